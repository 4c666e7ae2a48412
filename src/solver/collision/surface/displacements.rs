//! How far the vertices of bodies are from where they were expected to be, and how far they may be: what was found then holds until one is farther.
//!
//! Each is expected to go on as in the substep before for a few substeps, and to stay where it is then: what flies or swings is where it is expected
//! to be, and what is hit is not. Those that are farther away than they may be *begin anew* from where they are; only what they are a part of has to
//! be looked for again.

use std::ops::Range;

use bevy::math::Vec3A;

use super::primitives::Primitives;
use super::search::Moving;
use super::spread::{EachMoved, Spread, drift_of};
use super::steps::Steps;
use crate::solver::particles::Vectors;

/// One of this many vertices, at most, begins anew by itself: with more of them all do.
const MIN_PER_RENEWED: usize = 6;

/// Displacements of all vertices from where they are expected, in two frames: *with its body*, without what all of the body have in common, and *in
/// the world*. Distances within a body change by the first, those of bodies by the second.
#[derive(Debug, Clone, Default)]
pub(super) struct Displacements {
    /// Where they are expected at the start and at the end of the substep, by slot, m.
    expected: [Vectors; 2],
    /// How far they are expected to go in a substep, by slot, m.
    steps: Vectors,
    /// For how many substeps from the start of this one on; then they are expected to stay.
    left: u32,
    /// The ends of the path that each is expected to go from the start of the substep on, in which all began anew, m; later none.
    paths: Vec<[Vec3A; 2]>,
    /// By slot: how far each may be from there, m.
    pub limits: [Vec<f32>; 2],
    /// By body: the least of them.
    least_limits: Vec<[f32; 2]>,
    /// By slot: how far each is, or was at the start of the substep, m. Known where each was to be measured.
    pub moved: [Vec<f32>; 2],
    /// By body: what its vertices have in common, at the start and at the end of the substep, m.
    drifts: Vec<[Vec3A; 2]>,
    /// The number of times that some began anew since all did, and, by slot, the last one of these.
    pub renewal: u32,
    pub renewals: Vec<u32>,
    /// The number of those that did.
    renewed: usize,
    /// Those that are farther than they may be: body and slot.
    pub beyond: Vec<(u32, u32)>,
}

/// Which displacements count.
#[derive(Clone, Copy)]
pub(super) struct Measured<'a> {
    pub primitives: &'a Primitives,
    pub moving: Moving<'a>,
    /// By body: in how many frames it is near something; 0 for one that has diverged.
    pub frames: &'a [usize],
}

/// The number of the body of a ball.
pub(super) const BALL: u32 = u32::MAX;

impl Displacements {
    /// All begin anew at the start of the substep. Each is expected to go as far as in its step (m, by slot) in each of the next `substeps`.
    pub fn begin(&mut self, moving: Moving, bodies: usize, (steps, substeps): (Steps, u32)) {
        self.steps.resize(moving.particles.len());
        (0..moving.particles.len()).for_each(|slot| self.steps.set(slot, steps.of(slot).into()));
        self.left = substeps;
        self.begin_all(moving, bodies);
    }

    /// All begin anew as others have in the same substep.
    pub fn begin_as(&mut self, other: &Self, moving: Moving, bodies: usize) {
        self.steps.copy_from(&other.steps);
        self.left = other.left;
        self.begin_all(moving, bodies);
    }

    fn begin_all(&mut self, moving: Moving, bodies: usize) {
        self.expected.iter_mut().for_each(|places| places.copy_from(moving.start));
        self.go_on();
        let count = moving.particles.len();
        self.limits.iter_mut().chain(&mut self.moved).for_each(|all| all.resize(count, 0.0));
        self.least_limits.clear();
        self.least_limits.resize(bodies, [f32::INFINITY; 2]);
        self.drifts.clear();
        self.drifts.resize(bodies, [Vec3A::ZERO; 2]);
        self.renewals.clear();
        self.renewals.resize(count, 0);
        (self.renewal, self.renewed) = (0, 0);
        let mut paths = std::mem::take(&mut self.paths);
        paths.clear();
        paths.extend((0..count).map(|slot| self.path_of(slot)));
        self.paths = paths;
    }

