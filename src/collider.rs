//! What particles collide with, how they rebound, and the message that reports it.

use bevy::prelude::*;

use crate::parameter::{self, InvalidParameter};

/// A solid half-space: all that lies below the local +Y axis of its [`Transform`].
///
/// At the default transform it is the ground, y = 0. Move or rotate the transform (or a parent) to
/// place it; while it moves, particles feel the velocity of its surface. Scale has no effect.
#[derive(Component, Reflect, Debug, Clone, Copy, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[require(Transform)]
pub struct PlaneCollider {
    /// Coefficient of restitution, 0 (all energy of the impact is absorbed) to 1 (elastic). Default 0.
    pub restitution: f32,
    /// Coefficient of Coulomb friction, finite and >= 0. Default 0.
    pub friction: f32,
}

impl PlaneCollider {
    /// Checks that restitution and friction are in their ranges.
    ///
    /// # Errors
    /// Names the field at fault.
    pub fn validate(&self) -> Result<(), InvalidParameter> {
        parameter::fraction("restitution", self.restitution)?;
        parameter::non_negative("friction", self.friction)
    }
}

/// Which collisions act, and how particles rebound from each other.
///
/// Two particles do not collide with each other
/// - if a `Spring` joins them whose rest length is shorter than their two radii
///   together: they overlap at rest, where contact and spring would oppose each other;
/// - if both hang on springs and they overlap when they are first in contact, until they have
///   separated: pushing them apart would stretch the springs and add energy.
#[derive(Resource, Reflect, Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(rename = "Collisions", default, deny_unknown_fields))]
#[reflect(Resource, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct CollisionSettings {
    /// Whether particles collide with [`PlaneCollider`]s. Default true.
    pub ground: bool,
    /// Whether particles collide with particles. Default true.
    pub particles: bool,
    /// Whether `Spring`s between particles collide along their length, as capsules that taper from the radius of one end
    /// to that of the other, where `particles` collide. (Nets do so in any case.) Default false.
    pub springs: bool,
    /// Coefficient of restitution between two particles, 0 to 1. Default 0.
    pub restitution: f32,
    /// Coefficient of Coulomb friction between two particles, finite and >= 0. Default 0.
    pub friction: f32,
}

impl CollisionSettings {
    /// Checks that restitution and friction are in their ranges.
    ///
    /// # Errors
    /// Names the field at fault.
    pub fn validate(&self) -> Result<(), InvalidParameter> {
        parameter::fraction("restitution", self.restitution)?;
        parameter::non_negative("friction", self.friction)
    }
}

impl Default for CollisionSettings {
    fn default() -> Self {
        Self { ground: true, particles: true, springs: false, restitution: 0.0, friction: 0.0 }
    }
}

/// Two things touched during a tick: one message for each touching pair and tick.
///
/// Contacts are collected only if the app asks for them with `app.add_message::<Contact>()`;
/// otherwise they cost nothing.
#[derive(Message, Reflect, Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[non_exhaustive]
pub struct Contact {
    /// The particle that was pushed along [`normal`](Self::normal), or the net of which it is one.
    pub particle: Entity,
    /// Its number in the net; `None` of a loose particle.
    pub index: Option<u32>,
    /// The entity of the [`PlaneCollider`], or the other particle, or the net of which it is one.
    pub other: Entity,
    /// The number of the other particle in its net; `None` of a plane or a loose particle.
    pub other_index: Option<u32>,
    /// Where they touched, in world space, m.
    pub point: Vec3,
    /// Unit vector from [`other`](Self::other) towards [`particle`](Self::particle).
    pub normal: Vec3,
    /// Sum of the normal impulses over the tick, N·s.
    pub impulse: f32,
}
