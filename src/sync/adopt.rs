//! Taking over a state that was put back: its entities get the slots that it says.
//!
//! The world may differ from the one in which the state was saved: entities may be missing, new, disabled or enabled since. All these
//! changes are treated as if they happened in this tick.

use bevy::ecs::entity::EntityHashSet;
use bevy::prelude::*;

use super::registry::Slot;
use super::slots::{Assignment, Candidates};
use super::springs::copy_spring;
use super::state::{MassSpringState, RegisteredCollider};

impl Assignment<'_, '_, '_, '_, '_> {
    /// Takes over a state that was put back.
    pub(super) fn adopt(&mut self) {
        self.adopt_particles();
        let absent = self.adopt_springs();
        self.adopt_bends();
        self.adopt_colliders();
        let nets = self.candidates.all_nets.iter().collect();
        self.state.nets.adopt(nets);
        self.register_unknown();
        self.place_parts();
        self.complete_initial_state();
        self.simulation.fresh.clear();
        self.simulation.fresh.resize(self.state.particles.slots.len(), false);
        absent.into_iter().for_each(|spring| self.suspend(spring));
        self.copy_all_springs();
        self.copy_all_bends();
    }

    fn adopt_particles(&mut self) {
        let particles = &mut self.candidates.particles;
        particles.iter_mut().for_each(|(.., mut slot)| *slot = Slot::default());
        let (excluded, mut is_outdated) = (&self.state.excluded, false);
        self.state.particles.adopt(|entry, slot, is_new| {
            let Ok((.., (_, is_quarantined, is_disabled), mut to)) = particles.get_mut(entry.entity) else {
                return false;
            };
            entry.assign(&mut *to, slot);
            let is_absent = is_quarantined || is_disabled;
            is_outdated |= match slot {
                Some(_) => is_absent,
                None => !is_absent && !is_new && !excluded.contains(&entry.entity),
            };
            true
        });
        self.state.is_outdated |= is_outdated;
    }

    /// Returns the springs with a slot that are disabled or broken by now.
    fn adopt_springs(&mut self) -> Vec<Entity> {
        let springs = &mut self.candidates.springs;
        springs.iter_mut().for_each(|(.., mut slot)| *slot = Slot::default());
        let mut absent = Vec::new();
        self.state.springs.adopt(|entry, slot, _| {
            let Ok((_, (is_disabled, is_broken), mut to)) = springs.get_mut(entry.entity) else {
                return false;
            };
            entry.assign(&mut *to, slot);
            absent.extend(((is_disabled || is_broken) && slot.is_some()).then_some(entry.entity));
            true
        });
        absent
    }

    fn adopt_colliders(&mut self) {
        let all = &self.candidates.all;
        let is_collider = |entity| all.get(entity).is_ok_and(|(_, is_collider)| is_collider);
        self.state.colliders.retain(|collider| is_collider(collider.entity));
    }

    /// Registers the entities that the state does not know, as if they had just been spawned.
    fn register_unknown(&mut self) {
        let state = &mut *self.state;
        let known: EntityHashSet = state.colliders.iter().map(|collider| collider.entity).collect();
        let mut all: Vec<(Entity, bool)> = self.candidates.all.iter().collect();
        all.sort_unstable_by_key(|(entity, _)| entity.index_u32());
        for (entity, is_collider) in all {
            if let Ok((.., mut slot)) = self.candidates.particles.get_mut(entity)
                && !slot.is_registered()
            {
                state.particles.add(entity, &mut *slot);
            }
            if let Ok((.., mut slot)) = self.candidates.springs.get_mut(entity)
                && !slot.is_registered()
            {
                state.springs.add(entity, &mut *slot);
            }
            if let Ok((.., mut slot)) = self.candidates.bends.get_mut(entity)
                && !slot.is_registered()
            {
                state.bends.all.add(entity, &mut *slot);
            }
            if is_collider && !known.contains(&entity) {
                state.colliders.push(RegisteredCollider::new(entity));
            }
        }
    }

    /// Makes the initial state one of all entities in the simulation, whatever this app has seen of them before.
    fn complete_initial_state(&mut self) {
        let initial = &mut self.bookkeeping.initial;
        let recorded = initial.entities();
        let MassSpringState { particles, springs, bends, nets, colliders, .. } = &mut *self.state;
        for entry in &mut particles.entries {
            entry.is_recorded = recorded.contains(&entry.entity);
            let data = self.candidates.particles.get(entry.entity).ok().filter(|_| !entry.is_recorded);
            if let Some((particle, transform, velocity, force, (is_pinned, ..), slot)) = data
                && slot.get().is_some()
            {
                let data = (particle, transform, velocity, force, is_pinned);
                initial.record_particle(entry.entity, data);
                entry.is_recorded = true;
            }
        }
        for entry in &mut springs.entries {
            entry.is_recorded = recorded.contains(&entry.entity);
            let data = self.candidates.springs.get(entry.entity).ok().filter(|_| !entry.is_recorded);
            if let Some((spring, ..)) = data {
                initial.record_spring(entry.entity, *spring);
                entry.is_recorded = true;
            }
        }
        for net in &mut nets.entries {
            net.is_recorded = recorded.contains(&net.entity);
            let data = self.candidates.nets.get(net.entity).ok().filter(|_| !net.is_recorded);
            if let Some((data, transform, _)) = data {
                initial.record_net(net.entity, &data, transform);
                net.is_recorded = true;
            }
        }
        for entry in &mut bends.all.entries {
            entry.is_recorded = recorded.contains(&entry.entity);
            let data = self.candidates.bends.get(entry.entity).ok().filter(|_| !entry.is_recorded);
            if let Some((bend, ..)) = data {
                initial.record_bend(entry.entity, *bend);
                entry.is_recorded = true;
            }
        }
        for collider in colliders {
            collider.is_recorded = recorded.contains(&collider.entity);
        }
    }

    /// Copies the parameters of all springs in the simulation; those with other ends are pending from now on.
    fn copy_all_springs(&mut self) {
        let Candidates { particles, parts, springs, .. } = &self.candidates;
        let mut relinked = Vec::new();
        for &entity in self.state.springs.slots.iter().filter(|entity| **entity != Entity::PLACEHOLDER) {
            let Ok((spring, _, slot)) = springs.get(entity) else { continue };
            let slot_of = |end| match particles.get(end) {
                Ok((.., slot)) => slot.get(),
                Err(_) => parts.get(end).ok().and_then(|(_, part)| part.slot).map(|slot| slot as usize),
            };
            if slot.get().is_some_and(|slot| !copy_spring(spring, slot, slot_of, &mut self.state.solver)) {
                relinked.push(entity);
            }
        }
        relinked.into_iter().for_each(|spring| self.suspend(spring));
    }
}
