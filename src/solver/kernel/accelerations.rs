//! The forces on the particles of one block, and their accelerations.

use bevy::math::Vec3;

use super::bends::AddBends;
use super::{Motion, in_vectors, run};
use crate::solver::elements::{Element, Spring, for_each_kind};
use crate::solver::field::Field;
use crate::solver::graph::block::{Block, Loose, MIN_RUN, Run};

/// Springs computed before their forces are added: enough that the additions do not wait for the
/// stores of those before.
const CHUNK: usize = 64;

/// Springs computed together: a vector of AVX2.
pub(super) const LANES: usize = MIN_RUN;

/// Forces of the springs of a chunk, from index `LANES`, with zeros on both sides.
struct Forces([[f32; LANES + CHUNK + LANES + LANES]; 3]);

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
    let range = block.slots.start..block.slots.start + count;
    for part in in_vectors(block.slots.start, count) {
        let slots = range.start + part.start..range.start + part.end;
        for (axis, force) in force.iter_mut().enumerate() {
            let applied_force = &motion.applied_force[axis][slots.clone()];
            let velocity = &motion.velocity[axis][slots.clone()];
            let force = &mut force[part.clone()];
            for index in 0..force.len() {
                // The drag of the medium: −ν v. Plus 0, so that it is never −0: to add 0 later changes no bit.
                force[index] = (applied_force[index] + 0.0) - field.viscosity * velocity[index];
            }
        }
    }
    if let Some(gas) = field.gas {
        for (force, gas) in force.iter_mut().zip(gas.axes()) {
            force.iter_mut().zip(&gas[range.clone()]).for_each(|(force, gas)| *force += gas);
        }
    }
    add_runs(block, motion, &mut force, block.slots.start);
    if AddBends::is_needed(block) {
        run(AddBends { block, motion, force: &mut force });
    }
    add_all_loose(block, motion, &mut force);
    // Newton's second law: a = f / m + g, and 0 for pinned particles. Gravity is added as an
    // acceleration, so that free fall does not depend on the mass, not even by a rounding.
    let gravity = field.gravity.to_array();
    for part in in_vectors(block.slots.start, count) {
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
            air.brake(axis, range.start, &motion.velocity[axis][range.clone()], acceleration);
        }
        if !air.filaments.is_empty() {
            air.brake_filaments(range.start, motion.velocity.map(|axis| &axis[range.clone()]), &mut force);
        }
    }
}

