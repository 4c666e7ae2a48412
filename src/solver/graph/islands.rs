//! The islands: what elements join, directly or through others.
//!
//! Pinned particles join nothing: what hangs on two sides of one moves independently. Nor do elements that
//! exert no force.

use std::ops::Range;

use super::Linked;
use super::reduction::Reduction;
use crate::solver::buckets::Buckets;
use crate::solver::elements::{Acting, Elements, Enclosure};
use crate::solver::particles::Particles;
use crate::solver::state::Version;

/// The islands of free particles, in the order of their first slots.
#[derive(Debug, Clone, Default)]
pub(in crate::solver) struct Islands {
    /// The island of each slot; [`NO_ISLAND`] of a pinned particle and of one without elements.
    of_slot: Vec<u32>,
    islands: Vec<Island>,
    /// Slots in a row of free particles of one island, or of none, and that.
    runs: Vec<(Range<u32>, Option<usize>)>,
    key: (Version, Version),
}

/// What is known of an island.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(in crate::solver) struct Island {
    /// Number of elements.
    pub elements: usize,
    /// Whether its equations are not solved directly: springs close a loop among free particles, or bends couple too
    /// many of them. Ropes, with rods or without, chains and trees have none.
    pub has_loops: bool,
}

const NO_ISLAND: u32 = u32::MAX;

impl Islands {
    /// Makes them those of the acting `elements`; returns whether anything was derived anew.
    pub fn refresh(&mut self, elements: &Elements, particles: &Particles) -> bool {
        let key = (elements.ends_version(), particles.free_version());
        if self.key == key {
            return false;
        }
        self.key = key;
        let mut forest = Forest::new(particles.len());
        let mut joined = vec![false; particles.len()];
        // Of each slot how many elements have their first free end there.
        let mut counts = vec![0_u32; particles.len()];
        // Whether an element closes a loop there. As flags: most elements of a cloth do.
        let mut closing = vec![false; particles.len()];
        let mut bent = Vec::new();
        elements.for_each_acting_ends(|ends| {
            if let [first, second] = *ends {
                let [first, second] = [first as usize, second as usize];
                let (is_first_free, is_second_free) =
                    (!particles.is_pinned(first), !particles.is_pinned(second));
                joined[first] |= is_first_free;
                joined[second] |= is_second_free;
                counts[if is_first_free { first } else { second }] +=
                    u32::from(is_first_free || is_second_free);
                if is_first_free && is_second_free && !forest.join(first, second) {
                    closing[first] = true;
                }
                return;
            }
            let mut free = ends.iter().map(|end| *end as usize).filter(|end| !particles.is_pinned(*end));
            let Some(first) = free.next() else { return };
            joined[first] = true;
            counts[first] += 1;
            for end in free {
                joined[end] = true;
                forest.join(first, end);
            }
            bent.push(first);
        });
        for (_, enclosure) in elements.gases().acting() {
            let mut free = free_slots(enclosure, particles);
            let Some(first) = free.next() else { continue };
            joined[first] = true;
            closing[first] = true;
            for slot in free {
                joined[slot] = true;
                forest.join(first, slot);
            }
        }
        self.number(&mut forest, &joined, particles);
        for (slot, _) in closing.into_iter().enumerate().filter(|(_, is_closing)| *is_closing) {
            self.island_mut(slot).has_loops = true;
        }
        self.reduce(&bent, elements, particles);
        for (slot, count) in counts.into_iter().enumerate().filter(|(_, count)| *count > 0) {
            self.island_mut(slot).elements += count as usize;
        }
        true
    }

    fn number(&mut self, forest: &mut Forest, joined: &[bool], particles: &Particles) {
        let mut of_root = vec![NO_ISLAND; joined.len()];
        self.islands.clear();
        self.of_slot.clear();
        self.of_slot.extend(joined.iter().enumerate().map(|(slot, is_joined)| {
            if !is_joined {
                return NO_ISLAND;
            }
            let island = &mut of_root[forest.root(slot)];
            if *island == NO_ISLAND {
                *island = self.islands.len() as u32;
                self.islands.push(Island::default());
            }
            *island
        }));
        self.runs.clear();
        for slot in (0..joined.len()).filter(|slot| !particles.is_pinned(*slot)) {
            let (island, slot) = (self.of(slot), slot as u32);
            match self.runs.last_mut().filter(|(slots, last)| slots.end == slot && *last == island) {
                Some((slots, _)) => slots.end = slot + 1,
                None => self.runs.push((slot..slot + 1, island)),
            }
        }
    }

