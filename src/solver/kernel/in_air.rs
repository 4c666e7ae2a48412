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
        let Self { air, start, position, velocity, vacuum, acceleration, substep } = self;
        let axes = position.into_iter().zip(velocity).zip(acceleration.into_iter().zip(vacuum));
        for (axis, ((position, velocity), (acceleration, vacuum))) in axes.enumerate() {
            let count = vacuum.len();
            let (position, velocity) = (&mut position[..count], &mut velocity[..count]);
            let acceleration = &mut acceleration[..count];
            acceleration.copy_from_slice(vacuum);
            air.brake(axis, start, velocity, acceleration);
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
        let Self { accelerate, air, acceleration, substep, velocity } = self;
        let Accelerate { block, motion, field, acceleration: mut vacuum } = accelerate;
        block_accelerations(block, motion, field, &mut vacuum);
        let half = 0.5 * substep;
        for (axis, (velocity, acceleration)) in velocity.into_iter().zip(acceleration).enumerate() {
            let count = velocity.len();
            let range = block.slots.start..block.slots.start + count;
            let predicted = &motion.velocity[axis][range.clone()];
            let acceleration = &mut acceleration[..count];
            for (velocity, acceleration) in velocity.iter_mut().zip(&*acceleration) {
                *velocity = -half * acceleration;
            }
            acceleration.copy_from_slice(&vacuum[axis][..count]);
            air.brake(axis, range.start, predicted, acceleration);
            for index in 0..count {
                velocity[index] = predicted[index] + (velocity[index] + half * acceleration[index]);
            }
        }
    }
}
