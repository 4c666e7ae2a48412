//! The part of the state that belongs to contacts: what the next ticks depend on, beside particles, springs and colliders.

use super::broad_phase::BroadPhase;
use super::contact_forces::ContactForces;
use super::pairs::Impulses;
use super::surface::Grip;
use crate::solver::state::Version;

/// What is remembered of the contacts from tick to tick: a part of the state of a simulation.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub struct ContactMemory {
    /// The last search for candidates; `None` where a new one is due.
    pub(super) broad_phase: Option<BroadPhase>,
    /// Whether slow particles have wide skins.
    pub(super) wide: bool,
    /// Number of substeps since the last search.
    pub(super) age: u32,
    /// Whether particles have many neighbours.
    pub(super) crowded: bool,
    /// The touching pairs, in the order in which they are solved.
    pub(super) contacts: Vec<RememberedContact>,
    /// The initially overlapping pairs of slots, the smaller first.
    pub(super) initial_overlaps: Vec<[u32; 2]>,
    /// The pairs that touched when both fell asleep, to go on from there.
    dormant: Vec<RememberedContact>,
    /// The initially overlapping pairs of particles that sleep.
    dormant_overlaps: Vec<[u32; 2]>,
    /// Where surfaces stick to each other.
    pub(super) grips: Vec<Grip>,
    /// The contacts of implicit steps.
    pub(in crate::solver) forces: ContactForces,
    /// Whether the particle in each slot was a sphere in the last search.
    pub(super) searched: Vec<bool>,
    pub(super) version: Version,
}

/// A pair that touched at the end of the last substep.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct RememberedContact {
    /// The upper particle and the lower one.
    pub slots: [u32; 2],
    pub impulses: Impulses,
}

impl ContactMemory {
    /// Resets it, as if the simulation had just started.
    pub fn clear(&mut self) {
        self.clear_pairs();
        self.forces = ContactForces::default();
    }

    /// Resets all but the forces in implicit steps.
    pub(super) fn clear_pairs(&mut self) {
        if !self.has_no_pairs() {
            let forces = std::mem::take(&mut self.forces);
            *self = Self { forces, version: Version::new(), ..Self::default() };
        }
    }

    /// Whether nothing is remembered of pairs and of the search for them.
    fn has_no_pairs(&self) -> bool {
        let Self {
            broad_phase,
            wide,
            age,
            crowded,
            contacts,
            initial_overlaps,
            dormant,
            dormant_overlaps,
            ..
        } = self;
        let any_contacts = !(contacts.is_empty() && dormant.is_empty() && self.grips.is_empty());
        let any_initial_overlaps = !(initial_overlaps.is_empty() && dormant_overlaps.is_empty());
        let has_searched =
            broad_phase.is_some() || *age > 0 || *wide || *crowded || !self.searched.is_empty();
        !(any_contacts || any_initial_overlaps || has_searched)
    }

    /// Whether nothing can touch among `count` particles as long as its free chains are free.
    pub(super) fn nothing_has_a_skin(&self, count: usize) -> bool {
        self.broad_phase.as_ref().is_some_and(|last| last.fits(count) && !last.any_skins)
    }

    /// Whether the last search has found free chains.
    pub fn any_chains(&self) -> bool {
        self.broad_phase.as_ref().is_some_and(|last| !last.chains.is_empty())
    }

    /// To be called when a radius, a mass or a spring has changed: the next tick searches for the pairs that
    /// may touch.
    pub fn request_search(&mut self) {
        self.broad_phase = None;
        self.version = Version::new();
    }

    /// Has the next tick search for pairs if other particles are spheres than in the last search: those of a radius, m, that
    /// are not `covered`.
    pub(super) fn check_spheres(&mut self, radius: &[f32], covered: &[bool]) {
        if self.broad_phase.is_none() {
            return;
        }
        let searched = &self.searched;
        let has_changed = if searched.len() > radius.len() {
            true
        } else if covered.is_empty() {
            // Without a way out: of this the compiler makes vectors.
            let spheres = searched.iter().zip(radius);
            spheres.fold(false, |any, (searched, radius)| any | ((*radius > 0.0) != *searched))
        } else {
            let is_sphere = |slot: usize| radius[slot] > 0.0 && covered.get(slot) != Some(&true);
            searched.iter().enumerate().any(|(slot, searched)| is_sphere(slot) != *searched)
        };
        if has_changed {
            self.request_search();
        }
    }

    /// To be called when particles have fallen asleep: `is_held` says which do, or are pinned.
    pub fn put_to_sleep(&mut self, is_held: impl Fn(usize) -> bool) {
        let are_held = |slots: &[u32; 2]| slots.iter().all(|slot| is_held(*slot as usize));
        let Self { contacts, initial_overlaps, dormant, dormant_overlaps, .. } = self;
        dormant.extend(contacts.extract_if(.., |contact| are_held(&contact.slots)));
        dormant_overlaps.extend(initial_overlaps.extract_if(.., |pair| are_held(pair)));
        self.request_search();
    }

