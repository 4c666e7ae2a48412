//! The pairs of particles that may touch: searched anew when the last search has become invalid, else derived from it.

use crate::solver::elements::Elements;
use crate::solver::graph::Exclusions;
use crate::solver::particles::{Particles, Vectors};
use crate::solver::state::Version;

use super::Substep;
use super::broad_phase::{BroadPhase, should_be_wide};
use super::chain_search::ChainSearch;
use super::chains::{ChainPurpose, ChainQuery, Proof};
use super::crowds::is_crowd;
use super::grid::Grid;
use super::list::List;
use super::memory::ContactMemory;
use super::pairs::PairContacts;
use super::regions::{Groups, Regions};

/// Number of pairs a particle from which on particles are crowded: thick skins then cost more than they save.
const CROWDED_PAIRS: usize = 8;

/// Number of pairs a particle below which they are crowded no longer.
const SCATTERED_PAIRS: usize = 1;

/// The candidate pairs, a cache of [`ContactMemory`].
#[derive(Debug, Clone, Default)]
pub(super) struct Candidates {
    /// In groups, each from the bottom of the world to the top.
    pub list: List,
    pub grid: Grid,
    /// The found pairs of slots.
    found: Vec<(u32, u32)>,
    pub exclusions: Exclusions,
    pub covered: Vec<bool>,
    chain_search: ChainSearch,
    /// Whether the free chains of the last search were so in this substep.
    pub proof: Proof,
    pub regions: Regions,
    pub groups: Groups,
    /// The memory from which all this follows.
    pub version: Option<Version>,
    /// The memory for which the exclusions were derived from springs, masses and radii.
    pub exclusions_version: Option<Version>,
    /// Whether contacts have been found since then that the memory does not hold yet.
    pub ahead: bool,
    /// Whether the list has been refreshed for the sweeps of this substep.
    is_refreshed: bool,
}

impl Candidates {
    /// There are `count` particles, and no pairs among them.
    pub fn disable(&mut self, memory: &mut ContactMemory, count: usize) {
        memory.clear_pairs();
        self.list.clear();
        self.groups.clear();
        self.regions.set_single(count);
        self.version = None;
        self.ahead = false;
    }

    /// Makes the list good for the present positions, and recalls in `contacts` the impulses of the substep
    /// before. `previous` are the positions at the start of the substep, m.
    pub fn refresh(
        &mut self,
        memory: &mut ContactMemory,
        contacts: &mut PairContacts,
        paths: (&Particles, &Vectors),
        substep: Substep,
    ) {
        let last = memory.broad_phase.as_ref().filter(|last| last.fits(paths.0.len()));
        let exceeded = last.map(|last| self.is_exceeded(last, paths.0));
        self.refresh_exclusions(memory, paths.0, substep.elements);
        if !std::mem::take(&mut self.is_refreshed) {
            memory.age = memory.age.saturating_add(1);
        }
        if exceeded == Some(true) {
            memory.wide = should_be_wide(memory.wide, memory.age);
        }
        if exceeded != Some(false) {
            return self.renew(memory, contacts, paths, substep, ChainPurpose::ForSubsteps);
        }
        self.derive(memory, contacts, paths.0);
        self.version = Some(memory.version);
        self.ahead = true;
    }

    /// Searches anew before the sweeps of a substep, if the last search has become invalid. Whether the list then holds all pairs that
    /// touch on their ways, as all have moved by less than their new skins.
    pub fn refresh_for_sweep(
        &mut self,
        memory: &mut ContactMemory,
        contacts: &mut PairContacts,
        paths: (&Particles, &Vectors),
        substep: Substep,
    ) -> bool {
        let last = memory.broad_phase.as_ref().filter(|last| last.fits(paths.0.len()));
        if last.is_none_or(|last| !self.is_exceeded(last, paths.0)) {
            return true;
        }
        self.refresh(memory, contacts, paths, substep);
        // The contacts of this substep have not been found yet: the memory holds the last ones.
        (self.is_refreshed, self.ahead) = (true, false);
        let last = memory.broad_phase.as_ref();
        last.is_some_and(|last| last.chains.is_empty() && last.covers_way_from(paths.1))
    }

