//! Which nets take part, in the order of spawning, and where each is in the solver.

use bevy::ecs::entity::{EntityMapper, MapEntities};
use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::query::Allow;
use bevy::prelude::*;

use super::super::Simulation;
use super::super::state::{MassSpringState, Warnings, touch};
use crate::nets::ParticleNet;
use crate::solver::NetRanges;

/// All nets, in the order of spawning, or of `SimulationOrder`.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(in crate::sync) struct NetRegistry {
    pub entries: Vec<RegisteredNet>,
    /// Whether nets were added, replaced or removed since the last tick.
    pub is_pending: bool,
    /// Number of slots of quarantined particles.
    pub quarantined: usize,
}

/// A net, and where it is in the solver.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(in crate::sync) struct RegisteredNet {
    pub entity: Entity,
    /// `None` while it takes no part.
    pub place: Option<NetPlace>,
    /// Whether it was inserted since the last tick: what was there before is gone.
    pub is_new: bool,
    /// Whether its elements join other particles than before: those that were there stay where they are.
    pub is_relaid: bool,
    /// Whether its initial state has been recorded.
    pub is_recorded: bool,
    /// Whether its entity has lost it.
    pub is_removed: bool,
    /// Where the entity was at the end of the last tick, if particles are pinned: these move with it.
    pub frame: Option<[f32; 12]>,
    /// What it was placed with in this tick, before its arrays are copied: the version of its parameters, and its pins in
    /// ascending order.
    #[cfg_attr(feature = "serialize", serde(skip))]
    pub placed: Option<(u64, Vec<u32>)>,
}

/// Where a net is in the solver.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(in crate::sync) struct NetPlace {
    pub ranges: NetRanges,
    /// The slot of each particle; empty if they are consecutive.
    order: Vec<u32>,
    /// The particle in each slot, by slot; empty if they are consecutive.
    numbers: Vec<(u32, u32)>,
    /// The particles that were out of the simulation when it was placed.
    pub quarantined: Vec<u32>,
}

impl NetPlace {
    pub fn new(ranges: NetRanges) -> Self {
        Self { ranges, ..Self::default() }
    }

    /// The number of particles.
    pub fn len(&self) -> usize {
        self.ranges.particles.len()
    }

    /// The slot of a particle.
    #[inline]
    pub fn slot(&self, particle: usize) -> usize {
        match self.order.get(particle) {
            Some(slot) => *slot as usize,
            None => self.ranges.particles.start + particle,
        }
    }

    /// The first slot, if they are consecutive.
    pub fn first(&self) -> Option<usize> {
        self.order.is_empty().then_some(self.ranges.particles.start)
    }

    /// The particle in a slot of the net.
    pub fn particle(&self, slot: usize) -> Option<u32> {
        if self.order.is_empty() {
            return self
                .ranges
                .particles
                .contains(&slot)
                .then(|| (slot - self.ranges.particles.start) as u32);
        }
        let place = self.numbers.binary_search_by_key(&(slot as u32), |(slot, _)| *slot).ok()?;
        Some(self.numbers[place].1)
    }

    /// The slots of all particles.
    pub fn slots(&self) -> impl ExactSizeIterator<Item = usize> {
        (0..self.len()).map(|particle| self.slot(particle))
    }

    /// Takes note that particles are in other slots: `new_slots[old]`.
    pub fn renumber(&mut self, new_slots: &[u32]) {
        let order: Vec<u32> = self.slots().map(|slot| new_slots[slot]).collect();
        let first = order.first().copied().unwrap_or(0);
        self.numbers.clear();
        if (first..).zip(&order).all(|(expected, slot)| expected == *slot) {
            self.ranges.particles = first as usize..first as usize + order.len();
            self.order.clear();
        } else {
            self.numbers.extend(order.iter().copied().zip(0..));
            self.numbers.sort_unstable();
            self.order = order;
        }
    }
}

impl RegisteredNet {
    pub fn new(entity: Entity) -> Self {
        Self {
            entity,
            place: None,
            is_new: true,
            is_relaid: false,
            is_recorded: false,
            is_removed: false,
            frame: None,
            placed: None,
        }
    }
}

