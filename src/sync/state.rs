//! The state of the simulation between two ticks, and the observers that keep it complete.

use std::fmt::Display;

use bevy::ecs::entity::{EntityHashMap, EntityHashSet, EntityMapper, MapEntities};
use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::query::Allow;
use bevy::prelude::*;

use crate::bend::Bend;
use crate::collider::ParticleCollider;
use crate::nets::ParticleNet;
use crate::particle::Particle;
use crate::solver::{Pose, State, Version};
use crate::spring::{Broken, Spring};

use super::Simulation;
use super::bends::BendRegistry;
use super::nets::NetRegistry;
use super::registry::{Registry, Slot};

/// What the simulation remembers from tick to tick beside the components: the order of particles and springs, where
/// pinned particles and colliders were, and the impulses of contacts.
///
/// Rollback libraries and save games store a clone of it together with the components [`Particle`],
/// [`ParticleVelocity`](crate::ParticleVelocity), [`Pinned`](crate::Pinned), [`AppliedForce`](crate::AppliedForce),
/// [`Quarantined`](crate::Quarantined), [`SimulationOrder`](crate::SimulationOrder), [`Spring`], [`Broken`], [`Bend`],
/// [`ParticleNet`], [`PartState`](crate::nets::PartState), [`Breaking`](crate::nets::Breaking),
/// [`Yielding`](crate::nets::Yielding), [`Winch`](crate::nets::Winch), [`ParticleCollider`], [`ColliderMotion`](crate::ColliderMotion), [`ContactMaterial`](crate::ContactMaterial),
/// [`ContactLayers`](crate::ContactLayers), [`ContactExemptions`](crate::ContactExemptions) and `Transform` (that of parents, too). With all of these put back,
/// this resource last, the next ticks have the same bits as those that followed the saving. Entities that were
/// respawned in the meantime are to be mapped (it implements [`MapEntities`]).
/// [`Snapshot`](crate::snapshot::Snapshot) does all of that, but for parents.
#[derive(Resource, Debug, Clone, Default)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub struct MassSpringState {
    pub(super) particles: Registry,
    pub(super) springs: Registry,
    /// The nets in the order of spawning.
    pub(super) nets: NetRegistry,
    pub(super) bends: BendRegistry,
    /// The colliders in the order of spawning.
    pub(super) colliders: Vec<RegisteredCollider>,
    /// The pairs of entities that touched in the last tick, sorted; recorded if requested.
    #[cfg_attr(feature = "serialize", serde(default))]
    pub(super) touching: Vec<[Entity; 2]>,
    /// Something happened that all slots depend on.
    pub(super) is_outdated: bool,
    /// Particles with bad values, left out until they are corrected.
    pub(super) excluded: Vec<Entity>,
    /// Springs that wait for an end, to be corrected or enabled.
    pub(super) pending: Vec<Entity>,
    /// Springs that broke since the last tick.
    pub(super) broken: Vec<Entity>,
    /// Particles that were despawned since the last tick.
    pub(super) despawned: EntityHashSet,
    pub(super) solver: State,
    /// Changes whenever any of this does.
    pub(super) version: Version,
}

/// A collider, and what is remembered of it.
#[derive(Debug, Clone, Copy)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct RegisteredCollider {
    pub entity: Entity,
    /// The pose of the last tick; `None` if it had none.
    pub last_pose: Option<Pose>,
    /// Whether its initial state has been recorded.
    pub is_recorded: bool,
}

impl RegisteredCollider {
    pub fn new(entity: Entity) -> Self {
        Self { entity, last_pose: None, is_recorded: false }
    }
}

impl MassSpringState {
    /// As before the first tick: all entities stay registered, nothing is remembered of what they did.
    pub(super) fn restart(&mut self) {
        self.particles.reset_slots();
        self.springs.reset_slots();
        self.nets.reset_slots();
        self.bends.reset_slots();
        self.colliders.iter_mut().for_each(|collider| collider.last_pose = None);
        self.touching.clear();
        self.solver.clear();
        self.solver.origin = Vec3::ZERO;
        self.solver.clear_contacts();
        self.solver.reset_air_clock();
        self.is_outdated = true;
        self.version = Version::new();
    }
}

impl MapEntities for MassSpringState {
    fn map_entities<M: EntityMapper>(&mut self, mapper: &mut M) {
        self.particles.map_entities(mapper);
        self.springs.map_entities(mapper);
        self.nets.map_entities(mapper);
        self.bends.map_entities(mapper);
        for entity in self
            .colliders
            .iter_mut()
            .map(|collider| &mut collider.entity)
            .chain(self.touching.as_flattened_mut())
            .chain(&mut self.excluded)
            .chain(&mut self.pending)
            .chain(&mut self.broken)
        {
            *entity = mapper.get_mapped(*entity);
        }
        let Self { touching, colliders, .. } = self;
        let is_collider = |entity| colliders.iter().any(|collider| collider.entity == entity);
        for pair in touching.iter_mut().filter(|[_, other]| !is_collider(*other)) {
            *pair = super::touching::ordered(*pair);
        }
        touching.sort_unstable();
        self.despawned = self.despawned.iter().map(|entity| mapper.get_mapped(*entity)).collect();
        self.version = Version::new();
    }
}

/// Warnings that were logged, so that each is logged once.
#[derive(Resource, Default)]
pub(super) struct Warnings(EntityHashMap<String>);