    /// The next substep begins.
    pub fn begin_substep(&mut self) {
        self.paths.clear();
        if self.left > 0 {
            self.left -= 1;
            self.expected.swap(0, 1);
            self.go_on();
        }
    }

    /// Has them go a step from where they are expected at the start of the substep to where they are at its end.
    fn go_on(&mut self) {
        let Self { expected: [start, end], steps, left, .. } = self;
        if *left == 0 {
            return end.copy_from(start);
        }
        let axes = end.axes_mut().into_iter().zip(start.axes()).zip(steps.axes());
        for ((end, start), step) in axes {
            end.iter_mut().zip(start).zip(step).for_each(|((end, start), step)| *end = start + step);
        }
    }

    /// The ends of the path that a vertex is expected to go from the start of the substep on, in which some have begun anew, m.
    #[inline(always)]
    pub fn path(&self, slot: usize) -> [Vec3A; 2] {
        match self.paths.get(slot) {
            Some(path) => *path,
            None => self.path_of(slot),
        }
    }

    #[inline(always)]
    fn path_of(&self, slot: usize) -> [Vec3A; 2] {
        let [start, step] = [&self.expected[0], &self.steps].map(|vectors| Vec3A::from(vectors.get(slot)));
        [start, start + self.left as f32 * step]
    }

    /// For how many substeps from the start of this one on they are expected to go on.
    pub fn substeps_left(&self) -> u32 {
        self.left
    }

    /// Whether any is expected to go anywhere.
    pub fn any_paths(&self) -> bool {
        self.left > 0
    }

    /// Finds what the vertices of a body have in common.
    pub fn find_drift(&mut self, number: usize, primitives: &Primitives, moving: Moving) {
        let (forest, [start, end]) = (&primitives.forest, &self.expected);
        self.drifts[number] = drift_of(forest.vertices_of(&forest.bodies[number]), moving, [start, end]);
    }

    /// Where the vertices of a body are, and have moved to.
    pub fn spread(&self, number: usize, primitives: &Primitives, moving: Moving) -> Spread {
        let [start, end] = &self.expected;
        Spread::of(&primitives.forest.bodies[number].runs, moving, [start, end])
    }

    /// How far a vertex of a body is from where it is expected, at the start and at the end of the substep, in both frames, m.
    pub fn distances(&self, (body, slot): (u32, usize), moving: Moving) -> [[f32; 2]; 2] {
        let drifts = self.drifts.get(body as usize).copied().unwrap_or_default();
        let ends = moving.ends(slot);
        let of = |drifts: [Vec3A; 2]| {
            let far = |side: usize| {
                let far = (ends[side] - Vec3A::from(self.expected[side].get(slot)) - drifts[side]).length();
                if far.is_finite() { far } else { 0.0 }
            };
            [far(0), far(1)]
        };
        [of(drifts), of([Vec3A::ZERO; 2])]
    }

    /// Limits the displacement of a vertex of a body.
    pub fn limit(&mut self, (body, slot, frame): (u32, usize, usize), limit: f32) {
        self.limits[frame][slot] = limit;
        if let Some(least) = self.least_limits.get_mut(body as usize) {
            least[frame] = least[frame].min(limit);
        }
    }

    /// Lists the vertices that are beyond their limits in the substep, in the frames from `first_frame` on; `with_each` measures
    /// each. `slack` is by how much those of a body may be beyond them, m. Calls `check` for each body, and returns false where that does.
    pub fn find_beyond(
        &mut self,
        measured: Measured,
        (first_frame, with_each): (usize, bool),
        slack: impl Fn(usize) -> f32,
        mut check: impl FnMut(usize, &Spread) -> bool,
    ) -> bool {
        let Measured { primitives, moving, frames } = measured;
        self.beyond.clear();
        for number in 0..primitives.forest.bodies.len() {
            let spread = self.spread(number, primitives, moving);
            if !check(number, &spread) {
                return false;
            }
            let (slack, least) = (slack(number), self.least_limits[number]);
            let (frames, farthest) = (first_frame..frames[number], spread.farthest());
            if with_each || frames.clone().any(|frame| farthest[frame] > least[frame] + slack) {
                self.find_drift(number, primitives, moving);
                self.measure_each(number, measured, (frames, slack));
            }
        }
        self.measure_balls(measured);
        true
    }

