//! In which order the unknowns of an island are eliminated.
//!
//! Its particles are numbered as *nodes*:
//!
//! ```text
//! 0 .. trees       leaves first: each has at most one neighbour among the nodes after it, its parent
//! trees .. free    the core, what is left: nodes on closed paths of elements
//! free .. end      pinned particles at the ends of elements
//! end              no particle: the parent of the roots
//! ```
//!
//! A forest has no core. Removing leaves at all ends at once makes the middle of a rope its root, so that the
//! two halves are eliminated side by side, which the processor does at the same time. An element of more than
//! two ends couples all of them, and a node of one may have a second parent: so ropes that resist bending are
//! eliminated directly, too (`reduction.rs`). Particles that contacts join are in the core.

use super::hierarchy::Hierarchy;
use super::reduction::{NO_PARENT, Reduction};
use super::{Islands, Linked};
use crate::solver::buckets::Buckets;
use crate::solver::elements::{Acting, Elements};
use crate::solver::particles::Particles;

/// The nodes of an island, the elements between them, and the order of elimination.
#[derive(Debug, Clone, Default)]
pub(in crate::solver) struct Elimination {
    /// The slot of each node.
    pub slots: Vec<u32>,
    /// Number of nodes that are eliminated directly.
    pub trees: usize,
    /// Number of nodes that are free.
    pub free: usize,
    /// The parent of each tree node.
    pub parents: Vec<u32>,
    /// What else is to be known of each tree node, where elements of more than two ends act on any; else empty.
    pub bent: Vec<BentNode>,
    /// The pairs of core nodes, numbered from 0 there, that are joined by what was eliminated.
    pub fills: Vec<[u32; 2]>,
    /// `tree_starts[i]..tree_starts[i + 1]` are the elements of tree node i.
    pub tree_starts: Vec<u32>,
    /// The numbers of the elements of two ends: those of the tree nodes, then those of the core, of these first
    /// the links within the core, in runs.
    pub elements: Vec<u32>,
    /// Their ends; the first is the tree node, or one of the core.
    pub ends: Vec<[u32; 2]>,
    /// The links within the core.
    pub runs: Vec<NodeRun>,
    /// The elements of more ends: those of the tree nodes, then those of the core. Their `ends` are nodes.
    pub compounds: Vec<Linked>,
    /// Number of those of the tree nodes.
    pub tree_compounds: usize,
    /// The numbers of the gases, and the nodes of their particles; free ones are in the core.
    pub gases: Vec<(u32, Vec<u32>)>,
    /// How the core is coarsened, for its preconditioner.
    pub hierarchy: Hierarchy,
}

/// Links of the core between consecutive nodes; core nodes are numbered from 0 here.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::solver) struct NodeRun {
    pub first: usize,
    pub second: usize,
    pub count: usize,
}

/// A tree node that may have two parents, with its share of the compounds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::solver) struct BentNode {
    /// The later one of its parents; the node that is none if it has fewer than two.
    pub second_parent: u32,
    /// Where its compounds end.
    pub compounds_end: u32,
    /// What joins its two parents when it is gone.
    pub fill: Fill,
}

/// Where the coupling of two nodes is kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::solver) enum Fill {
    /// There are no two.
    None,
    /// With a tree node, to its parent or to its second parent.
    Tree { node: u32, to_second: bool },
    /// In this place among the fills of the core.
    Core(u32),
}

/// The node of a particle that is pinned, or not in the elimination.
const NO_NODE: u32 = u32::MAX;

/// The number of a gas, and the slots of its particles, or their nodes.
type Gas = (u32, Vec<u32>);

impl Elimination {
    /// One for each of the islands that are `wanted`.
    pub fn of_islands(
        elements: &Elements,
        particles: &Particles,
        islands: &Islands,
        wanted: impl Fn(usize) -> bool,
    ) -> Vec<Self> {
        let mut members = Buckets::default();
        members.fill(islands.all().len(), |add| {
            elements.for_each_acting(|Acting { number, ends, .. }| {
                let island = ends.iter().find_map(|end| islands.of(*end as usize));
                if let Some(island) = island.filter(|island| wanted(*island)) {
                    add(island, Linked::new(number, ends));
                }
            });
        });
        let mut gases: Vec<Vec<Gas>> = vec![Vec::new(); islands.all().len()];
        for (number, enclosure) in elements.gases().acting() {
            let island = enclosure.slots.iter().find_map(|slot| islands.of(*slot as usize));
            if let Some(island) = island.filter(|island| wanted(*island)) {
                gases[island].push((number as u32, enclosure.slots.clone()));
            }
        }
        let mut nodes = vec![NO_NODE; particles.len()];
        let wanted = (0..members.len()).filter(|island| wanted(*island));
        let of = |island: usize| {
            Self::of(members.of(island), std::mem::take(&mut gases[island]), &[], particles, &mut nodes)
        };
        wanted.map(of).collect()
    }

