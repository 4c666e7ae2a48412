//! The state of a net.

use std::sync::Arc;

use bevy::prelude::*;

use super::Topology;

/// The particles of a net: the arrays own their positions, in world space.
#[derive(Component, Debug, Clone, Default)]
#[require(Transform)]
pub struct ParticleNet {
    topology: Arc<Topology>,
    positions: Vec<Vec3>,
    velocities: Vec<Vec3>,
}

impl ParticleNet {
    /// A net at rest, laid out in `frame`.
    pub fn new(topology: Arc<Topology>, frame: &Transform) -> Self {
        let positions: Vec<Vec3> =
            topology.positions.iter().map(|place| frame.transform_point(*place)).collect();
        Self { velocities: vec![Vec3::ZERO; positions.len()], positions, topology }
    }

    /// What it is made of.
    pub fn topology(&self) -> &Arc<Topology> {
        &self.topology
    }

    /// The positions of the particles in the world, m.
    pub fn positions(&self) -> &[Vec3] {
        &self.positions
    }

    /// The positions, to be changed: particles that were moved go on from there.
    pub fn positions_mut(&mut self) -> &mut [Vec3] {
        &mut self.positions
    }

    /// The velocities of the particles, m/s.
    pub fn velocities(&self) -> &[Vec3] {
        &self.velocities
    }

    /// The velocities, to be changed.
    pub fn velocities_mut(&mut self) -> &mut [Vec3] {
        &mut self.velocities
    }
}
