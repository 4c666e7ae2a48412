//! The elimination of trees of springs, from the leaves to their roots.
//!
//! An elimination is a chain of operations each of which waits for the one before, for longer than it takes. So two nodes of which
//! none is the parent of the other are eliminated side by side: those of the two halves of a rope.

use bevy::math::DVec3;
use wide::CmpEq;

use super::lanes::{LANES, LaneMatrices, LaneVectors, Lanes};
use super::linearised::Linearised;
use super::system::System;
use crate::solver::graph::Elimination;

/// The step of a node after its elimination: its own part, and what the step of its parent adds.
///
/// The three columns of its coupling to the parent and, last, its own part, by component.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Eliminated {
    x: [f64; 4],
    y: [f64; 4],
    z: [f64; 4],
}

impl Eliminated {
    /// Its step, from that of its parent.
    #[inline]
    pub fn step(&self, parent: DVec3) -> DVec3 {
        let component = |of: &[f64; 4]| of[3] + of[0] * parent.x + of[1] * parent.y + of[2] * parent.z;
        DVec3::new(component(&self.x), component(&self.y), component(&self.z))
    }
}

/// Two nodes, after their eliminations.
struct Outcome {
    /// The columns of their couplings to the parents.
    couplings: [LaneVectors; 3],
    own: LaneVectors,
    /// What they leave to their parents: what is subtracted from the diagonal blocks, and what is added to the right sides.
    matrices: LaneMatrices,
    rights: LaneVectors,
}

impl Outcome {
    /// That of nodes with these blocks, known to be at least `inertia` I > 0, `link`s that couple them to their parents, and right
    /// sides. L D Lᵀ, as in `block.rs`.
    #[inline(always)]
    fn new(own: LaneMatrices, inertia: Lanes, link: LaneMatrices, right: LaneVectors) -> Self {
        let inverse = |pivot: Lanes| Lanes::ONE / pivot.fast_max(inertia);
        let inverse_x = inverse(own.xx);
        let (yx, zx) = (own.xy * inverse_x, own.xz * inverse_x);
        let inverse_y = inverse(own.yy - yx * own.xy);
        let below = own.yz - yx * own.xz;
        let zy = below * inverse_y;
        let inverse_z = inverse(own.zz - zx * own.xz - zy * below);
        let solve = |right: LaneVectors| {
            let y = right.y - yx * right.x;
            let z = (right.z - zx * right.x - zy * y) * inverse_z;
            let y = y * inverse_y - zy * z;
            let x = right.x * inverse_x - yx * y - zx * z;
            LaneVectors { x, y, z }
        };
        let [x, y, z] = link.columns();
        let couplings = [solve(x), solve(y), solve(z)];
        let own = solve(right);
        let [x, y, z] = [link.times(couplings[0]), link.times(couplings[1]), link.times(couplings[2])];
        let matrices = LaneMatrices { xx: x.x, yy: y.y, zz: z.z, xy: y.x, xz: z.x, yz: z.y };
        Self { couplings, own, matrices, rights: link.times(own) }
    }

    #[inline(always)]
    fn eliminated(&self) -> [Eliminated; LANES] {
        let [first, second, third] = self.couplings.each_ref().map(|column| column.split());
        let own = self.own.split();
        let of = |lane: usize| {
            let [first, second, third, own] = [first[lane], second[lane], third[lane], own[lane]];
            Eliminated {
                x: [first.x, second.x, third.x, own.x],
                y: [first.y, second.y, third.y, own.y],
                z: [first.z, second.z, third.z, own.z],
            }
        };
        [of(0), of(1)]
    }
}

impl System {
    /// Linearises the elements of the trees, and eliminates these; gives their part of the potential, J.
    pub(super) fn eliminate_trees(&mut self, elimination: &Elimination) -> f64 {
        let trees = elimination.trees;
        let (mut energy, mut node, mut touching) = (0.0, 0, 0);
        while node < trees {
            let is_alone = node + 1 == trees || elimination.parents[node] as usize == node + 1;
            let last = if is_alone { node } else { node + 1 };
            energy += self.eliminate_nodes(elimination, [node, last], &mut touching);
            node = last + 1;
        }
        energy
    }

