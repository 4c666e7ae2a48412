//! The only code that knows both sides: the ECS and the solver's arrays.
//!
//! ```text
//! observers ──► rosters (who exists, in order of spawning)
//! Gather        gather::gather      numbering: somebody came or left? slots for them
//!                                   components ──► arrays
//! Step          run::run_step       arrays ──► arrays
//! Scatter       scatter::scatter    arrays ──► components, messages, reports
//! ```
//!
//! Each particle and each spring carries its slot in a component of its own, so that a tick copies
//! whole tables without looking anything up.

mod easing;
mod gather;
mod hierarchy;
mod index;
mod numbering;
mod planes;
mod restore;
mod roster;
mod run;
mod scatter;

use bevy::ecs::intern::Interned;
use bevy::ecs::schedule::ScheduleLabel;
use bevy::prelude::*;

use crate::MassSpringSystems;
use crate::particle::{Particle, Quarantined};
use crate::solver::SolverState;
use crate::solver::stability::{Components, FrequencyBounds};
use crate::spring::Spring;

pub(crate) use restore::{restore_initial_state, take_initial_state};
use roster::Slot;

/// The solver's state, and bounds on its frequencies.
#[derive(Resource, Default)]
pub(crate) struct Simulation {
    state: SolverState,
    bounds: FrequencyBounds,
    /// The parts of the net, once somebody has asked for them since `bounds` were computed.
    components: Option<Components>,
    /// A spring, or a mass, has changed since `bounds` were computed.
    bounds_are_stale: bool,
    /// Particles have come or gone since then, whose springs, if any, did not: that matters to the bounds
    /// only in a viscous medium.
    lone_particles_changed: bool,
}

/// Adds the three stages to `schedule`, and the observers that keep the rosters.
pub(crate) fn build(app: &mut App, schedule: Interned<dyn ScheduleLabel>) {
    app.init_resource::<Simulation>()
        .init_resource::<index::Index>()
        .init_resource::<gather::Gathered>()
        .init_resource::<planes::GatheredPlanes>();
    // Refused where such entities exist already; then the observers below see to it.
    let _ = app.try_register_required_components::<Particle, Slot<Particle>>();
    let _ = app.try_register_required_components::<Spring, Slot<Spring>>();
    index::enroll_existing(app.world_mut());
    app.add_observer(index::enroll::<Particle>)
        .add_observer(index::leave::<Particle>)
        .add_observer(index::enroll::<Spring>)
        .add_observer(index::leave::<Spring>)
        .add_observer(index::mark_changed::<Add, Quarantined>)
        .add_observer(index::mark_changed::<Remove, Quarantined>)
        .add_observer(planes::enroll_plane)
        .add_observer(planes::leave_plane)
        .add_systems(
            schedule,
            (
                gather::gather.in_set(MassSpringSystems::Gather),
                run::run_step.in_set(MassSpringSystems::Step),
                scatter::scatter.in_set(MassSpringSystems::Scatter),
            ),
        );
}
