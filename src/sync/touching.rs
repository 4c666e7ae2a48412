//! Which entities have begun and ceased to touch: messages and triggered events.

use bevy::ecs::system::SystemParam;
use bevy::prelude::*;

use crate::collider::{ContactEnded, ContactEvents, ContactStarted};
use crate::particle::Particle;
use crate::solver::ContactPartner;

use super::Simulation;
use super::colliders::GatheredColliders;
use super::registry::Slot;
use super::state::MassSpringState;

/// Where messages or events of this are asked for.
#[derive(SystemParam)]
pub(super) struct Requests<'w, 's> {
    started: Option<Res<'w, Messages<ContactStarted>>>,
    ended: Option<Res<'w, Messages<ContactEnded>>>,
    marked: Query<'w, 's, (), With<ContactEvents>>,
}

impl Requests<'_, '_> {
    /// Whether anything reads them.
    pub fn any(&self) -> bool {
        self.started.is_some() || self.ended.is_some() || !self.marked.is_empty()
    }
}

/// Whether events are due or stored pairs are to be dropped.
pub(super) fn is_requested(simulation: Res<Simulation>, state: Res<MassSpringState>) -> bool {
    simulation.touching_is_read || !state.touching.is_empty()
}

/// Publishes the pairs that touch in this tick and did not in the last one, and those that did and do not any more.
pub(super) fn publish_touching(
    mut state: ResMut<MassSpringState>,
    simulation: Res<Simulation>,
    colliders: Res<GatheredColliders>,
    (mut started, mut ended): (
        Option<ResMut<Messages<ContactStarted>>>,
        Option<ResMut<Messages<ContactEnded>>>,
    ),
    (marked, slots): (Query<(), With<ContactEvents>>, Query<&Slot<Particle>>),
    mut commands: Commands,
) {
    let entity_in = |slot: usize| state.particles.slots.get(slot).copied();
    let pair = |slot: usize, other: ContactPartner| {
        let entity = entity_in(slot)?;
        Some(match other {
            ContactPartner::Collider(number) => [entity, *colliders.entities.get(number)?],
            ContactPartner::Particle(slot) => ordered([entity, entity_in(slot)?]),
        })
    };
    let records = simulation.outputs.contacts.iter();
    let mut now: Vec<[Entity; 2]> = records.filter_map(|record| pair(record.slot, record.other)).collect();
    if state.solver.asleep_count() > 0 {
        // What sleeps is not examined: it touches what it touched.
        let rests = |entity: Entity| match state.nets.get(entity).map(|net| &net.place) {
            Some(Some(place)) => state.solver.rests(place.slots()),
            Some(None) => false,
            None => match slots.get(entity).map(Slot::get) {
                Ok(slot) => slot.is_some_and(|slot| state.solver.rests([slot].into_iter())),
                Err(_) => colliders.entities.contains(&entity),
            },
        };
        now.extend(state.touching.iter().filter(|pair| pair.iter().all(|entity| rests(*entity))));
    }
    now.sort_unstable();
    now.dedup();
    let before = std::mem::replace(&mut state.touching, now);
    let now = &state.touching;
    for &[entity, other] in now.iter().filter(|pair| before.binary_search(pair).is_err()) {
        if let Some(messages) = &mut started {
            messages.write(ContactStarted { entity, other });
        }
        for [entity, other] in both_ways([entity, other]) {
            if marked.contains(entity) {
                commands.trigger(ContactStarted { entity, other });
            }
        }
    }
    for &[entity, other] in before.iter().filter(|pair| now.binary_search(pair).is_err()) {
        if let Some(messages) = &mut ended {
            messages.write(ContactEnded { entity, other });
        }
        for [entity, other] in both_ways([entity, other]) {
            if marked.contains(entity) {
                commands.trigger(ContactEnded { entity, other });
            }
        }
    }
}

/// Two particles or nets in the order in which a pair of them is stored: which of two nets has the lower slot changes as
/// they grow.
pub(super) fn ordered([one, other]: [Entity; 2]) -> [Entity; 2] {
    if other < one { [other, one] } else { [one, other] }
}

/// A pair as each of the two sees it; once if it is a net that touches itself.
fn both_ways([entity, other]: [Entity; 2]) -> impl Iterator<Item = [Entity; 2]> {
    let number = if entity == other { 1 } else { 2 };
    [[entity, other], [other, entity]].into_iter().take(number)
}
