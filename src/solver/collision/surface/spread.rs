//! How far the vertices of a body may move after a search, and how far they have moved since some time: bounds for the whole body in one vectorised pass,
//! and the displacement of each vertex in another.

use std::ops::Range;

use bevy::math::Vec3A;

use super::search::Moving;
use super::tree::Box3;
use crate::solver::particles::Vectors;

/// Number of substeps for which the box of a body is to hold at the velocity in the search.
const BODY_SUBSTEPS: f32 = 16.0;

/// Margin of the box of a body on each side, as a fraction of its size.
const BODY_MARGIN: f32 = 0.1;

/// Number of vertices of a body, at most, of which the mean displacement is that of the body.
const SAMPLES: usize = 8;

/// Rounding, as a part of a coordinate.
const ROUNDING: f32 = 4e-7;

/// The boxes of what the vertices of a body have done.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spread {
    /// How far they are from where they are expected, at the start of the substep and at its end, m.
    displacement: [Box3; 2],
    /// Their positions at both, m.
    pub position: Box3,
}

impl Spread {
    /// That of the vertices in some ranges of slots; those that are nowhere (NaN) are left out.
    pub fn of(runs: &[Range<u32>], moving: Moving, expected: [&Vectors; 2]) -> Self {
        let mut ends = [[[f32::INFINITY, f32::NEG_INFINITY]; 3]; 3];
        pulp::Arch::new().dispatch(Extremes { runs, moving, expected, ends: &mut ends });
        let box_of = |ends: [[f32; 2]; 3]| {
            let [least, most] = [0, 1].map(|side| Vec3A::from_array(ends.map(|axis| axis[side])));
            Box3 { least, most }
        };
        let [start, end, position] = ends.map(box_of);
        Self { displacement: [start, end], position }
    }

    /// How far any is from where it is expected, at most: with what they have in common taken off, and without; m.
    pub fn farthest(&self) -> [f32; 2] {
        let within = self.displacement.map(|all| 0.5 * (all.most - all.least).length());
        let world = self.displacement.map(|all| all.most.abs().max(all.least.abs()).length());
        [within, world].map(|[start, end]| start.max(end))
    }
}

/// About what some vertices have in common, at the start and at the end, m: the mean of some of them, which a few that are hit do not change much.
/// Whatever it is, what holds with it taken off holds.
pub(super) fn drift_of(vertices: &[u32], moving: Moving, expected: [&Vectors; 2]) -> [Vec3A; 2] {
    let sample = vertices.iter().step_by(vertices.len().div_ceil(SAMPLES).max(1));
    let (mut sums, mut count) = ([Vec3A::ZERO; 2], 0.0);
    for slot in sample.map(|slot| *slot as usize) {
        let ends = moving.ends(slot);
        let far = [0, 1].map(|side| ends[side] - Vec3A::from(expected[side].get(slot)));
        if (far[0] + far[1]).is_finite() {
            (sums, count) = ([sums[0] + far[0], sums[1] + far[1]], count + 1.0);
        }
    }
    if count > 0.0 { sums.map(|sum| sum / count) } else { sums }
}

/// Finds the extremes of displacements and positions, by axis.
struct Extremes<'a> {
    runs: &'a [Range<u32>],
    moving: Moving<'a>,
    expected: [&'a Vectors; 2],
    ends: &'a mut [[[f32; 2]; 3]; 3],
}

impl pulp::WithSimd for Extremes<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) {
        let Self { runs, moving, expected, ends } = self;
        let arrays = [moving.start, moving.end, expected[0], expected[1]].map(|vectors| vectors.axes());
        for axis in 0..3 {
            let mut least = [simd.splat_f32s(f32::INFINITY); 3];
            let mut most = [simd.splat_f32s(f32::NEG_INFINITY); 3];
            for run in runs {
                let slices = arrays.map(|array| &array[axis][run.start as usize..run.end as usize]);
                let [start, end, before, after] = slices.map(|slice| S::as_simd_f32s(slice));
                let expected = before.0.iter().zip(after.0);
                for ((start, end), (before, after)) in start.0.iter().zip(end.0).zip(expected) {
                    let moved = [simd.sub_f32s(*start, *before), simd.sub_f32s(*end, *after)];
                    let lows = [moved[0], moved[1], simd.min_f32s(*start, *end)];
                    let highs = [moved[0], moved[1], simd.max_f32s(*start, *end)];
                    for kind in 0..3 {
                        // The second operand where the first is NaN, on processors that tell them apart.
                        least[kind] = simd.min_f32s(lows[kind], least[kind]);
                        most[kind] = simd.max_f32s(highs[kind], most[kind]);
                    }
                }
                let expected = before.1.iter().zip(after.1);
                for ((start, end), (before, after)) in start.1.iter().zip(end.1).zip(expected) {
                    let moved = [start - before, end - after];
                    let lows = [moved[0], moved[1], start.min(*end)];
                    let highs = [moved[0], moved[1], start.max(*end)];
                    for kind in 0..3 {
                        let [low, high] = &mut ends[kind][axis];
                        (*low, *high) = (low.min(lows[kind]), high.max(highs[kind]));
                    }
                }
            }
            for kind in 0..3 {
                let [low, high] = &mut ends[kind][axis];
                *low = low.min(simd.reduce_min_f32s(least[kind]));
                *high = high.max(simd.reduce_max_f32s(most[kind]));
            }
        }
    }
}

