//! The forces of parallelograms in runs: additions only, and up to three runs in one pass over the forces.
//!
//! What limits them is the number of loads. Runs that go through the same particles, as the three kinds of hinges of a
//! triangulated grid do, are computed a window of slots at a time, into a buffer each; then each force is loaded once and gets what
//! all of their corners add to it. A buffer keeps as many pulls of the window before as corners are apart:
//!
//! ```text
//! slots      … 7 8 9 | 10 11 12 13 14 15 16 17        corners 0 and 3 apart
//! pulls        7 8 9 | 10 11 12 13 14 15 16 17
//! force                f₁₀ += p₁₀ − p₇, f₁₁ += p₁₁ − p₈, …
//! ```

use super::Motion;
use super::accelerations::LANES;
use crate::solver::graph::{BendRun, Parallelograms};

/// Pulls in the buffer of a run. Twice as many in three buffers do not fit into the first-level cache; with fewer, the some
/// hundred instructions with which each window starts are a noticeable part.
const PLACES: usize = 2048;

/// Working memory: the pulls of each run.
pub(super) type Buffers = [[f32; PLACES]; 3];

/// Empty ones.
pub(super) fn buffers() -> Buffers {
    [[0.0; PLACES]; 3]
}

/// Numbers computed together.
type Lanes = [f32; LANES];

/// Adds the forces of the first of `runs`, if it is of parallelograms, with up to two more of the same particles; the number of
/// runs that are done with this.
#[inline(always)]
pub(super) fn add<const N: usize>(
    runs: &[BendRun<N>],
    motion: &Motion,
    force: &mut [&mut [f32]; 3],
    start: usize,
    [one, two, three]: &mut Buffers,
) -> usize {
    let run = |number: usize| {
        let run = runs.get(number)?.parallelograms()?;
        (run.span <= PLACES / 2).then_some(run)
    };
    let Some(first) = run(0) else { return 0 };
    let next = |number: usize| run(number).filter(|run| run.overlap(&first));
    let Some(second) = next(1) else {
        add_together([first], motion, force, start, [one]);
        return 1;
    };
    let Some(third) = next(2) else {
        add_together([first, second], motion, force, start, [one, two]);
        return 2;
    };
    add_together([first, second, third], motion, force, start, [one, two, three]);
    3
}

#[inline(always)]
fn add_together<const RUNS: usize>(
    runs: [Parallelograms; RUNS],
    motion: &Motion,
    force: &mut [&mut [f32]; 3],
    start: usize,
    mut buffers: [&mut [f32; PLACES]; RUNS],
) {
    let (mut lowest, mut end, mut span) = (usize::MAX, 0, 0);
    for run in &runs {
        lowest = lowest.min(run.lowest);
        end = end.max(run.lowest + run.count + run.span);
        span = span.max(run.span);
    }
    for (force, position) in force.iter_mut().zip(motion.position) {
        buffers.iter_mut().for_each(|pulls| pulls[..span].fill(0.0));
        let (mut slot, mut holes) = (lowest, runs.map(|run| run.holes));
        while slot < end {
            let count = (PLACES - span).min(end - slot);
            for ((pulls, run), holes) in buffers.iter_mut().zip(&runs).zip(&mut holes) {
                compute(run, (position, motion.first), slot, &mut pulls[span..span + count], holes);
            }
            // Of each run the pulls on the particles of the window by one of the corners.
            let corner = |run: usize, offset: usize| &buffers[run][span - offset..][..count];
            let one: [&[f32]; RUNS] = std::array::from_fn(|run| corner(run, runs[run].plus[0]));
            let two: [&[f32]; RUNS] = std::array::from_fn(|run| corner(run, runs[run].plus[1]));
            let three: [&[f32]; RUNS] = std::array::from_fn(|run| corner(run, runs[run].minus[0]));
            let four: [&[f32]; RUNS] = std::array::from_fn(|run| corner(run, runs[run].minus[1]));
            add_corners(&mut force[slot - start..][..count], one, two, three, four);
            slot += count;
            if slot < end {
                buffers.iter_mut().for_each(|pulls| pulls.copy_within(count..count + span, 0));
            }
        }
    }
}

/// Adds to forces what two corners of each run add, and two others subtract.
#[inline(always)]
fn add_corners<const RUNS: usize>(
    force: &mut [f32],
    one: [&[f32]; RUNS],
    two: [&[f32]; RUNS],
    three: [&[f32]; RUNS],
    four: [&[f32]; RUNS],
) {
    let lanes = |pulls: [&[f32]; RUNS], at: usize| -> [Lanes; RUNS] {
        std::array::from_fn(|run| pulls[run].as_chunks().0[at])
    };
    let (vectors, rest) = force.as_chunks_mut::<LANES>();
    let done = vectors.len() * LANES;
    for (at, force) in vectors.iter_mut().enumerate() {
        let (one, two, three, four) = (lanes(one, at), lanes(two, at), lanes(three, at), lanes(four, at));
        for lane in 0..LANES {
            for run in 0..RUNS {
                force[lane] += one[run][lane];
                force[lane] += two[run][lane];
                force[lane] -= three[run][lane];
                force[lane] -= four[run][lane];
            }
        }
    }
    for (index, force) in (done..).zip(rest) {
        for run in 0..RUNS {
            *force += one[run][index];
            *force += two[run][index];
            *force -= three[run][index];
            *force -= four[run][index];
        }
    }
}

/// The pulls along one axis of the bends with their lowest corners in the slots from `slot` on; zero where there is none. Positions
/// are of the particles from `first` on, `holes` those from here on. Differences of near corners come first: they lose no digits.
#[inline(always)]
fn compute(
    run: &Parallelograms,
    (position, first): (&[f32], usize),
    slot: usize,
    pulls: &mut [f32],
    holes: &mut &[u32],
) {
    let window = slot..slot + pulls.len();
    let begin = run.lowest.clamp(window.start, window.end);
    let end = (run.lowest + run.count).clamp(window.start, window.end);
    pulls[..begin - slot].fill(0.0);
    pulls[end - slot..].fill(0.0);
    if begin == end {
        return;
    }
    let pulls = &mut pulls[begin - slot..end - slot];
    let count = pulls.len();
    let corner = |offset: usize| &position[begin + offset - first..][..count];
    let [one, two] = [corner(run.plus[0]), corner(run.plus[1])];
    let [three, four] = [corner(run.minus[0]), corner(run.minus[1])];
    for index in 0..count {
        pulls[index] = ((three[index] - one[index]) + (four[index] - two[index])) * run.stiffness;
    }
    let begin = begin - run.lowest;
    while let Some((place, rest)) = holes.split_first()
        && let Some(pull) = pulls.get_mut(*place as usize - begin)
    {
        *pull = 0.0;
        *holes = rest;
    }
}
