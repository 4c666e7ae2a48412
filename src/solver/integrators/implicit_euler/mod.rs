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
mod system;
mod topology;

use bevy::math::{DVec3, Vec3};

use super::super::SolverState;
use super::super::forces::Field;
use super::super::particles::Particles;
use conjugate_gradient::ConjugateGradient;
use system::{System, free_velocity};
use topology::{NOBODY, Topology};

/// The Newton step, as a part of the displacement in the time step, after which the error is gone for
/// all purposes: convergence is quadratic.
const TOLERANCE: f64 = 1e-3;

/// The most Newton steps.
const MOST_STEPS: usize = 40;

/// So many Newton steps may raise the potential before the first of them is taken back.
const PATIENCE: usize = 3;

/// Displacements below this part of a coordinate are lost when the position becomes an f32.
const ROUNDING: f64 = f32::EPSILON as f64 / 2.0;

/// What is kept from substep to substep: the order of elimination, and memory.
#[derive(Debug, Clone, Default)]
pub(super) struct ImplicitEuler {
    topology: Topology,
    system: System,
    conjugate_gradient: ConjugateGradient,
    best: Best,
    parts: Vec<Progress>,
    /// For each part Σ (m/h² + ν/h) (x' − y) and Σ (m/h² + ν/h).
    drifts: Vec<(DVec3, f64)>,
}

/// The best point so far, and the Newton step from there.
#[derive(Debug, Clone, Default)]
struct Best {
    potential: f64,
    position: Vec<DVec3>,
    step: Vec<DVec3>,
}

/// How far one connected part of the net has come: sums of squares, m².
#[derive(Debug, Clone, Copy, Default)]
struct Progress {
    /// Of the Newton step.
    step: f64,
    /// Of the displacement in free flight.
    flight: f64,
    /// Of the displacement by springs.
    pulled: f64,
    /// Of what is lost when positions become f32.
    least: f64,
}

impl Progress {
    fn is_enough(&self) -> bool {
        self.step <= TOLERANCE * TOLERANCE * (self.flight + self.pulled) + self.least
    }
}

pub(super) fn advance(state: &mut SolverState, field: Field, substep: f32) {
    let SolverState { particles, springs, scratch, .. } = state;
    let h = f64::from(substep);
    let solver = &mut scratch.implicit_euler;
    solver.topology.refresh(springs, &particles.inverse_mass);
    solver.system.begin(&solver.topology, particles, springs, field, h);
    solver.measure_scales(particles);
    solver.minimise();
    solver.balance();
    solver.finish(particles, field, h);
}

impl ImplicitEuler {
    /// The displacements that Newton steps are compared with: of the free flight, and the least that
    /// shows in f32.
    fn measure_scales(&mut self, particles: &Particles) {
        let Self { topology, system, parts, .. } = self;
        parts.clear();
        parts.resize(topology.anchored.len(), Progress::default());
        for node in 0..topology.free {
            let start = particles.position.get(topology.slots[node] as usize).as_dvec3();
            let part = &mut parts[topology.parts[node] as usize];
            part.flight += system.flight[node].distance_squared(start);
            part.least += ROUNDING * ROUNDING * start.length_squared();
        }
    }

    /// Newton's method.
    ///
    /// Full steps are best, though the first few may raise the potential: turning a stiff spring
    /// stretches it a little, until the next step. So up to [`PATIENCE`] steps may go up; then the
    /// search goes back to the best point and along its step for less and less of it. (The watchdog:
    /// Chamberlain, Powell, Lemarechal and Pedersen, *Math. Programming Study* 16, 1, 1982.)
    fn minimise(&mut self) {
        let mut ascents = 0;
        let mut share = 1.0;
        self.best.potential = f64::INFINITY;
        for _ in 0..MOST_STEPS {
            let potential = self.system.linearise(&self.topology);
            // The potential is a sum: it does not show what its rounding hides.
            let improved = potential <= self.best.potential + 1e-12 * self.best.potential.abs();
            ascents = if improved { 0 } else { ascents + 1 };
            if ascents > PATIENCE {
                share *= 0.5;
                self.return_to_best(share);
                continue;
            }
            self.conjugate_gradient.solve(&mut self.system, &self.topology);
            self.system.substitute_trees(&self.topology);
            if improved {
                share = 1.0;
                self.best.potential = potential;
                self.best.position.clone_from(&self.system.position);
                self.best.step.clone_from(&self.system.step);
            }
            if self.take_step() {
                return;
            }
        }
        self.return_to_best(0.0);
    }

    fn return_to_best(&mut self, share: f64) {
        let Best { position, step, .. } = &self.best;
        for ((iterate, position), step) in self.system.position.iter_mut().zip(position).zip(step) {
            *iterate = *position + *step * share;
        }
    }

    /// Takes the Newton step; says whether it was the last.
    fn take_step(&mut self) -> bool {
        let Self { topology, system, parts, .. } = self;
        for part in &mut *parts {
            (part.step, part.pulled) = (0.0, 0.0);
        }
        for node in 0..topology.free {
            let step = system.step[node];
            system.position[node] += step;
            let part = &mut parts[topology.parts[node] as usize];
            part.step += step.length_squared();
            part.pulled += system.position[node].distance_squared(system.flight[node]);
        }
        parts.iter().all(Progress::is_enough)
    }

    /// Moves every part that hangs on nothing as a whole, to where it has the momentum that it must
    /// have: Σ (m/h² + ν/h) (x' − y) = 0, as springs add none. It would be so by itself, had the
    /// equations of the core been solved to the last bit.
    fn balance(&mut self) {
        let Self { topology, system, parts, drifts, .. } = self;
        drifts.clear();
        drifts.resize(parts.len(), (DVec3::ZERO, 0.0));
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
            let mut velocity = free_velocity(particles, slot, field, h);
            let node = topology.nodes[slot];
            if node != NOBODY {
                velocity += (system.position[node as usize] - system.flight[node as usize]) / h;
            }
            let position = particles.position.get(slot).as_dvec3() + h * velocity;
            let acceleration = (velocity - particles.velocity.get(slot).as_dvec3()) / h;
            particles.position.set(slot, position.as_vec3());
            particles.velocity.set(slot, velocity.as_vec3());
            particles.acceleration.set(slot, acceleration.as_vec3());
        }
    }
}
