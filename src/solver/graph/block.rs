//! The elements that end in one block of particles: runs of springs, and what is in none.

use std::ops::Range;

use super::anchored::{Anchored, AnchoredPlace};
use super::bend_runs::BendRuns;
use crate::solver::buckets::sort_by_number;
use crate::solver::elements::{Spring, Table, for_each_kind};

/// Runs shorter than this are loose: a vector would not be filled.
pub(in crate::solver) const MIN_RUN: usize = 8;

/// Springs of a run that are computed before their forces are added: enough that the additions do not wait for the
/// stores of those before.
const CHUNK: usize = 64;

/// A run with holes has up to this number of places.
pub(in crate::solver) const MAX_JOINED: usize = 256;

/// Places between two runs, at most, for which they are joined: what is computed there for nothing costs less than a
/// run of its own.
const MAX_HOLE: u32 = MIN_RUN as u32;

/// In place of a spring where there is none.
pub(super) const NO_SPRING: u32 = u32::MAX;

/// Springs with consecutive slots at their lower ends, and at their upper ends, with holes where there is none: as from one
/// short rope to the next, or between the rows of a small cloth.
#[derive(Debug, Clone)]
pub(in crate::solver) struct Run {
    /// The first of the lower slots.
    pub lower: u32,
    /// The first of the upper slots.
    pub upper: u32,
    /// Number of springs and holes.
    pub count: u32,
    /// The places at which there is no spring, or an anchored one (`anchored.rs`). A run with holes is one chunk.
    pub holes: Vec<Range<u32>>,
    /// Where their parameters begin in the block.
    pub start: u32,
    /// Whether the block owns the lower and the upper ends.
    pub owned: [bool; 2],
    /// Whether all its springs only pull, or none does.
    pub tension_only: bool,
    /// Stiffness and damping, if they are those of all its springs: less to read.
    pub material: Option<[f32; 2]>,
}

/// An element that is in no run.
#[derive(Debug, Clone, Copy)]
pub(in crate::solver) struct Loose<E, const N: usize> {
    pub ends: [u32; N],
    /// Whether the block owns each of the ends.
    pub owned: [bool; N],
    pub element: E,
    /// The number of its pull among those that are computed in runs, if it is.
    pub computed: Option<u32>,
}

