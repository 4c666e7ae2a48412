//! Fine meshes on coarse nets.
//!
//! Vertices in the same place with the same normal at rest are one point, so that the creases of the artist stay, and
//! seams of the texture show none.

use std::collections::BTreeMap;

use bevy::math::Vec3;
use bevy::mesh::Mesh;

use super::binding::{NetMeshError, RestAttributes, positions_of};
use super::surface::{Points, Raised, Surface};
use crate::nets::Topology;

/// Hangs each vertex on four particles.
pub(super) fn bind_means(
    mesh: &Mesh,
    corners: Vec<[u32; 3]>,
    means: &[([u32; 4], [f32; 3])],
    particles: usize,
) -> Result<Surface, NetMeshError> {
    let is_missing = |(ends, _): &([u32; 4], _)| ends.iter().any(|particle| *particle as usize >= particles);
    if let Some(vertex) = means.iter().position(is_missing) {
        return Err(NetMeshError::Particle { vertex });
    }
    bind(mesh, corners, |vertices| {
        let mean = |vertex: &usize| {
            let (ends, [a, b, c]) = means[*vertex];
            (ends, [a, b, c, 1.0 - a - b - c])
        };
        Points::Means(vertices.iter().map(mean).collect())
    })
}

/// Hangs each vertex on the triangle of the net that is nearest at rest.
pub(super) fn bind_raised(
    mesh: &Mesh,
    corners: Vec<[u32; 3]>,
    topology: &Topology,
) -> Result<Surface, NetMeshError> {
    let particles = topology.positions.len();
    if topology.triangles.is_empty() {
        return Err(NetMeshError::NoSurface);
    }
    let is_missing = |corners: &[u32; 3]| corners.iter().any(|corner| *corner as usize >= particles);
    if let Some(triangle) = topology.triangles.iter().position(is_missing) {
        return Err(NetMeshError::Triangle { triangle });
    }
    let positions = positions_of(mesh)?;
    let base = Base::new(topology);
    bind(mesh, corners, |vertices| {
        let points = vertices.iter().map(|vertex| base.nearest(positions[*vertex].into())).collect();
        Points::Raised(Raised { base: topology.triangles.clone(), points })
    })
}

/// Binds a mesh by what it makes of the vertices that stand for points.
fn bind(
    mesh: &Mesh,
    corners: Vec<[u32; 3]>,
    points: impl FnOnce(&[usize]) -> Points,
) -> Result<Surface, NetMeshError> {
    let positions = positions_of(mesh)?;
    let normals = mesh.try_attribute(Mesh::ATTRIBUTE_NORMAL)?.as_float3().unwrap_or_default();
    // Adding zero makes -0 and 0 the same.
    let bits = |vector: [f32; 3]| vector.map(|value| (value + 0.0).to_bits());
    let mut places: BTreeMap<[u32; 3], usize> = BTreeMap::new();
    let mut known: BTreeMap<[[u32; 3]; 2], u32> = BTreeMap::new();
    let mut vertices = Vec::new();
    let mut point_of = Vec::with_capacity(positions.len());
    for (vertex, (place, normal)) in positions.iter().zip(normals).enumerate() {
        // Points in one place hang on the net alike.
        let first = *places.entry(bits(*place)).or_insert(vertex);
        point_of.push(*known.entry([bits(*place), bits(*normal)]).or_insert_with(|| {
            vertices.push(first);
            vertices.len() as u32 - 1
        }));
    }
    let triangles = corners.iter().map(|corners| corners.map(|corner| point_of[corner as usize])).collect();
    let tangents = RestAttributes::of(mesh)?.map(|rest| rest.tangents(&corners, &point_of));
    Ok(Surface { points: points(&vertices), triangles, point_of, tangents })
}

/// A coarse surface at rest.
struct Base<'a> {
    topology: &'a Topology,
    /// The middle of each triangle, and how far its corners are from there.
    spheres: Vec<(Vec3, f32)>,
    /// The normals of the particles.
    normals: Vec<Vec3>,
}

