//! Explicit (forward) Euler: x' = x + h v, v' = v + h a(x, v). First order.
//!
//! Its energy grows by the factor 1 + h²ω² a step for an undamped oscillation of frequency ω: it is
//! here to be compared with.

use super::super::SolverState;
use super::super::forces::{self, Field};
use super::add_scaled;

pub(super) fn advance(state: &mut SolverState, field: Field, substep: f32) {
    let SolverState { particles, springs, .. } = state;
    forces::evaluate(particles, springs, field);
    add_scaled(&mut particles.position, substep, &particles.velocity);
    add_scaled(&mut particles.velocity, substep, &particles.acceleration);
}
