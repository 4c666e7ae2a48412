//! When the simulation runs: the stages of a tick, and the schedule that holds them.

use bevy::ecs::intern::Interned;
use bevy::ecs::schedule::ScheduleLabel;
use bevy::prelude::*;

/// The stages of a tick, chained in this order, in the schedule of
/// [`MassSpringPlugin`](crate::MassSpringPlugin).
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum MassSpringSystems {
    /// Components are copied into the solver.
    Gather,
    /// The solver integrates one tick.
    Step,
    /// The solver's state is copied back into the components; messages are sent.
    Scatter,
}

/// All stages: one condition for them costs less than one for each.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct Tick;

/// The schedule of the simulation. The plugins that belong to a tick read it in `Plugin::finish`, where
/// the order of plugins does not matter, so that none of them takes a schedule of its own.
#[derive(Resource, Clone, Copy)]
pub(crate) struct SimulationSchedule(pub Interned<dyn ScheduleLabel>);

/// The schedule of the simulation; `None` in an app without [`MassSpringPlugin`](crate::MassSpringPlugin).
pub(crate) fn simulation_schedule(app: &App) -> Option<Interned<dyn ScheduleLabel>> {
    app.world().get_resource::<SimulationSchedule>().map(|schedule| schedule.0)
}

/// Whether a tick runs: in a schedule that runs each frame, such as `Update`, time may be paused.
pub(crate) fn time_advances(time: Res<Time>) -> bool {
    !time.delta().is_zero()
}
