//! The deepest point of an edge or a triangle of a net in a shape.
//!
//! The distance from a convex solid is a convex function, also inside, and its slope is the normal (Boyd and Vandenberghe,
//! *Convex Optimization*, 2004, section 8.1). So along an edge the deepest point is where the slope changes its sign
//! (`line.rs`). A triangle is searched in lines along one of its edges: the least of each is convex again.
//! Against a mesh each of its edges and corners is tested.
//!
//! Corners of the net are spheres of their own: where the deepest point is a corner, or an edge of a triangle, that has the contact.

use bevy::math::DVec3;

use super::line::{ACCURACY, Line, least_of_tangents, next_place};
use super::mesh::Mesh;
use super::tree::Bounds;
use super::triangle::{self, Feature};
use super::{Kind, Nearest, Shape};

/// A weight below this is none.
pub(super) const MIN_WEIGHT: f64 = 1e-3;

/// Number of lines of a triangle that are searched.
const MAX_LINES: usize = 24;

/// A point of an edge or a triangle, and the surface next to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::solver) struct Deepest {
    /// The parts of the corners in it.
    pub weights: [f64; 3],
    /// Distance from the surface less the radius there, m.
    pub gap: f64,
    pub nearest: Nearest,
}

impl Shape {
    /// The deepest point of an edge between its ends, with a radius that varies linearly from one to the other, m; where its surface
    /// is not farther than `within` m.
    ///
    /// # Errors
    /// Where there is none: a gap, m, below which no point of the edge is, its ends included; −∞ if none is known.
    pub(in crate::solver) fn deepest_on_edge(
        &self,
        ends: [DVec3; 2],
        radii: [f64; 2],
        within: f64,
    ) -> Result<Deepest, f64> {
        match &self.0 {
            Kind::Mesh(mesh) => mesh.deepest_on_edge(ends, radii, within),
            Kind::Flat(shape) => shape.deepest_on_edge(ends, radii, within),
            Kind::Compound(parts) => least(parts.iter().map(|part| {
                let ends = ends.map(|end| part.placement.to_local(end));
                part.turn(part.shape.deepest_on_edge(ends, radii, within))
            })),
            _ => {
                if let Some(found) = self.deepest_of_round_edge(ends, radii, within) {
                    return found;
                }
                let line = Line { shape: self, ends, radii };
                let half = 0.5 * ends[0].distance(ends[1]);
                let least = line.at(0.5).gap - half - 0.5 * (radii[0] - radii[1]).abs();
                if least > within {
                    return Err(least);
                }
                let found = line.deepest(within)?;
                let is_inner = found.weights[..2].iter().all(|weight| *weight > MIN_WEIGHT);
                if is_inner && found.gap <= within { Ok(found) } else { Err(found.gap - ACCURACY) }
            }
        }
    }

    /// The deepest point of a triangle within its edges; as above.
    pub(in crate::solver) fn deepest_on_triangle(
        &self,
        corners: [DVec3; 3],
        radii: [f64; 3],
        within: f64,
    ) -> Result<Deepest, f64> {
        match &self.0 {
            Kind::HalfSpace => Err(f64::NEG_INFINITY),
            Kind::Mesh(mesh) => mesh.deepest_on_triangle(corners, radii, within),
            Kind::Flat(shape) => shape.deepest_on_triangle(corners, radii, within),
            Kind::Compound(parts) => least(parts.iter().map(|part| {
                let corners = corners.map(|corner| part.placement.to_local(corner));
                part.turn(part.shape.deepest_on_triangle(corners, radii, within))
            })),
            _ => self
                .deepest_of_round_triangle(corners, radii, within)
                .unwrap_or_else(|| self.deepest_of_convex(corners, radii, within)),
        }
    }

