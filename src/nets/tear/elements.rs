//! What joins the particles of a net after some of them were split: each element goes to the copies that have its
//! triangles.

use bevy::math::Vec3;

use super::surface::{Surface, common_corners, copy_in};
use crate::nets::Topology;
use crate::solver::{Bend, Spring};

/// The copies of the particles, and the triangles before and after they were split.
pub(super) struct Copies<'a> {
    pub surface: &'a Surface,
    /// The triangles as they were.
    pub before: &'a [[u32; 3]],
    /// As they are.
    pub now: &'a [[u32; 3]],
    /// The places of the particles at rest, m.
    pub places: &'a [Vec3],
    pub is_split: Vec<bool>,
}

impl Copies<'_> {
    fn is_split(&self, particle: u32) -> bool {
        self.is_split[particle as usize]
    }

    /// The copies of a particle.
    fn of(&self, particle: u32) -> Vec<u32> {
        if !self.is_split(particle) {
            return vec![particle];
        }
        let triangles = self.surface.first_at(particle).iter();
        let mut copies: Vec<u32> = triangles.map(|triangle| self.copy_in(*triangle, particle)).collect();
        copies.sort_unstable();
        copies.dedup();
        copies
    }

    fn copy_in(&self, triangle: u32, particle: u32) -> u32 {
        copy_in(self.before, self.now, triangle, particle)
    }

    /// The triangles that had both particles.
    fn shared(&self, one: u32, other: u32) -> impl Iterator<Item = u32> {
        let at_other = self.surface.first_at(other);
        self.surface.first_at(one).iter().copied().filter(|triangle| at_other.contains(triangle))
    }

    /// All ways to join copies of `ends` such that neighbours of the old mesh still have a triangle in common.
    fn ways<const N: usize>(&self, ends: [u32; N]) -> Vec<[u32; N]> {
        let mut ways = vec![ends];
        for place in 0..N {
            let copies = self.of(ends[place]);
            let extended = ways.iter().flat_map(|way| {
                copies.iter().filter_map(|copy| {
                    let mut way = *way;
                    way[place] = *copy;
                    (0..place).all(|other| self.are_joined(ends, way, [other, place])).then_some(way)
                })
            });
            ways = extended.collect();
        }
        ways
    }

    /// Whether two ends were no neighbours, or have copies that still are.
    fn are_joined<const N: usize>(&self, ends: [u32; N], way: [u32; N], [one, other]: [usize; 2]) -> bool {
        if !self.is_split(ends[one]) && !self.is_split(ends[other]) {
            return true;
        }
        let mut shared = self.shared(ends[one], ends[other]).peekable();
        let has_both = |triangle: u32| {
            let corners = self.now[triangle as usize];
            corners.contains(&way[one]) && corners.contains(&way[other])
        };
        shared.peek().is_none() || shared.any(has_both)
    }

    /// Copies of two particles on the two sides of an edge that is still common to a triangle of each.
    fn way_across(&self, [one, other]: [u32; 2]) -> Option<[u32; 2]> {
        let at_other = self.surface.first_at(other);
        let pairs = self
            .surface
            .first_at(one)
            .iter()
            .flat_map(|first| at_other.iter().map(move |second| [*first, *second]));
        let is_whole = |triangles: &[u32; 2]| {
            common_corners(self.before, *triangles) == 2 && common_corners(self.now, *triangles) == 2
        };
        let [first, second] = pairs.into_iter().find(is_whole)?;
        Some([self.copy_in(first, one), self.copy_in(second, other)])
    }

    /// The copy of a particle that has the triangle nearest to a place at rest.
    fn nearest(&self, particle: u32, place: Vec3) -> u32 {
        let distance = |triangle: u32| {
            let [a, b, c] = self.before[triangle as usize].map(|corner| self.places[corner as usize] - place);
            (a + b + c).length_squared()
        };
        let triangles = self.surface.first_at(particle).iter().copied();
        let nearest = triangles.min_by(|one, other| distance(*one).total_cmp(&distance(*other)));
        nearest.map_or(particle, |triangle| self.copy_in(triangle, particle))
    }
}

/// Joins the springs of split particles to the copies that have their triangles. One along an edge that was opened is
/// divided between its two sides.
pub(super) fn reattach_springs(topology: &mut Topology, copies: &Copies) {
    for number in 0..topology.springs.len() {
        let (ends, spring) = topology.springs[number];
        if !ends.iter().any(|end| copies.is_split(*end)) {
            continue;
        }
        match copies.surface.link(copies.before, ends) {
            Some(link) if link.is_edge() => match copies.ways(ends)[..] {
                [one, other, ..] => {
                    topology.springs[number] = (one, halved(spring));
                    topology.springs.push((other, halved(spring)));
                }
                [one] => topology.springs[number].0 = one,
                [] => topology.springs[number].1 = emptied(spring),
            },
            Some(_) => match copies.way_across(ends) {
                Some(way) => topology.springs[number].0 = way,
                None => topology.springs[number].1 = emptied(spring),
            },
            None => {
                let towards = [1, 0].map(|other: usize| copies.places[ends[other] as usize]);
                topology.springs[number].0 = [0, 1].map(|end| copies.nearest(ends[end], towards[end]));
            }
        }
    }
}

/// Joins the bends of split particles to the copies that have their triangles, and removes those across an opened edge.
pub(super) fn reattach_bends<const N: usize>(bends: &mut [([u32; N], Bend<N>)], copies: &Copies) {
    for (ends, bend) in bends {
        if ends.iter().any(|end| copies.is_split(*end)) {
            match copies.ways(*ends).first() {
                Some(way) => *ends = *way,
                None => disable(bend),
            }
        }
    }
}

/// What stays of a broken spring: it keeps its place.
pub(super) fn emptied(spring: Spring) -> Spring {
    let Spring { rest_length, tension_only, .. } = spring;
    Spring { tension_only, ..Spring::elastic(rest_length, 0.0, 0.0) }
}

pub(super) fn disable<const N: usize>(bend: &mut Bend<N>) {
    (bend.stiffness, bend.damping) = (0.0, 0.0);
}

/// Each of two springs that together are the one.
fn halved(spring: Spring) -> Spring {
    let Spring { stiffness, damping, breaking_force, .. } = spring;
    let breaking_force = breaking_force.map(|force| 0.5 * force);
    Spring { stiffness: 0.5 * stiffness, damping: 0.5 * damping, breaking_force, ..spring }
}
