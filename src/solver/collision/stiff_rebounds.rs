//! Rebounds of particles on springs under semi-implicit Euler, where velocities lag half a substep behind positions.
//!
//! How fast something rebounds follows from its acceleration: see `response.rs`. Semi-implicit Euler has evaluated that where the substep
//! began. For loose particles it is the same where they touch; that of what springs pull at is evaluated again where the substep would
//! have led to, in substeps in which any of it rebounds. From there to the surface is the depth, and what has been swept back before.

use bevy::math::{Vec3, Vec3A};

use super::material::skin_of;
use super::response::{Approach, Rebound};
use super::{ContactCaches, Substep};
use crate::solver::graph::Exclusions;
use crate::solver::particles::{Particles, Vectors};

/// The accelerations where the substep began and where it would have led to, m/s².
#[derive(Clone, Copy)]
struct Accelerations<'a> {
    start: &'a Vectors,
    at_end: &'a Vectors,
    exclusions: &'a Exclusions,
    particles: &'a Particles,
    /// Positions at the start, m.
    previous: &'a Vectors,
    /// s.
    duration: f32,
    /// Of the particles that an implicit step has moved, which blocks have no accelerations of.
    is_implicit: &'a [bool],
}

impl Accelerations<'_> {
    /// Whether semi-implicit Euler has moved a particle.
    fn is_explicit(&self, slot: usize) -> bool {
        !self.particles.is_pinned(slot) && self.is_implicit.get(slot) != Some(&true)
    }

    /// Those of a particle; of a loose one both are the same.
    fn of(&self, slot: usize) -> [Vec3; 2] {
        let start = self.start.get(slot);
        let changes = self.exclusions.is_sprung(slot) && self.is_explicit(slot);
        [start, if changes { self.at_end.get(slot) } else { start }]
    }

    /// By how much a particle has been put back from where the substep would have led to, m.
    fn put_back(&self, slot: usize) -> Vec3 {
        let Self { particles, previous, duration, .. } = self;
        if !self.is_explicit(slot) {
            return Vec3::ZERO;
        }
        particles.position.get(slot) - (previous.get(slot) + *duration * particles.velocity.get(slot))
    }
}

impl ContactCaches {
    /// The positions at the start of the substep, m.
    pub fn start(&self) -> &Vectors {
        &self.previous
    }

    /// Whether anything that springs pull at rebounds in this substep.
    pub fn any_rebounds_on_springs(&self) -> bool {
        let Self { candidates, plane_contacts, touches, .. } = self;
        let exclusions = &candidates.exclusions;
        let of_planes =
            plane_contacts.iter().any(|contact| contact.rebounds() && exclusions.is_sprung(contact.slot));
        let of_touches = || {
            let mut rebounding = touches.all.iter().filter(|touch| touch.target_velocity > 0.0);
            rebounding.any(|touch| exclusions.is_sprung(touch.slots[0] as usize))
        };
        let of_pairs = || {
            let mut groups = candidates.groups.iter();
            groups.any(|group| {
                let mut contacts = self.pair_contacts.of(group).iter();
                contacts.any(|contact| contact.sprung && contact.target_velocity > 0.0)
            })
        };
        of_planes || of_touches() || of_pairs()
    }

    /// Gives what rebounds the velocity that follows from the accelerations where the substep would have led to, m/s².
    pub fn adjust_rebounds(&mut self, particles: &Particles, substep: Substep, at_end: &Vectors) {
        let Substep { colliders, skins, duration, .. } = substep;
        let rebound = substep.rebound();
        let Self {
            candidates,
            plane_contacts,
            touches,
            surfaces,
            pair_contacts,
            bodies,
            previous,
            is_implicit,
            ..
        } = self;
        let exclusions = &candidates.exclusions;
        let accelerations = Accelerations {
            start: substep.acceleration,
            at_end,
            exclusions,
            particles,
            previous,
            duration,
            is_implicit,
        };
        for contact in plane_contacts.iter_mut().filter(|contact| contact.rebounds()) {
            let surface = &surfaces[contact.plane];
            let accelerations =
                accelerations.of(contact.slot).map(|vector| surface.normal.dot(vector.into()));
            contact.adjust(surface, particles, (rebound, accelerations), skin_of(skins, contact.slot));
        }
        for touch in touches.all.iter_mut().filter(|touch| touch.target_velocity > 0.0) {
            let ends =
                touch.slots[..touch.count as usize].iter().map(|slot| *slot as usize).zip(touch.weights);
            let [mut velocity, mut start, mut end, mut put_back] =
                [-touch.surface_velocity, Vec3A::ZERO, Vec3A::ZERO, Vec3A::ZERO];
            for (slot, weight) in ends {
                let [from, to] = accelerations.of(slot);
                velocity += weight * Vec3A::from(particles.velocity.get(slot));
                start += weight * Vec3A::from(from);
                end += weight * Vec3A::from(to);
                put_back += weight * Vec3A::from(accelerations.put_back(slot));
            }
            let material = colliders[touch.collider as usize].material;
            let [restitution, _] = material.between(skin_of(skins, touch.slots[0] as usize).material);
            let [velocity, acceleration, end, put_back] =
                [velocity, start, end, put_back].map(|vector| touch.normal.dot(vector));
            let approach =
                Approach { velocity, acceleration, depth: touch.depth.max(0.0) + put_back.max(0.0) };
            let rebound = Rebound { restitution, ..rebound };
            touch.target_velocity = rebound.velocity_after_on_springs(approach, end).max(0.0);
        }
        let slot_of = &candidates.regions.slot_of;
        for group in candidates.groups.iter() {
            let contacts = pair_contacts.of_mut(group).iter_mut();
            for contact in contacts.filter(|contact| contact.sprung && contact.target_velocity > 0.0) {
                let places = [contact.first(), contact.second()].map(|place| group.bodies.start + place);
                let [first, second] = places.map(|place| &bodies[place]);
                let [one, other] = places.map(|place| accelerations.of(slot_of[place] as usize));
                let along = |end: usize| contact.normal.dot((one[end] - other[end]).into());
                let [put_back, other_put_back] =
                    places.map(|place| accelerations.put_back(slot_of[place] as usize));
                let put_back = contact.normal.dot((put_back - other_put_back).into());
                let distance = (first.position - second.position).length();
                let approach = Approach {
                    velocity: (first.velocity - second.velocity).dot(contact.normal),
                    acceleration: along(0),
                    depth: (first.radius + second.radius - distance).max(0.0) + put_back.max(0.0),
                };
                contact.target_velocity = rebound.velocity_after_on_springs(approach, along(1)).max(0.0);
            }
        }
    }
}
