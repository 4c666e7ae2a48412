//! What is near a point or on a ray.

use bevy::math::{Dir3, Vec3};

use super::{Layout, ParticleNet};

/// Where a ray meets a net.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct NetHit {
    /// The particle that is nearest to the point.
    pub particle: u32,
    /// The triangle of the [`Topology`](super::Topology) that is met; `None` of a rope.
    pub triangle: Option<u32>,
    /// Where, in the world, m.
    pub point: Vec3,
    /// The distance along the ray, m.
    pub distance: f32,
}

impl ParticleNet {
    /// The particle that is nearest to a point of the world, and its distance, m. `None` of an empty net.
    pub fn nearest(&self, point: Vec3) -> Option<(u32, f32)> {
        let distances = self.positions().iter().map(|place| place.distance(point));
        (0..)
            .zip(distances)
            .filter(|(_, distance)| !distance.is_nan())
            .min_by(|one, other| one.1.total_cmp(&other.1))
    }

    /// Where a ray first meets its surface, from either side; of a rope, its segments as thick as its radius.
    pub fn cast_ray(&self, origin: Vec3, direction: Dir3) -> Option<NetHit> {
        self.cast_ray_at(self.positions(), origin, direction)
    }

    /// The same with its particles in other places, as where they are drawn.
    pub(crate) fn cast_ray_at(&self, places: &[Vec3], origin: Vec3, direction: Dir3) -> Option<NetHit> {
        let mut best: Option<NetHit> = None;
        let mut consider = |distance: f32, triangle: Option<u32>, corners: &[u32]| {
            if best.is_none_or(|best| distance < best.distance) {
                let point = origin + *direction * distance;
                let away = |corner: &&u32| places[**corner as usize].distance_squared(point);
                let nearest = corners.iter().min_by(|one, other| away(one).total_cmp(&away(other)));
                best = nearest.map(|particle| NetHit { particle: *particle, triangle, point, distance });
            }
        };
        for (number, triangle) in (0..).zip(&self.topology().triangles) {
            if let Some(distance) =
                meet_triangle(triangle.map(|corner| places[corner as usize]), origin, direction)
            {
                consider(distance, Some(number), triangle);
            }
        }
        if let Layout::Rope { .. } = self.topology().layout {
            for segment in self.topology().segments() {
                let ends = segment.map(|end| places[end as usize]);
                if let Some(distance) = meet_segment(ends, self.radius(), origin, direction) {
                    consider(distance, None, &segment);
                }
            }
        }
        best
    }
}

/// The distance at which a ray meets a triangle (Möller and Trumbore, *Fast, minimum storage ray/triangle
/// intersection*, 1997).
fn meet_triangle([a, b, c]: [Vec3; 3], origin: Vec3, direction: Dir3) -> Option<f32> {
    let (first, second) = (b - a, c - a);
    let across = direction.cross(second);
    let determinant = first.dot(across);
    if determinant == 0.0 {
        return None;
    }
    let from = origin - a;
    let u = from.dot(across) / determinant;
    let around = from.cross(first);
    let v = direction.dot(around) / determinant;
    let distance = second.dot(around) / determinant;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance >= 0.0).then_some(distance)
}

/// The distance at which a ray is nearest to a segment, if that is within `radius`, less half the chord there.
fn meet_segment([a, b]: [Vec3; 2], radius: f32, origin: Vec3, direction: Dir3) -> Option<f32> {
    let (along, from) = (b - a, a - origin);
    // The point a + s (b − a) that is nearest to the line of the ray: all seen across the ray.
    let across = along - *direction * along.dot(*direction);
    let offset = from - *direction * from.dot(*direction);
    let square = across.length_squared();
    let share = if square > 0.0 { (-offset.dot(across) / square).clamp(0.0, 1.0) } else { 0.0 };
    let (miss, distance) = ((offset + across * share).length(), (from + along * share).dot(*direction));
    (miss <= radius)
        .then(|| distance - (radius * radius - miss * miss).sqrt())
        .filter(|distance| *distance >= 0.0)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use bevy::prelude::Transform;

    use super::super::Topology;
    use super::*;

    fn net(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>, layout: Layout, radius: f32) -> ParticleNet {
        let masses = vec![1.0; positions.len()];
        let topology = Topology { positions, masses, triangles, layout, radius, ..Topology::default() };
        ParticleNet::new(Arc::new(topology), &Transform::IDENTITY)
    }

    #[test]
    fn a_ray_meets_the_nearer_of_two_triangles_from_either_side() {
        let corners =
            [0.0, -1.0].map(|z| [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]].map(|[x, y]| Vec3::new(x, y, z)));
        let found = net(corners.concat(), vec![[3, 4, 5], [0, 2, 1]], Layout::Free, 0.0);
        let hit = found.cast_ray(Vec3::new(0.7, 0.2, 2.0), Dir3::NEG_Z).unwrap();
        assert_eq!((hit.particle, hit.triangle, hit.distance), (1, Some(1), 2.0));
        let hit = found.cast_ray(Vec3::new(0.1, 0.7, -3.0), Dir3::Z).unwrap();
        assert_eq!((hit.particle, hit.triangle, hit.distance), (5, Some(0), 2.0));
        assert_eq!(found.cast_ray(Vec3::new(0.7, 0.7, 2.0), Dir3::NEG_Z), None);
        assert_eq!(found.cast_ray(Vec3::new(0.1, 0.1, 2.0), Dir3::Z), None);
        let (nearest, distance) = found.nearest(Vec3::new(0.9, 0.0, -0.9)).unwrap();
        assert!(nearest == 4 && (distance - 0.02_f32.sqrt()).abs() < 1e-6);
    }

    #[test]
    fn a_ray_meets_a_rope_as_thick_as_it_is() {
        let found =
            net(vec![Vec3::ZERO, Vec3::X, Vec3::X * 2.0], vec![], Layout::Rope { is_closed: false }, 0.1);
        let hit = found.cast_ray(Vec3::new(1.8, 0.0, 3.0), Dir3::NEG_Z).unwrap();
        assert_eq!((hit.particle, hit.triangle), (2, None));
        assert!((hit.distance - 2.9).abs() < 1e-6);
        assert_eq!(found.cast_ray(Vec3::new(1.8, 0.11, 3.0), Dir3::NEG_Z), None);
    }
}
