//! The classical Runge–Kutta method. Fourth order, four evaluations of the forces.
//!
//! Kutta, *Z. Math. Phys.* 46, 435 (1901). With y = (x, v) and y' = f(y) = (v, a(x, v)):
//! k1 = f(y), k2 = f(y + h/2 k1), k3 = f(y + h/2 k2), k4 = f(y + h k3),
//! y' = y + h/6 (k1 + 2 k2 + 2 k3 + k4).
//!
//! Contacts come after the substep. What bears a load has sunk in the later stages, by up to h²/2 a, and is put back: what it
//! bears would rest on springs that are squeezed by h² k / 6 m too much. So what contacts gave a particle in the substep before,
//! the acceleration b, holds it in the stages of this one, as far as it is pressed that way:
//!
//! ```text
//! a held = a + min(‖b‖, max(0, −a · n)) n      with n = b / ‖b‖
//! ```
//!
//! It says only where forces are evaluated: y' has the sum of the a, so contacts find the same load, and momentum is kept. What
//! nothing touches moves to the bit as without. The b of the last substep of a tick is a part of the state.

use bevy::math::Vec3;

use super::velocity_verlet::Carried;
use super::{Stage, StepVectors, add_scaled, set_to_sum};
use crate::solver::particles::Vectors;
use crate::solver::pulls::Pulls;

/// For each stage: when it is, in h, its weight in the sum, and how far along its slope the next stage starts, in h.
const STAGES: [(f32, f32, f32); 4] = [(0.0, 1.0, 0.5), (0.5, 2.0, 0.5), (0.5, 2.0, 1.0), (1.0, 1.0, 0.0)];

pub(super) fn advance(stage: &mut Stage, pulls: &Pulls, substep: f32) {
    if stage.scratch.carried == Carried::Nothing {
        stage.scratch.held.copy_from(pulls.held());
    } else {
        find_held(stage, substep);
    }
    stage.scratch.position.copy_from(&stage.particles.position);
    stage.scratch.velocity.copy_from(&stage.particles.velocity);
    let count = stage.particles.len();
    for slope in [&mut stage.scratch.position_slope, &mut stage.scratch.velocity_slope] {
        slope.resize(0);
        slope.resize(count);
    }
    for (time, weight, reach) in STAGES {
        stage.ramp_to(time);
        stage.evaluate();
        let Stage { particles, acceleration, scratch, .. } = stage;
        add_scaled(&mut scratch.position_slope, weight, &particles.velocity);
        add_scaled(&mut scratch.velocity_slope, weight, acceleration);
        hold(acceleration, &scratch.held);
        // The position of the next stage needs the velocity of this one, so it moves first.
        set_to_sum(&mut particles.position, &scratch.position, reach * substep, &particles.velocity);
        set_to_sum(&mut particles.velocity, &scratch.velocity, reach * substep, acceleration);
    }
    let Stage { particles, scratch, .. } = stage;
    set_to_sum(&mut particles.position, &scratch.position, substep / 6.0, &scratch.position_slope);
    set_to_sum(&mut particles.velocity, &scratch.velocity, substep / 6.0, &scratch.velocity_slope);
    scratch.carried = Carried::Accelerations;
}

/// After the last substep of a tick, of `substep` seconds, and its contacts: leaves the b of all particles for the next one.
pub(super) fn end_tick(stage: &mut Stage, pulls: &mut Pulls, substep: f32) {
    find_held(stage, substep);
    pulls.set_held(&stage.scratch.held);
}

/// Removes the part of each acceleration that presses a particle against what holds it.
fn hold(acceleration: &mut Vectors, held: &Vectors) {
    for slot in 0..held.len().min(acceleration.len()) {
        let limit = held.get(slot).length();
        if limit > 0.0 {
            let (normal, own) = (held.get(slot) / limit, acceleration.get(slot));
            acceleration.set(slot, own + normal * (-own.dot(normal)).clamp(0.0, limit));
        }
    }
}

/// Finds the b of all particles, as contacts, or what else acts between substeps, have changed their velocities since the last one.
fn find_held(stage: &mut Stage, substep: f32) {
    let Stage { particles, scratch, .. } = stage;
    let StepVectors { position_slope: unheld, velocity, velocity_slope, held, carried, .. } = &mut **scratch;
    if matches!(carried, Carried::Nothing | Carried::Accelerations) {
        held.resize(0);
        return;
    }
    set_to_sum(unheld, velocity, substep / 6.0, velocity_slope);
    held.resize(particles.len());
    for (slot, inverse_mass) in particles.inverse_mass().iter().enumerate() {
        let change = particles.velocity.get(slot) - unheld.get(slot);
        held.set(slot, if *inverse_mass > 0.0 { change / substep } else { Vec3::ZERO });
    }
}
