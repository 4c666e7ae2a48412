//! The elements of one kind: their ends, their parameters, and which of these have changed.

use super::{Element, MAX_UNSORTED, Rates};

/// The elements of one kind, each in a place of its own for as long as it exists.
///
/// An empty place keeps the ends that it had, as the kernel's runs go on through it. The ends are for the graph
/// alone to see: what hangs together is derived there, once.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", serde(bound = "E: serde::Serialize + serde::de::DeserializeOwned"))]
pub(in crate::solver) struct Table<E, const N: usize> {
    #[cfg_attr(feature = "serialize", serde(with = "tuples"))]
    ends: Vec<[u32; N]>,
    elements: Vec<E>,
    /// Of the sorted elements, whether an end was pinned then.
    anchored: Vec<bool>,
    /// The places that have changed since [`reset_edits`](Self::reset_edits).
    #[cfg_attr(feature = "serialize", serde(skip))]
    edits: Vec<u32>,
    /// Number of places when the last tick ended: what was added since then has no past.
    ticked: usize,
    /// What was changed since the last tick, with what it was then. In a tick by place, one entry each.
    ramps: Vec<Ramp<E>>,
}

/// An element with parameters that change within a tick, from one value to another.
#[derive(Debug, Clone, Copy)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(in crate::solver) struct Ramp<E> {
    /// Its place.
    pub index: u32,
    /// The parameters at the start of the tick.
    from: E,
    /// Those at its end.
    to: E,
}

impl<E, const N: usize> Default for Table<E, N> {
    fn default() -> Self {
        Self {
            ends: Vec::new(),
            elements: Vec::new(),
            anchored: Vec::new(),
            edits: Vec::new(),
            ticked: 0,
            ramps: Vec::new(),
        }
    }
}

impl<E> Ramp<E> {
    /// The parameters when `share` of the tick is done.
    pub fn at<const N: usize>(&self, share: f32) -> E
    where
        E: Element<N>,
    {
        if share == 1.0 { self.to } else { self.from.between(&self.to, share) }
    }

    /// The largest coefficients on the way.
    pub fn largest_rates<const N: usize>(&self) -> Rates
    where
        E: Element<N>,
    {
        let (from, to) = (self.from.rates(), self.to.rates());
        Rates { stiffness: from.stiffness.max(to.stiffness), damping: from.damping.max(to.damping) }
    }
}

impl<E: Element<N>, const N: usize> Table<E, N> {
    /// The number of places, empty ones included.
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    pub(super) fn push(&mut self, ends: [u32; N], element: E) -> usize {
        self.ends.push(ends);
        self.elements.push(element);
        self.len() - 1
    }

    pub(super) fn extend(&mut self, added: impl Iterator<Item = ([u32; N], E)> + Clone) {
        self.ends.extend(added.clone().map(|(ends, _)| ends));
        self.elements.extend(added.map(|(_, element)| element));
    }

    /// Replaces the parameters of an element; the old ones.
    pub(super) fn set(&mut self, index: usize, element: E) -> E {
        self.edits.push(index as u32);
        let old = std::mem::replace(&mut self.elements[index], element);
        if index < self.ticked {
            self.ramps.push(Ramp { index: index as u32, from: old, to: element });
        }
        old
    }

    /// Changes an element within a tick; if it is on a ramp, both ends of that.
    pub(super) fn replace(&mut self, index: u32, change: impl Fn(&mut E)) {
        self.edits.push(index);
        change(&mut self.elements[index as usize]);
        for ramp in self.ramps.iter_mut().filter(|ramp| ramp.index == index) {
            change(&mut ramp.from);
            change(&mut ramp.to);
        }
    }

    /// Takes it that an element had the parameters `past` when the last tick ended.
    pub(super) fn set_past(&mut self, index: usize, past: E) {
        self.ramps.push(Ramp { index: index as u32, from: past, to: self.elements[index] });
    }

    /// The parameters of the elements that were there when the last tick ended, as they were then.
    pub fn past(&self) -> Vec<E> {
        let mut past = self.elements[..self.ticked].to_vec();
        for ramp in self.ramps.iter().rev() {
            if let Some(past) = past.get_mut(ramp.index as usize) {
                *past = ramp.from;
            }
        }
        past
    }

    /// What goes from one value to another in this tick.
    pub fn ramps(&self) -> &[Ramp<E>] {
        &self.ramps
    }

