//! What particles collide with, how they rebound, and the messages that report it.

mod build;
mod contact;
mod list;
mod motion;
mod primitives;
mod settings;
mod shape;

use bevy::prelude::*;

use crate::parameter::{self, InvalidParameter};

pub use crate::solver::CombineRule;
pub use contact::{Contact, ContactEnded, ContactEvents, ContactStarted};
pub use list::SharedList;
pub use motion::ColliderMotion;
pub(crate) use motion::move_colliders;
pub use settings::CollisionSettings;
pub use shape::{ColliderPart, ColliderShape};

/// A solid that particles and nets collide with, placed by its [`Transform`].
///
/// Made from any of Bevy's primitives, in two dimensions from a circle, rectangle, capsule or polygon; from a mesh, a
/// convex hull, a height field, or several of these. The default is a half-space: the ground, y = 0.
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
/// Which particles it touches: [`ContactLayers`] on its entity and on theirs.
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
