//! Who exists, in the order of spawning.
//!
//! Slots follow that order, never the order of queries, so that results do not depend on how entities
//! move between archetypes.

use std::marker::PhantomData;

use bevy::prelude::*;

/// Where an entity with the component `T` stands: its number in the roster and its slot in the solver.
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

    /// Gives the entity a slot or takes it away.
    pub fn set(&mut self, slot: Option<usize>) {
        self.slot = slot.map_or(u32::MAX, |slot| slot as u32);
    }
}

/// One entity that has or had the component.
#[derive(Debug)]
pub(super) struct Entry<Initial> {
    pub entity: Entity,
    serial: u64,
    /// Its initial state, from the first tick that saw it.
    pub initial: Option<Initial>,
}

/// All entities with one component, in the order in which they got it.
#[derive(Debug)]
pub(super) struct Roster<Initial> {
    pub entries: Vec<Entry<Initial>>,
    /// The entity in each slot of the solver; a placeholder in a slot that somebody left.
    pub slots: Vec<Entity>,
    /// How many of the entries have been looked at: those after them have just come.
    seen: usize,
    /// The slots of those that have left since.
    pub departed: Vec<usize>,
    /// How many slots are empty.
    pub vacant: usize,
    next_serial: u64,
}

impl<Initial> Default for Roster<Initial> {
    fn default() -> Self {
        Self {
            entries: Vec::new(),
            slots: Vec::new(),
            seen: 0,
            departed: Vec::new(),
            vacant: 0,
            next_serial: 0,
        }
    }
}

impl<Initial> Roster<Initial> {
    /// Adds an entity at the end. An entry that it had before is void from now on.
    pub fn enroll<T: Send + Sync + 'static>(&mut self, entity: Entity, slot: &mut Slot<T>) {
        slot.serial = self.next_serial;
        slot.set(None);
        self.entries.push(Entry { entity, serial: self.next_serial, initial: None });
        self.next_serial += 1;
    }

    /// How many came and left since the last look.
    pub fn news(&self) -> usize {
        self.entries.len() - self.seen + self.departed.len()
    }

    /// How many are in the simulation.
    pub fn live(&self) -> usize {
        self.slots.len() - self.vacant
    }

    /// Forgets all slots, so that every entry is looked at again.
    pub fn start_anew(&mut self) {
        self.slots.clear();
        self.departed.clear();
        (self.seen, self.vacant) = (0, 0);
    }

    /// The entries that came since the last look; to be [put back](Self::put_back).
    pub fn new_entries(&mut self) -> Vec<Entry<Initial>> {
        self.entries.split_off(self.seen)
    }

    /// Puts back those entries that were looked at and stay.
    pub fn put_back(&mut self, entries: Vec<Entry<Initial>>) {
        self.entries.extend(entries);
        self.seen = self.entries.len();
    }

    /// Empties a slot; says whether anybody was in it.
    pub fn vacate(&mut self, slot: usize) -> bool {
        let left = std::mem::replace(&mut self.slots[slot], Entity::PLACEHOLDER) != Entity::PLACEHOLDER;
        self.vacant += usize::from(left);
        left
    }
}

impl<Initial> Entry<Initial> {
    /// Whether this entry is the one under which the entity is enrolled.
    pub fn is_valid<T: Send + Sync + 'static>(&self, slot: &Slot<T>) -> bool {
        self.serial == slot.serial
    }
}
