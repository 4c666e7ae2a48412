//! Rebounds of particles on springs under explicit schemes.
//!
//! How fast something rebounds follows from its acceleration: see `response.rs`. For loose particles it is the same where they touch; for
//! what springs pull at it changes within the substep, so that those at its start and at its end decide. From where the substep has led
//! to to the surface is the depth, and what has been swept back before.

use bevy::math::Vec3A;

use super::material::properties_of;
use super::response::{Rebound, SprungApproach};
use super::{ContactCaches, Substep};
use crate::solver::graph::Exclusions;
use crate::solver::particles::{Particles, Vectors};

/// What an explicit scheme has evaluated in a substep.
#[derive(Clone, Copy)]
pub(in crate::solver) struct Evaluated<'a> {
    /// The accelerations at its start and where it has led to, m/s².
    pub accelerations: [&'a Vectors; 2],
    /// How much of these, by h², its displacements fall short of h times the velocity at its end.
    pub shares: [f32; 2],
}

/// How particles have moved in a substep.
#[derive(Clone, Copy)]
struct Motions<'a> {
    evaluated: Evaluated<'a>,
    exclusions: &'a Exclusions,
    particles: &'a Particles,
    /// Positions at the start, m.
    previous: &'a Vectors,
    /// s.
    duration: f32,
    /// Of the particles that an implicit step has moved, which blocks have no accelerations of.
    is_implicit: &'a [bool],
}

/// How a particle, or a place between several, has moved in a substep.
#[derive(Debug, Clone, Copy, Default)]
struct Motion {
    /// At the start and at the end, m/s².
    accelerations: [Vec3A; 2],
    /// Where the substep would have led to, from its start, m.
    displacement: Vec3A,
    /// By how much it has been put back from there, m.
    put_back: Vec3A,
}

impl Motion {
    fn add(&mut self, weight: f32, other: Self) {
        for (sum, other) in self.accelerations.iter_mut().zip(other.accelerations) {
            *sum += weight * other;
        }
        self.displacement += weight * other.displacement;
        self.put_back += weight * other.put_back;
    }

    /// The accelerations, the displacement and what was put back along a normal.
    fn along(&self, normal: Vec3A) -> ([f32; 2], f32, f32) {
        let accelerations = self.accelerations.map(|vector| vector.dot(normal));
        (accelerations, self.displacement.dot(normal), self.put_back.dot(normal).max(0.0))
    }
}

impl Motions<'_> {
    /// Whether an explicit scheme has moved a particle.
    fn is_explicit(&self, slot: usize) -> bool {
        !self.particles.is_pinned(slot) && self.is_implicit.get(slot) != Some(&true)
    }

    /// That of a particle. The acceleration of a loose one is the same at both ends.
    fn of(&self, slot: usize) -> Motion {
        let Self { evaluated, particles, previous, duration: h, .. } = *self;
        let [start, end] = evaluated.accelerations.map(|accelerations| Vec3A::from(accelerations.get(slot)));
        let moved = Vec3A::from(particles.position.get(slot) - previous.get(slot));
        if !self.is_explicit(slot) {
            return Motion { accelerations: [start; 2], displacement: moved, put_back: Vec3A::ZERO };
        }
        let accelerations = if self.exclusions.is_sprung(slot) { [start, end] } else { [start; 2] };
        let [first, second] = evaluated.shares;
        let displacement =
            h * Vec3A::from(particles.velocity.get(slot)) - h * h * (first * start + second * end);
        Motion { accelerations, displacement, put_back: moved - displacement }
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
        if !exclusions.any_sprung() {
            return false;
        }
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

    /// Gives what rebounds the velocity that follows from the accelerations at both ends of the substep.
    pub fn adjust_rebounds(&mut self, particles: &Particles, substep: Substep, evaluated: Evaluated) {
        let Substep { colliders, properties, duration, .. } = substep;
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
        let motions = Motions { evaluated, exclusions, particles, previous, duration, is_implicit };
        for contact in plane_contacts.iter_mut().filter(|contact| contact.rebounds()) {
            let surface = &surfaces[contact.plane];
            let motion = motions.of(contact.slot);
            let (accelerations, ..) = motion.along(surface.normal);
            let moved = (rebound, accelerations, motion.displacement);
            contact.adjust(surface, particles, moved, properties_of(properties, contact.slot));
        }
        for touch in touches.all.iter_mut().filter(|touch| touch.target_velocity > 0.0) {
            let ends =
                touch.slots[..touch.count as usize].iter().map(|slot| *slot as usize).zip(touch.weights);
            let mut velocity = -touch.surface_velocity;
            let mut motion = Motion { displacement: -duration * touch.surface_velocity, ..Motion::default() };
            for (slot, weight) in ends {
                velocity += weight * Vec3A::from(particles.velocity.get(slot));
                motion.add(weight, motions.of(slot));
            }
            let material = colliders[touch.collider as usize].material;
            let [restitution, _] =
                material.between(properties_of(properties, touch.slots[0] as usize).material);
            let (accelerations, displacement, put_back) = motion.along(touch.normal);
            let rebound = Rebound { restitution, ..rebound };
            let approach = SprungApproach {
                velocity: velocity.dot(touch.normal),
                accelerations,
                displacement,
                depth: touch.depth.max(0.0) + put_back,
            };
            touch.target_velocity = rebound.velocity_after_on_springs(approach).max(0.0);
        }
        let slot_of = &candidates.regions.slot_of;
        for group in candidates.groups.iter() {
            let contacts = pair_contacts.of_mut(group).iter_mut();
            for contact in contacts.filter(|contact| contact.sprung && contact.target_velocity > 0.0) {
                let places = [contact.first(), contact.second()].map(|place| group.bodies.start + place);
                let [first, second] = places.map(|place| &bodies[place]);
                let [mut motion, other] = places.map(|place| motions.of(slot_of[place] as usize));
                motion.add(-1.0, other);
                let (accelerations, displacement, put_back) = motion.along(contact.normal);
                let distance = (first.position - second.position).length();
                let approach = SprungApproach {
                    velocity: (first.velocity - second.velocity).dot(contact.normal),
                    accelerations,
                    displacement,
                    depth: (first.radius + second.radius - distance).max(0.0) + put_back,
                };
                contact.target_velocity = rebound.velocity_after_on_springs(approach).max(0.0);
            }
        }
    }
}
