//! The nets: what elements join, directly or through others.
//!
//! Other than in an island, pinned particles join, too: what hangs from them belongs to them.

use super::islands::Forest;
use crate::solver::buckets::Buckets;
use crate::solver::elements::{Acting, Elements};
use crate::solver::state::Version;

/// The nets, in the order of their first slots.
#[derive(Debug, Clone, Default)]
pub(crate) struct Nets {
    members: Buckets<u32>,
    key: (Version, usize),
}

impl Nets {
    /// Makes them those of the acting `elements` between `particles` particles.
    pub(in crate::solver) fn refresh(&mut self, elements: &Elements, particles: usize) {
        let key = (elements.ends_version(), particles);
        if self.key == key {
            return;
        }
        self.key = key;
        let mut forest = Forest::new(particles);
        let mut joined = vec![false; particles];
        elements.for_each_acting(|Acting { ends, .. }| {
            for &end in ends {
                joined[end as usize] = true;
                forest.join(ends[0] as usize, end as usize);
            }
        });
        for (_, enclosure) in elements.gases().acting() {
            for &slot in &enclosure.slots {
                joined[slot as usize] = true;
                forest.join(enclosure.slots[0] as usize, slot as usize);
            }
        }
        let mut of_root = vec![None; particles];
        let mut nets = 0;
        let mut members = Vec::new();
        for slot in (0..particles).filter(|slot| joined[*slot]) {
            let net = *of_root[forest.root(slot)].get_or_insert_with(|| {
                nets += 1;
                nets - 1
            });
            members.push((net, slot as u32));
        }
        self.members.fill(nets, |add| members.iter().for_each(|(net, slot)| add(*net, *slot)));
    }

    /// The slots of each net, in ascending order.
    pub fn all(&self) -> impl Iterator<Item = &[u32]> {
        (0..self.members.len()).map(|net| self.members.of(net))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solver::elements::Spring;

    #[test]
    fn a_net_is_all_that_springs_join_and_a_removed_spring_divides_it() {
        let mut elements = Elements::default();
        for ends in [[4, 1], [1, 2], [3, 6], [2, 4]] {
            elements
                .push(ends, Spring { rest_length: 1.0, stiffness: 1.0, damping: 0.0, ..Spring::default() });
        }
        let mut nets = Nets::default();
        nets.refresh(&elements, 7);
        assert_eq!(nets.all().collect::<Vec<_>>(), [&[1, 2, 4][..], &[3, 6]]);
        elements.remove::<Spring, 2>(0);
        elements.remove::<Spring, 2>(1);
        nets.refresh(&elements, 7);
        assert_eq!(nets.all().collect::<Vec<_>>(), [&[2, 4][..], &[3, 6]]);
    }
}
