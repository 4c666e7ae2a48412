//! Triangle meshes: the nearest of their triangles, and on which side of it a point is.
//!
//! What is inside is decided by the angle-weighted normals of faces, edges and corners (Bærentzen and Aanæs, *Signed
//! distance computation using the angle weighted pseudonormal*, IEEE Trans. Vis. Comput. Graphics 11, 243, 2005), which
//! is right for every closed mesh that is consistently oriented.

use bevy::math::{DVec3, Vec3};

use super::normals::{Edges, Normals, find_normals, kind, welded};
use super::simplex::Simplex;
use super::tree::{Bounds, Tree};
use super::triangle::{self, Feature};
use super::{Crossing, Fingerprint, Nearest};
use crate::solver::state::Version;

/// Below this part of the coordinates a distance says nothing about its direction.
const ROUNDING: f64 = 1e-12;

/// Number of parts of the way of a cast, the triangles near each of which are looked up together.
const CAST_PIECES: u32 = 8;

/// What a mesh is the surface of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum MeshKind {
    /// A solid: the mesh is closed.
    Solid,
    /// All that lies behind its triangles.
    OneSided,
    /// Nothing: a sheet, which is met from both sides.
    TwoSided,
}

/// Why a mesh is none that anything can collide with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshError {
    /// A coordinate is infinite or not a number.
    #[error("vertex {0} is not finite")]
    NotFinite(usize),
    /// A triangle has a corner that is not there.
    #[error("triangle {triangle} has the corner {corner}, but there are {vertices} vertices")]
    OutOfRange {
        /// Its number.
        triangle: usize,
        /// The index.
        corner: u32,
        /// Their number.
        vertices: usize,
    },
    /// A triangle has the same corner twice.
    #[error("triangle {0} has the same corner twice")]
    SameCorner(usize),
    /// No triangle has an area.
    #[error("no triangle has an area")]
    Degenerate,
    /// Closed, but its triangles face inwards.
    #[error("it is inside out: its triangles are to be counterclockwise seen from outside")]
    InsideOut,
    /// One-sided, but neighbouring triangles face different sides.
    #[error("its triangles do not all face the same side")]
    NotOriented,
}

/// The mesh, and the tree of its triangles.
#[derive(Debug)]
pub(in crate::solver) struct Mesh {
    corners: Vec<[DVec3; 3]>,
    normals: Vec<Normals>,
    tree: Tree,
    pub bounds: Bounds,
    pub kind: MeshKind,
    /// No other mesh has it.
    pub version: Version,
    /// Of its triangles and what it is.
    pub fingerprint: u64,
}

