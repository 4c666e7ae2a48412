//! How much of its box and of its play a chain has used.

use bevy::math::Vec3;
use pulp::Simd;

use super::chains::{Chain, LANES};
use crate::solver::particles::Vectors;

/// Coordinates of consecutive particles, m, and the slot of the first.
pub(super) type Coordinates<'a> = (usize, [&'a [f32]; 3]);

/// Whether the centres of a chain less `common` are in its box grown by `margin`, and whether the relative motion of neighbours is within
/// `play`, m. (Each chain by itself: where this is computed for all at once, the compiler makes no vectors of it.)
#[inline(always)]
pub(super) fn keeps_within(
    chain: &Chain,
    (first, [x, y, z]): Coordinates,
    links: &Vectors,
    (common, margin): (Vec3, Vec3),
    play: f32,
) -> [bool; 2] {
    let bounds = [chain.least + common - margin, chain.most + common + margin];
    let (slots, count) = (chain.slots(), chain.slots().len());
    let here = slots.start - first;
    let positions = [&x[here..here + count], &y[here..here + count], &z[here..here + count]];
    let [along_x, along_y, along_z] = links.axes();
    let links = [&along_x[slots.clone()], &along_y[slots.clone()], &along_z[slots]];
    let limit = play * play;
    let mut single = Extent::<1>::default();
    single.add_clearance(positions.map(|axis| [axis[0]]), bounds);
    if count <= LANES {
        for place in 1..count {
            single.add([positions, links], place, bounds);
        }
        return [single.is_inside(), single.is_within(limit)];
    }
    let mut lanes = Extent::<LANES>::default();
    let mut place = 1;
    while place + LANES < count {
        lanes.add([positions, links], place, bounds);
        place += LANES;
    }
    // The last ones overlap those before.
    lanes.add([positions, links], count - LANES, bounds);
    [single.is_inside() && lanes.is_inside(), lanes.is_within(limit)]
}

/// A direction along which a chain is monotone, so that it touches nothing of its own: each particle is ahead of the one before by at least a distance.
/// Then so are any two, and links that have no end in common.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct MonotoneDirection {
    /// A unit vector; zero where the chain is not known to be monotone.
    pub direction: Vec3,
    /// m.
    pub min_advance: f32,
}

/// Whether the centres of a chain less `common` are in its box grown by `margin`, and whether it is monotone.
#[inline(always)]
pub(super) fn is_monotone<S: Simd>(
    simd: S,
    chain: &Chain,
    (first, [x, y, z]): Coordinates,
    (common, margin): (Vec3, Vec3),
    monotone: MonotoneDirection,
) -> bool {
    let (least, most) = (chain.least + common - margin, chain.most + common + margin);
    let count = chain.slots().len();
    let here = chain.slots().start - first;
    let positions = [&x[here..here + count], &y[here..here + count], &z[here..here + count]];
    let place_of = |place: usize| Vec3::new(positions[0][place], positions[1][place], positions[2][place]);
    let is_inside = |point: Vec3| point.cmpge(least).all() && point.cmple(most).all();
    if !is_inside(place_of(0)) {
        return false;
    }
    let lanes = S::F32_LANES;
    if count <= lanes {
        return (1..count).all(|place| {
            let advance = monotone.direction.dot(place_of(place) - place_of(place - 1));
            is_inside(place_of(place)) && advance >= monotone.min_advance
        });
    }
    let splat = |vector: Vec3| vector.to_array().map(|value| simd.splat_f32s(value));
    let (least, most, direction) = (splat(least), splat(most), splat(monotone.direction));
    // The least distance to a side of the box, and that by which one is ahead of the one before; the sum is NaN if any of these is.
    let [mut clearance, mut advance] = [simd.splat_f32s(f32::INFINITY); 2];
    let mut sum = simd.splat_f32s(0.0);
    let mut place = 1;
    loop {
        let mut ahead = simd.splat_f32s(0.0);
        for axis in 0..3 {
            let here = vector(simd, positions[axis], place);
            let displacement = simd.sub_f32s(here, vector(simd, positions[axis], place - 1));
            ahead = simd.add_f32s(ahead, simd.mul_f32s(direction[axis], displacement));
            clearance = simd.min_f32s(clearance, simd.sub_f32s(here, least[axis]));
            clearance = simd.min_f32s(clearance, simd.sub_f32s(most[axis], here));
        }
        (advance, sum) = (simd.min_f32s(advance, ahead), simd.add_f32s(sum, ahead));
        if place + lanes == count {
            break;
        }
        // The last ones overlap those before.
        place = (place + lanes).min(count - lanes);
    }
    let excess = simd.sub_f32s(advance, simd.splat_f32s(monotone.min_advance));
    simd.reduce_min_f32s(simd.min_f32s(clearance, excess)) >= 0.0 && !simd.reduce_sum_f32s(sum).is_nan()
}

