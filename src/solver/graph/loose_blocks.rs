//! The elements of kinds without runs, in the blocks: they are computed one by one.

use super::block::{Block, Loose};
use super::blocks::{Blocks, Place};
use crate::solver::elements::{Element, Elements, Holds, Table, for_each_kind};

macro_rules! define_loose_places {
    ($($(#[$meta:meta])* $kind:ident: $element:ty, $ends:literal;)*) => {
        /// Where the parameters of each element of these kinds are, in up to a block for each end; of kinds with runs empty.
        #[derive(Debug, Clone, Default)]
        pub(super) struct LoosePlaces {
            $($(#[$meta])* $kind: Vec<[Option<Place>; $ends]>,)*
        }

        impl Blocks {
            /// Lists the elements of these kinds that are not listed yet.
            pub(super) fn list_loose(&mut self, elements: &Elements) {
                $($(#[$meta])* if !<$element as Element<$ends>>::HAS_RUNS {
                    let table = Holds::<$element, $ends>::table(elements);
                    for index in self.loose_places.$kind.len()..table.len() {
                        let places = self.place(table, index, |block| &mut block.loose.$kind);
                        self.loose_places.$kind.push(places);
                    }
                })*
            }

            /// Takes over which of them have been added and changed since the last time.
            pub(super) fn update_loose(&mut self, elements: &Elements) {
                self.list_loose(elements);
                $($(#[$meta])* if !<$element as Element<$ends>>::HAS_RUNS {
                    let table = Holds::<$element, $ends>::table(elements);
                    for index in table.edits().iter().map(|index| *index as usize) {
                        let places = &self.loose_places.$kind[index];
                        set(&mut self.blocks, places, table.elements()[index], |block| &mut block.loose.$kind);
                    }
                })*
            }

            /// Gives those on ramps the parameters that they have when `share` of the tick is done.
            pub(super) fn ramp_loose_to(&mut self, elements: &Elements, share: f32) {
                $($(#[$meta])* if !<$element as Element<$ends>>::HAS_RUNS {
                    for ramp in Holds::<$element, $ends>::table(elements).ramps() {
                        let places = &self.loose_places.$kind[ramp.index as usize];
                        set(&mut self.blocks, places, ramp.at(share), |block| &mut block.loose.$kind);
                    }
                })*
            }
        }
    };
}
for_each_kind!(define_loose_places);

impl Blocks {
    /// Lists an element in each block that has an end of it; where in these.
    fn place<E: Element<N>, const N: usize>(
        &mut self,
        table: &Table<E, N>,
        index: usize,
        list: impl Fn(&mut Block) -> &mut Vec<Loose<E, N>>,
    ) -> [Option<Place>; N] {
        let blocks = self.add_loose(table, index, &list);
        blocks.map(|block| {
            let block = block?;
            Some(Place { block, index: list(&mut self.blocks[block as usize]).len() as u32 - 1 })
        })
    }
}

/// Gives an element other parameters.
fn set<E: Element<N>, const N: usize>(
    blocks: &mut [Block],
    places: &[Option<Place>; N],
    element: E,
    list: impl Fn(&mut Block) -> &mut Vec<Loose<E, N>>,
) {
    for place in places.iter().flatten() {
        list(&mut blocks[place.block as usize])[place.index as usize].element = element;
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::Vec3;

    use super::super::layout::MIN_BLOCK;
    use super::*;
    use crate::solver::elements::Spring;
    use crate::solver::elements::sling::Sling;
    use crate::solver::particles::Particles;
    use crate::solver::state::Version;

    /// What is added, changed, removed and on a ramp is listed as if all were listed anew, also between blocks.
    #[test]
    fn edits_are_taken_over_in_all_blocks() {
        let count = 3 * MIN_BLOCK;
        let (mut particles, mut elements) = (Particles::default(), Elements::default());
        for slot in 0..count {
            particles.push(Vec3::ZERO, Vec3::ZERO, 1.0, 0.0);
            if slot > 0 {
                elements.push([slot as u32 - 1, slot as u32], Spring::elastic(1.0, 1.0, 0.0));
            }
        }
        let sling = |stiffness: f32| Sling { stiffness, damping: 0.5 };
        let ends = |number: u32| [0, 7, 13].map(|step| (number * 97 + step * 151) % count as u32);
        (0..200).for_each(|number| _ = elements.push(ends(number), sling(1.0)));
        elements.settle(particles.inverse_mass());
        elements.end_ramps();
        let mut blocks = Blocks::default();
        let mut refresh = |elements: &mut Elements| {
            blocks.refresh(elements, &particles, (Version::default(), |_| false));
            blocks.clone()
        };
        let first = refresh(&mut elements);
        assert!(first.blocks.iter().filter(|block| !block.loose.slings.is_empty()).count() > 1);
        let between = first.blocks.iter().flat_map(|block| &block.loose.slings);
        assert!(between.clone().count() > 200 && between.clone().any(|sling| sling.owned != [true; 3]));
        elements.set(20, sling(3.0));
        elements.remove::<Sling, 3>(30);
        (200..220).for_each(|number| _ = elements.push(ends(number), sling(2.0)));
        elements.begin_ramps();
        let mut updated = refresh(&mut elements);
        let listed = |blocks: &Blocks| {
            let lists = blocks.blocks.iter().map(|block| format!("{:?}", block.loose.slings));
            lists.collect::<Vec<_>>()
        };
        let anew = |elements: &Elements| {
            let mut blocks = Blocks::default();
            blocks.refresh(&mut elements.clone(), &particles, (Version::default(), |_| false));
            blocks
        };
        assert_eq!(listed(&updated), listed(&anew(&elements)));
        updated.ramp_to(&elements, 0.25);
        let stiffnesses = || {
            let slings = updated.blocks.iter().flat_map(|block| &block.loose.slings);
            slings.filter(|sling| sling.ends == ends(20)).map(|sling| sling.element.stiffness)
        };
        assert!(stiffnesses().count() > 0 && stiffnesses().all(|stiffness| stiffness == 1.5));
    }
}
