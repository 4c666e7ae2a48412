//! The first time at which an edge or a triangle of a net, its corners moving in straight lines, comes near a shape.
//!
//! A convex solid lies behind its tangent plane at the point nearest to the feature, and the height of each corner above a plane is a
//! linear function of time: until the first corner has reached the least height, no point of the feature is nearer. There the next plane
//! is found (conservative advancement, Mirtich 1996, with the separating axes of Gilbert, Johnson and Keerthi). Each triangle of a mesh
//! is such a solid. Features that overlap the solid at the start are ignored.

use bevy::math::DVec3;

use super::feature::MIN_WEIGHT;
use super::mesh::{Mesh, MeshKind};
use super::separation::{Separation, separation_from};
use super::tree::Bounds;
use super::{Kind, Nearest, Shape};

/// Displacement above which a feature is swept, as a fraction of its radius and of half the thickness of the shape.
const SWEEP_THRESHOLD: f64 = 0.5;

/// Number of planes, at most: a feature that grazes a surface for longer than that ends there.
const MAX_STEPS: usize = 48;

/// Distance that a feature keeps which is nearer than the least distance at the start, as a fraction of that at the start.
const KEPT_PART: f64 = 0.97;

/// A feature that ends at this fraction of the least distance, or farther, has not come too near: positions were rounded.
const TOLERATED_PART: f64 = 0.9;

/// Displacement that counts as none, as a fraction of the least distance.
const NEGLIGIBLE_DISPLACEMENT: f64 = 0.02;

/// The straight paths of the corners of an edge or a triangle in a substep, in the axes of a shape.
#[derive(Debug, Clone, Copy)]
pub(in crate::solver::collision) struct CornerPaths {
    /// m; of an edge the last corner is the one before.
    pub from: [DVec3; 3],
    /// m.
    pub to: [DVec3; 3],
    pub count: usize,
}

/// Where a feature comes near a shape.
#[derive(Debug, Clone, Copy)]
pub(in crate::solver::collision) struct Arrival {
    /// As a part of its way.
    pub time: f64,
    /// From the shape to it.
    pub normal: DVec3,
    /// The point of the shape next to it.
    pub foot: DVec3,
    /// The parts of the corners in its point next to the shape.
    pub weights: [f64; 3],
    /// How far it stays from the shape, m.
    pub limit: f64,
}

impl CornerPaths {
    pub fn at(&self, time: f64) -> [DVec3; 3] {
        [0, 1, 2].map(|corner| self.from[corner].lerp(self.to[corner], time))
    }

    /// The longest of them, m.
    pub fn longest(&self) -> f64 {
        (0..self.count).map(|corner| self.from[corner].distance(self.to[corner])).fold(0.0, f64::max)
    }

    /// Whether all corners stay at least so far, m, on one side of a plane.
    fn stay_on_one_side(&self, point: DVec3, normal: DVec3, least: f64) -> bool {
        let corners = self.from[..self.count].iter().chain(&self.to[..self.count]);
        let heights = || corners.clone().map(|corner| normal.dot(*corner - point));
        heights().all(|height| height >= least) || heights().all(|height| height <= -least)
    }

    fn in_part(&self, part: &super::Part) -> Self {
        let local = |corners: [DVec3; 3]| corners.map(|corner| part.placement.to_local(corner));
        Self { from: local(self.from), to: local(self.to), ..*self }
    }

