//! How the solver sees the world: from its own origin, and in two dimensions without depth.
//!
//! Far from the world's origin the coordinates of a `Transform` are coarse: 8 mm apart at 100 km. The solver measures
//! positions from an origin of its own, near the particles, where f32 is fine. A `Transform` is written as the
//! rounded sum of both; as long as it still is that sum, the solver's own position counts.

use bevy::math::{Affine3A, DVec3, Vec3A};
use bevy::prelude::*;

use crate::settings::Dimensions;
use crate::solver::{Collider, Pose};

use super::hierarchy::{to_local, to_world};

/// How far the particles may be from the solver's origin along an axis, m: f32 is 2 µm fine there.
const REACH: f32 = 32.0;

/// Origins are multiples of this, m, so that sums and differences with them are exact wherever f32 can hold them.
const ORIGIN_STEP: f32 = 16.0;

/// Number of particles, at most, by which an origin is chosen.
pub(super) const SAMPLE: usize = 16;

/// From the world to the solver and back.
#[derive(Debug, Clone, Copy)]
pub(super) struct View {
    /// Of the solver, m.
    pub origin: Vec3,
    /// Whether motion is in the plane z = 0.
    pub is_flat: bool,
}

impl View {
    pub fn new(origin: Vec3, dimensions: Dimensions) -> Self {
        Self { origin, is_flat: dimensions == Dimensions::Two }
    }

    /// In which dimensions particles move.
    pub fn dimensions(self) -> Dimensions {
        if self.is_flat { Dimensions::Two } else { Dimensions::Three }
    }

    /// A vector without the depth that it must not have.
    #[inline]
    pub fn flatten(self, vector: Vec3) -> Vec3 {
        if self.is_flat { vector.with_z(0.0) } else { vector }
    }

    /// A point of the world, seen by the solver.
    #[inline]
    pub fn to_solver(self, world: Vec3) -> Vec3 {
        self.flatten(world - self.origin)
    }

    /// A point of the solver, seen by the world, where it replaces `present`.
    #[inline]
    pub fn to_world(self, position: Vec3, present: Vec3) -> Vec3 {
        let world = position + self.origin;
        if self.is_flat { world.with_z(present.z) } else { world }
    }

    /// A parent's frame, seen by the solver.
    pub fn frame_to_solver(self, mut frame: Affine3A) -> Affine3A {
        frame.translation -= Vec3A::from(self.origin);
        frame
    }

    /// A point in a frame that the solver sees, seen by the solver.
    pub fn child_to_solver(self, frame: &Affine3A, local: Vec3) -> Vec3 {
        self.flatten(to_world(frame, local))
    }

    /// A point of the solver in a frame that it sees, where it replaces `present`.
    pub fn solver_to_child(self, frame: &Affine3A, position: Vec3, present: Vec3) -> Vec3 {
        if !self.is_flat {
            return to_local(frame, position);
        }
        let local = to_local(frame, position.with_z(to_world(frame, present).z));
        // Where x and y of the frame lie in the plane of motion, its z is the depth and stays to the bit.
        let is_upright = frame.matrix3.x_axis.z == 0.0 && frame.matrix3.y_axis.z == 0.0;
        if is_upright { local.with_z(present.z) } else { local }
    }

    /// A pose without the depth that it must not have; `None` if nothing of its normal remains.
    pub fn flatten_pose(self, pose: Pose) -> Option<Pose> {
        if self.is_flat { pose.of_half_space_in_plane() } else { Some(pose) }
    }

    /// A collider of the world, seen by the solver. A half-space is given by the point of its surface that is next to
    /// the solver's origin, since the coordinates of one far away would be coarse.
    pub fn collider_to_solver(self, collider: Collider) -> Collider {
        if self.origin == Vec3::ZERO {
            return collider;
        }
        let Collider { start, target, .. } = collider;
        if !collider.shape.is_half_space() {
            let [start, target] =
                [start, target].map(|pose| Pose { point: self.to_solver(pose.point), ..pose });
            return Collider { start, target, ..collider };
        }
        let [rotation, turned] = [start, target].map(|pose| pose.rotation.as_dquat().normalize());
        let normal = rotation * DVec3::Y;
        let origin = self.origin.as_dvec3();
        let from = start.point.as_dvec3() - origin;
        let foot = normal * from.dot(normal);
        // The same point of the body at the end of the tick.
        let arm = rotation.inverse() * (foot - from);
        let arrived = target.point.as_dvec3() - origin + turned * arm;
        Collider {
            start: Pose { point: foot.as_vec3(), ..start },
            target: Pose { point: if start == target { foot } else { arrived }.as_vec3(), ..target },
            ..collider
        }
    }
}

/// The origin for particles at these places of the world, of which there are at most [`SAMPLE`].
///
/// It is the present one as long as their median is near it: single particles that have gone astray do not matter. It
/// moves only where most particles gain by it, being much nearer to their median than that is to the present origin: it
/// does not follow a net that explodes.
pub(super) fn choose_origin(present: Vec3, places: impl Iterator<Item = Vec3>) -> Vec3 {
    let mut sample = [Vec3::ZERO; SAMPLE];
    let (mut count, mut are_near) = (0, true);
    for place in places.filter(|place| place.is_finite()).take(SAMPLE) {
        are_near &= (place - present).abs().cmple(Vec3::splat(REACH)).all();
        sample[count] = place;
        count += 1;
    }
    if are_near {
        return present;
    }
    let mut axes = [0, 1, 2].map(|axis| sample.map(|place| place[axis]));
    let mut origin = present.to_array();
    for (origin, axis) in origin.iter_mut().zip(&mut axes) {
        let axis = &mut axis[..count];
        axis.sort_unstable_by(f32::total_cmp);
        let median = axis[count / 2];
        let distance = (median - *origin).abs();
        let is_near = |coordinate: &&f32| (**coordinate - median).abs() <= (distance / 64.0).max(REACH);
        if distance > REACH && 2 * axis.iter().filter(is_near).count() > count {
            let rounded = (median / ORIGIN_STEP).round() * ORIGIN_STEP;
            *origin = if median.abs() <= REACH { 0.0 } else { rounded };
        }
    }
    Vec3::from_array(origin)
}

