//! Triangle meshes as recipes read them.

use std::collections::BTreeMap;

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
    /// By the name of a group the weights of its vertices, in their order: see [`paint_weights`](Self::paint_weights).
    pub weights: Vec<(String, Vec<f32>)>,
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
        let group = self.vertices().filter(|vertex| is_in(vertex)).map(|vertex| vertex.number).collect();
        self.painted.push((name.into(), group));
    }

    /// Adds a group of the vertices that have a `weight` above 0; above 1 it counts as 1. How weights act: see
    /// [`Topology::weights`](crate::nets::Topology::weights).
    ///
    /// ```
    /// # use bevy::prelude::*;
    /// # use bevy_mass_spring::nets::{Attachment, Cloth, Part, PartOf, RecipeMesh, TriangleMesh};
    /// /// A cape that is tied to a neck where it is red: the redder, the more firmly.
    /// fn spawn_cape(mut commands: Commands, mut mesh: TriangleMesh, neck: Entity) {
    ///     mesh.paint_weights("COLLAR", |vertex| vertex.colour[0]);
    ///     let cape = commands.spawn((Cloth::from_mesh(), RecipeMesh(mesh.into()))).id();
    ///     let collar = Part::Painted("COLLAR".into());
    ///     commands.spawn((PartOf(cape), collar, Attachment::to(neck).with_stiffness(200.0)));
    /// }
    /// ```
    pub fn paint_weights(&mut self, name: impl Into<String>, weight: impl Fn(&MeshVertex) -> f32) {
        let weighted = self.vertices().map(|vertex| (vertex.number, weight(&vertex)));
        let weighted = weighted.filter(|(_, weight)| *weight > 0.0);
        let (group, weights) = weighted.map(|(vertex, weight)| (vertex, weight.min(1.0))).unzip();
        let name = name.into();
        self.painted.push((name.clone(), group));
        self.weights.push((name, weights));
    }

    fn vertices(&self) -> impl Iterator<Item = MeshVertex> {
        self.positions.iter().enumerate().map(|(number, position)| MeshVertex {
            number: number as u32,
            position: *position,
            colour: self.colours.get(number).copied().unwrap_or([1.0; 4]),
        })
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

/// Groups of particles, in ascending order, and weights of some.
#[derive(Debug, Default)]
pub(super) struct Groups {
    pub painted: Vec<(String, Vec<u32>)>,
    pub weights: Vec<(String, Vec<f32>)>,
}

impl TriangleMesh {
    /// Its groups as groups of the particles that stand for their vertices. A particle that stands for several has the
    /// greatest of their weights.
    pub(super) fn groups(&self, particle_of: impl Fn(u32) -> Option<u32>) -> Groups {
        let mut groups = Groups::default();
        for (name, vertices) in &self.painted {
            let weights = self.weights.iter().find(|(other, _)| other == name).map(|(_, weights)| weights);
            let weight =
                |place: usize| weights.and_then(|weights| weights.get(place)).copied().unwrap_or(1.0);
            let mut found: BTreeMap<u32, f32> = BTreeMap::new();
            for (place, vertex) in vertices.iter().enumerate() {
                let Some(particle) = particle_of(*vertex) else { continue };
                let greatest = found.entry(particle).or_insert(0.0);
                *greatest = greatest.max(weight(place));
            }
            groups.painted.push((name.clone(), found.keys().copied().collect()));
            if weights.is_some() {
                groups.weights.push((name.clone(), found.into_values().collect()));
            }
        }
        groups
    }
}

/// The mesh as a collider: a solid where it is closed, else a sheet that is met from both sides.
impl From<TriangleMesh> for ColliderShape {
    fn from(mesh: TriangleMesh) -> Self {
        Self::Mesh { vertices: mesh.positions.into(), triangles: mesh.triangles.into(), one_sided: false }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_particle_has_the_greatest_weight_of_its_vertices() {
        let places = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::X, Vec3::ONE];
        let mut mesh = TriangleMesh::new(places.into(), vec![[0, 1, 2], [2, 3, 4]]);
        let weights = [f32::NAN, 0.25, 0.0, 0.75, 3.0];
        mesh.paint_weights("COLLAR", |vertex| weights[vertex.number as usize]);
        assert_eq!(mesh.painted, [("COLLAR".to_owned(), vec![1, 3, 4])]);
        mesh.paint("LEFT", |vertex| vertex.position.x < 0.5);
        // Vertices 1 and 3 are at one place.
        let Groups { painted, weights } = mesh.groups(|vertex| Some([2, 1, 0, 1, 3][vertex as usize]));
        assert_eq!(painted, [("COLLAR".to_owned(), vec![1, 3]), ("LEFT".to_owned(), vec![0, 2])]);
        assert_eq!(weights, [("COLLAR".to_owned(), vec![0.75, 1.0])]);
    }
}
