//! The edges by which a mesh is drawn.

use bevy::math::{DVec3, Vec3};

use super::Shape;

/// The cosine of the angle between two faces up to which they are parts of one face: its corners are rounded.
const SAME_FACE: f64 = 1.0 - 1e-5;

impl Shape {
    /// The edges of a mesh or hull along which its faces meet at an angle, or end, m; none of other shapes.
    pub fn sharp_edges(&self) -> Vec<[Vec3; 2]> {
        let Some(mesh) = self.as_mesh() else { return Vec::new() };
        let key = |point: DVec3| point.to_array().map(f64::to_bits);
        let mut sides: Vec<_> = mesh
            .faces()
            .flat_map(|([a, b, c], normal)| {
                [[a, b], [b, c], [c, a]].map(|[from, to]| {
                    let ends = if key(from) < key(to) { [from, to] } else { [to, from] };
                    (ends.map(key), ends, normal)
                })
            })
            .collect();
        sides.sort_by_key(|(key, ..)| *key);
        let edges = sides.chunk_by(|(one, ..), (next, ..)| one == next);
        edges
            .filter(|edge| match edge {
                [(.., one), (.., other)] => one.dot(*other) < SAME_FACE,
                _ => true,
            })
            .map(|edge| edge[0].1.map(|end| end.as_vec3()))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::mesh::tests::box_mesh;
    use super::*;

    #[test]
    fn a_box_has_twelve_edges() {
        let (vertices, triangles) = box_mesh();
        let edges = Shape::mesh(&vertices, &triangles, false).unwrap().sharp_edges();
        assert_eq!(edges.len(), 12);
        // Along the axes, none along a diagonal.
        assert!(
            edges
                .iter()
                .all(|[from, to]| (*to - *from).to_array().iter().filter(|x| **x != 0.0).count() == 1)
        );
        assert!(Shape::cuboid(Vec3::ONE).sharp_edges().is_empty());
        let half = Shape::mesh(&vertices, &triangles[..2], false).unwrap().sharp_edges();
        assert_eq!(half.len(), 4, "the border of a side");
    }
}