#[inline(always)]
fn add_runs(block: &Block, motion: &Motion, force: &mut [&mut [f32]; 3], start: usize) {
    let mut forces = Forces([[0.0; LANES + CHUNK + LANES + LANES]; 3]);
    for run in &block.runs {
        let count = run.count as usize;
        let offset = (run.upper - run.lower) as usize;
        let mut done = 0;
        while done < count {
            // What is left after a chunk fills a vector, or there is none.
            let left = count - done;
            let chunk = if left < CHUNK + LANES { left } else { CHUNK };
            match run.tension_only {
                false => run_forces::<false>(block, run, done, chunk, motion, &mut forces),
                true => run_forces::<true>(block, run, done, chunk, motion, &mut forces),
            }
            let lower = (run.lower as usize + done).wrapping_sub(start);
            let upper = (run.upper as usize + done).wrapping_sub(start);
            if run.owned == [true; 2] && offset <= LANES {
                add_both(force, lower, offset, chunk, &mut forces);
            } else {
                if run.owned[0] {
                    add(force, lower, chunk, &forces);
                }
                if run.owned[1] {
                    subtract(force, upper, chunk, &forces);
                }
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
fn run_forces<const TENSION_ONLY: bool>(
    block: &Block,
    run: &Run,
    done: usize,
    chunk: usize,
    motion: &Motion,
    forces: &mut Forces,
) {
    let lanes = |array: &'_ [f32], at: usize| -> [f32; LANES] {
        array[at..at + LANES].first_chunk().copied().unwrap_or([0.0; LANES])
    };
    let (count, lower, start) = (run.count as usize, run.lower as usize, run.start as usize);
    let offset = (run.upper - run.lower) as usize;
    // Slices of one length: an index is checked for all of them at once. (`array::map` is not always inlined.)
    let length = offset + count;
    let [x, y, z] = motion.position;
    let position = [&x[lower..][..length], &y[lower..][..length], &z[lower..][..length]];
    let [x, y, z] = motion.velocity;
    let velocity = [&x[lower..][..length], &y[lower..][..length], &z[lower..][..length]];
    let rest_lengths = &block.rest_length[start..start + count];
    for first in (0..chunk).step_by(LANES) {
        // The last vector of a run overlaps the one before it and computes some springs again.
        let at = (done + first).min(count - LANES);
        let all = |[x, y, z]: [&[f32]; 3], at: usize| [lanes(x, at), lanes(y, at), lanes(z, at)];
        let (lower_position, upper_position) = (all(position, at), all(position, at + offset));
        let (lower_velocity, upper_velocity) = (all(velocity, at), all(velocity, at + offset));
        let rest_length = lanes(rest_lengths, at);
        let [stiffness, damping] = match run.material {
            Some([stiffness, damping]) => [[stiffness; LANES], [damping; LANES]],
            None => [lanes(&block.stiffness, start + at), lanes(&block.damping, start + at)],
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
            let spring = Spring {
                rest_length: rest_length[lane],
                stiffness: stiffness[lane],
                damping: damping[lane],
                tension_only: TENSION_ONLY,
                ..Spring::elastic(0.0, 0.0, 0.0)
            };
            let pull = spring
                .pull(between(&lower_position, &upper_position), between(&lower_velocity, &upper_velocity));
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

/// Adds the forces of loose elements: gathered, computed together, and added one after the other; the last ones,
/// too few to fill a vector, one by one.
#[inline(always)]
fn add_loose<E: Element<N>, const N: usize>(
    loose: &[Loose<E, N>],
    motion: &Motion,
    force: &mut [&mut [f32]; 3],
    start: usize,
) {
    let mut add = |Loose { ends, owned, element }: &Loose<E, N>, pull: Vec3| {
        for ((&end, owned), weight) in ends.iter().zip(owned).zip(element.weights()) {
            if *owned {
                for (force, pull) in force.iter_mut().zip(pull.to_array()) {
                    force[end as usize - start] += weight * pull;
                }
            }
        }
    };
    let (groups, last) = loose.as_chunks::<LANES>();
    for group in groups {
        // By coordinate, in place of arrays of vectors: those would be stored in other pieces than they are loaded in.
        let (mut separations, mut rates) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
        for (lane, Loose { ends, element, .. }) in group.iter().enumerate() {
            let separation = combine(motion.position, ends, element.weights());
            let rate = combine(motion.velocity, ends, element.weights());
            for axis in 0..3 {
                (separations[axis][lane], rates[axis][lane]) = (separation[axis], rate[axis]);
            }
        }
        let mut pulls = [[0.0; LANES]; 3];
        for lane in 0..LANES {
            let vector = |axes: &[[f32; LANES]; 3]| Vec3::new(axes[0][lane], axes[1][lane], axes[2][lane]);
            let pull = group[lane].element.pull(vector(&separations), vector(&rates));
            (pulls[0][lane], pulls[1][lane], pulls[2][lane]) = (pull.x, pull.y, pull.z);
        }
        for (lane, loose) in group.iter().enumerate() {
            add(loose, Vec3::new(pulls[0][lane], pulls[1][lane], pulls[2][lane]));
        }
    }
    for loose in last {
        let of = |vectors| combine(vectors, &loose.ends, loose.element.weights());
        add(loose, loose.element.pull(of(motion.position), of(motion.velocity)));
    }
}

/// Σ cᵢ vᵢ over the ends of an element.
#[inline(always)]
fn combine<const N: usize>([x, y, z]: [&[f32]; 3], ends: &[u32; N], weights: [f32; N]) -> Vec3 {
    let vector = |end: u32| Vec3::new(x[end as usize], y[end as usize], z[end as usize]);
    let first = vector(ends[0]) * weights[0];
    ends[1..].iter().zip(&weights[1..]).fold(first, |sum, (end, weight)| sum + vector(*end) * *weight)
}
