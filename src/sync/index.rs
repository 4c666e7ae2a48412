//! Which particle and which spring has which slot: kept by observers, renumbered only when somebody
//! came or went.

use std::fmt::Display;
use std::time::Instant;

use bevy::ecs::entity::EntityHashMap;
use bevy::prelude::*;

use crate::parameter::{self, InvalidParameter};
use crate::particle::{AppliedForce, Particle, ParticleVelocity, Pinned, Quarantined};
use crate::solver::Vectors;
use crate::solver::contacts::Pose;
use crate::spring::Spring;

use super::Simulation;
use super::gather::Gathered;
use super::restore::InitialParticle;
use super::roster::{Roster, Slot};

/// The rosters, and what must be remembered of entities between ticks.
#[derive(Resource, Default)]
pub(crate) struct Index {
    pub(super) particles: Roster<InitialParticle>,
    pub(super) springs: Roster<Spring>,
    /// The planes in the order of spawning, with the pose of the last tick.
    pub(super) planes: Vec<(Entity, Option<Pose>)>,
    /// Somebody came, went or changed in a way that the slots depend on.
    pub(super) changed: bool,
    /// Slots that have no past: a pinned particle there did not move to where it is.
    pub(super) fresh: Vec<bool>,
    /// Particles with bad values, left out until they are mended.
    excluded: Vec<Entity>,
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
    index.changed = true;
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
    index.changed = true;
    index.warnings.remove(&removed.entity);
    if let Ok(mut slot) = slots.get_mut(removed.entity) {
        slot.set(None);
    }
}

/// Takes note that a particle was taken out of the simulation, or let in again.
pub(super) fn mark_on_add<T: Component>(_: On<Add, T>, mut index: ResMut<Index>) {
    index.changed = true;
}

/// See [`mark_on_add`].
pub(super) fn mark_on_remove<T: Component>(_: On<Remove, T>, mut index: ResMut<Index>) {
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
            index.changed = true;
        }
    });
}

/// All that the index reads of a particle.
type ParticleData = (
    &'static Particle,
    &'static Transform,
    &'static ParticleVelocity,
    Option<&'static AppliedForce>,
    Has<Pinned>,
    Has<Quarantined>,
    &'static mut Slot<Particle>,
);

/// The springs: first those that changed, then those that get slots.
type SpringQueries<'w, 's> = ParamSet<
    'w,
    's,
    (
        Query<'static, 'static, (Entity, &'static Spring, &'static Slot<Spring>), Changed<Spring>>,
        Query<'static, 'static, (&'static Spring, &'static mut Slot<Spring>)>,
    ),
>;

/// Copies the parameters of edited springs, and renumbers all slots if that is needed.
pub(super) fn refresh_index(
    mut index: ResMut<Index>,
    mut simulation: ResMut<Simulation>,
    mut gathered: ResMut<Gathered>,
    mut particles: Query<ParticleData>,
    mut springs: SpringQueries,
) {
    gathered.start = Some(Instant::now());
    let (index, simulation) = (&mut *index, &mut *simulation);
    for (entity, spring, slot) in &springs.p0() {
        if !copy_spring(spring, slot, index, simulation) {
            index.changed = true;
        } else {
            index.forgive(entity);
        }
    }
    let mended = |entity: &Entity| {
        particles.get(*entity).is_ok_and(|(particle, transform, velocity, ..)| {
            check_particle(particle, transform, velocity).is_ok()
        })
    };
    index.changed |= index.excluded.iter().any(mended);
    if index.changed {
        index.changed = false;
        number_particles(index, simulation, &mut particles);
        number_springs(index, simulation, &particles, &mut springs.p1());
        simulation.bounds_are_stale = true;
    }
}

