//! The inner loops over the springs and particles of one block.
//!
//! They are plain loops over slices, written so that the compiler turns them into vector instructions,
//! and compiled for each instruction set that is worth it; which one runs is chosen once, when the
//! program starts (by the crate `pulp`). No operation is reordered or contracted, so all of them give the
//! same bits, those of [`spring_force`] one spring after the other.

use bevy::math::Vec3;

use super::batches::{Block, Loose, Run, SHORTEST_RUN, Side};
use super::forces::{Field, spring_force};

/// Springs computed before their forces are added: enough that the additions do not wait for the
/// stores of those before.
const CHUNK: usize = 64;

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

/// Springs computed together: a vector of AVX2.
const LANES: usize = SHORTEST_RUN;

/// Forces of the springs of a chunk, from index `LANES`; there is room for zeros on both sides.
struct Forces([[f32; LANES + CHUNK + LANES + LANES]; 3]);

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

impl Accelerate<'_> {
    pub fn run(self) {
        pulp::Arch::new().dispatch(self);
    }
}

impl Advance<'_> {
    pub fn run(self) {
        pulp::Arch::new().dispatch(self);
    }
}

impl Predict<'_> {
    pub fn run(self) {
        pulp::Arch::new().dispatch(self);
    }
}

impl Correct<'_> {
    pub fn run(self) {
        pulp::Arch::new().dispatch(self);
    }
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

#[inline(always)]
fn block_accelerations(block: &Block, motion: Motion, field: Field, target: &mut Target) {
    let start = target.start;
    let [x, y, z] = &mut target.acceleration;
    let mut force = [&mut **x, &mut **y, &mut **z];
    let count = force[0].len();
    let range = start..start + count;
    for (axis, force) in force.iter_mut().enumerate() {
        let applied_force = &motion.applied_force[axis][range.clone()];
        let velocity = &motion.velocity[axis][range.clone()];
        let force = &mut force[..count];
        for index in 0..count {
            // The drag of the medium: −ν v.
            force[index] = applied_force[index] - field.viscosity * velocity[index];
        }
    }
    add_runs(block, motion, &mut force, start);
    add_loose(block, motion, &mut force, start);
    // Newton's second law: a = f / m + g, and 0 for pinned particles. Gravity is added as an
    // acceleration, so that free fall does not depend on the mass, not even by a rounding.
    let inverse_mass = &motion.inverse_mass[range];
    for (force, gravity) in force.iter_mut().zip(field.gravity.to_array()) {
        let force = &mut force[..count];
        for index in 0..count {
            let free = force[index] * inverse_mass[index] + gravity;
            force[index] = if inverse_mass[index] > 0.0 { free } else { 0.0 };
        }
    }
}

#[inline(always)]
fn add_runs(block: &Block, motion: Motion, force: &mut [&mut [f32]; 3], start: usize) {
    let mut forces = Forces([[0.0; LANES + CHUNK + LANES + LANES]; 3]);
    for run in &block.runs {
        let count = run.count as usize;
        let offset = (run.upper - run.lower) as usize;
        let mut done = 0;
        while done < count {
            // What is left after a chunk fills a vector, or there is none.
            let left = count - done;
            let chunk = if left < CHUNK + LANES { left } else { CHUNK };
            run_forces(block, run, done, chunk, motion, &mut forces);
            let lower = (run.lower as usize + done).wrapping_sub(start);
            let upper = (run.upper as usize + done).wrapping_sub(start);
            match run.side {
                Side::Both if offset <= LANES => add_both(force, lower, offset, chunk, &mut forces),
                Side::Both => {
                    add(force, lower, chunk, &forces);
                    subtract(force, upper, chunk, &forces);
                }
                Side::Lower => add(force, lower, chunk, &forces),
                Side::Upper => subtract(force, upper, chunk, &forces),
            }
            done += chunk;
        }
    }
}

/// Adds forces to the particles from `at`.
#[inline(always)]
fn add(force: &mut [&mut [f32]; 3], at: usize, count: usize, forces: &Forces) {
    for (force, pull) in force.iter_mut().zip(&forces.0) {
        for (force, pull) in force[at..at + count].iter_mut().zip(&pull[LANES..LANES + count]) {
            *force += pull;
        }
    }
}

/// Subtracts forces from the particles from `at`.
#[inline(always)]
fn subtract(force: &mut [&mut [f32]; 3], at: usize, count: usize, forces: &Forces) {
    for (force, pull) in force.iter_mut().zip(&forces.0) {
        for (force, pull) in force[at..at + count].iter_mut().zip(&pull[LANES..LANES + count]) {
            *force -= pull;
        }
    }
}

