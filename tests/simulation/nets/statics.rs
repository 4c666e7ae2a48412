//! The linear statics of a topology, in f64: small displacements under forces, by conjugate gradients.

use bevy::math::{DMat3, DVec3};
use bevy_mass_spring::nets::Topology;

/// A term ½ k ‖P Σ cᵢ uᵢ‖² of the energy, with a projection P.
struct Term {
    ends: Vec<usize>,
    weights: Vec<f64>,
    stiffness: DMat3,
}

/// The net in equilibrium at rest, linearised there.
pub struct Statics {
    terms: Vec<Term>,
    pub positions: Vec<DVec3>,
    pub forces: Vec<DVec3>,
    /// 1 along the axes in which a particle is free, 0 in those in which it is held.
    pub free: Vec<DVec3>,
}

fn outer(direction: DVec3) -> DMat3 {
    DMat3::from_cols(direction * direction.x, direction * direction.y, direction * direction.z)
}

impl Statics {
    pub fn new(net: &Topology) -> Self {
        let positions: Vec<DVec3> = net.positions.iter().map(|place| place.as_dvec3()).collect();
        let mut terms = Vec::new();
        for (ends, spring) in &net.springs {
            let ends = ends.map(|end| end as usize);
            let direction = (positions[ends[0]] - positions[ends[1]]).normalize();
            let stiffness = outer(direction) * f64::from(spring.stiffness);
            terms.push(Term { ends: ends.to_vec(), weights: vec![1.0, -1.0], stiffness });
        }
        let rods = net.rods.iter().map(|(ends, bend)| (&ends[..], &bend.weights[..], bend.stiffness));
        let hinges = net.hinges.iter().map(|(ends, bend)| (&ends[..], &bend.weights[..], bend.stiffness));
        for (ends, weights, stiffness) in rods.chain(hinges) {
            terms.push(Term {
                ends: ends.iter().map(|end| *end as usize).collect(),
                weights: weights.iter().map(|weight| f64::from(*weight)).collect(),
                stiffness: DMat3::IDENTITY * f64::from(stiffness),
            });
        }
        let count = positions.len();
        Self { terms, positions, forces: vec![DVec3::ZERO; count], free: vec![DVec3::ONE; count] }
    }

    fn apply(&self, displacements: &[DVec3]) -> Vec<DVec3> {
        let mut forces = vec![DVec3::ZERO; displacements.len()];
        for term in &self.terms {
            let parts = term.ends.iter().zip(&term.weights);
            let separation: DVec3 = parts.clone().map(|(end, weight)| displacements[*end] * *weight).sum();
            let pull = term.stiffness * separation;
            for (end, weight) in parts {
                forces[*end] += pull * *weight;
            }
        }
        forces.iter().zip(&self.free).map(|(force, free)| *force * *free).collect()
    }

    /// The energy of displacements.
    pub fn energy(&self, displacements: &[DVec3]) -> f64 {
        let of_term = |term: &Term| {
            let parts = term.ends.iter().zip(&term.weights);
            let separation: DVec3 = parts.map(|(end, weight)| displacements[*end] * *weight).sum();
            0.5 * separation.dot(term.stiffness * separation)
        };
        self.terms.iter().map(of_term).sum()
    }

    /// The displacements under the forces, to a residual of 3e-7 of them. Of a net that nothing holds these
    /// must balance.
    pub fn solve(&self) -> Vec<DVec3> {
        let count = self.positions.len();
        let mut diagonal = vec![DVec3::ZERO; count];
        for term in &self.terms {
            let along = DVec3::from_array([0, 1, 2].map(|axis| term.stiffness.col(axis)[axis]));
            for (end, weight) in term.ends.iter().zip(&term.weights) {
                diagonal[*end] += along * *weight * *weight;
            }
        }
        let inverse: Vec<DVec3> = diagonal
            .iter()
            .map(|d| DVec3::from_array(d.to_array().map(|d| if d > 0.0 { 1.0 / d } else { 1.0 })))
            .collect();
        let dot = |a: &[DVec3], b: &[DVec3]| -> f64 { a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum() };
        let scaled = |residual: &[DVec3]| -> Vec<DVec3> {
            residual.iter().zip(&inverse).map(|(residual, inverse)| *residual * *inverse).collect()
        };
        let mut residual: Vec<DVec3> =
            self.forces.iter().zip(&self.free).map(|(force, free)| *force * *free).collect();
        let start = dot(&residual, &residual);
        let mut solution = vec![DVec3::ZERO; count];
        let mut step = scaled(&residual);
        let mut rho = dot(&residual, &step);
        for _ in 0..200_000 {
            if dot(&residual, &residual) <= 1e-13 * start {
                return solution;
            }
            let applied = self.apply(&step);
            let length = rho / dot(&step, &applied);
            for slot in 0..count {
                solution[slot] += step[slot] * length;
                residual[slot] -= applied[slot] * length;
            }
            let next = scaled(&residual);
            let new = dot(&residual, &next);
            for slot in 0..count {
                step[slot] = next[slot] + step[slot] * (new / rho);
            }
            rho = new;
        }
        panic!("no equilibrium: residual {}", (dot(&residual, &residual) / start).sqrt());
    }
}

/// The mean strain of a body whose surface has the area vectors `areas`, and the volume (or area) `volume`:
/// ½ Σ (u ⊗ a + a ⊗ u) / V, the divergence theorem.
pub fn mean_strain(displacements: &[DVec3], areas: &[DVec3], volume: f64) -> DMat3 {
    let mut sum = DMat3::ZERO;
    for (displacement, area) in displacements.iter().zip(areas) {
        let product =
            DMat3::from_cols(*displacement * area.x, *displacement * area.y, *displacement * area.z);
        sum += product + product.transpose();
    }
    sum * (0.5 / volume)
}

/// A uniaxial stress along a unit vector.
pub fn uniaxial(stress: f64, direction: DVec3) -> DMat3 {
    outer(direction) * stress
}
