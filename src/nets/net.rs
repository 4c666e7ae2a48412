//! The state of a net.

use std::sync::Arc;

use bevy::prelude::*;

use super::haul::Haul;
use super::version::Versions;
use super::{Breaking, Spool, Topology, Yielding};

/// Many particles and what joins them, on one entity: a rope, a cloth, a jelly, a balloon.
///
/// The arrays own the positions, in world space; what the entity's `Transform` was when the net was laid out does not
/// matter any more. Particle i is the i-th of the [`Topology`], for life.
///
/// What is written between two ticks counts: particles that were moved go on from there, a [pinned](Self::set_pinned)
/// one drags along what hangs from it. A value that is not finite is refused with a warning that names the particle.
/// A [`Part`](crate::nets::Part) gives an entity to one or more particles.
///
/// A net with an [invalid](Topology::validate) topology is left out of the simulation, with one warning.
#[derive(Component, Reflect, Debug, Clone, Default, PartialEq)]
#[reflect(opaque)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[require(Transform)]
pub struct ParticleNet {
    #[cfg_attr(feature = "serialize", serde(with = "shared"))]
    pub(super) topology: Arc<Topology>,
    #[cfg_attr(feature = "serialize", serde(skip))]
    pub(super) versions: Versions,
    pub(super) positions: Vec<Vec3>,
    pub(super) velocities: Vec<Vec3>,
    /// In ascending order.
    pinned: Vec<u32>,
    /// In ascending order.
    quarantined: Vec<u32>,
    /// In ascending order.
    pub(super) broken: Vec<u32>,
    /// One a particle, or none.
    pub(super) applied_forces: Vec<Vec3>,
    /// What parts do in this tick.
    pub(super) parts: PartActions,
    /// The tension of each spring at the end of the last tick, N; empty if it was not asked for.
    pub(super) tensions: Vec<f32>,
    /// What the springs were given by the component [`Breaking`].
    pub(super) breaking: Breaking,
    /// What they were given by the component [`Yielding`].
    #[cfg_attr(feature = "serialize", serde(default))]
    pub(super) yielding: Yielding,
    /// What is known of the rope on a winch.
    pub(super) spool: Option<Box<Spool>>,
    /// What its winch pulls at, if that has a greatest force.
    #[cfg_attr(feature = "serialize", serde(default))]
    pub(super) haul: Option<Haul>,
}

/// What the parts of a net do to it in a tick; found anew in each.
#[derive(Debug, Clone, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct PartActions {
    /// The particles that pinned parts hold, in ascending order.
    pub held: Vec<u32>,
    /// Forces on particles, N.
    pub forces: Vec<(u32, Vec3)>,
}

/// The arrays of a net, to be written by the simulation.
pub(crate) struct Arrays<'a> {
    pub positions: &'a mut [Vec3],
    pub velocities: &'a mut [Vec3],
    pub tensions: &'a mut Vec<f32>,
    pub parts: &'a mut PartActions,
    pub pinned: &'a [u32],
}

impl ParticleNet {
    /// A net at rest, laid out in `frame`.
    pub fn new(topology: Arc<Topology>, frame: &Transform) -> Self {
        Self::laid_out(topology, |place| frame.transform_point(place))
    }

    /// A net at rest, each particle where `place` takes its place in the frame of the recipe.
    pub fn laid_out(topology: Arc<Topology>, place: impl Fn(Vec3) -> Vec3) -> Self {
        let positions: Vec<Vec3> = topology.positions.iter().map(|position| place(*position)).collect();
        Self { velocities: vec![Vec3::ZERO; positions.len()], positions, topology, ..Self::default() }
    }

    /// The same net with these particles pinned; numbers without a particle are ignored.
    pub fn with_pinned(mut self, particles: impl IntoIterator<Item = u32>) -> Self {
        particles.into_iter().for_each(|particle| self.set_pinned(particle, true));
        self
    }

    /// What it is made of.
    pub fn topology(&self) -> &Arc<Topology> {
        &self.topology
    }

    /// Gives it other parameters, in effect from the next tick on: rest lengths, stiffnesses and dampings go there
    /// substep by substep. Where the elements join other particles, the net is laid out anew in the solver, with the
    /// particles where they are.
    ///
    /// Particles beyond the present number are at rest at their place in the frame of the recipe.
    pub fn set_topology(&mut self, topology: Arc<Topology>) {
        let (old, new) = (self.positions.len(), topology.positions.len());
        self.positions.truncate(new);
        self.positions.extend(topology.positions.iter().skip(old));
        self.velocities.resize(new, Vec3::ZERO);
        if !self.applied_forces.is_empty() {
            self.applied_forces.resize(new, Vec3::ZERO);
        }
        self.pinned.retain(|particle| (*particle as usize) < new);
        self.quarantined.retain(|particle| (*particle as usize) < new);
        self.broken.retain(|spring| (*spring as usize) < topology.springs.len());
        self.parts = PartActions::default();
        self.tensions.clear();
        (self.breaking, self.yielding) = (Breaking::default(), Yielding::default());
        (self.spool, self.haul) = (None, None);
        self.topology = topology;
        self.versions.touch_structure();
    }

