//! What particles collide with, how they rebound, and the messages that report it.

mod build;
mod contact;
mod exemptions;
mod list;
mod motion;
#[cfg(feature = "gizmos")]
mod outline;
mod place;
mod primitives;
mod settings;
mod shape;

use bevy::math::{DQuat, DVec2, DVec3};
use bevy::prelude::*;

use crate::parameter::{self, InvalidParameter};

pub use crate::solver::CombineRule;
pub use contact::{Contact, ContactEnded, ContactEvents, ContactStarted};
pub use exemptions::ContactExemptions;
pub use list::SharedList;
pub use motion::ColliderMotion;
pub(crate) use motion::move_colliders;
pub(crate) use place::pose_of;
pub use settings::CollisionSettings;
pub use shape::{ColliderPart, ColliderShape};

/// A solid that particles and nets collide with, placed by its [`Transform`].
///
/// The default is a half-space: the ground, y = 0. Others are made from
/// - Bevy's primitives `Sphere`, `Cuboid`, `Capsule3d`, `Cylinder`, `Cone` and `ConicalFrustum`, and in two dimensions
///   `Circle`, `Rectangle`, `Capsule2d`, `Triangle2d`, `Rhombus`, `RegularPolygon`, `ConvexPolygon`, `Segment2d` and
///   `Polyline2d`. Not from `Torus`, `Tetrahedron`, `Ellipse`, `Annulus`, `Polygon` and others: these take a mesh or a
///   compound;
/// - a Bevy `Mesh`: [`ColliderShape::mesh`](ColliderShape#method.mesh),
///   [`one_sided_mesh`](ColliderShape#method.one_sided_mesh) and [`convex_hull`](ColliderShape#method.convex_hull) (feature
///   `render`);
/// - points, triangles or heights, or several of all these: [`ColliderShape`].
///
/// A half-space with its surface through a point, facing a direction: [`facing`](Self::facing).
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_mass_spring::prelude::*;
/// # fn spawn(mut commands: Commands) {
/// commands.spawn(ParticleCollider::half_space().with_friction(0.5));
/// commands.spawn((ParticleCollider::from(Sphere::new(0.5)), Transform::from_xyz(0.0, 1.0, 0.0)));
/// # }
/// ```
///
/// Moving its `Transform` (or that of a parent) moves it: within the tick it goes there evenly, and particles feel
/// the velocity of its surface: a platform carries, a paddle hits, a turning drum rubs. The scale counts where the
/// result is a shape of the same kind: any of boxes, hulls and meshes, a uniform one of spheres; others are left out of
/// the simulation with a warning that names the entity. A half-space has no scale.
///
/// Which particles it touches: [`ContactLayers`] and [`ContactExemptions`] on its entity and on theirs.
#[derive(Component, Reflect, Debug, Clone, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(default))]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[require(Transform)]
pub struct ParticleCollider {
    /// Its geometry. Default: the half-space y < 0.
    pub shape: ColliderShape,
    /// Coefficient of restitution, 0 (all energy of the impact is absorbed) to 1 (elastic). Default 0.
    pub restitution: f32,
    /// Coefficient of Coulomb friction, finite and >= 0. Default 0.
    pub friction: f32,
    /// How its restitution is combined with the [`ContactMaterial`] of a particle that has one. Default: the mean.
    pub restitution_rule: CombineRule,
    /// How its friction is combined with the [`ContactMaterial`] of a particle that has one. Default: the mean.
    pub friction_rule: CombineRule,
    /// The velocity of its surface, in its own axes, beside that of its motion, m/s: a conveyor belt. Default 0.
    pub surface_velocity: Vec3,
    /// Whether it exerts no force: contacts with it are only reported, by [`Contact`] and the like. Default false.
    pub is_sensor: bool,
}

impl ParticleCollider {
    /// One of this shape, without restitution and friction.
    pub fn new(shape: impl Into<ColliderShape>) -> Self {
        Self { shape: shape.into(), ..Self::default() }
    }

    /// All that lies below the local +Y axis.
    pub fn half_space() -> Self {
        Self::default()
    }

    /// The `Transform` with which the local +Y axis, hence a [half-space](Self::half_space), faces `normal` at `point`, m.
    ///
    /// ```
    /// # use bevy::prelude::*;
    /// # use bevy_mass_spring::prelude::*;
    /// # fn spawn(mut commands: Commands) {
    /// let slope = Dir3::new(Vec3::new(-0.2, 1.0, 0.0)).expect("not zero");
    /// commands.spawn((ParticleCollider::half_space(), ParticleCollider::facing(Vec3::ZERO, slope)));
    /// # }
    /// ```
    pub fn facing(point: Vec3, normal: Dir3) -> Transform {
        // In f64: the f32 version takes slopes under 0.04° for none.
        let rotation = DQuat::from_rotation_arc(DVec3::Y, normal.as_dvec3().normalize());
        Transform::from_translation(point).with_rotation(rotation.as_quat())
    }

