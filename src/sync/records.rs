//! The components of what takes part, as a snapshot holds them.

use bevy::prelude::*;

use crate::collider::ParticleCollider;
use crate::nets::{PartState, ParticleNet};
use crate::particle::{AppliedForce, Particle, ParticleVelocity, Pinned, Quarantined};
use crate::spring::{Broken, Spring};

use super::easing;

/// The components of a spring.
#[derive(Debug, Clone, Copy)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct SpringRecord {
    pub entity: Entity,
    pub spring: Spring,
    pub is_broken: bool,
}

/// The components of a particle.
#[derive(Debug, Clone, Copy)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct ParticleRecord {
    pub entity: Entity,
    pub particle: Particle,
    pub translation: Vec3,
    pub velocity: ParticleVelocity,
    pub force: Option<AppliedForce>,
    pub is_pinned: bool,
    pub is_quarantined: bool,
}

/// The components of a net.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct NetRecord {
    pub entity: Entity,
    pub net: ParticleNet,
    pub translation: Vec3,
    pub rotation: Quat,
}

/// The components of a part of a net.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct PartRecord {
    pub entity: Entity,
    pub net: Entity,
    pub translation: Vec3,
    pub rotation: Quat,
    pub velocity: Vec3,
    pub force: Option<AppliedForce>,
    pub is_pinned: bool,
    pub state: PartState,
}

/// The components of a collider.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct ColliderRecord {
    pub entity: Entity,
    pub collider: ParticleCollider,
    pub transform: Transform,
}

impl ParticleRecord {
    pub fn of(world: &World, entity: Entity) -> Option<Self> {
        let entity = world.get_entity(entity).ok()?;
        Some(Self {
            entity: entity.id(),
            particle: *entity.get()?,
            translation: easing::exact_translation(world, entity)?,
            velocity: *entity.get()?,
            force: entity.get().copied(),
            is_pinned: entity.contains::<Pinned>(),
            is_quarantined: entity.contains::<Quarantined>(),
        })
    }

    pub fn restore(&self, entity: &mut EntityWorldMut) {
        entity.insert((self.particle, self.velocity));
        if let Some(mut transform) = entity.get_mut::<Transform>() {
            transform.translation = self.translation;
        }
        easing::reset(entity);
        match self.force {
            Some(force) => entity.insert(force),
            None => entity.remove::<AppliedForce>(),
        };
        set_marker(entity, Pinned, self.is_pinned);
        set_marker(entity, Quarantined, self.is_quarantined);
    }
}

/// Inserts or removes a component without a value.
fn set_marker<T: Component>(entity: &mut EntityWorldMut, marker: T, is_present: bool) {
    match is_present {
        true if entity.contains::<T>() => entity,
        true => entity.insert(marker),
        false => entity.remove::<T>(),
    };
}

impl NetRecord {
    pub fn of(world: &World, entity: Entity) -> Option<Self> {
        let transform = world.get::<Transform>(entity)?;
        let net = world.get::<ParticleNet>(entity)?.clone();
        Some(Self { entity, net, translation: transform.translation, rotation: transform.rotation })
    }

    pub fn restore(self, world: &mut World) {
        if let Some(mut net) = world.get_mut::<ParticleNet>(self.entity) {
            *net = self.net;
            if let Some(mut transform) = world.get_mut::<Transform>(self.entity) {
                (transform.translation, transform.rotation) = (self.translation, self.rotation);
            }
        }
    }
}

impl SpringRecord {
    pub fn of(world: &World, entity: Entity) -> Option<Self> {
        let entity = world.get_entity(entity).ok()?;
        Some(Self { entity: entity.id(), spring: *entity.get()?, is_broken: entity.contains::<Broken>() })
    }

    pub fn restore(&self, world: &mut World) {
        let Ok(mut entity) = world.get_entity_mut(self.entity) else { return };
        if let Some(mut spring) = entity.get_mut::<Spring>() {
            spring.set_if_neq(self.spring);
            set_marker(&mut entity, Broken, self.is_broken);
        }
    }
}

impl PartRecord {
    pub fn of(world: &World, net: Entity, entity: Entity) -> Option<Self> {
        let entity = world.get_entity(entity).ok()?;
        let Transform { translation, rotation, .. } = *entity.get()?;
        Some(Self {
            entity: entity.id(),
            net,
            translation,
            rotation,
            velocity: entity.get::<ParticleVelocity>()?.0,
            force: entity.get().copied(),
            is_pinned: entity.contains::<Pinned>(),
            state: PartState { tie: None, ..entity.get::<PartState>()?.clone() },
        })
    }

    pub fn restore(self, world: &mut World) {
        let Ok(mut entity) = world.get_entity_mut(self.entity) else { return };
        let Some(present) = entity.get::<PartState>() else { return };
        // Springs of attachments are restored as all others are: those that are in effect stay so.
        let state = PartState { tie: present.tie.clone(), ..self.state };
        entity.insert((state, ParticleVelocity(self.velocity)));
        if let Some(mut transform) = entity.get_mut::<Transform>() {
            (transform.translation, transform.rotation) = (self.translation, self.rotation);
        }
        match self.force {
            Some(force) => entity.insert(force),
            None => entity.remove::<AppliedForce>(),
        };
        set_marker(&mut entity, Pinned, self.is_pinned);
    }
}

impl ColliderRecord {
    pub fn of(world: &World, entity: Entity) -> Option<Self> {
        let entity = world.get_entity(entity).ok()?;
        let collider = entity.get::<ParticleCollider>()?.clone();
        Some(Self { entity: entity.id(), collider, transform: easing::exact_transform(world, entity)? })
    }

    pub fn restore(&self, world: &mut World) {
        let Ok(mut entity) = world.get_entity_mut(self.entity) else { return };
        let Some(mut collider) = entity.get_mut::<ParticleCollider>() else { return };
        collider.set_if_neq(self.collider.clone());
        if let Some(mut transform) = entity.get_mut::<Transform>() {
            transform.set_if_neq(self.transform);
        }
        easing::reset(&mut entity);
    }
}
