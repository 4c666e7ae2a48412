//! Surfaces: the vertices of a mesh from the places of particles.
//!
//! Vertices hang on *points*, which are particles or weighted means of four. Where several vertices hang on one point
//! (at seams of texture coordinates) they get its position and normal, to the bit: seams neither gape nor show.

use bevy::math::Vec3A;

use super::tangents::Tangents;

/// What a shape writes, in the order of the vertices of the mesh. As long as the mesh has such attributes.
#[derive(Debug, Default)]
pub(super) struct Vertices {
    pub positions: Vec<[f32; 3]>,
    pub normals: Vec<[f32; 3]>,
    pub tangents: Vec<[f32; 4]>,
}

impl Vertices {
    pub fn clear(&mut self) {
        self.positions.clear();
        self.normals.clear();
        self.tangents.clear();
    }
}

/// Working memory of shapes.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    /// The particles, in the space of the entity.
    pub places: Vec<Vec3A>,
    pub points: Vec<Vec3A>,
    /// The directions of strands.
    pub axes: Vec<Vec3A>,
    pub normals: Vec<Vec3A>,
}

/// What the points of a surface are.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Points {
    /// Point i is particle i.
    Particles,
    /// Means of four particles by weights that add up to 1.
    Means(Vec<([u32; 4], [f32; 4])>),
    /// Points over a coarse surface.
    Raised(Raised),
}

/// Points over the triangles of a coarse surface.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Raised {
    /// The triangles of the coarse surface, by particle.
    pub base: Vec<[u32; 3]>,
    /// The corners of the triangle under each point, its weights, which add up to 1 and are not negative, and its
    /// height over the triangle along the normals of the particles, m.
    pub points: Vec<([u32; 3], [f32; 3], f32)>,
}

/// A surface of triangles.
#[derive(Debug, Clone)]
pub(super) struct Surface {
    pub points: Points,
    /// The corners of the triangles, by point.
    pub triangles: Vec<[u32; 3]>,
    /// The point of each vertex.
    pub point_of: Vec<u32>,
    pub tangents: Option<Tangents>,
}

impl Surface {
    /// The number of particles that must be there.
    pub fn particle_count(&self) -> usize {
        let end = |number: Option<u32>| number.map_or(0, |number| number as usize + 1);
        match &self.points {
            Points::Particles => end(self.triangles.iter().flatten().chain(&self.point_of).copied().max()),
            Points::Means(means) => end(means.iter().flat_map(|(particles, _)| *particles).max()),
            Points::Raised(raised) => end(raised.base.iter().flatten().copied().max()),
        }
    }

    /// By which part of the box around the particles a point can lie outside of it, on each side.
    ///
    /// x = Σ wᵢ xᵢ with Σ wᵢ = 1 is at most n (b − a) above the upper end of [a, b], with n the sum of the negative
    /// weights.
    pub fn overhang(&self) -> f32 {
        let Points::Means(means) = &self.points else { return 0.0 };
        let negative = |weights: &[f32; 4]| weights.iter().map(|weight| (-weight).max(0.0)).sum();
        means.iter().map(|(_, weights)| negative(weights)).fold(0.0, f32::max)
    }

    /// How far a point can lie outside of the box around the particles, m.
    pub fn height(&self) -> f32 {
        let Points::Raised(raised) = &self.points else { return 0.0 };
        raised.points.iter().map(|(_, _, height)| height.abs()).fold(0.0, f32::max)
    }

