//! Substeps of semi-implicit Euler.

use super::accelerations::{add_elements, begin_forces, block_accelerations};
use super::closed::{Closed, Next, Substeps};
use super::{Accelerate, in_vectors};

/// A substep of semi-implicit Euler: the new state of the particles of one block.
pub(in crate::solver) struct Moved<'a> {
    pub position: [&'a mut [f32]; 3],
    pub velocity: [&'a mut [f32]; 3],
}

/// Writes the accelerations of the particles of one block, and their state after a substep of
/// semi-implicit Euler: v' = v + h a, x' = x + h v'.
pub(in crate::solver) struct Advance<'a> {
    pub accelerate: Accelerate<'a>,
    /// The substep h, s.
    pub substep: f32,
    pub moved: Moved<'a>,
}

/// Substeps of a block that no element joins to what is not in it.
pub(in crate::solver) struct AdvanceInPlace<'a> {
    pub closed: Closed<'a>,
    /// Those of the last substep.
    pub acceleration: [&'a mut [f32]; 3],
}

// By reference: it is too large to be moved for nothing.
impl pulp::WithSimd for &mut Advance<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Advance { accelerate, substep, moved } = self;
        let &mut Accelerate { block, motion, field, ref mut acceleration } = accelerate;
        block_accelerations(block, motion, field, acceleration);
        let (substep, start, count) = (*substep, block.slots.start, acceleration[0].len());
        for part in in_vectors(start, count) {
            for axis in 0..3 {
                let slots = start + part.start..start + part.end;
                let old_velocity = &motion.velocity[axis][slots.clone()];
                let old_position = &motion.position[axis][slots];
                let acceleration = &acceleration[axis][part.clone()];
                let velocity = &mut moved.velocity[axis][part.clone()];
                let position = &mut moved.position[axis][part.clone()];
                for index in 0..position.len() {
                    velocity[index] = old_velocity[index] + substep * acceleration[index];
                    position[index] = old_position[index] + substep * velocity[index];
                }
            }
        }
    }
}

impl pulp::WithSimd for &mut AdvanceInPlace<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let AdvanceInPlace { closed, acceleration } = self;
        let (block, field) = (closed.block, closed.field);
        if field.air.is_some() {
            block_accelerations(block, &closed.motion(), field, acceleration);
            return self.kick_and_drift();
        }
        begin_forces(block.slots.start, &closed.motion(), field, acceleration);
        let Substeps { count, duration, .. } = closed.substeps;
        for substep in 1..=count {
            add_elements(block, &closed.motion(), field, acceleration);
            let next = if substep == count { Next::Acceleration } else { closed.next() };
            for part in in_vectors(block.slots.start, acceleration[0].len()) {
                for (axis, force) in acceleration.iter_mut().enumerate() {
                    closed.lane(force, axis, part.clone()).pass(
                        next,
                        |acceleration, position, velocity, _| {
                            *velocity += duration * acceleration;
                            *position += duration * *velocity;
                        },
                    );
                }
            }
            closed.move_pinned(substep);
            if !closed.goes_on(substep) {
                return;
            }
        }
    }
}

