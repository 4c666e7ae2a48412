//! The parts: movable particles, asleep or awake, that elements or a gas join; a loose particle is one of its own.
//!
//! Other than an island, a part does not depend on which particles sleep. Pinned particles join nothing, but hold parts.

use std::ops::Range;

use super::islands::Forest;
use crate::solver::buckets::Buckets;
use crate::solver::elements::{Acting, Elements};
use crate::solver::particles::Particles;
use crate::solver::state::Version;

/// The parts, in the order of their first slots.
#[derive(Debug, Clone, Default)]
pub(in crate::solver) struct Parts {
    /// The part of each slot; [`NO_PART`] of a pinned particle and an empty slot.
    of_slot: Vec<u32>,
    members: Buckets<u32>,
    /// The ranges of slots of loose particles.
    loose: Vec<Range<usize>>,
    /// The parts that are joined by elements.
    joined: Vec<u32>,
    /// Pinned slots and the parts that elements join to them, in ascending order.
    holders: Vec<(u32, u32)>,
    key: (Version, Version),
}

const NO_PART: u32 = u32::MAX;

impl Parts {
    /// Makes them those of the acting `elements`.
    pub fn refresh(&mut self, elements: &Elements, particles: &Particles) {
        let key = (elements.ends_version(), particles.movable_version());
        if self.key == key && self.of_slot.len() == particles.len() {
            return;
        }
        self.key = key;
        let mut forest = Forest::new(particles.len());
        let mut is_joined = vec![false; particles.len()];
        let mut held = Vec::new();
        let mut join = |ends: &[u32]| {
            let movable = |end: &&u32| particles.is_movable(**end as usize);
            let Some(&first) = ends.iter().find(movable) else { return };
            is_joined[first as usize] = true;
            for &end in ends.iter().filter(movable) {
                is_joined[end as usize] = true;
                forest.join(first as usize, end as usize);
            }
            held.extend(ends.iter().filter(|end| !movable(end)).map(|end| (*end, first)));
        };
        elements.for_each_acting(|Acting { ends, .. }| join(ends));
        elements.gases().acting().for_each(|(_, enclosure)| join(&enclosure.slots));
        self.number(&mut forest, particles);
        self.find_loose(&is_joined, particles);
        self.holders.clear();
        self.holders.extend(held.into_iter().map(|(pinned, slot)| (pinned, self.of_slot[slot as usize])));
        self.holders.sort_unstable();
        self.holders.dedup();
    }

    fn number(&mut self, forest: &mut Forest, particles: &Particles) {
        let Self { of_slot, members, .. } = self;
        let mut of_root = vec![NO_PART; particles.len()];
        let mut count = 0;
        of_slot.clear();
        of_slot.extend((0..particles.len()).map(|slot| {
            if !particles.is_movable(slot) {
                return NO_PART;
            }
            let part = &mut of_root[forest.root(slot)];
            if *part == NO_PART {
                *part = count;
                count += 1;
            }
            *part
        }));
        members.fill(count as usize, |add| {
            let parts = of_slot.iter().enumerate().filter(|(_, part)| **part != NO_PART);
            parts.for_each(|(slot, part)| add(*part as usize, slot as u32));
        });
    }

    fn find_loose(&mut self, is_joined: &[bool], particles: &Particles) {
        let Self { of_slot, members, loose, joined, .. } = self;
        loose.clear();
        joined.clear();
        for slot in (0..particles.len()).filter(|slot| particles.is_movable(*slot)) {
            let part = of_slot[slot];
            match is_joined[slot] {
                true if members.of(part as usize)[0] as usize == slot => joined.push(part),
                true => {}
                false => match loose.last_mut().filter(|range| range.end == slot) {
                    Some(range) => range.end += 1,
                    None => loose.push(slot..slot + 1),
                },
            }
        }
    }

    /// Number of parts.
    pub fn len(&self) -> usize {
        self.members.len()
    }

    /// Number of movable particles.
    pub fn movable(&self) -> usize {
        self.members.entries()
    }

    /// The part of a particle; `None` of a pinned one and an empty slot.
    #[inline]
    pub fn of(&self, slot: usize) -> Option<usize> {
        let part = *self.of_slot.get(slot)?;
        (part != NO_PART).then_some(part as usize)
    }

    /// The slots of a part, in ascending order.
    #[inline]
    pub fn members(&self, part: usize) -> &[u32] {
        self.members.of(part)
    }

    /// The slot by which a part is known: its first.
    #[inline]
    pub fn first(&self, part: usize) -> usize {
        self.members.of(part)[0] as usize
    }

    /// The ranges of slots of particles that are parts of their own.
    pub fn loose(&self) -> &[Range<usize>] {
        &self.loose
    }

    /// The parts of which elements join the particles.
    pub fn joined(&self) -> &[u32] {
        &self.joined
    }

    /// The parts that elements join to the pinned particle in a slot.
    pub fn held_by(&self, pinned: usize) -> impl Iterator<Item = usize> {
        let first = self.holders.partition_point(|(slot, _)| (*slot as usize) < pinned);
        self.holders[first..]
            .iter()
            .take_while(move |(slot, _)| *slot as usize == pinned)
            .map(|(_, part)| *part as usize)
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::Vec3;

    use super::*;
    use crate::solver::elements::Spring;

    #[test]
    fn parts_are_what_springs_join_asleep_or_awake() {
        let mut particles = Particles::default();
        [1.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0]
            .into_iter()
            .for_each(|inverse| particles.push(Vec3::ZERO, Vec3::ZERO, inverse, 0.1));
        let mut elements = Elements::default();
        for ends in [[0, 1], [1, 3], [3, 6]] {
            elements.push(ends, Spring { rest_length: 1.0, stiffness: 1.0, ..Spring::default() });
        }
        let mut parts = Parts::default();
        parts.refresh(&elements, &particles);
        assert_eq!(
            [0, 1, 2, 3, 4, 5, 6].map(|slot| parts.of(slot)),
            [0, 9, 1, 2, 3, 4, 2].map(|part| (part < 9).then_some(part))
        );
        assert_eq!(
            (parts.members(2), parts.loose(), parts.joined()),
            (&[3, 6][..], &[2..3, 4..6][..], &[0, 2][..])
        );
        assert_eq!((parts.held_by(1).collect::<Vec<_>>(), parts.held_by(2).count()), (vec![0, 2], 0));
        particles.put_to_sleep([3, 6].into_iter());
        let mut asleep = Parts::default();
        asleep.refresh(&elements, &particles);
        assert_eq!(asleep.members(2), [3, 6]);
    }
}
