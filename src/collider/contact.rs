//! The messages that tell of contacts.

use bevy::prelude::*;

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
    /// The entity of the [`ParticleCollider`](crate::ParticleCollider), or the other particle, or the net of which it is one.
    pub other: Entity,
    /// The number of the other particle in its net; `None` of a collider or a loose particle.
    pub other_index: Option<u32>,
    /// Where they touched, in world space, m.
    pub point: Vec3,
    /// Unit vector from [`other`](Self::other) towards [`particle`](Self::particle).
    pub normal: Vec3,
    /// Sum of the normal impulses over the tick, N·s.
    pub impulse: f32,
}
