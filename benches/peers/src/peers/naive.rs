//! The straightforward implementation without Bevy: a structure for each particle and each spring, and two loops.

use bevy::math::Vec3;

use super::Peer;
use crate::scene::{GRAVITY, Scene, TICK};

struct Body {
    position: Vec3,
    velocity: Vec3,
    force: Vec3,
    inverse_mass: f32,
}

struct Link {
    ends: [usize; 2],
    rest_length: f32,
    stiffness: f32,
    damping: f32,
}

pub struct NaiveLoop {
    bodies: Vec<Body>,
    links: Vec<Link>,
    substeps: u32,
}

impl NaiveLoop {
    pub fn new(scene: &Scene, substeps: u32) -> Self {
        let bodies = scene.positions.iter().enumerate().map(|(particle, position)| Body {
            position: *position,
            velocity: Vec3::ZERO,
            force: Vec3::ZERO,
            inverse_mass: scene.inverse_mass(particle),
        });
        let links = scene.springs.iter().map(|&ends| Link {
            ends,
            rest_length: scene.rest_length(ends),
            stiffness: scene.stiffness,
            damping: scene.damping,
        });
        Self { bodies: bodies.collect(), links: links.collect(), substeps }
    }

    /// One step of semi-implicit Euler.
    fn substep(&mut self, h: f32) {
        for link in &self.links {
            let [first, second] = link.ends;
            let separation = self.bodies[first].position - self.bodies[second].position;
            let relative_velocity = self.bodies[first].velocity - self.bodies[second].velocity;
            let length = separation.length();
            if length > 0.0 {
                let direction = separation / length;
                let tension = link.stiffness * (length - link.rest_length)
                    + link.damping * relative_velocity.dot(direction);
                self.bodies[first].force -= direction * tension;
                self.bodies[second].force += direction * tension;
            }
        }
        for body in &mut self.bodies {
            if body.inverse_mass > 0.0 {
                body.velocity += h * (body.force * body.inverse_mass + GRAVITY);
                body.position += h * body.velocity;
            }
            body.force = Vec3::ZERO;
        }
    }
}

impl Peer for NaiveLoop {
    fn tick(&mut self) {
        for _ in 0..self.substeps {
            self.substep(TICK / self.substeps as f32);
        }
    }

    fn positions(&self) -> Vec<Vec3> {
        self.bodies.iter().map(|body| body.position).collect()
    }

    fn substeps(&self) -> u32 {
        self.substeps
    }
}
