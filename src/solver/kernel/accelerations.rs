//! The forces on the particles of one block, and their accelerations.

use bevy::math::Vec3;

use super::bends::AddBends;
use super::springs::AddSprings;
use super::{Motion, in_vectors, run};
use crate::solver::elements::{Element, for_each_kind};
use crate::solver::field::Field;
use crate::solver::graph::block::{Block, Loose, MIN_RUN};

/// Springs computed together: a vector of AVX2.
pub(super) const LANES: usize = MIN_RUN;

macro_rules! define_add_loose {
    ($($(#[$meta:meta])* $kind:ident: $element:ty, $ends:literal;)*) => {
        /// Adds the forces of the loose elements of all kinds.
        #[inline(always)]
        fn add_all_loose(block: &Block, motion: &Motion, force: &mut [&mut [f32]; 3]) {
            $($(#[$meta])* add_loose::<$element, $ends>(&block.loose.$kind, motion, force, block.slots.start);)*
        }
    };
}
for_each_kind!(define_add_loose);

/// Writes the accelerations of the particles of `block`.
#[inline(always)]
pub(super) fn block_accelerations(
    block: &Block,
    motion: &Motion,
    field: &Field,
    acceleration: &mut [&mut [f32]; 3],
) {
    let [x, y, z] = acceleration;
    let mut force = [&mut **x, &mut **y, &mut **z];
    let count = force[0].len();
    let slots = block.slots.start..block.slots.start + count;
    // The same in the arrays of the motion.
    let range = slots.start - motion.first..slots.end - motion.first;
    if motion.is_unpushed && field.viscosity == 0.0 {
        // What follows would come to this.
        force.iter_mut().for_each(|force| force.fill(0.0));
    } else {
        for part in in_vectors(slots.start, count) {
            let seen = range.start + part.start..range.start + part.end;
            for (axis, force) in force.iter_mut().enumerate() {
                let applied_force = &motion.applied_force[axis][seen.clone()];
                let velocity = &motion.velocity[axis][seen.clone()];
                let force = &mut force[part.clone()];
                for index in 0..force.len() {
                    // The drag of the medium: −ν v. Plus 0, so that it is never −0: to add 0 later changes no bit.
                    force[index] = (applied_force[index] + 0.0) - field.viscosity * velocity[index];
                }
            }
        }
    }
    if let Some(gas) = field.gas {
        for (force, gas) in force.iter_mut().zip(gas.axes()) {
            force.iter_mut().zip(&gas[slots.clone()]).for_each(|(force, gas)| *force += gas);
        }
    }
    if !block.runs.is_empty() {
        run(AddSprings { block, motion, force: &mut force });
    }
    if AddBends::is_needed(block) {
        run(AddBends { block, motion, force: &mut force });
    }
    add_all_loose(block, motion, &mut force);
    // Newton's second law: a = f / m + g, and 0 for pinned particles. Gravity is added as an
    // acceleration, so that free fall does not depend on the mass, not even by a rounding.
    let gravity = field.gravity.to_array();
    for part in in_vectors(slots.start, count) {
        let inverse_mass = &motion.inverse_mass[range.start + part.start..range.start + part.end];
        for (force, gravity) in force.iter_mut().zip(gravity) {
            let force = &mut force[part.clone()];
            for index in 0..force.len() {
                let free = force[index] * inverse_mass[index] + gravity;
                force[index] = if inverse_mass[index] > 0.0 { free } else { 0.0 };
            }
        }
    }
    if let Some(air) = field.air {
        for (axis, acceleration) in force.iter_mut().enumerate() {
            air.brake(axis, slots.start, &motion.velocity[axis][range.clone()], acceleration);
        }
        if !air.filaments.is_empty() {
            air.brake_filaments(slots.start, motion.velocity.map(|axis| &axis[range.clone()]), &mut force);
        }
    }
}

/// Adds the forces of loose elements one by one. Their ends are anywhere: to gather eight of them takes longer than to
/// compute them together saves.
#[inline(always)]
fn add_loose<E: Element<N>, const N: usize>(
    loose: &[Loose<E, N>],
    motion: &Motion,
    force: &mut [&mut [f32]; 3],
    start: usize,
) {
    if loose.is_empty() {
        return;
    }
    let (position, velocity) = (alike(motion.position), alike(motion.velocity));
    let first = motion.first;
    let [x, y, z] = force;
    let count = x.len();
    let (x, y, z) = (&mut x[..count], &mut y[..count], &mut z[..count]);
    for Loose { ends, owned, element } in loose {
        let weights = element.weights();
        // What is undamped does not depend on velocities: they need not be read.
        let is_damped = element.rates().damping != 0.0;
        let rate = if is_damped { combine(velocity, ends, weights, first) } else { Vec3::ZERO };
        let pull = element.pull(combine(position, ends, weights, first), rate);
        for end in 0..N {
            if owned[end] {
                let at = ends[end] as usize - start;
                x[at] += weights[end] * pull.x;
                y[at] += weights[end] * pull.y;
                z[at] += weights[end] * pull.z;
            }
        }
    }
}

/// Coordinates as slices of one length: an index is checked for all of them at once.
#[inline(always)]
fn alike([x, y, z]: [&[f32]; 3]) -> [&[f32]; 3] {
    let count = x.len();
    [&x[..count], &y[..count], &z[..count]]
}

/// Σ cᵢ vᵢ over the ends of an element, of vectors from the slot `first` on.
#[inline(always)]
fn combine<const N: usize>([x, y, z]: [&[f32]; 3], ends: &[u32; N], weights: [f32; N], first: usize) -> Vec3 {
    let mut sum = Vec3::ZERO;
    for number in 0..N {
        let end = ends[number] as usize - first;
        let part = Vec3::new(x[end], y[end], z[end]) * weights[number];
        sum = if number == 0 { part } else { sum + part };
    }
    sum
}
