//! Shapes of colliders from Bevy's primitives.

use bevy::prelude::*;

use super::{ColliderShape, ParticleCollider};

impl<T: Into<ColliderShape>> From<T> for ParticleCollider {
    fn from(shape: T) -> Self {
        Self::new(shape)
    }
}

impl From<Sphere> for ColliderShape {
    fn from(Sphere { radius }: Sphere) -> Self {
        Self::Sphere { radius }
    }
}

impl From<Cuboid> for ColliderShape {
    fn from(Cuboid { half_size }: Cuboid) -> Self {
        Self::Cuboid { half_size }
    }
}

impl From<Capsule3d> for ColliderShape {
    fn from(Capsule3d { radius, half_length }: Capsule3d) -> Self {
        Self::Capsule { radius, half_length }
    }
}

impl From<Cylinder> for ColliderShape {
    fn from(Cylinder { radius, half_height }: Cylinder) -> Self {
        Self::Cylinder { radius, half_height }
    }
}

impl From<Cone> for ColliderShape {
    fn from(Cone { radius, height }: Cone) -> Self {
        Self::Cone { radius, height }
    }
}

impl From<ConicalFrustum> for ColliderShape {
    fn from(ConicalFrustum { radius_top, radius_bottom, height }: ConicalFrustum) -> Self {
        Self::ConicalFrustum { radius_top, radius_bottom, height }
    }
}

impl From<Circle> for ColliderShape {
    fn from(Circle { radius }: Circle) -> Self {
        Self::Sphere { radius }
    }
}

impl From<Capsule2d> for ColliderShape {
    fn from(Capsule2d { radius, half_length }: Capsule2d) -> Self {
        Self::Capsule { radius, half_length }
    }
}

/// A box that is deeper than it is wide and high: what is in it leaves by a side.
impl From<Rectangle> for ColliderShape {
    fn from(Rectangle { half_size }: Rectangle) -> Self {
        Self::Cuboid { half_size: half_size.extend(half_size.element_sum()) }
    }
}

/// The prism above and below it.
impl From<Triangle2d> for ColliderShape {
    fn from(Triangle2d { vertices }: Triangle2d) -> Self {
        prism(&vertices)
    }
}

/// The prism above and below it.
impl From<RegularPolygon> for ColliderShape {
    fn from(polygon: RegularPolygon) -> Self {
        prism(&polygon.vertices(0.0).into_iter().collect::<Vec<Vec2>>())
    }
}

fn prism(corners: &[Vec2]) -> ColliderShape {
    let depth = corners.iter().map(|corner| corner.length()).fold(0.0, f32::max) * 2.0;
    let ends = corners.iter().flat_map(|corner| [corner.extend(-depth), corner.extend(depth)]);
    ColliderShape::ConvexHull { points: ends.collect() }
}
