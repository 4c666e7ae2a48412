//! Tangents: the direction of u of the texture on a surface that moves.
//!
//! Each vertex has an edge of a triangle at it. In the plane of its normal n, with ê the direction of that edge and
//! n × ê as axes, the tangent keeps the coordinates that it has at rest: t = cos φ ê + sin φ n × ê. That turns with
//! the surface, also within its plane, at the cost of two cross products; to find tangents anew from the texture
//! coordinates, as `generate_tangents` does, takes 100 times as long.

use bevy::math::{Vec3, Vec3A};

/// The tangent of each vertex, relative to the surface.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Tangents {
    vertices: Vec<Tangent>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Tangent {
    /// The point at the other end of the edge.
    end: u32,
    cos: f32,
    sin: f32,
    /// The sign of the bitangent, as Bevy's: w n × t points towards smaller v.
    w: f32,
}

/// A mesh at rest, by vertex.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rest<'a> {
    pub positions: &'a [[f32; 3]],
    pub normals: &'a [[f32; 3]],
    pub tangents: &'a [[f32; 4]],
}

impl Tangents {
    /// From the `corners` of the triangles, by vertex, the point of each vertex, and the mesh at rest.
    pub fn new(corners: &[[u32; 3]], point_of: &[u32], rest: Rest) -> Self {
        let alone = |tangent: &[f32; 4]| Tangent { end: u32::MAX, cos: 1.0, sin: 0.0, w: tangent[3] };
        let mut vertices: Vec<Tangent> = rest.tangents.iter().map(alone).collect();
        for corner in corners.iter().flat_map(|[a, b, c]| [[a, b], [b, c], [c, a]]) {
            let [from, to] = corner.map(|vertex| *vertex as usize);
            let tangent = &mut vertices[from];
            if tangent.end != u32::MAX {
                continue;
            }
            let edge = Vec3::from(rest.positions[to]) - Vec3::from(rest.positions[from]);
            let normal = Vec3::from(rest.normals[from]);
            let Some(along) = edge.reject_from_normalized(normal).try_normalize() else { continue };
            let [x, y, z, _] = rest.tangents[from];
            let direction = Vec3::new(x, y, z).reject_from_normalized(normal).normalize_or(along);
            tangent.end = point_of[to];
            (tangent.cos, tangent.sin) = (direction.dot(along), direction.dot(normal.cross(along)));
        }
        Self { vertices }
    }

    /// Appends the tangents of all vertices.
    pub fn write(&self, points: &[Vec3A], normals: &[Vec3A], point_of: &[u32], tangents: &mut Vec<[f32; 4]>) {
        tangents.extend(self.vertices.iter().zip(point_of).map(|(tangent, point)| {
            let (point, normal) = (points[*point as usize], normals[*point as usize]);
            let end = points.get(tangent.end as usize).copied().unwrap_or(point);
            let edge = end - point;
            let along = (edge - normal * edge.dot(normal))
                .try_normalize()
                .unwrap_or_else(|| normal.any_orthonormal_vector());
            let direction = along * tangent.cos + normal.cross(along) * tangent.sin;
            direction.extend(tangent.w).to_array()
        }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::math::Quat;

    #[test]
    fn a_tangent_turns_with_its_surface() {
        let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let slanted = Vec3::new(0.6, 0.8, 0.0);
        let rest = Rest {
            positions: &positions,
            normals: &[[0.0, 0.0, 1.0]; 3],
            tangents: &[slanted.extend(-1.0).to_array(); 3],
        };
        let tangents = Tangents::new(&[[0, 1, 2]], &[0, 1, 2], rest);
        for turn in [Quat::IDENTITY, Quat::from_rotation_z(2.0), Quat::from_rotation_x(1.0)] {
            let points = positions.map(|place| Vec3A::from(turn * Vec3::from(place)));
            let normals = [Vec3A::from(turn * Vec3::Z); 3];
            let mut written = Vec::new();
            tangents.write(&points, &normals, &[0, 1, 2], &mut written);
            for [x, y, z, w] in written {
                // Some ten roundings of numbers below 1.
                assert!(Vec3::new(x, y, z).distance(turn * slanted) < 1e-6);
                assert_eq!(w, -1.0);
            }
        }
    }
}
