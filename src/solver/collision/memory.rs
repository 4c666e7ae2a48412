//! What the next ticks depend on, beside particles, springs and planes. All else is a cache of it.

use super::broad_phase::BroadPhase;
use super::pairs::Impulses;
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
    /// The entangled pairs of slots, the smaller first.
    pub(super) entangled: Vec<[u32; 2]>,
    /// Whether the particle in each slot was a sphere in the last search.
    pub(super) searched: Vec<bool>,
    pub(super) version: Version,
}

/// A pair that touched at the end of the last substep.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct RememberedContact {
    /// The smaller first.
    pub slots: [u32; 2],
    pub impulses: Impulses,
}

impl ContactMemory {
    /// Forgets everything, as if the simulation had just started.
    pub fn forget(&mut self) {
        *self = Self { version: Version::new(), ..Self::default() };
    }

    /// To be called when a radius, a mass or a spring has changed: the next tick searches for the pairs that
    /// may touch.
    pub fn request_search(&mut self) {
        self.broad_phase = None;
        self.version = Version::new();
    }

    /// To be called when the particle in a slot is another one or was put elsewhere: its contacts are
    /// forgotten, and the particles on springs that it overlaps now do not collide with it until they part.
    pub fn forget_particle(&mut self, slot: usize) {
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
            *pair = [one.min(other), one.max(other)];
            true
        };
        self.contacts.retain_mut(|contact| new_pair(&mut contact.slots));
        self.entangled.retain_mut(new_pair);
        let old = std::mem::replace(&mut self.searched, vec![false; count]);
        for (searched, new) in old.into_iter().zip(new_slots) {
            if let Some(place) = new.and_then(|new| self.searched.get_mut(new as usize)) {
                *place = searched;
            }
        }
        self.request_search();
    }

    /// Whether the particle in a slot has been through a search since it was added or put there.
    pub(super) fn has_searched(&self, slot: u32) -> bool {
        self.searched.get(slot as usize) == Some(&true)
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::TAU;

    use bevy::math::{Quat, Vec3};

    use super::*;
    use crate::solver::collision::ContactCaches;
    use crate::solver::{PairRules, Plane, Scheme, SolverState, StepSettings, step};

    fn contact(slots: [u32; 2], normal: f32) -> RememberedContact {
        RememberedContact { slots, impulses: Impulses { normal, ..Impulses::default() } }
    }

    fn memory() -> ContactMemory {
        ContactMemory {
            broad_phase: Some(BroadPhase::default()),
            contacts: vec![contact([0, 1], 1.0), contact([1, 3], 2.0), contact([2, 3], 3.0)],
            entangled: vec![[0, 2], [0, 3]],
            searched: vec![true, true, false, true],
            ..ContactMemory::default()
        }
    }

    #[test]
    fn any_renumbering_keeps_what_is_known_of_the_particles_that_stay() {
        let mut memory = memory();
        let version = memory.version;
        memory.renumber(&[Some(4), Some(2), None, Some(0)], 5);
        assert_eq!(memory.contacts, [contact([2, 4], 1.0), contact([0, 2], 2.0)]);
        assert_eq!(memory.entangled, [[0, 4]]);
        assert_eq!(memory.searched, [true, false, true, false, true]);
        assert!(memory.broad_phase.is_none() && memory.version != version);
    }

    #[test]
    fn only_what_was_known_of_a_particle_can_be_forgotten() {
        let mut memory = memory();
        for (slot, changes) in [(2, false), (9, false), (1, true), (1, false)] {
            let version = memory.version;
            memory.forget_particle(slot);
            assert_eq!(memory.version != version, changes, "slot {slot}");
        }
        assert_eq!(memory.searched, [true, false, false, true]);
        assert!(memory.broad_phase.is_none());
    }

    #[test]
    fn nothing_survives_forgetting() {
        let mut memory = ContactMemory { wide: true, age: 7, crowded: true, ..memory() };
        memory.forget();
        assert!(memory.broad_phase.is_none() && memory.contacts.is_empty() && memory.entangled.is_empty());
        assert!(memory.searched.is_empty() && !memory.wide && memory.age == 0 && !memory.crowded);
    }

    /// A floor that tilts, a wall, and above them balls of three sizes.
    fn pile() -> SolverState {
        let mut state = SolverState::default();
        for ball in 0..60_u16 {
            let [column, row, layer] = [ball % 4, ball / 4 % 4, ball / 16].map(f32::from);
            let jitter = Vec3::new(f32::from(ball * 7 % 11), 0.0, f32::from(ball * 5 % 13)) * 0.003;
            let place = Vec3::new(column, layer + 0.5, row) * 0.22 + jitter;
            let radius = [0.1, 0.08, 0.05][usize::from(ball % 3)];
            state.particles.push(place, Vec3::NEG_Y * (2.0 + layer), 0.3 + radius, radius);
        }
        let mut floor = Plane::resting(Vec3::ZERO, Vec3::Y, 0.1, 0.4);
        floor.target.rotation *= Quat::from_rotation_z(0.01);
        let wall = Plane::resting(Vec3::X * -0.1, Vec3::X, 0.1, 0.4);
        state.planes.extend([floor, wall]);
        state
    }

    /// The pile, and falling into it two ropes: one thin, one so thick that it overlaps itself and is crowded.
    fn pile_with_ropes() -> SolverState {
        let mut state = pile();
        for (radius, height) in [(0.04, 1.4), (0.22, 2.2)] {
            let start = state.particles.len();
            for link in 0..30_usize {
                let (sin, cos) = bevy::math::ops::sin_cos(link as f32 / 30.0 * TAU);
                let place = Vec3::new(0.4 + 0.45 * sin, height, 0.4 + 0.45 * cos);
                state.particles.push(place, Vec3::NEG_Y * 3.0, 0.1, radius);
                if link > 0 {
                    state.springs.push(start + link - 1, start + link, 0.1, 200.0, 0.2);
                }
            }
        }
        state
    }

    fn settings(scheme: Scheme) -> StepSettings {
        StepSettings {
            scheme,
            substeps: 6,
            gravity: Vec3::NEG_Y * 9.81,
            pair_rules: Some(PairRules { restitution: 0.3, friction: 0.4 }),
            ..StepSettings::default()
        }
    }

    fn bits(state: &SolverState) -> Vec<u32> {
        let vectors = [&state.particles.position, &state.particles.velocity];
        vectors.iter().flat_map(|vectors| vectors.axes()).flatten().map(|value| value.to_bits()).collect()
    }

    /// What a game does in between.
    fn interfere(state: &mut SolverState, settings: &mut StepSettings, tick: u32) {
        let radius = &mut state.particles.radius[3];
        match tick {
            20 => {
                state.particles.position.set(5, Vec3::new(0.4, 1.0, 0.4));
                state.contacts.forget_particle(5);
            }
            30 => {
                *radius *= 1.5;
                state.contacts.request_search();
            }
            _ => {}
        }
        let rules = PairRules { restitution: 0.3, friction: 0.4 };
        settings.pair_rules = (!(40..43).contains(&tick)).then_some(rules);
    }

    /// The memory as it was written and read.
    fn restored(memory: &ContactMemory) -> ContactMemory {
        #[cfg(feature = "scene")]
        return ron::from_str(&ron::to_string(memory).expect("a memory can be written"))
            .expect("what was written can be read");
        #[cfg(not(feature = "scene"))]
        ContactMemory { version: Version::new(), ..memory.clone() }
    }

    /// Ticks with the caches of the tick before, with new caches, and with a restored memory, are the same.
    #[test]
    fn ticks_depend_on_no_cache() {
        let (mut entangled, mut crowded, mut wide, mut searched_within_ticks) = (0, false, false, 0);
        for (start, scheme) in Scheme::ALL
            .map(|scheme| (pile_with_ropes(), scheme))
            .into_iter()
            .chain([(pile(), Scheme::SemiImplicitEuler)])
        {
            let [mut state, mut without, mut resumed] = [start.clone(), start.clone(), start];
            let mut settings = settings(scheme);
            for tick in 0..80 {
                without.contact_caches = ContactCaches::default();
                resumed.contacts = restored(&resumed.contacts);
                for state in [&mut state, &mut without, &mut resumed] {
                    interfere(state, &mut settings, tick);
                    step(state, &settings);
                }
                let expected = bits(&state);
                assert!(bits(&without) == expected, "{scheme:?}, tick {tick}: without caches");
                assert!(bits(&resumed) == expected, "{scheme:?}, tick {tick}: with a restored memory");
                let counts = [&state, &without, &resumed].map(SolverState::contact_count);
                assert_eq!(counts, [counts[0]; 3], "{scheme:?}, tick {tick}");
                let ContactMemory { age, .. } = state.contacts;
                entangled = entangled.max(state.contacts.entangled.len());
                crowded |= state.contacts.crowded;
                wide |= state.contacts.wide;
                searched_within_ticks += u32::from((1..5).contains(&age));
            }
        }
        assert!(entangled > 10 && crowded && wide && searched_within_ticks > 50);
    }

    /// A copy goes on as the state did, long after that has gone on itself.
    #[test]
    fn a_copy_goes_on_alike() {
        let mut state = pile_with_ropes();
        let settings = settings(Scheme::SemiImplicitEuler);
        (0..40).for_each(|_| step(&mut state, &settings));
        let copy = SolverState { contact_caches: ContactCaches::default(), ..state.clone() };
        let memory = state.contacts.clone();
        let particles = state.particles.clone();
        let history: Vec<_> = (0..20)
            .map(|_| {
                step(&mut state, &settings);
                bits(&state)
            })
            .collect();
        // Back in time, with the caches of the present.
        state.contacts = memory;
        state.particles = particles;
        for mut state in [copy, state] {
            for expected in &history {
                step(&mut state, &settings);
                assert!(bits(&state) == *expected);
            }
        }
    }

    /// Particles in the opposite order move as before, to the bit, which they do not without warm start.
    #[test]
    fn renumbering_keeps_the_warm_start() {
        let mut state = pile();
        let settings = settings(Scheme::SemiImplicitEuler);
        (0..60).for_each(|_| step(&mut state, &settings));
        let count = state.particles.len();
        let [mut renumbered, mut forgetful] = [state.clone(), state.clone()];
        forgetful.contacts.forget();
        for slot in 0..count {
            let (new, old) = (&mut renumbered.particles, &state.particles);
            let place = count - 1 - slot;
            new.position.set(place, old.position.get(slot));
            new.velocity.set(place, old.velocity.get(slot));
            new.radius[place] = old.radius[slot];
            new.inverse_mass[place] = old.inverse_mass[slot];
        }
        let new_slots: Vec<_> = (0..count as u32).rev().map(Some).collect();
        renumbered.contacts.renumber(&new_slots, count);
        state.contacts.request_search();
        for state in [&mut state, &mut renumbered, &mut forgetful] {
            step(state, &settings);
        }
        let position = |state: &SolverState, slot: usize| state.particles.position.get(slot);
        assert!((0..count).all(|slot| position(&renumbered, count - 1 - slot) == position(&state, slot)));
        assert!(bits(&forgetful) != bits(&state));
    }
}
