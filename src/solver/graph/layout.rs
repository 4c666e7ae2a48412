//! Where the blocks of particles begin, and the tiles in which runs of springs stay.
//!
//! A *span* is a piece of the slots that no element leaves; an island in one piece is one. Small spans share a
//! block, large ones are cut into blocks and tiles counted from their first slot. So the order in which the
//! forces on a particle are added is the same whatever else is in the scene, and an island moves to the bit as
//! it would alone.

use std::ops::Range;

use crate::solver::elements::Elements;

/// Number of particles of a tile; no run crosses the end of one, but for holes. The state of as many fits in the first-level cache.
const TILE: usize = 1024;

/// The smallest number of particles of a block, where there are as many: smaller ones list more elements twice.
pub(super) const MIN_BLOCK: usize = 2048;

/// Particles from which on a block of small spans is closed: what the passes over one read and write fits in the first-level
/// cache.
const SHARED_BLOCK: usize = 512;

/// The part of the elements of a span that may be listed twice: a larger block is taken until no more are.
const MAX_CUT: f32 = 0.04;

/// The layout of the sorted elements among the particles that were there when they were sorted.
pub(super) struct Layout {
    ranges: Vec<Range<usize>>,
    /// The tile of each slot.
    tiles: Vec<u32>,
    /// The first slot of each span.
    starts: Vec<u32>,
}

/// A piece of the slots that no element leaves.
struct Span {
    slots: Range<usize>,
    /// Particles of each block.
    block: usize,
}

impl Layout {
    /// Particles in each block of those that came later.
    pub const LATE_BLOCK: usize = MIN_BLOCK;

    /// The layout of the sorted elements among the first `particles` particles.
    pub fn of(elements: &Elements, particles: usize) -> Self {
        let mut extents = Vec::with_capacity(elements.len());
        elements.for_each_sorted(|ends| {
            let (lower, upper) = (ends.iter().min(), ends.iter().max());
            extents.extend(lower.zip(upper).map(|(lower, upper)| [*lower, *upper]));
        });
        let mut spans = spans(&extents, particles);
        let mut tiles = vec![0; particles];
        let mut next_tile = 0;
        for span in &spans {
            for tile in tiles[span.slots.clone()].chunks_mut(TILE) {
                tile.fill(next_tile);
                next_tile += 1;
            }
        }
        choose_blocks(&extents, &mut spans);
        let starts = spans.iter().map(|span| span.slots.start as u32).collect();
        Self { ranges: ranges(&spans), tiles, starts }
    }

    /// The slots of all blocks, with those of particles that came later.
    fn ranges(&self, particles: usize) -> impl Iterator<Item = Range<usize>> {
        let sorted = self.tiles.len();
        let late = (sorted..particles).step_by(Self::LATE_BLOCK);
        self.ranges
            .iter()
            .cloned()
            .chain(late.map(move |start| start..particles.min(start + Self::LATE_BLOCK)))
    }

    /// The same without what is excluded: pieces of blocks.
    pub fn pieces(&self, particles: usize, is_excluded: impl Fn(usize) -> bool) -> Vec<Range<usize>> {
        let mut pieces = Vec::new();
        for range in self.ranges(particles) {
            let mut start = range.start;
            for slot in range.clone().chain([range.end]) {
                if slot == range.end || is_excluded(slot) {
                    if start < slot {
                        pieces.push(start..slot);
                    }
                    start = slot + 1;
                }
            }
        }
        pieces
    }

    /// The tile of a slot.
    pub fn tile_of(&self, slot: u32) -> u32 {
        self.tiles[slot as usize]
    }

    /// The number of the span of a slot.
    pub fn span_of(&self, slot: u32) -> u32 {
        self.starts.partition_point(|start| *start <= slot) as u32
    }
}

/// The pieces, from the lowest and the highest slot of each element.
fn spans(extents: &[[u32; 2]], particles: usize) -> Vec<Span> {
    let mut reach: Vec<u32> = (0..particles as u32).collect();
    for &[lower, upper] in extents {
        reach[lower as usize] = reach[lower as usize].max(upper);
    }
    let (mut spans, mut start, mut furthest) = (Vec::new(), 0, 0);
    for (slot, reach) in reach.into_iter().enumerate() {
        furthest = furthest.max(reach);
        if furthest as usize == slot {
            spans.push(Span { slots: start..slot + 1, block: MIN_BLOCK });
            start = slot + 1;
        }
    }
    spans
}

