//! The classical Runge–Kutta method. Fourth order, four evaluations of the forces.
//!
//! Kutta, *Z. Math. Phys.* 46, 435 (1901). With y = (x, v) and y' = f(y) = (v, a(x, v)):
//! k1 = f(y), k2 = f(y + h/2 k1), k3 = f(y + h/2 k2), k4 = f(y + h k3),
//! y' = y + h/6 (k1 + 2 k2 + 2 k3 + k4).

use super::{Stage, add_scaled, set_to_sum};

/// For each stage: when it is, in h, its weight in the sum, and how far along its slope the next stage starts, in h.
const STAGES: [(f32, f32, f32); 4] = [(0.0, 1.0, 0.5), (0.5, 2.0, 0.5), (0.5, 2.0, 1.0), (1.0, 1.0, 0.0)];

pub(super) fn advance(stage: &mut Stage, substep: f32) {
    let count = stage.particles.len();
    stage.scratch.position.copy_from(&stage.particles.position);
    stage.scratch.velocity.copy_from(&stage.particles.velocity);
    for slope in [&mut stage.scratch.position_slope, &mut stage.scratch.velocity_slope] {
        slope.resize(0);
        slope.resize(count);
    }
    for (time, weight, reach) in STAGES {
        stage.ramp_to(time);
        stage.evaluate();
        let Stage { particles, acceleration, scratch, .. } = stage;
        if time == 0.0 {
            scratch.start.copy_from(acceleration);
        }
        add_scaled(&mut scratch.position_slope, weight, &particles.velocity);
        add_scaled(&mut scratch.velocity_slope, weight, acceleration);
        // The position of the next stage needs the velocity of this one, so it moves first.
        set_to_sum(&mut particles.position, &scratch.position, reach * substep, &particles.velocity);
        set_to_sum(&mut particles.velocity, &scratch.velocity, reach * substep, acceleration);
    }
    let Stage { particles, scratch, .. } = stage;
    set_to_sum(&mut particles.position, &scratch.position, substep / 6.0, &scratch.position_slope);
    set_to_sum(&mut particles.velocity, &scratch.velocity, substep / 6.0, &scratch.velocity_slope);
}