/// Finds how far each vertex is from where it is expected at the start and at the end of a substep.
pub(super) struct EachMoved<'a> {
    pub runs: &'a [Range<u32>],
    pub moving: Moving<'a>,
    pub expected: [&'a Vectors; 2],
    /// What is taken off, at the start and at the end, m.
    pub drift: [Vec3A; 2],
    /// How far each may be, by slot, and by how much farther, m.
    pub limits: (&'a [f32], f32),
    /// How far each is, by slot, m; 0 for what is nowhere.
    pub moved: &'a mut [f32],
    /// Whether any is farther than it may be.
    pub is_beyond: &'a mut bool,
}

impl pulp::WithSimd for EachMoved<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) {
        let Self { runs, moving, expected, drift, limits: (limits, slack), moved, is_beyond } = self;
        let drift = drift.map(|drift| drift.to_array());
        let mut excess = simd.splat_f32s(0.0);
        for run in runs {
            let run = run.start as usize..run.end as usize;
            let places = [moving.start, moving.end, expected[0], expected[1]].map(|vectors| vectors.axes());
            let [start, end, before, after] =
                places.map(|axes| axes.map(|axis| S::as_simd_f32s(&axis[run.clone()])));
            let sides = [(start, before), (end, after)];
            let (limits, moved) =
                (S::as_simd_f32s(&limits[run.clone()]), S::as_mut_simd_f32s(&mut moved[run]));
            for number in 0..limits.0.len() {
                let mut squares = [simd.splat_f32s(0.0); 2];
                for axis in 0..3 {
                    for (side, (position, origin)) in sides.into_iter().enumerate() {
                        let displacement = simd.sub_f32s(position[axis].0[number], origin[axis].0[number]);
                        let displacement = simd.sub_f32s(displacement, simd.splat_f32s(drift[side][axis]));
                        squares[side] =
                            simd.add_f32s(squares[side], simd.mul_f32s(displacement, displacement));
                    }
                }
                let square = simd.max_f32s(squares[0], squares[1]);
                let is_finite = simd.less_than_f32s(square, simd.splat_f32s(f32::INFINITY));
                let far = simd.sqrt_f32s(simd.select_f32s(is_finite, square, simd.splat_f32s(0.0)));
                moved.0[number] = far;
                excess = simd.max_f32s(simd.sub_f32s(far, limits.0[number]), excess);
            }
            for number in 0..limits.1.len() {
                let square = sides.into_iter().zip(drift).map(|((position, origin), drift)| {
                    let displacement =
                        |axis: usize| (position[axis].1[number] - origin[axis].1[number]) - drift[axis];
                    (0..3).map(|axis| displacement(axis) * displacement(axis)).sum::<f32>()
                });
                let square = square.fold(0.0, f32::max);
                let far = if square < f32::INFINITY { square.sqrt() } else { 0.0 };
                moved.1[number] = far;
                *is_beyond |= far > limits.1[number] + slack;
            }
        }
        *is_beyond |= simd.reduce_max_f32s(excess) > slack;
    }
}

/// The box in which a vertex of a `radius` is on a path, and up to `limit` m from it, with its radius and half of the `margin`, the distance from
/// touching up to which pairs are wanted, m.
#[inline(always)]
pub(super) fn box_of_path([start, end]: [Vec3A; 2], limit: f32, (radius, margin): (f32, f32)) -> Box3 {
    if !(start + end).is_finite() {
        return Box3::NOTHING;
    }
    let rounding = ROUNDING * start.abs().max(end.abs()).max_element();
    let (least, most) = (start.min(end), start.max(end));
    Box3 { least, most }.grown(radius + limit + 0.5 * margin + rounding)
}

/// The box of a body, enlarged for some substeps in each of which it moves by `displacement`: while it overlaps no other one, nothing else has to
/// be checked of where the body is in the world.
pub(super) fn enlarged(tight: Box3, displacement: Vec3A) -> Box3 {
    let displacement = BODY_SUBSTEPS * displacement;
    let margin = BODY_MARGIN * (tight.most - tight.least);
    let (least, most) = (tight.least - margin, tight.most + margin);
    Box3 { least: least.min(least + displacement), most: most.max(most + displacement) }
}
