//! Snapshots, what rollback libraries save, and restarts.

use bevy::prelude::*;

use crate::sync;

pub use crate::sync::{MassSpringState, Snapshot, SnapshotError};

/// Takes a [`Snapshot`] as the initial state.
///
/// Without it the initial state of each particle, spring and plane is that of the first tick that sees it.
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

/// Puts all particles, springs and planes back into their initial state, bit for bit.
///
/// It is the [`Snapshot`] that [`TakeInitialState`] took last, or what each entity was in the first tick that saw it.
/// What was reported and measured of the last tick is reset, the tick counter with it. What follows repeats what
/// followed before, to the last bit. Entities that were despawned in the meantime stay so.
#[derive(Debug, Clone, Copy, Default)]
pub struct RestoreInitialState;

impl Command for RestoreInitialState {
    type Out = ();

    fn apply(self, world: &mut World) {
        sync::restore_initial_state(world);
    }
}
