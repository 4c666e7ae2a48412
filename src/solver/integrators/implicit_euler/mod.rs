//! Backward Euler: v' = v + h a(x', v'), x' = x + h v'. First order; stable for every substep.
//!
//! Baraff and Witkin, *Large steps in cloth simulation* (1998), took one Newton step on these equations;
//! here they are solved, as the minimum of a potential (Martin et al., *Example-based elastic
//! materials*, 2011; Liu et al., *Fast simulation of mass-spring systems*, 2013):
//!
//! Φ(x') = Σ ½ (m/h² + ν/h) ‖x' − y‖² + Σ ½ k (l(x') − l0)² + Σ ½ (c/h) (l(x') − l(x))²
//!
//! where y is where the particle flies without springs. The last sum is the dampers: their elongation
//! rate is (l' − l)/h, and their force acts along the spring as it is in the end, so that momentum and
//! angular momentum know nothing of it. Pinned particles are where they will be.
//!
//! Newton's method: `system.rs` linearises, `topology.rs` orders the unknowns so that trees of springs
//! are eliminated directly, `conjugate_gradient.rs` solves for the rest.

mod block;
mod conjugate_gradient;
mod core;
mod hierarchy;
mod newton;
mod preconditioner;
mod system;
mod topology;

use bevy::math::{DVec3, Vec3};

use super::super::SolverState;
use super::super::forces::Field;
use super::super::particles::Particles;
use super::free_velocity;
use newton::Newton;
use system::System;
use topology::{NOBODY, Topology};

/// What is kept from substep to substep: the order of elimination, and memory.
#[derive(Debug, Clone, Default)]
pub(super) struct ImplicitEuler {
    topology: Topology,
    system: System,
    newton: Newton,
    /// For each part of the net Σ (m/h² + ν/h) (x' − y) and Σ (m/h² + ν/h).
    drifts: Vec<(DVec3, f64)>,
}

pub(super) fn advance(state: &mut SolverState, field: Field, substep: f32) {
    let SolverState { particles, springs, scratch, .. } = state;
    let h = f64::from(substep);
    let ImplicitEuler { topology, system, newton, .. } = &mut scratch.implicit_euler;
    if topology.refresh(springs, &particles.inverse_mass) {
        system.resize(topology);
    }
    system.begin(topology, particles, springs, field, h);
    newton.minimise(system, topology);
    scratch.implicit_euler.balance();
    scratch.implicit_euler.finish(particles, field, h);
}

impl ImplicitEuler {
    /// Moves every part that hangs on nothing as a whole, to where it has the momentum that it must
    /// have: Σ (m/h² + ν/h) (x' − y) = 0, as springs add none. It would be so by itself, had the
    /// equations of the core been solved to the last bit.
    fn balance(&mut self) {
        let Self { topology, system, drifts, .. } = self;
        if topology.trees == topology.free {
            return;
        }
        drifts.clear();
        drifts.resize(topology.anchored.len(), (DVec3::ZERO, 0.0));
        for node in 0..topology.free {
            let (drift, inertia) = &mut drifts[topology.parts[node] as usize];
            *drift += system.inertia[node] * (system.position[node] - system.flight[node]);
            *inertia += system.inertia[node];
        }
        for node in 0..topology.free {
            let part = topology.parts[node] as usize;
            if !topology.anchored[part] {
                let (drift, inertia) = drifts[part];
                system.position[node] -= drift / inertia;
            }
        }
    }

    /// Writes positions, velocities and accelerations back.
    fn finish(&mut self, particles: &mut Particles, field: Field, h: f64) {
        let Self { topology, system, .. } = self;
        for slot in 0..particles.len() {
            if particles.inverse_mass[slot] == 0.0 {
                particles.acceleration.set(slot, Vec3::ZERO);
                continue;
            }
            let start = particles.position.get(slot).as_dvec3();
            let (position, velocity) = match topology.nodes[slot] {
                NOBODY => {
                    let velocity = free_velocity(particles, slot, field, h);
                    (start + h * velocity, velocity)
                }
                node => {
                    let position = system.position[node as usize];
                    (position, (position - start) / h)
                }
            };
            let acceleration = (velocity - particles.velocity.get(slot).as_dvec3()) / h;
            particles.position.set(slot, position.as_vec3());
            particles.velocity.set(slot, velocity.as_vec3());
            particles.acceleration.set(slot, acceleration.as_vec3());
        }
    }
}