impl AdvanceInPlace<'_> {
    /// Advances a substep by accelerations.
    #[inline(always)]
    fn kick_and_drift(&mut self) {
        let Self { closed, acceleration } = self;
        let substep = closed.substeps.duration;
        let axes = closed.position.iter_mut().zip(&mut closed.velocity).zip(acceleration);
        for ((position, velocity), acceleration) in axes {
            let count = acceleration.len();
            let (position, velocity) = (&mut position[..count], &mut velocity[..count]);
            for index in 0..count {
                velocity[index] += substep * acceleration[index];
                position[index] += substep * velocity[index];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::Vec3;

    use super::*;
    use crate::solver::elements::{Elements, Spring};
    use crate::solver::field::Field;
    use crate::solver::graph::Blocks;
    use crate::solver::kernel::{Motion, evaluate, run};
    use crate::solver::particles::{Particles, Vectors};

    const FIELD: Field = Field { gravity: Vec3::new(0.0, -9.81, 0.0), viscosity: 0.0, air: None, gas: None };

    /// The number of links of each rope.
    const LENGTHS: [usize; 10] = [20, 9, 20, 3, 70, 20, 20, 70, 20, 90];

    /// Ropes of these `lengths` in a row, each hanging from its first particle.
    fn ropes(lengths: &[usize]) -> (Particles, Elements) {
        let (mut particles, mut elements) = (Particles::default(), Elements::default());
        for (rope, &length) in lengths.iter().enumerate() {
            for number in 0..=length {
                let slot = particles.len();
                let wobble = |factor: usize| (number * factor % 101) as f32 * 0.003;
                let position = Vec3::new(0.1 * number as f32 + wobble(7), wobble(13), rope as f32);
                let velocity = Vec3::new(wobble(3), -wobble(17), wobble(5));
                particles.push(position, velocity, if number == 0 { 0.0 } else { 4.0 }, 0.0);
                if number > 0 {
                    let rest_length = 0.1 + wobble(11);
                    let spring = Spring { rest_length, stiffness: 800.0, damping: 0.7, ..Spring::default() };
                    elements.push([slot as u32 - 1, slot as u32], spring);
                }
            }
        }
        (particles, elements)
    }

    fn accelerations(particles: &Particles, blocks: &Blocks) -> Vectors {
        let mut acceleration = Vectors::default();
        acceleration.resize(particles.len());
        evaluate(Motion::of(particles), blocks, FIELD, &mut acceleration);
        acceleration
    }

    #[test]
    fn ropes_of_which_the_runs_are_joined_move_to_the_bit_as_alone() {
        let (mut particles, elements) = ropes(&LENGTHS);
        let blocks = Blocks::of(elements, &particles);
        let runs: Vec<(u32, usize)> =
            blocks.blocks[0].runs.iter().map(|run| (run.count, run.holes.len())).collect();
        // The first link of each rope is anchored: a place of its own at the start, or a hole. 1 + 19 + 2 + 8 + 2 + 19 places; 6 with the
        // rope of three links, which has no run; 69, then 2 + 19 twice and 2 + 69; with 2 + 19 it would be too many. What is longer
        // than a chunk has no holes.
        assert_eq!(runs, [(1 + 50 + 6 + 69 + 42 + 71, 7), (1 + 19, 1), (89, 0)]);
        let together = accelerations(&particles, &blocks);
        let mut first = 0;
        for (rope, &length) in LENGTHS.iter().enumerate() {
            let (mut alone, links) = ropes(&[length]);
            (0..alone.len()).for_each(|slot| alone.position.z[slot] = rope as f32);
            let own = accelerations(&alone, &Blocks::of(links, &alone));
            for slot in 0..alone.len() {
                assert_eq!(together.get(first + slot), own.get(slot), "rope {rope}, particle {slot}");
            }
            first += alone.len();
        }
        // That no force is applied is the same, known or not.
        particles.note_applied_forces();
        assert!(particles.is_unpushed());
        assert_eq!(accelerations(&particles, &blocks), together);
        particles.applied_force.set(7, Vec3::X);
        particles.note_applied_forces();
        assert!(!particles.is_unpushed());
    }

    #[test]
    fn in_place_gives_the_same_bits() {
        let (particles, elements) = ropes(&LENGTHS);
        let blocks = Blocks::of(elements, &particles);
        assert!(blocks.are_closed());
        let substep = 1e-3;
        let mut results = Vec::new();
        for in_place in [false, true] {
            let [mut position, mut velocity] = [particles.position.clone(), particles.velocity.clone()];
            let mut acceleration = Vectors::default();
            acceleration.resize(particles.len());
            let motion = Motion::of(&particles);
            let moved = blocks.split(position.axes_mut()).zip(blocks.split(velocity.axes_mut()));
            let parts = blocks.blocks.iter().zip(blocks.split(acceleration.axes_mut())).zip(moved);
            for ((block, acceleration), (position, velocity)) in parts {
                let slots = block.slots.clone();
                if in_place {
                    let closed = Closed {
                        block,
                        field: &FIELD,
                        applied_force: motion.applied_force.map(|axis| &axis[slots.clone()]),
                        inverse_mass: &motion.inverse_mass[slots],
                        is_unpushed: false,
                        position,
                        velocity,
                        substeps: Substeps {
                            count: 1,
                            duration: substep,
                            pinned: &[],
                            time_step: substep,
                            check: None,
                        },
                    };
                    run(&mut AdvanceInPlace { closed, acceleration });
                } else {
                    let moved = Moved { position, velocity };
                    let accelerate = Accelerate { block, motion: &motion, field: &FIELD, acceleration };
                    run(&mut Advance { accelerate, substep, moved });
                }
            }
            results.push([position, velocity, acceleration]);
        }
        assert_eq!(results[0], results[1]);
        assert_ne!(results[0][0], particles.position);
    }
}