impl NetRegistry {
    /// The net of an entity.
    pub fn get(&self, entity: Entity) -> Option<&RegisteredNet> {
        self.entries.iter().find(|net| net.entity == entity && !net.is_removed)
    }

    /// The entities that take part or are to, in their order.
    pub fn entities(&self) -> impl Iterator<Item = Entity> {
        self.entries.iter().filter(|net| !net.is_removed).map(|net| net.entity)
    }

    fn push(&mut self, entity: Entity) {
        self.is_pending = true;
        self.entries.push(RegisteredNet::new(entity));
    }

    /// Registers those of the nets that are unknown, and drops those that do not exist: after another state was put
    /// in place.
    pub fn adopt(&mut self, mut present: Vec<Entity>) {
        for net in &mut self.entries {
            net.is_removed |= !present.contains(&net.entity);
        }
        present.sort_unstable_by_key(|entity| entity.index_u32());
        for entity in present {
            if self.get(entity).is_none() {
                self.push(entity);
            }
        }
        self.is_pending |= self.entries.iter().any(|net| net.is_removed);
    }

    /// Takes all slots away.
    pub fn reset_slots(&mut self) {
        self.is_pending = true;
        self.quarantined = 0;
        self.entries.iter_mut().for_each(|net| {
            net.place = None;
            net.frame = None;
        });
    }
}

impl MapEntities for NetRegistry {
    fn map_entities<M: EntityMapper>(&mut self, mapper: &mut M) {
        self.entries.iter_mut().for_each(|net| net.entity = mapper.get_mapped(net.entity));
    }
}

/// Registers a net.
pub(in crate::sync) fn register_net(
    added: On<Add, ParticleNet>,
    mut state: ResMut<MassSpringState>,
    mut simulation: ResMut<Simulation>,
) {
    touch(&mut state, &mut simulation);
    state.nets.push(added.entity);
}

/// Takes note that a net was inserted where one was: it is laid out anew.
pub(in crate::sync) fn mark_replaced(
    inserted: On<Insert, ParticleNet>,
    mut state: ResMut<MassSpringState>,
    mut simulation: ResMut<Simulation>,
) {
    touch(&mut state, &mut simulation);
    state.nets.is_pending = true;
    for net in state.nets.entries.iter_mut().filter(|net| net.entity == inserted.entity) {
        net.is_new = true;
    }
}

/// Takes note that an entity lost its net.
pub(in crate::sync) fn unregister_net(
    removed: On<Remove, ParticleNet>,
    mut state: ResMut<MassSpringState>,
    mut simulation: ResMut<Simulation>,
    mut warnings: ResMut<Warnings>,
) {
    warnings.clear(removed.entity);
    touch(&mut state, &mut simulation);
    state.nets.is_pending = true;
    for net in state.nets.entries.iter_mut().filter(|net| net.entity == removed.entity) {
        net.is_removed = true;
    }
}

/// Registers the nets that were spawned before the plugin was added.
pub(in crate::sync) fn register_existing_nets(world: &mut World) {
    let mut nets = world.query_filtered::<Entity, (With<ParticleNet>, Allow<Disabled>)>();
    let mut nets: Vec<Entity> = nets.iter(world).collect();
    nets.sort_unstable_by_key(|entity| entity.index_u32());
    let mut state = world.resource_mut::<MassSpringState>();
    nets.into_iter().for_each(|net| state.nets.push(net));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn particles_keep_their_numbers_in_any_slots() {
        let ranges = NetRanges { particles: 3..6, ..NetRanges::default() };
        let mut place = NetPlace::new(ranges);
        assert_eq!(
            (place.slot(2), place.particle(5), place.particle(6), place.first()),
            (5, Some(2), None, Some(3))
        );
        place.renumber(&[9, 9, 9, 7, 2, 4]);
        assert_eq!(place.slots().collect::<Vec<_>>(), [7, 2, 4]);
        assert_eq!([2, 4, 7, 5].map(|slot| place.particle(slot)), [Some(1), Some(2), Some(0), None]);
        assert_eq!(place.first(), None);
        place.renumber(&[0, 0, 11, 0, 12, 0, 0, 10]);
        assert_eq!((place.first(), place.particle(12)), (Some(10), Some(2)));
    }
}
