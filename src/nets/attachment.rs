//! Ties between parts of nets and other entities.

use bevy::ecs::entity::MapEntities;
use bevy::prelude::*;

#[cfg(feature = "serialize")]
use bevy::reflect::{ReflectDeserialize, ReflectSerialize};

/// On a [`Part`](crate::nets::Part): ties each of its particles to another entity by a spring.
///
/// From the next tick on each of them has a [`Spring`](crate::Spring):
/// - to a [`Particle`](crate::Particle) or a part of one particle, as long at rest as they are apart now, if these
///   take part in the simulation: both pull at each other;
/// - to the place where the particle is now in the frame of any other entity with a `Transform`, 0 long at rest. That place
///   moves and turns with the entity, which is not pushed: its own physics may take the force from
///   [`SpringForces::reactions`](crate::SpringForces::reactions); [`Reaction`](crate::Reaction) has an example.
///
/// The spring of a part of one particle is on the part itself. A part of several particles, such as an edge or a painted
/// group, gets a child for each of them, in ascending order: the part of this particle alone, with the spring. So a seam may
/// give way particle by particle, as each tie has the whole breaking force. Particles that the part gets later are not tied.
/// Where the particles of a painted group have [weights](crate::nets::Topology::weights), each tie has its weight times the
/// stiffness: cloth is held firmly where the paint is full, and softly where it fades.
///
/// All that is true of springs is true of it: its tension is in [`SpringForces`](crate::SpringForces) under the entity that
/// has it, and when it breaks this entity gets [`Broken`](crate::Broken) and the event [`Broke`](crate::Broke); when its
/// other end is despawned, what [`OrphanedSprings`](crate::OrphanedSprings) says holds for that entity. Without the component
/// all of these ties are undone; inserted again it ties anew. To hold a part rigidly take [`Pinned`](crate::Pinned).
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_mass_spring::prelude::*;
/// # use bevy_mass_spring::nets::{Attachment, Part, ParticleNet, Parts};
/// fn lamp(mut commands: Commands, rope: ParticleNet, hook: Entity, lamp: Entity) {
///     commands.spawn((
///         rope,
///         related!(Parts[
///             (Part::Start, Attachment::to(hook)),
///             (Part::End, Attachment::to(lamp).breaking_at(500.0)),
///         ]),
///     ));
/// }
/// ```
#[derive(Component, FromTemplate, MapEntities, Reflect, Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Component, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct Attachment {
    /// What the part is tied to.
    #[entities]
    pub entity: Entity,
    /// The tension at which a tie breaks, N, finite and >= 0; of each particle of the part by itself. Default `None`: never.
    pub breaking_force: Option<f32>,
    /// The stiffness of the tie of each particle, N/m, finite and >= 0; times its weight in a painted group that has weights.
    /// Default `None`: that of the stiffest spring of the net at the particle, which costs the simulation nothing.
    pub stiffness: Option<f32>,
}

impl Attachment {
    /// A tie to `entity` that does not break.
    pub const fn to(entity: Entity) -> Self {
        Self { entity, breaking_force: None, stiffness: None }
    }

    /// The same with a breaking force, N.
    pub const fn breaking_at(mut self, force: f32) -> Self {
        self.breaking_force = Some(force);
        self
    }

    /// The same with a stiffness, N/m.
    pub const fn with_stiffness(mut self, stiffness: f32) -> Self {
        self.stiffness = Some(stiffness);
        self
    }
}

/// On the pinned particle that stands for an entity which is none, to which a part is attached. It is a child of that.
#[derive(Component, Debug, Clone, Copy, Default)]
pub(crate) struct Anchor;

/// An [`Attachment`] that is in effect.
#[derive(MapEntities, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Tie {
    #[entities]
    pub attachment: Attachment,
    /// The pinned particles in the frame of what it is tied to, if that is none itself; and the parts of one particle that
    /// have the springs, if the attached part is of several.
    #[entities]
    pub helpers: Vec<Entity>,
}
