//! Contacts that couple nodes which are eliminated directly: those of the edges of ropes.
//!
//! A contact at the point Σ wᵢ xᵢ adds the block B wᵢ wⱼ between each two of its nodes. Between nodes of the core it is one more
//! compound of the core. Where one of two is eliminated, and the other is its parent, as along an edge of a rope, the block is added to
//! the one that couples the two already. Otherwise the coupling is replaced by an upper bound in blocks of the single
//! nodes, 2 wᵢ wⱼ xᵢ·xⱼ <= wᵢ wⱼ (‖xᵢ‖² + ‖xⱼ‖²): Newton steps are shorter then, but converge to the same solution.

use super::block::Symmetric;
use super::system::System;
use crate::solver::elements::MAX_ENDS;
use crate::solver::graph::Elimination;

/// What contacts couple a tree node by to a parent of it.
#[derive(Debug, Clone, Copy)]
pub(super) struct TreeLink {
    pub node: usize,
    pub parent: usize,
    /// The block in the row of the node and the column of the parent, N/m.
    pub block: Symmetric,
}

impl System {
    /// Takes the contacts out of the compounds that couple nodes of the trees.
    pub(super) fn route_contacts(&mut self, elimination: &Elimination) {
        self.tree_links.clear();
        let first = elimination.compounds.len();
        let mut kept = first;
        for place in first..self.compounds.len() {
            let compound = self.compounds[place];
            let is_in_trees = |node: &u32| (*node as usize) < elimination.trees;
            if !compound.nodes.ends().iter().any(is_in_trees) {
                self.compounds[kept] = compound;
                kept += 1;
                continue;
            }
            let mut ends = [(usize::MAX, 0.0); MAX_ENDS];
            let mut count = 0;
            for (node, weight) in compound.nodes.ends().iter().zip(compound.weights) {
                if (*node as usize) < elimination.free {
                    ends[count] = (*node as usize, weight);
                    count += 1;
                }
            }
            ends[..count].sort_unstable_by_key(|(node, _)| *node);
            for end in 0..count {
                let (node, weight) = ends[end];
                self.diagonal[node] += compound.block.scaled(weight * weight);
                for &(other, other_weight) in &ends[end + 1..count] {
                    let block = compound.block.scaled(weight * other_weight);
                    if is_parent(elimination, node, other) {
                        self.tree_links.push(TreeLink { node, parent: other, block });
                    } else {
                        self.diagonal[node] += block;
                        self.diagonal[other] += block;
                    }
                }
            }
        }
        self.compounds.truncate(kept);
        self.tree_links.sort_by_key(|link| (link.node, link.parent));
    }
}

fn is_parent(elimination: &Elimination, node: usize, other: usize) -> bool {
    node < elimination.trees
        && (elimination.parents[node] as usize == other
            || elimination.bent.get(node).is_some_and(|bent| bent.second_parent as usize == other))
}
