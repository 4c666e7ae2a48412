//! sync
use bevy::prelude::*;
pub(crate) fn take_initial_state(_world: &mut World) {}
pub(crate) fn restore_initial_state(_world: &mut World) {}
