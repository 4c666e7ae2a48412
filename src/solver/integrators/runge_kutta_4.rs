//! The classical Runge–Kutta method. Fourth order, four evaluations of the forces.
//!
//! Kutta, *Z. Math. Phys.* 46, 435 (1901). With y = (x, v) and y' = f(y) = (v, a(x, v)):
//! k1 = f(y), k2 = f(y + h/2 k1), k3 = f(y + h/2 k2), k4 = f(y + h k3),
//! y' = y + h/6 (k1 + 2 k2 + 2 k3 + k4).

use super::super::SolverState;
use super::super::forces::{self, Field};
use super::{add_scaled, set_to_sum};

/// For each stage: its weight in the sum, and how far along its slope the next stage starts, in h.
const STAGES: [(f32, f32); 4] = [(1.0, 0.5), (2.0, 0.5), (2.0, 1.0), (1.0, 0.0)];

pub(super) fn advance(state: &mut SolverState, field: Field, substep: f32) {
    let SolverState { particles, springs, scratch, .. } = state;
    scratch.position.copy_from(&particles.position);
    scratch.velocity.copy_from(&particles.velocity);
    scratch.position_slope.resize(0);
    scratch.position_slope.resize(particles.len());
    scratch.velocity_slope.resize(0);
    scratch.velocity_slope.resize(particles.len());

    for (weight, reach) in STAGES {
        forces::evaluate(particles, springs, field);
        add_scaled(&mut scratch.position_slope, weight, &particles.velocity);
        add_scaled(&mut scratch.velocity_slope, weight, &particles.acceleration);
        // The position of the next stage needs the velocity of this one, so it moves first.
        set_to_sum(&mut particles.position, &scratch.position, reach * substep, &particles.velocity);
        set_to_sum(&mut particles.velocity, &scratch.velocity, reach * substep, &particles.acceleration);
    }
    set_to_sum(&mut particles.position, &scratch.position, substep / 6.0, &scratch.position_slope);
    set_to_sum(&mut particles.velocity, &scratch.velocity, substep / 6.0, &scratch.velocity_slope);
}
