//! From the vertices of a mesh to particles, and what is wrong with the mesh.

use std::collections::BTreeMap;

use bevy::math::{DVec3, Vec3};

use super::triangle_mesh::Groups;
use super::{NetError, TriangleMesh};

/// A mesh with one vertex in each place.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Welded {
    /// The places of the particles, in the order of the first vertex at each.
    pub positions: Vec<Vec3>,
    /// The particle of each vertex.
    pub particle_of: Vec<u32>,
    /// The triangles, without those that have no three different places.
    pub triangles: Vec<[u32; 3]>,
    /// The first vertex at each particle.
    vertex_of: Vec<u32>,
}

/// A side of a triangle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Side {
    /// Its ends, the smaller number first.
    pub ends: [u32; 2],
    /// The triangle.
    pub triangle: u32,
    /// The third particle of the triangle.
    pub apex: u32,
    /// Whether the triangle runs from the second end to the first.
    pub is_backward: bool,
}

/// Vertices nearer to each other than this part of the mesh's diagonal are in the same place.
const TOLERANCE: f64 = 1e-5;

impl TriangleMesh {
    /// Welds vertices in the same place, and checks what every net needs.
    ///
    /// # Errors
    /// If there is no triangle, a vertex is not finite, missing, or in no triangle, or a triangle is degenerate.
    pub(super) fn weld(&self) -> Result<Welded, NetError> {
        self.check()?;
        let extent = extent(&self.positions);
        let (vertex_of, particle_of) = representatives(&self.positions, TOLERANCE * extent);
        let positions: Vec<Vec3> = vertex_of.iter().map(|vertex| self.positions[*vertex as usize]).collect();
        let mut triangles = Vec::with_capacity(self.triangles.len());
        let mut is_used = vec![false; positions.len()];
        for (index, vertices) in self.triangles.iter().enumerate() {
            let corners = vertices.map(|vertex| particle_of[vertex as usize]);
            if corners[0] == corners[1] || corners[1] == corners[2] || corners[2] == corners[0] {
                continue;
            }
            if !has_area(corners.map(|corner| positions[corner as usize].as_dvec3())) {
                return Err(NetError::DegenerateTriangle { triangle: index as u32 });
            }
            corners.iter().for_each(|corner| is_used[*corner as usize] = true);
            triangles.push(corners);
        }
        if triangles.is_empty() {
            return Err(NetError::EmptyMesh);
        }
        if let Some(loose) = is_used.iter().position(|is_used| !is_used) {
            return Err(NetError::LooseVertex { vertex: vertex_of[loose] });
        }
        Ok(Welded { positions, particle_of, triangles, vertex_of })
    }

    /// The positions and triangles with one vertex in each place, without the triangles that have no three different places:
    /// the seams of a texture and the poles of a sphere are closed.
    ///
    /// # Errors
    /// If there is no triangle, or a vertex is not finite or missing.
    #[cfg(feature = "render")]
    pub(super) fn closed_seams(&self) -> Result<(Vec<Vec3>, Vec<[u32; 3]>), NetError> {
        self.check()?;
        let (vertex_of, place_of) = representatives(&self.positions, TOLERANCE * extent(&self.positions));
        let positions = vertex_of.iter().map(|vertex| self.positions[*vertex as usize]).collect();
        let triangles = self.triangles.iter().map(|corners| corners.map(|vertex| place_of[vertex as usize]));
        Ok((positions, triangles.filter(|[a, b, c]| a != b && b != c && c != a).collect()))
    }

    fn check(&self) -> Result<(), NetError> {
        let count = self.positions.len() as u32;
        if self.triangles.is_empty() {
            return Err(NetError::EmptyMesh);
        }
        if let Some(vertex) = self.positions.iter().position(|position| !position.is_finite()) {
            return Err(NetError::NonFiniteVertex { vertex: vertex as u32 });
        }
        for (triangle, vertices) in self.triangles.iter().enumerate() {
            if let Some(&vertex) = vertices.iter().find(|vertex| **vertex >= count) {
                return Err(NetError::MissingVertex { triangle: triangle as u32, vertex, count });
            }
        }
        Ok(())
    }
}

/// The diagonal of the box around places, m.
fn extent(positions: &[Vec3]) -> f64 {
    let least = positions.iter().copied().reduce(Vec3::min).unwrap_or_default();
    let most = positions.iter().copied().reduce(Vec3::max).unwrap_or_default();
    least.as_dvec3().distance(most.as_dvec3())
}