    /// Eliminates two nodes, or one that is given twice. The first of the `tree_links` that have not been added is at `touching`.
    #[inline(always)]
    fn eliminate_nodes(
        &mut self,
        elimination: &Elimination,
        nodes: [usize; LANES],
        touching: &mut usize,
    ) -> f64 {
        let count = if nodes[0] == nodes[1] { 1 } else { LANES };
        let [first, second] = nodes;
        let parents = [elimination.parents[first] as usize, elimination.parents[second] as usize];
        let inertia = Lanes::new([self.inertia[first], self.inertia[second]]);
        let position = LaneVectors::new([self.position[first], self.position[second]]);
        let apart = position - LaneVectors::new([self.flight[first], self.flight[second]]);
        let pulled = apart.dot(apart);
        let pulled_energy = inertia * pulled;
        let load = Lanes::splat(self.load);
        let elements_of = |node: usize| {
            let [start, end] = [elimination.tree_starts[node], elimination.tree_starts[node + 1]];
            start as usize..end as usize
        };
        let mut numbers = [elements_of(first), elements_of(second)];
        // The first one leads to the parent. That of a root may lead to a pinned particle instead: what is added to the parent of a
        // root, which is no particle, counts for nothing.
        let next = [numbers[0].next(), numbers[1].next()];
        let pulls = self.linearise_elements(elimination, nodes, position, next);
        let Pulls { mut energy, mut force, block: mut link, .. } = pulls;
        let mut others = LaneMatrices::default();
        let mut on_parents = LaneVectors::default() - force;
        while !(numbers[0].is_empty() && numbers[1].is_empty()) {
            let next = [numbers[0].next(), numbers[1].next()];
            let more = self.linearise_elements(elimination, nodes, position, next);
            let is_parent = |lane: usize| if more.ends[lane] == parents[lane] { 1.0 } else { 0.0 };
            let mask = Lanes::new([is_parent(0), is_parent(1)]).cmp_eq(Lanes::ONE);
            energy += more.energy;
            force = force + more.force;
            let LaneVectors { x, y, z } = more.force;
            on_parents = on_parents - LaneVectors { x: x & mask, y: y & mask, z: z & mask };
            link += more.block.masked(mask);
            others += more.block.masked(!mask);
        }
        let energy = Lanes::HALF * pulled_energy + energy;
        let right =
            LaneVectors::new([self.right[first], self.right[second]]) - apart * (load * inertia) + force;
        let diagonal = LaneMatrices::new([self.diagonal[first], self.diagonal[second]]);
        let mut own = diagonal.plus_diagonal(inertia);
        own += link;
        own += others;
        while let Some(touch) = self.tree_links.get(*touching).filter(|touch| touch.node <= nodes[1]) {
            // What is on the diagonal of the parent has been added already.
            let lane = touch.node - nodes[0];
            self.diagonal[parents[lane]] += touch.block;
            let mut links = link.split();
            links[lane] -= touch.block;
            link = LaneMatrices::new(links);
            *touching += 1;
        }
        let outcome = Outcome::new(own, inertia, link, right);
        let step_energy = right.dot(outcome.own).to_array();
        let (pulled, pulled_energy) = (pulled.to_array(), pulled_energy.to_array());
        let (links, matrices) = (link.split(), outcome.matrices.split());
        let (on_parents, rights) = (on_parents.split(), outcome.rights.split());
        let eliminated = outcome.eliminated();
        let energy = energy.to_array();
        let mut sum = 0.0;
        for lane in 0..count {
            sum += energy[lane];
            self.sums.pulled += pulled[lane];
            self.sums.pulled_energy += pulled_energy[lane];
            self.sums.step_energy += step_energy[lane];
            let (node, parent) = (nodes[lane], parents[lane]);
            self.eliminated[node] = eliminated[lane];
            (self.right[node], self.diagonal[node]) = Default::default();
            self.right[parent] += on_parents[lane];
            self.right[parent] += rights[lane];
            self.diagonal[parent] += links[lane];
            self.diagonal[parent] -= matrices[lane];
        }
        sum
    }
}

