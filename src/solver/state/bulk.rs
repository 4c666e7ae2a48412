//! Nets: consecutive particles and elements, added and removed as one.

use std::ops::Range;

use bevy::math::Vec3;

use super::State;
use crate::solver::elements::{Bend, Spring};

/// Where a net is: consecutive slots, unless particles were renumbered since, and consecutive places in each table.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct NetRanges {
    pub particles: Range<usize>,
    pub springs: Range<usize>,
    pub rods: Range<usize>,
    pub hinges: Range<usize>,
}

/// The elements of a net, with ends that are counted from its first particle.
#[derive(Debug, Clone, Copy)]
pub(crate) struct NetElements<'a> {
    pub springs: &'a [([u32; 2], Spring)],
    pub rods: &'a [([u32; 3], Bend<3>)],
    pub hinges: &'a [([u32; 4], Bend<4>)],
}

impl State {
    /// Appends a net: its particles as (position in m, 1 / mass in 1/kg; 0: pinned), all of one radius, m, and its
    /// elements.
    pub(crate) fn add_net(
        &mut self,
        particles: impl ExactSizeIterator<Item = (Vec3, f32)>,
        radius: f32,
        elements: NetElements,
    ) -> NetRanges {
        let first = self.particles.len();
        self.particles.extend(particles, radius);
        self.contacts.request_search();
        self.may_coincide |= !elements.springs.is_empty();
        NetRanges {
            particles: first..self.particles.len(),
            springs: self.elements.extend(first as u32, elements.springs),
            rods: self.elements.extend(first as u32, elements.rods),
            hinges: self.elements.extend(first as u32, elements.hinges),
        }
    }

    /// Empties the slots and the places of the elements of a net that end in these slots.
    pub(crate) fn remove_from_net(&mut self, ranges: &NetRanges, slots: impl Iterator<Item = usize>) {
        let mut is_gone = vec![false; self.particles.len()];
        for slot in slots {
            is_gone[slot] = true;
            self.remove_particle(slot);
        }
        self.remove_elements(ranges, |end| is_gone[end as usize]);
    }

    fn remove_elements(&mut self, ranges: &NetRanges, is_gone: impl Fn(u32) -> bool) {
        let elements = &mut self.elements;
        elements
            .remove_where::<Spring, 2>(ranges.springs.clone(), |ends| ends.iter().any(|end| is_gone(*end)));
        elements.remove_where::<Bend<3>, 3>(ranges.rods.clone(), |ends| ends.iter().any(|end| is_gone(*end)));
        elements
            .remove_where::<Bend<4>, 4>(ranges.hinges.clone(), |ends| ends.iter().any(|end| is_gone(*end)));
    }

    /// Gives the elements of a net these parameters. `slot_of` has the slot of each particle. `false`, and nothing is
    /// changed, if they join other particles.
    pub(crate) fn set_net(
        &mut self,
        ranges: &NetRanges,
        wanted: NetElements,
        slot_of: impl Fn(u32) -> u32 + Copy,
    ) -> bool {
        let Self { elements, pulls, contacts, .. } = self;
        let mut any_changed = false;
        let mut on_change = |ends: &[u32], begins_or_ends: bool| {
            any_changed = true;
            if begins_or_ends {
                ends.iter().for_each(|end| pulls.forget(*end as usize));
            }
        };
        let is_same = elements
            .set_all(ranges.springs.clone(), wanted.springs, slot_of, |e, b| on_change(e, b))
            && elements.set_all(ranges.rods.clone(), wanted.rods, slot_of, |e, b| on_change(e, b))
            && elements.set_all(ranges.hinges.clone(), wanted.hinges, slot_of, |e, b| on_change(e, b));
        if any_changed {
            contacts.request_search();
            self.may_coincide = true;
        }
        is_same
    }

    /// The springs that do not belong to a net but end in one of its slots.
    pub(crate) fn springs_into(&self, ranges: &NetRanges, is_in: impl Fn(u32) -> bool) -> Vec<usize> {
        self.elements.springs_into(is_in, &ranges.springs)
    }
}
