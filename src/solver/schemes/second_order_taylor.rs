//! Second-order Taylor expansion: x' = x + h v + h²/2 a, v' = v + h a(x, v).
//!
//! Exact for constant acceleration (free fall). Elsewhere the velocity is only first-order accurate,
//! and so, over many steps, is the position.

use super::Stage;

pub(super) fn advance(stage: &mut Stage, substep: f32) {
    stage.evaluate();
    let half_square = 0.5 * substep * substep;
    let particles = &mut stage.particles;
    let axes = particles.position.axes_mut().into_iter().zip(particles.velocity.axes_mut());
    for ((position, velocity), acceleration) in axes.zip(stage.acceleration.axes()) {
        for ((position, velocity), acceleration) in position.iter_mut().zip(velocity).zip(acceleration) {
            *position += substep * *velocity + half_square * acceleration;
            *velocity += substep * acceleration;
        }
    }
}