    fn deepest_of_convex(&self, corners: [DVec3; 3], radii: [f64; 3], within: f64) -> Result<Deepest, f64> {
        let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
        let radius = (radii[0] + radii[1] + radii[2]) / 3.0;
        let nearest = self.nearest(middle, 0.0);
        // The tangent there lies below the distance.
        let tangent =
            |corner: usize| nearest.distance + nearest.normal.dot(corners[corner] - middle) - radii[corner];
        let least = tangent(0).min(tangent(1)).min(tangent(2));
        let least = least.max(nearest.distance - radius - reach(corners, middle));
        if least > within {
            return Err(least);
        }
        let line = |part: f64| {
            let ends = [corners[0].lerp(corners[2], part), corners[1].lerp(corners[2], part)];
            let radius = |corner: usize| radii[corner] + part * (radii[2] - radii[corner]);
            Line { shape: self, ends, radii: [radius(0), radius(1)] }
        };
        // How the least of a line changes from line to line.
        let slope = |(found, gradient): &(Deepest, DVec3)| {
            let across = corners[2] - corners[0] * found.weights[0] - corners[1] * found.weights[1];
            let thickening = radii[2] - radii[0] * found.weights[0] - radii[1] * found.weights[1];
            gradient.dot(across) - thickening
        };
        let (mut from, mut to) = (0.0, 1.0);
        let (first, last) = (line(0.0).least(), line(1.0 - MIN_WEIGHT).least());
        let (mut low, mut high) = ((first.0.gap, slope(&first)), (last.0.gap, slope(&last)));
        let at_corner = low.0.min(high.0);
        if low.1 >= 0.0 || high.1 <= 0.0 {
            return Err(least);
        }
        let mut best: Option<(f64, Deepest)> = None;
        for number in 0..MAX_LINES {
            let bound = least_of_tangents([from, to], [low, high]);
            if bound > within.min(at_corner - ACCURACY) {
                return Err(least);
            }
            if best.as_ref().is_some_and(|(_, best)| best.gap <= bound + ACCURACY) {
                break;
            }
            let middle = next_place([from, to], [low, high], number);
            let found = line(middle).least();
            let steepness = slope(&found);
            let (found, _) = found;
            if best.as_ref().is_none_or(|(_, best)| found.gap < best.gap) {
                best = Some((middle, found));
            }
            if steepness < 0.0 {
                (from, low) = (middle, (found.gap, steepness));
            } else {
                (to, high) = (middle, (found.gap, steepness));
            }
        }
        let (part, found) = best.ok_or(f64::NEG_INFINITY)?;
        let [first, second, _] = found.weights;
        let weights = [first * (1.0 - part), second * (1.0 - part), part];
        let is_inner = weights.iter().all(|weight| *weight > MIN_WEIGHT);
        match is_inner && found.gap <= within {
            true => Ok(Deepest { weights, ..found }),
            // A line ends at its edge, of which another point may be deeper.
            false => Err(least),
        }
    }
}

impl super::Part {
    /// What its shape has found, in the axes of the compound.
    fn turn(&self, found: Result<Deepest, f64>) -> Result<Deepest, f64> {
        found.map(|found| {
            let normal = self.placement.rotation * found.nearest.normal;
            Deepest { nearest: Nearest { normal, ..found.nearest }, ..found }
        })
    }
}

impl Shape {
    /// The point of an edge, ends included, that is next to a convex shape.
    pub(super) fn nearest_of_edge(&self, ends: [DVec3; 2]) -> ([f64; 3], Nearest) {
        let (found, _) = Line { shape: self, ends, radii: [0.0; 2] }.least();
        (found.weights, found.nearest)
    }

    /// The point of a triangle, edges included, that is next to a convex shape.
    pub(super) fn nearest_of_triangle(&self, corners: [DVec3; 3]) -> ([f64; 3], Nearest) {
        if let Ok(found) = self.deepest_of_convex(corners, [0.0; 3], f64::INFINITY) {
            return (found.weights, found.nearest);
        }
        let edges = [0, 1, 2].map(|edge| {
            let other = (edge + 1) % 3;
            let (parts, nearest) = self.nearest_of_edge([corners[edge], corners[other]]);
            let mut weights = [0.0; 3];
            (weights[edge], weights[other]) = (parts[0], parts[1]);
            (weights, nearest)
        });
        let [first, second, third] = edges;
        let nearer = |one: ([f64; 3], Nearest), other: ([f64; 3], Nearest)| {
            if other.1.distance < one.1.distance { other } else { one }
        };
        nearer(nearer(first, second), third)
    }
}

/// How far the corners are from a point, m.
fn reach(corners: [DVec3; 3], middle: DVec3) -> f64 {
    corners.iter().map(|corner| corner.distance_squared(middle)).fold(0.0, f64::max).sqrt()
}

/// The deepest of what was found, or the least of the bounds.
fn least(found: impl Iterator<Item = Result<Deepest, f64>>) -> Result<Deepest, f64> {
    let found = found.reduce(|one, other| match (one, other) {
        (Ok(one), Ok(other)) => Ok(if other.gap < one.gap { other } else { one }),
        (Err(one), Err(other)) => Err(one.min(other)),
        (found @ Ok(_), _) | (_, found) => found,
    });
    found.unwrap_or(Err(f64::INFINITY))
}

impl Mesh {
    /// The bounds of a feature and of what is within `reach` m of it; if nothing of the mesh is nearer than its size, an error:
    /// a bound of its gaps, m.
    fn bounds_of_feature(&self, corners: &[DVec3], reach: f64, within: f64) -> Result<Bounds, f64> {
        let bounds = corners.iter().fold(Bounds::EMPTY, |all, corner| all.with(corner.as_vec3()));
        let size = 0.5 * (bounds.high - bounds.low).max_element();
        let near = bounds.grown(1.01 * (reach + within) as f32 + 1e-6);
        if self.any_overlapping(&near.grown(size)) { Ok(near) } else { Err(within + f64::from(size)) }
    }

