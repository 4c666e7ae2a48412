//! A list of pairs that may touch, in which a pair can be found by its particles.

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
    /// `starts[a]..starts[a + 1]` are the partners of the particle in slot a.
    starts: Vec<u32>,
    /// The partners in the slots b > a, and the place of the pair in the list.
    partners: Vec<(u32, u32)>,
}

impl List {
    /// Removes the pairs.
    pub fn clear(&mut self) {
        self.pairs.clear();
        self.starts.clear();
    }

    /// Finds out where the pairs of each particle are; `slot_of` has the slot of each body.
    pub fn index(&mut self, slot_of: &[u32]) {
        let Self { pairs, starts, partners } = self;
        starts.clear();
        starts.resize(slot_of.len() + 1, 0);
        for pair in &*pairs {
            let [a, _] = slots(slot_of, pair);
            starts[a as usize] += 1;
        }
        let mut total = 0;
        for start in &mut *starts {
            total += *start;
            *start = total;
        }
        partners.clear();
        partners.resize(pairs.len(), (0, 0));
        for (place, pair) in pairs.iter().enumerate() {
            let [a, b] = slots(slot_of, pair);
            let start = &mut starts[a as usize];
            *start -= 1;
            partners[*start as usize] = (b, place as u32);
        }
    }

    /// The place of the pair of the particles in the slots a < b.
    pub fn find(&self, [a, b]: [u32; 2]) -> Option<usize> {
        let bounds = self.starts.get(a as usize..a as usize + 2)?;
        let partners = &self.partners[bounds[0] as usize..bounds[1] as usize];
        Some(partners.iter().find(|(partner, _)| *partner == b)?.1 as usize)
    }
}

/// The slots of a pair, the smaller first.
pub(super) fn slots(slot_of: &[u32], pair: &Candidate) -> [u32; 2] {
    let (one, other) = (slot_of[pair.lower as usize], slot_of[pair.upper as usize]);
    [one.min(other), one.max(other)]
}
