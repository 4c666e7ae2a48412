//! The world cut into slabs, so that threads can solve contacts at the same time.
//!
//! The bodies are ordered by slab, and the pairs come in *groups*: first those within a slab, then those
//! across every other seam between two slabs, then those across the other seams, at last those of slabs
//! that are not neighbours. Groups of one kind share no body, so it does not matter which is solved first.
//! Where the cuts are follows from the particles, never from the threads.

use std::ops::Range;

use bevy::math::Vec3;

use crate::solver::parallel;
use crate::solver::particles::Vectors;

use super::bodies::Body;

/// Number of particles of a slab, at least. Measured: with slabs of 4,096, two threads took a tenth longer for
/// 10,000 balls than one without slabs; with these, they take a third less for 100,000.
const MIN_SLAB: usize = 16_384;

/// Number of slabs at most: the thinner they are, the more pairs lie across their seams.
const MAX_SLABS: usize = 8;

/// One particle in this number is sampled to find where to cut.
const SAMPLING: usize = 8;

/// The slabs.
#[derive(Debug, Clone, Default)]
pub(super) struct Regions {
    /// The first body of each slab, and their number.
    starts: Vec<usize>,
    /// The slab of each slot.
    slabs: Vec<u8>,
    /// The body of each slot.
    pub body_of: Vec<u32>,
    /// The slot of each body.
    pub slot_of: Vec<u32>,
    /// Coordinates, to find where to cut.
    sample: Vec<f32>,
}

impl Regions {
    /// One slab for all.
    pub fn set_single(&mut self, count: usize) {
        if self.count() == 1 && self.body_of.len() == count {
            return;
        }
        self.starts.clear();
        self.starts.extend([0, count]);
        self.slabs.clear();
        self.slabs.resize(count, 0);
        self.body_of.clear();
        self.body_of.extend(0..count as u32);
        self.slot_of.clone_from(&self.body_of);
    }

    /// Cuts across the direction, not along `up`, in which the particles at `positions` lie furthest apart.
    pub fn divide(&mut self, positions: &Vectors, radius: &[f32], up: Vec3) {
        let spheres = radius.iter().filter(|radius| **radius > 0.0).count();
        let slabs = (spheres / MIN_SLAB).clamp(1, MAX_SLABS);
        if slabs == 1 {
            self.set_single(radius.len());
            return;
        }
        let coordinates = positions.axes()[widest_axis(positions, up)];
        self.sample.clear();
        let sampled = (0..radius.len()).filter(|slot| radius[*slot] > 0.0).step_by(SAMPLING);
        self.sample.extend(sampled.map(|slot| coordinates[slot]));
        self.sample.sort_unstable_by(f32::total_cmp);
        let mut cuts = [f32::INFINITY; MAX_SLABS - 1];
        for (number, cut) in cuts.iter_mut().take(slabs - 1).enumerate() {
            *cut = self.sample[(number + 1) * self.sample.len() / slabs];
        }
        self.slabs.clear();
        self.slabs.extend(
            coordinates.iter().map(|x| cuts[..slabs - 1].iter().map(|cut| u8::from(x >= cut)).sum::<u8>()),
        );
        self.number(slabs);
    }

    /// Numbers the bodies by slab, and by slot within a slab.
    fn number(&mut self, slabs: usize) {
        let Self { starts, slabs: slab_of, body_of, slot_of, .. } = self;
        starts.clear();
        starts.resize(slabs + 1, 0);
        for slab in &*slab_of {
            starts[*slab as usize + 1] += 1;
        }
        for slab in 0..slabs {
            starts[slab + 1] += starts[slab];
        }
        let mut next = [0; MAX_SLABS];
        next[..slabs].copy_from_slice(&starts[..slabs]);
        body_of.clear();
        slot_of.clear();
        slot_of.resize(slab_of.len(), 0);
        for (slot, slab) in slab_of.iter().enumerate() {
            let body = &mut next[*slab as usize];
            body_of.push(*body as u32);
            slot_of[*body] = slot as u32;
            *body += 1;
        }
    }

