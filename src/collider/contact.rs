//! The messages that report contacts.

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

/// Two entities have begun to touch: particles or nets, or one of them and a [`ParticleCollider`](crate::ParticleCollider),
/// sensors included.
///
/// As a message it is collected only if the app asks for it with `app.add_message::<ContactStarted>()`, one for each pair;
/// as an event it is triggered on those of the two that have [`ContactEvents`]. Of two particles or nets either may be
/// the [`entity`](Self::entity) of the message. A net that touches itself is both.
#[derive(Message, EntityEvent, Reflect, Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[non_exhaustive]
pub struct ContactStarted {
    /// The particle or net; as an event the one that it is triggered on.
    pub entity: Entity,
    /// What it touches.
    pub other: Entity,
}

/// Two entities do not touch any more: see [`ContactStarted`].
///
/// So it is, in the next tick, when one of them has been despawned, disabled or has ceased to be a particle, net or collider:
/// the other one, if marked, gets the event, the [`other`](Self::other) of which may not exist any more; there is none on what was
/// despawned.
#[derive(Message, EntityEvent, Reflect, Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[non_exhaustive]
pub struct ContactEnded {
    /// The particle or net; as an event the one that it is triggered on.
    pub entity: Entity,
    /// What it touched.
    pub other: Entity,
}

/// Triggers [`ContactStarted`] and [`ContactEnded`] on its entity: a particle, net or collider.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_mass_spring::prelude::*;
/// # fn spawn(mut commands: Commands) {
/// commands
///     .spawn((ParticleCollider::from(Sphere::new(1.0)).as_sensor(), ContactEvents))
///     .observe(|started: On<ContactStarted>| println!("{} came in", started.other));
/// # }
/// ```
#[derive(Component, Reflect, Debug, Clone, Copy, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct ContactEvents;
