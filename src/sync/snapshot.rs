//! Snapshots: all that the next ticks depend on, and how it is put back; the initial state is one.

use bevy::ecs::entity::{
    Entities, EntityHashMap, EntityHashSet, EntityMapper, MapEntities, SceneEntityMapper,
};
use bevy::prelude::*;

use crate::bend::Bend;
use crate::collider::ParticleCollider;
use crate::nets::{PartState, ParticleNet, Parts};
use crate::particle::{AppliedForce, Particle, ParticleVelocity};
use crate::report::TickReport;
use crate::solver::Measurements;
use crate::spring::Spring;

use super::options::OptionalComponents;
use super::records::{ColliderRecord, NetRecord, PartRecord, ParticleRecord, SpringRecord};
use super::state::MassSpringState;

/// All that the next ticks of the simulation depend on, but for settings and [`Environment`](crate::Environment).
///
/// What follows [`restore`](Self::restore) is to the last bit what followed [`take`](Self::take), in the same app or
/// in another one in which the same scene was spawned, on any number of threads. With the feature `serialize` it can
/// be written to a file.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_mass_spring::prelude::*;
/// #[derive(Resource)]
/// struct Checkpoint(Snapshot);
///
/// fn save(world: &mut World) {
///     let snapshot = Snapshot::take(world);
///     world.insert_resource(Checkpoint(snapshot));
/// }
///
/// fn load(world: &mut World) {
///     world.resource_scope(|world, checkpoint: Mut<Checkpoint>| checkpoint.0.restore(world));
/// }
/// ```
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub struct Snapshot {
    particles: Vec<ParticleRecord>,
    springs: Vec<SpringRecord>,
    nets: Vec<NetRecord>,
    parts: Vec<PartRecord>,
    bends: Vec<(Entity, Bend)>,
    colliders: Vec<ColliderRecord>,
    options: OptionalComponents,
    /// `None` for an initial state, before any tick has run.
    state: Option<MassSpringState>,
}

/// Why a [`Snapshot`] does not fit into a world.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("the snapshot has {expected} {what}, the world {found}")]
#[non_exhaustive]
pub struct SnapshotError {
    /// Particles, springs, bends, nets, parts or colliders.
    pub what: &'static str,
    /// Their number in the snapshot.
    pub expected: usize,
    /// Their number in the world.
    pub found: usize,
}

impl Snapshot {
    /// Takes a snapshot of all particles, springs, bends, nets and colliders. It changes nothing.
    ///
    /// Between two ticks positions are those of the last one, not those that interpolation shows.
    ///
    /// # Panics
    /// If the world is without [`MassSpringPlugin`](crate::MassSpringPlugin).
    pub fn take(world: &World) -> Self {
        let state = world.resource::<MassSpringState>();
        let particles = state.particles.entities();
        let particles = particles.filter_map(|entity| ParticleRecord::of(world, entity)).collect();
        let springs = state.springs.entities();
        let springs = springs.filter_map(|entity| SpringRecord::of(world, entity)).collect();
        let nets = state.nets.entities().filter_map(|entity| NetRecord::of(world, entity)).collect();
        let colliders = state
            .colliders
            .iter()
            .filter_map(|collider| ColliderRecord::of(world, collider.entity))
            .collect();
        let parts_of = |net: Entity| world.get::<Parts>(net).map_or(&[][..], Parts::entities);
        let parts = state.nets.entities().flat_map(|net| parts_of(net).iter().map(move |part| (net, *part)));
        let parts = parts.filter_map(|(net, part)| PartRecord::of(world, net, part)).collect();
        let bends = state.bends.all.entities();
        let bends = bends.filter_map(|entity| Some((entity, *world.get::<Bend>(entity)?))).collect();
        let state = Some(state.clone());
        let mut snapshot =
            Self { particles, springs, bends, nets, parts, colliders, state, ..Self::default() };
        snapshot.options = OptionalComponents::of(world, snapshot.entities_with_options().into_iter());
        snapshot
    }

