//! Velocity Verlet: x' = x + h v + h²/2 a, v' = v + h/2 (a + a'), with a' = a(x', v + h a). Second order.
//!
//! Swope et al., *J. Chem. Phys.* 76, 637 (1982). The forces here depend on the velocity, so they are
//! evaluated at the predicted velocity v + h a (Groot and Warren, *J. Chem. Phys.* 107, 4423, 1997, with
//! λ = 1), which keeps the second order with damping and is the original scheme without. The a of a substep
//! is the a' of the one before, so that each costs one evaluation; the first of a tick takes a(x, v).

use super::super::SolverState;
use super::super::blocks;
use super::super::forces::{self, Field};
use super::super::kernel::{self, Accelerate, Correct, Motion, Predict, Target};
use super::super::particles::{Particles, Vectors};

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
    /// Something else than this scheme has moved particles.
    pub fn note_disturbance(&mut self) {
        if *self == Self::Accelerations {
            *self = Self::Disturbed;
        }
    }
}

pub(super) fn advance(state: &mut SolverState, field: Field, substep: f32) {
    let SolverState { particles, springs, scratch, .. } = state;
    if scratch.verlet == Carried::Nothing {
        forces::evaluate(particles, springs, field);
    }
    let Particles { position, velocity, applied_force, acceleration, inverse_mass, .. } = particles;
    let (other_velocity, other_acceleration) = (&mut scratch.velocity, &mut scratch.velocity_slope);
    other_velocity.resize(position.len());
    other_acceleration.resize(position.len());
    if scratch.verlet == Carried::Disturbed {
        restore_predicted(other_velocity, velocity, [other_acceleration, acceleration], substep);
        let motion = motion(position, other_velocity, applied_force, inverse_mass);
        forces::evaluate_motion(motion, springs, field, acceleration);
    }
    let batches = springs.batches();
    let (size, parallel) = (batches.block_size, batches.are_worth_sharing());

    let parts = position.chunks_mut(size).zip(velocity.chunks_mut(size)).zip(acceleration.chunks(size));
    blocks::for_each(parts, parallel, |((position, velocity), acceleration)| {
        kernel::run(Predict { position, velocity, acceleration, substep });
    });

    let motion = motion(position, velocity, applied_force, inverse_mass);
    let written = other_acceleration.chunks_mut(size).zip(other_velocity.chunks_mut(size));
    let parts = batches.blocks.iter().zip(acceleration.chunks(size)).zip(written).enumerate();
    blocks::for_each(
        parts,
        parallel,
        |(number, ((block, predicted_acceleration), (acceleration, velocity)))| {
            let target = Target { start: number * size, acceleration };
            let accelerate = Accelerate { block, motion, field, target };
            kernel::run(Correct { accelerate, predicted_acceleration, substep, velocity });
        },
    );
    std::mem::swap(velocity, other_velocity);
    std::mem::swap(acceleration, other_acceleration);
    scratch.verlet = Carried::Accelerations;
}

fn motion<'a>(
    position: &'a Vectors,
    velocity: &'a Vectors,
    applied_force: &'a Vectors,
    inverse_mass: &'a [f32],
) -> Motion<'a> {
    Motion {
        position: position.axes(),
        velocity: velocity.axes(),
        applied_force: applied_force.axes(),
        inverse_mass,
    }
}

/// Makes `predicted` what it would have been if the disturbed particles had come with their present
/// `velocity`. All others, whose velocity is still the corrected one, keep theirs: then their next
/// accelerations are the same to the bit, whatever touched whom elsewhere.
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