impl Mesh {
    /// That of these vertices, m; what is closed is solid, what is not is `one_sided` or a sheet.
    pub fn new(vertices: &[Vec3], triangles: &[[u32; 3]], one_sided: bool) -> Result<Self, MeshError> {
        if let Some(vertex) = vertices.iter().position(|vertex| !vertex.is_finite()) {
            return Err(MeshError::NotFinite(vertex));
        }
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(corner) = corners.iter().copied().find(|corner| *corner as usize >= vertices.len()) {
                return Err(MeshError::OutOfRange { triangle, corner, vertices: vertices.len() });
            }
            let [a, b, c] = *corners;
            if a == b || b == c || c == a {
                return Err(MeshError::SameCorner(triangle));
            }
        }
        let place_of = welded(vertices);
        let place = |corner: u32| vertices[corner as usize].as_dvec3();
        let area = |corners: &[u32; 3]| {
            let [a, b, c] = corners.map(place);
            (b - a).cross(c - a)
        };
        let triangles: Vec<[u32; 3]> = triangles
            .iter()
            .map(|corners| corners.map(|corner| place_of[corner as usize]))
            .filter(|corners| area(corners).length_squared() > 0.0)
            .collect();
        if triangles.is_empty() {
            return Err(MeshError::Degenerate);
        }
        let edges = Edges::of(&triangles);
        let corners: Vec<[DVec3; 3]> = triangles.iter().map(|corners| corners.map(place)).collect();
        let kind = kind(&corners, &edges, one_sided)?;
        let bounds_of = |corners: &[DVec3; 3]| {
            corners.iter().fold(Bounds::EMPTY, |all, corner| all.with(corner.as_vec3()))
        };
        let all: Vec<Bounds> = corners.iter().map(bounds_of).collect();
        let mut tree = Tree::default();
        tree.build(&all);
        let bounds = all.into_iter().fold(Bounds::EMPTY, Bounds::union);
        let normals = find_normals(&triangles, &corners, &edges, vertices.len());
        let mut fingerprint = Fingerprint::default();
        corners.iter().flatten().for_each(|corner| fingerprint.add_floats(corner.to_array()));
        fingerprint.add(kind as u64);
        let fingerprint = fingerprint.finish();
        Ok(Self { corners, normals, tree, bounds, kind, version: Version::new(), fingerprint })
    }

    /// The nearest point of the surface; of a sheet that is met from the side of its normals (1) or from the other one
    /// (−1), `side` says which, 0: from that on which the point is.
    pub fn nearest(&self, point: DVec3, side: f64) -> Nearest {
        let mut best = Best::NONE;
        self.tree.nearest(point, f64::INFINITY, |item| {
            best.try_triangle(point, self.corners[item as usize], item);
            best.square
        });
        self.nearest_at(point, side, best)
    }

    /// The nearest point of these triangles, as if there were no others; `side` as for [`nearest`](Self::nearest). Each is at least as
    /// far away as is said, and none is meant to be nearer than one before it.
    pub fn nearest_of(&self, point: DVec3, side: f64, items: impl Iterator<Item = (u32, f64)>) -> Nearest {
        let mut best = Best::NONE;
        for (item, least) in items {
            if least > 0.0 && least * least > best.square {
                break;
            }
            best.try_triangle(point, self.corners[item as usize], item);
        }
        self.nearest_at(point, side, best)
    }

    /// Calls `visit` with the number of each triangle that is at most `reach` m away, and how far it is, m; in no order.
    pub fn within(&self, point: DVec3, reach: f64, mut visit: impl FnMut(u32, f64)) {
        let wide = (reach * (1.0 + 1e-6)) as f32 + 4.0 * f32::EPSILON * point.abs().max_element() as f32;
        self.overlapping(&Bounds::of_sphere(point.as_vec3(), wide), |item, corners| {
            let distance = triangle::nearest_point(point, corners).0.distance(point);
            if distance <= reach {
                visit(item, distance);
            }
        });
    }

    /// The longest side of what bounds it, m.
    pub fn size(&self) -> f64 {
        f64::from((self.bounds.high - self.bounds.low).max_element())
    }

    fn nearest_at(&self, point: DVec3, side: f64, best: Best) -> Nearest {
        let Best { square, item, foot, feature } = best;
        let far = Nearest { distance: f64::INFINITY, normal: DVec3::Y };
        let Some(normals) = self.normals.get(item as usize) else { return far };
        let (normal, is_border) = normals.of(feature);
        let apart = point - foot;
        let is_behind = apart.dot(normal) < 0.0;
        let sign = match self.kind {
            MeshKind::Solid if is_behind => -1.0,
            MeshKind::OneSided if is_behind && !is_border => -1.0,
            MeshKind::TwoSided if side != 0.0 && !is_border && is_behind == (side > 0.0) => -1.0,
            _ => 1.0,
        };
        let distance = square.sqrt();
        let facing = if self.kind == MeshKind::TwoSided && side < 0.0 { -normal } else { normal };
        let normal = match distance > ROUNDING * point.abs().max_element() {
            true if feature == Feature::Face => normals.face * if is_behind { -sign } else { sign },
            true => apart * (sign / distance),
            false => facing,
        };
        Nearest { distance: sign * distance, normal }
    }

    /// On which side of the sheet a point is: 1 or −1; 0 beyond its border, and of what is no sheet.
    pub fn side(&self, point: DVec3) -> f64 {
        if self.kind != MeshKind::TwoSided {
            return 0.0;
        }
        let nearest = self.nearest(point, 1.0);
        let is_behind = self.nearest(point, -1.0).distance > 0.0;
        match (nearest.distance < 0.0, is_behind) {
            (true, _) => -1.0,
            (false, true) => 0.0,
            (false, false) => 1.0,
        }
    }

    /// Where the path of a point first crosses the surface from outside.
    pub fn crossing(&self, from: DVec3, to: DVec3) -> Option<Crossing> {
        let extent = Bounds::EMPTY.with(from.as_vec3()).with(to.as_vec3());
        let rounding = 4.0 * f32::EPSILON * from.abs().max(to.abs()).max_element() as f32;
        let mut first: Option<(f64, u32, bool)> = None;
        self.tree.overlapping(&extent.grown(rounding), |item| {
            let Some((time, is_front)) = triangle::crossing(from, to, self.corners[item as usize]) else {
                return;
            };
            let counts = is_front || self.kind == MeshKind::TwoSided;
            if counts && first.is_none_or(|(least, known, _)| (time, item) < (least, known)) {
                first = Some((time, item, is_front));
            }
        });
        let (time, item, is_front) = first?;
        let face = self.normals[item as usize].face;
        Some(Crossing { time, foot: from.lerp(to, time), normal: if is_front { face } else { -face } })
    }

    /// Where a ball first touches the surface, from either side, on the way of its centre.
    pub fn cast(&self, from: DVec3, to: DVec3, radius: f64) -> Option<Crossing> {
        let length = from.distance(to);
        let farthest =
            (self.bounds.low.as_dvec3() - from).abs().max((self.bounds.high.as_dvec3() - from).abs());
        // Beyond that there is nothing of it.
        let part = ((farthest.length() + radius) / length).min(1.0);
        let at = |share: f64| from.lerp(to, share * part);
        let rounding = 8.0 * f32::EPSILON * from.abs().max(at(1.0).abs()).max_element() as f32;
        let margin = (radius * (1.0 + 1e-6)) as f32 + rounding + 1e-6;
        let mut first: Option<Crossing> = None;
        for piece in 0..CAST_PIECES {
            let [start, end] = [piece, piece + 1].map(|piece| f64::from(piece) / f64::from(CAST_PIECES));
            let bounds = Bounds::EMPTY.with(at(start).as_vec3()).with(at(end).as_vec3());
            self.overlapping(&bounds.grown(margin), |_, corners| {
                let found = Simplex::new(corners, 0.0).cast(from, at(1.0), radius);
                if found.is_some_and(|found| first.is_none_or(|first| found.time < first.time)) {
                    first = found;
                }
            });
            if first.is_some_and(|first| first.time <= end) {
                break;
            }
        }
        first.map(|first| Crossing { time: first.time * part, ..first })
    }

    /// The corners of all triangles and their normals.
    pub fn faces(&self) -> impl Iterator<Item = ([DVec3; 3], DVec3)> {
        self.corners.iter().zip(&self.normals).map(|(corners, normals)| (*corners, normals.face))
    }

    /// Whether any triangle may overlap these bounds.
    pub fn any_overlapping(&self, bounds: &Bounds) -> bool {
        self.tree.any_overlapping(bounds)
    }

    /// Calls `visit` with number and corners of each triangle that may overlap these bounds, in no order.
    pub fn overlapping(&self, bounds: &Bounds, mut visit: impl FnMut(u32, [DVec3; 3])) {
        self.tree.overlapping(bounds, |item| visit(item, self.corners[item as usize]));
    }
}

