//! The elements that end in one block of particles: runs of springs, and what is in none.

use std::ops::Range;

use super::bend_runs::BendRuns;
use crate::solver::elements::{Spring, Table, for_each_kind};

/// Runs shorter than this are loose: a vector would not be filled.
pub(in crate::solver) const MIN_RUN: usize = 8;

/// Springs whose lower ends are consecutive slots, and whose upper ends are too.
#[derive(Debug, Clone, Copy)]
pub(in crate::solver) struct Run {
    /// The first of the lower slots.
    pub lower: u32,
    /// The first of the upper slots.
    pub upper: u32,
    /// Number of springs.
    pub count: u32,
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
}

macro_rules! define_loose {
    ($($(#[$meta:meta])* $kind:ident: $element:ty, $ends:literal;)*) => {
        /// The loose elements of each kind.
        #[derive(Debug, Clone, Default)]
        pub(in crate::solver) struct LooseElements {
            $($(#[$meta])* pub $kind: Vec<Loose<$element, $ends>>,)*
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
    /// The springs in runs, then the loose ones.
    pub springs: Vec<u32>,
    pub bends: BendRuns,
    pub loose: LooseElements,
}

/// A spring of a block, in the order of sorting.
#[derive(Debug, Clone, Copy)]
pub(super) struct Entry {
    pub tile: u32,
    pub owned: Owned,
    pub offset: u32,
    pub lower: u32,
    pub spring: u32,
}

/// Which ends of a spring a block owns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Owned {
    Both,
    Lower,
    Upper,
}

impl Block {
    pub(super) fn set_parameters(&mut self, index: usize, spring: Spring) {
        let Some(rest_length) = self.rest_length.get_mut(index) else {
            self.loose.springs[index - self.rest_length.len()].element = spring;
            return;
        };
        let Spring { stiffness, damping, .. } = spring;
        *rest_length = spring.length_at_rest();
        self.stiffness[index] = stiffness;
        self.damping[index] = damping;
        let run = self.runs.partition_point(|run| run.start as usize <= index) - 1;
        if self.runs[run].material != Some([stiffness, damping]) {
            self.runs[run].material = None;
        }
    }

    /// Divides sorted entries into runs and loose springs.
    pub(super) fn fill_runs(&mut self, springs: &Table<Spring, 2>, entries: &[Entry]) {
        let springs = springs.elements();
        let spring_of = |entry: &Entry| &springs[entry.spring as usize];
        let material = |entry: &Entry| [spring_of(entry).stiffness, spring_of(entry).damping];
        let consecutive = |one: &Entry, next: &Entry| {
            one.lower + 1 == next.lower
                && (one.tile, one.owned, one.offset) == (next.tile, next.owned, next.offset)
                && spring_of(one).tension_only == spring_of(next).tension_only
        };
        let mut short: Vec<&Entry> = Vec::new();
        for group in entries.chunk_by(consecutive) {
            if group.len() < MIN_RUN {
                short.extend(group);
                continue;
            }
            let Entry { owned, offset, lower, .. } = group[0];
            let first = material(&group[0]);
            let is_uniform = group.iter().all(|entry| material(entry) == first);
            self.runs.push(Run {
                lower,
                upper: lower + offset,
                count: group.len() as u32,
                start: self.springs.len() as u32,
                owned: [owned != Owned::Upper, owned != Owned::Lower],
                tension_only: spring_of(&group[0]).tension_only,
                material: is_uniform.then_some(first),
            });
            self.rest_length.extend(group.iter().map(|entry| spring_of(entry).length_at_rest()));
            self.stiffness.extend(group.iter().map(|entry| spring_of(entry).stiffness));
            self.damping.extend(group.iter().map(|entry| spring_of(entry).damping));
            self.springs.extend(group.iter().map(|entry| entry.spring));
        }
        for entry in short {
            let Entry { owned, offset, lower, spring, .. } = *entry;
            self.loose.springs.push(Loose {
                ends: [lower, lower + offset],
                owned: [owned != Owned::Upper, owned != Owned::Lower],
                element: *spring_of(entry),
            });
            self.springs.push(spring);
        }
    }
}
