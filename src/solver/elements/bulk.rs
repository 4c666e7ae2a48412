//! Many elements at once: those of a net are consecutive in the table of their kind.

use std::ops::Range;

use super::{Element, Elements, Holds, Spring};
use crate::solver::state::Version;

impl Elements {
    /// Appends elements with ends that are counted from the slot `first`; returns their places.
    pub fn extend<E: Element<N>, const N: usize>(
        &mut self,
        first: u32,
        added: &[([u32; N], E)],
    ) -> Range<usize>
    where
        Self: Holds<E, N>,
    {
        let start = Holds::<E, N>::table(self).len();
        if !added.is_empty() {
            let new = Version::new();
            self.versions = super::Versions { all: new, rates: new, ends: new, ..self.versions };
            if added.iter().any(|(_, element)| element.max_stretch().is_some()) {
                self.versions.limits = new;
            }
            if added.iter().any(|(_, element)| element.may_fail()) {
                self.versions.failures = new;
            }
            self.table_mut()
                .extend(added.iter().map(|(ends, element)| (ends.map(|end| end + first), *element)));
        }
        start..start + added.len()
    }

    /// Empties those of the `places` of which an end `is_gone`.
    pub fn remove_where<E: Element<N>, const N: usize>(
        &mut self,
        places: Range<usize>,
        is_gone: impl Fn(&[u32; N]) -> bool,
    ) where
        Self: Holds<E, N>,
    {
        for index in places {
            let table = Holds::<E, N>::table(self);
            if is_gone(&table.all_ends()[index]) && table.element(index).is_some_and(|element| element.acts())
            {
                self.remove::<E, N>(index);
            }
        }
    }

    /// Gives the elements in `places` these parameters, where they are others; `on_change` gets the ends of each that
    /// changes, and whether it begins or ceases to act. `merge` says what becomes of one, from what is there and what is
    /// wanted. `false`, and nothing is changed, if they join other slots than `slot_of` says.
    pub fn set_all<E: Element<N>, const N: usize>(
        &mut self,
        places: Range<usize>,
        wanted: &[([u32; N], E)],
        slot_of: impl Fn(u32) -> u32,
        merge: impl Fn(usize, &E, &E) -> E,
        mut on_change: impl FnMut(&[u32; N], bool),
    ) -> bool
    where
        Self: Holds<E, N>,
    {
        let table = Holds::<E, N>::table(self);
        let is_same = places.len() == wanted.len()
            && places.clone().zip(wanted).all(|(index, (ends, _))| table.joins(index, ends.map(&slot_of)));
        if !is_same {
            return false;
        }
        for (number, (index, (ends, wanted))) in places.zip(wanted).enumerate() {
            let old = Holds::<E, N>::table(self).elements()[index];
            let element = merge(number, &old, wanted);
            if old != element {
                on_change(&ends.map(&slot_of), old.acts() != element.acts());
                self.set(index, element);
            }
        }
        true
    }

    /// The springs outside of `own` that end in one of the `slots`.
    pub fn springs_into(&self, slots: impl Fn(u32) -> bool, own: &Range<usize>) -> Vec<usize> {
        let table = Holds::<Spring, 2>::table(self);
        let ends = table.all_ends().iter().enumerate();
        let outside = ends.filter(|(index, ends)| !own.contains(index) && ends.iter().any(|end| slots(*end)));
        outside.map(|(index, _)| index).collect()
    }
}
