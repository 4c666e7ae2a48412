//! Which particles elements join to each particle.

use crate::solver::buckets::Buckets;
use crate::solver::elements::{Acting, Elements};
use crate::solver::state::Version;

/// The neighbours of each particle, each once, in the order of their slots.
#[derive(Debug, Clone, Default)]
pub(in crate::solver) struct Neighbours {
    others: Buckets<u32>,
    key: (Version, usize),
}

impl Neighbours {
    /// Makes them those of the acting `elements` between `particles` particles.
    pub fn refresh(&mut self, elements: &Elements, particles: usize) {
        let key = (elements.ends_version(), particles);
        if self.key == key && self.others.len() == particles {
            return;
        }
        self.key = key;
        self.others.fill(particles, |add| {
            elements.for_each_acting(|Acting { ends, .. }| {
                for &end in ends {
                    ends.iter().filter(|other| **other != end).for_each(|other| add(end as usize, *other));
                }
            });
        });
        self.others.sort_and_dedup();
    }

    /// The number of particles.
    pub fn particles(&self) -> usize {
        self.others.len()
    }

    /// The neighbours of the particle in `slot`.
    #[inline]
    pub fn of(&self, slot: usize) -> &[u32] {
        self.others.of(slot)
    }
}
