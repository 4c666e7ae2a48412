//! What crosses, or is in one place, at the start of a substep.
//!
//! Such pairs are left alone, and so are those beside them: the place where two ropes cross in a plane moves on from edge to edge,
//! and what is stopped there would never part.

use super::contact::COINCIDENT;
use super::list::NearPair;
use super::search::{Candidate, Moving};

/// The corners of pairs that cross.
#[derive(Debug, Clone, Default)]
pub(super) struct Crossings {
    slots: Vec<u32>,
    /// The pairs that may cross.
    pairs: Vec<NearPair>,
    /// By slot; all false while there are none.
    is_marked: Vec<bool>,
}

impl Crossings {
    /// Lists those of some pairs that may cross before a vertex is beyond its limits by the slack of its body. Of what is joined nothing is a
    /// crossing.
    pub fn list(
        &mut self,
        candidates: &[Candidate],
        (pairs, limits): (&[NearPair], &[Vec<f32>; 2]),
        slacks: &[f32],
    ) {
        let slack = 2.0 * slacks.iter().copied().fold(0.0, f32::max);
        let may_cross = |near: &&NearPair| {
            let candidate = &candidates[near.number as usize];
            candidate.most >= candidate.reach
                && candidate.least_distance(near.distance, limits) <= most_of(candidate) + slack
        };
        self.pairs.extend(pairs.iter().filter(may_cross));
    }

    /// Finds those that cross at the start of a substep.
    pub fn find(&mut self, candidates: &[Candidate], moved: &[Vec<f32>; 2], moving: Moving) {
        self.slots.drain(..).for_each(|slot| self.is_marked[slot as usize] = false);
        for near in &self.pairs {
            let candidate = &candidates[near.number as usize];
            let may_cross = candidate.least_distance(near.distance, moved) <= most_of(candidate);
            if may_cross && candidate.paths(moving).closest(0.0).apart.length() <= most_of(candidate) {
                self.slots.extend_from_slice(&candidate.slots);
            }
        }
        if !self.slots.is_empty() {
            self.is_marked.resize(moving.particles.len(), false);
            self.slots.iter().for_each(|slot| self.is_marked[*slot as usize] = true);
        }
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.pairs.clear();
    }

    /// Whether a pair is beside a crossing, or one itself.
    #[inline]
    pub fn exempt(&self, candidate: &Candidate) -> bool {
        let is_marked = |side: &[u32]| side.iter().any(|slot| self.is_marked[*slot as usize]);
        !self.slots.is_empty() && candidate.sides().into_iter().all(is_marked)
    }
}

/// The distance of a pair that counts as crossing, at most, m.
fn most_of(candidate: &Candidate) -> f32 {
    COINCIDENT * candidate.reach
}
