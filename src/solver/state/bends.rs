//! Bends in the state: added, changed and removed as springs are.

use super::State;
use crate::solver::elements::{Bend, Elements, Holds, Table};

impl State {
    fn bends<const N: usize>(&self) -> &Table<Bend<N>, N>
    where
        Elements: Holds<Bend<N>, N>,
    {
        self.elements.table()
    }

    /// Appends a bend between the slots `ends`, which differ; its index among those of as many ends.
    pub(in crate::solver) fn add_bend<const N: usize>(&mut self, ends: [usize; N], bend: Bend<N>) -> usize
    where
        Elements: Holds<Bend<N>, N>,
    {
        self.contacts.request_search();
        ends.into_iter().for_each(|end| self.strain(end));
        self.elements.push(ends.map(|end| end as u32), bend)
    }

    /// Changes the parameters of a bend, if it exists and they are others.
    pub(in crate::solver) fn set_bend<const N: usize>(&mut self, index: usize, bend: Bend<N>)
    where
        Elements: Holds<Bend<N>, N>,
    {
        let Some(old) = self.bends().element(index).copied().filter(|old| *old != bend) else { return };
        let acts = |bend: &Bend<N>| bend.stiffness > 0.0 || bend.damping > 0.0;
        let (ends, _) = self.bends::<N>().with_ends(index);
        ends.into_iter().for_each(|end| self.sleep.disturb(end));
        if !(acts(&old) && acts(&bend) && old.weights == bend.weights) {
            // Else its parameters, and with them the pulls, go on from where they are.
            ends.into_iter().for_each(|end| self.pulls.invalidate(end));
        }
        self.elements.set(index, bend);
        self.contacts.request_search();
    }

    /// Removes a bend; its place stays empty.
    pub(in crate::solver) fn remove_bend<const N: usize>(&mut self, index: usize)
    where
        Elements: Holds<Bend<N>, N>,
    {
        self.set_bend(index, Bend::<N>::default());
    }

    /// Appends a bend of three particles; its index.
    pub(crate) fn add_rod(&mut self, ends: [usize; 3], rod: Bend<3>) -> usize {
        self.add_bend(ends, rod)
    }

    /// Changes the parameters of a bend of three particles, if they are others.
    pub(crate) fn set_rod(&mut self, index: usize, rod: Bend<3>) {
        self.set_bend(index, rod);
    }

    /// Removes a bend of three particles; its place stays empty.
    pub(crate) fn remove_rod(&mut self, index: usize) {
        self.remove_bend::<3>(index);
    }

    /// The slots of the ends of a bend of three particles.
    pub(crate) fn rod_ends(&self, index: usize) -> [usize; 3] {
        self.bends().with_ends(index).0
    }

    /// The parameters of the bends of three particles that were there when the last tick ended, as they were then.
    pub(crate) fn past_rods(&self) -> Vec<Bend<3>> {
        self.bends().past()
    }

    /// Takes it that a bend that was added anew was there when the last tick ended, with the parameters `past`.
    pub(crate) fn set_past_rod(&mut self, index: usize, past: Bend<3>) {
        self.elements.set_past(index, past);
    }
}
