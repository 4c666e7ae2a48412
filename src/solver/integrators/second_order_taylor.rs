//! Second-order Taylor expansion: x' = x + h v + h²/2 a, v' = v + h a(x, v).
//!
//! Exact for constant acceleration (free fall). Elsewhere the velocity is only first-order accurate,
//! and so, over many steps, is the position.

use super::super::SolverState;
use super::super::forces::{self, Field};

pub(super) fn advance(state: &mut SolverState, field: Field, substep: f32) {
    let SolverState { particles, springs, .. } = state;
    forces::evaluate(particles, springs, field);
    let half_square = 0.5 * substep * substep;
    let (positions, velocities) = (particles.position.axes_mut(), particles.velocity.axes_mut());
    for ((position, velocity), acceleration) in
        positions.into_iter().zip(velocities).zip(particles.acceleration.axes())
    {
        for ((position, velocity), acceleration) in position.iter_mut().zip(velocity).zip(acceleration) {
            *position += substep * *velocity + half_square * acceleration;
            *velocity += substep * acceleration;
        }
    }
}
