//! The elements in the order in which the kernel takes them.
//!
//! The particles are divided into *blocks* of consecutive slots. A block owns the forces on its particles and
//! lists every element that ends in it; one between two blocks is listed in both, and each computes it for its
//! own ends, so that blocks need not wait for each other and a tick has the same bits on any number of threads.
//!
//! Within a block springs are sorted by the offset between their two slots, then by slot. Ropes, cloths and
//! lattices then fall into long *runs*, in which the first ends are consecutive and the second ends too: eight
//! springs are loaded, computed and stored at a time without gathering. The others are *loose*, taken one by one.
//! Bends fall into runs in the same way (`bend_blocks.rs`); elements of other kinds are loose (`loose_blocks.rs`).
//!
//! In which order the forces on a particle are added follows from its island alone: see `layout.rs`.

use super::anchored::Anchored;
use super::bend_blocks::BendPlaces;
use super::block::{Block, Entry, Loose, NO_SPRING};
use super::layout::Layout;
use super::loose_blocks::LoosePlaces;
use crate::solver::elements::{Element, Elements, Spring, Table};
use crate::solver::particles::{Particles, split_off};
use crate::solver::state::Version;

/// From about this number of particles and springs together on it pays to wake other threads. Measured: a rope of
/// 10,000 (20,000) takes two threads a twentieth longer than one, a cloth of 70² (34,000) a twelfth less.
const MIN_SHARED: usize = 25_000;

/// All elements in blocks.
#[derive(Debug, Clone, Default)]
pub(in crate::solver) struct Blocks {
    /// The blocks, in the order of their slots. Particles that the planner has excluded are in none.
    pub blocks: Vec<Block>,
    /// Where the parameters of each spring are; in the second place only for a spring between two blocks.
    pub(super) places: Vec<[Option<Place>; 2]>,
    pub(super) bend_places: BendPlaces,
    pub(super) loose_places: LoosePlaces,
    /// Whether each block owns all ends of its elements.
    are_closed: bool,
    particles: usize,
    version: Version,
    excluded: Version,
    ranges_version: Version,
}

/// The number of a block, and of an element of one kind in it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    pub block: u32,
    pub index: u32,
}

impl Blocks {
    /// The blocks of settled elements.
    pub fn of(mut elements: Elements, particles: &Particles) -> Self {
        elements.settle(particles.inverse_mass());
        let mut blocks = Self::default();
        blocks.build(&elements, particles.len(), |_| false);
        blocks
    }

    /// Makes them those of `elements`, without the particles that are `excluded`: their set has a version.
    pub fn refresh(
        &mut self,
        elements: &mut Elements,
        particles: &Particles,
        (excluded, is_excluded): (Version, impl Fn(usize) -> bool),
    ) {
        let count = particles.len();
        if (self.version, self.particles, self.excluded) == (elements.version(), count, excluded) {
            return;
        }
        // A state that was put back may have fewer particles.
        let is_listed = elements.lists_edits_since(self.version) && count >= self.particles;
        let is_whole = excluded == Version::default() && self.excluded == excluded;
        if is_listed && is_whole && !self.blocks.is_empty() {
            self.update(elements.springs(), elements.sorted_particles(), count);
            self.update_bends(elements);
            self.update_loose(elements);
        } else {
            self.build(elements, count, is_excluded);
        }
        (self.version, self.excluded) = (elements.version(), excluded);
        elements.reset_edits();
    }

    /// Gives the elements on ramps the parameters that they have when `share` of the tick is done.
    pub fn ramp_to(&mut self, elements: &Elements, share: f32) {
        let ramps = elements.springs().ramps().iter();
        ramps.for_each(|ramp| self.set_parameters(ramp.index as usize, ramp.at(share)));
        self.ramp_bends_to(elements, share);
        self.ramp_loose_to(elements, share);
    }

    /// Gives a spring other parameters.
    pub fn set_parameters(&mut self, index: usize, spring: Spring) {
        for place in self.places[index].into_iter().flatten() {
            self.blocks[place.block as usize].set_parameters(place.index as usize, spring);
        }
    }

    /// Changes when a block gets other slots.
    pub fn ranges_version(&self) -> Version {
        self.ranges_version
    }