/// Copies the parameters of a spring that joins the same particles as before; says whether it does.
fn copy_spring(spring: &Spring, slot: &Slot<Spring>, index: &Index, simulation: &mut Simulation) -> bool {
    let springs = &mut simulation.state.springs;
    let Some(slot) = slot.get().filter(|slot| *slot < springs.len()) else { return false };
    let (first, second) = springs.ends(slot);
    let ends = [first, second].map(|end| index.particles.slots.get(end).copied());
    if ends != spring.particles.map(Some) || spring.validate().is_err() {
        return false;
    }
    springs.rest_length[slot] = spring.rest_length;
    springs.stiffness[slot] = spring.stiffness;
    springs.damping[slot] = spring.damping;
    simulation.state.contacts.invalidate();
    simulation.bounds_are_stale = true;
    true
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

/// Gives slots to all particles that take part, in the order of the roster.
fn number_particles(index: &mut Index, simulation: &mut Simulation, particles: &mut Query<ParticleData>) {
    let mut new_slots = vec![None; index.particles.slots.len()];
    let mut entities = Vec::with_capacity(index.particles.entries.len());
    let mut positions = Vectors::default();
    let mut entries = std::mem::take(&mut index.particles.entries);
    index.fresh.clear();
    index.excluded.clear();
    entries.retain_mut(|entry| {
        let Ok((particle, transform, velocity, force, pinned, quarantined, mut slot)) =
            particles.get_mut(entry.entity)
        else {
            return false;
        };
        if !entry.is_valid(&slot) {
            return false;
        }
        let old_slot = slot.get();
        slot.set(None);
        if quarantined {
            return true;
        }
        if let Err(problem) = check_particle(particle, transform, velocity) {
            index.excluded.push(entry.entity);
            index.warn_once(
                entry.entity,
                format_args!("particle {} is left out of the simulation: {problem}", entry.entity),
            );
            return true;
        }
        index.forgive(entry.entity);
        entry
            .initial
            .get_or_insert_with(|| InitialParticle::new(particle, transform, velocity, force, pinned));
        let old_slot = old_slot.filter(|old| index.particles.slots.get(*old) == Some(&entry.entity));
        slot.set(Some(entities.len()));
        if let Some(old) = old_slot {
            new_slots[old] = Some(entities.len() as u32);
        }
        positions
            .push(old_slot.map_or(transform.translation, |old| simulation.state.particles.position.get(old)));
        index.fresh.push(old_slot.is_none());
        entities.push(entry.entity);
        true
    });
    index.particles.entries = entries;
    simulation.state.contacts.renumber(&new_slots, entities.len());
    simulation.state.particles.resize(entities.len());
    simulation.state.particles.position = positions;
    index.particles.slots = entities;
}

/// Gives slots to all springs whose two ends have one.
fn number_springs(
    index: &mut Index,
    simulation: &mut Simulation,
    particles: &Query<ParticleData>,
    springs: &mut Query<(&Spring, &mut Slot<Spring>)>,
) {
    let state = &mut simulation.state.springs;
    state.clear();
    let mut entities = Vec::with_capacity(index.springs.entries.len());
    let mut entries = std::mem::take(&mut index.springs.entries);
    entries.retain_mut(|entry| {
        let Ok((spring, mut slot)) = springs.get_mut(entry.entity) else { return false };
        if !entry.is_valid(&slot) {
            return false;
        }
        slot.set(None);
        entry.initial.get_or_insert(*spring);
        match resolve_spring(spring, particles) {
            Ok(Some([first, second])) => {
                index.forgive(entry.entity);
                slot.set(Some(entities.len()));
                state.push(first, second, spring.rest_length, spring.stiffness, spring.damping);
                entities.push(entry.entity);
            }
            Ok(None) => index.forgive(entry.entity),
            Err(problem) => index.warn_once(
                entry.entity,
                format_args!("spring {} is left out of the simulation: {problem}", entry.entity),
            ),
        }
        true
    });
    index.springs.entries = entries;
    index.springs.slots = entities;
}

/// What can be wrong with a spring.
#[derive(Debug, thiserror::Error)]
enum SpringProblem {
    #[error(transparent)]
    Parameter(#[from] InvalidParameter),
    #[error("its end {0} is not a particle")]
    MissingParticle(Entity),
    #[error("both of its ends are {0}")]
    Loop(Entity),
}

/// The slots of a spring's ends; `None` if an end is a particle that takes no part at present.
fn resolve_spring(
    spring: &Spring,
    particles: &Query<ParticleData>,
) -> Result<Option<[usize; 2]>, SpringProblem> {
    spring.validate()?;
    let [first, second] = spring.particles;
    if first == second {
        return Err(SpringProblem::Loop(first));
    }
    let slot_of = |entity| match particles.get(entity) {
        Ok((.., slot)) => Ok(slot.get()),
        Err(_) => Err(SpringProblem::MissingParticle(entity)),
    };
    let (first, second) = (slot_of(first)?, slot_of(second)?);
    Ok(first.zip(second).map(|(first, second)| [first, second]))
}