/// The vector of the numbers from a `place` on.
#[inline(always)]
fn vector<S: Simd>(_: S, numbers: &[f32], place: usize) -> S::f32s {
    S::as_simd_f32s(&numbers[place..place + S::F32_LANES]).0[0]
}

/// How much of what they may use particles of a chain have used, in lanes.
struct Extent<const COUNT: usize> {
    /// The least distance to a side of the box, m: negative outside.
    clearance: [f32; COUNT],
    /// The greatest square of the change of a link, m².
    change: [f32; COUNT],
    /// The sum of these squares: unlike what is the least or the greatest, NaN if any of them is.
    sum: [f32; COUNT],
}

impl<const COUNT: usize> Default for Extent<COUNT> {
    fn default() -> Self {
        Self { clearance: [f32::INFINITY; COUNT], change: [0.0; COUNT], sum: [0.0; COUNT] }
    }
}

impl<const COUNT: usize> Extent<COUNT> {
    /// Adds the particles from a `place` in the chain, and the links that end in them.
    #[expect(clippy::needless_range_loop, reason = "of plain loops the compiler makes vectors")]
    #[inline(always)]
    fn add(&mut self, [positions, links]: [[&[f32]; 3]; 2], place: usize, bounds: [Vec3; 2]) {
        let lanes = |axis: &[f32], place: usize| {
            *axis[place..].first_chunk::<COUNT>().expect("the chain has as many")
        };
        let [x, y, z] = positions;
        let here = [lanes(x, place), lanes(y, place), lanes(z, place)];
        self.add_clearance(here, bounds);
        let mut change_squared = [0.0; COUNT];
        for axis in 0..3 {
            let (before, link) = (lanes(positions[axis], place - 1), lanes(links[axis], place));
            for lane in 0..COUNT {
                let change = (here[axis][lane] - before[lane]) - link[lane];
                change_squared[lane] += change * change;
            }
        }
        for lane in 0..COUNT {
            let change = change_squared[lane];
            self.sum[lane] += change;
            self.change[lane] = if change > self.change[lane] { change } else { self.change[lane] };
        }
    }

    #[expect(clippy::needless_range_loop, reason = "of plain loops the compiler makes vectors")]
    #[inline(always)]
    fn add_clearance(&mut self, positions: [[f32; COUNT]; 3], [least, most]: [Vec3; 2]) {
        for axis in 0..3 {
            for lane in 0..COUNT {
                let [below, above] =
                    [positions[axis][lane] - least[axis], most[axis] - positions[axis][lane]];
                let clearance = if below < above { below } else { above };
                self.clearance[lane] =
                    if clearance < self.clearance[lane] { clearance } else { self.clearance[lane] };
            }
        }
    }

    /// Whether none is outside of the box, or NaN.
    #[inline(always)]
    fn is_inside(&self) -> bool {
        self.clearance.iter().all(|clearance| *clearance >= 0.0) && !self.sum.iter().any(|sum| sum.is_nan())
    }

    /// Whether no square of a change is more than this, or NaN.
    #[inline(always)]
    fn is_within(&self, limit: f32) -> bool {
        !self.change.iter().any(|change| *change > limit) && !self.sum.iter().any(|sum| sum.is_nan())
    }
}
