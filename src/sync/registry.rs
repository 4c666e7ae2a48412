//! Which entities take part: their identity, in the order of spawning, and their slots.
//!
//! Slots follow that order, never the order of queries, so that results do not depend on how entities
//! move between archetypes.

use std::marker::PhantomData;

use bevy::ecs::entity::{EntityHashMap, EntityHashSet, EntityMapper, MapEntities};
use bevy::platform::collections::HashSet;
use bevy::prelude::*;

/// The registration of an entity with the component `T`, and its slot in the solver.
#[derive(Component, Debug)]
#[component(clone_behavior = Ignore)]
pub(super) struct Slot<T: Send + Sync + 'static> {
    slot: u32,
    serial: u64,
    component: PhantomData<T>,
}

impl<T: Send + Sync + 'static> Default for Slot<T> {
    fn default() -> Self {
        Self { slot: u32::MAX, serial: u64::MAX, component: PhantomData }
    }
}

impl<T: Send + Sync + 'static> Slot<T> {
    /// The slot in the solver; `None` for an entity that is left out.
    pub fn get(&self) -> Option<usize> {
        (self.slot != u32::MAX).then_some(self.slot as usize)
    }

    /// Whether a registry has the entity.
    pub fn is_registered(&self) -> bool {
        self.serial != u64::MAX
    }

    /// Gives the entity a slot or takes it away.
    pub fn set(&mut self, slot: Option<usize>) {
        self.slot = slot.map_or(u32::MAX, |slot| slot as u32);
    }
}

/// The registration of an entity. It is void when the entity's own has another serial number.
#[derive(Debug, Clone, Copy)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Entry {
    pub entity: Entity,
    serial: u64,
    /// Whether its initial state has been recorded.
    pub is_recorded: bool,
}

/// All entities with one component, in the order in which they got it.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Registry {
    pub entries: Vec<Entry>,
    /// The entity in each slot of the solver; a placeholder in an empty one.
    pub slots: Vec<Entity>,
    /// Number of entries that have been processed: those after them are new.
    processed: usize,
    /// Slots of entities that have lost the component since.
    pub removed: Vec<u32>,
    /// Number of empty slots.
    vacant: usize,
    next_serial: u64,
}

impl Registry {
    /// Adds an entity at the end. An entry that it had before is void from now on.
    pub fn add<T: Send + Sync + 'static>(&mut self, entity: Entity, slot: &mut Slot<T>) {
        slot.serial = self.next_serial;
        slot.set(None);
        self.entries.push(Entry { entity, serial: self.next_serial, is_recorded: false });
        self.next_serial += 1;
    }

    /// Number of entities added and removed since the last time.
    pub fn pending(&self) -> usize {
        self.entries.len() - self.processed + self.removed.len()
    }

    /// Number of entities in the simulation.
    pub fn live(&self) -> usize {
        self.slots.len() - self.vacant
    }

    /// Whether one in `share` slots is empty or pending, or more are; `others` are pending beside those known here.
    pub fn is_fragmented(&self, others: usize, share: usize) -> bool {
        (self.pending() + others + self.vacant) * share > self.slots.len()
    }

    /// Takes all slots away, so that every entry is processed again.
    pub fn reset_slots(&mut self) {
        self.slots.clear();
        self.removed.clear();
        (self.processed, self.vacant) = (0, 0);
    }

    /// The entries that were added since the last time; to be [put back](Self::put_back).
    pub fn take_new(&mut self) -> Vec<Entry> {
        self.entries.split_off(self.processed)
    }

    /// Puts back those entries that were processed and stay.
    pub fn put_back(&mut self, entries: Vec<Entry>) {
        self.entries.extend(entries);
        self.processed = self.entries.len();
    }

    /// Empties a slot; returns whether it was in use.
    pub fn vacate(&mut self, slot: usize) -> bool {
        let was_used = std::mem::replace(&mut self.slots[slot], Entity::PLACEHOLDER) != Entity::PLACEHOLDER;
        self.vacant += usize::from(was_used);
        was_used
    }

    /// The entities in the order of their registration, each once.
    pub fn entities(&self) -> impl DoubleEndedIterator<Item = Entity> {
        let mut known = EntityHashSet::default();
        let mut entities: Vec<Entity> = self.entries.iter().rev().map(|entry| entry.entity).collect();
        entities.retain(|entity| known.insert(*entity));
        entities.into_iter().rev()
    }

    /// Calls `assign` for each registration, with the slot that its entity has, and whether no tick has processed it
    /// yet. Where it returns `false` the entity is gone, and its slot is to be emptied.
    pub fn adopt(&mut self, mut assign: impl FnMut(&Entry, Option<usize>, bool) -> bool) {
        let slot_of: EntityHashMap<usize> = self.slots.iter().copied().zip(0..).collect();
        let mut removed: HashSet<u32> = self.removed.iter().copied().collect();
        for (index, entry) in self.entries.iter().enumerate() {
            let (slot, is_new) = (slot_of.get(&entry.entity).copied(), index >= self.processed);
            // One that lost the component and got it again has another slot by the next tick.
            let is_present = assign(entry, slot.filter(|_| !is_new), is_new);
            let freed = slot.filter(|_| is_new || !is_present).map(|slot| slot as u32);
            self.removed.extend(freed.filter(|slot| removed.insert(*slot)));
        }
    }
}

impl MapEntities for Registry {
    fn map_entities<M: EntityMapper>(&mut self, mapper: &mut M) {
        self.entries.iter_mut().for_each(|entry| entry.entity = mapper.get_mapped(entry.entity));
        self.slots.iter_mut().filter(|entity| **entity != Entity::PLACEHOLDER).for_each(|entity| {
            *entity = mapper.get_mapped(*entity);
        });
    }
}

impl Entry {
    /// Whether this entry is the one under which the entity is registered.
    pub fn is_valid<T: Send + Sync + 'static>(&self, slot: &Slot<T>) -> bool {
        self.serial == slot.serial
    }

    /// Registers the entity of this entry with `slot`.
    pub fn assign<T: Send + Sync + 'static>(&self, to: &mut Slot<T>, slot: Option<usize>) {
        to.serial = self.serial;
        to.set(slot);
    }
}
