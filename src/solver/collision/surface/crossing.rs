//! What crosses, or is in one place, at the start of a substep.
//!
//! Such pairs are left alone, and so are those beside them: the place where two ropes cross in a plane moves on from edge to edge,
//! and what is stopped there would never part.

use super::contact::COINCIDENT;
use super::search::{Candidate, Moving};

/// The corners of pairs that cross.
#[derive(Debug, Clone, Default)]
pub(super) struct Crossings {
    slots: Vec<u32>,
    /// The numbers of the candidates that may cross.
    numbers: Vec<u32>,
    /// By slot; all false while there are none.
    is_marked: Vec<bool>,
}

impl Crossings {
    /// Lists those of the `close` candidates that may cross before a vertex has moved farther than the `limits`, m, with its body and in
    /// the world. Of what is joined nothing is a crossing.
    pub fn list(&mut self, candidates: &[Candidate], close: &[u32], limits: [f32; 2]) {
        let may_cross = |number: &&u32| {
            let candidate = &candidates[**number as usize];
            let most = COINCIDENT * candidate.reach + 2.0 * limits[usize::from(!candidate.is_within)];
            candidate.most >= candidate.reach && candidate.distance <= most
        };
        self.numbers.clear();
        self.numbers.extend(close.iter().filter(may_cross));
    }

    /// Finds those that cross at the start of a substep.
    pub fn find(&mut self, candidates: &[Candidate], moved: &[Vec<f32>; 2], moving: Moving) {
        self.slots.drain(..).for_each(|slot| self.is_marked[slot as usize] = false);
        for candidate in self.numbers.iter().map(|number| &candidates[*number as usize]) {
            let most = COINCIDENT * candidate.reach;
            let may_cross = candidate.least_distance(moved) <= most;
            if may_cross && candidate.ways(moving).closest(0.0).apart.length() <= most {
                self.slots.extend_from_slice(&candidate.slots);
            }
        }
        if !self.slots.is_empty() {
            self.is_marked.resize(moving.particles.len(), false);
            self.slots.iter().for_each(|slot| self.is_marked[*slot as usize] = true);
        }
    }

    /// Whether a pair is beside a crossing, or one itself.
    #[inline]
    pub fn exempt(&self, candidate: &Candidate) -> bool {
        let is_marked = |side: &[u32]| side.iter().any(|slot| self.is_marked[*slot as usize]);
        !self.slots.is_empty() && candidate.sides().into_iter().all(is_marked)
    }
}
