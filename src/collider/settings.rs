//! Which collisions act.

use bevy::prelude::*;

use crate::parameter::{self, InvalidParameter};

/// Which collisions act, and how particles rebound from each other.
///
/// Two particles do not collide with each other
/// - if a `Spring` joins them with a rest length shorter than their two radii
///   together: they overlap at rest, where contact and spring would oppose each other;
/// - if both hang on springs and they overlap when they are first in contact, until they have
///   separated: pushing them apart would stretch the springs and add energy.
#[derive(Resource, Reflect, Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(rename = "Collisions", default, deny_unknown_fields))]
#[reflect(Resource, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct CollisionSettings {
    /// Whether particles collide with [`ParticleCollider`](crate::ParticleCollider)s. Default true.
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