    /// Time at which the primitive first is `least` m from the plane that `separation` returns, on the side to which `front` points, if
    /// that is given.
    fn advance(
        &self,
        least: f64,
        front: Option<DVec3>,
        separation: impl Fn([DVec3; 3]) -> Option<Separation>,
    ) -> Option<Arrival> {
        let longest = self.longest();
        // Written so that NaN takes this branch.
        if !(longest > 0.0 && longest.is_finite()) {
            return None;
        }
        let mut limit = least;
        let mut arrival: Option<Arrival> = None;
        let mut time = 0.0;
        for step in 0..=MAX_STEPS {
            let at = self.at(time);
            let Some(Separation { normal, foot, weights, distance }) = separation(at) else { return arrival };
            if front.is_some_and(|front| front.dot(normal) < -1e-6) {
                // What is behind comes out.
                return None;
            }
            if step == 0 {
                limit = least.min(KEPT_PART * distance);
            }
            let height = |corner: usize| normal.dot(at[corner] - foot);
            let gap = (0..self.count).map(height).fold(f64::INFINITY, f64::min);
            // For how long nothing is nearer than that: each corner stays as high, or, where the points that are next to each other
            // are not known well enough for a plane between the two, all displacements are as short.
            let until = |limit: f64| {
                let each = (0..self.count).map(|corner| {
                    let sink = -normal.dot(self.to[corner] - self.from[corner]);
                    if sink > 0.0 { (height(corner) - limit).max(0.0) / sink } else { f64::INFINITY }
                });
                match gap >= TOLERATED_PART * limit {
                    true => each.fold(f64::INFINITY, f64::min),
                    false => (distance - limit).max(0.0) / longest,
                }
            };
            if time + until(TOLERATED_PART * limit) >= 1.0 {
                return None;
            }
            arrival = Some(Arrival { time, normal, foot, weights, limit });
            let next = until(limit);
            if next * longest <= NEGLIGIBLE_DISPLACEMENT * limit || time + next >= 1.0 {
                return arrival;
            }
            time += next;
        }
        arrival
    }
}

impl Shape {
    /// Where a feature meets it between its corners, if it moves by more than half its thickness and half that of the shape;
    /// what meets it at a corner is left to that.
    pub(in crate::solver::collision) fn swept(
        &self,
        paths: &CornerPaths,
        radii: [f64; 3],
    ) -> Option<Arrival> {
        let radius = SWEEP_THRESHOLD * radii[0].min(radii[1]).min(radii[2]);
        if paths.longest() <= radius.max(SWEEP_THRESHOLD * self.half_thickness()) {
            return None;
        }
        let is_inner =
            |found: &Arrival| found.weights[..paths.count].iter().all(|weight| *weight > MIN_WEIGHT);
        self.arrival(paths, radius).filter(is_inner)
    }

    /// Where a feature comes as near as `least` m to it, or where it goes on from nearer than that; `None` if it never does.
    pub(in crate::solver::collision) fn arrival(&self, paths: &CornerPaths, least: f64) -> Option<Arrival> {
        match &self.0 {
            Kind::Mesh(mesh) => mesh.arrival(paths, least),
            Kind::Flat(shape) => shape.arrival(paths, least),
            Kind::Compound(parts) => first(parts.iter().filter_map(|part| {
                let found = part.shape.arrival(&paths.in_part(part), least)?;
                let normal = part.placement.rotation * found.normal;
                Some(Arrival { normal, foot: part.placement.to_world(found.foot), ..found })
            })),
            _ if self.is_passed_by(paths, least) => None,
            _ => paths.advance(least, None, |corners| self.separation(corners, paths.count)),
        }
    }

    /// Whether the plane next to one of the corners tells that nothing comes near.
    fn is_passed_by(&self, paths: &CornerPaths, least: f64) -> bool {
        paths.from[..paths.count].iter().any(|corner| {
            let nearest = self.nearest(*corner, 0.0);
            let foot = *corner - nearest.normal * nearest.distance;
            let is_high = |corner: &DVec3| nearest.normal.dot(*corner - foot) >= least;
            let ends = paths.from[..paths.count].iter().chain(&paths.to[..paths.count]);
            nearest.distance > 0.0 && { ends }.all(is_high)
        })
    }