    /// Puts all particles, springs, bends, nets and colliders of the snapshot back that still exist, and the solver with them.
    ///
    /// Masses, radii, positions, velocities, forces, pins, the parameters of springs and bends, the place and parameters of
    /// colliders, and what they all have of [`ContactMaterial`](crate::ContactMaterial),
    /// [`ContactLayers`](crate::ContactLayers), [`ColliderMotion`](crate::ColliderMotion), [`Breaking`](crate::nets::Breaking),
    /// [`Yielding`](crate::nets::Yielding) and [`Winch`](crate::nets::Winch) return to what they were; particles that were quarantined and springs that broke
    /// since come back. The `Transform`s of parents are the app's to put back. Entities that were despawned stay so. Entities that were spawned since keep their components and join as if they had just been
    /// spawned.
    ///
    /// # Panics
    /// If the world is without [`MassSpringPlugin`](crate::MassSpringPlugin).
    pub fn restore(&self, world: &mut World) {
        self.clone().put_back(world);
    }

    /// Puts the snapshot into another world in which the same scene was spawned: the first particle of the
    /// simulation there becomes the first one of the snapshot, and so on. No tick need have run there; nets from meshes
    /// that load are to be laid out.
    ///
    /// # Errors
    /// If the world has another number of particles, springs, bends, nets, parts or colliders. Nothing is put back then; recipes are
    /// laid out and attachments tied all the same, as the next tick would do.
    ///
    /// # Panics
    /// If the world is without [`MassSpringPlugin`](crate::MassSpringPlugin).
    pub fn restore_in_order(&self, world: &mut World) -> Result<(), SnapshotError> {
        super::nets::prepare(world);
        let present = Self::take(world);
        let pairs = [
            ("particles", self.particle_entities(), present.particle_entities()),
            ("springs", self.spring_entities(), present.spring_entities()),
            ("nets", self.net_entities(), present.net_entities()),
            ("parts", self.part_entities(), present.part_entities()),
            ("bends", self.bend_entities(), present.bend_entities()),
            ("colliders", self.collider_entities(), present.collider_entities()),
        ];
        let mut map = EntityHashMap::default();
        for (what, from, to) in pairs {
            if from.len() != to.len() {
                return Err(SnapshotError { what, expected: from.len(), found: to.len() });
            }
            map.extend(from.into_iter().zip(to));
        }
        let mut snapshot = self.clone();
        // What was despawned before the snapshot was taken becomes entities that do not exist here either.
        SceneEntityMapper::world_scope(&mut map, world, |_, mapper| snapshot.map_entities(mapper));
        snapshot.put_back(world);
        Ok(())
    }

    /// All entities that it holds, particles first.
    fn entities(&self) -> Vec<Entity> {
        [self.entities_with_options(), self.spring_entities(), self.bend_entities()].concat()
    }

    /// Those that may have optional components: all but springs and bends.
    fn entities_with_options(&self) -> Vec<Entity> {
        let of_parts = [self.net_entities(), self.part_entities(), self.collider_entities()].concat();
        [self.particle_entities(), of_parts].concat()
    }

    fn particle_entities(&self) -> Vec<Entity> {
        self.particles.iter().map(|record| record.entity).collect()
    }

    fn spring_entities(&self) -> Vec<Entity> {
        self.springs.iter().map(|record| record.entity).collect()
    }

    fn net_entities(&self) -> Vec<Entity> {
        self.nets.iter().map(|record| record.entity).collect()
    }

    fn part_entities(&self) -> Vec<Entity> {
        self.parts.iter().map(|record| record.entity).collect()
    }

    fn bend_entities(&self) -> Vec<Entity> {
        self.bends.iter().map(|(entity, _)| *entity).collect()
    }

