//! Substeps of velocity Verlet.

use super::accelerations::{add_elements, begin_forces, block_accelerations};
use super::closed::{Closed, Lane, Next, Substeps};
use super::{Accelerate, in_vectors};

/// Moves the particles of one block by their accelerations a: x' = x + h v + h²/2 a, v' = v + h a.
pub(in crate::solver) struct Predict<'a> {
    pub position: [&'a mut [f32]; 3],
    pub velocity: [&'a mut [f32]; 3],
    pub acceleration: [&'a [f32]; 3],
    /// The substep h, s.
    pub substep: f32,
}

/// Writes the accelerations of the particles of one block, and corrects their velocities, which had been
/// predicted by other ones: v' = v + h/2 (a − a predicted).
pub(in crate::solver) struct Correct<'a> {
    pub accelerate: Accelerate<'a>,
    pub predicted_acceleration: [&'a [f32]; 3],
    /// The substep h, s.
    pub substep: f32,
    /// The new velocities.
    pub velocity: [&'a mut [f32]; 3],
}

/// Substeps of a block that no element joins to what is not in it, from accelerations that are still to be evaluated: the same as
/// [`Predict`] and [`Correct`] by turns, of which the second one and the next first one are one pass.
pub(in crate::solver) struct VerletInPlace<'a> {
    pub closed: Closed<'a>,
    /// Working memory.
    pub force: [&'a mut [f32]; 3],
    /// Those of the last substep.
    pub acceleration: [&'a mut [f32]; 3],
}

impl pulp::WithSimd for Predict<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { position, velocity, acceleration, substep } = self;
        let axes = position.into_iter().zip(velocity).zip(acceleration);
        for ((position, velocity), acceleration) in axes {
            let count = acceleration.len();
            let (position, velocity) = (&mut position[..count], &mut velocity[..count]);
            for index in 0..count {
                let half_kick = 0.5 * substep * acceleration[index];
                position[index] += substep * (velocity[index] + half_kick);
                velocity[index] += substep * acceleration[index];
            }
        }
    }
}

impl pulp::WithSimd for Correct<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Accelerate { block, motion, field, mut acceleration } = self.accelerate;
        block_accelerations(block, motion, field, &mut acceleration);
        let half = 0.5 * self.substep;
        for (axis, velocity) in self.velocity.into_iter().enumerate() {
            let count = velocity.len();
            let range = block.slots.start..block.slots.start + count;
            let predicted = &motion.velocity[axis][range];
            let predicted_acceleration = &self.predicted_acceleration[axis][..count];
            let acceleration = &acceleration[axis][..count];
            for index in 0..count {
                let error = acceleration[index] - predicted_acceleration[index];
                velocity[index] = predicted[index] + half * error;
            }
        }
    }
}

// By reference: it is too large to be moved for nothing.
impl pulp::WithSimd for &mut VerletInPlace<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Closed { block, field, .. } = self.closed;
        let count = self.closed.substeps.count;
        begin_forces(block.slots.start, &self.closed.motion(), field, &mut self.force);
        for substep in 0..=count {
            add_elements(block, &self.closed.motion(), field, &mut self.force);
            match substep {
                0 => self.pass::<false, true>(),
                _ if substep < count => self.pass::<true, true>(),
                _ => self.pass::<true, false>(),
            }
            if substep < count {
                self.closed.move_pinned(substep + 1);
                if !self.closed.goes_on(substep + 1) {
                    return;
                }
            }
        }
    }
}

impl VerletInPlace<'_> {
    /// Corrects the velocities of the substep that ends, and predicts the motion in the one that begins.
    #[inline(always)]
    fn pass<const CORRECTS: bool, const PREDICTS: bool>(&mut self) {
        let Self { closed, force, acceleration: accelerations } = self;
        let Substeps { duration, .. } = closed.substeps;
        let half = 0.5 * duration;
        let next = if PREDICTS { closed.next() } else { Next::Nothing };
        for part in in_vectors(closed.block.slots.start, force[0].len()) {
            for axis in 0..3 {
                let accelerations = &mut accelerations[axis][part.clone()];
                let lane: Lane = closed.lane(force[axis], axis, part.clone());
                lane.pass(next, |acceleration, position, velocity, index| {
                    if CORRECTS {
                        *velocity += half * (acceleration - accelerations[index]);
                    }
                    if PREDICTS {
                        *position += duration * (*velocity + half * acceleration);
                        *velocity += duration * acceleration;
                    }
                    accelerations[index] = acceleration;
                });
            }
        }
    }
}
