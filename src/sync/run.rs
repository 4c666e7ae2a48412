//! The step: which scheme runs, in how many substeps, and how long it took.

use std::time::Duration;

use bevy::platform::time::Instant;
use bevy::prelude::*;

use crate::collider::{CollisionSettings, Contact};
use crate::diagnostics::Measurements;
use crate::environment::Environment;
use crate::report::TickReport;
use crate::settings::{SolverSettings, Substeps};
use crate::solver::stability::{Choice, Components, FrequencyBounds, MAX_SUBSTEPS};
use crate::solver::{PairRules, StepSettings, energy, step};

use super::Simulation;
use super::gather::Gathered;
use super::index::Index;

/// Runs the tick.
pub(super) fn run_step(
    mut simulation: ResMut<Simulation>,
    mut planner: Planner,
    index: Res<Index>,
    gathered: Res<Gathered>,
    mut report: ResMut<TickReport>,
    contacts: Option<Res<Messages<Contact>>>,
    measurements: Option<ResMut<Measurements>>,
) {
    let start = Instant::now();
    let simulation = &mut *simulation;
    let (settings, stiff_springs) = planner.plan(simulation);
    simulation.state.contacts.recording = contacts.is_some();
    step(&mut simulation.state, &settings);
    report.tick += 1;
    report.integrator = settings.scheme.into();
    report.substeps = settings.substeps;
    report.stiff_substeps = settings.stiff_substeps;
    report.stiff_springs = stiff_springs;
    report.particles = index.particles.live();
    report.springs = index.springs.live();
    report.contacts = simulation.state.contacts.count();
    report.gather_time = gathered.start.map_or(Duration::ZERO, |gather_start| start - gather_start);
    report.step_time = start.elapsed();
    if let Some(mut measurements) = measurements {
        *measurements = energy::totals(&simulation.state, settings.gravity).into();
    }
}

impl From<energy::Totals> for Measurements {
    fn from(totals: energy::Totals) -> Self {
        Self {
            kinetic_energy: totals.kinetic_energy,
            elastic_energy: totals.elastic_energy,
            gravitational_energy: totals.gravitational_energy,
            momentum: totals.momentum,
            max_speed: totals.max_speed,
            max_stretch: totals.max_stretch,
            mean_stretch: totals.mean_stretch,
        }
    }
}

/// The user's settings, from which a tick is planned.
#[derive(bevy::ecs::system::SystemParam)]
pub(super) struct Planner<'w, 's> {
    time: Res<'w, Time>,
    environment: Res<'w, Environment>,
    solver: Res<'w, SolverSettings>,
    collisions: Res<'w, CollisionSettings>,
    /// What was complained of last, so that it is said once.
    complaint: Local<'s, Option<String>>,
    planned_viscosity: Local<'s, f32>,
}

impl Planner<'_, '_> {
    /// The settings of this tick, and the number of springs that are stiff in it.
    fn plan(&mut self, simulation: &mut Simulation) -> (StepSettings, usize) {
        let mut complaints = Vec::new();
        let settings = self.resolve(simulation, &mut complaints);
        let complaint = (!complaints.is_empty()).then(|| complaints.join("; "));
        if *self.complaint != complaint {
            if let Some(complaint) = &complaint {
                log::warn!("{complaint}");
            }
            *self.complaint = complaint;
        }
        settings
    }

    fn resolve(
        &mut self,
        simulation: &mut Simulation,
        complaints: &mut Vec<String>,
    ) -> (StepSettings, usize) {
        let mut environment = *self.environment;
        if let Err(problem) = environment.validate() {
            complaints.push(format!("Environment: {problem}; neither gravity nor viscosity acts"));
            environment = Environment { gravity: Vec3::ZERO, viscosity: 0.0, ..environment };
        }
        let mut collisions = *self.collisions;
        if let Err(problem) = collisions.validate() {
            complaints
                .push(format!("CollisionSettings: {problem}; particles do not collide with each other"));
            collisions.particles = false;
        }
        let viscosity = environment.effective_viscosity();
        let is_stale = simulation.bounds_are_stale
            || *self.planned_viscosity != viscosity
            || simulation.lone_particles_changed && viscosity > 0.0;
        if is_stale && self.solver.wants_bounds() {
            let Simulation { state, bounds, components, .. } = simulation;
            *bounds = FrequencyBounds::of(&state.particles.inverse_mass, state.springs.listed(), viscosity);
            *components = None;
            (simulation.bounds_are_stale, simulation.lone_particles_changed) = (false, false);
            *self.planned_viscosity = viscosity;
        }
        let time_step = self.time.delta_secs();
        let choice = self.choose(simulation, time_step, viscosity);
        complaints.extend(self.substeps_complaint(&simulation.bounds, choice.substeps));
        let settings = StepSettings {
            scheme: choice.scheme,
            substeps: choice.substeps,
            stiff_substeps: choice.stiff_substeps,
            time_step,
            gravity: environment.effective_gravity(),
            viscosity,
            collide_with_planes: collisions.ground,
            pair_rules: collisions
                .particles
                .then_some(PairRules { restitution: collisions.restitution, friction: collisions.friction }),
        };
        (settings, choice.stiff_springs)
    }

    /// Chooses schemes and substeps, and says to the solver who is stiff.
    fn choose(&self, simulation: &mut Simulation, time_step: f32, viscosity: f32) -> Choice {
        let Simulation { state, bounds, components, .. } = simulation;
        let inverse_mass = &state.particles.inverse_mass;
        let find = || Components::of(inverse_mass, state.springs.listed(), viscosity);
        let choice =
            self.solver.choose_by_component(bounds, time_step, || components.get_or_insert_with(find));
        state.stiff.clear();
        if let Some(components) = components.as_ref().filter(|_| choice.stiff_substeps > 0) {
            state.stiff.extend(components.stiff_slots());
        }
        choice
    }

    /// What is wrong with the number of substeps.
    fn substeps_complaint(&self, bounds: &FrequencyBounds, substeps: u32) -> Option<String> {
        match self.solver.substeps {
            Substeps::Fixed(0) => {
                Some("SolverSettings: substeps is Fixed(0), expected at least 1; one is run".to_owned())
            }
            Substeps::Auto if substeps >= MAX_SUBSTEPS => Some(format!(
                "the springs are so stiff for their masses that {MAX_SUBSTEPS} substeps a tick may not \
                 suffice (angular frequency up to {:e} rad/s); the simulation may diverge",
                bounds.angular_frequency
            )),
            _ => None,
        }
    }
}
