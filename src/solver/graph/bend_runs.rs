//! The bends of one block of particles that the kernel takes eight at a time.

use super::block::{Loose, MIN_RUN};
use crate::solver::elements::{Bend, for_each_bend};

/// Places of a run without a bend, at most, one after the other: what is computed there for nothing costs less than
/// a run of its own.
const MAX_HOLE: u32 = MIN_RUN as u32;

/// Bends with consecutive slots at each end, with holes where there is none: as along a rope, or the rows of a cloth.
#[derive(Debug, Clone)]
pub(in crate::solver) struct BendRun<const N: usize> {
    /// The first of the slots of each end.
    pub first: [u32; N],
    /// The ends in the order of their slots.
    pub order: [u32; N],
    /// Number of bends and holes.
    pub count: u32,
    /// Where their parameters begin in the list.
    pub start: u32,
    /// The places of the run at which there is no bend, in ascending order.
    pub holes: Vec<u32>,
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

        impl BendRuns {
            /// Whether the block owns all ends of all of them.
            pub(super) fn are_owned(&self) -> bool {
                let mut are_owned = true;
                $($(#[$meta])* {
                    are_owned &= self.$kind.runs.iter().all(|run| run.owned == [true; $ends]);
                })*
                are_owned
            }
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
    pub span: u32,
    pub owned: [bool; N],
    /// The slots of all ends, from the first one.
    pub offsets: [i32; N],
    pub first: u32,
    pub bend: u32,
}

impl<const N: usize> BendEntry<N> {
    /// Number of places between this bend and the next, if both may be in one run; `None` of two on the same ends.
    fn hole_before(&self, next: &Self) -> Option<u32> {
        let are_alike = (self.span, self.owned, self.offsets) == (next.span, next.owned, next.offsets);
        next.first.checked_sub(self.first + 1).filter(|_| are_alike)
    }

    fn ends(&self) -> [u32; N] {
        self.offsets.map(|offset| self.first.wrapping_add_signed(offset))
    }
}

impl<const N: usize> BendList<N> {
    /// Number of bends in runs, and of holes.
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
        self.runs[run].note(bend);
    }

    /// Appends the parameters of a bend to the last run.
    fn push(&mut self, bend: Bend<N>) {
        let Bend { rest_length, stiffness, damping, weights } = bend;
        self.rest_length.push(rest_length);
        self.stiffness.push(stiffness);
        self.damping.push(damping);
        self.weights.iter_mut().zip(weights).for_each(|(all, weight)| all.push(weight));
        if let Some(run) = self.runs.last_mut() {
            run.count += 1;
        }
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
            (one.span, one.owned, one.offsets, one.first + 1)
                == (next.span, next.owned, next.offsets, next.first)
        };
        let groups = || entries.chunk_by(consecutive);
        let mut last: Option<&BendEntry<N>> = None;
        for group in groups().filter(|group| group.len() >= MIN_RUN) {
            let (entry, start) = (&group[0], self.len() as u32);
            let hole = last.and_then(|last| last.hole_before(entry)).filter(|hole| *hole <= MAX_HOLE);
            match (hole, self.runs.last_mut()) {
                (Some(hole), Some(run)) => {
                    run.holes.extend(run.count..run.count + hole);
                    let nothing = Bend { weights: [0.0; N], ..Bend::default() };
                    (0..hole).for_each(|_| self.push(nothing));
                }
                _ => self.runs.push(BendRun::new(entry, start, bends[entry.bend as usize])),
            }
            for entry in group {
                place(entry.bend, self.len());
                let bend = bends[entry.bend as usize];
                self.push(bend);
                if let Some(run) = self.runs.last_mut() {
                    run.note(bend);
                }
            }
            last = group.last();
        }
        for entry in groups().filter(|group| group.len() < MIN_RUN).flatten() {
            place(entry.bend, self.len() + loose.len());
            let element = bends[entry.bend as usize];
            loose.push(Loose { ends: entry.ends(), owned: entry.owned, element, computed: None });
        }
    }
}

