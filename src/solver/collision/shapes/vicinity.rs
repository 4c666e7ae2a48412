//! The triangles of a mesh near a point that moves little, so that what lies on a mesh does not search the tree again.
//!
//! A distance changes by no more than the displacement of the point. So a triangle that was farther away than all of a short list is not
//! the nearest as long as the point has moved by less than half the difference. The result is that of a search of the tree, to the bit.

use bevy::math::{DVec3, Vec3};

use super::Nearest;
use super::mesh::Mesh;
use crate::solver::state::Version;

/// Triangles of a list, at most: as many as meet in a corner of a regular mesh.
const MAX_LISTED: usize = 6;

/// The least margin of a list, as a part of the size of the mesh.
const MIN_MARGIN: f64 = 1e-4;

/// What is known of a mesh from one place in its axes: all its triangles but the first `count` of `listed` are farther away
/// than `clearance`, m, and those are in the order of their distances.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::solver) struct Vicinity {
    mesh: Version,
    place: Vec3,
    clearance: f32,
    listed: [Listed; MAX_LISTED],
    count: u32,
}

#[derive(Debug, Clone, Copy, Default)]
struct Listed {
    triangle: u32,
    /// No farther away than it is, m.
    distance: f32,
}

impl Vicinity {
    /// The nearest point of the surface if it is at most `within` m away, or the point is inside; `side` as for [`Mesh::nearest`]. A
    /// list is made with `margin` m, which is to be several times the displacement between two calls.
    pub fn nearest(
        &mut self,
        mesh: &Mesh,
        (point, side): (DVec3, f64),
        within: f64,
        margin: impl FnOnce() -> f64,
    ) -> Option<Nearest> {
        let near = |nearest: Nearest| (nearest.distance <= within).then_some(nearest);
        if let Some((clearance, _)) = self.clearance_at(mesh, point) {
            if self.count == 0 && clearance > within {
                return None;
            }
            if let Some(found) = self.known(mesh, (point, side)) {
                return near(found);
            }
        }
        let found = mesh.nearest(point, side);
        let margin = margin().max(MIN_MARGIN * mesh.size());
        if found.distance.abs() <= within + margin {
            self.list(mesh, point, found.distance.abs() + margin);
        } else if found.distance > within {
            *self = Self { count: 0, ..Self::new(mesh, point, found.distance) };
        }
        near(found)
    }

    /// The nearest point of the surface, if it is on one of the listed triangles.
    pub fn known(&self, mesh: &Mesh, (point, side): (DVec3, f64)) -> Option<Nearest> {
        let (clearance, moved) = self.clearance_at(mesh, point).filter(|_| self.count > 0)?;
        let listed = self.listed[..self.count as usize].iter();
        let bounded = listed.map(|listed| (listed.triangle, f64::from(listed.distance) - moved));
        let found = mesh.nearest_of(point, side, bounded);
        (found.distance.abs() < clearance).then_some(found)
    }

    /// How far triangles that are not listed are from a point, at least, and how far that is from where the list was made, m.
    fn clearance_at(&self, mesh: &Mesh, point: DVec3) -> Option<(f64, f64)> {
        let moved = point.distance(self.place.as_dvec3()) * (1.0 + 1e-6);
        (self.mesh == mesh.version).then(|| (f64::from(self.clearance) - moved, moved))
    }

    fn new(mesh: &Mesh, point: DVec3, clearance: f64) -> Self {
        Self {
            mesh: mesh.version,
            place: point.as_vec3(),
            clearance: rounded_down(clearance, point),
            listed: [Listed::default(); MAX_LISTED],
            count: 0,
        }
    }

    /// Lists the nearest triangles of those within `reach` m.
    fn list(&mut self, mesh: &Mesh, point: DVec3, reach: f64) {
        let mut listed = [(f64::INFINITY, u32::MAX); MAX_LISTED + 1];
        mesh.within(point, reach, |item, distance| {
            let mut next = (distance, item);
            for place in &mut listed {
                if next < *place {
                    std::mem::swap(&mut next, place);
                }
            }
        });
        let (first_left, _) = listed[MAX_LISTED];
        let known = listed.iter().take(MAX_LISTED).filter(|(_, item)| *item != u32::MAX);
        *self = Self::new(mesh, point, reach.min(first_left));
        for (place, (distance, triangle)) in known.enumerate() {
            self.listed[place] = Listed { triangle: *triangle, distance: rounded_down(*distance, point) };
            self.count += 1;
        }
    }
}

/// A distance from a point, so much smaller that it is none too large from where the point is in f32.
fn rounded_down(distance: f64, point: DVec3) -> f32 {
    (distance - 1e-6 * (point.abs().max_element() + distance)) as f32
}

#[cfg(test)]
mod tests {
    use super::super::mesh::tests::box_mesh;
    use super::*;

    /// A point that walks about a box, near and far, inside and out.
    #[test]
    fn what_is_near_is_what_a_search_finds() {
        let (vertices, triangles) = box_mesh();
        let mesh = Mesh::new(&vertices, &triangles, false).unwrap();
        let (mut vicinity, mut reused, mut touched) = (Vicinity::default(), 0, 0);
        for step in 0..20_000_u32 {
            let time = f64::from(step) * 1e-3;
            let turn = |speed: f64| bevy::math::ops::sin((speed * time) as f32);
            let point = DVec3::new(
                f64::from(turn(0.7)) * 1.4,
                f64::from(turn(1.1)) * 2.4,
                f64::from(turn(1.3)) * 3.4,
            );
            let before = vicinity.place;
            let found = vicinity.nearest(&mesh, (point, 0.0), 0.1, || 0.05);
            let expected = mesh.nearest(point, 0.0);
            assert_eq!(found, (expected.distance <= 0.1).then_some(expected), "step {step}");
            reused += u32::from(vicinity.place == before);
            touched += u32::from(found.is_some());
        }
        assert!(reused > 10_000 && (1000..19_000).contains(&touched), "{reused}, {touched}");
    }

    /// A point that goes through a sheet and back, which is met from one side, from the other, or from that on which it is.
    #[test]
    fn what_is_known_of_a_sheet_is_what_a_search_from_its_side_finds() {
        let corners: Vec<Vec3> =
            (0..25_u8).map(|corner| Vec3::new(f32::from(corner % 5), 0.0, f32::from(corner / 5))).collect();
        let cells = (0..16_u32).map(|cell| cell / 4 * 5 + cell % 4);
        let triangles: Vec<[u32; 3]> =
            cells.flat_map(|at| [[at, at + 5, at + 6], [at, at + 6, at + 1]]).collect();
        let sheet = Mesh::new(&corners, &triangles, false).unwrap();
        assert_eq!(sheet.kind, super::super::MeshKind::TwoSided);
        for side in [-1.0, 0.0, 1.0] {
            let (mut vicinity, mut known) = (Vicinity::default(), 0);
            for step in 0..4000_u32 {
                let time = f64::from(step) * 1e-3;
                let height = 0.1 * f64::from(bevy::math::ops::sin((5.0 * time) as f32));
                let point = DVec3::new(0.5 + 0.7 * time, height, 1.3 + 0.4 * time);
                let expected = sheet.nearest(point, side);
                if let Some(found) = vicinity.known(&sheet, (point, side)) {
                    known += 1;
                    assert_eq!(found, expected, "side {side}, step {step}");
                }
                let found = vicinity.nearest(&sheet, (point, side), f64::INFINITY, || 0.02);
                assert_eq!(found, Some(expected), "side {side}, step {step}");
            }
            assert!(known > 2000, "{known}");
        }
    }
}
