//! Adding, changing and removing elements, and which versions these change.

use super::versions::Versions;
use super::{Element, Elements, Holds};
use crate::solver::state::Version;

impl Elements {
    /// Appends an element between different slots; its index in its table.
    pub fn push<E: Element<N>, const N: usize>(&mut self, ends: [u32; N], element: E) -> usize
    where
        Self: Holds<E, N>,
    {
        let new = Version::new();
        self.versions = Versions { all: new, rates: new, ends: new, ..self.versions };
        if element.max_stretch().is_some() {
            self.versions.limits = new;
        }
        if element.may_fail() {
            self.versions.failures = new;
        }
        self.table_mut().push(ends, element)
    }

    /// Replaces the parameters of an element.
    pub fn set<E: Element<N>, const N: usize>(&mut self, index: usize, element: E)
    where
        Self: Holds<E, N>,
    {
        let old = self.table_mut().set(index, element);
        self.versions.all = Version::new();
        if old.rates() != element.rates() {
            self.versions.rates = self.versions.all;
        }
        if old.acts() != element.acts() {
            self.versions.ends = self.versions.all;
        }
        if old.max_stretch().is_some() != element.max_stretch().is_some() {
            self.versions.limits = self.versions.all;
        }
        if old.may_fail() != element.may_fail() {
            self.versions.failures = self.versions.all;
        }
        if old.tension_only() != element.tension_only() {
            // It belongs into another run.
            self.versions.edited_since = self.versions.all;
        }
    }

    /// Empties the place of an element. It leaves all that is derived from the elements at once.
    pub fn remove<E: Element<N>, const N: usize>(&mut self, index: usize)
    where
        Self: Holds<E, N>,
    {
        let emptied = self.table().element(index).map(E::emptied).unwrap_or_default();
        self.set(index, emptied);
    }

    /// See [`Table::set_past`].
    pub fn set_past<E: Element<N>, const N: usize>(&mut self, index: usize, past: E)
    where
        Self: Holds<E, N>,
    {
        self.table_mut().set_past(index, past);
        self.versions.rates = Version::new();
    }

    /// Removes all elements.
    pub fn clear(&mut self) {
        *self = Self::default();
        self.versions.reset();
    }
}
