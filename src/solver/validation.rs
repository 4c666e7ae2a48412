//! Checks of what is given to the solver.

use crate::solver::api::SolverError;
use crate::solver::elements::{Bend, Plasticity, Spring};

/// The inverse of a mass, 1/kg.
pub(super) fn inverse(mass: f32) -> Result<f32, SolverError> {
    let inverse = 1.0 / mass;
    match mass > 0.0 && inverse.is_finite() {
        true => Ok(inverse),
        false => Err(SolverError::OutOfRange {
            field: "mass",
            value: mass,
            expected: "a number > 0 with a finite inverse",
        }),
    }
}

/// Names the parameter of a spring that is out of its range.
pub(super) fn check(spring: Spring) -> Result<(), SolverError> {
    non_negative("rest_length", spring.rest_length)?;
    non_negative("stiffness", spring.stiffness)?;
    non_negative("damping", spring.damping)?;
    spring.max_stretch.map_or(Ok(()), |limit| non_negative("max_stretch", limit))?;
    spring.breaking_force.map_or(Ok(()), |limit| non_negative("breaking_force", limit))?;
    let Some(Plasticity { yield_strain, max_strain, strain }) = spring.plasticity else { return Ok(()) };
    non_negative("yield_strain", yield_strain)?;
    non_negative("max_strain", max_strain)?;
    match strain.is_finite() && strain >= -1.0 {
        true => Ok(()),
        false => {
            let expected = "a finite number >= -1";
            Err(SolverError::OutOfRange { field: "strain", value: strain, expected })
        }
    }
}

/// Weights of up to four ends, each rounded to a part in 2^24 of the largest.
pub(super) fn check_bend<const N: usize>(bend: &Bend<N>) -> Result<(), SolverError> {
    non_negative("rest_length", bend.rest_length)?;
    non_negative("stiffness", bend.stiffness)?;
    non_negative("damping", bend.damping)?;
    let sum: f32 = bend.weights.iter().sum();
    let largest = bend.weights.iter().fold(0.0_f32, |largest, weight| largest.max(weight.abs()));
    match sum.abs() <= 1e-6 * largest {
        true => Ok(()),
        false => Err(SolverError::OutOfRange { field: "sum of weights", value: sum, expected: "0" }),
    }
}

pub(super) fn non_negative(field: &'static str, value: f32) -> Result<(), SolverError> {
    match value.is_finite() && value >= 0.0 {
        true => Ok(()),
        false => Err(SolverError::OutOfRange { field, value, expected: "a finite number >= 0" }),
    }
}
