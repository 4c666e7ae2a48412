//! The forces of bends in runs: a chunk of them at a time, step by step, so that each step reads a few arrays in order.

use bevy::math::Vec3;

use super::accelerations::LANES;
use super::{Motion, parallelograms};
use crate::solver::elements::{Bend, for_each_bend};
use crate::solver::graph::block::Block;
use crate::solver::graph::{BendList, BendRun};

/// Bends computed together: what is read and written stays in the first-level cache.
const CHUNK: usize = 512;

/// A vector for each bend of a chunk, from index `LANES`.
type Chunk = [[f32; LANES + CHUNK + LANES + LANES]; 3];

/// Working memory of the forces of bends.
pub(super) struct BendBuffers {
    /// Separations, then pulls, with zeros on both sides.
    pulls: Chunk,
    /// Rates of the separations.
    rates: Chunk,
    parallelograms: parallelograms::Buffers,
}

impl BendBuffers {
    pub fn new() -> Self {
        let zeros = [[0.0; LANES + CHUNK + LANES + LANES]; 3];
        Self { pulls: zeros, rates: zeros, parallelograms: parallelograms::buffers() }
    }
}

/// Adds the forces of all bends in runs. Work of its own, as the compiler would else copy it into each that evaluates
/// forces.
pub(super) struct AddBends<'a, 'b> {
    pub block: &'a Block,
    pub motion: &'a Motion<'a>,
    pub force: &'a mut [&'b mut [f32]; 3],
    pub buffers: &'a mut BendBuffers,
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
                let Self { block, motion, force, buffers } = self;
                $($(#[$meta])* add_bends(&block.bends.$kind, motion, force, block.slots.start, buffers);)*
            }
        }
    };
}
for_each_bend!(define_add_bends);

#[inline(always)]
fn add_bends<const N: usize>(
    list: &BendList<N>,
    motion: &Motion,
    force: &mut [&mut [f32]; 3],
    start: usize,
    buffers: &mut BendBuffers,
) {
    let mut runs = &list.runs[..];
    while let Some(run) = runs.first() {
        let together = parallelograms::add(runs, motion, force, start, &mut buffers.parallelograms);
        if together > 0 {
            runs = &runs[together..];
            continue;
        }
        add_run(list, run, motion, buffers, (force, start));
        runs = &runs[1..];
    }
}

/// Adds the forces of the bends of a run.
#[inline(always)]
fn add_run<const N: usize>(
    list: &BendList<N>,
    run: &BendRun<N>,
    motion: &Motion,
    buffers: &mut BendBuffers,
    (force, start): (&mut [&mut [f32]; 3], usize),
) {
    let count = run.count as usize;
    let mut done = 0;
    while done < count {
        let left = count - done;
        let chunk = if left < CHUNK + LANES { left } else { CHUNK };
        match (run.is_curved, run.is_damped) {
            (false, false) => compute::<false, false, N>(list, run, (done, chunk), motion, buffers),
            (false, true) => compute::<false, true, N>(list, run, (done, chunk), motion, buffers),
            (true, _) => compute::<true, true, N>(list, run, (done, chunk), motion, buffers),
        }
        let place_of = |hole: usize| run.holes.partition_point(|place| (*place as usize) < hole);
        for place in &run.holes[place_of(done)..place_of(done + chunk)] {
            let place = LANES + *place as usize - done;
            buffers.pulls.iter_mut().for_each(|pulls| pulls[place] = 0.0);
        }
        match run.weights {
            Some(weights) => add_uniform(run, weights, (done, chunk), &mut buffers.pulls, force, start),
            None => add_each(list, run, (done, chunk), &buffers.pulls, force, start),
        }
        done += chunk;
    }
}

/// The pulls of `chunk` bends of a run, from the one numbered `done`.
#[inline(always)]
fn compute<const CURVED: bool, const DAMPED: bool, const N: usize>(
    list: &BendList<N>,
    run: &BendRun<N>,
    (done, chunk): (usize, usize),
    motion: &Motion,
    BendBuffers { pulls, rates, .. }: &mut BendBuffers,
) {
    if let (false, false, Some([stiffness, _])) = (CURVED, DAMPED, run.material) {
        return combine(list, run, (done, chunk), (motion.first, motion.position), pulls, |separation| {
            separation * -stiffness
        });
    }
    combine(list, run, (done, chunk), (motion.first, motion.position), pulls, |separation| separation);
    if DAMPED {
        combine(list, run, (done, chunk), (motion.first, motion.velocity), rates, |rate| rate);
    }
    let places = run.start as usize + done..run.start as usize + done + chunk;
    let rest_lengths = &list.rest_length[places.clone()];
    match run.material {
        Some(material) => pull::<CURVED, DAMPED, N>(pulls, rates, rest_lengths, |_| material),
        None => {
            let (stiffness, damping) = (&list.stiffness[places.clone()], &list.damping[places]);
            pull::<CURVED, DAMPED, N>(pulls, rates, rest_lengths, |index| [stiffness[index], damping[index]]);
        }
    }
}

