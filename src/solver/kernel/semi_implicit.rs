//! Substeps of semi-implicit Euler.

use super::accelerations::block_accelerations;
use super::{Accelerate, Motion, in_vectors};
use crate::solver::field::Field;
use crate::solver::graph::block::Block;

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

/// The same where no element joins the block to what is not in it: what nothing else reads is overwritten.
pub(in crate::solver) struct AdvanceInPlace<'a> {
    pub block: &'a Block,
    pub field: &'a Field<'a>,
    /// Of the particles of the block, as what follows.
    pub applied_force: [&'a [f32]; 3],
    pub inverse_mass: &'a [f32],
    /// Whether it is known that all applied forces are zero.
    pub is_unpushed: bool,
    pub acceleration: [&'a mut [f32]; 3],
    /// The state, old and new.
    pub moved: Moved<'a>,
    /// The substep h, s.
    pub substep: f32,
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
        let AdvanceInPlace { block, field, acceleration, moved, substep, .. } = self;
        let motion = Motion {
            first: block.slots.start,
            is_unpushed: self.is_unpushed,
            position: moved.position.each_ref().map(|axis| &**axis),
            velocity: moved.velocity.each_ref().map(|axis| &**axis),
            applied_force: self.applied_force,
            inverse_mass: self.inverse_mass,
        };
        block_accelerations(block, &motion, field, acceleration);
        let (substep, count) = (*substep, acceleration[0].len());
        for part in in_vectors(block.slots.start, count) {
            for axis in 0..3 {
                let acceleration = &acceleration[axis][part.clone()];
                let velocity = &mut moved.velocity[axis][part.clone()];
                let position = &mut moved.position[axis][part.clone()];
                for index in 0..position.len() {
                    velocity[index] += substep * acceleration[index];
                    position[index] += substep * velocity[index];
                }
            }
        }
    }
}
