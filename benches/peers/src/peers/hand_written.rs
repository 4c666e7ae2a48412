//! The straightforward implementation in Bevy: particles and springs are entities, and one system looks up both ends
//! of each spring with `Query::get_many_mut`.

use bevy::prelude::*;

use super::{Peer, headless};
use crate::scene::{GRAVITY, Scene};

#[derive(Component)]
struct Body {
    velocity: Vec3,
    force: Vec3,
    inverse_mass: f32,
}

#[derive(Component)]
struct Link {
    ends: [Entity; 2],
    rest_length: f32,
    stiffness: f32,
    damping: f32,
}

#[derive(Resource)]
struct SubstepCount(u32);

pub struct HandWritten {
    app: App,
    particles: Vec<Entity>,
    substeps: u32,
}

impl HandWritten {
    pub fn new(scene: &Scene, substeps: u32) -> Self {
        let mut app = headless::app();
        app.insert_resource(SubstepCount(substeps)).add_systems(FixedUpdate, simulate);
        let particles = headless::spawn_particles(&mut app, scene, |particle, place| {
            let inverse_mass = scene.inverse_mass(particle);
            (Body { velocity: Vec3::ZERO, force: Vec3::ZERO, inverse_mass }, place)
        });
        for ends in &scene.springs {
            app.world_mut().spawn(Link {
                ends: ends.map(|end| particles[end]),
                rest_length: scene.rest_length(*ends),
                stiffness: scene.stiffness,
                damping: scene.damping,
            });
        }
        headless::start(&mut app);
        Self { app, particles, substeps }
    }
}

/// Semi-implicit Euler.
fn simulate(
    mut bodies: Query<(&mut Transform, &mut Body)>,
    links: Query<&Link>,
    substeps: Res<SubstepCount>,
    time: Res<Time>,
) {
    let h = time.delta_secs() / substeps.0 as f32;
    for _ in 0..substeps.0 {
        for link in &links {
            let Ok([(first_place, mut first), (second_place, mut second)]) = bodies.get_many_mut(link.ends)
            else {
                continue;
            };
            let separation = first_place.translation - second_place.translation;
            let length = separation.length();
            if length > 0.0 {
                let direction = separation / length;
                let tension = link.stiffness * (length - link.rest_length)
                    + link.damping * (first.velocity - second.velocity).dot(direction);
                first.force -= direction * tension;
                second.force += direction * tension;
            }
        }
        for (mut place, mut body) in &mut bodies {
            if body.inverse_mass > 0.0 {
                let acceleration = body.force * body.inverse_mass + GRAVITY;
                body.velocity += h * acceleration;
                place.translation += h * body.velocity;
            }
            body.force = Vec3::ZERO;
        }
    }
}

impl Peer for HandWritten {
    fn tick(&mut self) {
        self.app.update();
    }

    fn positions(&self) -> Vec<Vec3> {
        headless::positions(&self.app, &self.particles)
    }

    fn substeps(&self) -> u32 {
        self.substeps
    }
}