macro_rules! define_loose {
    ($($(#[$meta:meta])* $kind:ident: $element:ty, $ends:literal;)*) => {
        /// The loose elements of each kind.
        #[derive(Debug, Clone, Default)]
        pub(in crate::solver) struct LooseElements {
            $($(#[$meta])* pub $kind: Vec<Loose<$element, $ends>>,)*
        }

        impl LooseElements {
            /// Whether the block owns all ends of all of them.
            fn are_owned(&self) -> bool {
                let mut are_owned = true;
                $($(#[$meta])* {
                    are_owned &= self.$kind.iter().all(|loose| loose.owned == [true; $ends]);
                })*
                are_owned
            }
        }
    };
}
for_each_kind!(define_loose);

/// The elements that end in one block of particles.
#[derive(Debug, Clone, Default)]
pub(in crate::solver) struct Block {
    /// Its particles.
    pub slots: Range<usize>,
    pub runs: Vec<Run>,
    /// Parameters of the springs in runs.
    pub rest_length: Vec<f32>,
    pub stiffness: Vec<f32>,
    pub damping: Vec<f32>,
    /// The springs in runs, with [`NO_SPRING`] in holes, then the loose ones.
    pub springs: Vec<u32>,
    /// The holes in which a loose spring is computed, in ascending order.
    pub anchored: Vec<AnchoredPlace>,
    pub bends: BendRuns,
    pub loose: LooseElements,
}

/// In the number of a spring.
const TENSION_ONLY: u32 = 1 << 31;

/// A spring of a block, in the order of sorting. As small as can be: there are as many as springs.
#[derive(Debug, Clone, Copy)]
pub(super) struct Entry {
    /// What all springs of a run have in common, apart from the offset: the tile, and which ends the block owns.
    group: u32,
    pub offset: u32,
    pub lower: u32,
    /// The number of the spring; with [`TENSION_ONLY`] if it only pulls.
    spring: u32,
}

impl Entry {
    /// A spring of a tile with its number, its lower slot and its offset, and whether the block owns its lower and its upper end.
    pub fn new(
        tile: u32,
        owned: [bool; 2],
        [lower, offset]: [u32; 2],
        (number, spring): (usize, &Spring),
    ) -> Self {
        let kind = match owned {
            [true, true] => 0,
            [true, false] => 1,
            [false, _] => 2,
        };
        let flag = if spring.tension_only { TENSION_ONLY } else { 0 };
        Self { group: 3 * tile + kind, offset, lower, spring: number as u32 | flag }
    }

    /// The number of the spring.
    pub fn spring(&self) -> u32 {
        self.spring & !TENSION_ONLY
    }

    fn tension_only(&self) -> bool {
        self.spring & TENSION_ONLY != 0
    }

    fn owned(&self) -> [bool; 2] {
        let kind = self.group % 3;
        [kind != 2, kind != 1]
    }

    /// Sorts entries by the tile, the ends that the block owns, the offset and the slot; equal ones keep their order. `spare`
    /// is working memory.
    pub fn sort(entries: &mut Vec<Self>, spare: &mut Vec<Self>) {
        sort_by_number(entries, spare, |entry| entry.lower);
        let (mut groups, mut width) = ([u32::MAX, 0], 0);
        for Self { group, offset, .. } in &*entries {
            (groups, width) = ([groups[0].min(*group), groups[1].max(*group)], width.max(offset + 1));
        }
        let range = u64::from(groups[1].saturating_sub(groups[0]) + 1) * u64::from(width);
        if range <= 4 * entries.len() as u64 {
            // Few enough to be counted at once.
            sort_by_number(entries, spare, |entry| (entry.group - groups[0]) * width + entry.offset);
        } else {
            sort_by_number(entries, spare, |entry| entry.offset);
            sort_by_number(entries, spare, |entry| entry.group);
        }
    }
}

impl Run {
    /// Number of springs that the kernel computes at a time, from the one numbered `done` on. In which order forces are
    /// added depends on this.
    pub fn chunk_from(&self, done: usize) -> usize {
        let left = self.count as usize - done;
        // What is left after a chunk fills a vector, or there is none.
        if left < CHUNK + MIN_RUN || !self.holes.is_empty() { left } else { CHUNK }
    }

    /// Whether a hole may be added at its ends: it is one chunk, and not too long, and the block owns all ends.
    pub(super) fn may_have_holes(&self) -> bool {
        self.owned == [true; 2]
            && self.chunk_from(0) == self.count as usize
            && (self.count as usize) < MAX_JOINED
    }

    /// Number of places between this run and the next, if both may be one: each is a chunk, and no particle has forces
    /// of both, so that none are added in another order.
    fn hole_before(&self, next: &Self) -> Option<u32> {
        let is_alike = self.owned == [true; 2]
            && (self.owned, self.tension_only) == (next.owned, next.tension_only)
            && self.upper - self.lower == next.upper - next.lower;
        let hole = next.lower.checked_sub(self.lower + self.count).filter(|_| is_alike)?;
        let offset = self.upper - self.lower;
        let count = self.count + hole + next.count;
        let are_chunks = [self, next].iter().all(|run| run.chunk_from(0) == run.count as usize);
        let fits = are_chunks && count as usize <= MAX_JOINED;
        (fits && (offset..=MAX_HOLE).contains(&hole)).then_some(hole)
    }
}

impl Block {
    /// Whether it owns all ends of its elements.
    pub fn is_closed(&self) -> bool {
        self.runs.iter().all(|run| run.owned == [true; 2]) && self.bends.are_owned() && self.loose.are_owned()
    }

    /// The springs that end in a slot.
    pub fn springs_at(&self, slot: u32) -> Vec<usize> {
        let in_runs = self.runs.iter().flat_map(|run| {
            [run.lower, run.upper].into_iter().zip(run.owned).filter_map(move |(first, owned)| {
                let at = slot.checked_sub(first).filter(|at| owned && *at < run.count)?;
                Some(run.start + at)
            })
        });
        let among_loose = self.loose.springs.iter().zip(self.rest_length.len() as u32..);
        let among_loose = among_loose.filter(|(loose, _)| loose.ends.contains(&slot)).map(|(_, place)| place);
        let places = in_runs.chain(among_loose).map(|place| self.springs[place as usize]);
        places.filter(|spring| *spring != NO_SPRING).map(|spring| spring as usize).collect()
    }

    pub(super) fn set_parameters(&mut self, index: usize, spring: Spring) {
        let mut index = index;
        if let Some(loose) = index.checked_sub(self.rest_length.len()) {
            let loose = &mut self.loose.springs[loose];
            loose.element = spring;
            let Some(computed) = loose.computed else { return };
            index = self.anchored[computed as usize].place as usize;
        }
        let Spring { stiffness, damping, .. } = spring;
        self.rest_length[index] = spring.length_at_rest();
        self.stiffness[index] = stiffness;
        self.damping[index] = damping;
        let run = self.runs.partition_point(|run| run.start as usize <= index) - 1;
        if self.runs[run].material != Some([stiffness, damping]) {
            self.runs[run].material = None;
        }
    }

    /// Divides sorted entries into runs and loose springs; `anchored` ones may be computed in runs.
    pub(super) fn fill_runs(&mut self, springs: &Table<Spring, 2>, entries: &[Entry], anchored: &Anchored) {
        let springs = springs.elements();
        let spring_of = |entry: &Entry| &springs[entry.spring() as usize];
        let consecutive = |one: &Entry, next: &Entry| {
            one.lower + 1 == next.lower
                && (one.group, one.offset, one.tension_only())
                    == (next.group, next.offset, next.tension_only())
        };
        let mut short: Vec<&Entry> = Vec::new();
        [&mut self.rest_length, &mut self.stiffness, &mut self.damping]
            .into_iter()
            .for_each(|numbers| numbers.reserve(entries.len()));
        self.springs.reserve(entries.len());
        for group in entries.chunk_by(consecutive) {
            if group.len() < MIN_RUN {
                short.extend(group);
                continue;
            }
            let Entry { offset, lower, .. } = group[0];
            let run = Run {
                lower,
                upper: lower + offset,
                count: group.len() as u32,
                holes: Vec::new(),
                start: self.springs.len() as u32,
                owned: group[0].owned(),
                tension_only: group[0].tension_only(),
                material: None,
            };
            self.begin_run(run, anchored);
            group.iter().for_each(|entry| self.push_place(entry.spring(), spring_of(entry)));
        }
        self.end_run(anchored);
        for entry in short {
            let Entry { offset, lower, .. } = *entry;
            self.loose.springs.push(Loose {
                ends: [lower, lower + offset],
                owned: entry.owned(),
                element: *spring_of(entry),
                computed: None,
            });
            self.springs.push(entry.spring());
        }
    }

    /// Lists a run, of which the parameters come next, or joins it to the last one.
    fn begin_run(&mut self, mut run: Run, anchored: &Anchored) {
        let hole = self.runs.last().and_then(|last| last.hole_before(&run));
        let (Some(hole), Some(mut last)) = (hole, self.runs.pop_if(|_| hole.is_some())) else {
            self.end_run(anchored);
            run.start = self.springs.len() as u32;
            self.extend_front(&mut run, anchored);
            self.runs.push(run);
            return;
        };
        let first = last.lower + last.count;
        last.holes.push(last.count..last.count + hole);
        last.count += hole + run.count;
        (first..first + hole).for_each(|lower| self.push_hole(&last, lower, anchored));
        self.runs.push(last);
    }

    /// Finds what the springs of the last run have in common, when all of its parameters are there.
    fn end_run(&mut self, anchored: &Anchored) {
        self.extend_back(anchored);
        let Some(run) = self.runs.last_mut() else { return };
        let (stiffness, damping) =
            (&self.stiffness[run.start as usize..], &self.damping[run.start as usize..]);
        let first = [stiffness[0], damping[0]];
        let is_uniform = |numbers: &[f32], first: f32| numbers.iter().all(|number| *number == first);
        run.material = (is_uniform(stiffness, first[0]) && is_uniform(damping, first[1])).then_some(first);
    }

    /// Appends a place to the run that is being filled, and the parameters of what is computed there.
    pub(super) fn push_place(&mut self, number: u32, spring: &Spring) {
        self.rest_length.push(spring.length_at_rest());
        self.stiffness.push(spring.stiffness);
        self.damping.push(spring.damping);
        self.springs.push(number);
    }
}
