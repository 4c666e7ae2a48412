//! Edges and triangles of one radius against what is round: all points within a radius of a point or of a segment, balls and capsules.
//!
//! The deepest point is that next to the point or the segment, in closed form (Ericson, *Real-Time Collision Detection*, 2005,
//! sections 5.1.5 and 5.1.9).

use bevy::math::DVec3;

use super::feature::{Deepest, MIN_WEIGHT};
use super::line::ACCURACY;
use super::triangle::{self, Feature};
use super::{Kind, Shape};

/// A point of a triangle: its weights, and how far it is from the core.
type Found = ([f64; 3], f64);

impl Shape {
    /// The half length of the segment along y of which all is within a radius, m; `None` of what is not round.
    fn core(&self) -> Option<f64> {
        match self.0 {
            Kind::Ball { .. } => Some(0.0),
            Kind::Capsule { half_length, .. } => Some(half_length),
            _ => None,
        }
    }

    /// The deepest point of an edge, as [`deepest_on_edge`](Self::deepest_on_edge) finds it; `None` where there is no closed form.
    pub(super) fn deepest_of_round_edge(
        &self,
        ends: [DVec3; 2],
        radii: [f64; 2],
        within: f64,
    ) -> Option<Result<Deepest, f64>> {
        let half_length = self.core().filter(|_| radii[0] == radii[1])?;
        let axis = DVec3::Y * half_length;
        let [part, _] = triangle::nearest_parameters(ends, [-axis, axis]);
        let weights = [1.0 - part, part, 0.0];
        let nearest = self.nearest(ends[0].lerp(ends[1], part), 0.0);
        let gap = nearest.distance - radii[0];
        let is_inner = part > MIN_WEIGHT && part < 1.0 - MIN_WEIGHT && gap <= within;
        Some(if is_inner { Ok(Deepest { weights, gap, nearest }) } else { Err(gap - ACCURACY) })
    }

    /// The deepest point of a triangle within its edges, as [`deepest_on_triangle`](Self::deepest_on_triangle) finds it; `None` where
    /// there is no closed form.
    pub(super) fn deepest_of_round_triangle(
        &self,
        corners: [DVec3; 3],
        radii: [f64; 3],
        within: f64,
    ) -> Option<Result<Deepest, f64>> {
        let is_even = radii[0] == radii[1] && radii[0] == radii[2];
        let half_length = self.core().filter(|_| is_even)?;
        let (weights, is_face) = if half_length > 0.0 {
            nearest_to_segment(corners, DVec3::Y * half_length)?
        } else {
            let (weights, on) = triangle::nearest(DVec3::ZERO, corners);
            (weights, on == Feature::Face)
        };
        let point = corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2];
        let nearest = self.nearest(point, 0.0);
        let gap = nearest.distance - radii[0];
        let is_inner = is_face && weights.iter().all(|weight| *weight > MIN_WEIGHT);
        Some(if is_inner && gap <= within {
            Ok(Deepest { weights, gap, nearest })
        } else {
            Err(gap - ACCURACY)
        })
    }
}

