//! The elimination of trees with nodes that may have two parents: ropes that resist bending.
//!
//! With A the block of a node, P and Q what couples it to its parents p and q, and r its right side, its step is
//!
//! x = A⁻¹ (r − P x_p − Q x_q)
//!
//! and what is left for the parents is H_pp − Pᵀ A⁻¹ P, H_qq − Qᵀ A⁻¹ Q, H_pq − Pᵀ A⁻¹ Q, r_p − Pᵀ A⁻¹ r and
//! r_q − Qᵀ A⁻¹ r: Gauss's elimination, which for a rope is that of a matrix of five diagonals of blocks
//! (George and Liu, *Computer Solution of Large Sparse Positive Definite Systems*, 1981, chapter 4).

use bevy::math::{DMat3, DVec3};

use super::block::{Factor, Symmetric};
use super::system::System;
use crate::solver::graph::{BentNode, Elimination, Fill};

/// What is kept of the nodes.
#[derive(Debug, Clone, Default)]
pub(super) struct Wide {
    nodes: Vec<WideNode>,
    /// What couples the pairs of core nodes that [`Elimination::fills`] lists, N/m; the first is the row.
    pub fills: Vec<DMat3>,
}

/// A node: before it is eliminated what the nodes below have coupled it by to its parents, afterwards its step as
/// `own` + Σ `couplings` · (the step of a parent).
#[derive(Debug, Clone, Copy, Default)]
struct WideNode {
    own: DVec3,
    couplings: [DMat3; 2],
}

/// A node that is being eliminated, with the stiffness and the forces of its elements.
struct Row {
    node: usize,
    parents: [usize; 2],
    own: Symmetric,
    right: DVec3,
    /// P and Q, the rows of the node.
    couplings: [DMat3; 2],
    /// H_pq, as far as its elements make it.
    between: Symmetric,
}

impl Wide {
    /// Allocates the nodes of `elimination`.
    pub fn resize(&mut self, elimination: &Elimination) {
        self.nodes.resize(elimination.bent.len(), WideNode { couplings: [DMat3::ZERO; 2], own: DVec3::ZERO });
        self.fills.resize(elimination.fills.len(), DMat3::ZERO);
    }

    /// The step of a node, from those of its parents.
    #[inline]
    pub fn step(&self, node: usize, [first, second]: [DVec3; 2]) -> DVec3 {
        let WideNode { own, couplings: [to_first, to_second] } = &self.nodes[node];
        *own + *to_first * first + *to_second * second
    }

    fn fill_mut(&mut self, fill: Fill) -> Option<&mut DMat3> {
        match fill {
            Fill::None => None,
            Fill::Tree { node, to_second } => {
                Some(&mut self.nodes[node as usize].couplings[usize::from(to_second)])
            }
            Fill::Core(place) => Some(&mut self.fills[place as usize]),
        }
    }
}

impl System {
    /// Linearises the elements of the trees, and eliminates these; returns their part of the potential, J.
    pub(super) fn eliminate_wide(&mut self, elimination: &Elimination) -> f64 {
        let mut energy = 0.0;
        self.wide.nodes.iter_mut().for_each(|node| node.couplings = [DMat3::ZERO; 2]);
        self.wide.fills.fill(DMat3::ZERO);
        let mut compounds_start = 0;
        let mut touching = 0;
        for (node, bent) in elimination.bent.iter().enumerate() {
            let apart = self.position[node] - self.flight[node];
            let (pulled, inertia) = (apart.length_squared(), self.inertia[node]);
            self.sums.pulled += pulled;
            self.sums.pulled_energy += inertia * pulled;
            energy += 0.5 * inertia * pulled;
            let mut row = Row {
                node,
                parents: [elimination.parents[node] as usize, bent.second_parent as usize],
                own: self.diagonal[node].plus_diagonal(inertia),
                right: self.right[node] - self.load * inertia * apart,
                couplings: self.wide.nodes[node].couplings,
                between: Symmetric::default(),
            };
            energy += self.add_pairs(elimination, &mut row);
            let compounds = compounds_start..bent.compounds_end as usize;
            compounds_start = compounds.end;
            for compound in compounds {
                energy += self.add_compound(elimination, compound, &mut row);
            }
            while let Some(touch) = self.tree_links.get(touching).filter(|touch| touch.node == node) {
                touching += 1;
                if let Some(which) = row.parents.iter().position(|parent| *parent == touch.parent) {
                    row.couplings[which] += touch.block.matrix();
                }
            }
            (self.right[node], self.diagonal[node]) = Default::default();
            self.eliminate(row, inertia, bent);
        }
        energy
    }

