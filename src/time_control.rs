//! Single-stepping while time is paused.
//!
//! Pausing itself is Bevy's: `Time<Virtual>::pause` and `unpause`.

use std::time::Duration;

use bevy::prelude::*;

/// Asks for single ticks while `Time<Virtual>` is paused.
///
/// Each request runs one tick of Bevy's fixed loop, the game's `FixedUpdate` included. Requests made
/// while time is not paused are dropped.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_mass_spring::prelude::*;
/// fn step_once(mut single_step: ResMut<SingleStep>) {
///     single_step.request();
/// }
/// ```
#[derive(Resource, Reflect, Debug, Clone, Copy, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Resource, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct SingleStep {
    requested: u32,
}

impl SingleStep {
    /// Asks for one more tick.
    pub fn request(&mut self) {
        self.requested += 1;
    }
}

/// Runs the ticks that [`SingleStep`] asks for. [`MassSpringPlugin`](crate::MassSpringPlugin) adds it.
#[derive(Debug, Clone, Copy, Default)]
pub struct SingleStepPlugin;

impl Plugin for SingleStepPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<SingleStep>().register_type::<SingleStep>().add_systems(
            RunFixedMainLoop,
            grant_single_steps.in_set(RunFixedMainLoopSystems::BeforeFixedMainLoop),
        );
    }
}

/// Adds one time step to the fixed clock for each request, which the fixed loop then runs.
pub(crate) fn grant_single_steps(
    mut single_step: ResMut<SingleStep>,
    virtual_time: Res<Time<Virtual>>,
    mut fixed_time: ResMut<Time<Fixed>>,
) {
    if single_step.requested == 0 {
        return;
    }
    if virtual_time.is_paused() {
        let requested: Duration = fixed_time.timestep() * single_step.requested;
        fixed_time.accumulate_overstep(requested);
    }
    single_step.requested = 0;
}
