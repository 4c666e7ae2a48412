//! The geometry of a collider.

use bevy::math::DVec3;
use bevy::prelude::*;

use super::list::SharedList;

/// The shape of a [`ParticleCollider`](crate::ParticleCollider), in its own axes.
///
/// The big ones (points, vertices, heights) are shared by all copies.
#[derive(Reflect, Debug, Clone, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(deny_unknown_fields))]
#[reflect(opaque)]
#[reflect(Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[non_exhaustive]
pub enum ColliderShape {
    /// All below y = 0.
    #[default]
    HalfSpace,
    /// A ball.
    Sphere {
        /// m, > 0.
        radius: f32,
    },
    /// All within a distance of a segment along y.
    Capsule {
        /// The distance, m, > 0.
        radius: f32,
        /// Half the length of the segment, m, > 0.
        half_length: f32,
    },
    /// A box.
    Cuboid {
        /// m, each > 0.
        half_size: Vec3,
    },
    /// A cylinder along y.
    Cylinder {
        /// m, > 0.
        radius: f32,
        /// m, > 0.
        half_height: f32,
    },
    /// A cone along y with its tip at half its height above the centre.
    Cone {
        /// Of its base, m, > 0.
        radius: f32,
        /// m, > 0.
        height: f32,
    },
    /// A cone along y without its tip.
    ConicalFrustum {
        /// m, >= 0, and one of the two > 0.
        radius_top: f32,
        /// m, >= 0.
        radius_bottom: f32,
        /// m, > 0.
        height: f32,
    },
    /// The smallest convex solid that holds all points (feature `parry`).
    ConvexHull {
        /// m; not all in one plane.
        points: SharedList<Vec3>,
    },
    /// Triangles. A closed mesh is a solid; another one is a sheet that is met from both sides, unless it is one-sided.
    Mesh {
        /// m.
        vertices: SharedList<Vec3>,
        /// The corners of each triangle, counterclockwise seen from outside.
        triangles: SharedList<[u32; 3]>,
        /// Of a mesh that is not closed: all behind it is solid. Default false.
        #[cfg_attr(feature = "serialize", serde(default, skip_serializing_if = "is_false"))]
        one_sided: bool,
    },
    /// Ground: all below a surface with heights given at the corners of a grid.
    HeightField {
        /// Along x and z, m, > 0. It is centred.
        size: Vec2,
        /// Rows along z, of each the heights along x, m. At least two of either.
        heights: SharedList<Vec<f32>>,
    },
    /// The union of several shapes.
    Compound {
        /// At least one.
        parts: SharedList<ColliderPart>,
    },
}

impl ColliderShape {
    /// The same, where it is a mesh that is not closed, with all behind its triangles solid. Other shapes stay what they are.
    ///
    /// ```
    /// # use bevy::prelude::*;
    /// # use bevy_mass_spring::prelude::*;
    /// let hills = Polyline2d::new([Vec2::ZERO, Vec2::new(2.0, 1.0), Vec2::new(4.0, 0.0)]);
    /// let ground = ParticleCollider::new(ColliderShape::from(hills).one_sided());
    /// assert!(ground.validate().is_ok());
    /// ```
    pub fn one_sided(mut self) -> Self {
        if let Self::Mesh { one_sided, .. } = &mut self {
            *one_sided = true;
        }
        self
    }

    /// A function that computes the penetration depth of a ball, m, negative outside, from its centre in the axes of the shape and its
    /// radius, m. `None` if the shape is invalid.
    pub fn depth_meter(&self) -> Option<impl Fn(DVec3, f32) -> f64 + use<>> {
        let shape = self.build(Vec3::ONE).ok()?;
        Some(move |point, radius| shape.depth(point, radius))
    }
}

#[cfg(feature = "serialize")]
fn is_false(value: &bool) -> bool {
    !value
}

/// A part of a [`ColliderShape::Compound`].
#[derive(Debug, Clone, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(default, deny_unknown_fields))]
pub struct ColliderPart {
    /// Its geometry; no compound.
    pub shape: ColliderShape,
    /// Where it is in the axes of the whole, m. Default 0.
    pub position: Vec3,
    /// Its rotation. Default: none.
    pub rotation: Quat,
}