impl Warnings {
    /// Logs what is wrong with an entity, once until it is corrected or something else is wrong.
    pub fn warn_once(&mut self, entity: Entity, problem: impl Display) {
        let problem = problem.to_string();
        if self.0.get(&entity) != Some(&problem) {
            log::warn!("{problem}");
            self.0.insert(entity, problem);
        }
    }

    /// Clears the warning about an entity: all is well with it.
    pub fn clear(&mut self, entity: Entity) {
        if !self.0.is_empty() {
            self.0.remove(&entity);
        }
    }
}

/// A component that has a registry.
pub(super) trait Registered: Component {
    fn registry(state: &mut MassSpringState) -> &mut Registry;
}

impl Registered for Particle {
    fn registry(state: &mut MassSpringState) -> &mut Registry {
        &mut state.particles
    }
}

impl Registered for Spring {
    fn registry(state: &mut MassSpringState) -> &mut Registry {
        &mut state.springs
    }
}

/// Gives a state that an observer changes a new version. One that was put back meanwhile stays known as such.
pub(super) fn touch(state: &mut MassSpringState, simulation: &mut Simulation) {
    let was_replaced = state.version != simulation.version;
    state.version = Version::new();
    if !was_replaced {
        simulation.version = state.version;
    }
}

/// Registers an entity that got the component.
pub(super) fn register<T: Registered>(
    added: On<Add, T>,
    mut state: ResMut<MassSpringState>,
    mut simulation: ResMut<Simulation>,
    mut slots: Query<&mut Slot<T>, Allow<Disabled>>,
    mut commands: Commands,
) {
    touch(&mut state, &mut simulation);
    if let Ok(mut slot) = slots.get_mut(added.entity) {
        T::registry(&mut state).add(added.entity, &mut slot);
        return;
    }
    // The slot comes with the component, unless there were such entities before the plugin: what is
    // required of a component cannot be changed then.
    let mut slot = Slot::<T>::default();
    T::registry(&mut state).add(added.entity, &mut slot);
    commands.entity(added.entity).try_insert(slot);
}

/// Takes note that an entity lost the component: its slot is no longer its own.
pub(super) fn unregister<T: Registered>(
    removed: On<Remove, T>,
    mut state: ResMut<MassSpringState>,
    mut simulation: ResMut<Simulation>,
    mut warnings: ResMut<Warnings>,
    mut slots: Query<&mut Slot<T>, Allow<Disabled>>,
) {
    warnings.clear(removed.entity);
    // The slots of the entities are not those of a state that was put back, before a tick has taken it over.
    let was_replaced = state.version != simulation.version;
    touch(&mut state, &mut simulation);
    if let Ok(mut slot) = slots.get_mut(removed.entity) {
        let freed = slot.get().filter(|_| !was_replaced);
        T::registry(&mut state).removed.extend(freed.map(|slot| slot as u32));
        slot.set(None);
    }
}

/// Takes note that a particle is despawned: its springs go with it.
pub(super) fn note_despawned(despawned: On<Despawn, Particle>, mut state: ResMut<MassSpringState>) {
    state.despawned.insert(despawned.entity);
}

/// Takes note that a spring broke: its slot is emptied in the next tick.
pub(super) fn note_broken(
    broken: On<Add, Broken>,
    mut state: ResMut<MassSpringState>,
    mut simulation: ResMut<Simulation>,
    springs: Query<(), (With<Slot<Spring>>, Allow<Disabled>)>,
) {
    if springs.contains(broken.entity) {
        touch(&mut state, &mut simulation);
        state.broken.push(broken.entity);
    }
}

/// What has a registry.
type IsRegistered = Or<(With<Slot<Particle>>, With<Slot<Spring>>, With<Slot<Bend>>, With<ParticleNet>)>;

/// Takes note that the slots depend on what has just happened to `T`: [`Add`], [`Insert`] or [`Remove`].
pub(super) fn mark_outdated<E: EntityEvent, T: Component>(
    event: On<E, T>,
    mut state: ResMut<MassSpringState>,
    mut simulation: ResMut<Simulation>,
    registered: Query<(), (IsRegistered, Allow<Disabled>)>,
) {
    if registered.contains(event.event_target()) {
        state.is_outdated = true;
        touch(&mut state, &mut simulation);
    }
}

/// Registers what was spawned before the plugin was added.
pub(super) fn register_existing(world: &mut World) {
    register_all::<Particle>(world);
    register_all::<Spring>(world);
    register_all::<Bend>(world);
    let mut colliders = world.query_filtered::<Entity, (With<ParticleCollider>, Allow<Disabled>)>();
    let mut colliders: Vec<Entity> = colliders.iter(world).collect();
    colliders.sort_unstable_by_key(|entity| entity.index_u32());
    world
        .resource_mut::<MassSpringState>()
        .colliders
        .extend(colliders.into_iter().map(RegisteredCollider::new));
}

fn register_all<T: Registered>(world: &mut World) {
    let mut existing: Vec<Entity> =
        world.query_filtered::<Entity, (With<T>, Allow<Disabled>)>().iter(world).collect();
    existing.sort_unstable_by_key(|entity| entity.index_u32());
    world.resource_scope(|world, mut state: Mut<MassSpringState>| {
        for entity in existing {
            let mut entity_mut = world.entity_mut(entity);
            let mut slot = Slot::<T>::default();
            T::registry(&mut state).add(entity, &mut slot);
            entity_mut.insert(slot);
        }
    });
}
