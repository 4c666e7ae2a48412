//! The two halves of velocity Verlet where the air blows.

use super::Accelerate;
use super::accelerations::block_accelerations;
use crate::solver::field::AirLoad;

/// Moves the particles of one block by the accelerations f that air makes of those in vacuum: x' = x + h v + h²/2 f,
/// v' = v + h f.
pub(in crate::solver) struct PredictInAir<'a> {
    pub air: &'a AirLoad,
    /// The first slot of the block.
    pub start: usize,
    pub position: [&'a mut [f32]; 3],
    pub velocity: [&'a mut [f32]; 3],
    pub vacuum: [&'a [f32]; 3],
    /// Where f goes.
    pub acceleration: [&'a mut [f32]; 3],
    /// The substep h, s.
    pub substep: f32,
}

/// Writes the accelerations in vacuum of the particles of one block, and corrects their velocities, which had been
/// predicted by other accelerations f: v' = v + h/2 (f' − f).
pub(in crate::solver) struct CorrectInAir<'a> {
    pub accelerate: Accelerate<'a>,
    pub air: &'a AirLoad,
    /// f, then f'.
    pub acceleration: [&'a mut [f32]; 3],
    /// The substep h, s.
    pub substep: f32,
    /// The new velocities.
    pub velocity: [&'a mut [f32]; 3],
}

impl pulp::WithSimd for PredictInAir<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { air, start, position, velocity, vacuum, mut acceleration, substep } = self;
        for (axis, (acceleration, vacuum)) in acceleration.iter_mut().zip(vacuum).enumerate() {
            acceleration.copy_from_slice(vacuum);
            air.brake(axis, start, velocity[axis], acceleration);
        }
        if !air.filaments.is_empty() {
            air.brake_filaments(start, velocity.each_ref().map(|axis| &**axis), &mut acceleration);
        }
        for ((position, velocity), acceleration) in position.into_iter().zip(velocity).zip(acceleration) {
            let count = acceleration.len();
            let (position, velocity) = (&mut position[..count], &mut velocity[..count]);
            for index in 0..count {
                position[index] += substep * (velocity[index] + 0.5 * substep * acceleration[index]);
                velocity[index] += substep * acceleration[index];
            }
        }
    }
}

impl pulp::WithSimd for CorrectInAir<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { accelerate, air, mut acceleration, substep, mut velocity } = self;
        let Accelerate { block, motion, field, acceleration: mut vacuum } = accelerate;
        block_accelerations(block, motion, field, &mut vacuum);
        let half = 0.5 * substep;
        let range = block.slots.start..block.slots.start + velocity[0].len();
        let predicted = motion.velocity.map(|axis| &axis[range.clone()]);
        for (axis, (velocity, acceleration)) in velocity.iter_mut().zip(&mut acceleration).enumerate() {
            let count = velocity.len();
            let acceleration = &mut acceleration[..count];
            for (velocity, acceleration) in velocity.iter_mut().zip(&*acceleration) {
                *velocity = -half * acceleration;
            }
            acceleration.copy_from_slice(&vacuum[axis][..count]);
            air.brake(axis, range.start, predicted[axis], acceleration);
        }
        if !air.filaments.is_empty() {
            air.brake_filaments(range.start, predicted, &mut acceleration);
        }
        for ((velocity, acceleration), predicted) in velocity.into_iter().zip(acceleration).zip(predicted) {
            let count = velocity.len();
            let (acceleration, predicted) = (&acceleration[..count], &predicted[..count]);
            for index in 0..count {
                velocity[index] = predicted[index] + (velocity[index] + half * acceleration[index]);
            }
        }
    }
}
