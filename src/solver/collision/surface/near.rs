//! Which particles of a mesh are neighbours along it: their contact distance is at most half of the distance along the mesh.

use super::tree::MAX_CORNERS;
use crate::solver::buckets::Buckets;

/// Ways along the mesh up to this multiple of the radius of the particle where they begin are known; those of two that
/// touch are at most half as long.
const REACH: f32 = 4.0;

/// The lengths of paths along edges and springs, at rest.
#[derive(Debug, Clone, Default)]
pub(super) struct Near {
    /// Of each slot those that are near, and how far, m; in the order of the slots.
    ways: Buckets<(u32, f32)>,
    /// Working memory.
    joined: Buckets<(u32, f32)>,
    found: Vec<(u32, u32, f32)>,
    length: Vec<f32>,
    front: Vec<u32>,
    reached: Vec<u32>,
}

impl Near {
    /// Finds the paths along `links`, which have a length in m, from each particle that is on the mesh and those that springs
    /// join to it.
    pub fn rebuild(&mut self, links: &[([u32; 2], f32)], radius: &[f32], on_mesh: &[bool]) {
        let Self { ways, joined, found, length, front, reached } = self;
        let count = radius.len();
        joined.fill(count, |add| {
            for &([a, b], length) in links {
                add(a as usize, (b, length));
                add(b as usize, (a, length));
            }
        });
        found.clear();
        length.clear();
        length.resize(count, f32::INFINITY);
        for from in 0..count {
            let reach = REACH * radius[from];
            if reach == 0.0 || (!on_mesh[from] && joined.of(from).is_empty()) {
                continue;
            }
            length[from] = 0.0;
            front.push(from as u32);
            // Label correcting: in a few steps, as ways are short.
            while let Some(at) = front.pop() {
                for &(to, way) in joined.of(at as usize) {
                    let sum = length[at as usize] + way;
                    if sum < reach && sum < length[to as usize] {
                        if length[to as usize] == f32::INFINITY {
                            reached.push(to);
                        }
                        length[to as usize] = sum;
                        front.push(to);
                    }
                }
            }
            for to in reached.drain(..) {
                if to as usize != from {
                    let way = length[to as usize];
                    found.extend([(from as u32, to, way), (to, from as u32, way)]);
                }
                length[to as usize] = f32::INFINITY;
            }
            length[from] = f32::INFINITY;
        }
        // Each way from both of its ends, and the shortest first where it was found from both.
        found.sort_unstable_by(|(a, b, one), (c, d, other)| (a, b).cmp(&(c, d)).then(one.total_cmp(other)));
        found.dedup_by_key(|(from, to, _)| (*from, *to));
        ways.fill(count, |add| {
            found.iter().for_each(|(from, to, length)| add(*from as usize, (*to, *length)));
        });
    }

    /// The ways from corners of one cluster to those of another one; both in ascending order.
    pub fn between(&self, first: &[u32], second: &[u32]) -> ClusterWays {
        let mut ways = ClusterWays([[f32::INFINITY; MAX_CORNERS]; MAX_CORNERS]);
        let ([Some(least), Some(most)], false) = ([second.first(), second.last()], self.ways.is_empty())
        else {
            return ways;
        };
        for (slot, own) in first.iter().zip(&mut ways.0) {
            let near = self.ways.of(*slot as usize);
            let start = near.partition_point(|(other, _)| other < least);
            let mut place = 0;
            for (other, way) in near[start..].iter().take_while(|(other, _)| other <= most) {
                while second[place] < *other {
                    place += 1;
                }
                if second[place] == *other {
                    own[place] = *way;
                }
            }
        }
        ways
    }

    /// The least way from a corner of one side to one of the other, m; infinity where it is long.
    pub fn way(&self, first: &[u32], second: &[u32]) -> f32 {
        if self.ways.is_empty() {
            return f32::INFINITY;
        }
        let mut least = f32::INFINITY;
        for slot in first {
            for (other, way) in self.ways.of(*slot as usize) {
                if *way < least && second.contains(other) {
                    least = *way;
                }
            }
        }
        least
    }
}

/// The ways along the mesh between the corners of two clusters, by their places, m; infinity where they are long.
pub(super) struct ClusterWays([[f32; MAX_CORNERS]; MAX_CORNERS]);

impl ClusterWays {
    /// The least of the ways from corners of the first cluster to those of the second, m.
    #[inline]
    pub fn least(&self, first: &[u8], second: &[u8]) -> f32 {
        let mut least = f32::INFINITY;
        for one in first {
            for other in second {
                least = least.min(self.0[*one as usize][*other as usize]);
            }
        }
        least
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ways_are_the_shortest_and_end_at_a_few_radii() {
        let links = [([0, 1], 1.0), ([1, 2], 1.0), ([0, 2], 1.5), ([2, 3], 1.0), ([3, 4], 9.0)];
        let mut near = Near::default();
        near.rebuild(&links, &[0.7, 0.7, 0.7, 0.7, 0.7], &[true; 5]);
        assert_eq!(near.way(&[0], &[2, 4]), 1.5);
        assert_eq!(near.way(&[0], &[3, 4]), 2.5);
        assert_eq!(near.way(&[0, 1], &[3, 4]), 2.0);
        assert_eq!(near.way(&[0, 1, 2, 3], &[4]), f32::INFINITY);
        let corners = [[0, 1, 4].as_slice(), &[1, 2, 3]];
        let ways = near.between(corners[0], corners[1]);
        for (one, first) in (0..).zip(corners[0]) {
            for (other, second) in (0..).zip(corners[1]) {
                assert_eq!(
                    ways.least(&[one], &[other]),
                    near.way(&[*first], &[*second]),
                    "{first} to {second}"
                );
            }
        }
        assert_eq!(ways.least(&[0, 2], &[1, 2]), 1.5);
    }
}