/// A run of bends x₀ + x₁ − x₂ − x₃ of the corners of parallelograms, flat at rest and all of one stiffness: the twists of a
/// regular grid, and its hinges.
#[derive(Debug, Clone, Copy)]
pub(in crate::solver) struct Parallelograms<'a> {
    /// The first of the lowest slots.
    pub lowest: usize,
    /// From the lowest corner to those with the weight 1.
    pub plus: [usize; 2],
    /// From the lowest corner to those with the weight −1.
    pub minus: [usize; 2],
    /// From the lowest corner to the highest.
    pub span: usize,
    /// Number of bends and holes.
    pub count: usize,
    /// N/m.
    pub stiffness: f32,
    /// The places at which there is no bend, in ascending order.
    pub holes: &'a [u32],
}

impl Parallelograms<'_> {
    /// Whether half of the bends of both or more have their lowest corners in the same slots.
    pub fn overlap(&self, other: &Self) -> bool {
        let end = (self.lowest + self.count).min(other.lowest + other.count);
        2 * end.saturating_sub(self.lowest.max(other.lowest)) >= self.count.max(other.count)
    }
}

impl<const N: usize> BendRun<N> {
    /// The run as one of parallelograms, if all of its bends are, and the block owns all of their corners.
    pub fn parallelograms(&self) -> Option<Parallelograms<'_>> {
        let (weights, [stiffness, _]) = (self.weights?, self.material?);
        let lowest = self.first[self.order[0] as usize];
        let corners = |weight: f32| {
            let corners = || (0..N).filter(|end| weights[*end] == weight);
            let [one, other] = [corners().next()?, corners().nth(1)?];
            (corners().count() == 2).then_some([one, other].map(|end| (self.first[end] - lowest) as usize))
        };
        let (plus, minus) = (corners(1.0)?, corners(-1.0)?);
        let is_plain = N == 4 && self.owned == [true; N] && !self.is_curved && !self.is_damped;
        is_plain.then_some(Parallelograms {
            lowest: lowest as usize,
            plus,
            minus,
            span: (self.first[self.order[N - 1] as usize] - lowest) as usize,
            count: self.count as usize,
            stiffness,
            holes: &self.holes,
        })
    }

    /// An empty run that will begin with this bend.
    fn new(entry: &BendEntry<N>, start: u32, bend: Bend<N>) -> Self {
        let first = entry.ends();
        let mut order = std::array::from_fn(|end| end as u32);
        order.sort_unstable_by_key(|end| first[*end as usize]);
        Self {
            first,
            order,
            count: 0,
            start,
            holes: Vec::new(),
            owned: entry.owned,
            weights: Some(bend.weights),
            material: Some([bend.stiffness, bend.damping]),
            is_curved: false,
            is_damped: false,
        }
    }

    /// Takes note of the parameters of one of its bends.
    fn note(&mut self, Bend { rest_length, stiffness, damping, weights }: Bend<N>) {
        self.material = self.material.filter(|material| *material == [stiffness, damping]);
        self.weights = self.weights.filter(|all| *all == weights);
        self.is_curved |= rest_length > 0.0;
        self.is_damped |= damping > 0.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One run ends and the next begins with bends on the same ends.
    #[test]
    fn runs_that_overlap_are_two() {
        let entry = |(bend, first): (u32, u32)| BendEntry {
            span: 0,
            owned: [true; 3],
            offsets: [0, 1, 2],
            first,
            bend,
        };
        let entries: Vec<_> = (0..).zip((0..10).chain(9..19)).map(entry).collect();
        let (mut list, mut loose) = (BendList::<3>::default(), Vec::new());
        list.fill(&vec![Bend::default(); entries.len()], &entries, &mut loose, |_, _| ());
        assert_eq!((list.runs.len(), list.len(), loose.len()), (2, 20, 0));
    }
}
