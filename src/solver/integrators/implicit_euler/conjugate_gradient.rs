//! The core's linear system, by preconditioned conjugate gradients.
//!
//! Hestenes and Stiefel, *J. Res. Nat. Bur. Stand.* 49, 409 (1952). The matrix exists as its springs
//! only; the preconditioner is its 3×3 diagonal blocks, inverted.

use bevy::math::DVec3;

use super::block::{Factor, Symmetric};
use super::system::System;
use super::topology::Topology;

/// The error that is left, as a part of the solution, both measured as energies (‖e‖² = eᵀHe).
const TOLERANCE: f64 = 1e-2;

/// The error is estimated by what the last so many rounds have gained
/// (Strakoš and Tichý, *ETNA* 13, 56, 2002).
const LOOK_BACK: usize = 8;

/// The most rounds.
const MOST_ROUNDS: usize = 1000;

/// Vectors of the iteration, by core node.
#[derive(Debug, Clone, Default)]
pub(super) struct ConjugateGradient {
    own: Vec<Symmetric>,
    factors: Vec<Factor>,
    residual: Vec<DVec3>,
    direction: Vec<DVec3>,
    product: Vec<DVec3>,
    preconditioned: Vec<DVec3>,
    /// Rounds of the last solution.
    pub rounds: usize,
}

impl ConjugateGradient {
    /// Solves for the steps of the core, which it takes as a first guess.
    pub fn solve(&mut self, system: &mut System, topology: &Topology) {
        let nodes = topology.trees..topology.free;
        self.rounds = 0;
        if nodes.is_empty() {
            return;
        }
        self.begin(system, topology);
        let step = &mut system.step[nodes];
        step.fill(DVec3::ZERO);
        let mut steepness = dot(&self.residual, &self.preconditioned);
        let mut gained = [0.0; LOOK_BACK];
        let mut total_gain = 0.0;
        for round in 0..MOST_ROUNDS {
            if steepness <= 0.0 {
                break;
            }
            self.rounds += 1;
            multiply(&self.own, &system.couplings, topology, &self.direction, &mut self.product);
            let length = steepness / dot(&self.direction, &self.product);
            let gain = length * steepness;
            for (step, direction) in step.iter_mut().zip(&self.direction) {
                *step += *direction * length;
            }
            for (residual, product) in self.residual.iter_mut().zip(&self.product) {
                *residual -= *product * length;
            }
            total_gain += gain;
            gained[round % LOOK_BACK] = gain;
            if round + 1 >= LOOK_BACK && gained.iter().sum::<f64>() <= TOLERANCE * TOLERANCE * total_gain {
                break;
            }
            self.precondition();
            let new_steepness = dot(&self.residual, &self.preconditioned);
            let conjugation = new_steepness / steepness;
            steepness = new_steepness;
            for (direction, preconditioned) in self.direction.iter_mut().zip(&self.preconditioned) {
                *direction = *preconditioned + *direction * conjugation;
            }
        }
    }

    fn begin(&mut self, system: &System, topology: &Topology) {
        let nodes = topology.trees..topology.free;
        self.own.clear();
        self.own.extend(
            system.diagonal[nodes.clone()]
                .iter()
                .zip(&system.inertia[nodes.clone()])
                .map(|(own, inertia)| own.plus_diagonal(*inertia)),
        );
        self.factors.clear();
        let mut whole = self.own.clone();
        for (coupling, ends) in core_couplings(system, topology) {
            let block = coupling.block();
            for end in ends {
                whole[end] += block;
            }
        }
        self.factors.extend(
            whole.iter().zip(&system.inertia[nodes.clone()]).map(|(block, inertia)| block.factor(*inertia)),
        );
        self.residual.clear();
        self.residual.extend_from_slice(&system.right[nodes]);
        self.product.resize(self.residual.len(), DVec3::ZERO);
        self.preconditioned.resize(self.residual.len(), DVec3::ZERO);
        self.precondition();
        self.direction.clone_from(&self.preconditioned);
    }

    fn precondition(&mut self) {
        let residual = self.residual.iter().zip(&self.factors);
        for (preconditioned, (residual, factor)) in self.preconditioned.iter_mut().zip(residual) {
            *preconditioned = factor.solve(*residual);
        }
    }
}

/// The couplings between two nodes of the core, these numbered from 0.
fn core_couplings<'a>(
    system: &'a System,
    topology: &'a Topology,
) -> impl Iterator<Item = (&'a super::system::Coupling, [usize; 2])> + 'a {
    let ends = &topology.ends[topology.tree_springs()..];
    system
        .couplings
        .iter()
        .zip(ends)
        .filter(|(_, ends)| (ends[1] as usize) < topology.free)
        .map(|(coupling, ends)| (coupling, ends.map(|end| end as usize - topology.trees)))
}

/// `product` = matrix · `vector`.
fn multiply(
    own: &[Symmetric],
    couplings: &[super::system::Coupling],
    topology: &Topology,
    vector: &[DVec3],
    product: &mut [DVec3],
) {
    for ((product, own), vector) in product.iter_mut().zip(own).zip(vector) {
        *product = own.times(*vector);
    }
    for (coupling, ends) in couplings.iter().zip(&topology.ends[topology.tree_springs()..]) {
        if ends[1] as usize >= topology.free {
            continue;
        }
        let [first, second] = ends.map(|end| end as usize - topology.trees);
        let force = coupling.times(vector[first] - vector[second]);
        product[first] += force;
        product[second] -= force;
    }
}

fn dot(one: &[DVec3], other: &[DVec3]) -> f64 {
    one.iter().zip(other).map(|(one, other)| one.dot(*other)).sum()
}
