//! Who is in the simulation, kept by observers; and what was said of whom.

use std::fmt::Display;

use bevy::ecs::entity::EntityHashMap;
use bevy::prelude::*;

use crate::particle::Particle;
use crate::solver::contacts::Pose;
use crate::spring::Spring;

use super::restore::InitialParticle;
use super::roster::{Roster, Slot};

/// The rosters, and what must be remembered of entities between ticks.
#[derive(Resource, Default)]
pub(crate) struct Index {
    pub(super) particles: Roster<InitialParticle>,
    pub(super) springs: Roster<Spring>,
    /// The planes in the order of spawning, with the pose of the last tick.
    pub(super) planes: Vec<(Entity, Option<Pose>)>,
    /// Something happened that all slots depend on.
    pub(super) changed: bool,
    /// Slots that have no past: a pinned particle there did not move to where it is.
    pub(super) fresh: Vec<bool>,
    /// Particles with bad values, left out until they are mended.
    pub(super) excluded: Vec<Entity>,
    /// Springs that wait for an end, or to be mended.
    pub(super) waiting: Vec<Entity>,
    warnings: EntityHashMap<String>,
}

impl Index {
    /// Logs what is wrong with an entity, once until it is mended or something else is wrong.
    pub(super) fn warn_once(&mut self, entity: Entity, problem: impl Display) {
        let problem = problem.to_string();
        if self.warnings.get(&entity) != Some(&problem) {
            log::warn!("{problem}");
            self.warnings.insert(entity, problem);
        }
    }

    pub(super) fn forgive(&mut self, entity: Entity) {
        if !self.warnings.is_empty() {
            self.warnings.remove(&entity);
        }
    }
}

/// A component that has a roster.
pub(super) trait Enrolled: Component {
    /// What is recorded of it for a restart.
    type Initial;
    fn roster(index: &mut Index) -> &mut Roster<Self::Initial>;
}

impl Enrolled for Particle {
    type Initial = InitialParticle;
    fn roster(index: &mut Index) -> &mut Roster<InitialParticle> {
        &mut index.particles
    }
}

impl Enrolled for Spring {
    type Initial = Self;
    fn roster(index: &mut Index) -> &mut Roster<Self> {
        &mut index.springs
    }
}

/// Enrolls an entity that got the component.
pub(super) fn enroll<T: Enrolled>(
    added: On<Add, T>,
    mut index: ResMut<Index>,
    mut slots: Query<&mut Slot<T>>,
    mut commands: Commands,
) {
    if let Ok(mut slot) = slots.get_mut(added.entity) {
        T::roster(&mut index).enroll(added.entity, &mut slot);
        return;
    }
    // The slot comes with the component, unless there were such entities before the plugin: what is
    // required of a component cannot be changed then.
    let mut slot = Slot::<T>::default();
    T::roster(&mut index).enroll(added.entity, &mut slot);
    commands.entity(added.entity).try_insert(slot);
}

/// Takes note that an entity lost the component: its slot is no longer its own.
pub(super) fn leave<T: Enrolled>(
    removed: On<Remove, T>,
    mut index: ResMut<Index>,
    mut slots: Query<&mut Slot<T>>,
) {
    index.warnings.remove(&removed.entity);
    if let Ok(mut slot) = slots.get_mut(removed.entity) {
        T::roster(&mut index).departed.extend(slot.get());
        slot.set(None);
    }
}

/// Takes note that the slots depend on what has just happened to `T`: [`Add`] or [`Remove`].
pub(super) fn mark_changed<E: Event, T: Component>(_: On<E, T>, mut index: ResMut<Index>) {
    index.changed = true;
}

/// Enrolls what was spawned before the plugin was added.
pub(super) fn enroll_existing(world: &mut World) {
    enroll_all::<Particle>(world);
    enroll_all::<Spring>(world);
    let planes: Vec<Entity> =
        world.query_filtered::<Entity, With<crate::collider::PlaneCollider>>().iter(world).collect();
    world.resource_mut::<Index>().planes.extend(planes.into_iter().map(|plane| (plane, None)));
}

fn enroll_all<T: Enrolled>(world: &mut World) {
    let mut existing: Vec<Entity> = world.query_filtered::<Entity, With<T>>().iter(world).collect();
    existing.sort_unstable();
    world.resource_scope(|world, mut index: Mut<Index>| {
        for entity in existing {
            let mut entity_mut = world.entity_mut(entity);
            let mut slot = Slot::<T>::default();
            T::roster(&mut index).enroll(entity, &mut slot);
            entity_mut.insert(slot);
        }
    });
}