    /// The number of slabs.
    pub fn count(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// Whether there is more than one.
    pub fn are_many(&self) -> bool {
        self.count() > 1
    }

    /// The group of the pair of the particles in two slots.
    fn group_of(&self, one: u32, other: u32) -> usize {
        let (one, other) = (self.slabs[one as usize] as usize, self.slabs[other as usize] as usize);
        match (one.min(other), one.abs_diff(other)) {
            (slab, 0) => slab,
            (slab, 1) => self.count() + slab / 2 + slab % 2 * (self.count() / 2),
            _ => 2 * self.count() - 1,
        }
    }

    /// The bodies of a group.
    fn bodies_of(&self, group: usize) -> Range<usize> {
        let count = self.count();
        let even_seams = count / 2;
        match group {
            _ if group < count => self.starts[group]..self.starts[group + 1],
            _ if group + 1 == 2 * count => 0..self.body_of.len(),
            _ => {
                let seam = group - count;
                let slab = if seam < even_seams { 2 * seam } else { 2 * (seam - even_seams) + 1 };
                self.starts[slab]..self.starts[slab + 2]
            }
        }
    }
}

/// The axis along which the positions vary most, one along `up` left out.
fn widest_axis(positions: &Vectors, up: Vec3) -> usize {
    let spread = |axis: usize| {
        let coordinates = positions.axes()[axis].iter().step_by(SAMPLING);
        let (count, sum, squares) =
            coordinates.fold((0.0_f64, 0.0_f64, 0.0_f64), |(count, sum, squares), x| {
                let x = f64::from(*x);
                (count + 1.0, sum + x, squares + x * x)
            });
        let variance = squares / count - (sum / count).powi(2);
        variance * f64::from(1.0 - up[axis].abs())
    };
    (0..3).max_by(|a, b| spread(*a).total_cmp(&spread(*b))).unwrap_or(0)
}

/// Pairs that are solved one after the other.
#[derive(Debug, Clone, Default)]
pub(super) struct Group {
    /// The bodies that they may be of.
    pub bodies: Range<usize>,
    /// Their places in the list of all pairs.
    pub pairs: Range<usize>,
    /// Number of them that are contacts.
    pub contacts: usize,
    /// Whether any of them overlap from the start.
    pub any_initial_overlaps: bool,
    /// Whether the last iteration had to correct any.
    pub corrected: bool,
}

/// All groups, one behind the other in the list of pairs.
#[derive(Debug, Clone, Default)]
pub(super) struct Groups {
    groups: Vec<Group>,
    slabs: usize,
}

/// Lists from which the part of each group is cut off, one group after the other.
pub(super) trait Lists: Send + Sized {
    /// Takes the first `count` entries.
    fn take_front(&mut self, count: usize) -> Self;
}

impl<T: Send> Lists for &mut [T] {
    fn take_front(&mut self, count: usize) -> Self {
        self.split_off_mut(..count).expect("the groups lie within the list")
    }
}

impl<A: Lists, B: Lists> Lists for (A, B) {
    fn take_front(&mut self, count: usize) -> Self {
        (self.0.take_front(count), self.1.take_front(count))
    }
}

impl Groups {
    /// Removes all.
    pub fn clear(&mut self) {
        self.groups.clear();
        self.slabs = 0;
    }

    /// Sorts pairs of slots by group, `from` into `to`; those of a group stay in their order.
    pub fn arrange(&mut self, regions: &Regions, from: &[(u32, u32)], to: &mut Vec<(u32, u32)>) {
        self.slabs = regions.count();
        self.groups.clear();
        self.groups.resize_with(2 * self.slabs, Group::default);
        for (one, other) in from {
            self.groups[regions.group_of(*one, *other)].pairs.end += 1;
        }
        let mut start = 0;
        for (number, group) in self.groups.iter_mut().enumerate() {
            group.bodies = regions.bodies_of(number);
            let end = start + group.pairs.end;
            // Grows while it is filled.
            group.pairs = start..start;
            start = end;
        }
        to.clear();
        to.extend_from_slice(from);
        for (one, other) in from {
            let place = &mut self.groups[regions.group_of(*one, *other)].pairs.end;
            to[*place] = (*one, *other);
            *place += 1;
        }
    }

    /// The number of contacts.
    pub fn contacts(&self) -> usize {
        self.groups.iter().map(|group| group.contacts).sum()
    }

    /// Whether the last iteration had to correct any contact.
    pub fn were_corrected(&self) -> bool {
        self.groups.iter().any(|group| group.corrected)
    }

    /// The groups, in order.
    pub fn iter(&self) -> impl Iterator<Item = &Group> {
        self.groups.iter()
    }

