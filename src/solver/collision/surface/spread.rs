//! How far the vertices of a body may move after a search, and how far they have moved since some time: bounds for the whole body in one vectorised pass,
//! and the displacement of each vertex in another.

use std::ops::Range;

use bevy::math::Vec3A;

use super::search::Moving;
use super::tree::Box3;
use crate::solver::particles::Vectors;

/// The skin of a slow vertex, as a fraction of its radius.
const SKIN: f32 = 0.6;

/// The skin of a fast vertex: a multiple of its displacement in the substep of the search, but at most one of its radius.
const FAST_SKIN: [f32; 2] = [4.0, 6.0];

/// How far a vertex may be from its path, as a part of its radius.
const SWEPT_SKIN: f32 = 0.1;

/// Number of substeps for which the box of a body is to hold at the velocity in the search.
const BODY_SUBSTEPS: f32 = 16.0;

/// Margin of the box of a body on each side, as a fraction of its size.
const BODY_MARGIN: f32 = 0.1;

/// Rounding, as a part of a coordinate.
const ROUNDING: f32 = 4e-7;

/// The boxes of what the vertices of a body have done.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spread {
    /// Their displacements from their origins at the start of the substep, and at its end, m.
    displacement: [Box3; 2],
    /// Their positions at both, m.
    pub position: Box3,
}

impl Spread {
    /// That of the vertices in some ranges of slots; those that are nowhere (NaN) are left out.
    pub fn of(runs: &[Range<u32>], moving: Moving, origins: [&Vectors; 2]) -> Self {
        let mut ends = [[[f32::INFINITY, f32::NEG_INFINITY]; 3]; 3];
        pulp::Arch::new().dispatch(Extremes { runs, moving, origins, ends: &mut ends });
        let box_of = |ends: [[f32; 2]; 3]| {
            let [least, most] = [0, 1].map(|side| Vec3A::from_array(ends.map(|axis| axis[side])));
            Box3 { least, most }
        };
        let [start, end, position] = ends.map(box_of);
        Self { displacement: [start, end], position }
    }

    /// The displacement that they have in common, at the start and at the end, m.
    pub fn drift(&self) -> [Vec3A; 2] {
        self.displacement.map(|all| {
            let middle = 0.5 * (all.least + all.most);
            if middle.is_finite() { middle } else { Vec3A::ZERO }
        })
    }

    /// How far any is from where it was, at most: with what they have in common taken off, and without; m.
    pub fn farthest(&self) -> [f32; 2] {
        let within = self.displacement.map(|all| 0.5 * (all.most - all.least).length());
        let world = self.displacement.map(|all| all.most.abs().max(all.least.abs()).length());
        [within, world].map(|[start, end]| start.max(end))
    }
}

/// Finds the extremes of displacements and positions, by axis.
struct Extremes<'a> {
    runs: &'a [Range<u32>],
    moving: Moving<'a>,
    origins: [&'a Vectors; 2],
    ends: &'a mut [[[f32; 2]; 3]; 3],
}

impl pulp::WithSimd for Extremes<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) {
        let Self { runs, moving, origins, ends } = self;
        let arrays = [moving.start, moving.end, origins[0], origins[1]].map(|vectors| vectors.axes());
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

/// Finds how far each vertex is from its origins at the start and at the end of a substep.
pub(super) struct EachMoved<'a> {
    pub runs: &'a [Range<u32>],
    pub moving: Moving<'a>,
    pub origins: [&'a Vectors; 2],
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
        let Self { runs, moving, origins, drift, limits: (limits, slack), moved, is_beyond } = self;
        let drift = drift.map(|drift| drift.to_array());
        let mut excess = simd.splat_f32s(0.0);
        for run in runs {
            let run = run.start as usize..run.end as usize;
            let places = [moving.start, moving.end, origins[0], origins[1]].map(|vectors| vectors.axes());
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

/// The margin of a vertex of a `radius` that moves by `displacement`: how far it may get from the first of two places, m; and the box in which it
/// is then, with its radius and half of the `margin`, the distance from touching up to which pairs are wanted, m.
#[inline(always)]
pub(super) fn margin_of(ends: [Vec3A; 2], displacement: Vec3A, (radius, margin): (f32, f32)) -> (f32, Box3) {
    if !(ends[0] + ends[1]).is_finite() {
        return (0.0, Box3::NOTHING);
    }
    let displacement = displacement.length();
    let skin = (SKIN * radius).max((FAST_SKIN[0] * displacement).min(FAST_SKIN[1] * radius));
    let rounding = ROUNDING * ends[0].abs().max(ends[1].abs()).max_element();
    let limit = displacement + skin + f32::MIN_POSITIVE;
    let reach = Vec3A::splat(radius + limit + 0.5 * margin + rounding);
    (limit, Box3 { least: ends[0] - reach, most: ends[0] + reach })
}

/// The same where it follows its path: how far it may get from there, m; and the box of the path.
#[inline(always)]
pub(super) fn swept_margin_of(
    ends: [Vec3A; 2],
    displacement: Vec3A,
    (radius, margin): (f32, f32),
) -> (f32, Box3) {
    if !(ends[0] + ends[1]).is_finite() {
        return (0.0, Box3::NOTHING);
    }
    let limit = SWEPT_SKIN * radius + f32::MIN_POSITIVE;
    let rounding = ROUNDING * ends[0].abs().max(ends[1].abs()).max_element();
    let (least, most) = (ends[0].min(ends[0] + displacement), ends[0].max(ends[0] + displacement));
    (limit, Box3 { least, most }.grown(radius + limit + 0.5 * margin + rounding))
}

/// How far a vertex that hardly moves may get, m.
pub(super) fn slow_limit(radius: f32) -> f32 {
    SKIN * radius
}

/// The box of a body, enlarged for some substeps in each of which it moves by `displacement`: while it overlaps no other one, nothing else has to
/// be checked of where the body is in the world.
pub(super) fn enlarged(tight: Box3, displacement: Vec3A) -> Box3 {
    let displacement = BODY_SUBSTEPS * displacement;
    let margin = BODY_MARGIN * (tight.most - tight.least);
    let (least, most) = (tight.least - margin, tight.most + margin);
    Box3 { least: least.min(least + displacement), most: most.max(most + displacement) }
}
