//! The elements of one kind: their ends, their parameters, and which of these have changed.

use super::{Element, MAX_UNSORTED};

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
}

impl<E, const N: usize> Default for Table<E, N> {
    fn default() -> Self {
        Self { ends: Vec::new(), elements: Vec::new(), anchored: Vec::new(), edits: Vec::new() }
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

    /// Replaces the parameters of an element; the old ones.
    pub(super) fn set(&mut self, index: usize, element: E) -> E {
        self.edits.push(index as u32);
        std::mem::replace(&mut self.elements[index], element)
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

    /// Whether an end of a sorted element was pinned when it was sorted. Such elements are taken one by one, so
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
    pub(super) fn for_each_acting(&self, mut visit: impl FnMut(u32, &[u32; N], &E)) {
        for (index, (ends, element)) in (0..).zip(self.ends.iter().zip(&self.elements)) {
            if element.acts() {
                visit(index, ends, element);
            }
        }
    }
}

/// Arrays of any length, which serde itself knows up to a fixed one only.
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