/// Adds forces to the particles from `at` and subtracts them from those `offset` further, in one: what
/// is stored is not loaded again at once.
#[inline(always)]
fn add_both(force: &mut [&mut [f32]; 3], at: usize, offset: usize, count: usize, forces: &mut Forces) {
    let end = LANES + count;
    for (force, pull) in force.iter_mut().zip(&mut forces.0) {
        // Those before the chunk are zero always.
        pull[end..end + LANES].fill(0.0);
        let ahead = &pull[LANES..end + offset];
        let behind = &pull[LANES - offset..end];
        for (force, (ahead, behind)) in
            force[at..at + count + offset].iter_mut().zip(ahead.iter().zip(behind))
        {
            *force += ahead - behind;
        }
    }
}

/// The forces of `chunk` springs of a run, from the one numbered `done`, on their lower ends.
#[inline(always)]
fn run_forces(block: &Block, run: &Run, done: usize, chunk: usize, motion: Motion, forces: &mut Forces) {
    let lanes = |array: &'_ [f32], at: usize| -> [f32; LANES] {
        array[at..at + LANES].first_chunk().copied().unwrap_or([0.0; LANES])
    };
    let count = run.count as usize;
    for first in (0..chunk).step_by(LANES) {
        // The last vector of a run overlaps the one before it and computes some springs again.
        let at = (done + first).min(count - LANES);
        let (lower, upper, place) =
            (run.lower as usize + at, run.upper as usize + at, run.start as usize + at);
        let ends =
            |axes: [&[f32]; 3]| (axes.map(|axis| lanes(axis, lower)), axes.map(|axis| lanes(axis, upper)));
        let (lower_position, upper_position) = ends(motion.position);
        let (lower_velocity, upper_velocity) = ends(motion.velocity);
        let rest_length = lanes(&block.rest_length, place);
        let [stiffness, damping] = match run.material {
            Some([stiffness, damping]) => [[stiffness; LANES], [damping; LANES]],
            None => [lanes(&block.stiffness, place), lanes(&block.damping, place)],
        };
        let mut pulls = [[0.0; LANES]; 3];
        for lane in 0..LANES {
            let between = |lower: &[[f32; LANES]; 3], upper: &[[f32; LANES]; 3]| {
                Vec3::new(
                    lower[0][lane] - upper[0][lane],
                    lower[1][lane] - upper[1][lane],
                    lower[2][lane] - upper[2][lane],
                )
            };
            let pull = spring_force(
                between(&lower_position, &upper_position),
                between(&lower_velocity, &upper_velocity),
                rest_length[lane],
                stiffness[lane],
                damping[lane],
            );
            pulls[0][lane] = pull.x;
            pulls[1][lane] = pull.y;
            pulls[2][lane] = pull.z;
        }
        for (force, pull) in forces.0.iter_mut().zip(pulls) {
            let at = LANES + at - done;
            force[at..at + LANES].copy_from_slice(&pull);
        }
    }
}

/// Adds the forces of the loose springs: gathered, computed together, and added one after the other.
#[inline(always)]
fn add_loose(block: &Block, motion: Motion, force: &mut [&mut [f32]; 3], start: usize) {
    let first_place = block.rest_length.len() - block.loose.len();
    for (group, place) in block.loose.chunks(LANES).zip((first_place..).step_by(LANES)) {
        let mut separation = [Vec3::ZERO; LANES];
        let mut relative_velocity = [Vec3::ZERO; LANES];
        for (lane, loose) in group.iter().enumerate() {
            let (lower, upper) = (loose.lower as usize, loose.upper as usize);
            let between = |[x, y, z]: [&[f32]; 3]| {
                Vec3::new(x[lower] - x[upper], y[lower] - y[upper], z[lower] - z[upper])
            };
            separation[lane] = between(motion.position);
            relative_velocity[lane] = between(motion.velocity);
        }
        let mut pulls = [Vec3::ZERO; LANES];
        for (lane, pull) in pulls.iter_mut().enumerate().take(group.len()) {
            *pull = spring_force(
                separation[lane],
                relative_velocity[lane],
                block.rest_length[place + lane],
                block.stiffness[place + lane],
                block.damping[place + lane],
            );
        }
        for (&Loose { lower, upper, side }, pull) in group.iter().zip(pulls) {
            for (force, pull) in force.iter_mut().zip(pull.to_array()) {
                if side != Side::Upper {
                    force[lower as usize - start] += pull;
                }
                if side != Side::Lower {
                    force[upper as usize - start] -= pull;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
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