    /// One for several islands together, for as long as contacts join the particles in the slots `in_core`; some of
    /// these may be in no island.
    pub fn joined<'a>(parts: impl Iterator<Item = &'a Self>, in_core: &[u32], particles: &Particles) -> Self {
        let (mut members, mut gases) = (Vec::new(), Vec::new());
        for part in parts {
            let slot = |node: u32| part.slots[node as usize];
            let pairs = part.elements.iter().zip(&part.ends);
            members.extend(pairs.map(|(element, ends)| Linked::new(*element, &ends.map(slot))));
            members.extend(part.compounds.iter().map(|compound| compound.map_ends(slot)));
            let slots_of = |(number, nodes): &Gas| (*number, nodes.iter().map(|node| slot(*node)).collect());
            gases.extend(part.gases.iter().map(slots_of));
        }
        members.sort_unstable_by_key(|member| member.element);
        gases.sort_unstable();
        Self::of(&members, gases, in_core, particles, &mut vec![NO_NODE; particles.len()])
    }

    /// The elimination of these elements and gases, with the slots `in_core` in the core; `nodes` is working memory.
    fn of(
        members: &[Linked],
        gases: Vec<Gas>,
        in_core: &[u32],
        particles: &Particles,
        nodes: &mut [u32],
    ) -> Self {
        let in_gas = gases.iter().flat_map(|(_, slots)| slots);
        let in_core = &in_core.iter().chain(in_gas).copied().collect::<Vec<u32>>();
        let mut all: Vec<u32> = members.iter().flat_map(Linked::ends).chain(in_core).copied().collect();
        all.sort_unstable();
        all.dedup();
        let (pinned, free): (Vec<u32>, Vec<u32>) =
            all.into_iter().partition(|slot| particles.is_pinned(*slot as usize));
        let reduction = Reduction::of(members, in_core, &free, particles, nodes);
        let mut elimination = Self { free: free.len(), trees: reduction.order.len(), ..Self::default() };
        let order = reduction.order.iter().chain(&reduction.left);
        elimination.slots.extend(order.map(|place| free[*place as usize]).chain(pinned));
        for (node, slot) in (0..).zip(&elimination.slots) {
            nodes[*slot as usize] = node;
        }
        let no_node = elimination.slots.len() as u32;
        let node_of =
            |place: u32| if place == NO_PARENT { no_node } else { nodes[free[place as usize] as usize] };
        let parents: Vec<[u32; 2]> = reduction
            .parents
            .iter()
            .map(|parents| {
                let [one, other] = parents.map(node_of);
                [one.min(other), one.max(other)]
            })
            .collect();
        elimination.parents.extend(parents.iter().map(|[parent, _]| *parent));
        elimination.sort_elements(members, nodes);
        elimination.list_bent(&parents);
        elimination.gases = gases;
        for slot in elimination.gases.iter_mut().flat_map(|(_, slots)| slots) {
            *slot = nodes[*slot as usize];
        }
        elimination
    }

    /// Finds what is to be known of tree nodes at compounds.
    fn list_bent(&mut self, parents: &[[u32; 2]]) {
        if self.tree_compounds == 0 {
            return;
        }
        let (trees, free) = (self.trees as u32, self.free as u32);
        let mut compounds_end = 0;
        for (node, &[parent, second_parent]) in (0..).zip(parents) {
            let own = self.compounds[compounds_end..self.tree_compounds].iter();
            compounds_end += own.take_while(|compound| compound.ends().contains(&node)).count();
            let fill = if second_parent >= free {
                Fill::None
            } else if parent < trees {
                // The two are joined, so that one is a parent of the other.
                Fill::Tree { node: parent, to_second: parents[parent as usize][0] != second_parent }
            } else {
                Fill::Core(self.core_fill([parent - trees, second_parent - trees]))
            };
            self.bent.push(BentNode { second_parent, compounds_end: compounds_end as u32, fill });
        }
    }

    /// The place of a pair of core nodes among the fills.
    fn core_fill(&mut self, pair: [u32; 2]) -> u32 {
        let known = self.fills.iter().position(|fill| *fill == pair);
        known.unwrap_or_else(|| {
            self.fills.push(pair);
            self.fills.len() - 1
        }) as u32
    }

    /// Lists the elements that have a free end, by the node that they are assigned to.
    fn sort_elements(&mut self, members: &[Linked], nodes: &[u32]) {
        let (trees, free) = (self.trees as u32, self.free as u32);
        let in_nodes = members.iter().map(|member| member.map_ends(|slot| nodes[slot as usize]));
        let (mut pairs, compounds): (Vec<Linked>, Vec<Linked>) =
            in_nodes.partition(|member| member.count == 2);
        let first_node = |compound: &Linked| compound.ends().iter().copied().min().unwrap_or(NO_NODE);
        self.compounds = compounds;
        self.compounds.sort_by_key(|compound| (first_node(compound).min(trees), compound.element));
        self.tree_compounds = self.compounds.partition_point(|compound| first_node(compound) < trees);
        for pair in &mut pairs {
            pair.ends[..2].sort_unstable();
        }
        pairs.sort_by_key(|&Linked { ends, element, .. }| {
            let (first, second) = (ends[0], ends[1]);
            match (first < trees, second < free) {
                (true, _) => (0, first, second, element),
                (false, true) => (1, second - first, first, element),
                (false, false) => (2, first, second, element),
            }
        });
        self.elements.extend(pairs.iter().map(|pair| pair.element));
        self.ends.extend(pairs.iter().map(|pair| [pair.ends[0], pair.ends[1]]));
        // The elements are sorted by tree node, those of the core last.
        let start_of = |node: u32| self.ends.partition_point(|ends| ends[0] < node) as u32;
        self.tree_starts.extend((0..=trees).map(start_of));
        for ends in self.ends[self.tree_elements()..].iter().take_while(|ends| ends[1] < free) {
            let [first, second] = ends.map(|end| (end - trees) as usize);
            match self.runs.last_mut() {
                Some(run) if [run.first + run.count, run.second + run.count] == [first, second] => {
                    run.count += 1;
                }
                _ => self.runs.push(NodeRun { first, second, count: 1 }),
            }
        }
        self.hierarchy.build(self.free - self.trees, &self.runs);
    }

    /// The number of elements that are assigned to tree nodes.
    pub fn tree_elements(&self) -> usize {
        self.tree_starts.last().map_or(0, |end| *end as usize)
    }

    /// Whether the island hangs on a pinned particle.
    pub fn is_anchored(&self) -> bool {
        self.slots.len() > self.free
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::Vec3;

    use super::*;
    use crate::solver::elements::{Bend, Spring};

    fn eliminations(links: &[[u32; 2]], bends: &[[u32; 3]], inverse_mass: &[f32]) -> Vec<Elimination> {
        let (mut elements, mut particles) = (Elements::default(), Particles::default());
        for link in links {
            elements
                .push(*link, Spring { rest_length: 1.0, stiffness: 1.0, damping: 0.0, ..Spring::default() });
        }
        for bend in bends {
            elements.push(
                *bend,
                Bend { rest_length: 0.0, stiffness: 1.0, damping: 0.0, weights: [1.0, -2.0, 1.0] },
            );
        }
        for inverse_mass in inverse_mass {
            particles.push(Vec3::ZERO, Vec3::ZERO, *inverse_mass, 0.0);
        }
        let mut islands = Islands::default();
        islands.refresh(&elements, &particles);
        Elimination::of_islands(&elements, &particles, &islands, |_| true)
    }

    fn elimination(links: &[[u32; 2]], inverse_mass: &[f32]) -> Elimination {
        let mut all = eliminations(links, &[], inverse_mass);
        assert_eq!(all.len(), 1);
        all.remove(0)
    }

    #[test]
    fn leaves_of_a_rope_are_removed_at_both_ends() {
        let rope = elimination(&[[0, 1], [1, 2], [3, 2], [3, 4], [4, 5]], &[0.0, 1.0, 1.0, 1.0, 1.0, 1.0]);
        assert_eq!(rope.slots, [1, 5, 2, 4, 3, 0]);
        assert_eq!((rope.trees, rope.free), (5, 5));
        assert_eq!(rope.parents, [2, 3, 4, 4, 6]);
        assert_eq!(rope.ends, [[0, 2], [0, 5], [1, 3], [2, 4], [3, 4]]);
        assert_eq!(rope.tree_starts, [0, 2, 3, 4, 5, 5]);
        assert!(rope.is_anchored());
    }

    #[test]
    fn two_particles_make_one_tree_even_by_two_springs() {
        let pair = elimination(&[[0, 1], [1, 0]], &[1.0, 1.0]);
        assert_eq!((pair.trees, pair.parents.clone()), (2, vec![1, 2]));
        assert!(!pair.is_anchored());
    }

    #[test]
    fn a_ring_with_a_tail_keeps_the_ring_as_its_core() {
        let links = [[0, 1], [1, 2], [2, 0], [2, 3], [3, 4], [5, 6]];
        let all = eliminations(&links, &[], &[1.0; 8]);
        assert_eq!(all[0].slots, [4, 3, 0, 1, 2]);
        assert_eq!((all[0].trees, all[0].free), (2, 5));
        assert_eq!(all[0].parents, [1, 4]);
        assert_eq!((all[1].slots.clone(), all[1].trees), (vec![5, 6], 2));
    }

    #[test]
    fn pinning_a_particle_of_a_ring_opens_it() {
        let open = elimination(&[[0, 1], [1, 2], [2, 0]], &[1.0, 0.0, 1.0]);
        assert_eq!((open.trees, open.free, open.slots.len()), (2, 2, 3));
    }

    #[test]
    fn a_rope_with_rods_is_solved_directly() {
        let links = [[0, 1], [1, 2], [2, 3], [3, 4]];
        let all = eliminations(&links, &[[0, 1, 2], [1, 2, 3], [2, 3, 4]], &[0.0, 1.0, 1.0, 1.0, 1.0]);
        let rope = &all[0];
        assert_eq!((rope.slots.clone(), rope.trees), (vec![1, 4, 2, 3, 0], 4));
        assert_eq!(rope.parents, [2, 2, 3, 5]);
        // By node: the rods of slots 0 and 1 to 3, of 2 to 4, and none.
        assert_eq!(rope.compounds, [[4, 0, 2], [0, 2, 3], [2, 3, 1]].map(|ends| compound(rope, ends)));
        let seconds: Vec<(u32, u32)> =
            rope.bent.iter().map(|node| (node.second_parent, node.compounds_end)).collect();
        assert_eq!(seconds, [(3, 2), (3, 3), (5, 3), (5, 3)]);
        let fill = Fill::Tree { node: 2, to_second: false };
        assert_eq!(
            rope.bent.iter().map(|node| node.fill).collect::<Vec<_>>(),
            [fill, fill, Fill::None, Fill::None]
        );
    }

    /// The compound of a rope with these nodes.
    fn compound(rope: &Elimination, ends: [u32; 3]) -> Linked {
        let found = rope.compounds.iter().find(|compound| compound.ends() == ends);
        *found.unwrap_or_else(|| panic!("no compound joins {ends:?}: {:?}", rope.compounds))
    }

    #[test]
    fn what_is_between_two_contacts_is_in_the_core_and_joined_by_what_was_outside() {
        let links: Vec<[u32; 2]> = (0..7).map(|slot| [slot, slot + 1]).collect();
        let rods: Vec<[u32; 3]> = (0..6).map(|slot| [slot, slot + 1, slot + 2]).collect();
        let rope = &eliminations(&links, &rods, &[1.0; 8])[0];
        assert_eq!((rope.trees, rope.free, rope.fills.len()), (8, 8, 0));
        let mut particles = Particles::default();
        (0..8).for_each(|_| particles.push(Vec3::ZERO, Vec3::ZERO, 1.0, 0.0));
        let touching = Elimination::joined(std::iter::once(rope), &[2, 5], &particles);
        assert_eq!(touching.slots, [0, 7, 1, 6, 2, 3, 4, 5]);
        assert_eq!((touching.trees, touching.fills.clone()), (4, vec![[0, 1], [2, 3]]));
        assert_eq!(touching.compounds.len() - touching.tree_compounds, 2);
    }
}
