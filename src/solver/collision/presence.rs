//! Whether a collider has moved or changed since the last tick, and what is near it: that wakes what sleeps.

use std::f64::consts::PI;

use bevy::math::Vec3;

use super::collider::Collider;
use super::material::{Exemptions, Layers};
use super::plane::Pose;
use super::shapes::{Bounds, Fingerprint, Placement};

/// What a tick leaves of a collider, to be compared with in the next one.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(in crate::solver) struct Presence {
    /// Of all but its pose.
    fingerprint: u64,
    pose: Pose,
    layers: Layers,
    is_half_space: bool,
    low: Vec3,
    high: Vec3,
}

impl Presence {
    /// That of a collider at the end of a tick.
    pub fn of(collider: &Collider) -> Self {
        let pose = collider.target;
        let Bounds { low, high } = collider.shape.bounds(pose);
        let is_half_space = collider.shape.is_half_space();
        Self { fingerprint: collider.fingerprint(), pose, layers: collider.layers, is_half_space, low, high }
    }

    /// Whether a collider is as it was, and begins the tick where it was.
    pub fn goes_on_as(&self, collider: &Collider) -> bool {
        self.pose == collider.start && self.fingerprint == collider.fingerprint()
    }

    /// Whether it may have touched a sphere of `reach` m.
    pub fn was_near(&self, centre: Vec3, reach: f32, layers: Layers) -> bool {
        let is_near = match self.is_half_space {
            true => (centre - self.pose.point).dot(self.pose.rotation * Vec3::Y) <= reach,
            false => Bounds { low: self.low, high: self.high }.overlaps(&Bounds::of_sphere(centre, reach)),
        };
        is_near && self.layers.meet(layers)
    }

    /// Positions are measured from elsewhere: `shift` m from where they were.
    pub fn shift(&mut self, shift: Vec3) {
        self.pose.point -= shift;
        self.low -= shift;
        self.high -= shift;
    }
}

impl Collider {
    /// Whether it is on its way in the tick.
    pub(in crate::solver) fn moves(&self) -> bool {
        self.start != self.target
    }

    /// Whether what it touches cannot rest: it is on its way, or a conveyor.
    pub(in crate::solver) fn carries(&self) -> bool {
        self.moves() || (self.surface_velocity != Vec3::ZERO && !self.is_sensor)
    }

    /// A test whether it may touch a sphere, of such a centre, radius and layers, at any time in the tick.
    ///
    /// Seen from it, the centre moves along an arc, which is at most π/2 times as long as its chord; what it touches on
    /// that is at most half of it away from one of the ends.
    pub(in crate::solver) fn nearness(&self) -> impl Fn(Vec3, f32, Layers) -> bool + '_ {
        let (bounds, places) = (self.bounds(), [self.start, self.target].map(Placement::new));
        move |centre, reach, layers| {
            if !bounds.overlaps(&Bounds::of_sphere(centre, reach)) || !self.layers.meet(layers) {
                return false;
            }
            let [from, to] = places.map(|place| place.to_local(centre.as_dvec3()));
            let within = f64::from(reach) + 0.25 * PI * from.distance(to);
            let is_near = |place| self.shape.nearest(place, 0.0).distance <= within;
            is_near(to) || (from != to && is_near(from))
        }
    }

    /// Of all but its pose.
    fn fingerprint(&self) -> u64 {
        let mut fingerprint = Fingerprint::default();
        self.shape.add_to(&mut fingerprint);
        let Self { material, surface_velocity, layers, is_sensor, .. } = self;
        fingerprint.add_floats([material.restitution, material.friction].map(f64::from));
        fingerprint.add_floats(surface_velocity.as_dvec3().to_array());
        fingerprint.add(material.restitution_rule as u64 | (material.friction_rule as u64) << 8);
        fingerprint.add(u64::from(layers.memberships) | u64::from(layers.filters) << 32);
        if layers.exemptions != Exemptions::NONE {
            let Exemptions { body, of } = layers.exemptions;
            fingerprint.add(u64::from(body));
            of.iter().for_each(|body| fingerprint.add(u64::from(*body)));
        }
        fingerprint.add(u64::from(*is_sensor));
        fingerprint.finish()
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::Quat;

    use super::*;
    use crate::solver::collision::Shape;

    fn rod() -> Collider {
        let pose = Pose { point: Vec3::ZERO, rotation: Quat::IDENTITY };
        Collider::resting(Shape::cuboid(Vec3::new(2.0, 0.1, 0.1)), pose)
    }

    #[test]
    fn a_collider_is_the_same_only_if_nothing_of_it_changed() {
        let known = Presence::of(&rod());
        assert!(known.goes_on_as(&rod()));
        let changes: [fn(&mut Collider); 6] = [
            |rod| rod.start.point.x = 1e-6,
            |rod| rod.shape = Shape::cuboid(Vec3::new(2.0, 0.1, 0.2)),
            |rod| rod.material.friction = 0.1,
            |rod| rod.surface_velocity.x = 1.0,
            |rod| rod.layers.filters = 1,
            |rod| rod.is_sensor = true,
        ];
        for (number, change) in changes.into_iter().enumerate() {
            let mut other = rod();
            change(&mut other);
            assert!(!known.goes_on_as(&other), "change {number}");
        }
    }

    /// A rod that turns by a quarter in a tick sweeps the sphere at 45 degrees, though it is far from there at both ends.
    #[test]
    fn what_is_swept_is_near() {
        let mut rod = rod();
        rod.target.rotation = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2);
        let is_near = rod.nearness();
        assert!(is_near(Vec3::new(1.0, 1.0, 0.0), 0.1, Layers::ALL));
        assert!(!is_near(Vec3::new(0.0, 0.0, 1.0), 0.1, Layers::ALL));
        assert!(!is_near(Vec3::new(1.0, 1.0, 0.0), 0.1, Layers::new(0, 0)));
    }
}
