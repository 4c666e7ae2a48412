//! Velocity Verlet: x' = x + h v + h²/2 a, v' = v + h/2 (a + a'), with a' = a(x', v + h a). Second order.
//!
//! Swope et al., *J. Chem. Phys.* 76, 637 (1982). The forces here depend on the velocity, so they are
//! evaluated at the predicted velocity v + h a (Groot and Warren, *J. Chem. Phys.* 107, 4423, 1997, with
//! λ = 1), which keeps the second order with damping and is the original scheme without. The a of a substep
//! is the a' of the one before, so that each costs one evaluation; the first of a tick takes a(x, v).

use super::{Stage, verlet_in_air};
use crate::solver::kernel::{self, Accelerate, Correct, Motion, Predict};
use crate::solver::parallel;
use crate::solver::particles::Vectors;

/// What the last substep has left for the next one, besides the state.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) enum Carried {
    /// Nothing: a tick begins.
    #[default]
    Nothing,
    /// Accelerations, but contacts have moved some particles since.
    Disturbed,
    /// The accelerations a'.
    Accelerations,
}

impl Carried {
    /// Contacts have moved particles.
    pub fn disturb(&mut self) {
        if *self == Self::Accelerations {
            *self = Self::Disturbed;
        }
    }
}

pub(super) fn advance(stage: &mut Stage, substep: f32) {
    if let Some(air) = stage.field.air {
        return verlet_in_air::advance(stage, air, substep);
    }
    if stage.scratch.carried == Carried::Nothing {
        stage.evaluate();
    }
    let Stage { particles, blocks, elements, field, acceleration, scratch, gas, .. } = stage;
    let (other_velocity, other_acceleration) = (&mut scratch.velocity, &mut scratch.velocity_slope);
    other_velocity.resize(particles.len());
    other_acceleration.resize(particles.len());
    if scratch.carried == Carried::Disturbed {
        restore_predicted(other_velocity, &particles.velocity, [other_acceleration, acceleration], substep);
        let motion = Motion::at(&particles.position, other_velocity, particles);
        let field = gas.evaluate(elements.gases(), &particles.position, *field);
        kernel::evaluate(motion, blocks, field, acceleration);
    }
    let is_shared = blocks.are_worth_sharing();

    let (position, velocity) = (&mut particles.position, &mut particles.velocity);
    let moved = blocks.split(position.axes_mut()).zip(blocks.split(velocity.axes_mut()));
    let parts = moved.zip(blocks.split(acceleration.axes_mut()));
    parallel::for_each(parts, is_shared, |((position, velocity), acceleration)| {
        let acceleration = acceleration.map(|axis| &*axis);
        kernel::run(Predict { position, velocity, acceleration, substep });
    });

    // The next substep may have to evaluate a' again, with the pinned where they are then, to the bit.
    stage.pinned.apply(stage.particles);
    stage.ramp_to(1.0);
    let Stage { particles, blocks, elements, field, acceleration, scratch, gas, .. } = stage;
    let (other_velocity, other_acceleration) = (&mut scratch.velocity, &mut scratch.velocity_slope);
    let field = gas.evaluate(elements.gases(), &particles.position, *field);
    let motion = Motion::of(particles);
    let written = blocks.split(other_acceleration.axes_mut()).zip(blocks.split(other_velocity.axes_mut()));
    let parts = blocks.blocks.iter().zip(blocks.split(acceleration.axes_mut())).zip(written);
    parallel::for_each(parts, is_shared, |((block, predicted_acceleration), (acceleration, velocity))| {
        let predicted_acceleration = predicted_acceleration.map(|axis| &*axis);
        let accelerate = Accelerate { block, motion: &motion, field: &field, acceleration };
        kernel::run(Correct { accelerate, predicted_acceleration, substep, velocity });
    });
    std::mem::swap(&mut particles.velocity, other_velocity);
    std::mem::swap(*acceleration, other_acceleration);
    scratch.carried = Carried::Accelerations;
}

/// Makes `predicted` what it would have been if the disturbed particles had come with their present
/// `velocity`. All others, whose velocity is still the corrected one, keep theirs: then their next
/// accelerations are the same to the bit, whatever touched each other elsewhere.
fn restore_predicted(
    predicted: &mut Vectors,
    velocity: &Vectors,
    [predicted_acceleration, acceleration]: [&Vectors; 2],
    substep: f32,
) {
    let half = 0.5 * substep;
    let accelerations = predicted_acceleration.axes().into_iter().zip(acceleration.axes());
    let axes = predicted.axes_mut().into_iter().zip(velocity.axes()).zip(accelerations);
    for ((predicted, velocity), (predicted_acceleration, acceleration)) in axes {
        for slot in 0..velocity.len() {
            let corrected = predicted[slot] + half * (acceleration[slot] - predicted_acceleration[slot]);
            predicted[slot] = if velocity[slot] == corrected { predicted[slot] } else { velocity[slot] };
        }
    }
}