    /// Computes the vertices from `scratch.places`. A metre of the world is `scale` long there.
    pub fn write(&self, scale: f32, scratch: &mut Scratch, vertices: &mut Vertices) {
        let Scratch { places, points, normals, .. } = scratch;
        let points: &[Vec3A] = match &self.points {
            Points::Particles => places,
            Points::Means(means) => {
                points.clear();
                points.extend(means.iter().map(|(particles, weights)| mean(places, *particles, *weights)));
                points
            }
            Points::Raised(raised) => {
                raised.write(scale, places, normals, points);
                points
            }
        };
        sum_area_normals(points, &self.triangles, normals);
        for normal in normals.iter_mut() {
            *normal = normal.try_normalize().unwrap_or(Vec3A::Z);
        }
        vertices.clear();
        let point_of = || self.point_of.iter().map(|point| *point as usize);
        vertices.positions.extend(point_of().map(|point| points[point].to_array()));
        vertices.normals.extend(point_of().map(|point| normals[point].to_array()));
        if let Some(tangents) = &self.tangents {
            tangents.write(points, normals, &self.point_of, &mut vertices.tangents);
        }
    }
}

impl Raised {
    fn write(&self, scale: f32, places: &[Vec3A], normals: &mut Vec<Vec3A>, points: &mut Vec<Vec3A>) {
        sum_area_normals(places, &self.base, normals);
        for normal in normals.iter_mut() {
            *normal = normal.normalize_or_zero();
        }
        points.clear();
        points.extend(self.points.iter().map(|(corners, [wa, wb, wc], height)| {
            let [a, b, c] = corners.map(|corner| corner as usize);
            let normal = normals[a] * *wa + normals[b] * *wb + normals[c] * *wc;
            let foot = places[a] * *wa + places[b] * *wb + places[c] * *wc;
            foot + normal.normalize_or_zero() * (height * scale)
        }));
    }
}

fn mean(places: &[Vec3A], particles: [u32; 4], weights: [f32; 4]) -> Vec3A {
    let [a, b, c, d] = particles.map(|particle| places[particle as usize]);
    let [wa, wb, wc, wd] = weights;
    (a * wa + b * wb) + (c * wc + d * wd)
}

/// Sums the normals of the triangles around each point, each as long as twice the area of its triangle.
///
/// The cross product of two edges is that; a sum by area is what Bevy's `compute_area_weighted_normals` does.
pub(super) fn sum_area_normals(points: &[Vec3A], triangles: &[[u32; 3]], normals: &mut Vec<Vec3A>) {
    normals.clear();
    normals.resize(points.len(), Vec3A::ZERO);
    for triangle in triangles {
        let [a, b, c] = triangle.map(|corner| corner as usize);
        let normal = (points[b] - points[a]).cross(points[c] - points[a]);
        normals[a] += normal;
        normals[b] += normal;
        normals[c] += normal;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_with_negative_weights_stays_within_its_overhang() {
        let surface = Surface {
            points: Points::Means(vec![([0, 1, 2, 3], [1.25, -0.5, 0.5, -0.25])]),
            triangles: Vec::new(),
            point_of: vec![0],
            tangents: None,
        };
        assert_eq!(surface.overhang(), 0.75);
        // The worst case: the particles of positive weight at one end, the others at the other.
        let places = vec![Vec3A::ONE, Vec3A::ZERO, Vec3A::ONE, Vec3A::ZERO];
        let mut scratch = Scratch { places, ..Scratch::default() };
        let mut vertices = Vertices::default();
        surface.write(1.0, &mut scratch, &mut vertices);
        assert_eq!(vertices.positions, [[1.75; 3]]);
        assert_eq!(surface.particle_count(), 4);
    }

    #[test]
    fn normals_are_weighted_by_area() {
        // Two triangles about an edge: one of area 1/2 facing z, one of area 1 facing y.
        let points = [Vec3A::ZERO, Vec3A::X, Vec3A::Y, Vec3A::new(0.0, 0.0, 2.0)];
        let triangles = [[0, 1, 2], [1, 0, 3]];
        let mut normals = Vec::new();
        sum_area_normals(&points, &triangles, &mut normals);
        assert_eq!(normals[2], Vec3A::Z);
        assert_eq!(normals[3], Vec3A::Y * 2.0);
        assert_eq!(normals[0], Vec3A::new(0.0, 2.0, 1.0));
    }
}
