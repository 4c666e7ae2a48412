//! Semi-implicit (symplectic) Euler: v' = v + h a(x, v), x' = x + h v'. First order.
//!
//! Symplectic: without damping it conserves an energy that differs from the true one by O(h)
//! (Hairer, Lubich and Wanner, *Geometric Numerical Integration*, 2006, I.1.2), at the cost of the
//! explicit scheme.

use super::super::SolverState;
use super::super::forces::{self, Field};

pub(super) fn advance(state: &mut SolverState, field: Field, substep: f32) {
    let SolverState { particles, springs, .. } = state;
    forces::evaluate(particles, springs, field);
    let (positions, velocities) = (particles.position.axes_mut(), particles.velocity.axes_mut());
    for ((position, velocity), acceleration) in
        positions.into_iter().zip(velocities).zip(particles.acceleration.axes())
    {
        for ((position, velocity), acceleration) in position.iter_mut().zip(velocity).zip(acceleration) {
            *velocity += substep * acceleration;
            *position += substep * *velocity;
        }
    }
}
