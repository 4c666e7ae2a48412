//! Restart: the initial state of every particle and spring, and the commands that take and restore it.

use bevy::prelude::*;

use crate::sync;

/// Records the present state of all particles and springs as their initial state.
///
/// The plugin does this by itself for each particle and spring in the first tick that sees it.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_mass_spring::prelude::*;
/// fn checkpoint(mut commands: Commands) {
///     commands.queue(TakeInitialState);
/// }
/// ```
#[derive(Debug, Clone, Copy, Default)]
pub struct TakeInitialState;

impl Command for TakeInitialState {
    type Out = ();

    fn apply(self, world: &mut World) {
        sync::take_initial_state(world);
    }
}

/// Puts all particles and springs back into their initial state, bit for bit.
///
/// Positions, velocities, masses, radii, applied forces, pins and the parameters of springs return to
/// what they were; [quarantined](crate::particle::Quarantined) particles come back; what was
/// reported and measured of the last tick is reset, the tick counter with it. What runs after it repeats what ran before it, to the last bit. Entities that
/// were despawned in the meantime stay so.
#[derive(Debug, Clone, Copy, Default)]
pub struct RestoreInitialState;

impl Command for RestoreInitialState {
    type Out = ();

    fn apply(self, world: &mut World) {
        sync::restore_initial_state(world);
    }
}
