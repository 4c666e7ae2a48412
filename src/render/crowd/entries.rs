//! From the particles of a rope to what the vertex shader reads of them.
//!
//! A strand has two more entries at each end, as control points of the shader's splines: those of a loop repeat its other end, those of
//! others are the next particles inwards, reflected at the end. So the shader needs no special case for ends.

use bevy::math::Vec3A;

use super::Entry;
use crate::render::surface::Scratch;
use crate::render::tube::{Section, Tube, centres, directions, roll};

/// The number of entries before the first and after the last particle of a strand.
pub(super) const MARGIN: usize = 2;

impl Tube {
    /// The number of entries of all strands.
    pub fn entry_count(&self) -> usize {
        self.strands.iter().map(|strand| strand.particles.len() + 2 * MARGIN).sum()
    }

    /// Computes the entries from `scratch.places`, which are in the world.
    pub fn write_entries(&self, scratch: &mut Scratch, entries: &mut Vec<Entry>) {
        entries.clear();
        let Section::Round { radius, .. } = self.profile.section else { return };
        let rings = self.profile.rings as f32;
        let Scratch { places, points, axes, normals } = scratch;
        for (strand, start) in self.strands.iter().zip(&self.starts) {
            centres(strand, places, 1, points);
            let last = points.len() - 1;
            directions(points, strand.is_closed, axes);
            roll(strand, start, points, axes, normals);
            let mut push = |place: Vec3A, normal: Vec3A| {
                let ([x, y, z], [u, v, w]) = (place.to_array(), normal.to_array());
                entries.push([x, y, z, rings, u, v, w, radius]);
            };
            let [before, after] = margins(points, strand.is_closed);
            before.into_iter().for_each(|place| push(place, normals[0]));
            points.iter().zip(&*normals).for_each(|(place, normal)| push(*place, *normal));
            after.into_iter().for_each(|place| push(place, normals[last]));
        }
    }
}

/// The places beyond both ends.
fn margins(points: &[Vec3A], is_closed: bool) -> [[Vec3A; MARGIN]; 2] {
    let last = points.len() - 1;
    if is_closed {
        return [[points[last.saturating_sub(2)], points[last - 1]], [points[1], points[2.min(last)]]];
    }
    // Beyond a single link a strand goes on straight.
    let second = |end: usize, next: usize, second: Option<&Vec3A>| {
        second.copied().unwrap_or(2.0 * points[next] - points[end])
    };
    let reflect = |end: usize, place: Vec3A| 2.0 * points[end] - place;
    let from_start = second(0, 1, points.get(2));
    let from_end = second(last, last - 1, last.checked_sub(2).and_then(|place| points.get(place)));
    [
        [reflect(0, from_start), reflect(0, points[1])],
        [reflect(last, points[last - 1]), reflect(last, from_end)],
    ]
}