    /// To be called when particles have woken: `is_asleep` says which have not.
    pub fn wake(&mut self, is_asleep: impl Fn(usize) -> bool) {
        let are_awake = |slots: &[u32; 2]| !slots.iter().any(|slot| is_asleep(*slot as usize));
        let Self { contacts, initial_overlaps, dormant, dormant_overlaps, .. } = self;
        contacts.extend(dormant.extract_if(.., |contact| are_awake(&contact.slots)));
        initial_overlaps.extend(dormant_overlaps.extract_if(.., |pair| are_awake(pair)));
        self.request_search();
    }

    /// To be called when the particle in a slot is another one or was put elsewhere: its contacts are
    /// removed, and the particles on springs that it overlaps now do not collide with it until they part.
    pub fn clear_particle(&mut self, slot: usize) {
        self.grips.retain(|grip| !grip.is_of(slot));
        self.forces.clear_particle(slot);
        if let Some(searched) = self.searched.get_mut(slot).filter(|searched| **searched) {
            *searched = false;
            self.request_search();
        }
    }

    /// To be called when the particles have got other slots: `new_slots[old]` is the new slot of each, any
    /// but the same twice; `None` for those that were removed. `count` is their new number.
    pub fn renumber(&mut self, new_slots: &[Option<u32>], count: usize) {
        let new_slot = |old: u32| new_slots.get(old as usize).copied().flatten();
        let new_pair = |pair: &mut [u32; 2]| {
            let [Some(one), Some(other)] = pair.map(new_slot) else { return false };
            *pair = [one, other];
            true
        };
        for contacts in [&mut self.contacts, &mut self.dormant] {
            contacts.retain_mut(|contact| new_pair(&mut contact.slots));
        }
        for initial_overlaps in [&mut self.initial_overlaps, &mut self.dormant_overlaps] {
            initial_overlaps.retain_mut(new_pair);
            initial_overlaps.iter_mut().for_each(|pair| pair.sort_unstable());
        }
        self.grips.retain_mut(|grip| grip.renumber(new_slot));
        self.forces.renumber(new_slot);
        let old = std::mem::replace(&mut self.searched, vec![false; count]);
        for (searched, new) in old.into_iter().zip(new_slots) {
            if let Some(place) = new.and_then(|new| self.searched.get_mut(new as usize)) {
                *place = searched;
            }
        }
        self.request_search();
    }

    /// The initially overlapping pairs of slots, the smaller first.
    pub(in crate::solver) fn initial_overlaps(&self) -> &[[u32; 2]] {
        &self.initial_overlaps
    }

    /// Whether the particles in two slots overlap ever since one of them was new.
    pub(in crate::solver) fn overlap_from_the_start(&self, one: u32, other: u32) -> bool {
        self.initial_overlaps.contains(&[one.min(other), one.max(other)])
    }

    /// Whether the particle in a slot has been through a search since it was added or put there.
    pub(in crate::solver) fn has_searched(&self, slot: u32) -> bool {
        self.searched.get(slot as usize) == Some(&true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn contact(slots: [u32; 2], normal: f32) -> RememberedContact {
        RememberedContact { slots, impulses: Impulses { normal, ..Impulses::default() } }
    }

    fn memory() -> ContactMemory {
        ContactMemory {
            broad_phase: Some(BroadPhase::default()),
            contacts: vec![contact([0, 1], 1.0), contact([1, 3], 2.0), contact([2, 3], 3.0)],
            initial_overlaps: vec![[0, 2], [0, 3]],
            searched: vec![true, true, false, true],
            ..ContactMemory::default()
        }
    }

    #[test]
    fn any_renumbering_keeps_what_is_known_of_the_particles_that_stay() {
        let mut memory = memory();
        let version = memory.version;
        memory.renumber(&[Some(4), Some(2), None, Some(0)], 5);
        assert_eq!(memory.contacts, [contact([4, 2], 1.0), contact([2, 0], 2.0)]);
        assert_eq!(memory.initial_overlaps, [[0, 4]]);
        assert_eq!(memory.searched, [true, false, true, false, true]);
        assert!(memory.broad_phase.is_none() && memory.version != version);
    }

    #[test]
    fn only_what_was_known_of_a_particle_can_be_forgotten() {
        let mut memory = memory();
        for (slot, changes) in [(2, false), (9, false), (1, true), (1, false)] {
            let version = memory.version;
            memory.clear_particle(slot);
            assert_eq!(memory.version != version, changes, "slot {slot}");
        }
        assert_eq!(memory.searched, [true, false, false, true]);
        assert!(memory.broad_phase.is_none());
    }

    #[test]
    fn nothing_survives_forgetting() {
        let mut memory = ContactMemory { wide: true, age: 7, crowded: true, ..memory() };
        memory.clear();
        assert!(
            memory.broad_phase.is_none() && memory.contacts.is_empty() && memory.initial_overlaps.is_empty()
        );
        assert!(memory.searched.is_empty() && !memory.wide && memory.age == 0 && !memory.crowded);
    }
}
