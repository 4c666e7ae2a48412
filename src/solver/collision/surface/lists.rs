//! The pairs that are near, among all that were found: lists within lists.
//!
//! A search finds all pairs that may touch before a vertex leaves its box, which is wide, as searches are dear. Most of them are far
//! from touching for all of that time. A list has those of them that may touch before a vertex goes a part of that distance from where it
//! is now, by their distances of now, and another list those of the first one: the last is the one that is looked at in each substep,
//! and is made anew from the one before as often as it has to be (Verlet's neighbour lists, *Phys. Rev.* 159, 98, 1967, nested).

use bevy::math::Vec3A;

use super::closest::closest;
use super::displacements::{Displacements, Measured};
use super::pair::{apart_along, least_apart, rounding_of};
use super::search::{Candidate, Moving};

/// The limits of a list as a part of those of the one before, or of the search.
const PART: f32 = 0.3;

/// A pair that is near.
#[derive(Debug, Clone, Copy)]
pub(super) struct NearPair {
    /// Its number among the candidates.
    pub number: u32,
    /// Its distance at the start of the substep in which it was listed, at least, m.
    pub distance: f32,
    /// The unit vector between its closest points at some time: its sides stay apart along it for long.
    pub direction: Vec3A,
}

/// The pairs that may touch while vertices are within limits.
#[derive(Debug, Clone, Default)]
pub(super) struct List {
    pub displacements: Displacements,
    /// In the order of the candidates.
    pub pairs: Vec<NearPair>,
}

impl List {
    /// Lists those of the pairs of `outer` that may come within `margin` m of touching; `is_fresh` says that their distances are those
    /// of now. Whether the limits of `outer` leave room for those of the list.
    pub fn make(
        &mut self,
        (pairs, outer, is_fresh): (impl Iterator<Item = NearPair>, &Displacements, bool),
        (candidates, margin, measured): (&[Candidate], f32, Measured),
    ) -> bool {
        if !self.displacements.begin_within(outer, measured, PART) {
            return false;
        }
        let (limits, start) = (&self.displacements.limits, measured.moving.start);
        self.pairs.clear();
        for NearPair { number, mut distance, mut direction } in pairs {
            let candidate = &candidates[number as usize];
            let most = candidate.largest_reach() + margin;
            let may_touch = |distance: f32| candidate.least_distance(distance, limits) <= most;
            if !is_fresh {
                if !may_touch(candidate.least_distance(distance, &outer.moved)) {
                    continue;
                }
                let corners = candidate.slots.map(|slot| start.get(slot as usize).into());
                let rounding = rounding_of(&corners);
                let kind = candidate.kind;
                if !may_touch(apart_along(kind, &corners, direction) - rounding)
                    || !may_touch(least_apart(kind, &corners) - rounding)
                {
                    continue;
                }
                let apart = closest(kind, &corners).apart;
                (distance, direction) = (apart.length() - rounding, apart.normalize_or_zero());
            }
            if may_touch(distance) {
                self.pairs.push(NearPair { number, distance, direction });
            }
        }
        true
    }

    /// Lists the first `count` candidates, whatever their distances.
    pub fn list_all(&mut self, count: usize, moving: Moving) {
        self.displacements.begin(moving, 0, false);
        self.pairs.clear();
        let (distance, direction) = (f32::NEG_INFINITY, Vec3A::ZERO);
        self.pairs.extend((0..count as u32).map(|number| NearPair { number, distance, direction }));
    }
}