    /// The plane between a convex shape and a feature.
    fn separation(&self, corners: [DVec3; 3], count: usize) -> Option<Separation> {
        let (weights, nearest) = match count {
            2 => self.nearest_of_edge([corners[0], corners[1]]),
            _ => self.nearest_of_triangle(corners),
        };
        let point = corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2];
        let foot = point - nearest.normal * nearest.distance;
        let Nearest { distance, normal } = nearest;
        (distance > 0.0).then_some(Separation { normal, foot, weights, distance })
    }
}

impl Mesh {
    fn arrival(&self, paths: &CornerPaths, least: f64) -> Option<Arrival> {
        let ends = paths.from.iter().chain(&paths.to);
        let bounds = ends.fold(Bounds::EMPTY, |all, corner| all.with(corner.as_vec3()));
        let size = bounds.low.abs().max(bounds.high.abs()).max_element();
        let mut found: Option<Arrival> = None;
        self.overlapping(&bounds.grown(least as f32 + 8.0 * f32::EPSILON * size), |_, facet| {
            let front = (facet[1] - facet[0]).cross(facet[2] - facet[0]).try_normalize();
            if front.is_some_and(|normal| paths.stay_on_one_side(facet[0], normal, least)) {
                return;
            }
            let front = front.filter(|_| self.kind != MeshKind::TwoSided);
            let arrival = paths.advance(least, front, |corners| separation_from(corners, paths.count, facet));
            found = first(found.into_iter().chain(arrival));
        });
        found
    }
}

/// The one that comes first.
fn first(arrivals: impl Iterator<Item = Arrival>) -> Option<Arrival> {
    arrivals.reduce(|one, other| if other.time < one.time { other } else { one })
}

#[cfg(test)]
mod tests {
    use bevy::math::{Quat, Vec3};

    use super::super::mesh::tests::box_mesh;
    use super::*;

    const TRIANGLE: [DVec3; 3] =
        [DVec3::new(-0.3, 0.0, -0.2), DVec3::new(0.4, 0.0, -0.1), DVec3::new(0.0, 0.0, 0.5)];

    fn fall(height: f64, displacement: DVec3, turn: Quat, count: usize) -> CornerPaths {
        let mut from = TRIANGLE.map(|corner| turn.as_dquat() * corner + DVec3::Y * height);
        if count == 2 {
            from[2] = from[1];
        }
        CornerPaths { from, to: from.map(|corner| corner + displacement), count }
    }

    /// The least gap at a time, by points all over the feature.
    fn gap(shape: &Shape, corners: [DVec3; 3]) -> f64 {
        let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
        let mut least = shape.nearest(middle, 0.0).distance;
        if least > 0.8 {
            return least;
        }
        for one in 0..=24 {
            for other in 0..=24 - one {
                let [v, w] = [one, other].map(|part| f64::from(part) / 24.0);
                let point = corners[0] * (1.0 - v - w) + corners[1] * v + corners[2] * w;
                least = least.min(shape.nearest(point, 0.0).distance);
            }
        }
        least
    }

