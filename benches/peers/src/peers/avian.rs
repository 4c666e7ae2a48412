//! avian3d: each particle a rigid body without a collider, each spring a `DistanceJoint`.
//!
//! Compliance is 1/k. Its `JointDamping` is left out: it brakes every relative motion of the two bodies,
//! also across the joint, which the dashpot along a spring does not, and makes the error larger.

use avian3d::prelude::*;
use bevy::prelude::*;

use super::{Peer, headless};
use crate::scene::{GRAVITY, Scene};

pub struct Avian {
    app: App,
    particles: Vec<Entity>,
    substeps: u32,
}

impl Avian {
    pub fn new(scene: &Scene, substeps: u32) -> Self {
        let mut app = headless::app();
        app.add_plugins(PhysicsPlugins::default())
            .insert_resource(Gravity(GRAVITY))
            .insert_resource(SubstepCount(substeps));
        // With rotations locked any inertia will do, but there must be one.
        let inertia = AngularInertia::new(Vec3::ONE);
        let particles = headless::spawn_particles(&mut app, scene, |particle, place| {
            let body = if scene.pinned.contains(&particle) { RigidBody::Static } else { RigidBody::Dynamic };
            (body, Mass(scene.mass), inertia, LockedAxes::ROTATION_LOCKED, SleepingDisabled, place)
        });
        for ends in &scene.springs {
            let [first, second] = ends.map(|end| particles[end]);
            let rest_length = scene.rest_length(*ends);
            app.world_mut().spawn(
                DistanceJoint::new(first, second)
                    .with_limits(rest_length, rest_length)
                    .with_compliance(1.0 / scene.stiffness),
            );
        }
        headless::start(&mut app);
        Self { app, particles, substeps }
    }
}

impl Peer for Avian {
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
