//! Particles in the layout of the contact solver: each in one cache line, its vectors in SIMD registers.
//!
//! Contacts read and write pairs of particles all over memory, where forces and integration run along the
//! arrays; so while contacts are solved the particles are a plain array of structures, ordered as
//! [`Regions`] say.

use bevy::math::Vec3A;

use crate::solver::parallel;
use crate::solver::particles::{Particles, Vectors, set};

use super::regions::Regions;
use crate::solver::graph::Exclusions;

/// Number of bodies that are copied as one part.
const BODIES_PER_PART: usize = 4096;

/// What contacts read and write of a particle.
#[derive(Debug, Clone, Copy, Default)]
#[repr(align(64))]
pub(super) struct Body {
    pub position: Vec3A,
    pub velocity: Vec3A,
    /// The position at the start of the substep, m.
    pub previous: Vec3A,
    pub inverse_mass: f32,
    pub radius: f32,
    /// Number of its resting contacts, at most 255.
    pub holds: u8,
    /// Number of the particles that it touches, at most 255.
    pub touching: u8,
    /// Whether it rests on the ground or on something that does.
    pub supported: bool,
    /// Whether the ground or something on it is in contact with it from below, however steep.
    pub carried: bool,
    /// Whether springs pull at it.
    pub sprung: bool,
    /// Whether its contacts with what is pinned are solved by implicit Euler.
    pub implicit: bool,
    /// Whether any of its contacts slips, or it touches what moves it along.
    pub slips: bool,
    /// Whether it stays where it is in this substep.
    pub held: bool,
}

/// One cache line: of two, a pile of 10,000 balls took 5 to 13 % longer.
const _: () = assert!(size_of::<Body>() == 64);

impl Body {
    /// Counts a resting contact.
    #[inline]
    pub fn hold(&mut self) {
        self.holds = self.holds.saturating_add(1);
    }

    /// How far it has moved in this substep, m.
    #[inline]
    pub fn moved(&self) -> Vec3A {
        self.position - self.previous
    }

    /// The inverse mass with which contacts displace it, 1/kg: what an implicit step has put somewhere stays there.
    #[inline]
    pub fn displaced_inverse_mass(&self) -> f32 {
        if self.implicit { 0.0 } else { self.inverse_mass }
    }
}

/// Copies all particles; `previous` are their positions at the start of the substep.
pub(super) fn fill(
    bodies: &mut Vec<Body>,
    particles: &Particles,
    previous: &Vectors,
    regions: &Regions,
    (exclusions, is_implicit): (&Exclusions, &[bool]),
) {
    bodies.resize(particles.len(), Body::default());
    let parts = bodies.chunks_mut(BODIES_PER_PART).zip(regions.slot_of.chunks(BODIES_PER_PART));
    parallel::for_each(parts, regions.are_many(), |(bodies, slots)| {
        for (body, slot) in bodies.iter_mut().zip(slots) {
            let slot = *slot as usize;
            *body = Body {
                position: particles.position.get(slot).into(),
                velocity: particles.velocity.get(slot).into(),
                previous: previous.get(slot).into(),
                inverse_mass: particles.inverse_mass()[slot],
                radius: particles.radius()[slot],
                holds: 0,
                touching: 0,
                supported: particles.inverse_mass()[slot] == 0.0,
                carried: particles.inverse_mass()[slot] == 0.0,
                sprung: exclusions.is_sprung(slot),
                implicit: is_implicit.get(slot) == Some(&true),
                slips: false,
                held: particles.inverse_mass()[slot] == 0.0,
            };
        }
    });
}

/// Changes each body by itself.
pub(super) fn for_each(bodies: &mut [Body], regions: &Regions, change: impl Fn(&mut Body) + Sync) {
    parallel::for_each(bodies.chunks_mut(BODIES_PER_PART), regions.are_many(), |bodies| {
        bodies.iter_mut().for_each(&change)
    });
}

/// Copies positions and velocities back.
pub(super) fn write_back(bodies: &[Body], particles: &mut Particles, regions: &Regions) {
    let places =
        particles.position.chunks_mut(BODIES_PER_PART).zip(particles.velocity.chunks_mut(BODIES_PER_PART));
    let parts = places.zip(regions.body_of.chunks(BODIES_PER_PART));
    parallel::for_each(parts, regions.are_many(), |((mut position, mut velocity), numbers)| {
        for (place, number) in numbers.iter().enumerate() {
            let body = &bodies[*number as usize];
            set(&mut position, place, body.position.into());
            set(&mut velocity, place, body.velocity.into());
        }
    });
}