    /// Whether an evaluation of the forces takes so long that other threads should help.
    pub fn are_worth_sharing(&self) -> bool {
        self.are_worth_sharing_for(1)
    }

    /// Whether this number of evaluations without a barrier between them does.
    pub fn are_worth_sharing_for(&self, evaluations: u32) -> bool {
        self.blocks.len() > 1 && (self.particles + self.places.len()) * evaluations as usize >= MIN_SHARED
    }

    /// Whether no element joins a block to what is not in it.
    pub fn are_closed(&self) -> bool {
        self.are_closed
    }

    /// Number of springs in no run; those between two blocks count twice.
    pub fn loose_springs(&self) -> usize {
        self.blocks.iter().map(|block| block.loose.springs.len()).sum()
    }

    /// Splits vectors, given by coordinate, into those of each block.
    pub fn split<'a>(
        &'a self,
        mut vectors: [&'a mut [f32]; 3],
    ) -> impl Iterator<Item = [&'a mut [f32]; 3]> + Send + 'a {
        let mut passed = 0;
        self.blocks.iter().map(move |Block { slots, .. }| {
            split_off(&mut vectors, slots.start - passed);
            passed = slots.end;
            split_off(&mut vectors, slots.len())
        })
    }

    /// The springs that end in a particle. They are not searched for if these are the blocks of `elements`.
    pub fn springs_at(&self, elements: &Elements, slot: usize) -> Vec<usize> {
        let springs = elements.springs();
        let are_present = elements.lists_edits_since(self.version) && self.places.len() == springs.len();
        let block = self.block_of(slot as u32).filter(|_| are_present);
        let Some(block) = block.map(|block| &self.blocks[block]) else {
            let ends = springs.all_ends().iter().enumerate();
            return ends.filter(|(_, ends)| ends.contains(&(slot as u32))).map(|(index, _)| index).collect();
        };
        block.springs_at(slot as u32)
    }

    pub(super) fn block_of(&self, slot: u32) -> Option<usize> {
        let block = self.blocks.partition_point(|block| block.slots.end <= slot as usize);
        self.blocks.get(block)?.slots.contains(&(slot as usize)).then_some(block)
    }

    /// Sorts all elements into blocks.
    fn build(&mut self, elements: &Elements, particles: usize, is_excluded: impl Fn(usize) -> bool) {
        let springs = elements.springs();
        let layout = Layout::of(elements, elements.sorted_particles().min(particles));
        self.particles = particles;
        self.ranges_version = Version::new();
        self.blocks.clear();
        let blocks = layout.pieces(particles, is_excluded).into_iter();
        self.blocks.extend(blocks.map(|slots| Block { slots, ..Block::default() }));
        self.places.clear();
        self.places.resize(springs.sorted(), [None; 2]);
        let mut anchored = self.anchored_entries(springs);
        for (number, entries) in self.sorted_entries(springs, &layout).into_iter().enumerate() {
            let anchored = Anchored::new(springs, &mut anchored[number]);
            self.blocks[number].fill_runs(springs, &entries, &anchored);
            let springs = self.blocks[number].springs.iter().zip(0..);
            for (spring, index) in springs.filter(|(spring, _)| **spring != NO_SPRING) {
                let [first, second] = &mut self.places[*spring as usize];
                let place = if first.is_none() { first } else { second };
                *place = Some(Place { block: number as u32, index });
            }
        }
        let anchored = (0..springs.sorted()).filter(|index| springs.is_anchored(*index));
        anchored.for_each(|index| self.add_spring(springs, index));
        self.link_anchored();
        for index in springs.sorted()..springs.len() {
            self.places.push([None; 2]);
            self.add_spring(springs, index);
        }
        self.list_bends(elements, &layout);
        self.loose_places = LoosePlaces::default();
        self.list_loose(elements);
        self.are_closed = self.blocks.iter().all(Block::is_closed);
    }

    /// The springs of each block that may be in runs, sorted.
    fn sorted_entries(&self, springs: &Table<Spring, 2>, layout: &Layout) -> Vec<Vec<Entry>> {
        // As many as fall on each by its part of the particles, and some more.
        let per_particle = springs.sorted() as f32 / self.particles.max(1) as f32;
        let capacity = |block: &Block| (1.1 * per_particle * block.slots.len() as f32) as usize;
        let mut entries: Vec<_> =
            self.blocks.iter().map(|block| Vec::with_capacity(capacity(block))).collect();
        let mut block = 0;
        // Ends lie close, and so do those of the next spring.
        let mut find = |slot: u32| {
            if !self.blocks.get(block).is_some_and(|found: &Block| found.slots.contains(&(slot as usize))) {
                block = self.block_of(slot)?;
            }
            Some(block)
        };
        let sorted = springs.all_ends()[..springs.sorted()].iter().zip(springs.elements());
        for (number, (&[first, second], spring)) in sorted.enumerate() {
            if springs.is_anchored(number) {
                continue;
            }
            let (lower, upper) = (first.min(second), first.max(second));
            let offset = upper - lower;
            let blocks = [find(lower), find(upper)];
            let mut add = |block: Option<usize>, slot, owned| {
                let Some(block) = block else { return };
                entries[block].push(Entry::new(
                    layout.tile_of(slot),
                    owned,
                    [lower, offset],
                    (number, spring),
                ));
            };
            if blocks[0] == blocks[1] {
                add(blocks[0], lower, [true; 2]);
            } else {
                add(blocks[0], lower, [true, false]);
                add(blocks[1], upper, [false, true]);
            }
        }
        let mut spare = Vec::new();
        // They are in the order of the springs: the last key.
        entries.iter_mut().for_each(|entries| Entry::sort(entries, &mut spare));
        entries
    }

    /// Takes over what has been added and changed since the last time.
    fn update(&mut self, springs: &Table<Spring, 2>, sorted_particles: usize, particles: usize) {
        if particles > self.particles {
            self.add_late_particles(sorted_particles, particles);
        }
        for index in self.places.len()..springs.len() {
            self.places.push([None; 2]);
            self.add_spring(springs, index);
        }
        let edits = springs.edits().iter().map(|index| *index as usize);
        edits.for_each(|index| self.set_parameters(index, springs.elements()[index]));
    }

    /// Puts added particles into blocks of their own, as [`Layout::ranges`] does.
    fn add_late_particles(&mut self, sorted_particles: usize, particles: usize) {
        let last = self.blocks.last_mut().filter(|last| last.slots.start >= sorted_particles);
        if let Some(last) = last {
            last.slots.end = particles.min(last.slots.start + Layout::LATE_BLOCK);
            self.particles = last.slots.end;
        }
        for start in (self.particles..particles).step_by(Layout::LATE_BLOCK) {
            let slots = start..particles.min(start + Layout::LATE_BLOCK);
            self.blocks.push(Block { slots, ..Block::default() });
        }
        self.particles = particles;
        self.ranges_version = Version::new();
    }

    /// Appends a spring that is in no run.
    fn add_spring(&mut self, springs: &Table<Spring, 2>, index: usize) {
        for place in self.add_loose(springs, index, |block| &mut block.loose.springs).into_iter().flatten() {
            let block = &mut self.blocks[place as usize];
            let index_in_block = block.springs.len() as u32;
            block.springs.push(index as u32);
            let [first, second] = &mut self.places[index];
            let entry = if first.is_none() { first } else { second };
            *entry = Some(Place { block: place, index: index_in_block });
        }
    }

    /// Lists an element in each block that has an end of it; these blocks.
    pub(super) fn add_loose<E: Element<N>, const N: usize>(
        &mut self,
        table: &Table<E, N>,
        index: usize,
        list: impl Fn(&mut Block) -> &mut Vec<Loose<E, N>>,
    ) -> [Option<u32>; N] {
        let (ends, element) = (table.all_ends()[index], table.elements()[index]);
        let blocks = ends.map(|end| self.block_of(end));
        let mut listed = [None; N];
        for (place, &block) in blocks.iter().enumerate() {
            let Some(number) = block.filter(|_| !blocks[..place].contains(&block)) else { continue };
            let owned = blocks.map(|other| other == block);
            self.are_closed &= owned == [true; N];
            list(&mut self.blocks[number]).push(Loose { ends, owned, element, computed: None });
            listed[place] = Some(number as u32);
        }
        listed
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::Vec3;

    use super::super::layout::MIN_BLOCK;
    use super::*;

    fn particles(count: usize) -> Particles {
        let mut particles = Particles::default();
        (0..count).for_each(|_| particles.push(Vec3::ZERO, Vec3::ZERO, 1.0, 0.0));
        particles
    }

    fn spring(rest_length: f32) -> Spring {
        Spring { rest_length, stiffness: 1.0, damping: 0.0, ..Spring::default() }
    }

    /// Each spring as (lower, upper, rest length), once for each of its ends that a block owns.
    fn listed(blocks: &Blocks) -> Vec<(u32, u32, u32)> {
        let mut listed = Vec::new();
        let mut list = |[lower, upper]: [u32; 2], owned: [bool; 2], rest_length: f32| {
            let owned = owned.iter().filter(|owned| **owned).count();
            listed.extend(std::iter::repeat_n(
                (lower.min(upper), lower.max(upper), rest_length.to_bits()),
                owned,
            ));
        };
        for block in &blocks.blocks {
            for run in &block.runs {
                let is_hole = |at: &u32| run.holes.iter().any(|hole| hole.contains(at));
                for at in (0..run.count).filter(|at| !is_hole(at)) {
                    let rest_length = block.rest_length[(run.start + at) as usize];
                    list([run.lower + at, run.upper + at], run.owned, rest_length);
                }
            }
            for loose in &block.loose.springs {
                list(loose.ends, loose.owned, loose.element.rest_length);
            }
        }
        listed.sort_unstable();
        listed
    }

    fn expected(elements: &Elements) -> Vec<(u32, u32, u32)> {
        let springs = elements.springs().all_ends().iter().zip(elements.springs().elements());
        let twice = |(&[first, second], spring): (&[u32; 2], &Spring)| {
            [(first.min(second), first.max(second), spring.rest_length.to_bits()); 2]
        };
        let mut expected: Vec<_> = springs.flat_map(twice).collect();
        expected.sort_unstable();
        expected
    }

    #[test]
    fn both_ends_of_every_spring_are_served_once() {
        let count = 5 * MIN_BLOCK;
        let mut elements = Elements::default();
        for slot in 0..count as u32 {
            // A rope, one link in ten the other way round, and some springs from anywhere to anywhere.
            let next = (slot + 1) % count as u32;
            elements.push(if slot % 10 == 0 { [next, slot] } else { [slot, next] }, spring(slot as f32));
            if slot % 100 == 0 {
                elements.push([slot, slot * 7 % count as u32 + 1], spring(0.5));
            }
        }
        elements.settle(particles(count).inverse_mass());
        let (mut blocks, all) = (Blocks::default(), particles(count + 1200));
        let refresh = |blocks: &mut Blocks, elements: &mut Elements, all: &Particles| {
            blocks.refresh(elements, all, (Version::default(), |_| false));
        };
        refresh(&mut blocks, &mut elements, &particles(count));
        assert!(blocks.blocks.len() > 1);
        assert_eq!(listed(&blocks), expected(&elements));
        // What is added and changed later is listed as if all were listed anew.
        elements.set(3, spring(17.5));
        elements.remove::<Spring, 2>(4);
        for slot in 0..100 {
            elements.push([slot * 70, count as u32 + 12 * slot], spring(2.5));
        }
        refresh(&mut blocks, &mut elements, &all);
        assert_eq!(listed(&blocks), expected(&elements));
        let anew = Blocks::of(elements.clone(), &all);
        let order = |blocks: &Blocks| format!("{:?}", blocks.blocks).replace("Some([1.0, 0.0])", "None");
        assert!(order(&blocks) == order(&anew));
        assert_eq!(blocks.springs_at(&elements, 7).len(), 2);
        // Without some particles, springs that end there are listed for the other end only.
        blocks.refresh(&mut elements, &all, (Version::new(), |slot| slot == 5));
        assert_eq!(listed(&blocks).len(), expected(&elements).len() - 2);
    }

    #[test]
    fn a_rope_is_one_run_in_each_tile() {
        let mut elements = Elements::default();
        for slot in 1..1500 {
            elements.push([slot - 1, slot], spring(0.1));
        }
        let blocks = Blocks::of(elements, &particles(1500));
        let runs: Vec<u32> = blocks.blocks[0].runs.iter().map(|run| run.count).collect();
        assert_eq!(runs, [1024, 475]);
    }
}
