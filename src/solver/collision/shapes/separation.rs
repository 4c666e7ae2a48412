//! The plane that parts a feature of a net from a triangle of a mesh.

use bevy::math::DVec3;

use super::triangle;

/// A distance below this part of the coordinates has no direction.
const TOUCHING: f64 = 1e-9;

/// The points of a feature and of a solid that are next to each other.
pub(super) struct Separation {
    /// From the solid to the feature.
    pub normal: DVec3,
    /// All of the solid is behind the plane through this point.
    pub foot: DVec3,
    /// The parts of the corners in the point of the feature.
    pub weights: [f64; 3],
    /// m.
    pub distance: f64,
}

/// The plane between a triangle and a feature; none where they cross.
pub(super) fn separation_from(corners: [DVec3; 3], count: usize, facet: [DVec3; 3]) -> Option<Separation> {
    let edges = |corners: [DVec3; 3]| [0, 1, 2].map(|edge| [corners[edge], corners[(edge + 1) % 3]]);
    let sides = if count == 2 { 1 } else { 3 };
    let crosses = |[from, to]: [DVec3; 2], corners| triangle::crossing(from, to, corners).is_some();
    if edges(corners)[..sides].iter().any(|edge| crosses(*edge, facet))
        || count == 3 && edges(facet).iter().any(|edge| crosses(*edge, corners))
    {
        return None;
    }
    let mut best: Option<(f64, [DVec3; 2], [f64; 3])> = None;
    let mut offer = |point: DVec3, foot: DVec3, weights: [f64; 3]| {
        let square = point.distance_squared(foot);
        if best.as_ref().is_none_or(|(least, ..)| square < *least) {
            best = Some((square, [point, foot], weights));
        }
    };
    for corner in 0..count {
        let mut weights = [0.0; 3];
        weights[corner] = 1.0;
        offer(corners[corner], triangle::nearest_point(corners[corner], facet).0, weights);
    }
    if count == 3 {
        for corner in facet {
            let (weights, _) = triangle::nearest(corner, corners);
            let [a, b, c] = corners;
            offer(a * weights[0] + b * weights[1] + c * weights[2], corner, weights);
        }
    }
    for (side, own) in edges(corners)[..sides].iter().enumerate() {
        for other in edges(facet) {
            let [part, across] = triangle::nearest_parameters(*own, other);
            let mut weights = [0.0; 3];
            (weights[side], weights[(side + 1) % 3]) = (1.0 - part, part);
            offer(own[0].lerp(own[1], part), other[0].lerp(other[1], across), weights);
        }
    }
    let (square, [point, foot], weights) = best?;
    let distance = square.sqrt();
    let size = point.abs().max(foot.abs()).max_element();
    let normal = if distance > TOUCHING * size {
        (point - foot) / distance
    } else {
        touching_normal(corners, count, facet)?
    };
    // By rounding a corner of the facet may be in front of that plane.
    let most = facet.iter().map(|corner| normal.dot(*corner - foot)).fold(0.0, f64::max);
    normal.is_finite().then_some(Separation { normal, foot: foot + normal * most, weights, distance })
}

/// The normal of the plane that parts a feature from a triangle that it touches: of the axes of the separating axis theorem (Gottschalk,
/// Lin and Manocha, *OBBTree*, SIGGRAPH 1996) that along which they overlap least. The nearest points are in one place there, and
/// what rounding leaves between them says nothing.
fn touching_normal(corners: [DVec3; 3], count: usize, facet: [DVec3; 3]) -> Option<DVec3> {
    let edges = |corners: [DVec3; 3]| [0, 1, 2].map(|edge| corners[(edge + 1) % 3] - corners[edge]);
    let (own, others) = (edges(corners), edges(facet));
    let own_face = (count == 3).then(|| own[0].cross(own[1]));
    let sides = if count == 2 { 1 } else { 3 };
    let across = own[..sides].iter().flat_map(|own| others.map(|other| own.cross(other)));
    let axes = [others[0].cross(others[1])].into_iter().chain(own_face).chain(across);
    let mut best: Option<(f64, DVec3)> = None;
    for axis in axes.filter_map(DVec3::try_normalize) {
        for axis in [axis, -axis] {
            let lowest =
                corners[..count].iter().map(|corner| axis.dot(*corner)).fold(f64::INFINITY, f64::min);
            let highest = facet.iter().map(|corner| axis.dot(*corner)).fold(f64::NEG_INFINITY, f64::max);
            if best.is_none_or(|(most, _)| lowest - highest > most) {
                best = Some((lowest - highest, axis));
            }
        }
    }
    best.map(|(_, axis)| axis)
}