    /// Measures how far each vertex is from where it is expected, and lists those that are beyond their limits.
    pub fn find_each_beyond(&mut self, measured: Measured, slack: impl Fn(usize) -> f32) {
        self.beyond.clear();
        for number in 0..measured.primitives.forest.bodies.len() {
            self.find_drift(number, measured.primitives, measured.moving);
            self.measure_each(number, measured, (0..measured.frames[number], slack(number)));
        }
        self.measure_balls(measured);
    }

    fn measure_each(&mut self, number: usize, measured: Measured, (frames, slack): (Range<usize>, f32)) {
        let Measured { primitives, moving, .. } = measured;
        let Self { expected: [before, after], limits, moved, beyond, drifts, .. } = self;
        let runs = &primitives.forest.bodies[number].runs;
        let drifts = [drifts[number], [Vec3A::ZERO; 2]];
        for frame in frames {
            let mut is_beyond = false;
            pulp::Arch::new().dispatch(EachMoved {
                runs,
                moving,
                expected: [before, after],
                drift: drifts[frame],
                limits: (&limits[frame], slack),
                moved: &mut moved[frame],
                is_beyond: &mut is_beyond,
            });
            if is_beyond {
                let far = |slot: u32| moved[frame][slot as usize] > limits[frame][slot as usize] + slack;
                let vertices = runs.iter().cloned().flatten().filter(|slot| far(*slot));
                beyond.extend(vertices.map(|slot| (number as u32, slot)));
            }
        }
    }

    fn measure_balls(&mut self, Measured { primitives, moving, .. }: Measured) {
        for slot in primitives.balls.iter().map(|slot| *slot as usize) {
            let [_, far] = self.distances((BALL, slot), moving).map(|[start, end]| start.max(end));
            self.moved[1][slot] = far;
            if far > self.limits[1][slot] {
                self.beyond.push((BALL, slot as u32));
            }
        }
    }

    /// Whether those that are beyond their limits, or in the list of them for another reason, are few enough to begin anew by themselves.
    pub fn may_renew(&mut self, primitives: &Primitives) -> bool {
        self.beyond.sort_unstable();
        self.beyond.dedup();
        let all = primitives.forest.vertices.len();
        (self.renewed + self.beyond.len()) * MIN_PER_RENEWED <= all
            && self.beyond.iter().all(|(body, _)| *body != BALL)
    }

    /// Those that are beyond their limits begin anew from where they are, to go as far as in their `step`, by slot, m, in each substep that is left: as if
    /// they had moved with their bodies until now, so that what is known of the others still holds. `skin`, by slot, is how far they may get, m.
    pub fn renew(&mut self, moving: Moving, step: impl Fn(usize) -> Vec3A, skin: impl Fn(usize) -> f32) {
        let beyond = std::mem::take(&mut self.beyond);
        self.renewal += 1;
        self.renewed += beyond.len();
        for (body, slot) in beyond.iter().map(|(body, slot)| (*body, *slot as usize)) {
            let [before, after] = self.drifts[body as usize];
            let place = moving.ends(slot)[0] - before;
            let step = step(slot) - (after - before);
            self.expected[0].set(slot, place.into());
            self.steps.set(slot, step.into());
            let end = if self.left > 0 { place + step } else { place };
            self.expected[1].set(slot, end.into());
            self.renewals[slot] = self.renewal;
            for (frame, [start, end]) in self.distances((body, slot), moving).into_iter().enumerate() {
                self.moved[frame][slot] = start.max(end);
                self.limit((body, slot, frame), start.max(end) + skin(slot) + f32::MIN_POSITIVE);
            }
        }
        self.beyond = beyond;
        self.paths.clear();
    }

    /// Whether what is known of some vertices since the renewal of this number is what holds: none of them has begun anew since.
    #[inline(always)]
    pub fn holds_for(&self, slots: &[u32; 4], renewal: u32) -> bool {
        slots.iter().all(|slot| self.renewals[*slot as usize] <= renewal)
    }

    /// Whether any of them has begun anew in the last renewal.
    #[inline(always)]
    pub fn any_renewed(&self, slots: &[u32]) -> bool {
        slots.iter().any(|slot| self.renewals[*slot as usize] == self.renewal)
    }
}