    fn collider_entities(&self) -> Vec<Entity> {
        self.colliders.iter().map(|record| record.entity).collect()
    }

    fn put_back(self, world: &mut World) {
        let entities = self.entities_with_options();
        let Self { particles, springs, bends, nets, parts, colliders, options, state } = self;
        for record in particles {
            if let Ok(mut entity) = world.get_entity_mut(record.entity)
                && entity.contains::<Particle>()
            {
                record.restore(&mut entity);
            }
        }
        springs.iter().for_each(|record| record.restore(world));
        nets.into_iter().for_each(|record| record.restore(world));
        parts.into_iter().for_each(|record| record.restore(world));
        for (entity, recorded) in bends {
            if let Some(mut bend) = world.get_mut::<Bend>(entity) {
                bend.set_if_neq(recorded);
            }
        }
        colliders.iter().for_each(|record| record.restore(world));
        match state {
            Some(state) => {
                options.restore(world, &entities.into_iter().collect());
                *world.resource_mut::<MassSpringState>() = state;
            }
            None => world.resource_mut::<MassSpringState>().restart(),
        }
    }
}

impl MapEntities for Snapshot {
    fn map_entities<M: EntityMapper>(&mut self, mapper: &mut M) {
        self.particles.iter_mut().for_each(|record| record.entity = mapper.get_mapped(record.entity));
        for record in &mut self.springs {
            record.entity = mapper.get_mapped(record.entity);
            record.spring.map_entities(mapper);
        }
        self.nets.iter_mut().for_each(|record| record.entity = mapper.get_mapped(record.entity));
        for record in &mut self.parts {
            (record.entity, record.net) = (mapper.get_mapped(record.entity), mapper.get_mapped(record.net));
        }
        for (entity, bend) in &mut self.bends {
            *entity = mapper.get_mapped(*entity);
            bend.map_entities(mapper);
        }
        self.colliders.iter_mut().for_each(|record| record.entity = mapper.get_mapped(record.entity));
        self.options.map_entities(mapper);
        if let Some(state) = &mut self.state {
            state.map_entities(mapper);
        }
    }
}

/// Number of records of the initial state from which on those of despawned entities are looked for.
const MIN_RECORDS: usize = 1024;

/// The one initial state. It is recorded as particles and springs are first seen, or taken on request.
#[derive(Resource, Default)]
pub(super) struct InitialState {
    snapshot: Snapshot,
    /// The parts that it holds.
    parts: EntityHashSet,
    /// Twice the number of its records when those of despawned entities were dropped last.
    limit: usize,
}

impl From<Snapshot> for InitialState {
    fn from(snapshot: Snapshot) -> Self {
        let parts = snapshot.parts.iter().map(|part| part.entity).collect();
        Self { snapshot, parts, limit: 0 }
    }
}

impl InitialState {
    /// The entities that it holds.
    pub fn entities(&self) -> EntityHashSet {
        self.snapshot.entities().into_iter().collect()
    }

    fn len(&self) -> usize {
        let Snapshot { particles, springs, nets, parts, bends, colliders, .. } = &self.snapshot;
        particles.len() + springs.len() + nets.len() + parts.len() + bends.len() + colliders.len()
    }

    /// Drops the records of entities that were despawned, when there may be as many of them as of others.
    pub fn drop_despawned(&mut self, entities: &Entities) {
        if self.len() < self.limit.max(MIN_RECORDS) {
            return;
        }
        let Self { snapshot: Snapshot { particles, springs, nets, parts, bends, colliders, .. }, .. } = self;
        particles.retain(|record| entities.contains_spawned(record.entity));
        springs.retain(|record| entities.contains_spawned(record.entity));
        nets.retain(|record| entities.contains_spawned(record.entity));
        parts.retain(|record| entities.contains_spawned(record.entity));
        bends.retain(|(entity, _)| entities.contains_spawned(*entity));
        colliders.retain(|record| entities.contains_spawned(record.entity));
        self.parts.retain(|entity| entities.contains_spawned(*entity));
        self.limit = 2 * self.len();
    }

