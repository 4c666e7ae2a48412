//! Semi-implicit (symplectic) Euler: v' = v + h a(x, v), x' = x + h v'. First order.
//!
//! Symplectic: without damping it conserves an energy that differs from the true one by O(h)
//! (Hairer, Lubich and Wanner, *Geometric Numerical Integration*, 2006, I.1.2), at the cost of the
//! explicit scheme.

use super::super::SolverState;
use super::super::blocks;
use super::super::forces::Field;
use super::super::kernel::{self, Accelerate, Advance, Motion, Moved, Target};

/// One pass over the blocks. The new state goes into other arrays, since the forces of other blocks
/// want the old one.
pub(super) fn advance(state: &mut SolverState, field: Field, substep: f32) {
    let SolverState { particles, springs, scratch, .. } = state;
    springs.prepare(particles.len());
    scratch.position.resize(particles.len());
    scratch.velocity.resize(particles.len());
    let motion = Motion {
        position: particles.position.axes(),
        velocity: particles.velocity.axes(),
        applied_force: particles.applied_force.axes(),
        inverse_mass: &particles.inverse_mass,
    };
    let batches = springs.batches();
    let size = batches.block_size;
    let moved = scratch.position.chunks_mut(size).zip(scratch.velocity.chunks_mut(size));
    let written = particles.acceleration.chunks_mut(size).zip(moved);
    let parts = batches.blocks.iter().zip(written).enumerate();
    blocks::for_each(
        parts,
        batches.are_worth_sharing(),
        |(number, (block, (acceleration, (position, velocity))))| {
            let target = Target { start: number * size, acceleration };
            let accelerate = Accelerate { block, motion, field, target };
            kernel::run(Advance { accelerate, substep, moved: Moved { position, velocity } });
        },
    );
    std::mem::swap(&mut particles.position, &mut scratch.position);
    std::mem::swap(&mut particles.velocity, &mut scratch.velocity);
}
