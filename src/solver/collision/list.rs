//! A list of pairs that may touch, in which a pair can be found by its particles.

use crate::solver::buckets::Buckets;

/// What is known of a pair from the substep before.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Past {
    /// It did not touch.
    Apart,
    /// It touched: the index of its contact.
    Contact(u32),
    /// Both particles are on springs, and they have overlapped ever since one of them was new. Such a
    /// pair does not collide: to part it would stretch the springs, with energy from nowhere.
    Entangled,
}

/// A pair of bodies that may touch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Candidate {
    /// The lower body.
    pub lower: u32,
    /// The upper body.
    pub upper: u32,
    pub past: Past,
}

/// Pairs, and where each of them is.
#[derive(Debug, Clone, Default)]
pub(super) struct List {
    pub pairs: Vec<Candidate>,
    /// Of each slot the partners in higher slots, and the place of the pair in the list.
    partners: Buckets<(u32, u32)>,
}

impl List {
    /// Removes the pairs.
    pub fn clear(&mut self) {
        self.pairs.clear();
        self.partners.fill(0, |_| {});
    }

    /// Finds out where the pairs of each particle are; `slot_of` has the slot of each body.
    pub fn index(&mut self, slot_of: &[u32]) {
        let Self { pairs, partners } = self;
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
