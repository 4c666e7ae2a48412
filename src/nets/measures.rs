//! What can be measured of a net: lengths, volume, tensions, pieces.

use bevy::math::{DVec3, Vec3};

use super::{Layout, ParticleNet};

impl ParticleNet {
    /// The present length of a rope along its particles, m, around it if it is closed; `None` of what is no rope.
    pub fn length(&self) -> Option<f32> {
        let Layout::Rope { .. } = self.topology().layout else { return None };
        let place = |end: u32| self.positions()[end as usize].as_dvec3();
        let lengths = self.topology().segments().map(|[one, other]| place(one).distance(place(other)));
        Some(lengths.sum::<f64>() as f32)
    }

    /// The volume inside its surface, m³, by the divergence theorem: Σ a · (b × c) / 6 over the triangles, from the first
    /// particle. Meaningful for closed surfaces only; 0 without triangles.
    pub fn volume(&self) -> f32 {
        let from = self.positions().first().copied().unwrap_or_default().as_dvec3();
        let place = |particle: u32| self.positions()[particle as usize].as_dvec3() - from;
        let sixfold: f64 = self
            .topology()
            .triangles
            .iter()
            .map(|triangle| {
                let [a, b, c] = triangle.map(place);
                a.dot(b.cross(c))
            })
            .sum();
        (sixfold / 6.0) as f32
    }

    /// The tension of spring `index`, N, damper included; negative where it pushes, 0 of one that does not exist.
    ///
    /// It follows from the positions: its error is their rounding times the stiffness. While [`SpringForces`](crate::SpringForces)
    /// exists it is that of the solver at the end of the last tick, without that error.
    pub fn tension(&self, index: usize) -> f32 {
        if let Some(tension) = self.published_tensions().get(index) {
            return *tension;
        }
        let Some((ends, spring)) = self.topology().springs.get(index) else { return 0.0 };
        let is_out = ends.iter().any(|end| self.quarantined().binary_search(end).is_ok());
        if is_out || self.broken().binary_search(&(index as u32)).is_ok() {
            return 0.0;
        }
        let [first, second] = ends.map(|end| end as usize);
        let separation = self.positions()[first].as_dvec3() - self.positions()[second].as_dvec3();
        let rate = (self.velocities()[first] - self.velocities()[second]).as_dvec3();
        let length = separation.length();
        let beyond = length - f64::from(spring.length_at_rest());
        if spring.tension_only && beyond <= 0.0 {
            return 0.0;
        }
        let speed = rate.dot(separation.normalize_or_zero());
        let tension = f64::from(spring.stiffness) * beyond + f64::from(spring.damping) * speed;
        (if spring.tension_only { tension.max(0.0) } else { tension }) as f32
    }

    /// The number of pieces that its springs hold together.
    pub fn pieces(&self) -> usize {
        let mut root: Vec<u32> = (0..self.len() as u32).collect();
        let mut pieces = self.len();
        for (spring, (ends, _)) in (0..).zip(&self.topology().springs) {
            if self.broken().binary_search(&spring).is_ok() {
                continue;
            }
            let [one, other] = ends.map(|end| find(&mut root, end));
            if one != other {
                root[one.max(other) as usize] = one.min(other);
                pieces -= 1;
            }
        }
        pieces
    }

    /// The mass of all particles, kg.
    pub fn mass(&self) -> f32 {
        self.masses().iter().map(|mass| f64::from(*mass)).sum::<f64>() as f32
    }

    /// The centre of mass, in the world, m.
    pub fn centre(&self) -> Vec3 {
        let (mut sum, mut mass) = (DVec3::ZERO, 0.0);
        for (place, own) in self.positions().iter().zip(self.masses()) {
            sum += place.as_dvec3() * f64::from(*own);
            mass += f64::from(*own);
        }
        if mass > 0.0 { (sum / mass).as_vec3() } else { Vec3::ZERO }
    }
}

/// The root of the tree in which a particle is, with paths halved on the way.
fn find(root: &mut [u32], mut particle: u32) -> u32 {
    while root[particle as usize] != particle {
        root[particle as usize] = root[root[particle as usize] as usize];
        particle = root[particle as usize];
    }
    particle
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use bevy::prelude::Transform;

    use super::super::Topology;
    use super::*;
    use crate::solver::Spring;

    fn net(topology: Topology) -> ParticleNet {
        ParticleNet::new(Arc::new(topology), &Transform::IDENTITY)
    }

    /// A tetrahedron with its corners at the origin and 1 m along each axis: 1/6 m³.
    #[test]
    fn a_tetrahedron_has_a_sixth_of_its_cube() {
        let far = Vec3::splat(100.0);
        let found = net(Topology {
            positions: [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z].map(|corner| corner + far).to_vec(),
            masses: vec![1.0, 1.0, 1.0, 5.0],
            triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
            ..Topology::default()
        });
        assert!((found.volume() - 1.0 / 6.0).abs() < 1e-5, "{}", found.volume());
        assert_eq!((found.length(), found.pieces(), found.mass()), (None, 4, 8.0));
        assert!(found.centre().distance(far + Vec3::new(0.125, 0.125, 0.625)) < 1e-4);
    }

    #[test]
    fn a_rope_has_a_length_and_tensions() {
        let spring = Spring { rest_length: 0.5, stiffness: 10.0, damping: 2.0, ..Spring::default() };
        let mut rope = net(Topology {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 2.0, 0.0), Vec3::ZERO],
            masses: vec![1.0; 4],
            springs: vec![
                ([0, 1], spring),
                ([1, 2], Spring { tension_only: true, rest_length: 9.0, ..spring }),
            ],
            layout: Layout::Rope { is_closed: true },
            ..Topology::default()
        });
        rope.velocities_mut()[1] = Vec3::X;
        assert!((rope.length().unwrap() - (3.0 + 5.0_f32.sqrt())).abs() < 1e-6);
        assert_eq!([0, 1, 2].map(|spring| rope.tension(spring)), [7.0, 0.0, 0.0]);
        assert_eq!(rope.pieces(), 2);
    }
}
