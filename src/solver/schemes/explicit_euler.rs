//! Explicit (forward) Euler: x' = x + h v, v' = v + h a(x, v). First order.
//!
//! Its energy grows by the factor 1 + h²ω² a step for an undamped oscillation of frequency ω: it is
//! here to be compared with.

use super::{Stage, add_scaled};

pub(super) fn advance(stage: &mut Stage, substep: f32) {
    stage.evaluate();
    let Stage { particles, acceleration, .. } = stage;
    add_scaled(&mut particles.position, substep, &particles.velocity);
    add_scaled(&mut particles.velocity, substep, acceleration);
}