    /// The same in two dimensions, turned about z: a half-plane. The layer, z, is 0.
    pub fn facing_2d(point: Vec2, normal: Dir2) -> Transform {
        let rotation = DQuat::from_rotation_arc_2d(DVec2::Y, normal.as_dvec2().normalize());
        Transform::from_translation(point.extend(0.0)).with_rotation(rotation.as_quat())
    }

    /// The same with a coefficient of restitution, 0 to 1.
    pub fn with_restitution(self, restitution: f32) -> Self {
        Self { restitution, ..self }
    }

    /// The same with a coefficient of Coulomb friction, >= 0.
    pub fn with_friction(self, friction: f32) -> Self {
        Self { friction, ..self }
    }

    /// The same with a surface that moves as a conveyor belt, m/s in its own axes.
    pub fn with_surface_velocity(self, surface_velocity: Vec3) -> Self {
        Self { surface_velocity, ..self }
    }

    /// The same as a sensor, which exerts no force.
    pub fn as_sensor(self) -> Self {
        Self { is_sensor: true, ..self }
    }

    /// Checks its shape, and that restitution and friction are in their ranges.
    ///
    /// # Errors
    /// Names the field at fault.
    pub fn validate(&self) -> Result<(), InvalidParameter> {
        self.validate_surface()?;
        self.shape.validate()
    }

    /// Checks all but its shape.
    pub(crate) fn validate_surface(&self) -> Result<(), InvalidParameter> {
        parameter::fraction("restitution", self.restitution)?;
        parameter::non_negative("friction", self.friction)?;
        parameter::finite("surface_velocity", self.surface_velocity)
    }
}

/// Restitution and friction of the surface of a particle or net.
///
/// Without it the coefficients of the [`ParticleCollider`] hold; with it both are combined, by the later one of the two
/// rules in the list of [`CombineRule`].
#[derive(Component, Reflect, Debug, Clone, Copy, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct ContactMaterial {
    /// Coefficient of restitution, 0 to 1. Default 0.
    pub restitution: f32,
    /// Coefficient of Coulomb friction, finite and >= 0. Default 0.
    pub friction: f32,
    /// How its restitution is combined with that of a collider. Default: the mean.
    pub restitution_rule: CombineRule,
    /// How its friction is combined with that of a collider. Default: the mean.
    pub friction_rule: CombineRule,
}

impl ContactMaterial {
    /// Checks that restitution and friction are in their ranges.
    ///
    /// # Errors
    /// Names the field at fault.
    pub fn validate(&self) -> Result<(), InvalidParameter> {
        parameter::fraction("restitution", self.restitution)?;
        parameter::non_negative("friction", self.friction)
    }
}

/// The layers that a particle, net or collider is in, and those that it touches.
///
/// Two of them touch if each is in a layer that the other one filters. Without it: in all layers, and touching all.
///
/// ```
/// # use bevy_mass_spring::prelude::*;
/// let character = ContactLayers::new(0b01, 0b10);
/// let cape = ContactLayers::new(0b10, 0b11);
/// assert!(character.meet(cape));
/// assert!(!character.meet(character));
/// ```
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct ContactLayers {
    /// Those that it is in, a bit each. Default: all.
    pub memberships: u32,
    /// Those that it touches. Default: all.
    pub filters: u32,
}

impl ContactLayers {
    /// In these layers, touching those.
    pub const fn new(memberships: u32, filters: u32) -> Self {
        Self { memberships, filters }
    }

    /// Whether two may touch.
    pub const fn meet(self, other: Self) -> bool {
        self.memberships & other.filters != 0 && other.memberships & self.filters != 0
    }
}

impl Default for ContactLayers {
    fn default() -> Self {
        Self::new(u32::MAX, u32::MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_spaces_face_their_normals() {
        let point = Vec3::new(1.0, 2.0, 3.0);
        for normal in [Vec3::Y, Vec3::NEG_Y, Vec3::X, Vec3::new(1e-4, 1.0, -2e-4), Vec3::new(0.3, -0.5, 0.8)]
        {
            let normal = Dir3::new(normal).unwrap();
            let place = ParticleCollider::facing(point, normal);
            assert_eq!(place.translation, point);
            assert!(place.up().distance(*normal) < 8.0 * f32::EPSILON, "{normal:?}: {place:?}");
        }
        for normal in [Vec2::Y, Vec2::NEG_Y, Vec2::X, Vec2::new(-0.6, 0.8), Vec2::new(1e-4, 1.0)] {
            let normal = Dir2::new(normal).unwrap();
            let place = ParticleCollider::facing_2d(Vec2::X, normal);
            assert!(place.up().distance(normal.extend(0.0)) < 8.0 * f32::EPSILON, "{normal:?}: {place:?}");
            assert!(place.back().distance(Vec3::Z) < 8.0 * f32::EPSILON, "it is turned about z");
        }
    }
}