    fn deepest_on_edge(&self, ends: [DVec3; 2], radii: [f64; 2], within: f64) -> Result<Deepest, f64> {
        let bounds = self.bounds_of_feature(&ends, radii[0].max(radii[1]), within)?;
        self.deepest_near_edge(&bounds, ends, radii, within).ok_or(f64::NEG_INFINITY)
    }

    fn deepest_near_edge(
        &self,
        bounds: &Bounds,
        ends: [DVec3; 2],
        radii: [f64; 2],
        within: f64,
    ) -> Option<Deepest> {
        // The nearest pair of edges; and the first and last crossing of a triangle.
        let mut best: Option<(f64, f64)> = None;
        let mut crossings = [f64::INFINITY, f64::NEG_INFINITY];
        self.overlapping(bounds, |_, corners| {
            if let Some((time, _)) = triangle::crossing(ends[0], ends[1], corners) {
                crossings = [crossings[0].min(time), crossings[1].max(time)];
            }
            for side in 0..3 {
                let other = [corners[side], corners[(side + 1) % 3]];
                if !bounds.overlaps(&Bounds::EMPTY.with(other[0].as_vec3()).with(other[1].as_vec3())) {
                    continue;
                }
                let [part, across] = triangle::nearest_parameters(ends, other);
                let apart = ends[0].lerp(ends[1], part).distance(other[0].lerp(other[1], across));
                let gap = apart - (radii[0] + part * (radii[1] - radii[0]));
                if best.is_none_or(|(least, known)| (gap, part) < (least, known)) {
                    best = Some((gap, part));
                }
            }
        });
        let part = match crossings[1] > crossings[0] {
            true => 0.5 * (crossings[0] + crossings[1]),
            false if crossings[0].is_finite() => return None,
            false => best.filter(|(gap, _)| *gap <= within)?.1,
        };
        if !(MIN_WEIGHT..=1.0 - MIN_WEIGHT).contains(&part) {
            return None;
        }
        let nearest = self.nearest(ends[0].lerp(ends[1], part), 0.0);
        let gap = nearest.distance - (radii[0] + part * (radii[1] - radii[0]));
        (gap <= within).then_some(Deepest { weights: [1.0 - part, part, 0.0], gap, nearest })
    }

    fn deepest_on_triangle(&self, corners: [DVec3; 3], radii: [f64; 3], within: f64) -> Result<Deepest, f64> {
        let bounds = self.bounds_of_feature(&corners, radii[0].max(radii[1]).max(radii[2]), within)?;
        self.deepest_near_triangle(&bounds, corners, radii, within).ok_or(f64::NEG_INFINITY)
    }

    fn deepest_near_triangle(
        &self,
        bounds: &Bounds,
        corners: [DVec3; 3],
        radii: [f64; 3],
        within: f64,
    ) -> Option<Deepest> {
        let mut best: Option<(f64, DVec3)> = None;
        self.overlapping(bounds, |_, facet| {
            for corner in facet.into_iter().filter(|corner| bounds.contains_point(corner.as_vec3())) {
                let (foot, feature) = triangle::nearest_point(corner, corners);
                let apart = foot.distance(corner);
                if feature == Feature::Face && best.as_ref().is_none_or(|(least, _)| apart < *least) {
                    best = Some((apart, foot));
                }
            }
        });
        let (_, foot) = best?;
        let weights = barycentric(foot, corners)?;
        let radius: f64 = weights.iter().zip(radii).map(|(weight, radius)| weight * radius).sum();
        let nearest = self.nearest(foot, 0.0);
        let gap = nearest.distance - radius;
        let is_inner = weights.iter().all(|weight| *weight > MIN_WEIGHT);
        (is_inner && gap <= within).then_some(Deepest { weights, gap, nearest })
    }
}

/// The weights of a point of a triangle (Ericson, *Real-Time Collision Detection*, 2005, section 3.4).
fn barycentric(point: DVec3, [a, b, c]: [DVec3; 3]) -> Option<[f64; 3]> {
    let (ab, ac, ap) = (b - a, c - a, point - a);
    let (d00, d01, d11) = (ab.dot(ab), ab.dot(ac), ac.dot(ac));
    let (d20, d21) = (ap.dot(ab), ap.dot(ac));
    let area = d00 * d11 - d01 * d01;
    if area <= 0.0 {
        return None;
    }
    let (v, w) = ((d11 * d20 - d01 * d21) / area, (d00 * d21 - d01 * d20) / area);
    Some([1.0 - v - w, v, w])
}

#[cfg(test)]
mod tests {
    use bevy::math::Vec3;

