//! The forces of springs in runs: a chunk of them at a time, eight together.

use bevy::math::Vec3;

use super::Motion;
use super::accelerations::LANES;
use crate::solver::elements::{Element, Spring};
use crate::solver::graph::block::{Block, MAX_JOINED, Run};

/// Numbers computed together.
type Lanes = [f32; LANES];

/// Forces of the springs of a chunk, from index `LANES`, with zeros on both sides.
struct Forces([[f32; LANES + MAX_JOINED + LANES + LANES]; 3]);

/// Adds the forces of all springs in runs. Work of its own, as the compiler would else copy it into each that evaluates
/// forces.
pub(super) struct AddSprings<'a, 'b> {
    pub block: &'a Block,
    pub motion: &'a Motion<'a>,
    pub force: &'a mut [&'b mut [f32]; 3],
}

impl pulp::WithSimd for AddSprings<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { block, motion, force } = self;
        let start = block.slots.start;
        let mut forces = Forces([[0.0; LANES + MAX_JOINED + LANES + LANES]; 3]);
        for run in &block.runs {
            let (count, offset) = (run.count as usize, (run.upper - run.lower) as usize);
            let mut done = 0;
            while done < count {
                let chunk = run.chunk_from(done);
                let part = (done, chunk);
                match (run.tension_only, run.material) {
                    (false, Some(_)) => compute::<false, true>(block, run, part, motion, &mut forces),
                    (true, Some(_)) => compute::<true, true>(block, run, part, motion, &mut forces),
                    (false, None) => compute::<false, false>(block, run, part, motion, &mut forces),
                    (true, None) => compute::<true, false>(block, run, part, motion, &mut forces),
                }
                // Only runs of one chunk have holes: few places each, for which a call takes longer than they do.
                let [x, y, z] = &mut forces.0;
                for hole in &run.holes {
                    for place in LANES + hole.start as usize..LANES + hole.end as usize {
                        (x[place], y[place], z[place]) = (0.0, 0.0, 0.0);
                    }
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
}

/// The forces of `chunk` springs of a run, from the one numbered `done`, on their lower ends.
#[inline(always)]
fn compute<const TENSION_ONLY: bool, const IS_UNIFORM: bool>(
    block: &Block,
    run: &Run,
    (done, chunk): (usize, usize),
    motion: &Motion,
    Forces([x, y, z]): &mut Forces,
) {
    let lower = run.lower as usize + done - motion.first;
    let upper = run.upper as usize + done - motion.first;
    let start = run.start as usize + done;
    let [stiffness, damping] = run.material.unwrap_or_default();
    let material = [[stiffness; LANES], [damping; LANES]];
    // The last vector overlaps the one before it and computes some springs again.
    let last = (chunk - LANES, usize::from(!chunk.is_multiple_of(LANES)));
    for (first, count) in [(0, chunk / LANES), last] {
        // Slices of one length: the indices of vectors need no checks.
        let position = [
            lanes_of(motion.position, lower + first, count),
            lanes_of(motion.position, upper + first, count),
        ];
        let velocity = [
            lanes_of(motion.velocity, lower + first, count),
            lanes_of(motion.velocity, upper + first, count),
        ];
        let rest_length = lanes(&block.rest_length, start + first, count);
        let stiffness = lanes(&block.stiffness, start + first, count);
        let damping = lanes(&block.damping, start + first, count);
        let x = &mut x[LANES + first..].as_chunks_mut().0[..count];
        let y = &mut y[LANES + first..].as_chunks_mut().0[..count];
        let z = &mut z[LANES + first..].as_chunks_mut().0[..count];
        for at in 0..count {
            let all = |vectors: &[[&[Lanes]; 3]; 2]| {
                let [[x, y, z], [u, v, w]] = vectors;
                [[x[at], y[at], z[at]], [u[at], v[at], w[at]]]
            };
            let material = if IS_UNIFORM { material } else { [stiffness[at], damping[at]] };
            [x[at], y[at], z[at]] =
                pulls::<TENSION_ONLY>(all(&position), all(&velocity), rest_length[at], material);
        }
    }
}

/// The same of three axes. (`array::map` is not always inlined.)
#[inline(always)]
fn lanes_of([x, y, z]: [&[f32]; 3], first: usize, count: usize) -> [&[Lanes]; 3] {
    [lanes(x, first, count), lanes(y, first, count), lanes(z, first, count)]
}

/// `count` vectors of the numbers from `first` on.
#[inline(always)]
fn lanes(numbers: &[f32], first: usize, count: usize) -> &[Lanes] {
    let (vectors, _) = numbers[first..].as_chunks();
    &vectors[..count]
}

/// The forces of springs on their lower ends, from the motion of both ends.
#[inline(always)]
fn pulls<const TENSION_ONLY: bool>(
    position: [[Lanes; 3]; 2],
    velocity: [[Lanes; 3]; 2],
    rest_length: Lanes,
    [stiffness, damping]: [Lanes; 2],
) -> [Lanes; 3] {
    let mut pulls = [[0.0; LANES]; 3];
    for lane in 0..LANES {
        let between = |[lower, upper]: &[[Lanes; 3]; 2]| {
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
        let pull = spring.pull(between(&position), between(&velocity));
        (pulls[0][lane], pulls[1][lane], pulls[2][lane]) = (pull.x, pull.y, pull.z);
    }
    pulls
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
        if let Some(beyond) = pull[end..].first_chunk_mut() {
            *beyond = [0.0; LANES];
        }
        let ahead = &pull[LANES..end + offset];
        let behind = &pull[LANES - offset..end];
        for (force, (ahead, behind)) in
            force[at..at + count + offset].iter_mut().zip(ahead.iter().zip(behind))
        {
            *force += ahead - behind;
        }
    }
}
