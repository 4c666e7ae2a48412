//! Where a collider is: its pose and scale from the matrix of its entity.

use bevy::math::{Affine3A, Vec3};

use super::ColliderShape;
use crate::parameter::InvalidParameter;
use crate::solver::{Pose, Shape};

/// The cosine of the angle between two axes from which on they count as sheared.
const MAX_SHEAR: f32 = 1e-3;

/// Scales next to multiples of the inverse of this are taken for them.
const SCALE_STEPS: f32 = 4096.0;

/// A collider's pose, whatever its scale; `None` if it is not finite.
pub(crate) fn pose_of(frame: &Affine3A) -> Option<Pose> {
    let (_, rotation, point) = frame.to_scale_rotation_translation();
    (point.is_finite() && rotation.is_finite()).then_some(Pose { point, rotation })
}

impl ColliderShape {
    /// Its pose and its scale in the world; `is_flat`: seen by particles that move in the plane z = 0.
    ///
    /// # Errors
    /// What is wrong with its transform.
    pub(crate) fn place(&self, frame: &Affine3A, is_flat: bool) -> Result<(Pose, Vec3), String> {
        let pose = pose_of(frame).ok_or(match frame.is_finite() {
            true => "its scale is 0 along an axis",
            false => "its transform is not finite",
        })?;
        if *self == Self::HalfSpace {
            let seen = if is_flat { pose.of_half_space_in_plane() } else { Some(pose) };
            return Ok((seen.ok_or("it is parallel to the plane in which particles move")?, Vec3::ONE));
        }
        let (scale, ..) = frame.to_scale_rotation_translation();
        let [x, y, z] = [frame.matrix3.x_axis, frame.matrix3.y_axis, frame.matrix3.z_axis];
        let is_sheared = [(x, y), (y, z), (z, x)]
            .into_iter()
            .any(|(one, other)| one.dot(other).abs() > MAX_SHEAR * one.length() * other.length());
        if is_sheared {
            return Err("it is sheared by the scale of a parent".to_owned());
        }
        // The scale comes rounded from the matrix: what is one is taken for one, so that a turn builds nothing anew.
        let rounded = (scale * SCALE_STEPS).round() / SCALE_STEPS;
        let is_near = (scale - rounded).abs().max_element() <= 1e-5 * scale.abs().max_element();
        let point = if is_flat { pose.point.with_z(0.0) } else { pose.point };
        Ok((Pose { point, ..pose }, if is_near { rounded } else { scale }))
    }

    /// What the solver collides with, at a scale; `is_flat`: as seen by particles that move in the plane z = 0.
    pub(crate) fn build_for(&self, scale: Vec3, is_flat: bool) -> Result<Shape, InvalidParameter> {
        let built = self.build(scale);
        if is_flat { built.map(Shape::in_plane) } else { built }
    }
}