/// Whether a triangle is more than a line: its height is more than the rounding of its corners.
fn has_area([a, b, c]: [DVec3; 3]) -> bool {
    let longest = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
    (b - a).cross(c - a).length() > 1e-6 * longest
}

/// The first vertex at each place, and the place of each vertex. Places are kept in cells of four tolerances, so that
/// one is looked for in few cells.
fn representatives(positions: &[Vec3], tolerance: f64) -> (Vec<u32>, Vec<u32>) {
    let size = 4.0 * tolerance.max(f64::MIN_POSITIVE);
    let mut places: BTreeMap<[i64; 3], Vec<u32>> = BTreeMap::new();
    let (mut vertex_of, mut place_of) = (Vec::new(), Vec::with_capacity(positions.len()));
    for (vertex, position) in positions.iter().enumerate() {
        let position = position.as_dvec3();
        let cell = |offset: f64| (position + offset).to_array().map(|value| (value / size).floor() as i64);
        let [low, high] = [cell(-tolerance), cell(tolerance)];
        let mut nearest: Option<(f64, u32)> = None;
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                for z in low[2]..=high[2] {
                    for &place in places.get(&[x, y, z]).map_or(&[][..], Vec::as_slice) {
                        let other: u32 = vertex_of[place as usize];
                        let distance = position.distance(positions[other as usize].as_dvec3());
                        let is_nearer =
                            nearest.is_none_or(|(best, number)| (distance, place) < (best, number));
                        if distance <= tolerance && is_nearer {
                            nearest = Some((distance, place));
                        }
                    }
                }
            }
        }
        let place = nearest.map_or(vertex_of.len() as u32, |(_, place)| place);
        if nearest.is_none() {
            vertex_of.push(vertex as u32);
            places.entry(cell(0.0)).or_default().push(place);
        }
        place_of.push(place);
    }
    (vertex_of, place_of)
}