    /// Makes a new search, and recalls in `contacts` the impulses of the substep before. `purpose`: what for.
    pub fn renew(
        &mut self,
        memory: &mut ContactMemory,
        contacts: &mut PairContacts,
        (particles, previous): (&Particles, &Vectors),
        substep: Substep,
        purpose: ChainPurpose,
    ) {
        self.store(memory, contacts);
        memory.age = 0;
        self.search_anew(memory, particles, substep, purpose);
        self.recall(memory, contacts);
        self.mark_initial_overlaps(memory, particles, previous);
        self.version = Some(memory.version);
        self.ahead = true;
    }

    /// Makes the exclusions those of the present springs.
    pub fn refresh_exclusions(&mut self, memory: &ContactMemory, particles: &Particles, elements: &Elements) {
        if self.exclusions_version != Some(memory.version) {
            self.exclusions.rebuild(particles, elements, &self.covered);
            self.exclusions_version = Some(memory.version);
        }
    }

    /// Whether pairs may touch that the last search has not found.
    fn is_exceeded(&self, last: &BroadPhase, particles: &Particles) -> bool {
        self.proof != Proof::Holds || last.skin_exceeded(particles)
    }

    /// Derives the list from the last search again, if that is good and the list does not follow from it already.
    pub fn derive(&mut self, memory: &ContactMemory, contacts: &mut PairContacts, particles: &Particles) {
        let Some(last) = memory.broad_phase.as_ref().filter(|last| last.fits(particles.len())) else {
            return;
        };
        if self.version != Some(memory.version) && !self.is_exceeded(last, particles) {
            self.search(last, particles);
            self.sort_bottom_up(last, particles.radius());
            self.recall(memory, contacts);
            self.version = Some(memory.version);
        }
    }

    /// The pairs of slots that may touch, if the last search is still good.
    pub fn found_pairs(&self, memory: &ContactMemory, particles: &Particles) -> Option<&[(u32, u32)]> {
        let last = memory.broad_phase.as_ref().filter(|last| last.fits(particles.len()))?;
        (self.version == Some(memory.version) && !self.is_exceeded(last, particles)).then_some(&self.found)
    }

    /// Checks whether the free chains still are.
    pub fn check_chains(
        &mut self,
        memory: &mut ContactMemory,
        particles: &Particles,
        substep: Substep,
    ) -> Proof {
        self.refresh_exclusions(memory, particles, substep.elements);
        let last = memory.broad_phase.as_mut().filter(|last| last.fits(particles.len()));
        let time_step = substep.settings.time_step;
        self.proof =
            last.map_or(Proof::Fails, |last| last.check_chains(particles, &self.exclusions, time_step));
        self.proof
    }

    /// Searches the pairs at the present positions.
    fn search_anew(
        &mut self,
        memory: &mut ContactMemory,
        particles: &Particles,
        substep: Substep,
        purpose: ChainPurpose,
    ) {
        let time_step = substep.settings.time_step;
        let ContactMemory { broad_phase, wide, crowded, .. } = memory;
        let broad_phase = broad_phase.get_or_insert_default();
        broad_phase.start(particles, substep.up());
        broad_phase.choose_skins(particles, &self.exclusions, (*wide, *crowded), time_step);
        let query = ChainQuery {
            time_step,
            substep: substep.duration,
            gravity: substep.settings.gravity.length(),
            purpose,
        };
        broad_phase.find_chains(&mut self.chain_search, particles, &self.exclusions, query);
        self.search(broad_phase, particles);
        if !*crowded && self.found.len() > CROWDED_PAIRS * particles.len() {
            *crowded = true;
            broad_phase.choose_skins(particles, &self.exclusions, (*wide, *crowded), time_step);
            broad_phase.remove_chain_skins();
            self.search(broad_phase, particles);
        }
        *crowded &= self.found.len() >= SCATTERED_PAIRS * particles.len();
        self.sort_bottom_up(broad_phase, particles.radius());
    }

