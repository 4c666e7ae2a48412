//! What candidates take from the memory of contacts, and give to it.

use super::candidates::Candidates;
use super::list::{PairHistory, slots};
use super::memory::{ContactMemory, RememberedContact};
use super::pairs::PairContacts;
use crate::solver::particles::{Particles, Vectors};
use crate::solver::state::Version;

impl Candidates {
    /// Writes the contacts into the memory.
    pub fn store(&mut self, memory: &mut ContactMemory, contacts: &PairContacts) {
        if !std::mem::take(&mut self.ahead) {
            return;
        }
        let ContactMemory { contacts: remembered, initial_overlaps, version, .. } = memory;
        remembered.clear();
        initial_overlaps.clear();
        for group in self.groups.iter() {
            let slot = |place: usize| self.regions.slot_of[group.bodies.start + place];
            remembered.extend(contacts.of(group).iter().map(|contact| RememberedContact {
                slots: [slot(contact.first()), slot(contact.second())],
                impulses: contact.impulses,
            }));
            if group.any_initial_overlaps {
                let pairs = &self.list.pairs[group.pairs.clone()];
                let pairs = pairs.iter().filter(|pair| pair.history == PairHistory::InitialOverlap);
                initial_overlaps.extend(pairs.map(|pair| slots(&self.regions.slot_of, pair)));
            }
        }
        *version = Version::new();
        (self.version, self.exclusions_version) = (Some(*version), Some(*version));
    }

    /// Gives the listed pairs the history that the memory holds.
    pub fn recall(&mut self, memory: &ContactMemory, contacts: &mut PairContacts) {
        let Self { list, regions, .. } = self;
        list.index(&regions.slot_of);
        contacts.reserve(list.pairs.len());
        let are_known = |slots: &[u32; 2]| slots.iter().all(|slot| memory.has_searched(*slot));
        for contact in memory.contacts.iter().filter(|contact| are_known(&contact.slots)) {
            let [upper, lower] = contact.slots;
            if let Some(place) = list.find([upper.min(lower), upper.max(lower)]) {
                let pair = &mut list.pairs[place];
                pair.history = PairHistory::Contact(place as u32);
                let has_turned = regions.slot_of[pair.upper as usize] != upper;
                contacts.current[place].impulses =
                    if has_turned { contact.impulses.of_other() } else { contact.impulses };
            }
        }
        for slots in memory.initial_overlaps.iter().filter(|slots| are_known(slots)) {
            if let Some(place) = list.find(*slots) {
                list.pairs[place].history = PairHistory::InitialOverlap;
            }
        }
    }

    /// Finds the pairs on springs that overlap when one of them is new: they do not collide until they part.
    /// From now on no particle is new.
    pub fn mark_initial_overlaps(
        &mut self,
        memory: &mut ContactMemory,
        particles: &Particles,
        previous: &Vectors,
    ) {
        let Self { list, exclusions, regions, .. } = self;
        let are_new = |slots: [u32; 2]| !slots.iter().all(|slot| memory.has_searched(*slot));
        let overlap = |[a, b]: [usize; 2]| {
            let reach = particles.radius()[a] + particles.radius()[b];
            previous.get(a).distance_squared(previous.get(b)) < reach * reach
        };
        if exclusions.any_sprung() {
            for pair in list.pairs.iter_mut().filter(|pair| pair.history == PairHistory::Apart) {
                let slots = slots(&regions.slot_of, pair);
                let ends = slots.map(|slot| slot as usize);
                if ends.iter().all(|slot| exclusions.is_sprung(*slot)) && are_new(slots) && overlap(ends) {
                    pair.history = PairHistory::InitialOverlap;
                }
            }
        }
        memory.searched.clear();
        let is_sphere = |(slot, radius): (usize, &f32)| *radius > 0.0 && !exclusions.is_covered(slot);
        memory.searched.extend(particles.radius().iter().enumerate().map(is_sphere));
    }
}