    pub fn record_particle(
        &mut self,
        entity: Entity,
        (particle, transform, velocity, force, is_pinned): (
            &Particle,
            &Transform,
            &ParticleVelocity,
            Option<&AppliedForce>,
            bool,
        ),
    ) {
        self.snapshot.particles.push(ParticleRecord {
            entity,
            particle: *particle,
            translation: transform.translation,
            velocity: *velocity,
            force: force.copied(),
            is_pinned,
            is_quarantined: false,
        });
    }

    pub fn record_spring(&mut self, entity: Entity, spring: Spring) {
        self.snapshot.springs.push(SpringRecord { entity, spring, is_broken: false });
    }

    pub fn record_net(&mut self, entity: Entity, net: &ParticleNet, transform: &Transform) {
        let Transform { translation, rotation, .. } = *transform;
        self.snapshot.nets.push(NetRecord { entity, net: net.clone(), translation, rotation });
    }

    /// Records a part once.
    pub fn record_part(
        &mut self,
        entity: Entity,
        net: Entity,
        (transform, velocity, force, is_pinned): (&Transform, Vec3, Option<AppliedForce>, bool),
        state: &PartState,
    ) {
        if !self.parts.insert(entity) {
            return;
        }
        let (Transform { translation, rotation, .. }, state) = (*transform, state.clone());
        let record = PartRecord { entity, net, translation, rotation, velocity, force, is_pinned, state };
        self.snapshot.parts.push(record);
    }

    pub fn record_bend(&mut self, entity: Entity, bend: Bend) {
        self.snapshot.bends.push((entity, bend));
    }

    pub fn record_collider(&mut self, entity: Entity, collider: ParticleCollider, transform: &Transform) {
        self.snapshot.colliders.push(ColliderRecord { entity, collider, transform: *transform });
    }
}

/// See [`TakeInitialState`](crate::snapshot::TakeInitialState).
pub(crate) fn take_initial_state(world: &mut World) {
    let snapshot = Snapshot::take(world);
    let mut state = world.resource_mut::<MassSpringState>();
    let MassSpringState { particles, springs, bends, nets, colliders, .. } = &mut *state;
    nets.entries.iter_mut().for_each(|net| net.is_recorded = true);
    let entries = particles.entries.iter_mut().chain(&mut springs.entries).chain(&mut bends.all.entries);
    entries.for_each(|entry| entry.is_recorded = true);
    colliders.iter_mut().for_each(|collider| collider.is_recorded = true);
    *world.resource_mut::<InitialState>() = snapshot.into();
}

/// See [`RestoreInitialState`](crate::snapshot::RestoreInitialState).
pub(crate) fn restore_initial_state(world: &mut World) {
    let snapshot = world.resource::<InitialState>().snapshot.clone();
    snapshot.put_back(world);
    *world.resource_mut::<TickReport>() = TickReport::default();
    if let Some(mut measurements) = world.get_resource_mut::<Measurements>() {
        *measurements = Measurements::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_of_despawned_entities_are_dropped() {
        let (mut world, mut initial) = (World::new(), InitialState::default());
        let kept: Vec<Entity> = (0..2 * MIN_RECORDS).map(|_| world.spawn_empty().id()).collect();
        let bend = Bend::new(kept[0], kept[1], kept[2]);
        kept.iter().for_each(|entity| initial.record_bend(*entity, bend));
        for _ in 0..10 * MIN_RECORDS {
            let entity = world.spawn_empty().id();
            initial.record_bend(entity, bend);
            world.despawn(entity);
            initial.drop_despawned(world.entities());
            assert!(initial.len() <= 2 * kept.len());
        }
        assert!(kept.iter().all(|entity| initial.entities().contains(entity)));
    }
}
