//! The forces of bends in runs: eight are loaded, computed and stored at a time without gathering.

use bevy::math::Vec3;

use super::Motion;
use super::accelerations::{CHUNK, LANES};
use crate::solver::elements::{Bend, for_each_bend};
use crate::solver::graph::block::Block;
use crate::solver::graph::{BendList, BendRun};

/// The pulls of the bends of a chunk, from index `LANES`, with zeros on both sides.
struct Pulls([[f32; LANES + CHUNK + LANES + LANES]; 3]);

/// Adds the forces of all bends in runs. Work of its own, as the compiler would else copy it into each that evaluates
/// forces.
pub(super) struct AddBends<'a, 'b> {
    pub block: &'a Block,
    pub motion: Motion<'a>,
    pub force: &'a mut [&'b mut [f32]; 3],
}

macro_rules! define_add_bends {
    ($($(#[$meta:meta])* $kind:ident: $ends:literal;)*) => {
        impl AddBends<'_, '_> {
            /// Whether there are any.
            pub fn is_needed(block: &Block) -> bool {
                let mut any = false;
                $($(#[$meta])* { any |= !block.bends.$kind.runs.is_empty(); })*
                any
            }
        }

        impl pulp::WithSimd for AddBends<'_, '_> {
            type Output = ();

            #[inline(always)]
            fn with_simd<S: pulp::Simd>(self, _: S) {
                let Self { block, motion, force } = self;
                $($(#[$meta])* add_bends(&block.bends.$kind, motion, force, block.slots.start);)*
            }
        }
    };
}
for_each_bend!(define_add_bends);

#[inline(always)]
fn add_bends<const N: usize>(list: &BendList<N>, motion: Motion, force: &mut [&mut [f32]; 3], start: usize) {
    let mut pulls = Pulls([[0.0; LANES + CHUNK + LANES + LANES]; 3]);
    for run in &list.runs {
        let count = run.count as usize;
        let mut done = 0;
        while done < count {
            // What is left after a chunk fills a vector, or there is none.
            let left = count - done;
            let chunk = if left < CHUNK + LANES { left } else { CHUNK };
            match (run.is_curved, run.is_damped) {
                (false, false) => compute::<false, false, N>(list, run, (done, chunk), motion, &mut pulls),
                (false, true) => compute::<false, true, N>(list, run, (done, chunk), motion, &mut pulls),
                (true, _) => compute::<true, true, N>(list, run, (done, chunk), motion, &mut pulls),
            }
            match run.weights {
                Some(weights) => add_uniform(run, weights, (done, chunk), &mut pulls, force, start),
                None => add_each(list, run, (done, chunk), &pulls, force, start),
            }
            done += chunk;
        }
    }
}

#[inline(always)]
fn lanes(array: &[f32], at: usize) -> [f32; LANES] {
    array[at..at + LANES].first_chunk().copied().unwrap_or([0.0; LANES])
}

/// The pulls of `chunk` bends of a run, from the one numbered `done`.
#[inline(always)]
fn compute<const CURVED: bool, const DAMPED: bool, const N: usize>(
    list: &BendList<N>,
    run: &BendRun<N>,
    (done, chunk): (usize, usize),
    motion: Motion,
    pulls: &mut Pulls,
) {
    let count = run.count as usize;
    let mut weights = run.weights.unwrap_or([0.0; N]).map(|weight| [weight; LANES]);
    for first in (0..chunk).step_by(LANES) {
        // The last vector of a run overlaps the one before it and computes some bends again.
        let at = (done + first).min(count - LANES);
        let place = run.start as usize + at;
        if run.weights.is_none() {
            for (weights, all) in weights.iter_mut().zip(&list.weights) {
                *weights = lanes(all, place);
            }
        }
        let separation = combine(motion.position, run, at, &weights);
        let rate = if DAMPED { combine(motion.velocity, run, at, &weights) } else { [[0.0; LANES]; 3] };
        let rest_length = if CURVED { lanes(&list.rest_length, place) } else { [0.0; LANES] };
        let [stiffness, damping] = match run.material {
            Some(material) => material.map(|value| [value; LANES]),
            None => [lanes(&list.stiffness, place), lanes(&list.damping, place)],
        };
        let mut found = [[0.0; LANES]; 3];
        for lane in 0..LANES {
            let vector = |axes: &[[f32; LANES]; 3]| Vec3::new(axes[0][lane], axes[1][lane], axes[2][lane]);
            let material = [rest_length[lane], stiffness[lane], damping[lane]];
            let pull = Bend::<N>::pull_of::<CURVED, DAMPED>(material, vector(&separation), vector(&rate));
            found[0][lane] = pull.x;
            found[1][lane] = pull.y;
            found[2][lane] = pull.z;
        }
        for (pulls, found) in pulls.0.iter_mut().zip(found) {
            let at = LANES + at - done;
            pulls[at..at + LANES].copy_from_slice(&found);
        }
    }
}

/// Σ cᵢ vᵢ over the ends of eight bends of a run, from the one numbered `at`.
#[inline(always)]
fn combine<const N: usize>(
    vectors: [&[f32]; 3],
    run: &BendRun<N>,
    at: usize,
    weights: &[[f32; LANES]; N],
) -> [[f32; LANES]; 3] {
    let mut sums = [[0.0; LANES]; 3];
    for (sums, vectors) in sums.iter_mut().zip(vectors) {
        for (end, weights) in weights.iter().enumerate() {
            let values = lanes(vectors, run.first[end] as usize + at);
            for lane in 0..LANES {
                let term = values[lane] * weights[lane];
                sums[lane] = if end == 0 { term } else { sums[lane] + term };
            }
        }
    }
    sums
}

/// Adds the forces of bends with the same weights. Ends that are near each other are added to together: what is
/// stored is not loaded again at once.
#[inline(always)]
fn add_uniform<const N: usize>(
    run: &BendRun<N>,
    weights: [f32; N],
    (done, chunk): (usize, usize),
    pulls: &mut Pulls,
    force: &mut [&mut [f32]; 3],
    start: usize,
) {
    let end = LANES + chunk;
    // Those before the chunk are zero always.
    pulls.0.iter_mut().for_each(|pulls| pulls[end..end + LANES].fill(0.0));
    let mut next = 0;
    while next < N {
        let first = run.order[next] as usize;
        let mut offsets = [0; 3];
        let mut factors = [0.0; 3];
        let mut together = 0;
        while together < 3 && next + together < N {
            let other = run.order[next + together] as usize;
            let offset = (run.first[other] - run.first[first]) as usize;
            if offset > LANES || run.owned[other] != run.owned[first] {
                break;
            }
            (offsets[together], factors[together]) = (offset, weights[other]);
            together += 1;
        }
        next += together;
        if !run.owned[first] {
            continue;
        }
        let at = (run.first[first] as usize + done).wrapping_sub(start);
        for (force, pulls) in force.iter_mut().zip(&pulls.0) {
            let count = chunk + offsets[together - 1];
            let force = &mut force[at..at + count];
            let shifted = |which: usize| &pulls[LANES - offsets[which]..][..count];
            let (one, [a, b, c]) = (shifted(0), factors);
            match together {
                1 => {
                    for index in 0..count {
                        force[index] += a * one[index];
                    }
                }
                2 => {
                    let two = shifted(1);
                    for index in 0..count {
                        force[index] += a * one[index] + b * two[index];
                    }
                }
                _ => {
                    let (two, three) = (shifted(1), shifted(2));
                    for index in 0..count {
                        force[index] += a * one[index] + b * two[index] + c * three[index];
                    }
                }
            }
        }
    }
}

/// Adds the forces of bends with weights of their own, end by end.
#[inline(always)]
fn add_each<const N: usize>(
    list: &BendList<N>,
    run: &BendRun<N>,
    (done, chunk): (usize, usize),
    pulls: &Pulls,
    force: &mut [&mut [f32]; 3],
    start: usize,
) {
    let place = run.start as usize + done;
    for end in (0..N).filter(|end| run.owned[*end]) {
        let at = (run.first[end] as usize + done).wrapping_sub(start);
        let weights = &list.weights[end][place..place + chunk];
        for (force, pulls) in force.iter_mut().zip(&pulls.0) {
            let (force, pulls) = (&mut force[at..at + chunk], &pulls[LANES..LANES + chunk]);
            for index in 0..chunk {
                force[index] += weights[index] * pulls[index];
            }
        }
    }
}
