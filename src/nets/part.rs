//! Parts: entities that stand for particles of a net.

use std::fmt;

use bevy::ecs::VariantDefaults;
use bevy::ecs::entity::MapEntities;
use bevy::prelude::*;

use super::{Corner, ParticleNet, Side, Tie, Topology};
use crate::particle::ParticleVelocity;

/// Which particles of a net an entity stands for. [`PartOf`] says of which net.
///
/// What is true of a loose [`Particle`](crate::Particle) is true of a part:
/// - its `Transform` shows where it is, written in each tick; to write another one moves its particles;
/// - with [`Pinned`](crate::Pinned) it goes where its `Transform`, or a parent of it, goes;
/// - an [`AppliedForce`](crate::AppliedForce) pushes it, shared among its particles by mass;
/// - its [`ParticleVelocity`] is theirs;
/// - a [`Spring`](crate::Spring) may end in it, if it is of one particle.
///
/// A part of several particles is at their centre of mass, turned as they are (the rotation that fits best to the places
/// at rest); pinned, they follow it rigidly. Its first `Transform` counts only if it is pinned and that is not the
/// identity; else the part takes the place of its particles, with whatever is between it and its parent. A parent that
/// moves carries pinned parts along and no others. Where several pinned parts hold a particle, the last one counts.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_mass_spring::prelude::*;
/// # use bevy_mass_spring::nets::{Part, PartOf, ParticleNet, Parts};
/// fn hang(mut commands: Commands, net: ParticleNet, hand: Entity) {
///     let rope = commands.spawn((net, related!(Parts[(Part::End, Pinned)]))).id();
///     commands.entity(hand).with_child((PartOf(rope), Part::Start, Pinned));
/// }
/// // The same in a scene; see docs/nets.md for more.
/// fn held() -> impl Scene {
///     bsn! {
///         #Hand
///         Transform
///         Children [ (#Rope Rope Parts [ Part::End Pinned ]), PartOf(#Rope) Part::Start Pinned ]
///     }
/// }
/// ```
#[derive(Component, VariantDefaults, Reflect, Debug, Clone, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[require(Transform, ParticleVelocity, PartState)]
#[non_exhaustive]
pub enum Part {
    /// All particles.
    #[default]
    All,
    /// One particle, by its number.
    Particle(u32),
    /// Some particles, by their numbers.
    Particles(Vec<u32>),
    /// The first particle of a rope.
    Start,
    /// The last particle of a rope.
    End,
    /// The particles along a side of a cloth.
    Edge(Side),
    /// The particle at a corner of a cloth.
    Corner(Corner),
    /// A group of particles that an artist painted or a closure chose, by its name.
    Painted(String),
    /// The particles that at rest are nearest to these points in the frame of the recipe, m: of each point the first one of
    /// those equally near.
    Nearest(Vec<Vec3>),
}

#[cfg(feature = "serialize")]
use bevy::reflect::{ReflectDeserialize, ReflectSerialize};

impl Part {
    /// Its particles in a net, in ascending order; `None` if the net has no such part.
    pub fn particles(&self, topology: &Topology) -> Option<Vec<u32>> {
        let count = topology.positions.len() as u32;
        let mut found = match self {
            Self::All => (0..count).collect(),
            Self::Particle(particle) => vec![*particle],
            Self::Particles(particles) => particles.clone(),
            Self::Start => vec![topology.start()?],
            Self::End => vec![topology.end()?],
            Self::Edge(side) => topology.edge(*side)?,
            Self::Corner(corner) => vec![topology.corner(*corner)?],
            Self::Painted(name) => topology.painted(name)?.to_vec(),
            Self::Nearest(points) => points.iter().filter_map(|point| topology.nearest(*point)).collect(),
        };
        found.sort_unstable();
        found.dedup();
        (!found.is_empty() && found.iter().all(|particle| *particle < count)).then_some(found)
    }
}

impl fmt::Display for Part {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::All => write!(formatter, "particle at all"),
            Self::Particle(particle) => write!(formatter, "particle {particle}"),
            Self::Particles(particles) => write!(formatter, "particles {particles:?}"),
            Self::Start => write!(formatter, "start"),
            Self::End => write!(formatter, "end"),
            Self::Edge(side) => write!(formatter, "edge {side:?}"),
            Self::Corner(corner) => write!(formatter, "corner {corner:?}"),
            Self::Painted(name) => write!(formatter, "painted group \"{name}\""),
            Self::Nearest(points) => write!(formatter, "particle nearest to {points:?}"),
        }
    }
}

/// The net of a [`Part`].
#[derive(Component, FromTemplate, Reflect, MapEntities, Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Component, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[relationship(relationship_target = Parts)]
#[require(Part)]
pub struct PartOf(#[entities] pub Entity);

/// The parts of a net; they are despawned with it.
#[derive(Component, Reflect, Debug, Clone, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[relationship_target(relationship = PartOf, linked_spawn)]
pub struct Parts(Vec<Entity>);

impl Parts {
    /// The entities, in the order in which they became parts.
    pub fn entities(&self) -> &[Entity] {
        &self.0
    }
}

/// The state of a [`Part`] from tick to tick. Rollback libraries save it with the other components.
#[derive(Component, MapEntities, Reflect, Debug, Clone, Default)]
#[reflect(opaque)]
#[reflect(Component, Default, Debug, Clone)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct PartState {
    /// In ascending order; empty until they are found.
    pub(crate) particles: Vec<u32>,
    /// Translation and rotation that the last tick wrote, or left; `None` before the first one.
    pub(crate) written: Option<(Vec3, Quat)>,
    pub(crate) written_velocity: Vec3,
    /// Whether it was pinned in the last tick.
    pub(crate) is_held: bool,
    /// The places of its particles in its own frame when it was pinned, m; of parts of several particles.
    pub(crate) offsets: Vec<Vec3>,
    /// The attachment that is in effect.
    #[entities]
    #[cfg_attr(feature = "serialize", serde(default))]
    pub(crate) tie: Option<Tie>,
    /// The version of the net in which the particles were found; 0 before.
    #[cfg_attr(feature = "serialize", serde(skip))]
    pub(crate) structure: u64,
    /// The slot in the solver, of a part of one particle.
    #[cfg_attr(feature = "serialize", serde(skip))]
    pub(crate) slot: Option<u32>,
}

impl PartState {
    /// The particles that it stands for, in ascending order; none before the first tick, or if its net has no such part.
    pub fn particles(&self) -> &[u32] {
        &self.particles
    }

    /// That of a part of one of its particles.
    pub(crate) fn of_one(&self, particle: u32) -> Self {
        Self { particles: vec![particle], structure: self.structure, ..Self::default() }
    }

    /// Whether its particles were found in this net, as it is.
    pub(crate) fn is_of(&self, net: &ParticleNet) -> bool {
        self.structure == net.versions().structure
    }
}