/// Chooses for each span the smallest power of two particles a block that cuts few of its elements. It depends on
/// the elements alone, never on the number of threads.
fn choose_blocks(extents: &[[u32; 2]], spans: &mut [Span]) {
    let large = || spans.iter().enumerate().filter(|(_, span)| span.slots.len() > MIN_BLOCK);
    // The large spans in their order, and of each the number of elements that blocks of 2ⁿ particles would cut.
    let ends: Vec<u32> = large().map(|(_, span)| span.slots.end as u32).collect();
    let starts: Vec<u32> = large().map(|(_, span)| span.slots.start as u32).collect();
    let numbers: Vec<usize> = large().map(|(number, _)| number).collect();
    let mut elements = vec![0_usize; numbers.len()];
    let mut cut = vec![[0_usize; u32::BITS as usize + 1]; numbers.len()];
    let mut place = 0;
    for &[lower, upper] in extents {
        if !(ends.get(place).is_some_and(|end| lower < *end) && starts[place] <= lower) {
            place = ends.partition_point(|end| *end <= lower);
        }
        let Some(start) = starts.get(place).filter(|start| **start <= lower) else { continue };
        elements[place] += 1;
        // The highest place in which the two numbers differ: smaller blocks divide them.
        let differing = (lower - start) ^ (upper - start);
        cut[place][(u32::BITS - differing.leading_zeros()) as usize] += 1;
    }
    for ((number, elements), cut) in numbers.into_iter().zip(elements).zip(cut) {
        let span = &mut spans[number];
        let is_cut = |block: usize| {
            let cut: usize = cut[block.trailing_zeros() as usize + 1..].iter().sum();
            cut as f32 > MAX_CUT * elements as f32
        };
        while is_cut(span.block) && span.block < span.slots.len() {
            span.block *= 2;
        }
    }
}

/// The blocks: small spans together, large ones in pieces.
fn ranges(spans: &[Span]) -> Vec<Range<usize>> {
    let mut ranges: Vec<Range<usize>> = Vec::new();
    let mut is_open = false;
    for Span { slots, block, .. } in spans {
        if slots.len() >= MIN_BLOCK {
            ranges.extend(slots.clone().step_by(*block).map(|start| start..slots.end.min(start + block)));
            is_open = false;
            continue;
        }
        match ranges.last_mut().filter(|_| is_open) {
            Some(last) => last.end = slots.end,
            None => ranges.push(slots.clone()),
        }
        is_open = ranges.last().is_some_and(|last| last.len() < SHARED_BLOCK);
    }
    ranges
}

#[cfg(test)]
mod tests {
    use bevy::math::Vec3;

    use super::super::block::Block;
    use super::super::blocks::Blocks;
    use crate::solver::elements::{Elements, Spring};
    use crate::solver::particles::Particles;

    #[test]
    fn the_blocks_of_an_island_do_not_depend_on_what_is_before_it() {
        let rope = |elements: &mut Elements, start: u32, count: u32| {
            for slot in start + 1..start + count {
                let spring = Spring { rest_length: 0.1, stiffness: 1.0, damping: 0.0, ..Spring::default() };
                elements.push([slot - 1, slot], spring);
            }
        };
        let blocks = |elements: Elements, count: usize| {
            let mut particles = Particles::default();
            (0..count).for_each(|_| particles.push(Vec3::ZERO, Vec3::ZERO, 1.0, 0.0));
            Blocks::of(elements, &particles).blocks
        };
        let (mut alone, mut beside) = (Elements::default(), Elements::default());
        rope(&mut alone, 0, 5000);
        rope(&mut beside, 0, 40);
        rope(&mut beside, 40, 5000);
        let shape = |blocks: &[Block], first: u32| -> Vec<(u32, u32)> {
            blocks.iter().flat_map(|block| &block.runs).map(|run| (run.lower - first, run.count)).collect()
        };
        assert_eq!(shape(&blocks(alone, 5000), 0), shape(&blocks(beside, 5040)[1..], 40));
    }
}
