//! The order of pairs, which follows from the mesh alone: that in which a walk down the trees of bodies finds all of them, whenever they are found.
//!
//! Contacts are solved one after the other. In this order those of parts that are far from each other along a mesh come before those of
//! neighbours: a knot holds where it would slip if contacts were solved from one end of the cord to the other.

use super::search::Candidate;
use super::tree::{Forest, Node};

/// Which of two pairs comes first: by bodies, those within them first; by the walk down their trees; by their places in the two clusters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Order {
    bodies: (bool, u32, u32),
    path: u64,
    place: u32,
}

impl Order {
    /// That of a pair. By slot, `body_of` is the number of the body.
    pub fn of(pair: &Candidate, body_of: &[u32]) -> Self {
        let [one, other] = [pair.slots[0], pair.slots[3]].map(|slot| body_of[slot as usize]);
        let bodies = (!pair.is_within, one.min(other), one.max(other));
        Self { bodies, path: pair.path, place: pair.place }
    }
}

/// Two bits of a path for each level of the trees, of which there are no more than 32: in trees that halve their clusters 2³² of these.
const LAST_LEVEL: u32 = 62;

/// The path on which a walk comes from two nodes to two leaves below them.
pub(super) fn path_to([mut one, mut other]: [u32; 2], [first, second]: [u32; 2], forest: &Forest) -> u64 {
    let mut path = 0;
    for level in (0..=LAST_LEVEL).rev().step_by(2) {
        let nodes = [one, other].map(|node| forest.nodes[node as usize]);
        let is_behind = [first >= nodes[0].second, second >= nodes[1].second];
        let below =
            |node: u32, Node { second, .. }: Node, is_behind: bool| if is_behind { second } else { node + 1 };
        // In the order of `Walks::walk`: what is across comes first, then what is behind.
        let step = match (nodes[0].is_leaf, nodes[1].is_leaf) {
            (true, true) => break,
            _ if one == other => match is_behind {
                [false, true] => 0,
                [true, ..] => 1,
                [false, false] => 2,
            },
            (false, false) => 2 * u64::from(!is_behind[0]) + u64::from(!is_behind[1]),
            (false, true) => u64::from(!is_behind[0]),
            (true, false) => u64::from(!is_behind[1]),
        };
        path |= step << level;
        if !nodes[0].is_leaf {
            one = below(one, nodes[0], is_behind[0]);
        }
        if !nodes[1].is_leaf {
            other = below(other, nodes[1], is_behind[1]);
        }
    }
    path
}
