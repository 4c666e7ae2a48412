//! The initial state: what is recorded of each entity, and how it is put back.

use bevy::prelude::*;

use crate::diagnostics::Measurements;
use crate::particle::{AppliedForce, Particle, ParticleVelocity, Pinned, Quarantined};
use crate::report::TickReport;
use crate::spring::Spring;

use super::Simulation;
use super::easing;
use super::index::Index;
use super::roster::Slot;

/// What is recorded of a particle.
#[derive(Debug, Clone, Copy)]
pub(super) struct InitialParticle {
    particle: Particle,
    translation: Vec3,
    velocity: ParticleVelocity,
    force: Option<AppliedForce>,
    pinned: bool,
}

impl InitialParticle {
    pub fn new(
        particle: &Particle,
        transform: &Transform,
        velocity: &ParticleVelocity,
        force: Option<&AppliedForce>,
        pinned: bool,
    ) -> Self {
        Self {
            particle: *particle,
            translation: transform.translation,
            velocity: *velocity,
            force: force.copied(),
            pinned,
        }
    }

    fn of(world: &World, entity: EntityRef) -> Option<Self> {
        Some(Self {
            particle: *entity.get()?,
            translation: easing::exact_translation(world, entity)?,
            velocity: *entity.get()?,
            force: entity.get().copied(),
            pinned: entity.contains::<Pinned>(),
        })
    }

    fn restore(&self, entity: &mut EntityWorldMut) {
        entity.insert((self.particle, self.velocity));
        if let Some(mut transform) = entity.get_mut::<Transform>() {
            transform.translation = self.translation;
        }
        easing::forget(entity);
        match self.force {
            Some(force) => entity.insert(force),
            None => entity.remove::<AppliedForce>(),
        };
        match self.pinned {
            true => entity.insert(Pinned),
            false => entity.remove::<Pinned>(),
        };
        entity.remove::<Quarantined>();
    }
}

/// See [`TakeInitialState`](crate::snapshot::TakeInitialState).
pub(crate) fn take_initial_state(world: &mut World) {
    world.resource_scope(|world, mut index: Mut<Index>| {
        for entry in &mut index.particles.entries {
            if let Ok(entity) = world.get_entity(entry.entity) {
                entry.initial = InitialParticle::of(world, entity);
            }
        }
        for entry in &mut index.springs.entries {
            entry.initial = world.get::<Spring>(entry.entity).copied();
        }
    });
}

/// See [`RestoreInitialState`](crate::snapshot::RestoreInitialState).
pub(crate) fn restore_initial_state(world: &mut World) {
    let index = world.resource::<Index>();
    let particles: Vec<(Entity, InitialParticle)> = index
        .particles
        .entries
        .iter()
        .filter(|entry| world.get::<Slot<Particle>>(entry.entity).is_some_and(|slot| entry.is_valid(slot)))
        .filter_map(|entry| Some((entry.entity, entry.initial?)))
        .collect();
    let springs: Vec<(Entity, Spring)> = index
        .springs
        .entries
        .iter()
        .filter(|entry| world.get::<Slot<Spring>>(entry.entity).is_some_and(|slot| entry.is_valid(slot)))
        .filter_map(|entry| Some((entry.entity, entry.initial?)))
        .collect();
    for (entity, initial) in particles {
        let Ok(mut entity) = world.get_entity_mut(entity) else { continue };
        if entity.contains::<Particle>() {
            initial.restore(&mut entity);
        }
    }
    for (entity, initial) in springs {
        if let Some(mut spring) = world.get_mut::<Spring>(entity) {
            spring.set_if_neq(initial);
        }
    }
    let mut index = world.resource_mut::<Index>();
    index.fresh.fill(true);
    // Also forgets what the slots did before: no particle that comes back has a past.
    index.particles.slots.clear();
    index.changed = true;
    world.resource_mut::<Simulation>().state.contacts.forget();
    *world.resource_mut::<TickReport>() = TickReport::default();
    if let Some(mut measurements) = world.get_resource_mut::<Measurements>() {
        *measurements = Measurements::default();
    }
}
