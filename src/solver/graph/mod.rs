//! Connectivity: all that follows from the ends of the elements, derived once for each version of them.
//!
//! No other module reads the ends. Each gets what it needs of them: [`Islands`] the
//! planner, [`Blocks`] the vectorised kernel, [`Colouring`] position-based dynamics, [`Elimination`] the implicit
//! scheme, [`Exclusions`] the contacts, couplings the stability bounds. All of these are caches: pure functions
//! of the state. An element that is removed leaves them at once.

pub(super) mod anchored;
mod bend_blocks;
mod bend_runs;
pub(super) mod block;
mod blocks;
mod coincidence;
mod colouring;
mod coupling;
mod elimination;
mod ends;
mod exclusions;
mod hierarchy;
mod islands;
mod layout;
mod limits;
mod loose_blocks;
mod neighbours;
mod nets;
mod order;
mod parts;
mod reduction;

use crate::solver::elements::MAX_ENDS;
pub(super) use bend_runs::{BendList, BendRun, Parallelograms};
pub(super) use blocks::Blocks;
pub(super) use coincidence::part_coincident;
pub(super) use colouring::Colouring;
pub(super) use coupling::{Coupling, for_each_coupling};
pub(super) use elimination::{BentNode, Elimination, Fill, NodeRun};
pub(super) use ends::spring_ends;
pub(super) use exclusions::{Exclusions, overlap_at_rest, sprung_pinned};
pub(super) use hierarchy::Hierarchy;
pub(super) use islands::{Forest, Island, IslandSet, Islands, has_loops};
pub(super) use limits::{LimitGroup, Limits};
pub(super) use neighbours::Neighbours;
pub(crate) use nets::Nets;
pub(super) use order::better_order;
pub(super) use parts::Parts;

/// An element and what is at its ends.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Linked {
    /// Its number.
    pub element: u32,
    /// Number of its ends.
    pub count: u32,
    /// The first `count` of these are slots, or nodes.
    pub ends: [u32; MAX_ENDS],
}

impl Linked {
    pub fn new(element: u32, ends: &[u32]) -> Self {
        let mut all = [0; MAX_ENDS];
        all[..ends.len()].copy_from_slice(ends);
        Self { element, count: ends.len() as u32, ends: all }
    }

    /// Its ends.
    #[inline]
    pub fn ends(&self) -> &[u32] {
        &self.ends[..self.count as usize]
    }

    fn map_ends(&self, new: impl Fn(u32) -> u32) -> Self {
        let mut mapped = *self;
        mapped.ends[..self.count as usize].iter_mut().for_each(|end| *end = new(*end));
        mapped
    }
}
