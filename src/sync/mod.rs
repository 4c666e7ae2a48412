//! The only module that imports both sides: the ECS and the solver's arrays.
//!
//! ```text
//! observers ──► state      registries: which entities exist, in the order of spawning
//! Gather        gather     slots for what was added; components ──► arrays
//! Step          run        arrays ──► arrays
//! Scatter       scatter    arrays ──► components, messages, reports
//! ```
//!
//! Each particle and each spring carries its slot in a component of its own, so that a tick copies
//! whole tables without looking anything up. [`MassSpringState`] is all that one tick hands on to the next beside
//! the components; everything else here can be dropped.

mod adopt;
mod bends;
mod colliders;
mod contact_properties;
mod easing;
mod exemptions;
mod gather;
mod hierarchy;
mod nets;
mod options;
mod records;
mod registry;
mod relocate;
mod rigid;
mod run;
mod scatter;
mod slots;
mod snapshot;
mod springs;
mod state;
mod teleport;
mod touching;
mod view;

use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::intern::Interned;
use bevy::ecs::schedule::ScheduleLabel;
use bevy::prelude::*;

use crate::bend::Bend;
use crate::collider::move_colliders;
use crate::nets::change_materials;
use crate::particle::{Particle, Quarantined, SimulationOrder};
use crate::schedule::MassSpringSystems;
use crate::solver::particles::Vectors;
use crate::solver::{Caches, Inputs, Outputs, Version};
use crate::spring::{Broken, Spring};

#[cfg(feature = "interpolation")]
pub(crate) use easing::keep_untouched;
use registry::Slot;
pub(crate) use relocate::{Scope, relocate};
pub use snapshot::{Snapshot, SnapshotError};
pub(crate) use snapshot::{restore_initial_state, take_initial_state};
pub use state::MassSpringState;

/// What the stages of a tick share beside the state.
#[derive(Resource, Default)]
pub(crate) struct Simulation {
    inputs: Inputs,
    caches: Caches,
    outputs: Outputs,
    /// Slots that have no past: a pinned particle there did not move to where it is.
    fresh: Vec<bool>,
    /// Positions before the solver's origin was moved in this tick; empty if it was not.
    unshifted: Vectors,
    /// How far it was moved then, m.
    shift: Vec3,
    /// The version of the state that the slots of the entities belong to.
    version: Version,
    /// Whether anything reads which entities have begun and ceased to touch in this tick.
    touching_is_read: bool,
}

/// Adds the three stages to `schedule`, and the observers that keep the registries.
pub(crate) fn build(app: &mut App, schedule: Interned<dyn ScheduleLabel>) {
    app.init_resource::<Simulation>()
        .init_resource::<MassSpringState>()
        .init_resource::<state::Warnings>()
        .init_resource::<snapshot::InitialState>()
        .init_resource::<gather::Gathered>()
        .init_resource::<colliders::GatheredColliders>()
        .init_resource::<nets::GatheredNets>();
    // Refused where such entities exist already; then the observers below see to it.
    let _ = app.try_register_required_components::<Particle, Slot<Particle>>();
    let _ = app.try_register_required_components::<Spring, Slot<Spring>>();
    let _ = app.try_register_required_components::<Bend, Slot<Bend>>();
    state::register_existing(app.world_mut());
    nets::register_existing_nets(app.world_mut());
    app.add_observer(state::register::<Particle>)
        .add_observer(state::unregister::<Particle>)
        .add_observer(state::note_despawned)
        .add_observer(state::register::<Spring>)
        .add_observer(state::unregister::<Spring>)
        .add_observer(state::register::<Bend>)
        .add_observer(state::unregister::<Bend>)
        .add_observer(state::mark_outdated::<Add, Quarantined>)
        .add_observer(state::mark_outdated::<Remove, Quarantined>)
        .add_observer(state::note_broken)
        .add_observer(state::mark_outdated::<Remove, Broken>)
        .add_observer(state::mark_outdated::<Add, Disabled>)
        .add_observer(state::mark_outdated::<Remove, Disabled>)
        .add_observer(state::mark_outdated::<Insert, SimulationOrder>)
        .add_observer(colliders::register_collider)
        .add_observer(colliders::sort_colliders)
        .add_observer(colliders::unregister_collider)
        .add_observer(nets::register_net)
        .add_observer(nets::mark_replaced)
        .add_observer(nets::unregister_net)
        .add_observer(nets::untie)
        .add_observer(nets::retie)
        .add_observer(nets::unlink_part)
        .add_observer(nets::relink_part)
        .add_observer(nets::note_despawned_part)
        .add_systems(
            schedule,
            (
                (
                    (
                        change_materials,
                        nets::give_breaking,
                        nets::give_yielding,
                        nets::gather_parts,
                        nets::tie_attachments,
                        nets::turn_winches,
                    )
                        .chain()
                        .run_if(nets::any_nets),
                    move_colliders,
                    gather::gather,
                )
                    .chain()
                    .in_set(MassSpringSystems::Gather),
                run::run_step.in_set(MassSpringSystems::Step),
                (
                    scatter::scatter,
                    touching::publish_touching.run_if(touching::is_requested),
                    (nets::scatter_nets, nets::scatter_parts).chain().run_if(nets::any_nets),
                )
                    .chain()
                    .in_set(MassSpringSystems::Scatter),
            ),
        );
}
