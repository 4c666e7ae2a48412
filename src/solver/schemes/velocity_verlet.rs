//! Velocity Verlet: x' = x + h v + h²/2 a, v' = v + h/2 (a + a'), with a' = a(x', v + h a). Second order.
//!
//! Swope et al., *J. Chem. Phys.* 76, 637 (1982). The forces here depend on the velocity, so they are
//! evaluated at the predicted velocity v + h a (Groot and Warren, *J. Chem. Phys.* 107, 4423, 1997, with
//! λ = 1), which keeps the second order with damping and is the original scheme without. The a of a substep
//! is the a' of the one before, so that each costs one evaluation; the first of a tick takes a(x, v).
//!
//! Contacts come after the substep. What bears a load has sunk by h²/2 a by then, where a' was evaluated, and is put back: what
//! it bears would rest on springs that are squeezed by h² k / 2 m too much, nearly twice what they should at the limit of
//! stability. So a' is evaluated once more where contacts have left the particles, and all velocities change by h/2 of the
//! difference: v' = v + h/2 (a + a'), with the a' that the next substep begins with. This keeps momentum, as a' does.

use super::{Stage, StepVectors, closed, verlet_in_air};
use crate::solver::field::Field;
use crate::solver::graph::Blocks;
use crate::solver::kernel::{self, Accelerate, Correct, Motion, Predict, Substeps, VerletInPlace};
use crate::solver::parallel;
use crate::solver::particles::{Particles, Vectors};

/// What the last substep has left for the next one, besides the state.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) enum Carried {
    /// Nothing: a tick begins.
    #[default]
    Nothing,
    /// Accelerations, but contacts have moved some particles since.
    Disturbed,
    /// Accelerations, but elements have broken or yielded since: what they did until then they did.
    Outdated,
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

    /// Elements have broken or yielded.
    pub fn outdate(&mut self) {
        if *self != Self::Nothing {
            *self = Self::Outdated;
        }
    }
}

pub(super) fn advance(stage: &mut Stage, substep: f32) {
    if let Some(air) = stage.field.air {
        return verlet_in_air::advance(stage, air, substep);
    }
    match stage.scratch.carried {
        Carried::Nothing => stage.evaluate(),
        Carried::Disturbed | Carried::Outdated => evaluate_again(stage, substep),
        Carried::Accelerations => {}
    }
    let Stage { particles, blocks, acceleration, scratch, .. } = stage;
    let StepVectors { velocity: other_velocity, velocity_slope: other_acceleration, .. } = &mut **scratch;
    other_velocity.resize(particles.len());
    other_acceleration.resize(particles.len());
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

/// All substeps of a tick, of blocks that no element leaves.
pub(super) fn advance_in_place(
    particles: &mut Particles,
    blocks: &Blocks,
    (field, scratch, acceleration): (&Field, &mut StepVectors, &mut Vectors),
    substeps: Substeps,
) {
    let force = &mut scratch.velocity_slope;
    force.resize(particles.len());
    let kept = blocks.split(force.axes_mut()).zip(blocks.split(acceleration.axes_mut()));
    closed::for_each(particles, blocks, field, substeps, kept, |closed, (force, acceleration)| {
        kernel::run(&mut VerletInPlace { closed, force, acceleration });
    });
}

/// Evaluates the a' of the last substep where contacts have left the particles since, and corrects the velocities by it.
pub(super) fn evaluate_again(stage: &mut Stage, substep: f32) {
    if let Some(air) = stage.field.air {
        return verlet_in_air::evaluate_again(stage, air, substep);
    }
    let Stage { particles, blocks, elements, field, acceleration, scratch, gas, .. } = stage;
    let StepVectors { velocity: predicted, velocity_slope: again, carried, .. } = &mut **scratch;
    restore_predicted(predicted, &particles.velocity, [again, acceleration], substep);
    let motion = Motion::at(&particles.position, predicted, particles);
    let field = gas.evaluate(elements.gases(), &particles.position, *field);
    kernel::evaluate(motion, blocks, field, again);
    if *carried == Carried::Disturbed {
        correct(&mut particles.velocity, blocks, [acceleration, again], |_| 0.5 * substep);
    }
    std::mem::swap(*acceleration, again);
    *carried = Carried::Accelerations;
}

/// Changes the velocities of the particles in `blocks` by the difference of two accelerations times the `share` of the slot.
pub(super) fn correct(
    velocity: &mut Vectors,
    blocks: &Blocks,
    [first, again]: [&Vectors; 2],
    share: impl Fn(usize) -> f32,
) {
    let axes = velocity.axes_mut().into_iter().zip(first.axes().into_iter().zip(again.axes()));
    for (velocity, (first, again)) in axes {
        for slots in blocks.blocks.iter().map(|block| block.slots.clone()) {
            let (first, again) = (&first[slots.clone()], &again[slots.clone()]);
            let velocity = &mut velocity[slots.clone()];
            for index in 0..velocity.len() {
                let difference = again[index] - first[index];
                let corrected = velocity[index] + share(slots.start + index) * difference;
                // All others keep their velocity to the bit, the sign of a zero included.
                velocity[index] = if difference == 0.0 { velocity[index] } else { corrected };
            }
        }
    }
}

/// Makes `predicted` what it would have been if the disturbed particles had come with their present
/// `velocity`. All others still have the corrected velocity and keep their prediction: then their next
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
