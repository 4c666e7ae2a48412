//! A shape at a place in the world, for queries of what is near.

use bevy::math::{DVec3, Quat, Vec2, Vec3};

use super::super::plane::Pose;
use super::{Crossing, Kind, Nearest, Placement, Shape};

/// The least sine of the angle between the normal of a half-space and the axis of depth, in two dimensions.
const MIN_SLOPE: f32 = 1e-3;

impl Pose {
    /// That of a half-space seen by particles that move in the plane z = 0; `None` if nothing of its normal remains.
    pub(crate) fn of_half_space_in_plane(self) -> Option<Self> {
        let normal = (self.rotation * Vec3::Y).truncate();
        let normal = (normal.length() > MIN_SLOPE).then(|| normal.normalize())?;
        let rotation = Quat::from_rotation_arc_2d(Vec2::Y, normal);
        Some(Self { point: self.point.with_z(0.0), rotation })
    }
}

/// A shape at a place in the world.
#[derive(Debug, Clone)]
pub(crate) struct PlacedShape {
    shape: Shape,
    placement: Placement,
}

impl PlacedShape {
    pub fn new(shape: Shape, pose: Pose) -> Self {
        Self { shape, placement: Placement::new(pose) }
    }

    /// How far a point is from its surface, m, negative inside, and the outward normal there.
    pub fn nearest(&self, point: DVec3) -> Nearest {
        let found = self.shape.nearest(self.placement.to_local(point), 0.0);
        Nearest { normal: self.placement.direction(&self.shape, found.normal), ..found }
    }

    /// Where a ball first touches it on the way of its centre; at time 0 where it does from the start.
    pub fn cast(&self, from: DVec3, to: DVec3, radius: f64) -> Option<Crossing> {
        let Self { shape, placement } = self;
        let [start, end] = [from, to].map(|end| placement.to_local(end));
        let Crossing { time, foot, normal } = shape.first_contact(start, end, radius)?;
        let facing = placement.direction(shape, normal);
        // In the plane the surface is as far away as it is in space, along the normal within the plane.
        let foot = match shape.0 {
            Kind::Flat(_) => from.lerp(to, time) - facing * (start.lerp(end, time) - foot).dot(normal),
            _ => placement.to_world(foot),
        };
        Some(Crossing { time, foot, normal: facing })
    }
}
