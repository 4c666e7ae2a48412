//! Particles as the contacts want them: each in one cache line, its vectors in SIMD registers.
//!
//! Contacts reach for two particles here and two there, where forces and integration run along the
//! arrays; so while contacts are solved the particles are a plain array of structures.

use bevy::math::{Vec3, Vec3A};

use crate::solver::particles::Particles;

/// What contacts read and write of a particle.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(super) struct Body {
    pub position: Vec3A,
    pub velocity: Vec3A,
    /// The position at the start of the substep, m.
    pub previous: Vec3A,
    pub inverse_mass: f32,
    pub radius: f32,
    /// How many resting contacts it has.
    pub holds: u32,
    /// Whether it rests on the ground or on something that does.
    pub supported: bool,
}

impl Body {
    /// How far it has moved in this substep, m.
    #[inline]
    pub fn moved(&self) -> Vec3A {
        self.position - self.previous
    }
}

/// Copies all particles, each into its slot; `previous` are their positions at the start of the substep.
pub(super) fn fill(bodies: &mut Vec<Body>, particles: &Particles, previous: &[Vec3]) {
    bodies.clear();
    bodies.extend(previous.iter().enumerate().map(|(slot, previous)| Body {
        position: particles.position.get(slot).into(),
        velocity: particles.velocity.get(slot).into(),
        previous: (*previous).into(),
        inverse_mass: particles.inverse_mass[slot],
        radius: particles.radius[slot],
        holds: 0,
        supported: particles.inverse_mass[slot] == 0.0,
    }));
}

/// Copies positions and velocities back.
pub(super) fn write_back(bodies: &[Body], particles: &mut Particles) {
    for (slot, body) in bodies.iter().enumerate() {
        particles.position.set(slot, body.position.into());
        particles.velocity.set(slot, body.velocity.into());
    }
}
