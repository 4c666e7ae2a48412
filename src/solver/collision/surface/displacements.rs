//! How far the vertices of bodies have moved since some time, and how far they may: what was found then holds until one goes farther.

use bevy::math::Vec3A;

use super::primitives::Primitives;
use super::search::Moving;
use super::spread::{EachMoved, Spread};
use crate::solver::particles::Vectors;

/// Number of substeps, at most, for which limits are to hold what moves fast.
const LIMIT_IN_DISPLACEMENTS: f32 = 4.0;

/// Displacements of all vertices since some time, in two frames: *with its body*, without what all of the body have in common, and *in the
/// world*. Distances within a body change by the first, those of bodies by the second.
#[derive(Debug, Clone, Default)]
pub(super) struct Displacements {
    /// Where they were, by slot, m.
    pub origins: Vectors,
    /// The ends of paths from there, by slot, m: what displacements at the end of a substep are measured from, if it `is_swept`.
    path_ends: Vectors,
    pub is_swept: bool,
    /// By slot: how far each may be from there, m.
    pub limits: [Vec<f32>; 2],
    /// By body: the least of them.
    least_limits: Vec<[f32; 2]>,
    /// By slot: how far each is, or was at the start of the substep, m. Known where each was to be measured.
    pub moved: [Vec<f32>; 2],
}

/// Which displacements count.
#[derive(Clone, Copy)]
pub(super) struct Measured<'a> {
    pub primitives: &'a Primitives,
    pub moving: Moving<'a>,
    /// By body: in how many frames it is near something; 0 for one that has diverged.
    pub frames: &'a [usize],
}

impl Displacements {
    /// None has moved since the start of the substep; if it `is_swept`, none has left the path that it has in it.
    pub fn begin(&mut self, moving: Moving, bodies: usize, is_swept: bool) {
        self.origins.copy_from(moving.start);
        self.is_swept = is_swept;
        if is_swept {
            self.path_ends.copy_from(moving.end);
        }
        let count = moving.particles.len();
        self.limits.iter_mut().chain(&mut self.moved).for_each(|all| all.resize(count, 0.0));
        self.least_limits.clear();
        self.least_limits.resize(bodies, [f32::INFINITY; 2]);
    }

    /// Whether they may be those of the substep: paths are those of one substep only.
    pub fn fit(&self, moving: Moving) -> bool {
        let is_same = |(one, other): (&[f32], &[f32])| {
            one.iter().map(|number| number.to_bits()).eq(other.iter().map(|number| number.to_bits()))
        };
        !self.is_swept || self.origins.axes().into_iter().zip(moving.start.axes()).all(is_same)
    }

    /// Limits the displacement of a vertex of a body.
    pub fn limit(&mut self, (body, slot, frame): (usize, usize, usize), limit: f32) {
        self.limits[frame][slot] = limit;
        let least = &mut self.least_limits[body][frame];
        *least = least.min(limit);
    }

    /// Whether all are within their limits on their paths in the substep, in the frames from `first_frame` on; `with_each` measures each.
    /// `slack` is by how much those of a body may be beyond them, m. Calls `check` for each body, and stops where that says no.
    pub fn hold(
        &mut self,
        Measured { primitives, moving, frames }: Measured,
        (first_frame, with_each): (usize, bool),
        slack: impl Fn(usize) -> f32,
        mut check: impl FnMut(usize, &Spread) -> bool,
    ) -> bool {
        let Self { origins, path_ends, is_swept, limits, least_limits, moved } = self;
        let expected = [&*origins, if *is_swept { path_ends } else { origins }];
        for (number, body) in primitives.forest.bodies.iter().enumerate() {
            let spread = Spread::of(&body.runs, moving, expected);
            if !check(number, &spread) {
                return false;
            }
            let (frames, farthest, least) = (frames[number], spread.farthest(), least_limits[number]);
            let slack = slack(number);
            let are_all_clear = (first_frame..frames).all(|frame| farthest[frame] <= least[frame] + slack);
            let drifts = [spread.drift(), [Vec3A::ZERO; 2]];
            let measured = if with_each || !are_all_clear { frames } else { 0 };
            for (frame, drift) in drifts.into_iter().enumerate().take(measured).skip(first_frame) {
                let mut is_beyond = false;
                pulp::Arch::new().dispatch(EachMoved {
                    runs: &body.runs,
                    moving,
                    origins: expected,
                    drift,
                    limits: (&limits[frame], slack),
                    moved: &mut moved[frame],
                    is_beyond: &mut is_beyond,
                });
                if is_beyond {
                    return false;
                }
            }
        }
        primitives.balls.iter().all(|slot| {
            let slot = *slot as usize;
            let ends = moving.ends(slot);
            let expected = expected.map(|places| Vec3A::from(places.get(slot)));
            let far = ends[0].distance(expected[0]).max(ends[1].distance(expected[1]));
            moved[1][slot] = if far.is_finite() { far } else { 0.0 };
            moved[1][slot] <= limits[1][slot]
        })
    }

    /// Begins at the start of the substep, with limits that are a `part` of those of `outer`, but a few displacements in the substep at least: all
    /// that hold these hold those. Whether there is room left for limits of half of that.
    pub fn begin_within(&mut self, outer: &Self, measured: Measured, part: f32) -> bool {
        let Measured { primitives, moving, frames } = measured;
        self.begin(moving, primitives.forest.bodies.len(), false);
        let limit_of = |slot: usize, frame: usize, [before, displacement]: [f32; 2]| {
            let most = outer.limits[frame][slot];
            let wanted = (part * most).max(LIMIT_IN_DISPLACEMENTS * displacement);
            // All of it is left where `outer` begins in this substep, too.
            let left = most - before;
            (wanted.min(left), left < (0.5 * part * most).max(displacement))
        };
        // How far a vertex has come since `outer` began, and goes in the substep, with what has been in common by then taken off.
        let lengths = |slot: usize, [before, common]: [Vec3A; 2]| {
            let [start, end] = moving.ends(slot);
            let moved = start - Vec3A::from(outer.origins.get(slot));
            let lengths = [moved - before, end - start - common].map(|vector| vector.length());
            lengths.map(|length| if length.is_finite() { length } else { 0.0 })
        };
        for (number, body) in primitives.forest.bodies.iter().enumerate() {
            let [own, other] = [&self.origins, &outer.origins]
                .map(|origins| Spread::of(&body.runs, moving, [origins; 2]).drift());
            let drifts = [[other[0], own[1]], [Vec3A::ZERO; 2]];
            for slot in primitives.forest.vertices_of(body).iter().map(|slot| *slot as usize) {
                for (frame, drift) in drifts.into_iter().enumerate().take(frames[number]) {
                    let (limit, is_narrow) = limit_of(slot, frame, lengths(slot, drift));
                    if is_narrow {
                        return false;
                    }
                    self.limit((number, slot, frame), limit);
                }
            }
        }
        for slot in primitives.balls.iter().map(|slot| *slot as usize) {
            let (limit, is_narrow) = limit_of(slot, 1, lengths(slot, [Vec3A::ZERO; 2]));
            if is_narrow {
                return false;
            }
            self.limits[1][slot] = limit;
        }
        true
    }
}
