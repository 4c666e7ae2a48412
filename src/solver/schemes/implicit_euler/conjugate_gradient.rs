//! The core's linear system, by preconditioned conjugate gradients.
//!
//! Hestenes and Stiefel, *J. Res. Nat. Bur. Stand.* 49, 409 (1952).

use super::core::{Core, get, set};
use super::preconditioner::Preconditioner;
use super::system::System;
use crate::solver::graph::Elimination;

/// The error that is left of a Newton step, as a part of it, both measured as energies (‖e‖² = eᵀHe).
pub(super) const STEP_TOLERANCE: f64 = 0.1;

/// The same where edges and faces touch something curved: which of many contacts hold follows from distances that are far below the
/// others in the step.
pub(super) const FEATURE_TOLERANCE: f64 = 0.03;

/// The same for a rebound, which no further step corrects.
pub(super) const REBOUND_TOLERANCE: f64 = 1e-4;

/// Number of iterations from the gains of which the error is estimated (Strakoš and Tichý, *ETNA* 13, 56, 2002).
const LOOK_BACK: usize = 4;

/// Maximal number of iterations.
const MAX_ITERATIONS: usize = 1000;

/// The iteration's vectors.
#[derive(Debug, Clone, Default)]
pub(super) struct ConjugateGradient {
    core: Core,
    preconditioner: Preconditioner,
    solution: Vec<f64>,
    residual: Vec<f64>,
    direction: Vec<f64>,
    product: Vec<f64>,
    preconditioned: Vec<f64>,
    /// Iterations of the last solution.
    iterations: usize,
}

impl ConjugateGradient {
    /// Solves for the steps of the core, up to an error of `tolerance`.
    pub fn solve(&mut self, system: &mut System, elimination: &Elimination, tolerance: f64) {
        let nodes = elimination.trees..elimination.free;
        self.iterations = 0;
        if nodes.is_empty() {
            return;
        }
        self.preconditioner.fill(system, elimination);
        self.core.fill(system, elimination);
        let vectors = [
            &mut self.solution,
            &mut self.residual,
            &mut self.direction,
            &mut self.product,
            &mut self.preconditioned,
        ];
        for vector in vectors {
            vector.clear();
            vector.resize(3 * nodes.len(), 0.0);
        }
        for (node, right) in system.right[nodes.clone()].iter().enumerate() {
            set(&mut self.residual, node, *right);
        }
        pulp::Arch::new().dispatch(Iteration { vectors: self, elimination, tolerance });
        for (node, step) in system.step[nodes].iter_mut().enumerate() {
            *step = get(&self.solution, node);
        }
    }

    /// The iteration, from the solution 0 and the residual that is the right side.
    #[inline(always)]
    fn iterate(&mut self, elimination: &Elimination, tolerance: f64) {
        let Self { core, preconditioner, solution, residual, direction, product, preconditioned, iterations } =
            self;
        preconditioner.apply(&elimination.hierarchy, residual, preconditioned);
        direction.copy_from_slice(preconditioned);
        let mut steepness = dot(residual, preconditioned);
        let mut gained = [0.0; LOOK_BACK];
        let mut total_gain = 0.0;
        while *iterations < MAX_ITERATIONS && steepness > 0.0 {
            core.multiply(&elimination.runs, direction, product);
            let length = steepness / dot(direction, product);
            add_scaled(solution, length, direction);
            add_scaled(residual, -length, product);
            gained[*iterations % LOOK_BACK] = length * steepness;
            total_gain += length * steepness;
            *iterations += 1;
            let recent: f64 = gained.iter().sum();
            if *iterations >= LOOK_BACK && recent <= tolerance * tolerance * total_gain {
                break;
            }
            preconditioner.apply(&elimination.hierarchy, residual, preconditioned);
            let new_steepness = dot(residual, preconditioned);
            let conjugation = new_steepness / steepness;
            steepness = new_steepness;
            for (direction, preconditioned) in direction.iter_mut().zip(&*preconditioned) {
                *direction = preconditioned + conjugation * *direction;
            }
        }
    }
}

/// The iteration, to be compiled for the processor's vector instructions; these change no bit.
struct Iteration<'a> {
    vectors: &'a mut ConjugateGradient,
    elimination: &'a Elimination,
    tolerance: f64,
}

impl pulp::WithSimd for Iteration<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        self.vectors.iterate(self.elimination, self.tolerance);
    }
}

/// Sums run side by side, always as many, so that the result does not depend on the processor.
const SUMS: usize = 8;

#[inline(always)]
fn dot(one: &[f64], other: &[f64]) -> f64 {
    let mut sums = [0.0; SUMS];
    let (ones, others) = (one.chunks_exact(SUMS), other.chunks_exact(SUMS));
    let rest: f64 = ones.remainder().iter().zip(others.remainder()).map(|(one, other)| one * other).sum();
    for (one, other) in ones.zip(others) {
        for lane in 0..SUMS {
            sums[lane] += one[lane] * other[lane];
        }
    }
    sums.iter().sum::<f64>() + rest
}

#[inline(always)]
fn add_scaled(values: &mut [f64], factor: f64, slopes: &[f64]) {
    for (value, slope) in values.iter_mut().zip(slopes) {
        *value += factor * slope;
    }
}