#[cfg(test)]
mod tests {
    use std::f32::consts::FRAC_PI_6;

    use super::*;
    use crate::solver::Shape;

    fn view(origin: Vec3, is_flat: bool) -> View {
        View { origin, is_flat }
    }

    #[test]
    fn the_origin_follows_the_median_and_stays_while_that_is_near() {
        let near = [Vec3::X * 30.0, Vec3::Y * -32.0, Vec3::ONE];
        assert_eq!(choose_origin(Vec3::ZERO, near.into_iter()), Vec3::ZERO);
        let far = Vec3::new(1e5, 3.0, -700.0);
        let astray = [far, far + Vec3::ONE, Vec3::splat(-1e9), Vec3::NAN, far - Vec3::ONE];
        let origin = choose_origin(Vec3::ZERO, astray.into_iter());
        assert_eq!(origin, Vec3::new(1e5, 0.0, -704.0));
        assert_eq!(choose_origin(origin, [far + Vec3::X * 30.0].into_iter()), origin);
        assert_eq!(choose_origin(origin, [Vec3::ONE].into_iter()), Vec3::ZERO);
        assert_eq!(choose_origin(origin, std::iter::empty()), origin);
        let exploding = [-1e6, 3e5, 2e5, -4e4].map(|x| Vec3::X * x);
        assert_eq!(choose_origin(Vec3::ZERO, exploding.into_iter()), Vec3::ZERO);
    }

    #[test]
    fn near_the_origin_of_the_world_nothing_is_rounded_and_far_away_only_what_is_written() {
        let place = Vec3::new(0.1, -3.7, 1e-9);
        let here = view(Vec3::ZERO, false);
        assert_eq!((here.to_solver(place), here.to_world(place, Vec3::ONE)), (place, place));
        let there = view(Vec3::X * 99_968.0, false);
        let written = there.to_world(place, Vec3::ZERO);
        // The coordinates of a Transform at 100 km are 1/128 m apart.
        assert!((there.to_solver(written) - place).abs().max_element() <= 0.5 / 128.0);
        assert_eq!(there.to_world(there.to_solver(written), Vec3::ZERO), written);
    }

    #[test]
    fn depth_stays_to_the_bit() {
        let flat = view(Vec3::ZERO, true);
        let present = Vec3::new(1.0, 2.0, 0.3);
        assert_eq!(flat.to_solver(present), Vec3::new(1.0, 2.0, 0.0));
        assert_eq!(flat.to_world(Vec3::new(3.0, 4.0, 0.0), present), Vec3::new(3.0, 4.0, 0.3));
        let frame = Transform::from_xyz(5.0, 6.0, 7.7).with_rotation(Quat::from_rotation_z(FRAC_PI_6));
        let frame = frame.with_scale(Vec3::new(2.0, 2.0, 3.3)).compute_affine();
        let local = flat.solver_to_child(&frame, Vec3::new(3.0, 4.0, 0.0), present);
        assert_eq!(local.z.to_bits(), present.z.to_bits());
        let back = flat.child_to_solver(&frame, local);
        assert!((back - Vec3::new(3.0, 4.0, 0.0)).length() < 1e-5 && back.z == 0.0);
    }

    #[test]
    fn a_plane_in_two_dimensions_is_where_it_cuts_the_plane_of_motion() {
        let flat = view(Vec3::ZERO, true);
        let rotation = Quat::from_rotation_y(0.4) * Quat::from_rotation_z(FRAC_PI_6);
        let found = flat.flatten_pose(Pose { point: Vec3::new(1.0, 2.0, 9.0), rotation }).unwrap();
        let expected = (rotation * Vec3::Y).truncate().normalize().extend(0.0);
        assert!((found.rotation * Vec3::Y).distance(expected) < 1e-6);
        assert_eq!((found.rotation * Vec3::Y).z, 0.0);
        let facing = Quat::from_rotation_x(std::f32::consts::FRAC_PI_2);
        assert_eq!(flat.flatten_pose(Pose { point: Vec3::ZERO, rotation: facing }), None);
    }

    /// A plane of 30° through the world's origin, seen from 100 km along it: its distance from there is exact to
    /// the 1e-7 of its rotation.
    #[test]
    fn a_plane_is_given_by_the_point_next_to_the_origin() {
        let rotation = Quat::from_rotation_z(FRAC_PI_6);
        let along = rotation * Vec3::X * 1e5;
        let origin = (along / 16.0).round() * 16.0;
        let pose = Pose { point: Vec3::ZERO, rotation };
        let moved = Pose { point: rotation * Vec3::Y * 0.5, rotation };
        let plane = Collider { target: moved, ..Collider::resting(Shape::HALF_SPACE, pose) };
        let seen = view(origin, false).collider_to_solver(plane);
        let normal = (rotation.as_dquat() * DVec3::Y).normalize();
        let distance = -origin.as_dvec3().dot(normal);
        assert!((seen.start.point.as_dvec3().dot(normal) - distance).abs() < 1e-5);
        // Coordinates of up to 64 m, each rounded by 4e-6 m.
        assert!((seen.target.point - seen.start.point - moved.point).length() < 2e-5);
        assert!(seen.start.point.length() < 100.0);
    }
}
