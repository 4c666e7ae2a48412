//! Blocks that no element joins to what is not in them: what nothing else reads is overwritten, substep after substep while it
//! is in the first-level cache.

use std::ops::Range;

use super::Motion;
use super::accelerations::{answer, drive, is_undriven};
use crate::solver::field::Field;
use crate::solver::graph::block::Block;
use crate::solver::particles::{PinnedMotion, set};

/// What one after the other is done in each block.
#[derive(Clone, Copy)]
pub(in crate::solver) struct Substeps<'a> {
    pub count: u32,
    /// Of each substep, s.
    pub duration: f32,
    /// The pinned particles that move, in the order of their slots.
    pub pinned: &'a [PinnedMotion],
    /// All of the tick, s.
    pub time_step: f32,
    /// Called after each substep.
    pub check: Option<&'a Check<'a>>,
}

/// Is told the first slot of a block, the coordinates of its particles, m, and how many substeps are done; whether to go on.
pub(in crate::solver) type Check<'a> = dyn Fn(usize, [&[f32]; 3], u32) -> bool + Sync + 'a;

/// The particles of a closed block; all arrays are of these.
pub(in crate::solver) struct Closed<'a> {
    pub block: &'a Block,
    pub field: &'a Field<'a>,
    pub applied_force: [&'a [f32]; 3],
    pub inverse_mass: &'a [f32],
    /// Whether it is known that all applied forces are zero.
    pub is_unpushed: bool,
    /// The state, old and new.
    pub position: [&'a mut [f32]; 3],
    pub velocity: [&'a mut [f32]; 3],
    /// More than one only where neither air nor gases act: the field would be another one in each.
    pub substeps: Substeps<'a>,
}

/// What an array of forces gets in a pass that has used them.
#[derive(Clone, Copy)]
pub(super) enum Next {
    /// The accelerations that follow from them.
    Acceleration,
    /// Zero: with this the forces of the next substep begin.
    Nothing,
    /// What drives the particles in the next substep, elements apart.
    Drive,
}

impl Closed<'_> {
    /// What the forces depend on.
    #[inline(always)]
    pub(super) fn motion(&self) -> Motion<'_> {
        let [x, y, z] = &self.position;
        let [u, v, w] = &self.velocity;
        Motion {
            first: self.block.slots.start,
            is_unpushed: self.is_unpushed,
            position: [x, y, z],
            velocity: [u, v, w],
            applied_force: self.applied_force,
            inverse_mass: self.inverse_mass,
        }
    }

    /// With what the forces of another substep begin.
    #[inline(always)]
    pub(super) fn next(&self) -> Next {
        if is_undriven(self.is_unpushed, self.field) { Next::Nothing } else { Next::Drive }
    }

    /// Whether to go on after a number of substeps.
    #[inline(always)]
    pub(super) fn goes_on(&self, done: u32) -> bool {
        let [x, y, z] = &self.position;
        self.substeps.check.is_none_or(|check| check(self.block.slots.start, [x, y, z], done))
    }

    /// Puts the pinned particles where they are after a number of substeps.
    #[inline(always)]
    pub(super) fn move_pinned(&mut self, done: u32) {
        let Substeps { count, pinned, time_step, .. } = self.substeps;
        if pinned.is_empty() {
            return;
        }
        let elapsed = if done == count { 1.0 } else { done as f32 / count as f32 };
        let start = self.block.slots.start;
        // Slices of one length: a slot is checked for all of them at once.
        let count = self.inverse_mass.len();
        let [x, y, z] = &mut self.position;
        let mut position = [&mut x[..count], &mut y[..count], &mut z[..count]];
        let [u, v, w] = &mut self.velocity;
        let mut velocity = [&mut u[..count], &mut v[..count], &mut w[..count]];
        // What stands still has been where it is since the tick began.
        for motion in pinned.iter().filter(|motion| !motion.stands_still()) {
            let [place, speed] = motion.at(elapsed, time_step);
            set(&mut position, motion.slot - start, place);
            set(&mut velocity, motion.slot - start, speed);
        }
    }
}

/// The numbers of some particles along one axis in a pass.
pub(super) struct Lane<'a> {
    pub force: &'a mut [f32],
    pub position: &'a mut [f32],
    pub velocity: &'a mut [f32],
    applied_force: &'a [f32],
    inverse_mass: &'a [f32],
    gravity: f32,
    viscosity: f32,
}

impl Closed<'_> {
    /// Some particles along one axis: those with these indices.
    #[inline(always)]
    pub(super) fn lane<'a>(&'a mut self, force: &'a mut [f32], axis: usize, part: Range<usize>) -> Lane<'a> {
        Lane {
            force: &mut force[part.clone()],
            position: &mut self.position[axis][part.clone()],
            velocity: &mut self.velocity[axis][part.clone()],
            applied_force: &self.applied_force[axis][part.clone()],
            inverse_mass: &self.inverse_mass[part],
            gravity: self.field.gravity.to_array()[axis],
            viscosity: self.field.viscosity,
        }
    }
}

impl Lane<'_> {
    /// Calls `advance` with the acceleration, position, velocity and index of each particle.
    #[inline(always)]
    pub fn pass(self, next: Next, mut advance: impl FnMut(f32, &mut f32, &mut f32, usize)) {
        let Self { force, position, velocity, applied_force, inverse_mass, gravity, viscosity } = self;
        let count = force.len();
        let (applied_force, inverse_mass) = (&applied_force[..count], &inverse_mass[..count]);
        let (position, velocity) = (&mut position[..count], &mut velocity[..count]);
        let mut advance = |force: f32, position: &mut f32, velocity: &mut f32, index: usize| {
            let acceleration = answer(force, inverse_mass[index], gravity);
            advance(acceleration, position, velocity, index);
            acceleration
        };
        // A loop each, without a branch.
        match next {
            Next::Acceleration => {
                for index in 0..count {
                    force[index] = advance(force[index], &mut position[index], &mut velocity[index], index);
                }
            }
            Next::Nothing => {
                for index in 0..count {
                    advance(force[index], &mut position[index], &mut velocity[index], index);
                    force[index] = 0.0;
                }
            }
            Next::Drive => {
                for index in 0..count {
                    advance(force[index], &mut position[index], &mut velocity[index], index);
                    force[index] = drive(applied_force[index], viscosity, velocity[index]);
                }
            }
        }
    }
}
