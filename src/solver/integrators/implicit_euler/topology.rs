//! In which order the unknowns are eliminated: computed once for each net.
//!
//! Particles are renumbered as *nodes*:
//!
//! ```text
//! 0 .. trees          leaves first: each has at most one neighbour among the nodes after it, its parent
//! trees .. free       the core, what is left: each node of it lies on a closed way of springs
//! free .. pinned_end  pinned particles at the ends of springs
//! pinned_end          nobody: the parent of the roots
//! ```
//!
//! A forest has no core. Taking leaves off from all ends at once makes the middle of a rope its root,
//! so that the two halves are eliminated side by side, which the processor does at the same time.

use super::super::super::springs::Springs;
use super::super::net::Net;
use super::hierarchy::Hierarchy;

/// The nodes, the springs between them, and the order of elimination.
#[derive(Debug, Clone, Default)]
pub(super) struct Topology {
    /// The slot of each node.
    pub slots: Vec<u32>,
    /// The node of each slot; [`NOBODY`] without springs.
    pub nodes: Vec<u32>,
    /// Number of nodes that are eliminated directly.
    pub trees: usize,
    /// Number of nodes that are free.
    pub free: usize,
    /// The parent of each tree node.
    pub parents: Vec<u32>,
    /// `tree_starts[i]..tree_starts[i + 1]` are the springs of tree node i.
    pub tree_starts: Vec<u32>,
    /// The springs, by their index in [`Springs`]: those of the tree nodes, then those of the core, of
    /// these first the links within the core, in runs.
    pub springs: Vec<u32>,
    /// Their ends; the first is the tree node, or one of the core.
    pub ends: Vec<[u32; 2]>,
    /// The links within the core.
    pub runs: Vec<Run>,
    /// How the core is coarsened, for its preconditioner.
    pub hierarchy: Hierarchy,
    /// The connected part of the net that each free node belongs to; pinned particles connect nothing.
    pub parts: Vec<u32>,
    /// Whether each part hangs on a pinned particle.
    pub anchored: Vec<bool>,
    /// The net for which all this holds.
    net: Net,
}

/// Links of the core whose ends walk along the arrays; core nodes are numbered from 0 here.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Run {
    pub first: usize,
    pub second: usize,
    pub count: usize,
}

/// The node of a slot that is none.
pub(super) const NOBODY: u32 = u32::MAX;

impl Topology {
    /// The number of nodes, pinned ones included, but not the nobody.
    pub fn len(&self) -> usize {
        self.slots.len()
    }

    /// The number of springs that are assigned to tree nodes.
    pub fn tree_springs(&self) -> usize {
        self.tree_starts.last().map_or(0, |end| *end as usize)
    }

    /// Makes it that of `springs` between particles of `inverse_mass`; says whether it was not yet.
    pub fn refresh(&mut self, springs: &Springs, inverse_mass: &[f32]) -> bool {
        if !self.net.refresh(springs, inverse_mass) {
            return false;
        }
        let neighbours = Neighbours::of(springs, &self.net.free);
        let parent_slots = self.number(&neighbours, springs);
        let nobody = self.len() as u32;
        self.parents.clear();
        self.parents.extend(
            parent_slots.iter().map(|parent| parent.map_or(nobody, |slot| self.nodes[slot as usize])),
        );
        self.sort_springs(springs);
        self.find_parts(&neighbours);
        true
    }

    /// Numbers the nodes; returns the slot of each tree node's parent.
    fn number(&mut self, neighbours: &Neighbours, springs: &Springs) -> Vec<Option<u32>> {
        let count = self.net.free.len();
        let mut joined = vec![false; count];
        let free = |slot: usize| self.net.free[slot];
        for (first, second) in (0..springs.len()).map(|spring| springs.ends(spring)) {
            // A spring between two pinned particles is nobody's.
            if free(first) || free(second) {
                (joined[first], joined[second]) = (true, true);
            }
        }
        let mut degree: Vec<usize> = (0..count).map(|slot| neighbours.of_slot(slot).len()).collect();
        let mut parents = Vec::new();
        self.slots.clear();
        self.slots.extend((0..count as u32).filter(|slot| {
            let slot = *slot as usize;
            joined[slot] && free(slot) && degree[slot] <= 1
        }));
        let mut taken = vec![false; count];
        while let Some(&leaf) = self.slots.get(parents.len()) {
            taken[leaf as usize] = true;
            let parent = neighbours.of_slot(leaf as usize).iter().find(|other| !taken[**other as usize]);
            parents.push(parent.copied());
            if let Some(&parent) = parent {
                degree[parent as usize] -= 1;
                if degree[parent as usize] == 1 {
                    self.slots.push(parent);
                }
            }
        }
        self.trees = self.slots.len();
        let left = |slot: &u32| joined[*slot as usize] && !taken[*slot as usize];
        self.slots.extend((0..count as u32).filter(|slot| left(slot) && free(*slot as usize)));
        self.free = self.slots.len();
        self.slots.extend((0..count as u32).filter(|slot| left(slot) && !free(*slot as usize)));
        self.nodes.clear();
        self.nodes.resize(count, NOBODY);
        for (node, slot) in self.slots.iter().enumerate() {
            self.nodes[*slot as usize] = node as u32;
        }
        parents
    }

