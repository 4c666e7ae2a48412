//! The bends in the order in which the kernel takes them: in runs where all of their ends are consecutive, as springs
//! are; the others one by one.

use super::bend_runs::{BendEntry, BendList};
use super::block::{Block, Loose};
use super::blocks::{Blocks, Place};
use super::layout::Layout;
use crate::solver::elements::{Bend, Elements, Holds, Ramp, Table, for_each_bend};

macro_rules! define_bend_places {
    ($($(#[$meta:meta])* $kind:ident: $ends:literal;)*) => {
        /// Where the parameters of each bend are; in several places for one between blocks.
        #[derive(Debug, Clone, Default)]
        pub(super) struct BendPlaces {
            $($(#[$meta])* $kind: Vec<[Option<Place>; $ends]>,)*
        }

        impl Blocks {
            /// Sorts all bends into the blocks.
            pub(super) fn list_bends(&mut self, elements: &Elements, layout: &Layout) {
                $($(#[$meta])* {
                    let list = Kind { parts: |block| (&mut block.bends.$kind, &mut block.loose.$kind) };
                    let mut places = std::mem::take(&mut self.bend_places.$kind);
                    list.build(self, Holds::<Bend<$ends>, $ends>::table(elements), layout, &mut places);
                    self.bend_places.$kind = places;
                })*
            }

            /// Takes over which bends have been added and changed since the last time.
            pub(super) fn update_bends(&mut self, elements: &Elements) {
                $($(#[$meta])* {
                    let list = Kind { parts: |block| (&mut block.bends.$kind, &mut block.loose.$kind) };
                    let mut places = std::mem::take(&mut self.bend_places.$kind);
                    let table = Holds::<Bend<$ends>, $ends>::table(elements);
                    list.append(self, table, &mut places);
                    for index in table.edits().iter().map(|index| *index as usize) {
                        list.set(self, &places[index], table.elements()[index]);
                    }
                    self.bend_places.$kind = places;
                })*
            }

            /// Gives the bends on ramps the parameters that they have when `share` of the tick is done.
            pub(super) fn ramp_bends_to(&mut self, elements: &Elements, share: f32) {
                $($(#[$meta])* {
                    let list = Kind { parts: |block| (&mut block.bends.$kind, &mut block.loose.$kind) };
                    let places = std::mem::take(&mut self.bend_places.$kind);
                    let ramps: &[Ramp<Bend<$ends>>] = Holds::<Bend<$ends>, $ends>::table(elements).ramps();
                    for ramp in ramps {
                        list.set(self, &places[ramp.index as usize], ramp.at(share));
                    }
                    self.bend_places.$kind = places;
                })*
            }
        }
    };
}
for_each_bend!(define_bend_places);

/// The bends of N ends of a block: those in runs, and the others.
type Parts<'a, const N: usize> = (&'a mut BendList<N>, &'a mut Vec<Loose<Bend<N>, N>>);

/// How to find them.
struct Kind<const N: usize> {
    parts: fn(&mut Block) -> Parts<'_, N>,
}

impl<const N: usize> Kind<N> {
    fn build(
        &self,
        blocks: &mut Blocks,
        table: &Table<Bend<N>, N>,
        layout: &Layout,
        places: &mut Vec<[Option<Place>; N]>,
    ) {
        places.clear();
        places.resize(table.sorted(), [None; N]);
        for (number, entries) in sorted_entries(blocks, table, layout).into_iter().enumerate() {
            let (list, loose) = (self.parts)(&mut blocks.blocks[number]);
            list.fill(table.elements(), &entries, loose, |bend, index| {
                note(&mut places[bend as usize], Place { block: number as u32, index: index as u32 });
            });
        }
        for index in (0..table.sorted()).filter(|index| table.is_anchored(*index)) {
            places[index] = self.add(blocks, table, index);
        }
        self.append(blocks, table, places);
    }

    /// Lists the bends that came later.
    fn append(&self, blocks: &mut Blocks, table: &Table<Bend<N>, N>, places: &mut Vec<[Option<Place>; N]>) {
        for index in places.len()..table.len() {
            places.push(self.add(blocks, table, index));
        }
    }

    /// Appends a bend that is in no run.
    fn add(&self, blocks: &mut Blocks, table: &Table<Bend<N>, N>, index: usize) -> [Option<Place>; N] {
        let listed = blocks.add_loose(table, index, |block| (self.parts)(block).1);
        listed.map(|block| {
            block.map(|block| {
                let (list, loose) = (self.parts)(&mut blocks.blocks[block as usize]);
                Place { block, index: (list.len() + loose.len() - 1) as u32 }
            })
        })
    }

    fn set(&self, blocks: &mut Blocks, places: &[Option<Place>; N], bend: Bend<N>) {
        for place in places.iter().flatten() {
            let (list, loose) = (self.parts)(&mut blocks.blocks[place.block as usize]);
            match (place.index as usize).checked_sub(list.len()) {
                Some(index) => loose[index].element = bend,
                None => list.set(place.index as usize, bend),
            }
        }
    }
}

/// Enters a place in the first of `places` that is empty.
fn note<const N: usize>(places: &mut [Option<Place>; N], place: Place) {
    if let Some(empty) = places.iter_mut().find(|place| place.is_none()) {
        *empty = Some(place);
    }
}

/// The bends of each block that may be in runs, sorted.
fn sorted_entries<const N: usize>(
    blocks: &Blocks,
    table: &Table<Bend<N>, N>,
    layout: &Layout,
) -> Vec<Vec<BendEntry<N>>> {
    let mut entries = vec![Vec::new(); blocks.blocks.len()];
    for (bend, ends) in table.all_ends()[..table.sorted()].iter().enumerate() {
        if table.is_anchored(bend) {
            continue;
        }
        let found = ends.map(|end| blocks.block_of(end));
        let offsets = ends.map(|end| end.wrapping_sub(ends[0]) as i32);
        for (place, &block) in found.iter().enumerate() {
            let Some(number) = block.filter(|_| !found[..place].contains(&block)) else { continue };
            entries[number].push(BendEntry {
                span: layout.span_of(ends[0]),
                owned: found.map(|other| other == block),
                offsets,
                first: ends[0],
                bend: bend as u32,
            });
        }
    }
    entries.iter_mut().for_each(|entries| entries.sort_unstable());
    entries
}
