//! The order in which position-based dynamics takes the elements: block by block, in each by colour.
//!
//! No two elements of one colour share a free particle, so that their order among themselves changes nothing.

use std::ops::Range;

use super::{Blocks, Linked};
use crate::solver::elements::{Acting, Elements};
use crate::solver::particles::Particles;
use crate::solver::state::Version;

/// The elements with all free ends in one block of particles, then those between blocks, each by colour.
#[derive(Debug, Clone, Default)]
pub(in crate::solver) struct Colouring {
    elements: Vec<Linked>,
    /// Where those of each block end in `elements`.
    block_ends: Vec<usize>,
    key: (Version, Version, Version),
}

impl Colouring {
    /// Makes it that of the acting `elements`, with the blocks of `blocks`.
    pub fn refresh(&mut self, elements: &Elements, particles: &Particles, blocks: &Blocks) {
        let key = (elements.ends_version(), particles.free_version(), blocks.ranges_version());
        if self.key != key {
            self.key = key;
            self.colour(elements, particles, blocks.blocks.iter().map(|block| block.slots.clone()));
        }
    }

    /// Gives each element in turn the first colour that none has at its free ends, and sorts by block and colour.
    fn colour(
        &mut self,
        elements: &Elements,
        particles: &Particles,
        ranges: impl ExactSizeIterator<Item = Range<usize>>,
    ) {
        let count = ranges.len();
        let mut block_of = vec![count; particles.len()];
        for (block, range) in ranges.enumerate() {
            block_of[range].fill(block);
        }
        let mut taken: Vec<Vec<u32>> = vec![Vec::new(); particles.len()];
        let mut coloured: Vec<(usize, u32, Linked)> = Vec::with_capacity(elements.len());
        elements.for_each_acting(|Acting { number, ends, .. }| {
            let free = || ends.iter().map(|end| *end as usize).filter(|end| !particles.is_pinned(*end));
            let is_unused = |colour: &u32| free().all(|end| !taken[end].contains(colour));
            let colour = (0..).find(is_unused).unwrap_or(0);
            free().for_each(|end| taken[end].push(colour));
            let mut blocks = free().map(|end| block_of[end]);
            let Some(block) = blocks.next() else { return };
            let is_within = blocks.all(|other| other == block);
            coloured.push((if is_within { block } else { count }, colour, Linked::new(number, ends)));
        });
        coloured.sort_unstable();
        self.block_ends.clear();
        self.block_ends
            .extend((0..count).map(|block| coloured.partition_point(|(found, ..)| *found <= block)));
        self.elements.clear();
        self.elements.extend(coloured.into_iter().map(|(.., entry)| entry));
    }

    /// The elements within each block.
    pub fn within_blocks(&self) -> impl Iterator<Item = &[Linked]> {
        let starts = std::iter::once(&0).chain(&self.block_ends);
        starts.zip(&self.block_ends).map(|(start, end)| &self.elements[*start..*end])
    }

    /// The elements between blocks.
    pub fn between_blocks(&self) -> &[Linked] {
        &self.elements[self.block_ends.last().copied().unwrap_or(0)..]
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::Vec3;

    use super::*;
    use crate::solver::elements::Spring;

    #[test]
    fn elements_of_one_colour_share_no_free_particle() {
        let (mut elements, mut particles) = (Elements::default(), Particles::default());
        for ends in [[0, 1], [1, 2], [2, 3], [3, 1], [0, 3]] {
            elements
                .push(ends, Spring { rest_length: 1.0, stiffness: 1.0, damping: 0.0, ..Spring::default() });
        }
        for inverse_mass in [0.0, 1.0, 1.0, 1.0] {
            particles.push(Vec3::ZERO, Vec3::ZERO, inverse_mass, 0.0);
        }
        let numbers = |listed: &[Linked]| listed.iter().map(|entry| entry.element).collect::<Vec<_>>();
        let mut colouring = Colouring::default();
        colouring.colour(&elements, &particles, std::iter::once(0..4));
        // The colours are 0, 1, 0, 2, 1.
        assert_eq!(numbers(&colouring.elements), [0, 2, 1, 4, 3]);
        // Of the blocks {0, 1} and {2, 3}, one has element 0 to itself, the other 2, and 4, which has a pinned end.
        colouring.colour(&elements, &particles, [0..2, 2..4].into_iter());
        assert_eq!(colouring.within_blocks().map(numbers).collect::<Vec<_>>(), [vec![0], vec![2, 4]]);
        assert_eq!(numbers(colouring.between_blocks()), [1, 3]);
    }
}
