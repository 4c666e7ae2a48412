//! Half-spaces below surfaces: what others press onto one is held up in the same iterations, so that two that press a third one onto the
//! ground part by the weights of the upper ones.

use bevy::math::Vec3A;

use super::solve::Touching;
use crate::solver::particles::Particles;

use super::super::material::{ContactProperties, Layers, properties_of};
use super::super::plane::Surface;
use super::super::response::{shortened, tangential};

/// A particle that lies on a half-space, or may be pressed onto it.
#[derive(Debug, Clone, Copy)]
struct Support {
    /// The place of the particle among those that touch.
    body: u32,
    /// The place of the half-space.
    plane: u32,
    /// m.
    radius: f32,
    /// Coefficient of Coulomb friction.
    coefficient: f32,
    /// kg.
    mass: f32,
    /// Whether it lies on it at the end of the substep.
    touches: bool,
    /// N·s, beyond that of its own contact.
    impulse: f32,
    /// N·s.
    friction: Vec3A,
    /// By how much it was lifted in this substep, m, >= 0.
    lifted: f32,
}

/// All of them: working memory.
#[derive(Debug, Clone, Default)]
pub(super) struct Supports {
    planes: Vec<Surface>,
    all: Vec<Support>,
}

impl Supports {
    /// Finds those of the `bodies` that are not farther than their radius from one of the `half_spaces`.
    pub fn find(
        &mut self,
        half_spaces: impl Iterator<Item = (Surface, Layers)>,
        (bodies, particles): (&[Touching], &Particles),
        properties: &[ContactProperties],
    ) {
        let Self { planes, all } = self;
        planes.clear();
        all.clear();
        for (plane, (surface, layers)) in (0..).zip(half_spaces) {
            for (number, body) in (0..).zip(bodies).filter(|(_, body)| body.inverse_mass > 0.0) {
                let slot = body.slot as usize;
                let radius = particles.radius()[slot];
                let own = properties_of(properties, slot);
                if surface.depth(body.position, radius) >= -radius && own.layers.meet(layers) {
                    let [_, coefficient] = surface.coefficients(own.material);
                    all.push(Support {
                        body: number,
                        plane,
                        radius,
                        coefficient,
                        mass: 1.0 / body.inverse_mass,
                        touches: surface.touches(body.position.to_array(), radius),
                        impulse: 0.0,
                        friction: Vec3A::ZERO,
                        lifted: 0.0,
                    });
                }
            }
            planes.push(surface);
        }
    }

    /// Stops what approaches a half-space on which it lies; whether anything does, faster than `tolerance` m/s.
    pub fn correct_velocities(&mut self, bodies: &mut [Touching], tolerance: f32) -> bool {
        let Self { planes, all } = self;
        let mut corrected = false;
        for support in all.iter_mut().filter(|support| support.touches) {
            let (surface, body) = (&planes[support.plane as usize], &mut bodies[support.body as usize]);
            let relative = body.velocity - surface.velocity_at(body.position);
            let approach = -relative.dot(surface.normal);
            if approach <= 0.0 && support.impulse == 0.0 {
                continue;
            }
            corrected |= approach.abs() > tolerance;
            let impulse = (support.impulse + approach * support.mass).max(0.0);
            let sticking = support.friction - tangential(relative, surface.normal) * support.mass;
            let friction = shortened(sticking, support.coefficient * impulse);
            let change = surface.normal * (impulse - support.impulse) + friction - support.friction;
            (support.impulse, support.friction) = (impulse, friction);
            body.velocity += change * body.inverse_mass;
        }
        corrected
    }

    /// Lifts what is below the surface of a half-space onto it.
    pub fn correct_positions(&mut self, bodies: &mut [Touching]) {
        let Self { planes, all } = self;
        for support in &mut *all {
            let (surface, body) = (&planes[support.plane as usize], &mut bodies[support.body as usize]);
            let lifted = (support.lifted + surface.depth(body.position, support.radius)).max(0.0);
            body.position += surface.normal * (lifted - support.lifted);
            support.lifted = lifted;
        }
    }

    /// Whether there are any.
    pub fn any(&self) -> bool {
        !self.all.is_empty()
    }
}
