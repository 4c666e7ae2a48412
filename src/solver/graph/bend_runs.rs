//! The bends of one block of particles that the kernel takes eight at a time.

use super::block::{Loose, MIN_RUN};
use crate::solver::elements::{Bend, for_each_bend};

/// Bends each of whose ends are consecutive slots: as along a rope, or a row of a cloth.
#[derive(Debug, Clone, Copy)]
pub(in crate::solver) struct BendRun<const N: usize> {
    /// The first of the slots of each end.
    pub first: [u32; N],
    /// The ends in the order of their slots.
    pub order: [u32; N],
    /// Number of bends.
    pub count: u32,
    /// Where their parameters begin in the list.
    pub start: u32,
    /// Whether the block owns each of the ends.
    pub owned: [bool; N],
    /// The weights, if they are those of all its bends: less to read.
    pub weights: Option<[f32; N]>,
    /// Stiffness and damping, likewise.
    pub material: Option<[f32; 2]>,
    /// Whether the rest length of any is > 0.
    pub is_curved: bool,
    /// Whether the damping of any is > 0.
    pub is_damped: bool,
}

/// The bends of N ends in runs, an array for each parameter.
#[derive(Debug, Clone)]
pub(in crate::solver) struct BendList<const N: usize> {
    pub runs: Vec<BendRun<N>>,
    pub rest_length: Vec<f32>,
    pub stiffness: Vec<f32>,
    pub damping: Vec<f32>,
    pub weights: [Vec<f32>; N],
}

macro_rules! define_bend_runs {
    ($($(#[$meta:meta])* $kind:ident: $ends:literal;)*) => {
        /// The bends in runs, by the number of their ends.
        #[derive(Debug, Clone, Default)]
        pub(in crate::solver) struct BendRuns {
            $($(#[$meta])* pub $kind: BendList<$ends>,)*
        }
    };
}
for_each_bend!(define_bend_runs);

impl<const N: usize> Default for BendList<N> {
    fn default() -> Self {
        Self {
            runs: Vec::new(),
            rest_length: Vec::new(),
            stiffness: Vec::new(),
            damping: Vec::new(),
            weights: std::array::from_fn(|_| Vec::new()),
        }
    }
}

/// A bend of a block, in the order of sorting.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct BendEntry<const N: usize> {
    pub tile: u32,
    pub owned: [bool; N],
    /// The slots of all ends, from the first one.
    pub offsets: [i32; N],
    pub first: u32,
    pub bend: u32,
}

impl<const N: usize> BendEntry<N> {
    fn ends(&self) -> [u32; N] {
        self.offsets.map(|offset| self.first.wrapping_add_signed(offset))
    }
}

impl<const N: usize> BendList<N> {
    /// Number of bends in runs.
    pub fn len(&self) -> usize {
        self.rest_length.len()
    }

    /// Changes the parameters of one of them.
    pub fn set(&mut self, index: usize, bend: Bend<N>) {
        let Bend { rest_length, stiffness, damping, weights } = bend;
        (self.rest_length[index], self.stiffness[index], self.damping[index]) =
            (rest_length, stiffness, damping);
        self.weights.iter_mut().zip(weights).for_each(|(all, weight)| all[index] = weight);
        let run = self.runs.partition_point(|run| run.start as usize <= index) - 1;
        let run = &mut self.runs[run];
        if run.material != Some([stiffness, damping]) {
            run.material = None;
        }
        if run.weights != Some(weights) {
            run.weights = None;
        }
        run.is_curved |= rest_length > 0.0;
        run.is_damped |= damping > 0.0;
    }

    /// Divides sorted entries into runs and `loose` bends. Calls `place` with the number of each and its place:
    /// the loose ones come after those in runs.
    pub(super) fn fill(
        &mut self,
        bends: &[Bend<N>],
        entries: &[BendEntry<N>],
        loose: &mut Vec<Loose<Bend<N>, N>>,
        mut place: impl FnMut(u32, usize),
    ) {
        let consecutive = |one: &BendEntry<N>, next: &BendEntry<N>| {
            (one.tile, one.owned, one.offsets, one.first + 1)
                == (next.tile, next.owned, next.offsets, next.first)
        };
        let groups = || entries.chunk_by(consecutive);
        for group in groups().filter(|group| group.len() >= MIN_RUN) {
            let bends = || group.iter().map(|entry| bends[entry.bend as usize]);
            group.iter().zip(self.len()..).for_each(|(entry, index)| place(entry.bend, index));
            self.runs.push(BendRun::of(&group[0], self.len(), bends));
            for Bend { rest_length, stiffness, damping, weights } in bends() {
                self.rest_length.push(rest_length);
                self.stiffness.push(stiffness);
                self.damping.push(damping);
                self.weights.iter_mut().zip(weights).for_each(|(all, weight)| all.push(weight));
            }
        }
        for entry in groups().filter(|group| group.len() < MIN_RUN).flatten() {
            place(entry.bend, self.len() + loose.len());
            let element = bends[entry.bend as usize];
            loose.push(Loose { ends: entry.ends(), owned: entry.owned, element });
        }
    }
}

impl<const N: usize> BendRun<N> {
    fn of<I: Iterator<Item = Bend<N>>>(entry: &BendEntry<N>, start: usize, bends: impl Fn() -> I) -> Self {
        let first = entry.ends();
        let mut order = std::array::from_fn(|end| end as u32);
        order.sort_unstable_by_key(|end| first[*end as usize]);
        let material = |bend: Bend<N>| [bend.stiffness, bend.damping];
        let example = bends().next().unwrap_or_default();
        Self {
            first,
            order,
            count: bends().count() as u32,
            start: start as u32,
            owned: entry.owned,
            weights: bends().all(|bend| bend.weights == example.weights).then_some(example.weights),
            material: bends().all(|bend| material(bend) == material(example)).then(|| material(example)),
            is_curved: bends().any(|bend| bend.rest_length > 0.0),
            is_damped: bends().any(|bend| bend.damping > 0.0),
        }
    }
}
