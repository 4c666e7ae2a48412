//! How much of its box and of its play a chain has used.

use bevy::math::Vec3;

use super::chains::{Chain, LANES};
use crate::solver::particles::Vectors;

/// Coordinates of consecutive particles, m, and the slot of the first.
pub(super) type Coordinates<'a> = (usize, [&'a [f32]; 3]);

/// Whether all of these chains touch nothing, as each is in what is reserved for it and exceeds none of its play.
#[inline(always)]
pub(super) fn are_free(chains: &[Chain], positions: Coordinates, links: &Vectors, common: Vec3) -> bool {
    let mut extents = Extents::default();
    for chain in chains {
        extents.add(chain, positions, links, (common, chain.margin), chain.play);
    }
    extents.are_inside() && extents.are_within_play()
}

/// How much of what they may use chains have used.
#[derive(Default)]
pub(super) struct Extents {
    lanes: Extent<LANES>,
    single: Extent<1>,
}

impl Extents {
    /// Adds a chain, with its box as [`Chain::keeps_within`] has it.
    #[inline(always)]
    pub fn add(
        &mut self,
        chain: &Chain,
        (first, positions): Coordinates,
        links: &Vectors,
        (common, margin): (Vec3, Vec3),
        play: f32,
    ) {
        let Self { lanes, single } = self;
        let bounds = [chain.least + common - margin, chain.most + common + margin];
        let (slots, count) = (chain.slots(), chain.slots().len());
        let here = slots.start - first;
        // No closures in `map`, here and below: it might not be inlined, and is then compiled without AVX2.
        let [x, y, z] = positions;
        let [x, y, z] = [&x[here..here + count], &y[here..here + count], &z[here..here + count]];
        let [along_x, along_y, along_z] = links.axes();
        let links = [&along_x[slots.clone()], &along_y[slots.clone()], &along_z[slots]];
        let positions = [x, y, z];
        let limit = play * play;
        single.add_room([[x[0]], [y[0]], [z[0]]], bounds);
        if count <= LANES {
            for place in 1..count {
                single.add([positions, links], place, bounds, limit);
            }
            return;
        }
        let mut place = 1;
        while place + LANES < count {
            lanes.add([positions, links], place, bounds, limit);
            place += LANES;
        }
        // The last ones overlap those before.
        lanes.add([positions, links], count - LANES, bounds, limit);
    }

    #[inline(always)]
    pub fn are_inside(&self) -> bool {
        self.lanes.is_inside() && self.single.is_inside()
    }

    #[inline(always)]
    pub fn are_within_play(&self) -> bool {
        self.lanes.is_within_play() && self.single.is_within_play()
    }
}

/// The same, in lanes.
struct Extent<const COUNT: usize> {
    /// The least distance to a side of the box, m: negative outside.
    room: [f32; COUNT],
    /// The greatest square of the change of a link less that of the play, m²: positive beyond it.
    excess: [f32; COUNT],
    /// The sum of these squares: unlike what is the least or the greatest, NaN if any of them is.
    sum: [f32; COUNT],
}

impl<const COUNT: usize> Default for Extent<COUNT> {
    fn default() -> Self {
        Self { room: [f32::INFINITY; COUNT], excess: [f32::NEG_INFINITY; COUNT], sum: [0.0; COUNT] }
    }
}

impl<const COUNT: usize> Extent<COUNT> {
    /// Adds the particles from a `place` in the chain, and the links that end in them; the square of the play is `limit`, m².
    #[inline(always)]
    fn add(&mut self, [positions, links]: [[&[f32]; 3]; 2], place: usize, bounds: [Vec3; 2], limit: f32) {
        let lanes = |axis: &[f32], place: usize| {
            *axis[place..].first_chunk::<COUNT>().expect("the chain has as many")
        };
        let here = positions.map(|axis| lanes(axis, place));
        self.add_room(here, bounds);
        let mut change_squared = [0.0; COUNT];
        for axis in 0..3 {
            let (before, link) = (lanes(positions[axis], place - 1), lanes(links[axis], place));
            for lane in 0..COUNT {
                let change = (here[axis][lane] - before[lane]) - link[lane];
                change_squared[lane] += change * change;
            }
        }
        for lane in 0..COUNT {
            let excess = change_squared[lane] - limit;
            self.sum[lane] += change_squared[lane];
            self.excess[lane] = if excess > self.excess[lane] { excess } else { self.excess[lane] };
        }
    }

    #[inline(always)]
    fn add_room(&mut self, positions: [[f32; COUNT]; 3], [least, most]: [Vec3; 2]) {
        for axis in 0..3 {
            for lane in 0..COUNT {
                let [below, above] =
                    [positions[axis][lane] - least[axis], most[axis] - positions[axis][lane]];
                let room = if below < above { below } else { above };
                self.room[lane] = if room < self.room[lane] { room } else { self.room[lane] };
            }
        }
    }

    #[inline(always)]
    fn is_inside(&self) -> bool {
        self.room.iter().all(|room| *room >= 0.0)
    }

    #[inline(always)]
    fn is_within_play(&self) -> bool {
        !self.excess.iter().any(|excess| *excess > 0.0) && !self.sum.iter().any(|sum| sum.is_nan())
    }
}