impl Welded {
    /// A mesh of different places.
    pub fn unwelded(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Self {
        let identity: Vec<u32> = (0..positions.len() as u32).collect();
        Self { positions, particle_of: identity.clone(), triangles, vertex_of: identity }
    }

    /// The sides of all triangles; those of one edge are next to each other.
    pub fn sides(&self) -> Vec<Side> {
        let of_triangle = |(triangle, [a, b, c]): (usize, &[u32; 3])| {
            [[*a, *b, *c], [*b, *c, *a], [*c, *a, *b]].map(|[from, to, apex]| Side {
                ends: [from.min(to), from.max(to)],
                triangle: triangle as u32,
                apex,
                is_backward: from > to,
            })
        };
        let mut sides: Vec<Side> = self.triangles.iter().enumerate().flat_map(of_triangle).collect();
        sides.sort_unstable();
        sides
    }

    fn vertices(&self, ends: [u32; 2]) -> [u32; 2] {
        ends.map(|end| self.vertex_of[end as usize])
    }

    /// # Errors
    /// If more than two triangles share an edge, or two face different ways.
    pub fn check_manifold(&self) -> Result<(), NetError> {
        for edge in self.sides().chunk_by(|one, other| one.ends == other.ends) {
            match edge {
                [_] => {}
                [one, other] if one.is_backward != other.is_backward => {}
                [_, _] => return Err(NetError::Unoriented { edge: self.vertices(edge[0].ends) }),
                _ => return Err(NetError::NonManifold { edge: self.vertices(edge[0].ends) }),
            }
        }
        Ok(())
    }

    /// # Errors
    /// As [`check_manifold`](Self::check_manifold); and if an edge has one triangle only, or the mesh is inside out.
    pub fn check_closed(&self) -> Result<(), NetError> {
        self.check_manifold()?;
        let sides = self.sides();
        if let Some([open]) = sides.chunk_by(|one, other| one.ends == other.ends).find(|edge| edge.len() == 1)
        {
            return Err(NetError::Open { edge: self.vertices(open.ends) });
        }
        let volume = self.volume();
        if volume > 0.0 { Ok(()) } else { Err(NetError::InsideOut { volume }) }
    }

    /// The enclosed volume by the divergence theorem, ⅙ Σ a · (b × c), m³.
    pub fn volume(&self) -> f64 {
        let origin = self.positions[0].as_dvec3();
        let of_triangle = |corners: &[u32; 3]| {
            let [a, b, c] = corners.map(|corner| self.positions[corner as usize].as_dvec3() - origin);
            a.dot(b.cross(c)) / 6.0
        };
        self.triangles.iter().map(of_triangle).sum()
    }

    /// The groups of a mesh as groups of particles.
    pub fn groups(&self, mesh: &TriangleMesh) -> Groups {
        mesh.groups(|vertex| self.particle_of.get(vertex as usize).copied())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A unit cube with vertices of its own for each face, as Bevy's has.
    pub fn cube() -> TriangleMesh {
        let mut mesh = TriangleMesh::default();
        for axis in 0..3 {
            for side in [0.0, 1.0] {
                let first = mesh.positions.len() as u32;
                for [u, v] in [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]] {
                    let mut place = [0.0; 3];
                    (place[axis], place[(axis + 1) % 3], place[(axis + 2) % 3]) = (side, u, v);
                    mesh.positions.push(place.into());
                }
                let [a, b, c, d] = [first, first + 1, first + 2, first + 3];
                match side > 0.5 {
                    true => mesh.triangles.extend([[a, b, c], [a, c, d]]),
                    false => mesh.triangles.extend([[a, c, b], [a, d, c]]),
                }
            }
        }
        mesh
    }

    #[test]
    fn a_cube_with_hard_edges_has_eight_particles_and_is_closed() {
        let mesh = cube();
        let welded = mesh.weld().expect("sound");
        assert_eq!((mesh.positions.len(), welded.positions.len(), welded.triangles.len()), (24, 8, 12));
        for (vertex, particle) in welded.particle_of.iter().enumerate() {
            assert_eq!(mesh.positions[vertex], welded.positions[*particle as usize]);
        }
        welded.check_closed().expect("closed");
        assert!((welded.volume() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn what_is_wrong_is_named() {
        let change = |change: fn(&mut TriangleMesh)| {
            let mut mesh = cube();
            change(&mut mesh);
            mesh.weld().and_then(|welded| welded.check_closed()).expect_err("refused")
        };
        assert_eq!(change(|mesh| mesh.triangles.clear()), NetError::EmptyMesh);
        assert_eq!(change(|mesh| mesh.positions[3].x = f32::NAN), NetError::NonFiniteVertex { vertex: 3 });
        let missing = NetError::MissingVertex { triangle: 1, vertex: 99, count: 24 };
        assert_eq!(change(|mesh| mesh.triangles[1][2] = 99), missing);
        assert!(matches!(
            change(|mesh| mesh.triangles.truncate(mesh.triangles.len() - 1)),
            NetError::Open { .. }
        ));
        assert!(matches!(change(|mesh| mesh.triangles[4].swap(0, 1)), NetError::Unoriented { .. }));
        assert!(matches!(change(|mesh| mesh.triangles.push([0, 1, 22])), NetError::NonManifold { .. }));
        let inverted = |mesh: &mut TriangleMesh| mesh.triangles.iter_mut().for_each(|t| t.swap(0, 1));
        let NetError::InsideOut { volume } = change(inverted) else { panic!("inside out") };
        assert!((volume + 1.0).abs() < 1e-12);
        let loose = |mesh: &mut TriangleMesh| mesh.positions.push(Vec3::splat(3.0));
        assert_eq!(change(loose), NetError::LooseVertex { vertex: 24 });
        let sliver = |mesh: &mut TriangleMesh| {
            mesh.positions.push(Vec3::new(0.5, 0.0, 0.0));
            mesh.positions.push(Vec3::new(1.0, 0.0, 0.0));
            mesh.triangles.push([0, 24, 25]);
        };
        assert_eq!(change(sliver), NetError::DegenerateTriangle { triangle: 12 });
    }

    /// Vertices within the tolerance are one even across the borders of the cells that they are sorted into.
    #[test]
    fn near_vertices_are_one_wherever_they_lie() {
        let positions: Vec<Vec3> = (0..1000_u16)
            .map(|index| Vec3::X * f32::from(index / 2) + Vec3::X * 4e-4 * f32::from(index % 2))
            .collect();
        let (vertex_of, place_of) = representatives(&positions, 1e-3);
        assert_eq!(vertex_of.len(), 500);
        assert!(place_of.iter().enumerate().all(|(vertex, place)| vertex / 2 == *place as usize));
    }

    #[test]
    fn groups_of_vertices_become_groups_of_particles() {
        let mesh = cube().with_pins(|vertex| vertex.position.y > 0.5);
        let welded = mesh.weld().expect("sound");
        let painted = welded.groups(&mesh).painted;
        let [(name, particles)] = &painted[..] else { panic!("one group") };
        assert_eq!((name.as_str(), particles.len()), ("PIN", 4));
        assert!(particles.iter().all(|particle| welded.positions[*particle as usize].y == 1.0));
    }
}
