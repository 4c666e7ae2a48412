//! Slots for what was added, and empty slots for what was removed; all anew only when too many are empty.

use bevy::ecs::entity::Entities;
use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::query::Allow;
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;

use crate::bend::Bend;
use crate::collider::ParticleCollider;
use crate::nets::{PartOf, PartState, ParticleNet};
use crate::parameter::{self, InvalidParameter};
use crate::particle::{AppliedForce, Particle, ParticleVelocity, Pinned, Quarantined, SimulationOrder};
use crate::settings::OrphanedSprings;
use crate::solver;
use crate::spring::{Broken, Spring};

use super::Simulation;
use super::bends::BendData;
use super::nets::{GatheredNets, NetData};
use super::registry::{Entry, Slot};
use super::snapshot::InitialState;
use super::springs::{Edits, parameters, resolve_spring};
use super::state::{MassSpringState, Warnings};

/// All slots are assigned anew when more than one in this number is empty, or if as many were added or removed in
/// one tick.
const MAX_FRAGMENTATION: usize = 4;

/// All that the assignment reads of a particle.
pub(super) type ParticleData = (
    &'static Particle,
    &'static Transform,
    &'static ParticleVelocity,
    Option<&'static AppliedForce>,
    (Has<Pinned>, Has<Quarantined>, Has<Disabled>),
    &'static mut Slot<Particle>,
);

type SpringData = (&'static Spring, (Has<Disabled>, Has<Broken>), &'static mut Slot<Spring>);

/// All nets.
pub(super) type NetQuery<'w, 's> = Query<'w, 's, NetData, Allow<Disabled>>;

/// A part, and the net of which it is one.
pub(super) type PartOfNet = (&'static PartOf, &'static mut PartState);

type IsRegistered = Or<(With<Slot<Particle>>, With<Slot<Spring>>, With<Slot<Bend>>, With<ParticleCollider>)>;

/// All entities that may have a slot.
#[derive(SystemParam)]
pub(super) struct Candidates<'w, 's> {
    pub particles: Query<'w, 's, ParticleData, Allow<Disabled>>,
    pub springs: Query<'w, 's, SpringData, Allow<Disabled>>,
    pub nets: NetQuery<'w, 's>,
    pub parts: Query<'w, 's, PartOfNet, Allow<Disabled>>,
    pub all_nets: Query<'w, 's, Entity, (With<ParticleNet>, Allow<Disabled>)>,
    pub bends: Query<'w, 's, BendData, Allow<Disabled>>,
    pub orders: Query<'w, 's, &'static SimulationOrder, Allow<Disabled>>,
    /// All of these, and the colliders.
    pub all: Query<'w, 's, (Entity, Has<ParticleCollider>), (IsRegistered, Allow<Disabled>)>,
}

/// What the assignment writes beside the state.
#[derive(SystemParam)]
pub(super) struct Bookkeeping<'w, 's> {
    pub warnings: ResMut<'w, Warnings>,
    pub initial: ResMut<'w, InitialState>,
    pub orphaned_springs: Res<'w, OrphanedSprings>,
    pub commands: Commands<'w, 's>,
    pub entities: &'w Entities,
}

pub(super) fn check_particle(
    particle: &Particle,
    transform: &Transform,
    velocity: &ParticleVelocity,
) -> Result<(), InvalidParameter> {
    particle.validate()?;
    parameter::finite("translation", transform.translation)?;
    parameter::finite("velocity", velocity.0)
}

/// Gives slots to what was added, and takes them from what was removed.
pub(super) fn refresh_slots(
    state: &mut MassSpringState,
    simulation: &mut Simulation,
    mut edits: Edits,
    candidates: Candidates,
    nets: &mut GatheredNets,
    bookkeeping: &mut Bookkeeping,
) {
    let was_replaced = state.version != simulation.version;
    nets.check_nets(state, was_replaced, &candidates.nets);
    let mut assignment = Assignment { state, simulation, candidates, bookkeeping };
    if was_replaced {
        assignment.adopt();
        edits.retry = true;
    }
    let (net_particles, net_springs) = assignment.pending_nets();
    let Assignment { state, candidates: Candidates { particles, .. }, .. } = &mut assignment;
    let is_corrected = |entity: &Entity| {
        particles.get(*entity).is_ok_and(|(particle, transform, velocity, ..)| {
            check_particle(particle, transform, velocity).is_ok()
        })
    };
    state.is_outdated |= state.excluded.iter().any(is_corrected);
    state.is_outdated |= state.particles.is_fragmented(net_particles, MAX_FRAGMENTATION);
    state.is_outdated |= state.springs.is_fragmented(net_springs, MAX_FRAGMENTATION);
    state.is_outdated |= state.bends.all.is_fragmented(0, MAX_FRAGMENTATION);
    edits.retry |= state.bends.all.pending() > 0;
    let pending = state.particles.pending() + state.springs.pending() + state.broken.len();
    let any_pending = pending > 0 || state.nets.is_pending;
    if state.is_outdated {
        assignment.assign_all();
    } else if any_pending || edits.retry {
        assignment.update(&edits);
    }
    if !assignment.state.despawned.is_empty() {
        assignment.state.despawned.clear();
    }
    nets.refresh(assignment.state);
}