    /// Finds out which islands with bends, an end of each of which is listed, are not solved directly.
    fn reduce(&mut self, bent: &[usize], elements: &Elements, particles: &Particles) {
        let mut is_open = vec![false; self.islands.len()];
        for slot in bent {
            let island = self.of_slot[*slot] as usize;
            is_open[island] = !self.islands[island].has_loops;
        }
        if !is_open.contains(&true) {
            return;
        }
        let mut members = Buckets::default();
        members.fill(self.islands.len(), |add| {
            elements.for_each_acting(|Acting { number, ends, .. }| {
                let island = ends.iter().find_map(|end| self.of(*end as usize));
                if let Some(island) = island.filter(|island| is_open[*island]) {
                    add(island, Linked::new(number, ends));
                }
            });
        });
        let mut places = vec![0; particles.len()];
        for island in (0..is_open.len()).filter(|island| is_open[*island]) {
            let members = members.of(island);
            let mut free: Vec<u32> = members.iter().flat_map(Linked::ends).copied().collect();
            free.retain(|slot| !particles.is_pinned(*slot as usize));
            free.sort_unstable();
            free.dedup();
            let reduction = Reduction::of(members, &[], &free, particles, &mut places);
            self.islands[island].has_loops = !reduction.left.is_empty();
        }
    }

    fn island_mut(&mut self, slot: usize) -> &mut Island {
        &mut self.islands[self.of_slot[slot] as usize]
    }

    /// Changes whenever the islands do.
    pub fn key(&self) -> (Version, Version) {
        self.key
    }

    /// All islands.
    pub fn all(&self) -> &[Island] {
        &self.islands
    }

    /// The slots of all free particles in ranges as long as possible, in order, each with its island; `None` without elements.
    pub fn runs(&self) -> &[(Range<u32>, Option<usize>)] {
        &self.runs
    }

    /// The island of a free particle; `None` without elements.
    #[inline]
    pub fn of(&self, slot: usize) -> Option<usize> {
        let island = *self.of_slot.get(slot)?;
        (island != NO_ISLAND).then_some(island as usize)
    }
}

/// Some of the islands, and perhaps the free particles in none.
#[derive(Debug, Clone, Default)]
pub(in crate::solver) struct IslandSet {
    islands: Vec<bool>,
    others: bool,
    /// Of the islands that it is a set of.
    key: (Version, Version),
    version: Version,
}

impl IslandSet {
    /// Makes it those of `islands` that are `chosen`, and the free particles in none if `others`.
    pub fn set(&mut self, islands: &Islands, chosen: impl Iterator<Item = bool> + Clone, others: bool) {
        let is_same = self.key == islands.key && self.others == others;
        if !is_same || !self.islands.iter().copied().eq(chosen.clone()) {
            self.islands.clear();
            self.islands.extend(chosen);
            (self.others, self.key, self.version) = (others, islands.key, Version::new());
        }
    }

    /// Changes with what is in it.
    pub fn version(&self) -> Version {
        self.version
    }

    pub fn contains_island(&self, island: usize) -> bool {
        self.islands.get(island) == Some(&true)
    }

    /// Whether the particle in a slot is free and in one of the islands, or in none and one of the others.
    pub fn contains(&self, islands: &Islands, particles: &Particles, slot: usize) -> bool {
        match islands.of(slot) {
            Some(island) => self.contains_island(island),
            None => self.others && !particles.is_pinned(slot),
        }
    }
}

/// Disjoint sets of particles: each points to another one of its set, the root to itself.
#[derive(Debug, Clone, Default)]
pub(in crate::solver) struct Forest(Vec<u32>);

impl Forest {
    pub fn new(particles: usize) -> Self {
        Self((0..particles as u32).collect())
    }

    /// Each of `count` by itself.
    pub fn reset(&mut self, count: usize) {
        self.0.clear();
        self.0.extend(0..count as u32);
    }

    pub fn root(&mut self, slot: usize) -> usize {
        let Self(parents) = self;
        let mut slot = slot as u32;
        while parents[slot as usize] != slot {
            let parent = parents[slot as usize];
            parents[slot as usize] = parents[parent as usize];
            slot = parents[slot as usize];
        }
        slot as usize
    }

    /// Unites the sets of two particles; returns whether they were different ones.
    #[inline]
    pub fn join(&mut self, first: usize, second: usize) -> bool {
        if self.0[first] == self.0[second] {
            return false;
        }
        let (first, second) = (self.root(first), self.root(second));
        self.0[first] = second as u32;
        first != second
    }
}

fn free_slots<'a>(
    enclosure: &'a Enclosure,
    particles: &'a Particles,
) -> impl Iterator<Item = usize> + use<'a> {
    let slots = enclosure.slots.iter().map(|slot| *slot as usize);
    slots.filter(|slot| !particles.is_pinned(*slot))
}