    /// The numbers of the present version of its topology.
    pub(crate) fn versions(&self) -> Versions {
        self.versions
    }

    /// The number of particles.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether it has no particles.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// The positions of the particles in the world, m.
    pub fn positions(&self) -> &[Vec3] {
        &self.positions
    }

    /// The positions, to be changed: particles that were moved go on from there.
    pub fn positions_mut(&mut self) -> &mut [Vec3] {
        &mut self.positions
    }

    /// The velocities of the particles, m/s.
    pub fn velocities(&self) -> &[Vec3] {
        &self.velocities
    }

    /// The velocities, to be changed.
    pub fn velocities_mut(&mut self) -> &mut [Vec3] {
        &mut self.velocities
    }

    /// The mass of each particle, kg.
    pub fn masses(&self) -> &[f32] {
        &self.topology.masses
    }

    /// The radius of all particles, m.
    pub fn radius(&self) -> f32 {
        self.topology.radius
    }

    /// The particles that were [pinned](Self::set_pinned), in ascending order.
    pub fn pinned(&self) -> &[u32] {
        &self.pinned
    }

    /// Whether a particle is pinned, by [`set_pinned`](Self::set_pinned) or by a pinned part.
    pub fn is_pinned(&self, particle: u32) -> bool {
        self.pinned.binary_search(&particle).is_ok() || self.parts.held.binary_search(&particle).is_ok()
    }

    /// Gives a particle infinite mass, so that it goes where its position is written, or its own mass again. A number
    /// without a particle counts for nothing.
    pub fn set_pinned(&mut self, particle: u32, is_pinned: bool) {
        match (self.pinned.binary_search(&particle), is_pinned) {
            (Err(place), true) if (particle as usize) < self.positions.len() => {
                self.pinned.insert(place, particle)
            }
            (Ok(place), false) => {
                self.pinned.remove(place);
            }
            _ => {}
        }
    }

    /// The force on each particle that the game applies, N, in each tick until it is changed; empty if there is none.
    pub fn applied_forces(&self) -> &[Vec3] {
        &self.applied_forces
    }

    /// The forces, to be changed: one a particle.
    pub fn applied_forces_mut(&mut self) -> &mut [Vec3] {
        self.applied_forces.resize(self.positions.len(), Vec3::ZERO);
        &mut self.applied_forces
    }

    /// Removes all applied forces.
    pub fn clear_applied_forces(&mut self) {
        self.applied_forces.clear();
    }

    /// The particles that became non-finite and were taken out of the simulation, with what joins them to others, in
    /// ascending order. They keep their last finite position.
    pub fn quarantined(&self) -> &[u32] {
        &self.quarantined
    }

    /// Returns particles that were quarantined to the simulation.
    pub fn release_quarantined(&mut self) {
        self.quarantined.clear();
    }

    pub(crate) fn quarantine(&mut self, particle: u32) {
        if let Err(place) = self.quarantined.binary_search(&particle) {
            self.quarantined.insert(place, particle);
        }
    }

    /// The springs that broke, in ascending order of their numbers.
    pub fn broken(&self) -> &[u32] {
        &self.broken
    }

    pub(crate) fn break_spring(&mut self, spring: u32) {
        if let Err(place) = self.broken.binary_search(&spring) {
            self.broken.insert(place, spring);
            self.versions.touch_structure();
        }
    }

    /// The tensions of the last tick, as the solver has them; empty if it was not asked for them.
    pub(super) fn published_tensions(&self) -> &[f32] {
        &self.tensions
    }

    pub(crate) fn part_actions(&self) -> &PartActions {
        &self.parts
    }

    pub(crate) fn arrays_mut(&mut self) -> Arrays<'_> {
        let Self { positions, velocities, tensions, parts, pinned, .. } = self;
        Arrays { positions, velocities, tensions, parts, pinned }
    }
}

/// A topology in a file is one of its own.
#[cfg(feature = "serialize")]
mod shared {
    use std::sync::Arc;

    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    use crate::nets::Topology;

    pub fn serialize<S: Serializer>(topology: &Arc<Topology>, to: S) -> Result<S::Ok, S::Error> {
        (**topology).serialize(to)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Arc<Topology>, D::Error> {
        Topology::deserialize(from).map(Arc::new)
    }
}