/// The slots and the entities that get them.
pub(super) struct Assignment<'a, 'w, 's, 'b, 't> {
    pub state: &'a mut MassSpringState,
    pub simulation: &'a mut Simulation,
    pub candidates: Candidates<'w, 's>,
    pub bookkeeping: &'a mut Bookkeeping<'b, 't>,
}

impl Assignment<'_, '_, '_, '_, '_> {
    /// Assigns all slots in the order of the registries.
    fn assign_all(&mut self) {
        let state = &mut *self.state;
        state.is_outdated = false;
        state.excluded.clear();
        state.pending.clear();
        state.broken.clear();
        self.simulation.fresh.clear();
        let old_entities = std::mem::take(&mut state.particles.slots);
        let old_nets = self.take_nets();
        let state = &mut *self.state;
        let old_springs = state.springs.slots.iter().copied().zip(old_nets.springs.iter().copied());
        let old_springs: Vec<(Entity, solver::Spring)> =
            old_springs.filter(|(entity, _)| self.candidates.springs.contains(*entity)).collect();
        state.particles.reset_slots();
        state.springs.reset_slots();
        let past_bends = self.past_bends();
        let state = &mut *self.state;
        state.bends.reset_slots();
        let pulls = state.solver.take_pulls();
        state.solver.clear();
        let order_of =
            |entry: &Entry| self.candidates.orders.get(entry.entity).map_or(u64::MAX, |order| order.0);
        if !self.candidates.orders.is_empty() {
            state.particles.entries.sort_by_cached_key(order_of);
            state.springs.entries.sort_by_cached_key(order_of);
            state.bends.all.entries.sort_by_cached_key(order_of);
        }

        let mut new_slots = vec![None; old_entities.len()];
        self.add_particles(|entity, old, new| {
            let old = old.filter(|old| old_entities.get(*old) == Some(&entity))?;
            new_slots[old] = Some(new as u32);
            Some(old_nets.positions.get(old))
        });
        self.add_nets(old_nets, &mut new_slots);
        self.place_parts();
        self.add_new_springs();
        self.remember_springs(&old_springs);
        self.add_bends(false);
        self.remember_bends(&past_bends);
        self.state.solver.renumber_contacts(&new_slots);
        self.state.solver.put_back_pulls(pulls, &new_slots);
        if let Some(order) = self.simulation.caches.better_order(&self.state.solver) {
            self.reorder(&order);
        }
    }

    /// Springs that were in the simulation before go on from the parameters that they had in the last tick.
    fn remember_springs(&mut self, old_springs: &[(Entity, solver::Spring)]) {
        for (entity, past) in old_springs {
            let slot = self.candidates.springs.get(*entity).ok().and_then(|(.., slot)| slot.get());
            if let Some(slot) = slot {
                self.state.solver.set_past_spring(slot, *past);
            }
        }
    }

    /// Gives each particle the slot of its place in `order`.
    fn reorder(&mut self, order: &[u32]) {
        let mut new_slots = vec![0; order.len()];
        let (slots, fresh) = (self.state.particles.slots.clone(), self.simulation.fresh.clone());
        for (new, old) in order.iter().map(|old| *old as usize).enumerate() {
            new_slots[old] = new as u32;
            self.state.particles.slots[new] = slots[old];
            self.simulation.fresh[new] = fresh[old];
            if let Ok((.., mut slot)) = self.candidates.particles.get_mut(slots[old]) {
                slot.set(Some(new));
            }
        }
        self.state.solver.renumber(&new_slots);
        let places = self.state.nets.entries.iter_mut().filter_map(|net| net.place.as_mut());
        places.for_each(|place| place.renumber(&new_slots));
        self.place_parts();
    }

    /// Empties the slots of what was removed and appends what was added.
    fn update(&mut self, edits: &Edits) {
        let (waited, present) = (self.state.pending.len(), self.state.particles.slots.len());
        for slot in std::mem::take(&mut self.state.particles.removed) {
            self.remove_particle(slot as usize);
        }
        for slot in std::mem::take(&mut self.state.springs.removed) {
            self.remove_spring(slot as usize);
        }
        for spring in std::mem::take(&mut self.state.broken) {
            self.suspend(spring);
        }
        for &spring in &edits.relinked {
            self.suspend(spring);
        }
        let old_nets = self.remove_nets();
        self.remove_bends(&edits.relinked_bends);
        self.add_particles(|_, _, _| None);
        let any_nets = self.state.nets.is_pending;
        self.add_nets(old_nets, &mut []);
        if any_nets || edits.retry {
            self.place_parts();
        }
        // Springs that have been pending for long stay so where no particle was added for which they might wait.
        let any_added = self.state.particles.slots.len() > present;
        let first = if any_added || edits.retry || !self.state.despawned.is_empty() { 0 } else { waited };
        for spring in self.state.pending.split_off(first) {
            self.add_spring(spring);
        }
        self.add_new_springs();
        self.add_bends(first == 0);
    }

    /// Empties the slot of a particle; its springs and bends are pending from now on.
    fn remove_particle(&mut self, slot: usize) {
        if !self.state.particles.vacate(slot) {
            return;
        }
        let springs = self.simulation.caches.springs_at(&self.state.solver, slot);
        self.state.solver.remove_particle(slot);
        self.suspend_bends_at(slot);
        for spring in springs {
            self.suspend(self.state.springs.slots[spring]);
        }
    }

    /// Takes a spring out of its slot; it is pending from now on.
    pub(super) fn suspend(&mut self, entity: Entity) {
        let Ok((.., mut slot)) = self.candidates.springs.get_mut(entity) else { return };
        let old = slot.get();
        slot.set(None);
        if let Some(old) = old {
            self.remove_spring(old);
            self.state.pending.push(entity);
        }
    }

    fn remove_spring(&mut self, slot: usize) {
        if self.state.springs.vacate(slot) {
            self.state.solver.remove_spring(slot);
        }
    }

    /// Processes the particles that were added since the last time. `past(entity, old slot, new slot)` is where one
    /// was in the last tick.
    fn add_particles(&mut self, mut past: impl FnMut(Entity, Option<usize>, usize) -> Option<Vec3>) {
        let Bookkeeping { warnings, initial, .. } = &mut *self.bookkeeping;
        let state = &mut *self.state;
        let mut entries = state.particles.take_new();
        entries.retain_mut(|entry| {
            let Ok((particle, transform, velocity, force, flags, mut slot)) =
                self.candidates.particles.get_mut(entry.entity)
            else {
                return false;
            };
            if !entry.is_valid(&slot) {
                return false;
            }
            let (is_pinned, is_quarantined, is_disabled) = flags;
            let old_slot = slot.get();
            slot.set(None);
            if is_quarantined || is_disabled {
                return true;
            }
            if let Err(problem) = check_particle(particle, transform, velocity) {
                state.excluded.push(entry.entity);
                let entity = entry.entity;
                let message = format_args!("particle {entity} is left out of the simulation: {problem}");
                warnings.warn_once(entity, message);
                return true;
            }
            warnings.clear(entry.entity);
            if !std::mem::replace(&mut entry.is_recorded, true) {
                initial.record_particle(entry.entity, (particle, transform, velocity, force, is_pinned));
            }
            let new_slot = state.particles.slots.len();
            slot.set(Some(new_slot));
            let last_position = past(entry.entity, old_slot, new_slot);
            self.simulation.fresh.push(last_position.is_none());
            state.particles.slots.push(entry.entity);
            // Positions and velocities are filled in by the gather.
            let position = last_position.unwrap_or(transform.translation - state.solver.origin);
            let inverse_mass = if is_pinned { 0.0 } else { 1.0 / particle.mass };
            state.solver.add_particle(position, Vec3::ZERO, inverse_mass, particle.radius);
            true
        });
        state.particles.put_back(entries);
    }

    fn add_new_springs(&mut self) {
        let mut entries = self.state.springs.take_new();
        entries.retain_mut(|entry| {
            let Ok((spring, _, mut slot)) = self.candidates.springs.get_mut(entry.entity) else {
                return false;
            };
            if !entry.is_valid(&slot) {
                return false;
            }
            if !std::mem::replace(&mut entry.is_recorded, true) {
                self.bookkeeping.initial.record_spring(entry.entity, *spring);
            }
            slot.set(None);
            self.add_spring(entry.entity);
            true
        });
        self.state.springs.put_back(entries);
    }

    /// Gives a spring a slot, or leaves it pending.
    fn add_spring(&mut self, entity: Entity) {
        let Candidates { particles, parts, springs, .. } = &mut self.candidates;
        let Ok((spring, (is_disabled, is_broken), mut slot)) = springs.get_mut(entity) else { return };
        if slot.get().is_some() {
            return;
        }
        let Bookkeeping { warnings, orphaned_springs, commands, .. } = &mut *self.bookkeeping;
        let is_orphan = spring.particles.iter().any(|end| self.state.despawned.contains(end));
        if is_orphan && **orphaned_springs == OrphanedSprings::Despawn {
            commands.entity(entity).try_despawn();
            return;
        }
        if is_disabled || is_broken {
            self.state.pending.push(entity);
            return;
        }
        match resolve_spring(spring, particles, parts) {
            Ok(Some(ends)) => {
                slot.set(Some(self.state.springs.slots.len()));
                self.state.springs.slots.push(entity);
                self.state.solver.add_spring(ends, parameters(spring));
                warnings.clear(entity);
            }
            Ok(None) => {
                warnings.clear(entity);
                self.state.pending.push(entity);
            }
            Err(problem) => {
                let message = format_args!("spring {entity} is left out of the simulation: {problem}");
                warnings.warn_once(entity, message);
                self.state.pending.push(entity);
            }
        }
    }
}
