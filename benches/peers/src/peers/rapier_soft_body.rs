//! rapier3d's own soft body, without Bevy: the particles and springs of a scene are its particles and
//! edges, without a collider.
//!
//! Substeps are rapier's `num_solver_iterations`, 4 by default; each has 1 + 3 Gauss–Seidel sweeps.

use bevy::math::Vec3;
use rapier3d::prelude::*;

use super::Peer;
use crate::scene::{GRAVITY, Scene, TICK};

pub struct RapierSoftBody {
    world: PhysicsWorld,
    body: SoftBodyHandle,
    substeps: u32,
}

impl RapierSoftBody {
    pub fn new(scene: &Scene, substeps: u32) -> Self {
        let mut world = PhysicsWorld::new();
        world.gravity = Vector::from_array(GRAVITY.to_array());
        world.integration_parameters.dt = TICK;
        world.integration_parameters.num_solver_iterations = substeps as usize;
        let mut builder = SoftBodyBuilder::new(
            scene.positions.iter().map(|position| Vector::from_array(position.to_array())).collect(),
        )
        .particle_mass(scene.mass)
        .pinned_particles(scene.pinned.iter().map(|&particle| particle as u32))
        .edges(scene.springs.iter().map(|ends| ends.map(|end| end as u32)).collect())
        .no_surface_collider()
        .can_sleep(false);
        let softness = |spring: &[usize; 2]| softness(scene, *spring);
        builder.edge_softness = (0..).zip(scene.springs.iter().map(softness)).collect();
        let body = world.insert_soft_body(builder);
        Self { world, body, substeps }
    }
}

/// Frequency and damping ratio of a spring with stiffness k and damping c between the masses of its ends:
/// ω² = k (1/m₁ + 1/m₂), 2 ζ ω = c (1/m₁ + 1/m₂).
fn softness(scene: &Scene, ends: [usize; 2]) -> SpringCoefficients<f32> {
    let inverse_mass: f32 = ends.into_iter().map(|end| scene.inverse_mass(end)).sum();
    let angular_frequency = (scene.stiffness * inverse_mass).sqrt();
    SpringCoefficients::new(
        angular_frequency / std::f32::consts::TAU,
        scene.damping * inverse_mass / (2.0 * angular_frequency),
    )
}

impl Peer for RapierSoftBody {
    fn tick(&mut self) {
        self.world.step();
    }

    fn positions(&self) -> Vec<Vec3> {
        let position = |position: Vector| Vec3::from_array(position.to_array());
        self.world.soft_bodies[self.body].particle_positions().map(position).collect()
    }

    fn substeps(&self) -> u32 {
        self.substeps
    }
}
