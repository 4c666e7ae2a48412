//! This crate's plugin, headless.

use bevy::prelude::*;
use bevy_mass_spring::prelude::*;

use super::{Peer, headless};
use crate::scene::{GRAVITY, Scene};

pub struct MassSpring {
    app: App,
    particles: Vec<Entity>,
}

impl MassSpring {
    pub fn new(scene: &Scene, integrator: Integrator, substeps: SubstepMode) -> Self {
        let mut app = headless::app();
        app.add_plugins(MassSpringPlugin::default())
            .insert_resource(Environment { gravity: GRAVITY, ..Environment::default() })
            .insert_resource(SolverSettings { integrator, substeps })
            .insert_resource(CollisionSettings {
                ground: false,
                particles: false,
                ..CollisionSettings::default()
            });
        let particles =
            headless::spawn_particles(&mut app, scene, |_, place| (Particle::new(scene.mass, 0.0), place));
        for &pinned in &scene.pinned {
            app.world_mut().entity_mut(particles[pinned]).insert(Pinned);
        }
        for ends in &scene.springs {
            let [first, second] = ends.map(|end| particles[end]);
            let spring = Spring::new(first, second, scene.rest_length(*ends));
            app.world_mut().spawn(spring.with_stiffness(scene.stiffness).with_damping(scene.damping));
        }
        headless::start(&mut app);
        Self { app, particles }
    }
}

impl Peer for MassSpring {
    fn tick(&mut self) {
        self.app.update();
    }

    fn positions(&self) -> Vec<Vec3> {
        headless::positions(&self.app, &self.particles)
    }

    fn substeps(&self) -> u32 {
        self.app.world().resource::<TickReport>().substeps
    }
}
