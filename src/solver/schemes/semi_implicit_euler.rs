//! Semi-implicit (symplectic) Euler: v' = v + h a(x, v), x' = x + h v'. First order.
//!
//! Symplectic: without damping it conserves an energy that differs from the true one by O(h)
//! (Hairer, Lubich and Wanner, *Geometric Numerical Integration*, 2006, I.1.2), at the cost of the
//! explicit scheme.

use super::{Stage, closed};
use crate::solver::field::Field;
use crate::solver::graph::Blocks;
use crate::solver::kernel::{self, Accelerate, Advance, AdvanceInPlace, Motion, Moved, Substeps};
use crate::solver::parallel;
use crate::solver::particles::{Particles, Vectors};

/// One pass over the blocks. The new state goes into other arrays if the forces of other blocks want the old one.
pub(super) fn advance(stage: &mut Stage, substep: f32) {
    let Stage { particles, blocks, elements, field, acceleration, scratch, gas, .. } = stage;
    let field = gas.evaluate(elements.gases(), &particles.position, *field);
    if blocks.are_closed() {
        let substeps = Substeps { count: 1, duration: substep, pinned: &[], time_step: substep, check: None };
        return advance_in_place(particles, blocks, (&field, acceleration), substeps);
    }
    scratch.position.resize(particles.len());
    scratch.velocity.resize(particles.len());
    let motion = Motion::of(particles);
    let moved = blocks.split(scratch.position.axes_mut()).zip(blocks.split(scratch.velocity.axes_mut()));
    let written = blocks.split(acceleration.axes_mut()).zip(moved);
    let parts = blocks.blocks.iter().zip(written);
    parallel::for_each(parts, blocks.are_worth_sharing(), |(block, (acceleration, (position, velocity)))| {
        let accelerate = Accelerate { block, motion: &motion, field: &field, acceleration };
        kernel::run(&mut Advance { accelerate, substep, moved: Moved { position, velocity } });
    });
    std::mem::swap(&mut particles.position, &mut scratch.position);
    std::mem::swap(&mut particles.velocity, &mut scratch.velocity);
}

/// Substeps of blocks that no element leaves.
pub(super) fn advance_in_place(
    particles: &mut Particles,
    blocks: &Blocks,
    (field, acceleration): (&Field, &mut Vectors),
    substeps: Substeps,
) {
    let accelerations = blocks.split(acceleration.axes_mut());
    closed::for_each(particles, blocks, field, substeps, accelerations, |closed, acceleration| {
        kernel::run(&mut AdvanceInPlace { closed, acceleration });
    });
}