    #[test]
    fn a_feature_stops_in_front_of_each_shape_and_never_stops_where_it_passes() {
        let (vertices, triangles) = box_mesh();
        let shapes = [
            Shape::ball(0.2),
            Shape::capsule(0.02, 0.6),
            Shape::cuboid(Vec3::new(1.0, 0.001, 1.0)),
            Shape::frustum([0.3, 0.0], 0.2),
            Shape::mesh(&vertices, &triangles, false).unwrap(),
            Shape::mesh(&[Vec3::X, Vec3::Z, Vec3::NEG_X], &[[0, 1, 2]], false).unwrap(),
            Shape::compound([(Vec3::Y * 0.1, Quat::from_rotation_z(0.4), Shape::cuboid(Vec3::splat(0.2)))]),
        ];
        let least = 1e-3;
        let mut counts = [0; 2];
        for shape in &shapes {
            for number in 0..120_u32 {
                let part = |scale: u32| (number * scale % 101) as f32 / 101.0 - 0.5;
                let turn =
                    Quat::from_euler(bevy::math::EulerRot::XYZ, 6.0 * part(13), 6.0 * part(29), part(7));
                let displacement = DVec3::new(f64::from(part(37)), -60.0, f64::from(part(53)));
                let count = 2 + (number % 2) as usize;
                let mut paths = fall(3.0 + f64::from(part(17)), displacement, turn, count);
                let aside = DVec3::new(f64::from(2.0 * part(71)), 0.0, f64::from(2.0 * part(83)));
                (paths.from, paths.to) = (paths.from.map(|at| at + aside), paths.to.map(|at| at + aside));
                // Where it first comes near, by small steps.
                let times = (0..=2000).map(|step| f64::from(step) / 20_000.0);
                let coarse = { times }.find(|time| gap(shape, paths.at(*time)) <= 0.5 * least);
                let found = shape.arrival(&paths, least);
                counts[usize::from(found.is_some())] += 1;
                match (found, coarse) {
                    (Some(found), _) => {
                        let there = gap(shape, paths.at(found.time));
                        assert!(there >= 0.9 * least, "{shape:?} {number}: {there}");
                        assert!(coarse.is_none_or(|time| found.time <= time), "{shape:?} {number}");
                        // Points of a grid are next to what it meets, or a few cells away.
                        assert!(there < 0.05, "{shape:?} {number}: stopped {there} m before");
                    }
                    (None, Some(time)) => panic!("{shape:?} {number}: passes at {time}"),
                    (None, None) => {}
                }
            }
        }
        assert!(counts.iter().all(|count| *count > 100), "{counts:?}");
    }

    #[test]
    fn what_is_inside_or_behind_is_left_alone() {
        let out = fall(0.0, DVec3::Y * 9.0, Quat::IDENTITY, 3);
        assert!(Shape::ball(1.0).arrival(&out, 1e-3).is_none());
        let (vertices, triangles) = box_mesh();
        let shape = Shape::mesh(&vertices, &triangles, false).unwrap();
        let small = |corner: DVec3| corner * 0.1;
        let out = CornerPaths { from: out.from.map(small), to: out.to, ..out };
        assert!(shape.arrival(&out, 1e-3).is_none());
    }

    /// What has no thickness comes up to the surface itself: a triangle over the apex of a pyramid, and an edge across it, are parted from
    /// it by a plane that faces up and that the apex is not in front of.
    #[cfg(feature = "parry")]
    #[test]
    fn what_touches_without_a_distance_is_parted_by_a_plane() {
        let apex = Vec3::Y * 0.2;
        let base = [Vec3::new(-0.2, -0.15, -0.2), Vec3::new(0.2, -0.15, -0.2), Vec3::new(0.0, -0.15, 0.2)];
        let pyramid = Shape::convex_hull(&[base[0], base[1], base[2], apex]).unwrap();
        let mut met = 0;
        for number in 0..400_u32 {
            let part = |scale: u32| f64::from(number * scale % 101) / 101.0 - 0.5;
            let from = TRIANGLE.map(|corner| {
                let tilt = 0.3 * (corner.x * part(13) + corner.z * part(29));
                DVec3::new(corner.x + 0.1 * part(37), 0.201 + tilt, corner.z + 0.1 * part(53))
            });
            let count = 2 + (number % 2) as usize;
            let from = if count == 2 { [from[0], from[2], from[2]] } else { from };
            let paths = CornerPaths { from, to: from.map(|corner| corner - DVec3::Y * 0.01), count };
            let Some(Arrival { normal, foot, .. }) = pyramid.arrival(&paths, 0.0) else { continue };
            met += 1;
            let apex_height = (apex.as_dvec3() - foot).dot(normal);
            assert!(apex_height < 1e-6 && apex_height > -0.36, "{number}: {normal}, {apex_height}");
            assert!(normal.y > 0.3, "{number}: {normal}");
        }
        assert!(met > 100, "{met}");
    }
}
