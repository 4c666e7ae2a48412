//! The step: which scheme runs, in how many substeps, and how long it took.

use std::time::Duration;

use bevy::platform::time::Instant;
use bevy::prelude::*;

use crate::collider::{CollisionSettings, Contact};
use crate::environment::{Environment, Gusts};
use crate::report::{SpringForces, TickReport};
use crate::settings::{Dimensions, SleepSettings, SolverSettings};
use crate::solver::{
    self, MAX_SUBSTEPS, Measurements, PairRules, Plan, Sleep, StepSettings, SubstepMode, Version, measure,
    step,
};

use super::Simulation;
use super::gather::Gathered;
use super::state::MassSpringState;
use super::touching::Requests;

/// Runs the tick.
pub(super) fn run_step(
    mut state: ResMut<MassSpringState>,
    mut simulation: ResMut<Simulation>,
    mut configuration: Configuration,
    gathered: Res<Gathered>,
    mut report: ResMut<TickReport>,
    (contacts, touching): (Option<Res<Messages<Contact>>>, Requests),
    forces: Option<Res<SpringForces>>,
    measurements: Option<ResMut<Measurements>>,
) {
    let start = Instant::now();
    let (state, simulation) = (&mut *state, &mut *simulation);
    let mut complaints = Vec::new();
    let settings = configuration.settings(&mut complaints);
    let Simulation { inputs, caches, outputs, version, touching_is_read, .. } = simulation;
    *touching_is_read = touching.any();
    outputs.record_contacts = contacts.is_some() || *touching_is_read;
    outputs.record_forces = forces.is_some();
    step(&mut state.solver, inputs, caches, outputs, &settings);
    state.version = Version::new();
    *version = state.version;
    let Plan { integrator, substeps, stiff_substeps, stiff_springs } = outputs.plan;
    report.tick += 1;
    (report.integrator, report.substeps) = (integrator, substeps);
    (report.stiff_substeps, report.stiff_springs) = (stiff_substeps, stiff_springs);
    report.particles = state.particles.live() - state.nets.quarantined;
    report.asleep = state.solver.asleep_count();
    report.springs = state.springs.live();
    report.contacts = outputs.contact_count;
    report.gather_time = gathered.start.map_or(Duration::ZERO, |gather_start| start - gather_start);
    report.step_time = start.elapsed();
    if settings.substeps == SubstepMode::Auto && substeps >= MAX_SUBSTEPS {
        let bounds = caches.frequency_bounds(&state.solver, settings.viscosity);
        complaints.push(format!(
            "the springs are so stiff for their masses that {MAX_SUBSTEPS} substeps a tick may not suffice (angular \
             frequency up to {:e} rad/s); the simulation may diverge",
            bounds.angular_frequency
        ));
    }
    configuration.log(complaints);
    if let Some(mut measurements) = measurements {
        *measurements = measure(&state.solver, settings.gravity);
    }
}

/// The user's settings.
#[derive(bevy::ecs::system::SystemParam)]
pub(super) struct Configuration<'w, 's> {
    time: Res<'w, Time>,
    environment: Res<'w, Environment>,
    solver: Res<'w, SolverSettings>,
    dimensions: Res<'w, Dimensions>,
    collisions: Res<'w, CollisionSettings>,
    sleep: Res<'w, SleepSettings>,
    /// What was logged last, so that it is logged once.
    logged: Local<'s, Option<String>>,
}

impl Configuration<'_, '_> {
    /// The settings of this tick; bad ones are replaced and complained of.
    fn settings(&self, complaints: &mut Vec<String>) -> StepSettings {
        let mut environment = *self.environment;
        if let Err(problem) = environment.validate() {
            complaints.push(format!("Environment: {problem}; neither gravity nor viscosity nor air acts"));
            let (gravity, viscosity, air_density) = (Vec3::ZERO, 0.0, 0.0);
            environment = Environment { gravity, viscosity, air_density, gusts: None, ..environment };
        }
        let mut collisions = *self.collisions;
        if let Err(problem) = collisions.validate() {
            complaints
                .push(format!("CollisionSettings: {problem}; particles do not collide with each other"));
            collisions.particles = false;
        }
        if *self.dimensions == Dimensions::Two {
            environment.gravity.z = 0.0;
            environment.wind.z = 0.0;
        }
        let mut sleep = *self.sleep;
        if let Err(problem) = sleep.validate() {
            complaints.push(format!("SleepSettings: {problem}; nothing sleeps"));
            sleep.enabled = false;
        }
        let SolverSettings { integrator, substeps } = *self.solver;
        if substeps == SubstepMode::Fixed(0) {
            complaints
                .push("SolverSettings: substeps is Fixed(0), expected at least 1; one is run".to_owned());
        }
        let CollisionSettings { ground, particles, springs, restitution, friction } = collisions;
        StepSettings {
            integrator,
            substeps,
            time_step: self.time.delta_secs(),
            gravity: environment.effective_gravity(),
            viscosity: environment.effective_viscosity(),
            wind: environment.wind,
            air_density: environment.effective_air_density(),
            gusts: environment.gusts.map(|gusts| self.gusts(gusts)),
            collide_with_colliders: ground,
            pair_rules: particles.then_some(PairRules { restitution, friction }),
            sleep: sleep.enabled.then_some(Sleep { speed: sleep.speed, delay: sleep.delay }),
            collide_springs: springs,
            is_flat: *self.dimensions == Dimensions::Two,
        }
    }

    /// The gusts, which stay in the plane of motion.
    fn gusts(&self, Gusts { strength, length, time, seed }: Gusts) -> solver::Gusts {
        let z = if *self.dimensions == Dimensions::Two { 0.0 } else { strength };
        solver::Gusts { strength: Vec3::new(strength, strength, z), length, time, seed }
    }

    /// Logs complaints that were not logged in the last tick.
    fn log(&mut self, complaints: Vec<String>) {
        let complaint = (!complaints.is_empty()).then(|| complaints.join("; "));
        if *self.logged != complaint {
            if let Some(complaint) = &complaint {
                log::warn!("{complaint}");
            }
            *self.logged = complaint;
        }
    }
}