    use super::*;

    /// The least gap of an edge, by brute force.
    fn brute(shape: &Shape, ends: [DVec3; 2], radii: [f64; 2]) -> f64 {
        let parts = (0..=20_000).map(|part| f64::from(part) / 20_000.0);
        let gap = |part: f64| {
            shape.nearest(ends[0].lerp(ends[1], part), 0.0).distance - radii[0] - part * (radii[1] - radii[0])
        };
        parts.map(gap).fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn an_edge_is_deepest_where_no_other_point_is_deeper() {
        let shapes = [
            Shape::ball(0.5),
            Shape::capsule(0.1, 0.4),
            Shape::cuboid(Vec3::new(0.3, 0.5, 0.2)),
            Shape::frustum([0.4, 0.1], 0.5),
        ];
        let mut found = 0;
        for shape in &shapes {
            for number in 0..200_u32 {
                let part = |scale: u32| f64::from(number * scale % 101) / 101.0 - 0.5;
                let ends = [DVec3::new(-0.9, part(13), part(29)), DVec3::new(0.9, part(37), 1.5 * part(53))];
                let radii = [0.05, 0.02];
                let expected = brute(shape, ends, radii);
                match shape.deepest_on_edge(ends, radii, 0.01) {
                    Ok(deepest) => {
                        found += 1;
                        assert!(
                            (-1e-4..1e-6).contains(&(deepest.gap - expected)),
                            "{shape:?} {ends:?}: {deepest:?}, {expected}"
                        );
                    }
                    Err(least) => {
                        assert!(expected > 0.01 - 1e-6, "{shape:?} {ends:?}: {expected}");
                        assert!(expected > least - 1e-6, "{shape:?} {ends:?}: {expected}, {least}");
                    }
                }
            }
        }
        assert!(found > 200, "{found}");
    }

    #[test]
    fn the_corner_of_a_box_is_found_under_a_triangle() {
        let turn = DVec3::ONE.normalize();
        let shape = Shape::cuboid(Vec3::splat(0.5));
        let corner = DVec3::splat(0.5);
        // A triangle across the diagonal, a little below the corner.
        let across = turn.any_orthonormal_vector();
        let other = turn.cross(across);
        let middle = corner - turn * 0.02;
        let corners = [middle + across, middle - across * 0.5 + other, middle - across * 0.5 - other];
        let found = shape.deepest_on_triangle(corners, [0.01; 3], 0.0).unwrap();
        // The middle is 0.02/√3 below each of three faces.
        let expected = -0.02 / 3.0_f64.sqrt() - 0.01;
        // Along the ridges the slope changes by jumps: what is found is not as deep, by a few per cent.
        assert!((0.0..0.04).contains(&((found.gap - expected) / -expected)), "{found:?}, not {expected}");
        assert!(found.weights.iter().all(|weight| (weight - 1.0 / 3.0).abs() < 0.02), "{found:?}");
        let above = corners.map(|corner| corner + turn * 0.05);
        assert!(shape.deepest_on_triangle(above, [0.01; 3], 0.0).is_err());
        let flat = [DVec3::new(-0.4, 0.5, -0.4), DVec3::new(0.4, 0.5, -0.4), DVec3::new(0.0, 0.5, 0.4)];
        assert!(shape.deepest_on_triangle(flat, [0.01; 3], 0.0).is_err(), "its corners lie on it");
    }

    #[test]
    fn a_thin_pole_of_triangles_is_found_between_two_particles() {
        let side = 0.02;
        let vertices: Vec<Vec3> = (0..6)
            .map(|corner| {
                let (sin, cos) = bevy::math::ops::sin_cos(2.1 * (corner % 3) as f32);
                Vec3::new(side * cos, if corner < 3 { -1.0 } else { 1.0 }, side * sin)
            })
            .collect();
        let triangles =
            [[0, 1, 2], [3, 5, 4], [0, 3, 1], [1, 3, 4], [1, 4, 2], [2, 4, 5], [2, 5, 0], [0, 5, 3]];
        let pole = Shape::mesh(&vertices, &triangles, false).unwrap();
        let ends = [DVec3::new(-0.5, 0.1, 0.025), DVec3::new(0.5, 0.1, 0.025)];
        let beside = pole.deepest_on_edge(ends, [0.01; 2], 0.0).unwrap();
        assert!(beside.gap < 0.0 && beside.nearest.normal.z > 0.3, "{beside:?}");
        let through = pole.deepest_on_edge(ends.map(|end| end - DVec3::Z * 0.02), [0.01; 2], 0.0).unwrap();
        assert!(through.nearest.distance < 0.0, "{through:?}");
        assert!(pole.deepest_on_edge(ends.map(|end| end + DVec3::Z * 0.05), [0.01; 2], 0.0).is_err());
    }
}