/// Makes separations the pulls that they cause.
#[inline(always)]
fn pull<const CURVED: bool, const DAMPED: bool, const N: usize>(
    pulls: &mut Chunk,
    rates: &Chunk,
    rest_lengths: &[f32],
    material: impl Fn(usize) -> [f32; 2],
) {
    let chunk = rest_lengths.len();
    let [x, y, z] = pulls;
    let (x, y, z) =
        (&mut x[LANES..LANES + chunk], &mut y[LANES..LANES + chunk], &mut z[LANES..LANES + chunk]);
    let [rate_x, rate_y, rate_z] = rates;
    let (rate_x, rate_y, rate_z) =
        (&rate_x[LANES..LANES + chunk], &rate_y[LANES..LANES + chunk], &rate_z[LANES..LANES + chunk]);
    for index in 0..chunk {
        let [stiffness, damping] = material(index);
        let rest_length = if CURVED { rest_lengths[index] } else { 0.0 };
        let separation = Vec3::new(x[index], y[index], z[index]);
        let rate = if DAMPED { Vec3::new(rate_x[index], rate_y[index], rate_z[index]) } else { Vec3::ZERO };
        let material = [rest_length, stiffness, damping];
        let pull = Bend::<N>::pull_of::<CURVED, DAMPED>(material, separation, rate);
        (x[index], y[index], z[index]) = (pull.x, pull.y, pull.z);
    }
}

/// What `change` makes of Σ cᵢ vᵢ over the ends of `chunk` bends of a run, from the one numbered `done`; of vectors from
/// the slot `start` on.
#[inline(always)]
fn combine<const N: usize>(
    list: &BendList<N>,
    run: &BendRun<N>,
    (done, chunk): (usize, usize),
    (start, vectors): (usize, [&[f32]; 3]),
    sums: &mut Chunk,
    change: impl Fn(f32) -> f32,
) {
    let place = run.start as usize + done;
    for (sums, vectors) in sums.iter_mut().zip(vectors) {
        let sums = &mut sums[LANES..LANES + chunk];
        let mut ends = [&vectors[..0]; N];
        for (end, first) in ends.iter_mut().zip(run.first) {
            *end = &vectors[first as usize + done - start..][..chunk];
        }
        if let Some(weights) = run.weights {
            for index in 0..chunk {
                let first = ends[0][index] * weights[0];
                let sum = (1..N).fold(first, |sum, end| sum + ends[end][index] * weights[end]);
                sums[index] = change(sum);
            }
        } else {
            let mut weights = [&vectors[..0]; N];
            for (weights, all) in weights.iter_mut().zip(&list.weights) {
                *weights = &all[place..][..chunk];
            }
            for index in 0..chunk {
                let first = ends[0][index] * weights[0][index];
                let sum = (1..N).fold(first, |sum, end| sum + ends[end][index] * weights[end][index]);
                sums[index] = change(sum);
            }
        }
    }
}

/// Adds the forces of bends with the same weights. Ends that are near each other are added to together: what is
/// stored is not loaded again at once.
#[inline(always)]
fn add_uniform<const N: usize>(
    run: &BendRun<N>,
    weights: [f32; N],
    (done, chunk): (usize, usize),
    pulls: &mut Chunk,
    force: &mut [&mut [f32]; 3],
    start: usize,
) {
    let end = LANES + chunk;
    // Those before the chunk are zero always.
    pulls.iter_mut().for_each(|pulls| pulls[end..end + LANES].fill(0.0));
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
        for (force, pulls) in force.iter_mut().zip(&*pulls) {
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
    pulls: &Chunk,
    force: &mut [&mut [f32]; 3],
    start: usize,
) {
    let place = run.start as usize + done;
    for end in (0..N).filter(|end| run.owned[*end]) {
        let at = (run.first[end] as usize + done).wrapping_sub(start);
        let weights = &list.weights[end][place..place + chunk];
        for (force, pulls) in force.iter_mut().zip(pulls) {
            let (force, pulls) = (&mut force[at..at + chunk], &pulls[LANES..LANES + chunk]);
            for index in 0..chunk {
                force[index] += weights[index] * pulls[index];
            }
        }
    }
}
