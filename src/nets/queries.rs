//! What is near a point or on a ray: nets as the bodies that they are to what collides with them.

use bevy::math::{DVec3, Dir3, Vec3};

use super::ParticleNet;
use crate::solver::{Crossing, Nearest, Simplex};

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

/// A part of the body of a net.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct NetFeature {
    /// The particle that is nearest to where it was found.
    pub particle: u32,
    /// The number of its triangle; `None` of what is along a spring, and of a particle.
    pub triangle: Option<u32>,
}

/// The body of a net, as in its collisions: its triangles; where it has none, what is along its springs, and its
/// particles. What is broken or quarantined is no part of it.
#[derive(Clone, Copy)]
pub(crate) struct NetBody<'a> {
    net: &'a ParticleNet,
    /// Where its particles are, m.
    places: &'a [Vec3],
    /// Half of the thickness of its triangles, m.
    face_radius: f32,
    /// Whether z does not count.
    is_flat: bool,
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

    /// Where a ray first meets its surface as it is drawn, from either side: its triangles without their thickness; of a
    /// net without triangles, its springs and particles as thick as its radius.
    ///
    /// [`ParticleQueries`](crate::ParticleQueries) count the thickness of triangles, too, and give the normal.
    pub fn cast_ray(&self, origin: Vec3, direction: Dir3) -> Option<NetHit> {
        self.cast_ray_at(self.positions(), origin, direction)
    }

    /// The same with its particles in other places, as where they are drawn.
    pub(crate) fn cast_ray_at(&self, places: &[Vec3], origin: Vec3, direction: Dir3) -> Option<NetHit> {
        let body = NetBody { net: self, places, face_radius: 0.0, is_flat: false };
        let start = origin.as_dvec3();
        let around = body.around()?;
        // No point of it is farther away.
        let length = around.farthest(start);
        let (Crossing { time, foot, .. }, NetFeature { particle, triangle }) =
            body.cast(start, start + direction.as_dvec3() * length, 0.0)?;
        Some(NetHit { particle, triangle, point: foot.as_vec3(), distance: (time * length) as f32 })
    }

    /// Its body; `is_flat`: in two dimensions, where z does not count.
    pub(crate) fn body(&self, is_flat: bool) -> NetBody<'_> {
        NetBody { net: self, places: self.positions(), face_radius: self.radius(), is_flat }
    }
}

