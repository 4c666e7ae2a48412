//! Springs that ended in a pinned particle when they were sorted, in the runs of others.
//!
//! Such a spring is loose: what hangs on the two sides of a pinned particle must not depend on each other (`layout.rs`). But where it
//! continues a run, as the link by which a rope hangs does, its pull is computed there with the others. It is added as if it had been
//! computed among the loose ones, so that the results have the same bits.

use super::block::{Block, Entry, NO_SPRING, Run};
use super::blocks::Blocks;
use crate::solver::elements::{Spring, Table};

/// The number of pulls that are kept for a block, at most: the springs beyond are computed one by one.
pub(in crate::solver) const MAX_ANCHORED: usize = 128;

/// A place in a run, of a spring that is among the loose ones.
#[derive(Debug, Clone, Copy)]
pub(in crate::solver) struct AnchoredPlace {
    /// The place among those of all runs of the block.
    pub place: u32,
    pub spring: u32,
}

/// The springs of a block that are in no run, and may be computed in one.
pub(super) struct Anchored<'a> {
    springs: &'a Table<Spring, 2>,
    /// Sorted.
    entries: &'a [Entry],
}

impl<'a> Anchored<'a> {
    /// Of `entries`, of which the block owns both ends.
    pub fn new(springs: &'a Table<Spring, 2>, entries: &'a mut [Entry]) -> Self {
        entries.sort_unstable_by_key(|entry| (entry.offset, entry.lower, entry.spring()));
        Self { springs, entries }
    }

    /// The first one between two slots, if it acts like those of a run.
    fn find(&self, run: &Run, lower: u32) -> Option<(u32, &Spring)> {
        let ends = (run.upper - run.lower, lower);
        let place = self.entries.partition_point(|entry| (entry.offset, entry.lower) < ends);
        let entry = self.entries.get(place).filter(|entry| (entry.offset, entry.lower) == ends)?;
        let spring = &self.springs.elements()[entry.spring() as usize];
        (spring.tension_only == run.tension_only).then_some((entry.spring(), spring))
    }
}

impl Block {
    /// Whether a spring from slot `lower` on may be computed in a run.
    fn anchored_in<'a>(
        &self,
        run: &Run,
        lower: Option<u32>,
        anchored: &'a Anchored,
    ) -> Option<(u32, &'a Spring)> {
        if self.anchored.len() == MAX_ANCHORED {
            return None;
        }
        let found = anchored.find(run, lower?)?;
        self.anchored.iter().all(|other| other.spring != found.0).then_some(found)
    }

    /// Appends the place of slot `lower`, which is a hole of `run`: with the parameters of an anchored spring, or with any.
    pub(super) fn push_hole(&mut self, run: &Run, lower: u32, anchored: &Anchored) {
        let spring = if let Some((number, spring)) = self.anchored_in(run, Some(lower), anchored) {
            self.anchored.push(AnchoredPlace { place: self.springs.len() as u32, spring: number });
            *spring
        } else {
            // Those of the place before: a run of one material stays one.
            let last = |numbers: &[f32]| numbers.last().copied().unwrap_or_default();
            Spring::elastic(0.0, last(&self.stiffness), last(&self.damping))
        };
        self.push_place(NO_SPRING, &spring);
    }

    /// Lets a run, of which the parameters come next, begin a place earlier if an anchored spring is there.
    pub(super) fn extend_front(&mut self, run: &mut Run, anchored: &Anchored) {
        let lower = run.lower.checked_sub(1);
        if run.may_have_holes() && self.anchored_in(run, lower, anchored).is_some() {
            (run.lower, run.upper, run.count) = (run.lower - 1, run.upper - 1, run.count + 1);
            run.holes.push(0..1);
            self.push_hole(run, run.lower, anchored);
        }
    }

    /// Lets the last run, of which the parameters are the last ones, end a place later if an anchored spring is there.
    pub(super) fn extend_back(&mut self, anchored: &Anchored) {
        let Some(mut run) = self.runs.pop() else { return };
        let lower = run.lower + run.count;
        if run.may_have_holes() && self.anchored_in(&run, Some(lower), anchored).is_some() {
            run.holes.push(run.count..run.count + 1);
            run.count += 1;
            self.push_hole(&run, lower, anchored);
        }
        self.runs.push(run);
    }
}

impl Blocks {
    /// The anchored springs of which a block owns both ends, by block.
    pub(super) fn anchored_entries(&self, springs: &Table<Spring, 2>) -> Vec<Vec<Entry>> {
        let mut entries = vec![Vec::new(); self.blocks.len()];
        for index in (0..springs.sorted()).filter(|index| springs.is_anchored(*index)) {
            let ends = springs.all_ends()[index];
            let [lower, upper] = [ends[0].min(ends[1]), ends[0].max(ends[1])];
            if let Some(block) = self.block_of(lower).filter(|block| self.block_of(upper) == Some(*block)) {
                let spring = (index, &springs.elements()[index]);
                entries[block].push(Entry::new(0, [true; 2], [lower, upper - lower], spring));
            }
        }
        entries
    }

    /// Tells the loose springs that are computed in runs.
    pub(super) fn link_anchored(&mut self) {
        for (number, block) in self.blocks.iter_mut().enumerate() {
            for (computed, anchored) in (0..).zip(&block.anchored) {
                let places = self.places[anchored.spring as usize].iter().flatten();
                for place in places.filter(|place| place.block as usize == number) {
                    let loose = place.index as usize - block.rest_length.len();
                    block.loose.springs[loose].computed = Some(computed);
                }
            }
        }
    }
}
