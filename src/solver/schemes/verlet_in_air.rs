//! Velocity Verlet where the air blows: with a without air, and f(a, v) = (a + (b − d v)/m) / (1 + h d/m),
//!
//! ```text
//! x' = x + h v + h²/2 f(a, v)
//! v' = v + h/2 (f(a, v) + f(a', w))      w = v + h f(a, v),  a' = a(x', w)
//! ```
//!
//! The a' of a substep is the a of the next one; b and d are those of its own start. That is the scheme with the masses
//! m + h d, so that its limit h²K + 4 h C < 4 M is what it is in vacuum: air adds 4 h d to either side. Without other
//! forces v' = v (1 + y²)/2 with y = 1/(1 + h d/m), relative to the air: it never gains speed.

use super::velocity_verlet::{self, Carried};
use super::{Stage, StepVectors};
use crate::solver::field::{AirLoad, Field};
use crate::solver::kernel::{self, Accelerate, CorrectInAir, Motion, PredictInAir};
use crate::solver::parallel;
use crate::solver::particles::Vectors as Arrays;

/// What it keeps besides what the scheme in vacuum does.
#[derive(Debug, Clone, Default)]
pub(super) struct Vectors {
    /// a, m/s².
    vacuum: Arrays,
    /// The velocities v' of the last substep, m/s.
    corrected: Arrays,
}

pub(super) fn advance(stage: &mut Stage, air: &AirLoad, substep: f32) {
    let field = Field { air: None, ..stage.field };
    if matches!(stage.scratch.carried, Carried::Disturbed | Carried::Outdated) {
        evaluate_again(stage, air, substep);
    }
    let Stage { particles, blocks, elements, acceleration, scratch, gas, .. } = stage;
    let Vectors { vacuum, .. } = &mut scratch.air;
    vacuum.resize(particles.len());
    scratch.velocity.resize(particles.len());
    if scratch.carried == Carried::Nothing {
        let field = gas.evaluate(elements.gases(), &particles.position, field);
        kernel::evaluate(Motion::of(particles), blocks, field, vacuum);
    }
    let is_shared = blocks.are_worth_sharing();

    let (position, velocity) = (&mut particles.position, &mut particles.velocity);
    let moved = blocks.split(position.axes_mut()).zip(blocks.split(velocity.axes_mut()));
    let written = moved.zip(blocks.split(acceleration.axes_mut()));
    let parts = blocks.blocks.iter().zip(blocks.split(vacuum.axes_mut())).zip(written);
    parallel::for_each(parts, is_shared, |((block, vacuum), ((position, velocity), acceleration))| {
        let (start, vacuum) = (block.slots.start, vacuum.map(|axis| &*axis));
        kernel::run(PredictInAir { air, start, position, velocity, vacuum, acceleration, substep });
    });

    // The next substep may have to evaluate a' again, with the pinned where they are then, to the bit.
    stage.pinned.apply(stage.particles);
    stage.ramp_to(1.0);
    let Stage { particles, blocks, elements, acceleration, scratch, gas, .. } = stage;
    let Vectors { vacuum, corrected } = &mut scratch.air;
    let predicted = &mut scratch.velocity;
    let field = gas.evaluate(elements.gases(), &particles.position, field);
    let motion = Motion::of(particles);
    let written = blocks.split(acceleration.axes_mut()).zip(blocks.split(predicted.axes_mut()));
    let parts = blocks.blocks.iter().zip(blocks.split(vacuum.axes_mut())).zip(written);
    parallel::for_each(parts, is_shared, |((block, vacuum), (acceleration, velocity))| {
        let accelerate = Accelerate { block, motion: &motion, field: &field, acceleration: vacuum };
        kernel::run(CorrectInAir { accelerate, air, acceleration, substep, velocity });
    });
    std::mem::swap(&mut particles.velocity, predicted);
    corrected.copy_from(&particles.velocity);
    scratch.carried = Carried::Accelerations;
}

/// What [`velocity_verlet`](super::velocity_verlet::evaluate_again) does: here v' depends on a' by h/2 a' / (1 + h d/m).
pub(super) fn evaluate_again(stage: &mut Stage, air: &AirLoad, substep: f32) {
    let field = Field { air: None, ..stage.field };
    let Stage { particles, blocks, elements, scratch, gas, .. } = stage;
    let StepVectors {
        velocity: predicted,
        velocity_slope: again,
        air: Vectors { vacuum, corrected },
        carried,
        ..
    } = &mut **scratch;
    restore_predicted(predicted, &particles.velocity, corrected);
    again.resize(particles.len());
    let motion = Motion::at(&particles.position, predicted, particles);
    let field = gas.evaluate(elements.gases(), &particles.position, field);
    kernel::evaluate(motion, blocks, field, again);
    if *carried == Carried::Disturbed {
        let share = |slot: usize| 0.5 * substep * air.gain[slot];
        velocity_verlet::correct(&mut particles.velocity, blocks, [vacuum, again], share);
    }
    std::mem::swap(vacuum, again);
    *carried = Carried::Accelerations;
}

/// What [`velocity_verlet`](super::velocity_verlet) does for the same purpose, with the velocities v' at hand.
fn restore_predicted(predicted: &mut Arrays, velocity: &Arrays, corrected: &Arrays) {
    let axes = predicted.axes_mut().into_iter().zip(velocity.axes()).zip(corrected.axes());
    for ((predicted, velocity), corrected) in axes {
        for ((predicted, velocity), corrected) in predicted.iter_mut().zip(velocity).zip(corrected) {
            *predicted = if velocity == corrected { *predicted } else { *velocity };
        }
    }
}
