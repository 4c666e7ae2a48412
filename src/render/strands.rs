//! Strands: the springs of a net, taken apart into lines.
//!
//! A rope is one; a torn rope two; a fishing net one for each thread between two knots. They follow the springs and
//! not the numbers of particles, as those that a winch adds come last.

use crate::nets::Topology;

/// Particles that are joined one after the other.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Strand {
    /// The first comes again at the end of a closed one.
    pub particles: Vec<u32>,
    pub is_closed: bool,
    /// The rest length from the first particle to each, m.
    pub lengths: Vec<f32>,
}

/// All strands of springs that are not broken, in the order of their first particles.
pub(super) fn strands(topology: &Topology, broken: &[u32]) -> Vec<Strand> {
    let mut walk = Walk::new(topology, broken);
    let mut strands = Vec::new();
    // From where strands end, then round the loops, which end nowhere.
    for are_ends in [true, false] {
        for particle in 0..walk.first.len() as u32 - 1 {
            if are_ends && walk.springs_at(particle).len() == 2 {
                continue;
            }
            while let Some(strand) = walk.next_from(particle) {
                strands.push(strand);
            }
        }
    }
    strands
}

struct Walk<'a> {
    topology: &'a Topology,
    /// The springs at each particle: from `first[particle]` on in `springs`.
    first: Vec<u32>,
    springs: Vec<u32>,
    is_done: Vec<bool>,
}

impl<'a> Walk<'a> {
    fn new(topology: &'a Topology, broken: &[u32]) -> Self {
        let particles = topology.positions.len();
        let ends = || topology.springs.iter().map(|(ends, _)| ends.map(|end| end as usize));
        let mut is_done: Vec<bool> =
            ends().map(|[one, other]| one == other || one.max(other) >= particles).collect();
        for spring in broken {
            if let Some(is_done) = is_done.get_mut(*spring as usize) {
                *is_done = true;
            }
        }
        let mut first = vec![0_u32; particles + 2];
        let kept: Vec<(usize, [usize; 2])> =
            ends().enumerate().filter(|(spring, _)| !is_done[*spring]).collect();
        for end in kept.iter().flat_map(|(_, ends)| *ends) {
            first[end + 2] += 1;
        }
        for particle in 2..first.len() {
            first[particle] += first[particle - 1];
        }
        let mut springs = vec![0; 2 * kept.len()];
        for (spring, ends) in kept {
            for end in ends {
                let place = &mut first[end + 1];
                springs[*place as usize] = spring as u32;
                *place += 1;
            }
        }
        first.truncate(particles + 1);
        Self { topology, first, springs, is_done }
    }

    fn springs_at(&self, particle: u32) -> &[u32] {
        &self.springs[self.first[particle as usize] as usize..self.first[particle as usize + 1] as usize]
    }

    /// A strand that begins here with a spring that is in none yet.
    fn next_from(&mut self, start: u32) -> Option<Strand> {
        let mut strand = Strand { particles: vec![start], lengths: vec![0.0], is_closed: false };
        let (mut here, mut length) = (start, 0.0);
        while let Some(spring) =
            self.springs_at(here).iter().copied().find(|spring| !self.is_done[*spring as usize])
        {
            self.is_done[spring as usize] = true;
            let ([one, other], constants) = &self.topology.springs[spring as usize];
            here = if *one == here { *other } else { *one };
            length += constants.rest_length;
            strand.particles.push(here);
            strand.lengths.push(length);
            if here == start || self.springs_at(here).len() != 2 {
                break;
            }
        }
        strand.is_closed = here == start && strand.particles.len() > 2;
        (strand.particles.len() > 1).then_some(strand)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solver::Spring;
    use bevy::math::Vec3;

    fn net(particles: usize, joints: &[[u32; 2]]) -> Topology {
        let spring = Spring { rest_length: 0.5, ..Spring::default() };
        Topology {
            positions: vec![Vec3::ZERO; particles],
            springs: joints.iter().map(|ends| (*ends, spring)).collect(),
            ..Topology::default()
        }
    }

    fn particles(topology: &Topology) -> Vec<Vec<u32>> {
        strands(topology, &[]).into_iter().map(|strand| strand.particles).collect()
    }

    #[test]
    fn a_rope_is_one_strand_and_two_when_torn() {
        let rope = net(5, &[[0, 1], [1, 2], [2, 3], [3, 4]]);
        assert_eq!(particles(&rope), [[0, 1, 2, 3, 4]]);
        assert_eq!(strands(&rope, &[])[0].lengths, [0.0, 0.5, 1.0, 1.5, 2.0]);
        let torn = net(5, &[[0, 1], [2, 3], [3, 4]]);
        assert_eq!(particles(&torn), [vec![0, 1], vec![2, 3, 4]]);
        assert_eq!(strands(&rope, &[1]), strands(&torn, &[]));
    }

    #[test]
    fn links_that_a_winch_adds_are_where_their_springs_are() {
        let rope = net(5, &[[0, 1], [1, 4], [4, 2], [3, 2]]);
        assert_eq!(particles(&rope), [[0, 1, 4, 2, 3]]);
    }

    #[test]
    fn loops_are_closed() {
        let ring = net(4, &[[0, 1], [1, 2], [2, 3], [3, 0]]);
        let strands = strands(&ring, &[]);
        assert_eq!(strands[0].particles, [0, 1, 2, 3, 0]);
        assert!(strands[0].is_closed);
        assert_eq!(strands.len(), 1);
    }

    #[test]
    fn every_spring_of_a_grid_is_in_one_strand() {
        let mut joints = Vec::new();
        for slot in 0..12_u32 {
            if slot % 4 < 3 {
                joints.push([slot, slot + 1]);
            }
            if slot < 8 {
                joints.push([slot, slot + 4]);
            }
        }
        let mut links: Vec<[u32; 2]> = particles(&net(12, &joints))
            .iter()
            .flat_map(|strand| {
                strand.windows(2).map(|ends| [ends[0].min(ends[1]), ends[0].max(ends[1])]).collect::<Vec<_>>()
            })
            .collect();
        links.sort_unstable();
        joints.sort_unstable();
        assert_eq!(links, joints);
    }
}
