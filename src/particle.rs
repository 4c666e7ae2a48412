//! The components of a particle.

use bevy::prelude::*;

use crate::parameter::{self, InvalidParameter};

/// A point mass, the unit of every rope, cloth and jelly.
///
/// Its position is the entity's [`Transform`] (in world space, seen through the parents if it has
/// any); its velocity is [`ParticleVelocity`]. Add [`Pinned`] to fix it, [`AppliedForce`] to push it.
///
/// A child is carried along when its parent moves: it is elsewhere then, and neither its velocity nor that of what it
/// is tied to changes ([`Teleport`](crate::Teleport) says when a whole net is carried rigidly). So hair that is to
/// have inertia hangs by its [`Pinned`] roots only: these are children of the head, and the free particles have no
/// parent.
///
/// A particle with a bad value (see the fields) is left out of the simulation, with one warning that
/// names it, until the value is corrected.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[require(Transform, ParticleVelocity)]
pub struct Particle {
    /// Mass in kg, finite and > 0. Default 1.
    pub mass: f32,
    /// Radius in m of the sphere that collides, finite and >= 0. Default 0.05.
    ///
    /// A particle of radius 0 collides with colliders only.
    pub radius: f32,
}

impl Particle {
    /// A particle of `mass` in kg (> 0) and `radius` in m (>= 0).
    pub const fn new(mass: f32, radius: f32) -> Self {
        Self { mass, radius }
    }

    /// Checks that mass and radius are in their ranges.
    ///
    /// # Errors
    /// Names the field at fault.
    pub fn validate(&self) -> Result<(), InvalidParameter> {
        parameter::mass("mass", self.mass)?;
        parameter::non_negative("radius", self.radius)
    }
}

impl Default for Particle {
    fn default() -> Self {
        Self::new(1.0, 0.05)
    }
}

/// The velocity of a particle in m/s, in world space. Default 0.
///
/// That of a [`Pinned`] particle is written by the plugin: it is the velocity of its transform.
#[derive(Component, Reflect, Debug, Clone, Copy, Default, PartialEq, Deref, DerefMut)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct ParticleVelocity(pub Vec3);

/// Gives a particle infinite mass: no force and no contact moves it.
///
/// It moves with its [`Transform`] and those of its parents, and drags along what is tied to it: the motion since
/// the last tick is spread evenly over the substeps, and springs, dampers and contacts see its velocity. Where all that
/// hangs from it was moved alike, it has not moved but is elsewhere: see [`Teleport`](crate::Teleport).
#[derive(Component, Reflect, Debug, Clone, Copy, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct Pinned;

/// A force in N that the game applies to a particle, in world space. Default 0.
///
/// It is added to gravity, viscosity and springs in each tick until it is changed or removed.
#[derive(Component, Reflect, Debug, Clone, Copy, Default, PartialEq, Deref, DerefMut)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct AppliedForce(pub Vec3);

/// Marks a particle that the plugin took out of the simulation because its state became non-finite.
///
/// Its transform keeps the last finite position, and its springs exert no force. The fault is reported
/// once, as [`ParticleFault`](crate::report::ParticleFault) and in the log. Remove the component to
/// return the particle to the simulation.
#[derive(Component, Reflect, Debug, Clone, Copy, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct Quarantined;

/// The place of a particle, spring or plane in the order in which the simulation numbers particles and planes, and
/// adds forces.
///
/// Results depend on that order in their last bits. By default it is the order in which entities got their
/// [`Particle`], `Spring` or `ParticleCollider`; where that differs between two apps which must agree to the bit, give each entity a
/// number. Those with smaller ones come first, those without one last. A new number has all of them sorted again.
#[derive(Component, Reflect, Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[component(immutable)]
pub struct SimulationOrder(pub u64);