impl<'a> Base<'a> {
    fn new(topology: &'a Topology) -> Self {
        let mut normals = vec![Vec3::ZERO; topology.positions.len()];
        let mut spheres = Vec::with_capacity(topology.triangles.len());
        for triangle in &topology.triangles {
            let corners = triangle.map(|corner| topology.positions[corner as usize]);
            let [a, b, c] = corners;
            let middle = (a + b + c) / 3.0;
            spheres.push((
                middle,
                corners.map(|corner| corner.distance(middle)).into_iter().fold(0.0, f32::max),
            ));
            for corner in triangle {
                normals[*corner as usize] += (b - a).cross(c - a);
            }
        }
        for normal in &mut normals {
            *normal = normal.normalize_or_zero();
        }
        Self { topology, spheres, normals }
    }

    /// The triangle nearest to a place: its corners, the weights of the nearest point of it, and how far the place is
    /// above it along the normals.
    fn nearest(&self, place: Vec3) -> ([u32; 3], [f32; 3], f32) {
        let mut best = f32::INFINITY;
        let mut found = (self.topology.triangles[0], [1.0, 0.0, 0.0]);
        for (triangle, (middle, radius)) in self.topology.triangles.iter().zip(&self.spheres) {
            if place.distance(*middle) - radius > best {
                continue;
            }
            let corners = triangle.map(|corner| self.topology.positions[corner as usize]);
            let weights = nearest_on_triangle(place, corners);
            let distance = place.distance(sum(corners, weights));
            if distance < best {
                best = distance;
                found = (*triangle, weights);
            }
        }
        let (triangle, weights) = found;
        let foot = sum(triangle.map(|corner| self.topology.positions[corner as usize]), weights);
        let normal = sum(triangle.map(|corner| self.normals[corner as usize]), weights).normalize_or_zero();
        (triangle, weights, (place - foot).dot(normal))
    }
}

fn sum(corners: [Vec3; 3], [a, b, c]: [f32; 3]) -> Vec3 {
    corners[0] * a + corners[1] * b + corners[2] * c
}

/// The weights of the point of a triangle that is nearest to a place (Ericson, *Real-Time Collision Detection*, 2005,
/// section 5.1.5).
fn nearest_on_triangle(place: Vec3, [a, b, c]: [Vec3; 3]) -> [f32; 3] {
    let (ab, ac) = (b - a, c - a);
    let dots = |from: Vec3| (ab.dot(place - from), ac.dot(place - from));
    let ((d1, d2), (d3, d4), (d5, d6)) = (dots(a), dots(b), dots(c));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let t = d1 / (d1 - d3);
        return [1.0 - t, t, 0.0];
    }
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let t = d2 / (d2 - d6);
        return [1.0 - t, 0.0, t];
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        let t = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return [0.0, 1.0 - t, t];
    }
    let area = va + vb + vc;
    if area > 0.0 { [va / area, vb / area, vc / area] } else { [1.0, 0.0, 0.0] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_point_is_nearer_than_all_others() {
        let corners = [Vec3::ZERO, Vec3::new(1.0, 0.1, 0.0), Vec3::new(0.2, 0.9, 0.3)];
        for number in 0..200 {
            let place =
                [1.7_f32, 2.3, 3.1].map(|rate| 1.5 * bevy::math::ops::sin(rate * number as f32) + 0.3);
            let place = Vec3::from(place);
            let weights = nearest_on_triangle(place, corners);
            assert!(
                (weights.iter().sum::<f32>() - 1.0).abs() < 1e-6
                    && weights.iter().all(|weight| *weight >= 0.0)
            );
            let best = place.distance(sum(corners, weights));
            for i in 0..=20 {
                for j in 0..=20 - i {
                    let (a, b) = (i as f32 / 20.0, j as f32 / 20.0);
                    assert!(best <= place.distance(sum(corners, [1.0 - a - b, a, b])) + 1e-6);
                }
            }
        }
    }
}