/// Whether the equations of any island are not solved directly: see [`Island::has_loops`].
pub(in crate::solver) fn has_loops(elements: &Elements, particles: &Particles) -> bool {
    let mut forest = Forest::new(particles.len());
    let (mut has_loops, mut has_bends) = (elements.gases().any_act(), false);
    elements.for_each_acting(|Acting { ends, .. }| {
        if let ([first, second], false) = (ends, has_loops) {
            let is_free = |end: &u32| !particles.is_pinned(*end as usize);
            has_loops = is_free(first) && is_free(second) && !forest.join(*first as usize, *second as usize);
        }
        has_bends |= ends.len() > 2;
    });
    if has_loops || !has_bends {
        return has_loops;
    }
    let mut islands = Islands::default();
    islands.refresh(elements, particles);
    islands.islands.iter().any(|island| island.has_loops)
}

#[cfg(test)]
mod tests {
    use bevy::math::Vec3;

    use super::*;
    use crate::solver::elements::{Bend, Spring};

    fn particles(inverse_mass: &[f32]) -> Particles {
        let mut particles = Particles::default();
        inverse_mass.iter().for_each(|inverse| particles.push(Vec3::ZERO, Vec3::ZERO, *inverse, 0.0));
        particles
    }

    fn springs(ends: &[[u32; 2]]) -> Elements {
        let mut elements = Elements::default();
        for &ends in ends {
            elements
                .push(ends, Spring { rest_length: 1.0, stiffness: 1.0, damping: 0.0, ..Spring::default() });
        }
        elements
    }

    fn islands(elements: &Elements, particles: &Particles) -> Islands {
        let mut islands = Islands::default();
        islands.refresh(elements, particles);
        islands
    }

    #[test]
    fn pinned_particles_and_removed_springs_join_nothing() {
        let particles = particles(&[1.0, 1.0, 0.0, 1.0, 1.0, 1.0]);
        let mut elements = springs(&[[0, 1], [1, 2], [2, 3], [3, 4]]);
        let found = islands(&elements, &particles);
        assert_eq!(
            [0, 1, 2, 3, 4, 5].map(|slot| found.of(slot)),
            [Some(0), Some(0), None, Some(1), Some(1), None]
        );
        assert_eq!(found.all(), [Island { elements: 2, has_loops: false }; 2]);
        elements.remove::<Spring, 2>(0);
        let found = islands(&elements, &particles);
        assert_eq!([found.of(0), found.of(1), found.of(3)], [None, Some(0), Some(1)]);
    }

    #[test]
    fn cutting_a_ring_opens_it() {
        let particles = particles(&[1.0; 4]);
        let mut ring = springs(&[[0, 1], [1, 2], [3, 2], [3, 0]]);
        assert!(has_loops(&ring, &particles) && islands(&ring, &particles).all()[0].has_loops);
        ring.remove::<Spring, 2>(2);
        assert!(!has_loops(&ring, &particles) && !islands(&ring, &particles).all()[0].has_loops);
        ring.push([2, 3], Spring { rest_length: 1.0, stiffness: 1.0, damping: 0.0, ..Spring::default() });
        assert!(has_loops(&ring, &particles));
        let mut held = particles.clone();
        held.set_inverse_mass(1, 0.0);
        assert!(!has_loops(&ring, &held), "pinning a particle opens it, too");
    }

    #[test]
    fn an_element_of_three_ends_joins_all_of_them() {
        let particles = particles(&[1.0; 5]);
        let mut elements = springs(&[[3, 4]]);
        elements.push(
            [0, 1, 3],
            Bend { rest_length: 0.0, stiffness: 1.0, damping: 0.0, weights: [1.0, -2.0, 1.0] },
        );
        let found = islands(&elements, &particles);
        assert_eq!([0, 1, 2, 3, 4].map(|slot| found.of(slot)), [Some(0), Some(0), None, Some(0), Some(0)]);
        assert_eq!(found.all(), [Island { elements: 2, has_loops: false }]);
    }

    #[test]
    fn rods_along_a_rope_close_no_loop_and_across_a_ring_they_do() {
        let particles = particles(&[1.0; 8]);
        let mut elements = springs(&[[0, 1], [1, 2], [2, 3], [4, 5], [5, 6], [6, 7]]);
        let rod = Bend { rest_length: 0.0, stiffness: 1.0, damping: 0.0, weights: [1.0, -2.0, 1.0] };
        for ends in [[0, 1, 2], [1, 2, 3], [4, 5, 6], [5, 6, 7]] {
            elements.push(ends, rod);
        }
        assert!(!has_loops(&elements, &particles));
        // The rods of a closed rope couple five nodes round it.
        elements.push([6, 7, 4], rod);
        elements.push([7, 4, 5], rod);
        assert!(has_loops(&elements, &particles));
        let found: Vec<bool> = islands(&elements, &particles).all().iter().map(|all| all.has_loops).collect();
        assert_eq!(found, [false, true]);
    }
}
