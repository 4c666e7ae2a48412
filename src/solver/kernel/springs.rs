//! The forces of springs in runs: a chunk of them at a time, eight together.

use bevy::math::Vec3;

use super::Motion;
use super::accelerations::LANES;
use crate::solver::elements::{Element, Spring};
use crate::solver::graph::anchored::MAX_ANCHORED;
use crate::solver::graph::block::{Block, MAX_JOINED, Run};

/// Numbers computed together.
type Lanes = [f32; LANES];

/// Working memory of the forces of springs.
pub(super) struct SpringForces {
    /// Those of the springs of a chunk, from index `LANES`, with zeros on both sides.
    chunk: Chunk,
    /// The pulls of anchored springs.
    anchored: [Vec3; MAX_ANCHORED],
}

type Chunk = [[f32; LANES + MAX_JOINED + LANES + LANES]; 3];

impl SpringForces {
    pub fn new() -> Self {
        let chunk = [[0.0; LANES + MAX_JOINED + LANES + LANES]; 3];
        Self { chunk, anchored: [Vec3::ZERO; MAX_ANCHORED] }
    }

    /// The pull of an anchored spring that was computed in a run.
    #[inline(always)]
    pub fn anchored(&self, number: u32) -> Vec3 {
        self.anchored[number as usize % MAX_ANCHORED]
    }
}

/// Adds the forces of all springs in runs. Work of its own, as the compiler would else copy it into each that evaluates
/// forces.
pub(super) struct AddSprings<'a, 'b> {
    pub block: &'a Block,
    pub motion: &'a Motion<'a>,
    pub force: &'a mut [&'b mut [f32]; 3],
    pub forces: &'a mut SpringForces,
}

impl pulp::WithSimd for AddSprings<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { block, motion, force, forces } = self;
        let start = block.slots.start;
        let SpringForces { chunk: forces, anchored: pulls } = forces;
        let mut anchored = block.anchored.iter().zip(pulls).peekable();
        for run in &block.runs {
            let (count, offset) = (run.count as usize, (run.upper - run.lower) as usize);
            let mut done = 0;
            while done < count {
                let chunk = run.chunk_from(done);
                let part = (done, chunk);
                match (run.tension_only, run.material) {
                    (false, Some(_)) => compute::<false, true>(block, run, part, motion, forces),
                    (true, Some(_)) => compute::<true, true>(block, run, part, motion, forces),
                    (false, None) => compute::<false, false>(block, run, part, motion, forces),
                    (true, None) => compute::<true, false>(block, run, part, motion, forces),
                }
                // Only runs of one chunk have holes: few places each, for which a call takes longer than they do.
                let [x, y, z] = &mut *forces;
                for hole in &run.holes {
                    let end = run.start + hole.end;
                    while let Some((place, pull)) = anchored.next_if(|(anchored, _)| anchored.place < end) {
                        let at = LANES + (place.place - run.start) as usize;
                        *pull = Vec3::new(x[at], y[at], z[at]);
                    }
                    for place in LANES + hole.start as usize..LANES + hole.end as usize {
                        (x[place], y[place], z[place]) = (0.0, 0.0, 0.0);
                    }
                }
                let lower = (run.lower as usize + done).wrapping_sub(start);
                let upper = (run.upper as usize + done).wrapping_sub(start);
                if run.owned == [true; 2] && offset <= LANES {
                    add_both(force, lower, offset, chunk, forces);
                } else {
                    if run.owned[0] {
                        add(force, lower, chunk, forces);
                    }
                    if run.owned[1] {
                        subtract(force, upper, chunk, forces);
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
    [x, y, z]: &mut Chunk,
) {
    let lower = run.lower as usize + done - motion.first;
    let upper = run.upper as usize + done - motion.first;
    let start = run.start as usize + done;
    let [stiffness, damping] = run.material.unwrap_or_default();
    let material = [[stiffness; LANES], [damping; LANES]];
    // Slices of one length: the indices of vectors need no checks.
    let ends = [
        part(motion.position, lower, chunk),
        part(motion.position, upper, chunk),
        part(motion.velocity, lower, chunk),
        part(motion.velocity, upper, chunk),
    ];
    let parameters = part([&block.rest_length, &block.stiffness, &block.damping], start, chunk);
    let (x, y, z) = (&mut x[LANES..][..chunk], &mut y[LANES..][..chunk], &mut z[LANES..][..chunk]);
    {
        let ends = [all(ends[0]), all(ends[1]), all(ends[2]), all(ends[3])];
        let [rest_length, stiffness, damping] = all(parameters);
        let (x, y, z) = (x.as_chunks_mut().0, y.as_chunks_mut().0, z.as_chunks_mut().0);
        for at in 0..chunk / LANES {
            let end = |end: usize| [ends[end][0][at], ends[end][1][at], ends[end][2][at]];
            let material = if IS_UNIFORM { material } else { [stiffness[at], damping[at]] };
            [x[at], y[at], z[at]] =
                pulls::<TENSION_ONLY>([end(0), end(1)], [end(2), end(3)], rest_length[at], material);
        }
    }
    if !chunk.is_multiple_of(LANES) {
        // The last vector overlaps the one before it and computes some springs again.
        let [rest_length, stiffness, damping] = last(parameters);
        let material = if IS_UNIFORM { material } else { [stiffness, damping] };
        let pulls = pulls::<TENSION_ONLY>(
            [last(ends[0]), last(ends[1])],
            [last(ends[2]), last(ends[3])],
            rest_length,
            material,
        );
        let at = chunk - LANES;
        x[at..].copy_from_slice(&pulls[0]);
        y[at..].copy_from_slice(&pulls[1]);
        z[at..].copy_from_slice(&pulls[2]);
    }
}

/// `count` numbers from `at` of three arrays. (`array::map` is not always inlined.)
#[inline(always)]
fn part([x, y, z]: [&[f32]; 3], at: usize, count: usize) -> [&[f32]; 3] {
    [&x[at..][..count], &y[at..][..count], &z[at..][..count]]
}

/// Whole vectors from the start.
#[inline(always)]
fn all([x, y, z]: [&[f32]; 3]) -> [&[Lanes]; 3] {
    [x.as_chunks().0, y.as_chunks().0, z.as_chunks().0]
}

/// The vectors at the end.
#[inline(always)]
fn last([x, y, z]: [&[f32]; 3]) -> [Lanes; 3] {
    let last = |numbers: &[f32]| numbers.last_chunk().copied().unwrap_or([0.0; LANES]);
    [last(x), last(y), last(z)]
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
fn add(force: &mut [&mut [f32]; 3], at: usize, count: usize, forces: &Chunk) {
    for (force, pull) in force.iter_mut().zip(forces) {
        for (force, pull) in force[at..at + count].iter_mut().zip(&pull[LANES..LANES + count]) {
            *force += pull;
        }
    }
}

/// Subtracts forces from the particles from `at`.
#[inline(always)]
fn subtract(force: &mut [&mut [f32]; 3], at: usize, count: usize, forces: &Chunk) {
    for (force, pull) in force.iter_mut().zip(forces) {
        for (force, pull) in force[at..at + count].iter_mut().zip(&pull[LANES..LANES + count]) {
            *force -= pull;
        }
    }
}

/// Adds forces to the particles from `at` and subtracts them from those `offset` further, in one: what
/// is stored is not loaded again at once.
#[inline(always)]
fn add_both(force: &mut [&mut [f32]; 3], at: usize, offset: usize, count: usize, forces: &mut Chunk) {
    let end = LANES + count;
    for (force, pull) in force.iter_mut().zip(forces) {
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
