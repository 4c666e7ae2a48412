//! A net under one of the crate's schemes, and what its ticks cost.

use std::time::Instant;

use bevy::math::DVec3;
use bevy_mass_spring::settings::{Integrator, SolverSettings, SubstepMode};
use bevy_mass_spring::solver::{Integrator, Solver, StepSettings};

use crate::net::{Net, gravity};

/// Every named scheme, and `Auto`.
pub fn integrators() -> impl Iterator<Item = Integrator> {
    Integrator::named().into_iter().map(Integrator::from).chain([Integrator::Auto])
}

/// A run.
pub struct Simulation {
    pub state: Solver,
    pub settings: StepSettings,
    milliseconds: Vec<f64>,
}

impl Simulation {
    /// `net` in ticks of `time_step` seconds under gravity.
    pub fn new(net: &Net, integrator: Integrator, substeps: SubstepMode, time_step: f64) -> Self {
        let time_step = time_step as f32;
        let settings = SolverSettings { integrator, substeps };
        let (scheme, substeps) = settings.choose(&net.frequency_bounds(), time_step);
        let settings = StepSettings {
            integrator: scheme,
            substeps: SubstepMode::Fixed(substeps),
            time_step,
            gravity: gravity(),
            viscosity: net.viscosity as f32,
            ..StepSettings::default()
        };
        Self { state: net.solver_state(), settings, milliseconds: Vec::new() }
    }

    /// With one substep where every step is stable, else as many as the stability bound asks for.
    pub fn stable(net: &Net, integrator: Integrator, time_step: f64) -> Self {
        let substeps = match integrator {
            Integrator::ImplicitEuler => SubstepMode::Fixed(1),
            _ => SubstepMode::Auto,
        };
        Self::new(net, integrator, substeps, time_step)
    }

    /// Runs one tick; returns its cost, ms.
    pub fn tick(&mut self) -> f64 {
        let start = Instant::now();
        self.state.step(&self.settings);
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
        self.state.particles.position.axes().iter().all(|axis| axis.iter().all(|value| value.is_finite()))
    }

    /// Kinetic, elastic and gravitational energy, J.
    pub fn energy(&self) -> f64 {
        let totals = self.state.measure(self.settings.gravity);
        totals.kinetic_energy + totals.elastic_energy + totals.gravitational_energy
    }

    /// m
    pub fn position(&self, slot: usize) -> DVec3 {
        self.state.position(slot).as_dvec3()
    }

    /// m
    pub fn positions(&self) -> Vec<DVec3> {
        (0..self.state.particle_count()).map(|slot| self.position(slot)).collect()
    }

    /// The median cost of a tick so far.
    pub fn milliseconds(&self) -> f64 {
        let mut sorted = self.milliseconds.clone();
        sorted.sort_by(f64::total_cmp);
        sorted[sorted.len() / 2]
    }

    /// What ran: `4` substeps, or, for `Auto`, the scheme that was chosen and its substeps.
    pub fn choice(&self, integrator: Integrator) -> String {
        match integrator {
            Integrator::Auto => format!("{:?}, {}", self.settings.scheme, self.settings.substeps),
            _ => self.settings.substeps.to_string(),
        }
    }
}
