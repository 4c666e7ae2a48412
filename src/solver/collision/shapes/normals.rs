//! The connectivity of the triangles of a mesh, and their normals.

use bevy::math::{DVec3, Vec3};

use super::mesh::{MeshError, MeshKind};
use super::triangle::Feature;

/// A closed mesh counts as a sheet if its volume is below this fraction of that of a cube of the same surface area.
const MIN_VOLUME: f64 = 1e-9;

/// Those of a triangle: of its face, its edges and its corners.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Normals {
    pub face: DVec3,
    edges: [DVec3; 3],
    corners: [DVec3; 3],
    /// Bits of the edges, then of the corners, that lie on the border.
    border: u8,
}

impl Normals {
    /// That of a part of it, and whether that lies on the border of the mesh.
    pub fn of(&self, feature: Feature) -> (DVec3, bool) {
        match feature {
            Feature::Face => (self.face, false),
            Feature::Edge(edge) => (self.edges[edge], self.border >> edge & 1 == 1),
            Feature::Corner(corner) => (self.corners[corner], self.border >> (3 + corner) & 1 == 1),
        }
    }
}

/// For each vertex, the first one in the same place.
pub(super) fn welded(vertices: &[Vec3]) -> Vec<u32> {
    let mut order: Vec<u32> = (0..vertices.len() as u32).collect();
    // −0 is 0.
    let key = |vertex: u32| (vertices[vertex as usize] + Vec3::ZERO).to_array().map(f32::to_bits);
    order.sort_unstable_by_key(|vertex| (key(*vertex), *vertex));
    let mut first_of = vec![0; vertices.len()];
    for same in order.chunk_by(|one, next| key(*one) == key(*next)) {
        same.iter().for_each(|vertex| first_of[*vertex as usize] = same[0]);
    }
    first_of
}

/// The edges of all triangles, sorted by their ends: the smaller end, the larger one, whether the edge runs from the
/// larger to the smaller, the triangle and which of its edges.
pub(super) struct Edges(Vec<(u32, u32, bool, u32, usize)>);

impl Edges {
    pub fn of(triangles: &[[u32; 3]]) -> Self {
        let mut edges = Vec::with_capacity(3 * triangles.len());
        for (number, corners) in (0..).zip(triangles) {
            for edge in 0..3 {
                let (from, to) = (corners[edge], corners[(edge + 1) % 3]);
                edges.push((from.min(to), from.max(to), from > to, number, edge));
            }
        }
        edges.sort_unstable();
        Self(edges)
    }

    /// Those between the same two vertices, together.
    fn groups(&self) -> impl Iterator<Item = &[(u32, u32, bool, u32, usize)]> {
        self.0.chunk_by(|one, next| (one.0, one.1) == (next.0, next.1))
    }
}

/// What the mesh is the surface of.
pub(super) fn kind(corners: &[[DVec3; 3]], edges: &Edges, one_sided: bool) -> Result<MeshKind, MeshError> {
    let is_oriented =
        edges.groups().all(|group| group.len() == 1 || (group.len() == 2 && group[0].2 != group[1].2));
    let is_closed = is_oriented && edges.groups().all(|group| group.len() == 2);
    if is_closed {
        let volume = corners.iter().map(|[a, b, c]| a.dot(b.cross(*c)) / 6.0).sum::<f64>();
        let area = corners.iter().map(|[a, b, c]| 0.5 * (*b - *a).cross(*c - *a).length()).sum::<f64>();
        let least = MIN_VOLUME * (area / 6.0).powf(1.5);
        return match volume {
            _ if volume > least => Ok(MeshKind::Solid),
            _ if volume < -least => Err(MeshError::InsideOut),
            _ => Ok(MeshKind::TwoSided),
        };
    }
    match one_sided {
        true if !is_oriented => Err(MeshError::NotOriented),
        true => Ok(MeshKind::OneSided),
        false => Ok(MeshKind::TwoSided),
    }
}

/// The normals of all triangles.
pub(super) fn find_normals(
    triangles: &[[u32; 3]],
    corners: &[[DVec3; 3]],
    edges: &Edges,
    vertices: usize,
) -> Vec<Normals> {
    let mut normals = vec![Normals::default(); triangles.len()];
    let mut of_vertex = vec![DVec3::ZERO; vertices];
    let mut is_border = vec![false; vertices];
    for ((own, triangle), places) in normals.iter_mut().zip(triangles).zip(corners) {
        let [a, b, c] = *places;
        own.face = (b - a).cross(c - a).normalize();
        for (corner, vertex) in triangle.iter().enumerate() {
            let place = places[corner];
            let sides = [places[(corner + 1) % 3] - place, places[(corner + 2) % 3] - place];
            of_vertex[*vertex as usize] += own.face * sides[0].angle_between(sides[1]);
        }
    }
    for group in edges.groups() {
        let sum: DVec3 = group.iter().map(|edge| normals[edge.3 as usize].face).sum();
        for (from, to, _, triangle, edge) in group {
            let own = &mut normals[*triangle as usize];
            own.edges[*edge] = sum.try_normalize().unwrap_or(own.face);
            if group.len() == 1 {
                own.border |= 1 << edge;
                is_border[*from as usize] = true;
                is_border[*to as usize] = true;
            }
        }
    }
    for (own, triangle) in normals.iter_mut().zip(triangles) {
        for (corner, vertex) in triangle.iter().enumerate() {
            own.corners[corner] = of_vertex[*vertex as usize].try_normalize().unwrap_or(own.face);
            own.border |= u8::from(is_border[*vertex as usize]) << (3 + corner);
        }
    }
    normals
}
