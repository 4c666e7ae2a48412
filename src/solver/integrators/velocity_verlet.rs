//! Velocity Verlet: x' = x + h v + h²/2 a, v' = v + h/2 (a + a(x', v + h a)). Second order.
//!
//! Swope et al., *J. Chem. Phys.* 76, 637 (1982). The forces here depend on the velocity, so the
//! second evaluation takes the predicted velocity v + h a, which keeps the second order with damping
//! and is the original scheme without.

use super::super::SolverState;
use super::super::forces::{self, Field};
use super::add_scaled;

pub(super) fn advance(state: &mut SolverState, field: Field, substep: f32) {
    let SolverState { particles, springs, scratch, .. } = state;
    forces::evaluate(particles, springs, field);
    let old_acceleration = &mut scratch.velocity_slope;
    old_acceleration.copy_from(&particles.acceleration);

    add_scaled(&mut particles.position, substep, &particles.velocity);
    add_scaled(&mut particles.position, 0.5 * substep * substep, old_acceleration);

    let old_velocity = &mut scratch.velocity;
    old_velocity.copy_from(&particles.velocity);
    add_scaled(&mut particles.velocity, substep, old_acceleration);
    forces::evaluate(particles, springs, field);

    particles.velocity.copy_from(old_velocity);
    add_scaled(&mut particles.velocity, 0.5 * substep, old_acceleration);
    add_scaled(&mut particles.velocity, 0.5 * substep, &particles.acceleration);
}