impl NetBody<'_> {
    /// Where a ball first touches it on the way of its centre; at time 0 where it does from the start.
    pub fn cast(&self, from: DVec3, to: DVec3, radius: f64) -> Option<(Crossing, NetFeature)> {
        if !self.around()?.may_meet(from, to, radius) {
            return None;
        }
        let mut first: Option<(Crossing, Option<u32>, [u32; 3])> = None;
        self.for_each(|triangle, corners, solid| {
            let found = solid.cast(from, to, radius);
            if let Some(found) = found
                && first.is_none_or(|(first, ..)| found.time < first.time)
            {
                first = Some((found, triangle, corners));
            }
        });
        let (crossing, triangle, corners) = first?;
        Some((crossing, NetFeature { particle: self.nearest_of(corners, crossing.foot), triangle }))
    }

    /// The nearest point of its surface, at most `within` m away.
    pub fn nearest(&self, point: DVec3, within: f64) -> Option<(Nearest, NetFeature)> {
        if !self.around()?.may_meet(point, point, within.max(0.0)) {
            return None;
        }
        let mut least: Option<(Nearest, Option<u32>, [u32; 3])> = None;
        self.for_each(|triangle, corners, solid| {
            let found = solid.nearest(point);
            if found.distance <= within && least.is_none_or(|(least, ..)| found.distance < least.distance) {
                least = Some((found, triangle, corners));
            }
        });
        let (nearest, triangle, corners) = least?;
        let foot = point - nearest.normal * nearest.distance;
        Some((nearest, NetFeature { particle: self.nearest_of(corners, foot), triangle }))
    }

    /// A ball around all of it; `None` of what is nowhere.
    fn around(&self) -> Option<Simplex> {
        let places = self.places.iter().filter(|place| place.is_finite());
        let (low, high) = places.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), place| {
            (low.min(*place), high.max(*place))
        });
        let [low, high] = [low, high].map(|end| self.seen(end));
        let radius = 0.5 * low.distance(high) + f64::from(self.net.radius());
        (low.is_finite() && high.is_finite()).then(|| Simplex::new([low.midpoint(high)], radius))
    }

    /// Calls `visit` with the number of the triangle, if it is one, the particles at the corners and the solid of each part.
    fn for_each(&self, mut visit: impl FnMut(Option<u32>, [u32; 3], Simplex)) {
        let (topology, radius) = (self.net.topology(), f64::from(self.net.radius()));
        let place = |particle: u32| Some(self.seen(*self.places.get(particle as usize)?));
        let is_out = |particle: &u32| self.net.quarantined().binary_search(particle).is_ok();
        let are_out = |particles: &[u32]| !self.net.quarantined().is_empty() && particles.iter().any(is_out);
        let mut ball = |particle: u32| {
            if let (false, Some(place)) = (is_out(&particle), place(particle)) {
                visit(None, [particle; 3], Simplex::new([place], radius));
            }
        };
        if topology.triangles.is_empty() {
            // Those at the ends of springs are a part of these.
            (0..self.places.len() as u32).for_each(&mut ball);
        }
        // What was a corner of a triangle that is out is a particle.
        let lost = topology.triangles.iter().filter(|corners| are_out(&corners[..]));
        lost.flatten().for_each(|corner| ball(*corner));
        for (number, corners) in (0..).zip(&topology.triangles).filter(|(_, corners)| !are_out(&corners[..]))
        {
            if let [Some(a), Some(b), Some(c)] = corners.map(place) {
                visit(Some(number), *corners, Simplex::new([a, b, c], self.face_radius.into()));
            }
        }
        let springs = if topology.triangles.is_empty() { &topology.springs[..] } else { &[] };
        for (number, (ends, _)) in (0..).zip(springs) {
            let is_broken = self.net.broken().binary_search(&number).is_ok();
            if let (false, false, [Some(a), Some(b)]) = (is_broken, are_out(&ends[..]), ends.map(place)) {
                visit(None, [ends[0], ends[1], ends[1]], Simplex::new([a, b], radius));
            }
        }
    }

    /// Of these particles that which is nearest to a point.
    fn nearest_of(&self, particles: [u32; 3], point: DVec3) -> u32 {
        let distance = |particle: u32| self.seen(self.places[particle as usize]).distance_squared(point);
        particles.into_iter().fold(particles[0], |nearest, particle| {
            if distance(particle) < distance(nearest) { particle } else { nearest }
        })
    }

    fn seen(&self, place: Vec3) -> DVec3 {
        if self.is_flat { place.with_z(0.0) } else { place }.as_dvec3()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use bevy::prelude::Transform;

    use super::super::Topology;
    use super::*;
    use crate::solver::Spring;

    /// What a gap that counts as none, 1e-7 m, and the rounding of metres to f32 may change.
    const EXACT: f32 = 1e-6;

    fn net(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>, radius: f32) -> ParticleNet {
        let masses = vec![1.0; positions.len()];
        let topology = Topology { positions, masses, triangles, radius, ..Topology::default() };
        ParticleNet::new(Arc::new(topology), &Transform::IDENTITY)
    }

    /// Along x, with a particle at each metre.
    fn rope(segments: u32, radius: f32) -> ParticleNet {
        let topology = Topology {
            positions: (0..=segments).map(|number| Vec3::X * number as f32).collect(),
            masses: vec![1.0; segments as usize + 1],
            springs: (0..segments).map(|i| ([i, i + 1], Spring::elastic(1.0, 100.0, 0.0))).collect(),
            radius,
            ..Topology::default()
        };
        ParticleNet::new(Arc::new(topology), &Transform::IDENTITY)
    }

    #[test]
    fn a_ray_meets_the_nearer_of_two_triangles_from_either_side() {
        let corners =
            [0.0, -1.0].map(|z| [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]].map(|[x, y]| Vec3::new(x, y, z)));
        let found = net(corners.concat(), vec![[3, 4, 5], [0, 2, 1]], 0.1);
        let hit = found.cast_ray(Vec3::new(0.7, 0.2, 2.0), Dir3::NEG_Z).unwrap();
        assert_eq!((hit.particle, hit.triangle), (1, Some(1)));
        assert!((hit.distance - 2.0).abs() < EXACT, "{hit:?}");
        let hit = found.cast_ray(Vec3::new(0.1, 0.7, -3.0), Dir3::Z).unwrap();
        assert_eq!((hit.particle, hit.triangle), (5, Some(0)));
        assert!((hit.distance - 2.0).abs() < EXACT, "{hit:?}");
        assert_eq!(found.cast_ray(Vec3::new(0.7, 0.7, 2.0), Dir3::NEG_Z), None);
        assert_eq!(found.cast_ray(Vec3::new(0.1, 0.1, 2.0), Dir3::Z), None);
        let (nearest, distance) = found.nearest(Vec3::new(0.9, 0.0, -0.9)).unwrap();
        assert!(nearest == 4 && (distance - 0.02_f32.sqrt()).abs() < EXACT);
    }

    #[test]
    fn a_ray_meets_a_rope_as_thick_as_it_is() {
        let found = rope(2, 0.1);
        let hit = found.cast_ray(Vec3::new(1.8, 0.0, 3.0), Dir3::NEG_Z).unwrap();
        assert_eq!((hit.particle, hit.triangle), (2, None));
        assert!((hit.distance - 2.9).abs() < EXACT, "{hit:?}");
        assert_eq!(found.cast_ray(Vec3::new(1.8, 0.11, 3.0), Dir3::NEG_Z), None);
        // By 0.06 m beside its axis it is 0.08 m thick.
        let hit = found.cast_ray(Vec3::new(1.3, 0.06, 3.0), Dir3::NEG_Z).unwrap();
        assert!((hit.distance - 2.92).abs() < EXACT && hit.particle == 1, "{hit:?}");
    }

    #[test]
    fn a_body_has_the_thickness_of_its_faces_and_a_normal() {
        let found = net(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]], 0.1);
        let body = found.body(false);
        let start = DVec3::new(0.2, 0.6, 2.0);
        let (hit, feature) = body.cast(start, start - DVec3::Z * 4.0, 0.3).unwrap();
        assert!((hit.time - 0.4).abs() < 1e-6 && hit.normal == DVec3::Z, "{hit:?}");
        assert_eq!(feature, NetFeature { particle: 2, triangle: Some(0) });
        let (nearest, feature) = body.nearest(start, 2.0).unwrap();
        assert!((nearest.distance - 1.9).abs() < 1e-7 && nearest.normal == DVec3::Z, "{nearest:?}");
        assert_eq!(feature.triangle, Some(0));
        assert_eq!(body.nearest(start, 1.8), None);
        // Flat, it is all around the point.
        let (nearest, _) = found.body(true).nearest(start.with_z(0.0), 2.0).unwrap();
        assert!((nearest.distance + 0.1).abs() < 1e-7, "{nearest:?}");
    }

    #[test]
    fn what_is_broken_or_quarantined_is_no_part_of_a_body() {
        let mut found = rope(3, 0.1);
        let meets = |net: &ParticleNet, x: f64| {
            let start = DVec3::new(x, 0.0, 1.0);
            net.body(false).cast(start, start - DVec3::Z * 2.0, 0.0).map(|(_, feature)| feature.particle)
        };
        assert_eq!([0.4, 1.4, 2.4].map(|x| meets(&found, x)), [Some(0), Some(1), Some(2)]);
        found.break_spring(1);
        assert_eq!([0.4, 1.4, 2.4].map(|x| meets(&found, x)), [Some(0), None, Some(2)]);
        // The ends of what has come apart are as round as before.
        assert_eq!([1.09, 1.91].map(|x| meets(&found, x)), [Some(1), Some(2)]);
        found.quarantine(3);
        assert_eq!([2.4, 3.0, 2.09].map(|x| meets(&found, x)), [None, None, Some(2)]);
        let mut sheet = net(
            vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(1.0, 1.0, 0.0)],
            vec![[0, 1, 2], [1, 3, 2]],
            0.1,
        );
        sheet.quarantine(0);
        let ray = |x: f32, y: f32| sheet.cast_ray(Vec3::new(x, y, 1.0), Dir3::NEG_Z).map(|hit| hit.triangle);
        assert_eq!((ray(0.2, 0.2), ray(0.8, 0.8)), (None, Some(Some(1))));
    }

    #[test]
    fn lists_that_do_not_fit_and_places_that_are_none_stop_nothing() {
        let mut odd = net(vec![Vec3::ZERO, Vec3::X], vec![[0, 1, 7]], 0.1);
        assert_eq!(odd.cast_ray(Vec3::Z, Dir3::NEG_Z), None);
        odd.positions_mut().fill(Vec3::NAN);
        assert_eq!(odd.cast_ray(Vec3::Z, Dir3::NEG_Z), None);
        assert_eq!(odd.body(false).nearest(DVec3::ZERO, f64::INFINITY), None);
        assert_eq!(ParticleNet::default().cast_ray(Vec3::Z, Dir3::NEG_Z), None);
    }
}
