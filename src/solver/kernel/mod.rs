//! The inner loops over the springs and particles of one block.
//!
//! They are plain loops over slices, written so that the compiler turns them into vector instructions,
//! and compiled for each instruction set that is worth it; which one runs is chosen once, when the
//! program starts (by the crate `pulp`). No operation is reordered or contracted, so all of them give the
//! same bits, those of [`spring_force`](super::forces::spring_force) one spring after the other.

mod accelerations;

use super::batches::Block;
use super::forces::Field;
use accelerations::block_accelerations;

/// What the forces depend on: all particles, three arrays for each vector.
#[derive(Clone, Copy)]
pub(super) struct Motion<'a> {
    pub position: [&'a [f32]; 3],
    pub velocity: [&'a [f32]; 3],
    pub applied_force: [&'a [f32]; 3],
    pub inverse_mass: &'a [f32],
}

/// The particles of one block: where they begin, and the arrays to be written.
pub(super) struct Target<'a> {
    pub start: usize,
    pub acceleration: [&'a mut [f32]; 3],
}

/// A substep of semi-implicit Euler: the new state of the particles of one block.
pub(super) struct Moved<'a> {
    pub position: [&'a mut [f32]; 3],
    pub velocity: [&'a mut [f32]; 3],
}

/// Writes the accelerations of the particles of one block.
pub(super) struct Accelerate<'a> {
    pub block: &'a Block,
    pub motion: Motion<'a>,
    pub field: Field,
    pub target: Target<'a>,
}

/// Writes the accelerations of the particles of one block, and their state after a substep of
/// semi-implicit Euler: v' = v + h a, x' = x + h v'.
pub(super) struct Advance<'a> {
    pub accelerate: Accelerate<'a>,
    /// The substep h, s.
    pub substep: f32,
    pub moved: Moved<'a>,
}

/// Moves the particles of one block by their accelerations a: x' = x + h v + h²/2 a, v' = v + h a.
pub(super) struct Predict<'a> {
    pub position: [&'a mut [f32]; 3],
    pub velocity: [&'a mut [f32]; 3],
    pub acceleration: [&'a [f32]; 3],
    /// The substep h, s.
    pub substep: f32,
}

/// Writes the accelerations of the particles of one block, and corrects their velocities, which had been
/// predicted by other ones: v' = v + h/2 (a − a predicted).
pub(super) struct Correct<'a> {
    pub accelerate: Accelerate<'a>,
    pub predicted_acceleration: [&'a [f32]; 3],
    /// The substep h, s.
    pub substep: f32,
    /// The new velocities.
    pub velocity: [&'a mut [f32]; 3],
}

/// Does the work with the best instructions that the processor has.
pub(super) fn run(work: impl pulp::WithSimd<Output = ()>) {
    pulp::Arch::new().dispatch(work);
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
        let Accelerate { block, motion, field, mut target } = self.accelerate;
        block_accelerations(block, motion, field, &mut target);
        let half = 0.5 * self.substep;
        for (axis, velocity) in self.velocity.into_iter().enumerate() {
            let count = velocity.len();
            let range = target.start..target.start + count;
            let predicted = &motion.velocity[axis][range];
            let predicted_acceleration = &self.predicted_acceleration[axis][..count];
            let acceleration = &target.acceleration[axis][..count];
            for index in 0..count {
                let error = acceleration[index] - predicted_acceleration[index];
                velocity[index] = predicted[index] + half * error;
            }
        }
    }
}

impl pulp::WithSimd for Accelerate<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(mut self, _: S) {
        block_accelerations(self.block, self.motion, self.field, &mut self.target);
    }
}

impl pulp::WithSimd for Advance<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { accelerate: Accelerate { block, motion, field, mut target }, substep, moved } = self;
        block_accelerations(block, motion, field, &mut target);
        let count = target.acceleration[0].len();
        let range = target.start..target.start + count;
        for axis in 0..3 {
            let old_velocity = &motion.velocity[axis][range.clone()];
            let old_position = &motion.position[axis][range.clone()];
            let acceleration = &target.acceleration[axis][..count];
            let velocity = &mut moved.velocity[axis][..count];
            let position = &mut moved.position[axis][..count];
            for index in 0..count {
                velocity[index] = old_velocity[index] + substep * acceleration[index];
                position[index] = old_position[index] + substep * velocity[index];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::Vec3;
    use pulp::WithSimd;

    use super::*;
    use crate::solver::forces::{accelerations, evaluate};
    use crate::solver::{Particles, Springs, Vectors};

    const FIELD: Field = Field { gravity: Vec3::new(0.0, -9.81, 0.0), viscosity: 0.2 };

    /// A strip of cloth of three blocks, a few springs from anywhere to anywhere, and a pinned corner.
    fn net() -> (Particles, Springs) {
        let (width, count) = (37, 5000);
        let mut particles = Particles::default();
        let mut springs = Springs::default();
        let wobble = |slot: usize, factor: usize| (slot * factor % 101) as f32 * 0.002;
        for slot in 0..count {
            let (column, row) = ((slot % width) as f32, (slot / width) as f32);
            let position = Vec3::new(column + wobble(slot, 7), wobble(slot, 13), row + wobble(slot, 29));
            let velocity = Vec3::new(wobble(slot, 3), wobble(slot, 17), -wobble(slot, 5));
            particles.push(position, velocity, if slot == 0 { f32::INFINITY } else { 0.3 }, 0.0);
        }
        for (columns, rows) in [(1, 0), (2, 0), (0, 1), (1, 1)] {
            for slot in (0..count).filter(|slot| slot % width + columns < width) {
                let other = slot + columns + rows * width;
                if other < count {
                    // One in three the other way round, and a softer one here and there.
                    let (first, second) = if slot % 3 == 0 { (other, slot) } else { (slot, other) };
                    let stiffness = if slot % 500 == 7 { 20.0 } else { 80.0 };
                    springs.push(first, second, 1.0 + wobble(slot, 11), stiffness, 0.5);
                }
            }
        }
        for slot in (0..count).step_by(61) {
            springs.push(slot, slot * 31 % count + 1, 5.0, 3.0, 0.1);
        }
        springs.prepare(count);
        assert!(springs.batches().blocks.len() > 1);
        (particles, springs)
    }

    /// Each particle has fewer than n = 12 forces of at most 500 N; sums of n terms differ by at most
    /// 2 n u times the sum of their sizes, which 1/m turns into accelerations.
    #[test]
    fn the_kernel_does_what_the_plain_loop_does() {
        let (mut particles, mut springs) = net();
        let mut expected = Vectors::default();
        let Particles { position, velocity, applied_force, inverse_mass, .. } = &particles;
        accelerations(applied_force, inverse_mass, &springs, FIELD, position, velocity, &mut expected);
        evaluate(&mut particles, &mut springs, FIELD);
        let tolerance = 2.0 * 12.0 * (0.5 * f32::EPSILON) * (12.0 * 500.0) / 0.3;
        let mut largest = 0.0_f32;
        for slot in 0..particles.len() {
            let difference = particles.acceleration.get(slot) - expected.get(slot);
            assert!(difference.length() < tolerance, "slot {slot}: {difference}");
            largest = largest.max(expected.get(slot).length());
        }
        assert!(largest > 100.0 && particles.acceleration.get(0) == Vec3::ZERO);
    }

    #[test]
    fn every_instruction_set_gives_the_same_bits() {
        let (mut particles, mut springs) = net();
        evaluate(&mut particles, &mut springs, FIELD);
        let mut portable = Vectors::default();
        portable.resize(particles.len());
        let size = springs.batches().block_size;
        let motion = Motion {
            position: particles.position.axes(),
            velocity: particles.velocity.axes(),
            applied_force: particles.applied_force.axes(),
            inverse_mass: &particles.inverse_mass,
        };
        for (number, acceleration) in portable.chunks_mut(size).enumerate() {
            let block = &springs.batches().blocks[number];
            let target = Target { start: number * size, acceleration };
            Accelerate { block, motion, field: FIELD, target }.with_simd(pulp::Scalar::new());
        }
        assert_eq!(particles.acceleration, portable);
    }
}
