//! Particles as the contacts want them: one cache line holds two, whole.
//!
//! Contacts reach for two particles here and two there, where forces and integration run along the
//! arrays; so while contacts are solved the particles are a plain array of structures.

use bevy::math::Vec3;

use crate::solver::particles::Particles;

/// What contacts read and write of a particle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Body {
    pub position: Vec3,
    pub inverse_mass: f32,
    pub velocity: Vec3,
    pub radius: f32,
}

/// Copies all particles, each into its slot.
pub(super) fn fill(bodies: &mut Vec<Body>, particles: &Particles) {
    bodies.clear();
    bodies.extend((0..particles.len()).map(|slot| Body {
        position: particles.position.get(slot),
        inverse_mass: particles.inverse_mass[slot],
        velocity: particles.velocity.get(slot),
        radius: particles.radius[slot],
    }));
}

/// Copies positions and velocities back.
pub(super) fn write_back(bodies: &[Body], particles: &mut Particles) {
    for (slot, body) in bodies.iter().enumerate() {
        particles.position.set(slot, body.position);
        particles.velocity.set(slot, body.velocity);
    }
}
