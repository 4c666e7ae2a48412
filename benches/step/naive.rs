//! What one writes first: a structure for each particle and each spring, and two loops.

use bevy::math::Vec3;

use crate::{GRAVITY, Net, SUBSTEPS, TICK};

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

pub struct World {
    bodies: Vec<Body>,
    links: Vec<Link>,
}

impl World {
    pub fn of(net: &Net) -> Self {
        let inverse_mass = |slot| if net.pinned.contains(&slot) { 0.0 } else { 1.0 / net.mass };
        let bodies = net.positions.iter().enumerate().map(|(slot, position)| Body {
            position: *position,
            velocity: Vec3::ZERO,
            force: Vec3::ZERO,
            inverse_mass: inverse_mass(slot),
        });
        let links = net.links.iter().map(|&(first, second)| Link {
            ends: [first, second],
            rest_length: net.rest_length((first, second)),
            stiffness: net.stiffness,
            damping: net.damping,
        });
        Self { bodies: bodies.collect(), links: links.collect() }
    }

    pub fn position(&self, slot: usize) -> Vec3 {
        self.bodies[slot].position
    }

    pub fn tick(&mut self) {
        for _ in 0..SUBSTEPS {
            self.substep(TICK / SUBSTEPS as f32);
        }
    }

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
