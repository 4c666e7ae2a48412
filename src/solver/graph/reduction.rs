//! In which order the unknowns of a net can be eliminated so that each has few neighbours left.
//!
//! Eliminating an unknown joins those that are still left of its neighbours with each other. A node of a tree of
//! springs has one left, its parent, when all that hangs on it is gone. Along a rope with rods, which reach two links
//! far, it has two, and these are joined already: so a rope that resists bending is eliminated from both of its ends
//! in linear time, as a matrix of narrow band is. (Nets of which nothing is left are those of treewidth 2: Arnborg
//! and Proskurowski, *Discrete Applied Mathematics* 23, 11, 1989.)

use super::Linked;
use crate::solver::buckets::Buckets;
use crate::solver::particles::Particles;

/// The parent of a node that has fewer than two.
pub(super) const NO_PARENT: u32 = u32::MAX;

/// The order of elimination; particles are known by their *places* in a list.
#[derive(Debug, Default)]
pub(super) struct Reduction {
    /// The places that are eliminated, in this order.
    pub order: Vec<u32>,
    /// The neighbours that each of these has left, one or two; [`NO_PARENT`] beyond them.
    pub parents: Vec<[u32; 2]>,
    /// The places that are left, in their order.
    pub left: Vec<u32>,
}

/// The net while it is reduced.
struct Net {
    /// The neighbours of each place by elements.
    neighbours: Buckets<u32>,
    /// Those that were joined to it since.
    joined: Vec<Vec<u32>>,
    /// The number of those that are left.
    degree: Vec<usize>,
    /// The number that it may have when it is eliminated.
    limit: Vec<usize>,
    is_queued: Vec<bool>,
    is_gone: Vec<bool>,
}

impl Reduction {
    /// Reduces the net of the `members` between the particles in the slots `free`, but for those in the slots
    /// `kept`. Where no element has more than two ends, nothing but trees is eliminated.
    ///
    /// `places` is working memory, as long as there are slots.
    pub fn of(
        members: &[Linked],
        kept: &[u32],
        free: &[u32],
        particles: &Particles,
        places: &mut [u32],
    ) -> Self {
        let mut net = Net::of(members, kept, free, particles, places);
        let mut reduction = Self::default();
        reduction.order.extend((0..free.len() as u32).filter(|place| net.queue(*place)));
        while let Some(&place) = reduction.order.get(reduction.parents.len()) {
            let parents = net.eliminate(place);
            reduction.parents.push(parents);
            let ready = parents.into_iter().filter(|parent| *parent != NO_PARENT && net.queue(*parent));
            reduction.order.extend(ready);
        }
        reduction.left.extend((0..free.len() as u32).filter(|place| !net.is_gone[*place as usize]));
        reduction
    }
}

impl Net {
    fn of(members: &[Linked], kept: &[u32], free: &[u32], particles: &Particles, places: &mut [u32]) -> Self {
        for (place, slot) in (0..).zip(free) {
            places[*slot as usize] = place;
        }
        let place_of = |slot: u32| (!particles.is_pinned(slot as usize)).then(|| places[slot as usize]);
        let mut neighbours = Buckets::default();
        neighbours.fill(free.len(), |add| {
            for ends in members.iter().map(Linked::ends) {
                for (&end, &other) in ends.iter().flat_map(|end| ends.iter().map(move |other| (end, other))) {
                    if let (Some(end), Some(other), true) = (place_of(end), place_of(other), end != other) {
                        add(end as usize, other);
                    }
                }
            }
        });
        neighbours.sort_and_dedup();
        let mut limit = vec![1; free.len()];
        let bent = members.iter().filter(|member| member.count > 2).flat_map(Linked::ends);
        bent.filter_map(|end| place_of(*end)).for_each(|place| limit[place as usize] = 2);
        let mut is_queued = vec![false; free.len()];
        kept.iter().filter_map(|slot| place_of(*slot)).for_each(|place| is_queued[place as usize] = true);
        Self {
            degree: (0..free.len()).map(|place| neighbours.of(place).len()).collect(),
            joined: vec![Vec::new(); free.len()],
            is_gone: vec![false; free.len()],
            neighbours,
            limit,
            is_queued,
        }
    }

    /// Whether a place is ready to be eliminated, and has not been before.
    fn queue(&mut self, place: u32) -> bool {
        let place = place as usize;
        let is_ready = !self.is_queued[place] && self.degree[place] <= self.limit[place];
        self.is_queued[place] |= is_ready;
        is_ready
    }

    /// Eliminates a place; the neighbours that it had left, which are joined from now on.
    fn eliminate(&mut self, place: u32) -> [u32; 2] {
        self.is_gone[place as usize] = true;
        let all = self.neighbours.of(place as usize).iter().chain(&self.joined[place as usize]);
        let mut left = all.copied().filter(|other| !self.is_gone[*other as usize]);
        let parents = [left.next().unwrap_or(NO_PARENT), left.next().unwrap_or(NO_PARENT)];
        debug_assert!(left.next().is_none(), "a place is eliminated when it has few neighbours left");
        for parent in parents.into_iter().filter(|parent| *parent != NO_PARENT) {
            self.degree[parent as usize] -= 1;
        }
        let [first, second] = parents;
        if second != NO_PARENT && !self.are_joined(first, second) {
            self.joined[first as usize].push(second);
            self.joined[second as usize].push(first);
            self.degree[first as usize] += 1;
            self.degree[second as usize] += 1;
        }
        parents
    }

    fn are_joined(&self, first: u32, second: u32) -> bool {
        self.neighbours.of(first as usize).binary_search(&second).is_ok()
            || self.joined[first as usize].contains(&second)
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::Vec3;

    use super::*;

    fn reduce(count: usize, members: &[&[u32]], kept: &[u32]) -> Reduction {
        let mut particles = Particles::default();
        (0..count).for_each(|_| particles.push(Vec3::ZERO, Vec3::ZERO, 1.0, 0.0));
        let members: Vec<Linked> =
            (0..).zip(members).map(|(number, ends)| Linked::new(number, ends)).collect();
        let free: Vec<u32> = (0..count as u32).collect();
        Reduction::of(&members, kept, &free, &particles, &mut vec![0; count])
    }

    const RODS: [&[u32]; 4] = [&[0, 1, 2], &[1, 2, 3], &[2, 3, 4], &[3, 4, 5]];

    #[test]
    fn a_rope_with_rods_is_eliminated_from_both_ends() {
        let rope = reduce(6, &RODS, &[]);
        assert_eq!(rope.order, [0, 5, 1, 4, 2, 3]);
        assert_eq!(rope.parents, [[1, 2], [3, 4], [2, 3], [2, 3], [3, NO_PARENT], [NO_PARENT, NO_PARENT]]);
        assert!(rope.left.is_empty());
    }

    #[test]
    fn one_kept_node_leaves_no_other_and_two_all_between_them() {
        assert_eq!(reduce(6, &RODS, &[2]).left, [2]);
        assert_eq!(reduce(6, &RODS, &[0, 5]).left, [0, 1, 2, 3, 4, 5]);
    }

    #[test]
    fn nothing_but_trees_goes_where_all_elements_have_two_ends() {
        let ring = reduce(4, &[&[0, 1], &[1, 2], &[2, 0], &[2, 3]], &[]);
        assert_eq!((ring.order, ring.left), (vec![3], vec![0, 1, 2]));
    }
}