    /// Makes a ramp of all changes since the last tick to an element. What did not act, or ceases to, has none.
    pub(super) fn begin_ramps(&mut self) {
        self.ramps.sort_by_key(|ramp| ramp.index);
        self.ramps.dedup_by_key(|ramp| ramp.index);
        self.ramps.iter_mut().for_each(|ramp| ramp.to = self.elements[ramp.index as usize]);
        // Nor has what only changes in that it bears more, or less.
        self.ramps.retain(|ramp| ramp.from.acts() && ramp.to.acts() && ramp.at(0.0) != ramp.to);
    }

    /// Gives the elements on ramps the parameters that they have when `share` of the tick is done.
    pub(super) fn ramp_to(&mut self, share: f32) {
        for ramp in &self.ramps {
            self.elements[ramp.index as usize] = ramp.at(share);
        }
    }

    /// Removes all ramps, after a tick; returns whether the coefficients of any were others than they are now.
    pub(super) fn end_ramps(&mut self) -> bool {
        self.ticked = self.len();
        let any = self.ramps.iter().any(|ramp| ramp.from.rates() != ramp.to.rates());
        self.ramps.clear();
        any
    }

    /// The parameters of an element; `None` beyond the last one.
    #[inline]
    pub fn element(&self, index: usize) -> Option<&E> {
        self.elements.get(index)
    }

    /// The parameters of every place.
    pub fn elements(&self) -> &[E] {
        &self.elements
    }

    /// An element with its ends, for readers outside the solver.
    pub fn with_ends(&self, index: usize) -> ([usize; N], E) {
        (self.ends[index].map(|end| end as usize), self.elements[index])
    }

    /// Whether an element joins these slots, in this order.
    pub fn joins(&self, index: usize, ends: [u32; N]) -> bool {
        self.ends.get(index) == Some(&ends)
    }

    /// The ends of every place, empty ones included. For the graph alone.
    pub fn all_ends(&self) -> &[[u32; N]] {
        &self.ends
    }

    /// The number of elements in runs: those after them came later and are taken one by one, until there are
    /// too many, when a tick sorts all of them.
    pub fn sorted(&self) -> usize {
        self.anchored.len()
    }

    /// Whether an end of a sorted element was pinned when it was sorted. Such elements are added one by one, so
    /// that what hangs on the two sides of a pinned particle does not depend on each other.
    pub fn is_anchored(&self, index: usize) -> bool {
        self.anchored[index]
    }

    pub(super) fn is_settled(&self) -> bool {
        (self.len() - self.sorted()) * MAX_UNSORTED <= self.sorted()
    }

    pub(super) fn settle(&mut self, inverse_mass: &[f32]) {
        let is_pinned = |end: &u32| inverse_mass[*end as usize] == 0.0;
        self.anchored.clear();
        self.anchored.extend(self.ends.iter().map(|ends| ends.iter().any(is_pinned)));
        self.edits.clear();
    }

    pub(super) fn renumber(&mut self, new_slots: &[u32]) {
        for end in self.ends.as_flattened_mut() {
            *end = new_slots[*end as usize];
        }
        self.edits.clear();
    }

    /// The places that have changed since [`reset_edits`](Self::reset_edits).
    pub fn edits(&self) -> &[u32] {
        &self.edits
    }

    pub(super) fn reset_edits(&mut self) {
        self.edits.clear();
    }

    /// Calls `visit` for each element that exerts forces: its index, its ends and itself.
    #[inline(always)]
    pub fn for_each_acting(&self, mut visit: impl FnMut(u32, &[u32; N], &E)) {
        for (index, (ends, element)) in (0..).zip(self.ends.iter().zip(&self.elements)) {
            if element.acts() {
                visit(index, ends, element);
            }
        }
    }
}

/// Arrays of any length; serde supports those up to a fixed length only.
#[cfg(feature = "serialize")]
mod tuples {
    use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};

    pub fn serialize<S: Serializer, const N: usize>(ends: &[[u32; N]], to: S) -> Result<S::Ok, S::Error> {
        ends.as_flattened().serialize(to)
    }

    pub fn deserialize<'de, D: Deserializer<'de>, const N: usize>(
        from: D,
    ) -> Result<Vec<[u32; N]>, D::Error> {
        let flat = Vec::<u32>::deserialize(from)?;
        let (ends, rest) = flat.as_chunks::<N>();
        if rest.is_empty() { Ok(ends.to_vec()) } else { Err(D::Error::custom("a list of ends is cut off")) }
    }
}