    /// Lists the springs that have a free end, by the node that they are assigned to.
    fn sort_springs(&mut self, springs: &Springs) {
        let mut listed: Vec<([u32; 2], u32)> = (0..springs.len())
            .map(|spring| {
                let (first, second) = springs.ends(spring);
                let (first, second) = (self.nodes[first], self.nodes[second]);
                ([first.min(second), first.max(second)], spring as u32)
            })
            .filter(|(ends, _)| (ends[0] as usize) < self.free)
            .collect();
        let (trees, free) = (self.trees as u32, self.free as u32);
        listed.sort_by_key(|&([first, second], spring)| match (first < trees, second < free) {
            (true, _) => (0, first, second, spring),
            (false, true) => (1, second - first, first, spring),
            (false, false) => (2, first, second, spring),
        });
        self.springs.clear();
        self.springs.extend(listed.iter().map(|(_, spring)| *spring));
        self.ends.clear();
        self.ends.extend(listed.iter().map(|(ends, _)| *ends));
        self.tree_starts.clear();
        self.tree_starts.resize(self.trees + 1, 0);
        for ends in self.ends.iter().take_while(|ends| (ends[0] as usize) < self.trees) {
            self.tree_starts[ends[0] as usize + 1] += 1;
        }
        for node in 0..self.trees {
            self.tree_starts[node + 1] += self.tree_starts[node];
        }
        self.runs.clear();
        for ends in self.ends[self.tree_springs()..].iter().take_while(|ends| ends[1] < free) {
            let [first, second] = ends.map(|end| (end - trees) as usize);
            match self.runs.last_mut() {
                Some(run) if [run.first + run.count, run.second + run.count] == [first, second] => {
                    run.count += 1;
                }
                _ => self.runs.push(Run { first, second, count: 1 }),
            }
        }
        self.hierarchy.build(self.free - self.trees, &self.runs);
    }

    fn find_parts(&mut self, neighbours: &Neighbours) {
        self.parts.clear();
        self.parts.resize(self.free, NOBODY);
        self.anchored.clear();
        let mut reached = Vec::new();
        for start in 0..self.free {
            if self.parts[start] != NOBODY {
                continue;
            }
            let part = self.anchored.len() as u32;
            self.anchored.push(false);
            self.parts[start] = part;
            reached.push(self.slots[start]);
            while let Some(slot) = reached.pop() {
                for other in neighbours.of_slot(slot as usize) {
                    let node = self.nodes[*other as usize] as usize;
                    if self.parts[node] == NOBODY {
                        self.parts[node] = part;
                        reached.push(*other);
                    }
                }
            }
        }
        for &[first, second] in &self.ends {
            if second as usize >= self.free {
                self.anchored[self.parts[first as usize] as usize] = true;
            }
        }
    }
}

/// The free neighbours of each free slot, each named once.
struct Neighbours {
    starts: Vec<u32>,
    others: Vec<u32>,
}

impl Neighbours {
    fn of(springs: &Springs, free: &[bool]) -> Self {
        let count = free.len();
        let free = |slot: u32| free[slot as usize];
        let mut pairs: Vec<(u32, u32)> = springs
            .first()
            .iter()
            .zip(springs.second())
            .filter(|(first, second)| free(**first) && free(**second))
            .flat_map(|(&first, &second)| [(first, second), (second, first)])
            .collect();
        pairs.sort_unstable();
        pairs.dedup();
        let mut starts = vec![0; count + 1];
        for (slot, _) in &pairs {
            starts[*slot as usize + 1] += 1;
        }
        for slot in 0..count {
            starts[slot + 1] += starts[slot];
        }
        Self { starts, others: pairs.into_iter().map(|(_, other)| other).collect() }
    }

    fn of_slot(&self, slot: usize) -> &[u32] {
        &self.others[self.starts[slot] as usize..self.starts[slot + 1] as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn topology(links: &[(usize, usize)], inverse_mass: &[f32]) -> Topology {
        let mut springs = Springs::default();
        for (first, second) in links {
            springs.push(*first, *second, 1.0, 1.0, 0.0);
        }
        let mut topology = Topology::default();
        topology.refresh(&springs, inverse_mass);
        topology
    }

    #[test]
    fn a_rope_is_taken_off_from_both_ends() {
        let rope = topology(&[(0, 1), (1, 2), (3, 2), (3, 4), (4, 5)], &[0.0, 1.0, 1.0, 1.0, 1.0, 1.0]);
        assert_eq!(rope.slots, [1, 5, 2, 4, 3, 0]);
        assert_eq!((rope.trees, rope.free), (5, 5));
        assert_eq!(rope.parents, [2, 3, 4, 4, 6]);
        assert_eq!(rope.ends, [[0, 2], [0, 5], [1, 3], [2, 4], [3, 4]]);
        assert_eq!(rope.tree_starts, [0, 2, 3, 4, 5, 5]);
        assert_eq!(rope.anchored, [true]);
    }

    #[test]
    fn two_particles_make_one_tree_even_by_two_springs() {
        let pair = topology(&[(0, 1), (1, 0)], &[1.0, 1.0]);
        assert_eq!((pair.trees, pair.parents), (2, vec![1, 2]));
        assert_eq!(pair.anchored, [false]);
    }

    #[test]
    fn a_ring_with_a_tail_keeps_the_ring_as_its_core() {
        let ring = topology(&[(0, 1), (1, 2), (2, 0), (2, 3), (3, 4), (5, 6)], &[1.0; 8]);
        assert_eq!(ring.slots, [4, 5, 6, 3, 0, 1, 2]);
        assert_eq!((ring.trees, ring.free), (4, 7));
        assert_eq!(ring.parents, [3, 2, 7, 6]);
        assert_eq!(ring.parts, [0, 1, 1, 0, 0, 0, 0]);
    }

    #[test]
    fn pinning_a_particle_of_a_ring_opens_it() {
        let open = topology(&[(0, 1), (1, 2), (2, 0)], &[1.0, 0.0, 1.0]);
        assert_eq!((open.trees, open.free, open.len()), (2, 2, 3));
    }
}