    /// Calls `work` for each group with its part of `lists`, for all groups in parallel.
    pub fn for_each_list<L: Lists>(&self, mut lists: L, work: impl Fn(&Group, L) + Sync) {
        let parts = self.groups.iter().map(|group| (group, lists.take_front(group.pairs.len())));
        parallel::for_each(parts, self.slabs > 1, |(group, lists)| work(group, lists));
    }

    /// Calls `work` for each group that has pairs, with its part of `lists` and its bodies; those that may
    /// have bodies in common one after the other.
    pub fn for_each<L: Lists>(
        &mut self,
        mut lists: L,
        bodies: &mut [Body],
        work: impl Fn(&mut Group, L, &mut [Body]) + Sync,
    ) {
        let (slabs, seams) = (self.slabs, self.slabs.saturating_sub(1));
        let mut groups = self.groups.iter_mut();
        for count in [slabs, slabs / 2, seams / 2, slabs.min(1)] {
            let (mut bodies, mut passed) = (&mut *bodies, 0);
            let parts = groups.by_ref().take(count).filter_map(|group| {
                bodies.take_front(group.bodies.start - passed);
                passed = group.bodies.end;
                let own = bodies.take_front(group.bodies.len());
                let lists = lists.take_front(group.pairs.len());
                (!group.pairs.is_empty()).then_some((group, lists, own))
            });
            parallel::for_each(parts, count > 1, |(group, lists, own)| work(group, lists, own));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solver::particles::Particles;

    /// Particles side by side along x, high and low.
    fn row(count: usize) -> Particles {
        let mut particles = Particles::default();
        for slot in 0..count {
            // Not in order, so that slots and bodies differ.
            let place = (slot * 7919) % count;
            let height = if place.is_multiple_of(2) { 0.0 } else { 1e4 };
            particles.push(Vec3::new(place as f32, height, 0.0), Vec3::ZERO, 1.0, 0.4);
        }
        particles
    }

    #[test]
    fn slabs_are_about_equal_and_cut_across_the_ground() {
        let particles = row(70_000);
        let mut regions = Regions::default();
        regions.divide(&particles.position, particles.radius(), Vec3::Y);
        assert_eq!(regions.count(), 4);
        for slab in regions.starts.windows(2) {
            let size = slab[1] - slab[0];
            assert!((17_000..=18_000).contains(&size), "{size}");
        }
        for body in 0..70_000 {
            assert_eq!(regions.body_of[regions.slot_of[body] as usize] as usize, body);
        }
        let x = |body: usize| particles.position.x[regions.slot_of[body] as usize];
        let furthest = (0..regions.starts[1]).map(x).fold(0.0, f32::max);
        assert!((regions.starts[1]..70_000).all(|body| x(body) > furthest));
    }

    #[test]
    fn groups_hold_each_pair_once_in_order_and_parallel_ones_share_no_body() {
        let particles = row(90_000);
        let mut regions = Regions::default();
        regions.divide(&particles.position, particles.radius(), Vec3::Y);
        assert_eq!(regions.count(), 5);
        // Neighbours at all distances up to the whole row.
        let pairs: Vec<_> = (0..30_000_u32).map(|n| (3 * n, (n * n) % 90_000)).collect();
        let (mut groups, mut arranged) = (Groups::default(), Vec::new());
        groups.arrange(&regions, &pairs, &mut arranged);
        let mut sorted = [pairs.clone(), arranged.clone()];
        sorted.iter_mut().for_each(|pairs| pairs.sort_unstable());
        assert_eq!(sorted[0], sorted[1]);
        for group in groups.iter() {
            for (one, other) in &arranged[group.pairs.clone()] {
                let bodies = [one, other].map(|slot| regions.body_of[*slot as usize] as usize);
                assert!(bodies.iter().all(|body| group.bodies.contains(body)));
            }
        }
        let place = |pair: &(u32, u32)| pairs.iter().position(|other| other == pair);
        let first: Vec<_> = arranged[..20].iter().map(place).collect();
        assert!(first.is_sorted(), "{first:?}");

        let mut bodies = vec![Body::default(); 90_000];
        groups.for_each(&mut arranged[..], &mut bodies, |group, pairs, bodies| {
            assert_eq!((pairs.len(), bodies.len()), (group.pairs.len(), group.bodies.len()));
            group.contacts = pairs.len();
            for body in bodies {
                body.hold();
            }
        });
        assert_eq!(groups.contacts(), 30_000);
        // Its slab, the seams at its sides, and the pairs of all.
        assert_eq!(bodies[0].holds, 3);
        assert_eq!(bodies[45_000].holds, 4);
    }
}