/// The nearest triangle so far.
#[derive(Debug, Clone, Copy)]
struct Best {
    /// Of the distance, m².
    square: f64,
    item: u32,
    foot: DVec3,
    feature: Feature,
}

impl Best {
    const NONE: Self =
        Self { square: f64::INFINITY, item: u32::MAX, foot: DVec3::ZERO, feature: Feature::Face };

    /// Of what is equally near the first one counts.
    #[inline]
    fn try_triangle(&mut self, point: DVec3, corners: [DVec3; 3], item: u32) {
        let (foot, feature) = triangle::nearest_point(point, corners);
        let square = foot.distance_squared(point);
        if square < self.square || (square == self.square && item < self.item) {
            *self = Self { square, item, foot, feature };
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::primitives::cuboid;
    use super::*;

    /// The box of half sizes 1, 2, 3 m.
    pub fn box_mesh() -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let vertices = (0..8)
            .map(|corner| {
                let side = |bit: u32| if corner >> bit & 1 == 1 { 1.0 } else { -1.0 };
                Vec3::new(side(0), 2.0 * side(1), 3.0 * side(2))
            })
            .collect();
        let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let triangles = quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
        (vertices, triangles)
    }

    #[test]
    fn a_closed_mesh_is_as_far_as_the_box_that_it_is() {
        let (vertices, triangles) = box_mesh();
        let mesh = Mesh::new(&vertices, &triangles, false).unwrap();
        assert_eq!(mesh.kind, MeshKind::Solid);
        for sample in 0..2000 {
            let part = |scale: u32| f64::from(sample * scale % 97) / 97.0 - 0.5;
            let point = DVec3::new(5.0 * part(13), 9.0 * part(29), 11.0 * part(41));
            let expected = cuboid(point, DVec3::new(1.0, 2.0, 3.0));
            let found = mesh.nearest(point, 0.0);
            assert!((found.distance - expected.distance).abs() < 1e-12, "{point}: {found:?}, {expected:?}");
            let foot = point - found.normal * found.distance;
            assert!(cuboid(foot, DVec3::new(1.0, 2.0, 3.0)).distance.abs() < 1e-12, "{point}: {found:?}");
        }
    }

    #[test]
    fn what_is_bad_is_refused_by_name() {
        let (vertices, mut triangles) = box_mesh();
        triangles.iter_mut().for_each(|triangle| triangle.reverse());
        assert_eq!(Mesh::new(&vertices, &triangles, false).unwrap_err(), MeshError::InsideOut);
        let corners = [Vec3::ZERO, Vec3::X, Vec3::X * 2.0];
        assert_eq!(Mesh::new(&corners, &[[0, 1, 2]], false).unwrap_err(), MeshError::Degenerate);
        assert_eq!(Mesh::new(&corners, &[[0, 1, 1]], false).unwrap_err(), MeshError::SameCorner(0));
        assert_eq!(Mesh::new(&corners, &[], false).unwrap_err(), MeshError::Degenerate);
        let error = Mesh::new(&corners, &[[0, 1, 9]], false).unwrap_err();
        assert_eq!(error, MeshError::OutOfRange { triangle: 0, corner: 9, vertices: 3 });
        assert_eq!(Mesh::new(&[Vec3::NAN], &[], false).unwrap_err(), MeshError::NotFinite(0));
    }

    /// Two triangles of a square, of which the second looks down, and three at one edge: sheets, but not one-sided ones.
    #[test]
    fn one_sided_meshes_are_to_face_one_side() {
        let corners = [Vec3::ZERO, Vec3::Z, Vec3::new(1.0, 0.0, 1.0), Vec3::X, Vec3::NEG_X];
        let up = [[0, 1, 2], [0, 2, 3]];
        let turned = [[0, 1, 2], [0, 3, 2]];
        let fan = [[0, 1, 2], [0, 2, 3], [0, 2, 4]];
        assert_eq!(Mesh::new(&corners, &up, true).unwrap().kind, MeshKind::OneSided);
        for triangles in [&turned[..], &fan[..]] {
            assert_eq!(Mesh::new(&corners, triangles, true).unwrap_err(), MeshError::NotOriented);
            assert_eq!(Mesh::new(&corners, triangles, false).unwrap().kind, MeshKind::TwoSided);
        }
    }

    #[test]
    fn a_sheet_is_met_from_both_sides_and_a_one_sided_one_from_the_front() {
        let corners = [Vec3::ZERO, Vec3::Z, Vec3::X];
        let sheet = Mesh::new(&corners, &[[0, 1, 2]], false).unwrap();
        assert_eq!(sheet.kind, MeshKind::TwoSided);
        let (above, below) = (DVec3::new(0.2, 0.5, 0.2), DVec3::new(0.2, -0.5, 0.2));
        assert_eq!(sheet.nearest(above, 0.0), Nearest { distance: 0.5, normal: DVec3::Y });
        assert_eq!(sheet.nearest(below, 0.0), Nearest { distance: 0.5, normal: DVec3::NEG_Y });
        assert_eq!(sheet.nearest(below, 1.0), Nearest { distance: -0.5, normal: DVec3::Y });
        assert_eq!(sheet.nearest(above, -1.0), Nearest { distance: -0.5, normal: DVec3::NEG_Y });
        assert_eq!([above, below].map(|point| sheet.side(point)), [1.0, -1.0]);
        assert_eq!(sheet.side(DVec3::new(-1.0, -0.5, 0.2)), 0.0);
        let crossing = sheet.crossing(below, above).unwrap();
        assert_eq!((crossing.time, crossing.normal), (0.5, DVec3::NEG_Y));
        let floor = Mesh::new(&corners, &[[0, 1, 2]], true).unwrap();
        assert_eq!(floor.nearest(below, 0.0), Nearest { distance: -0.5, normal: DVec3::Y });
        assert!(floor.nearest(DVec3::new(-1.0, -0.5, 0.2), 0.0).distance > 0.0, "beyond its border");
        assert!(floor.crossing(below, above).is_none() && floor.crossing(above, below).is_some());
    }
}