    /// Finds the pairs of a search. Of those on springs all, as those that overlap from the start must be known.
    fn search(&mut self, broad_phase: &BroadPhase, particles: &Particles) {
        let Self { grid, found, exclusions, .. } = self;
        let BroadPhase { origins, skins, .. } = broad_phase;
        let (radius, inverse_mass) = (particles.radius(), particles.inverse_mass());
        let spheres = (0..radius.len())
            .filter(|slot| broad_phase.has_skin(*slot))
            .map(|slot| (slot as u32, origins.get(slot), radius[slot] + skins[slot]));
        let may_collide = |a: u32, b: u32| {
            let free = inverse_mass[a as usize] + inverse_mass[b as usize] > 0.0;
            free && !exclusions.contains(a.min(b), a.max(b))
        };
        let sphere = |slot: u32| (origins.get(slot as usize), radius[slot as usize]);
        let is_crowded = |slot: u32, listed: &[(u32, u32)]| {
            !exclusions.is_sprung(slot as usize) && is_crowd(listed, sphere)
        };
        grid.find_pairs(spheres, (may_collide, is_crowded), found);
    }

    /// Divides the found pairs into groups, and lists those of each from the bottom up.
    fn sort_bottom_up(&mut self, broad_phase: &BroadPhase, radius: &[f32]) {
        let (Self { list, found, regions, groups, .. }, BroadPhase { origins, up, .. }) = (self, broad_phase);
        regions.divide(origins, radius, *up);
        list.arrange(found, regions, groups, (origins, *up));
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::Vec3;

    use super::super::list::{PairHistory, slots};
    use super::super::memory::RememberedContact;
    use super::super::pairs::Impulses;
    use super::*;
    use crate::solver::elements::Spring;
    use crate::solver::settings::{Integrator, StepSettings};

    /// Longer than the radii: it excludes no pair.
    const LONG: Spring = Spring::elastic(1.8, 1.0, 0.0);

    fn row(spacing: f32, count: usize) -> Particles {
        let mut particles = Particles::default();
        for slot in 0..count {
            particles.push(Vec3::X * spacing * slot as f32, Vec3::ZERO, 1.0, 0.5);
        }
        particles
    }

    /// The memory and what follows from it.
    #[derive(Default)]
    struct Pairs {
        memory: ContactMemory,
        candidates: Candidates,
        contacts: PairContacts,
        elements: Elements,
    }

    impl Pairs {
        /// Refreshes the candidates and lists them, each pair in the order of its slots.
        fn refresh(&mut self, particles: &Particles) -> Vec<[u32; 2]> {
            let Self { memory, candidates, contacts, elements } = self;
            let settings = &StepSettings { gravity: Vec3::NEG_Y, time_step: 0.01, ..StepSettings::default() };
            let (colliders, properties, acceleration) = (&[], &[], &Vectors::default());
            let (integrator, duration, elapsed) = (Integrator::SemiImplicitEuler, 0.01, 1.0);
            let substep = Substep {
                elements,
                colliders,
                properties,
                acceleration,
                settings,
                integrator,
                duration,
                elapsed,
            };
            candidates.refresh(memory, contacts, (particles, &particles.position), substep);
            // No narrow phase follows.
            candidates.ahead = false;
            let Candidates { list, regions, .. } = candidates;
            let mut pairs: Vec<_> = list.pairs.iter().map(|pair| slots(&regions.slot_of, pair)).collect();
            pairs.sort_unstable();
            pairs
        }

        /// The impulses that the pair of two slots had, if it touched.
        fn impulses(&self, slots: [u32; 2]) -> Option<Impulses> {
            match self.history(slots) {
                PairHistory::Contact(contact) => Some(self.contacts.current[contact as usize].impulses),
                _ => None,
            }
        }

        fn history(&self, slots: [u32; 2]) -> PairHistory {
            let List { pairs, .. } = &self.candidates.list;
            pairs[self.candidates.list.find(slots).expect("the pair is listed")].history
        }
    }

    #[test]
    fn the_history_survives_searches_and_renumbering() {
        let mut particles = row(1.0, 4);
        let mut pairs = Pairs::default();
        assert_eq!(pairs.refresh(&particles), [[0, 1], [1, 2], [2, 3]]);
        // Of particles at the same height, the one in the larger slot counts as the upper one.
        let impulses = Impulses { normal: 7.0, friction: Vec3::Z };
        pairs.memory.contacts.push(RememberedContact { slots: [3, 2], impulses });

        particles.position.set(0, Vec3::X * -5.0);
        assert_eq!(pairs.refresh(&particles), [[1, 2], [2, 3]]);
        assert_eq!(pairs.impulses([2, 3]), Some(impulses));
        assert_eq!(pairs.impulses([1, 2]), None);

        // The row in the other direction, its first particle removed.
        pairs.memory.renumber(&[None, Some(2), Some(1), Some(0)], 3);
        particles = row(1.0, 3);
        assert_eq!(pairs.refresh(&particles), [[0, 1], [1, 2]]);
        let turned = Impulses { friction: -Vec3::Z, ..impulses };
        assert_eq!(pairs.impulses([0, 1]), Some(turned), "the roles have changed");
        assert_eq!(pairs.impulses([1, 2]), None);

        pairs.memory.clear_particle(0);
        pairs.refresh(&particles);
        assert_eq!(pairs.impulses([0, 1]), None);
    }

    #[test]
    fn new_particles_on_springs_do_not_collide_with_what_they_overlap() {
        let particles = row(0.9, 4);
        let mut pairs = Pairs::default();
        pairs.refresh(&particles);
        pairs.elements.push([0, 2], LONG);
        pairs.elements.push([1, 3], LONG);
        pairs.memory.request_search();
        assert_eq!(pairs.refresh(&particles), [[0, 1], [1, 2], [2, 3]]);
        assert_eq!(pairs.history([0, 1]), PairHistory::Apart, "neither is new");
        pairs.memory.clear_particle(0);
        pairs.refresh(&particles);
        assert_eq!(pairs.history([0, 1]), PairHistory::InitialOverlap);
        assert_eq!(pairs.history([1, 2]), PairHistory::Apart);
        pairs.candidates.disable(&mut pairs.memory, 4);
        pairs.refresh(&particles);
        assert!(
            [[0, 1], [1, 2], [2, 3]].iter().all(|pair| pairs.history(*pair) == PairHistory::InitialOverlap)
        );
    }

    #[test]
    fn pairs_come_from_the_bottom_up() {
        let mut particles = Particles::default();
        for height in [2.0, -1.0, 0.0, 1.0] {
            particles.push(Vec3::Y * height, Vec3::ZERO, 1.0, 0.6);
        }
        let mut pairs = Pairs::default();
        pairs.refresh(&particles);
        let listed: Vec<_> =
            pairs.candidates.list.pairs.iter().map(|pair| (pair.lower, pair.upper)).collect();
        assert_eq!(listed, [(1, 2), (2, 3), (3, 0)]);
    }

    /// What is derived is what was found, to the order of the list, in several slabs too.
    #[test]
    fn the_list_follows_from_the_memory() {
        let mut particles = Particles::default();
        for slot in 0..40_000_u32 {
            let [x, y, z] = [slot % 200, slot * 7919 % 13, slot / 200].map(|number| number as f32);
            particles.push(Vec3::new(x, 0.3 * y, z), Vec3::new(y, 0.0, x), 1.0, 0.5);
        }
        let mut pairs = Pairs::default();
        pairs.refresh(&particles);
        let found = pairs.candidates.list.pairs.clone();
        assert!(found.len() > 20_000 && pairs.candidates.regions.are_many());
        // They have moved since, but by less than their skins.
        for y in &mut particles.position.y {
            *y *= 0.99;
        }
        let mut derived = Pairs { memory: pairs.memory.clone(), ..Pairs::default() };
        derived.refresh(&particles);
        assert_eq!(derived.memory.age, 1);
        assert_eq!(derived.candidates.list.pairs, found);
        assert_eq!(derived.candidates.regions.slot_of, pairs.candidates.regions.slot_of);
    }

    #[test]
    fn points_and_two_pinned_particles_never_collide() {
        let mut particles = row(0.5, 3);
        particles.set_radius(0, 0.0);
        particles.set_inverse_mass(1, 0.0);
        particles.set_inverse_mass(2, 0.0);
        assert!(Pairs::default().refresh(&particles).is_empty());
    }
}
