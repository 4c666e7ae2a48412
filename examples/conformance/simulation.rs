//! A net under one of the crate's schemes, and what its ticks cost.

use std::time::Instant;

use bevy::math::DVec3;
use bevy_mass_spring::solver::{Integrator, Plan, Solver, StepSettings, SubstepMode};

use crate::net::{Net, gravity};

/// Every named scheme, and `Auto`.
pub fn integrators() -> impl Iterator<Item = Integrator> {
    Integrator::named().chain([Integrator::Auto])
}

/// A run.
pub struct Simulation {
    pub solver: Solver,
    settings: StepSettings,
    milliseconds: Vec<f64>,
}

impl Simulation {
    /// `net` in ticks of `time_step` seconds under gravity.
    pub fn new(net: &Net, integrator: Integrator, substeps: SubstepMode, time_step: f64) -> Self {
        let settings = StepSettings {
            integrator,
            substeps,
            time_step: time_step as f32,
            gravity: gravity(),
            viscosity: net.viscosity as f32,
            ..StepSettings::default()
        };
        Self { solver: net.solver(), settings, milliseconds: Vec::new() }
    }

    /// Back to the positions and velocities of `net`.
    pub fn restart(&mut self, net: &Net) {
        for slot in 0..net.position.len() {
            self.solver.set_position(slot, net.position[slot].as_vec3());
            self.solver.set_velocity(slot, net.velocity[slot].as_vec3());
        }
    }

    /// With one substep where every step is stable, else as many as the stability bound asks for.
    pub fn stable(net: &Net, integrator: Integrator, time_step: f64) -> Self {
        let substeps = match integrator {
            Integrator::ImplicitEuler | Integrator::TrBdf2 => SubstepMode::Fixed(1),
            _ => SubstepMode::Auto,
        };
        Self::new(net, integrator, substeps, time_step)
    }

    /// Runs one tick; returns its cost, ms.
    pub fn tick(&mut self) -> f64 {
        let start = Instant::now();
        self.solver.step(&self.settings);
        let milliseconds = start.elapsed().as_secs_f64() * 1e3;
        self.milliseconds.push(milliseconds);
        milliseconds
    }

    /// Runs a number of ticks, or fewer if the state becomes infinite.
    pub fn run(&mut self, ticks: usize) {
        for _ in 0..ticks {
            self.tick();
            if !self.is_finite() {
                break;
            }
        }
    }

    /// Whether every coordinate is a number.
    pub fn is_finite(&self) -> bool {
        self.positions().iter().all(|position| position.is_finite())
    }

    /// Kinetic, elastic and gravitational energy, J.
    pub fn energy(&self) -> f64 {
        let totals = self.solver.measure(self.settings.gravity);
        totals.kinetic_energy + totals.elastic_energy + totals.gravitational_energy
    }

    /// m
    pub fn position(&self, slot: usize) -> DVec3 {
        self.solver.position(slot).as_dvec3()
    }

    /// m
    pub fn positions(&self) -> Vec<DVec3> {
        (0..self.solver.particle_count()).map(|slot| self.position(slot)).collect()
    }

    /// The median cost of a tick so far.
    pub fn milliseconds(&self) -> f64 {
        let mut sorted = self.milliseconds.clone();
        sorted.sort_by(f64::total_cmp);
        sorted[sorted.len() / 2]
    }

    /// What ran in the last tick: `4` substeps, or, for `Auto`, the schemes that were chosen and their substeps.
    pub fn choice(&self) -> String {
        let Plan { integrator, substeps, stiff_substeps, stiff_springs, .. } = self.solver.outputs().plan;
        match (self.settings.integrator, stiff_substeps) {
            (Integrator::Auto, 0) => format!("{integrator}, {substeps}"),
            (Integrator::Auto, _) => {
                let implicit = Integrator::TrBdf2;
                format!("{integrator}, {substeps}; {implicit}, {stiff_substeps}, on {stiff_springs} springs")
            }
            _ => substeps.to_string(),
        }
    }
}
