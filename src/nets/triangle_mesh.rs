//! Triangle meshes as recipes read them.

use bevy::math::Vec3;

use crate::collider::ColliderShape;

/// A triangle mesh: what a cloth, jelly or balloon is made from.
///
/// Vertices may lie in the same place, as they do along the seams of texture coordinates and at hard edges: they
/// become one particle.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TriangleMesh {
    /// The places of the vertices, m.
    pub positions: Vec<Vec3>,
    /// The vertices of each triangle, counter-clockwise seen from its front.
    pub triangles: Vec<[u32; 3]>,
    /// The linear colour of each vertex, or empty.
    pub colours: Vec<[f32; 4]>,
    /// Groups of vertices, by name: see [`paint`](Self::paint).
    pub painted: Vec<(String, Vec<u32>)>,
}

/// A vertex, for the closure that chooses some.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeshVertex {
    /// Its number in the mesh.
    pub number: u32,
    /// Where it is, m.
    pub position: Vec3,
    /// Its linear colour; white where the mesh has none.
    pub colour: [f32; 4],
}

impl TriangleMesh {
    /// A mesh of these vertices and triangles.
    pub fn new(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Self {
        Self { positions, triangles, ..Self::default() }
    }

    /// Adds a group of the vertices that `is_in` chooses.
    pub fn paint(&mut self, name: impl Into<String>, is_in: impl Fn(&MeshVertex) -> bool) {
        let vertices = self.positions.iter().enumerate().map(|(number, position)| MeshVertex {
            number: number as u32,
            position: *position,
            colour: self.colours.get(number).copied().unwrap_or([1.0; 4]),
        });
        let group = vertices.filter(|vertex| is_in(vertex)).map(|vertex| vertex.number).collect();
        self.painted.push((name.into(), group));
    }

    /// The same mesh with the group `PIN` of the vertices that `is_in` chooses.
    pub fn with_pins(mut self, is_in: impl Fn(&MeshVertex) -> bool) -> Self {
        self.paint("PIN", is_in);
        self
    }

    /// Adds the groups that vertex colours mean: `RED`, `GREEN` and `BLUE`, each of the vertices of that colour,
    /// with more than a half in its own channel and less in both others. Nothing without colours.
    pub fn paint_by_colours(&mut self) {
        if self.colours.is_empty() {
            return;
        }
        for (channel, name) in ["RED", "GREEN", "BLUE"].into_iter().enumerate() {
            self.paint(name, |vertex| (0..3).all(|other| (vertex.colour[other] > 0.5) == (other == channel)));
        }
    }
}

/// The mesh as a collider: a solid where it is closed, else a sheet that is met from both sides.
impl From<TriangleMesh> for ColliderShape {
    fn from(mesh: TriangleMesh) -> Self {
        Self::Mesh { vertices: mesh.positions.into(), triangles: mesh.triangles.into(), one_sided: false }
    }
}