/// The point of a triangle that is next to the segment from −`axis` to `axis`, and whether it is within the edges; `None` where the
/// segment passes through it.
fn nearest_to_segment(corners: [DVec3; 3], axis: DVec3) -> Option<([f64; 3], bool)> {
    if triangle::crossing(-axis, axis, corners).is_some() {
        return None;
    }
    let mut edge: Found = ([0.0; 3], f64::INFINITY);
    for first in 0..3 {
        let ends = [corners[first], corners[(first + 1) % 3]];
        let [part, along] = triangle::nearest_parameters(ends, [-axis, axis]);
        let apart = ends[0].lerp(ends[1], part).distance(axis * (2.0 * along - 1.0));
        if apart < edge.1 {
            let mut weights = [0.0; 3];
            (weights[first], weights[(first + 1) % 3]) = (1.0 - part, part);
            edge = (weights, apart);
        }
    }
    let ends = [-axis, axis].map(|end| {
        let (weights, on) = triangle::nearest(end, corners);
        let foot = corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2];
        (weights, if on == Feature::Face { foot.distance(end) } else { f64::INFINITY })
    });
    let [first, second] = ends;
    let inner = match (first.1 - second.1).abs() <= ACCURACY {
        // It lies flat on the triangle, all of it.
        true => ([0, 1, 2].map(|corner| 0.5 * (first.0[corner] + second.0[corner])), first.1),
        false if first.1 < second.1 => first,
        false => second,
    };
    // Where an edge is as near, that has the contact.
    let is_face = inner.1 < edge.1 - ACCURACY;
    Some((if is_face { inner.0 } else { edge.0 }, is_face))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn random(number: u32) -> impl FnMut() -> DVec3 {
        let mut seed = number.wrapping_mul(2_654_435_761).wrapping_add(1);
        let mut part = move || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(seed >> 8) / f64::from(1_u32 << 24) - 0.5
        };
        move || DVec3::new(part(), part(), part())
    }

    /// Radii that differ by a billionth of a metre leave the search without a closed form: it finds the same.
    #[test]
    fn the_closed_forms_find_what_the_search_finds() {
        let (mut edges, mut triangles) = (0, 0);
        for shape in [Shape::ball(0.3), Shape::capsule(0.1, 0.4), Shape::capsule(0.3, 0.05)] {
            for number in 0..2000 {
                let mut place = random(number);
                let corners = [place(), place(), place()].map(|corner| corner + 0.4 * DVec3::Z);
                let [even, uneven] = [[0.02; 3], [0.02, 0.02, 0.02 + 1e-9]];
                let ends = [corners[0], corners[2]];
                match [even, uneven].map(|radii| shape.deepest_on_edge(ends, [radii[0], radii[2]], 0.01)) {
                    [Ok(one), Ok(other)] => {
                        edges += 1;
                        assert!((one.gap - other.gap).abs() < 3e-8, "{shape:?} {ends:?}: {one:?}, {other:?}");
                    }
                    [Err(least), Ok(other)] | [Ok(other), Err(least)] => {
                        // At a corner, or at the limit.
                        let is_limit = other.weights.iter().any(|weight| (weight - MIN_WEIGHT).abs() < 1e-4)
                            || (other.gap - 0.01).abs() < 1e-6;
                        assert!(is_limit, "{shape:?} {ends:?}: {least}, {other:?}");
                    }
                    [Err(one), Err(other)] => {
                        assert!(one > other - 3e-8, "{shape:?} {ends:?}: {one}, {other}")
                    }
                }
                match [even, uneven].map(|radii| shape.deepest_on_triangle(corners, radii, 0.01)) {
                    [Ok(one), Ok(other)] => {
                        triangles += 1;
                        // The search is as accurate in the place of the line, not in that on the line.
                        assert!(
                            (-1e-4..3e-8).contains(&(one.gap - other.gap)),
                            "{shape:?} {corners:?}: {one:?}, {other:?}"
                        );
                    }
                    [Ok(one), Err(least)] => {
                        assert!(one.gap > least - 3e-8, "{shape:?} {corners:?}: {one:?}, {least}");
                    }
                    [Err(least), Ok(other)] => {
                        assert!(other.gap > least - 3e-8, "{shape:?} {corners:?}: {least}, {other:?}");
                    }
                    [Err(_), Err(_)] => {}
                }
            }
        }
        assert!(edges > 300 && triangles > 200, "{edges}, {triangles}");
    }

    #[test]
    fn a_triangle_across_the_end_of_a_capsule_touches_it_there_and_one_beside_it_at_its_middle() {
        let shape = Shape::capsule(0.1, 0.5);
        let at = |height: f64| {
            [DVec3::new(-2.0, height, -1.0), DVec3::new(2.0, height, -1.0), DVec3::new(0.0, height, 3.0)]
        };
        let found = shape.deepest_on_triangle(at(0.61), [0.05; 3], 0.0).unwrap();
        assert!(
            (found.gap + 0.04).abs() < 1e-8 && found.nearest.normal.distance(DVec3::Y) < 1e-12,
            "{found:?}"
        );
        assert!(shape.deepest_on_triangle(at(0.7), [0.05; 3], 0.0).is_err());
        let beside = at(0.0).map(|corner| DVec3::new(0.12, corner.x, corner.z));
        let found = shape.deepest_on_triangle(beside, [0.05; 3], 0.0).unwrap();
        assert!((found.gap + 0.03).abs() < 1e-8, "{found:?}");
        let point: DVec3 = (0..3).map(|corner| beside[corner] * found.weights[corner]).sum();
        assert!(point.distance(DVec3::X * 0.12) < 1e-9, "{point}");
    }
}