/// What two elements contribute, one of each node.
struct Pulls {
    energy: Lanes,
    force: LaneVectors,
    block: LaneMatrices,
    /// The nodes at their other ends.
    ends: [usize; LANES],
}

impl System {
    /// Linearises an element of each of two `nodes` at this `position`; one may have none.
    #[inline(always)]
    fn linearise_elements(
        &mut self,
        elimination: &Elimination,
        nodes: [usize; LANES],
        position: LaneVectors,
        numbers: [Option<usize>; LANES],
    ) -> Pulls {
        let end = |lane: usize| match numbers[lane] {
            Some(number) => elimination.ends[number][1] as usize,
            None => nodes[lane],
        };
        let ends = [end(0), end(1)];
        let separation = position - LaneVectors::new([self.position[ends[0]], self.position[ends[1]]]);
        let element = |lane: usize| numbers[lane].map_or(&Linearised::NONE, |number| &self.elements[number]);
        let found = Linearised::linearise_both([element(0), element(1)], separation);
        let directions = found.direction.split();
        for lane in 0..LANES {
            if let Some(number) = numbers[lane] {
                self.elements[number].direction = directions[lane];
            }
        }
        let force = found.force * Lanes::splat(self.load);
        let block = LaneMatrices::uniaxial(found.direction, found.along, found.across);
        Pulls { energy: found.energy, force, block, ends }
    }
}

#[cfg(test)]
mod tests {
    use super::super::block::Symmetric;
    use super::*;

    /// own x − link y = r, parent y − link x = s
    #[test]
    fn two_pairs_of_nodes_that_are_eliminated_side_by_side_solve_their_equations() {
        let links = [
            Symmetric::uniaxial(DVec3::new(0.6, 0.0, 0.8), 9.0, 0.1),
            Symmetric::uniaxial(DVec3::new(0.8, 0.6, 0.0), 2.0, 0.4),
        ];
        let rights = [DVec3::new(1.0, -2.0, 3.0), DVec3::new(-0.5, 4.0, 1.5)];
        let owns = [0, 1].map(|lane| {
            let mut own = Symmetric::uniaxial(DVec3::new(0.0, 0.28, 0.96), 4.0, 0.0).plus_diagonal(0.5);
            own += links[lane];
            own
        });
        let outcome = Outcome::new(
            LaneMatrices::new(owns),
            Lanes::splat(0.5),
            LaneMatrices::new(links),
            LaneVectors::new(rights),
        );
        let (matrices, on_parents) = (outcome.matrices.split(), outcome.rights.split());
        let own_parts = outcome.own.split();
        for (lane, eliminated) in outcome.eliminated().iter().enumerate() {
            let mut parent = Symmetric::uniaxial(DVec3::new(0.28, 0.96, 0.0), 2.0, 1.0).plus_diagonal(0.5);
            parent += links[lane];
            let mut left = parent;
            left -= matrices[lane];
            let right = DVec3::new(2.0, 1.0, -1.0);
            let parent_step = left.factor(0.5).solve(right + on_parents[lane]);
            let step = eliminated.step(parent_step);
            let residuals = [
                owns[lane].times(step) - links[lane].times(parent_step) - rights[lane],
                parent.times(parent_step) - links[lane].times(step) - right,
            ];
            assert!(residuals.iter().all(|residual| residual.length() < 1e-13), "{residuals:?}");
            assert!((owns[lane].times(own_parts[lane]) - rights[lane]).length() < 1e-13);
        }
    }
}
