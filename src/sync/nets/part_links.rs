//! Which entities are parts, as they cease to be and come to others.

use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::query::Allow;
use bevy::prelude::*;

use super::super::state::{MassSpringState, Warnings};
use super::gather::GatheredNets;
use crate::nets::{Part, PartOf, PartState};

/// Takes note that an entity is no part any more: springs that end in it wait.
pub(in crate::sync) fn unlink_part(
    removed: On<Remove, Part>,
    mut gathered: ResMut<GatheredNets>,
    mut warnings: ResMut<Warnings>,
    mut states: Query<&mut PartState, Allow<Disabled>>,
) {
    warnings.clear(removed.entity);
    gathered.relinked_parts.insert(removed.entity);
    if let Ok(mut state) = states.get_mut(removed.entity) {
        *state = PartState { tie: state.tie.take(), ..PartState::default() };
    }
}

/// Takes note that a part is despawned: its springs go with it.
pub(in crate::sync) fn note_despawned_part(despawned: On<Despawn, Part>, mut state: ResMut<MassSpringState>) {
    state.despawned.insert(despawned.entity);
}

/// Takes note that a part is one of another net.
pub(in crate::sync) fn relink_part(
    inserted: On<Insert, PartOf>,
    mut states: Query<&mut PartState, Allow<Disabled>>,
) {
    if let Ok(mut state) = states.get_mut(inserted.entity) {
        state.structure = 0;
        state.is_held = false;
    }
}
