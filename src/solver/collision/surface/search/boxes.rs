//! How far each vertex may get until a search is no longer good, and the box in which it is until then.

use bevy::math::Vec3A;

use super::super::pair::{CLOSE_PART, MIN_DISTANCE_PART};
use super::super::primitives::Primitives;
use super::super::spread::{Spread, margin_of, slow_limit, swept_margin_of};
use super::super::tree::Box3;
use super::{Moving, Search, has_diverged};

/// Only lists of a search that allowed for fast motion are rebuilt with age: its limits were, on average, wider than those of vertices at
/// rest by this factor. A new search at narrow margins would find as many pairs again.
const MIN_WIDENING: f32 = 1.5;

/// By how much vertices may be beyond their limits where pairs are wanted only to stop what would pass through something, as a part of their
/// radius: what is not known then is not nearer than 1 − 0.8 of the distance at which it touches, and what is stopped is nearer than that.
const STOP_SLACK: f32 = 0.8;

const _: () = assert!(STOP_SLACK < 1.0 - (1.0 + CLOSE_PART) * MIN_DISTANCE_PART);

impl Search {
    /// Computes the margins and boxes of the vertices, with room for ways within bodies if these are wanted, or for the paths of the
    /// substep only. By how much wider the limits are than those of vertices at rest, on average.
    pub(super) fn make_boxes(
        &mut self,
        primitives: &Primitives,
        moving: Moving,
        (within, is_swept): (bool, bool),
    ) -> f32 {
        let Self { displacements, boxes, frames, drifts, largest, slacks, all_finite, .. } = self;
        *all_finite = true;
        let (forest, radius) = (&primitives.forest, moving.particles.radius());
        displacements.begin(moving, forest.bodies.len(), is_swept);
        boxes.iter_mut().for_each(|boxes| boxes.resize(moving.particles.len(), Box3::NOTHING));
        frames.clear();
        drifts.clear();
        largest.clear();
        slacks.clear();
        let margins = self.margins;
        // All limits, and what they would be of slow vertices, m.
        let mut sums = [0.0; 2];
        let mut place = |slot: usize, displacement: Vec3A, frame: usize| {
            let size = (radius[slot], margins[frame]);
            let (limit, place) = match is_swept {
                true => swept_margin_of(moving.ends(slot), displacement, size),
                false => margin_of(moving.ends(slot), displacement, size),
            };
            boxes[frame][slot] = place;
            *all_finite &= place.is_some();
            (sums[0], sums[1]) = (sums[0] + limit, sums[1] + slow_limit(radius[slot]));
            limit
        };
        for (number, body) in forest.bodies.iter().enumerate() {
            let spread = Spread::of(&body.runs, moving, [&displacements.origins; 2]);
            frames.push(usize::from(!has_diverged(primitives, number, &spread, moving)));
            let [_, drift] = spread.drift();
            let (mut thickest, mut thinnest) = (0.0_f32, f32::INFINITY);
            for slot in forest.vertices_of(body).iter().map(|slot| *slot as usize) {
                let [start, end] = moving.ends(slot);
                let own = if within { end - start - drift } else { Vec3A::ZERO };
                for (frame, displacement) in [own, end - start].into_iter().enumerate() {
                    displacements.limit((number, slot, frame), place(slot, displacement, frame));
                }
                (thickest, thinnest) = (thickest.max(radius[slot]), thinnest.min(radius[slot]));
            }
            // The distance of two sides is that of their thickest corners, which boxes of the others do not keep. Neighbours touch at half of
            // the way along the mesh.
            let slack = (thinnest - (1.0 - STOP_SLACK) * thickest).max(0.0);
            slacks.push(slack.min(STOP_SLACK * 0.25 * primitives.shortest_link));
            largest.push(thickest + 0.5 * margins[1]);
            drifts.push(drift);
        }
        for slot in primitives.balls.iter().map(|slot| *slot as usize) {
            let [start, end] = moving.ends(slot);
            displacements.limits[1][slot] = place(slot, end - start, 1);
        }
        self.is_wide = sums[0] > MIN_WIDENING * sums[1];
        sums[0] / sums[1]
    }
}
