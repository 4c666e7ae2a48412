//! bevy_rapier3d: each particle a rigid body without a collider, each spring a `SpringJoint`.
//!
//! A body can have one joint component, so each spring is a child entity of its second end.
//! Substeps are rapier's `num_solver_iterations`, 4 by default.

use bevy::prelude::*;
use bevy_rapier3d::prelude::*;
use bevy_rapier3d::rapier::dynamics::IntegrationParameters;

use super::{Peer, headless};
use crate::scene::{GRAVITY, Scene, TICK};

pub struct BevyRapier {
    app: App,
    particles: Vec<Entity>,
    substeps: u32,
}

impl BevyRapier {
    pub fn new(scene: &Scene, substeps: u32) -> Self {
        let initialization = RapierContextInitialization::InitializeDefaultRapierContext {
            integration_parameters: IntegrationParameters {
                dt: TICK,
                num_solver_iterations: substeps as usize,
                ..IntegrationParameters::default()
            },
            rapier_configuration: RapierConfiguration { gravity: GRAVITY, ..RapierConfiguration::new(1.0) },
        };
        let mut app = headless::app();
        app.insert_resource(TimestepMode::Fixed { dt: TICK, substeps: 1 }).add_plugins(
            RapierPhysicsPlugin::<NoUserData>::default()
                .with_custom_initialization(initialization)
                .in_fixed_schedule(),
        );
        let particles = headless::spawn_particles(&mut app, scene, |particle, place| {
            let body = if scene.pinned.contains(&particle) { RigidBody::Fixed } else { RigidBody::Dynamic };
            let mass = AdditionalMassProperties::Mass(scene.mass);
            (body, mass, LockedAxes::ROTATION_LOCKED, Sleeping::disabled(), place)
        });
        for ends in &scene.springs {
            let [first, second] = ends.map(|end| particles[end]);
            let spring = SpringJointBuilder::new(scene.rest_length(*ends), scene.stiffness, scene.damping);
            app.world_mut().spawn((ImpulseJoint::new(first, spring), ChildOf(second)));
        }
        headless::start(&mut app);
        Self { app, particles, substeps }
    }
}

impl Peer for BevyRapier {
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
