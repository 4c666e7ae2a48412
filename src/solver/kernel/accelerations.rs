//! The forces on the particles of one block, and their accelerations.

use bevy::math::Vec3;

use super::bends::AddBends;
use super::springs::{AddSprings, SpringForces};
use super::workspace::Workspace;
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
        fn add_all_loose(
            block: &Block,
            motion: &Motion,
            force: &mut [&mut [f32]; 3],
            computed: &SpringForces,
        ) {
            let start = block.slots.start;
            $($(#[$meta])* add_loose::<$element, $ends>(&block.loose.$kind, motion, force, computed, start);)*
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
    let start = block.slots.start;
    begin_forces(start, motion, field, acceleration);
    add_elements(block, motion, field, acceleration);
    let count = acceleration[0].len();
    // The same in the arrays of the motion.
    let range = start - motion.first..start - motion.first + count;
    let gravity = field.gravity.to_array();
    for part in in_vectors(start, count) {
        let inverse_mass = &motion.inverse_mass[range.start + part.start..range.start + part.end];
        for (force, gravity) in acceleration.iter_mut().zip(gravity) {
            let force = &mut force[part.clone()];
            for index in 0..force.len() {
                force[index] = answer(force[index], inverse_mass[index], gravity);
            }
        }
    }
    if let Some(air) = field.air {
        for (axis, acceleration) in acceleration.iter_mut().enumerate() {
            air.brake(axis, start, &motion.velocity[axis][range.clone()], acceleration);
        }
        if !air.filaments.is_empty() {
            air.brake_filaments(start, motion.velocity.map(|axis| &axis[range.clone()]), acceleration);
        }
    }
}

/// Newton's second law: a = f / m + g, and 0 for pinned particles. Gravity is added as an acceleration, so that free fall
/// does not depend on the mass, not even by a rounding.
#[inline(always)]
pub(super) fn answer(force: f32, inverse_mass: f32, gravity: f32) -> f32 {
    let free = force * inverse_mass + gravity;
    if inverse_mass > 0.0 { free } else { 0.0 }
}

/// The applied force and the drag of the medium, −ν v. Plus 0, so that it is never −0: to add 0 later changes no bit.
#[inline(always)]
pub(super) fn drive(applied_force: f32, viscosity: f32, velocity: f32) -> f32 {
    (applied_force + 0.0) - viscosity * velocity
}

/// Whether it is known that [`drive`] is zero for all particles.
#[inline(always)]
pub(super) fn is_undriven(is_unpushed: bool, field: &Field) -> bool {
    is_unpushed && field.viscosity == 0.0
}

/// Writes the forces without those of elements and gases on the particles from slot `start` on.
#[inline(always)]
pub(super) fn begin_forces(start: usize, motion: &Motion, field: &Field, force: &mut [&mut [f32]; 3]) {
    if is_undriven(motion.is_unpushed, field) {
        // What follows would come to this.
        force.iter_mut().for_each(|force| force.fill(0.0));
        return;
    }
    let first = start - motion.first;
    for part in in_vectors(start, force[0].len()) {
        let seen = first + part.start..first + part.end;
        for (axis, force) in force.iter_mut().enumerate() {
            let applied_force = &motion.applied_force[axis][seen.clone()];
            let velocity = &motion.velocity[axis][seen.clone()];
            let force = &mut force[part.clone()];
            for index in 0..force.len() {
                force[index] = drive(applied_force[index], field.viscosity, velocity[index]);
            }
        }
    }
}

/// Adds the forces of gases and of all elements to the particles of a block.
#[inline(always)]
pub(super) fn add_elements(block: &Block, motion: &Motion, field: &Field, force: &mut [&mut [f32]; 3]) {
    let [x, y, z] = force;
    let mut force = [&mut **x, &mut **y, &mut **z];
    let inverse_mass = &motion.inverse_mass[block.slots.start - motion.first..][..force[0].len()];
    if inverse_mass.iter().all(|inverse_mass| *inverse_mass == 0.0) {
        // The pinned edge of a cloth: no force moves it.
        return;
    }
    if let Some(gas) = field.gas {
        let slots = block.slots.start..block.slots.start + force[0].len();
        for (force, gas) in force.iter_mut().zip(gas.axes()) {
            force.iter_mut().zip(&gas[slots.clone()]).for_each(|(force, gas)| *force += gas);
        }
    }
    Workspace::with(|Workspace { springs, bends }| {
        if !block.runs.is_empty() {
            run(AddSprings { block, motion, force: &mut force, forces: springs });
        }
        if AddBends::is_needed(block) {
            run(AddBends { block, motion, force: &mut force, buffers: bends });
        }
        run(AddLoose { block, motion, force: &mut force, computed: springs });
    });
}

/// Adds the forces of all loose elements. Work of its own, as what a closure does is not compiled for the best instructions.
struct AddLoose<'a, 'b> {
    block: &'a Block,
    motion: &'a Motion<'a>,
    force: &'a mut [&'b mut [f32]; 3],
    computed: &'a SpringForces,
}

impl pulp::WithSimd for AddLoose<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { block, motion, force, computed } = self;
        add_all_loose(block, motion, force, computed);
    }
}

/// Adds the forces of loose elements one by one. Their ends are anywhere: to gather eight of them takes longer than to
/// compute them together saves.
#[inline(always)]
fn add_loose<E: Element<N>, const N: usize>(
    loose: &[Loose<E, N>],
    motion: &Motion,
    force: &mut [&mut [f32]; 3],
    computed: &SpringForces,
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
    for Loose { ends, owned, element, computed: number } in loose {
        let weights = element.weights();
        let pull = if let Some(number) = number {
            // In runs, pulls are those of the lower ends.
            let pull = computed.anchored(*number);
            if ends[0] < ends[1] { pull } else { -pull }
        } else {
            // What is undamped does not depend on velocities: they need not be read.
            let is_damped = element.rates().damping != 0.0;
            let rate = if is_damped { combine(velocity, ends, weights, first) } else { Vec3::ZERO };
            element.pull(combine(position, ends, weights, first), rate)
        };
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