    /// Adds the elements of two ends of a node; their energy, J.
    #[inline]
    fn add_pairs(&mut self, elimination: &Elimination, row: &mut Row) -> f64 {
        let mut energy = 0.0;
        let starts = &elimination.tree_starts[row.node..row.node + 2];
        let range = starts[0] as usize..starts[1] as usize;
        for (element, ends) in self.elements[range.clone()].iter_mut().zip(&elimination.ends[range]) {
            let other = ends[1] as usize;
            let found = element.linearise(self.position[row.node] - self.position[other]);
            energy += found.energy;
            let force = self.load * found.force;
            row.right += force;
            let block = found.block(element.direction);
            row.own += block;
            if let Some(which) = row.parents.iter().position(|parent| *parent == other) {
                row.couplings[which] -= block.matrix();
                self.right[other] -= force;
                self.diagonal[other] += block;
            }
        }
        energy
    }

    /// Adds an element of more ends; its energy, J.
    #[inline]
    fn add_compound(&mut self, elimination: &Elimination, compound: usize, row: &mut Row) -> f64 {
        let Self { compounds, elements, position, right, diagonal, load, .. } = self;
        let compound_element = &compounds[compound];
        let (nodes, weights) = (compound_element.nodes, compound_element.weights);
        let element = &mut elements[elimination.elements.len() + compound];
        let ends = || nodes.ends().iter().map(|end| *end as usize).zip(weights);
        let separation = ends().map(|(end, weight)| position[end] * weight).sum();
        let found = element.linearise(separation);
        let (force, block) = (*load * found.force, found.block(element.direction));
        // The weight of the node, and those of its parents.
        let mut of_node = 0.0;
        let mut of_parents = [0.0; 2];
        for (end, weight) in ends() {
            if end == row.node {
                of_node = weight;
            } else if let Some(which) = row.parents.iter().position(|parent| *parent == end) {
                of_parents[which] = weight;
                right[end] += force * weight;
                diagonal[end] += block.scaled(weight * weight);
            }
        }
        row.right += force * of_node;
        row.own += block.scaled(of_node * of_node);
        for (coupling, weight) in row.couplings.iter_mut().zip(of_parents) {
            *coupling += block.scaled(of_node * weight).matrix();
        }
        row.between += block.scaled(of_parents[0] * of_parents[1]);
        found.energy
    }

    /// Eliminates a node. Its block is at least `inertia` I.
    #[inline]
    fn eliminate(&mut self, row: Row, inertia: f64, bent: &BentNode) {
        let Row { node, parents: [first, second], right, couplings: [to_first, to_second], .. } = row;
        let factor = row.own.factor(inertia);
        let own = factor.solve(right);
        self.sums.step_energy += right.dot(own);
        let from_first = solve(&factor, &to_first);
        let from_second = solve(&factor, &to_second);
        self.wide.nodes[node] = WideNode { own, couplings: [-from_first, -from_second] };
        self.right[first] -= to_first.transpose() * own;
        self.diagonal[first] -= Symmetric::of_product(&to_first, &from_first);
        if let Some(fill) = self.wide.fill_mut(bent.fill) {
            *fill += row.between.matrix() - to_first.transpose() * from_second;
            self.right[second] -= to_second.transpose() * own;
            self.diagonal[second] -= Symmetric::of_product(&to_second, &from_second);
        }
    }
}

/// The inverse of the factored block · `matrix`.
#[inline]
fn solve(factor: &Factor, matrix: &DMat3) -> DMat3 {
    DMat3::from_cols(factor.solve(matrix.x_axis), factor.solve(matrix.y_axis), factor.solve(matrix.z_axis))
}
