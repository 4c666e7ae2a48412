//! A list of pairs that may touch, in which a pair can be found by its particles.

use bevy::math::Vec3;

use super::regions::{Groups, Regions};
use crate::solver::buckets::Buckets;
use crate::solver::particles::Vectors;

/// What is known of a pair from the substep before.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PairHistory {
    /// It did not touch.
    Apart,
    /// It touched: the index of its contact.
    Contact(u32),
    /// Both particles are on springs, and they have overlapped ever since one of them was new. Such a
    /// pair does not collide: to part it would stretch the springs, with energy from nowhere.
    InitialOverlap,
}

/// A pair of bodies that may touch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Candidate {
    /// The lower body.
    pub lower: u32,
    /// The upper body.
    pub upper: u32,
    pub history: PairHistory,
}

/// Pairs, and where each of them is.
#[derive(Debug, Clone, Default)]
pub(super) struct List {
    pub pairs: Vec<Candidate>,
    /// Of each slot the partners in higher slots, and the place of the pair in the list.
    partners: Buckets<(u32, u32)>,
    /// The pairs of slots in groups.
    grouped: Vec<(u32, u32)>,
    /// The heights of their middles, as sortable bits, and their places in the group.
    keys: Vec<u64>,
    /// The height of each particle, m.
    heights: Vec<f32>,
}

impl List {
    /// Removes the pairs.
    pub fn clear(&mut self) {
        self.pairs.clear();
        self.partners.fill(0, |_| {});
    }

    /// Lists the pairs of slots in `found` in groups, those of each by the height of their middle: whatever carries a
    /// pair comes before it. (Not by that of the lower particle: pairs in a row that share one would have to wait for
    /// each other.) Heights are those of `origins`, m, along `up`.
    pub fn arrange(
        &mut self,
        found: &[(u32, u32)],
        regions: &Regions,
        groups: &mut Groups,
        (origins, up): (&Vectors, Vec3),
    ) {
        let Self { pairs, grouped, keys, heights, .. } = self;
        groups.arrange(regions, found, grouped);
        heights.clear();
        heights.extend((0..origins.len()).map(|slot| origins.get(slot).dot(up)));
        keys.resize(found.len(), 0);
        pairs.resize(found.len(), Candidate { lower: 0, upper: 0, history: PairHistory::Apart });
        let height = |slot: u32| heights[slot as usize];
        let body = |slot: u32| regions.body_of[slot as usize];
        groups.for_each_list((&mut keys[..], &mut pairs[..]), |group, (keys, pairs)| {
            let found = &grouped[group.pairs.clone()];
            for (place, (key, (a, b))) in keys.iter_mut().zip(found).enumerate() {
                // Floats sort like integers once the bits of negative ones are inverted.
                let bits = (height(*a) + height(*b)).to_bits();
                let sortable = if bits >> 31 == 1 { !bits } else { bits | 1 << 31 };
                *key = u64::from(sortable) << 32 | place as u64;
            }
            keys.sort_unstable();
            for (pair, key) in pairs.iter_mut().zip(keys) {
                let (a, b) = found[*key as u32 as usize];
                let (lower, upper) = if height(b) < height(a) { (b, a) } else { (a, b) };
                *pair = Candidate { lower: body(lower), upper: body(upper), history: PairHistory::Apart };
            }
        });
    }

    /// Finds out where the pairs of each particle are; `slot_of` has the slot of each body.
    pub fn index(&mut self, slot_of: &[u32]) {
        let Self { pairs, partners, .. } = self;
        partners.fill(slot_of.len(), |add| {
            for (place, pair) in (0..).zip(&*pairs) {
                let [a, b] = slots(slot_of, pair);
                add(a as usize, (b, place));
            }
        });
    }

    /// The place of the pair of the particles in the slots a < b.
    pub fn find(&self, [a, b]: [u32; 2]) -> Option<usize> {
        if a as usize >= self.partners.len() {
            return None;
        }
        let partners = self.partners.of(a as usize);
        Some(partners.iter().find(|(partner, _)| *partner == b)?.1 as usize)
    }
}

/// The slots of a pair, the smaller first.
pub(super) fn slots(slot_of: &[u32], pair: &Candidate) -> [u32; 2] {
    let (one, other) = (slot_of[pair.lower as usize], slot_of[pair.upper as usize]);
    [one.min(other), one.max(other)]
}
