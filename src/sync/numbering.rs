//! Slots for who came, and empty slots where somebody left; all anew only when too many are empty.

use bevy::ecs::system::SystemParam;
use bevy::prelude::*;

use crate::parameter::{self, InvalidParameter};
use crate::particle::{AppliedForce, Particle, ParticleVelocity, Pinned, Quarantined};
use crate::solver::ordering;
use crate::spring::Spring;

use super::Simulation;
use super::index::Index;
use super::restore::InitialParticle;
use super::roster::{Roster, Slot};

/// All slots are numbered anew when more than one in so many is empty, or if so many came or left in
/// one tick.
const MOST_NEWS: usize = 4;

/// All that the numbering reads of a particle.
type ParticleData = (
    &'static Particle,
    &'static Transform,
    &'static ParticleVelocity,
    Option<&'static AppliedForce>,
    Has<Pinned>,
    Has<Quarantined>,
    &'static mut Slot<Particle>,
);

type SpringData = (&'static Spring, &'static mut Slot<Spring>);

/// Springs and whether they were edited.
pub(super) type EditedSprings = (Entity, Ref<'static, Spring>, &'static Slot<Spring>);

/// Who may get a slot.
#[derive(SystemParam)]
pub(super) struct Applicants<'w, 's> {
    particles: Query<'w, 's, ParticleData>,
    springs: Query<'w, 's, SpringData>,
}

/// Gives slots to who came, and takes them from who left.
pub(super) fn refresh_slots(
    index: &mut Index,
    simulation: &mut Simulation,
    edits: &Edits,
    applicants: Applicants,
) {
    let Applicants { particles, springs } = applicants;
    let mended = |entity: &Entity| {
        particles.get(*entity).is_ok_and(|(particle, transform, velocity, ..)| {
            check_particle(particle, transform, velocity).is_ok()
        })
    };
    index.changed |= index.excluded.iter().any(mended);
    index.changed |= wants_renumbering(&index.particles) || wants_renumbering(&index.springs);
    let news = index.particles.news() + index.springs.news();
    if index.changed || news > 0 || edits.retry {
        simulation.bounds_are_stale |= index.changed;
        simulation.lone_particles_changed = true;
        let mut numbering = Numbering { index, simulation, particles, springs };
        if numbering.index.changed {
            numbering.renumber();
        } else {
            numbering.update(edits);
        }
        simulation.state.contacts.invalidate();
    }
}

/// Whether so many came or left that all slots are better numbered anew.
fn wants_renumbering<Initial>(roster: &Roster<Initial>) -> bool {
    (roster.news() + roster.vacant) * MOST_NEWS > roster.slots.len()
}

/// What became of the springs that somebody edited.
#[derive(Default)]
pub(super) struct Edits {
    /// Springs in the simulation that are now bad, or have other ends.
    relinked: Vec<Entity>,
    /// Whether springs may have been mended.
    retry: bool,
}

/// Copies the parameters of the springs that were edited.
pub(super) fn copy_edited_springs(
    index: &mut Index,
    simulation: &mut Simulation,
    springs: &Query<EditedSprings>,
) -> Edits {
    let mut edits = Edits::default();
    for table in springs.contiguous_iter().expect("these components are all stored in tables") {
        let (entities, springs, slots) = table;
        let (last_run, this_run) = (springs.last_run_tick(), springs.this_run_tick());
        for (row, tick) in springs.changed_ticks_slice().iter().enumerate() {
            if !tick.is_newer_than(last_run, this_run) {
                continue;
            }
            let copied = slots[row].get().map(|slot| copy_spring(&springs[row], slot, index, simulation));
            match copied {
                Some(true) => index.forgive(entities[row]),
                Some(false) => edits.relinked.push(entities[row]),
                None => {}
            }
            edits.retry |= copied != Some(true);
        }
    }
    edits
}

/// Copies the parameters of a spring that joins the same particles as before; says whether it does.
fn copy_spring(spring: &Spring, slot: usize, index: &Index, simulation: &mut Simulation) -> bool {
    let springs = &mut simulation.state.springs;
    if slot >= springs.len() {
        return false;
    }
    let (first, second) = springs.ends(slot);
    let ends = [first, second].map(|end| index.particles.slots.get(end).copied());
    if ends != spring.particles.map(Some) || spring.validate().is_err() {
        return false;
    }
    let known = (springs.stiffness()[slot], springs.damping()[slot]) == (spring.stiffness, spring.damping);
    simulation.bounds_are_stale |= !known;
    if springs.rest_length()[slot] != spring.rest_length || !known {
        simulation.state.contacts.invalidate();
    }
    springs.set_parameters(slot, spring.rest_length, spring.stiffness, spring.damping);
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

/// The slots and those who get them.
struct Numbering<'a> {
    index: &'a mut Index,
    simulation: &'a mut Simulation,
    particles: Query<'a, 'a, ParticleData>,
    springs: Query<'a, 'a, SpringData>,
}

impl Numbering<'_> {
    /// Numbers all particles and springs in the order of their rosters.
    fn renumber(&mut self) {
        let state = &mut self.simulation.state;
        let old_entities = std::mem::take(&mut self.index.particles.slots);
        let old_positions = std::mem::take(&mut state.particles.position);
        state.particles.resize(0);
        state.springs.clear();
        let Index { particles, springs, changed, fresh, excluded, waiting, .. } = &mut *self.index;
        *changed = false;
        fresh.clear();
        excluded.clear();
        waiting.clear();
        particles.start_anew();
        springs.start_anew();

        let mut new_slots = vec![None; old_entities.len()];
        self.admit_particles(|entity, old, new| {
            let old = old.filter(|old| old_entities.get(*old) == Some(&entity))?;
            new_slots[old] = Some(new as u32);
            Some(old_positions.get(old))
        });
        self.admit_new_springs();
        let state = &mut self.simulation.state;
        match ordering::better_order(&mut state.springs, state.particles.len()) {
            Some(order) => self.reorder(&order),
            None => state.contacts.renumber(&new_slots, self.index.particles.slots.len()),
        }
    }

    /// Gives each particle the slot of its place in `order`.
    fn reorder(&mut self, order: &[u32]) {
        let mut new_slots = vec![0; order.len()];
        let (slots, fresh) = (self.index.particles.slots.clone(), self.index.fresh.clone());
        let state = &mut self.simulation.state;
        let positions = state.particles.position.clone();
        for (new, old) in order.iter().map(|old| *old as usize).enumerate() {
            new_slots[old] = new as u32;
            self.index.particles.slots[new] = slots[old];
            self.index.fresh[new] = fresh[old];
            state.particles.position.set(new, positions.get(old));
            if let Ok((.., mut slot)) = self.particles.get_mut(slots[old]) {
                slot.set(Some(new));
            }
        }
        state.springs.renumber(&new_slots);
        state.contacts.forget();
    }

    /// Empties the slots of those who left and appends those who came.
    fn update(&mut self, edits: &Edits) {
        let (waited, present) = (self.index.waiting.len(), self.index.particles.slots.len());
        for slot in std::mem::take(&mut self.index.particles.departed) {
            self.let_go(slot);
        }
        for slot in std::mem::take(&mut self.index.springs.departed) {
            self.take_out(slot);
        }
        for &spring in &edits.relinked {
            self.suspend(spring);
        }
        self.admit_particles(|_, _, _| None);
        // Those that have waited for long go on waiting where nobody came for whom they might.
        let came = self.index.particles.slots.len() > present;
        let first = if came || edits.retry { 0 } else { waited };
        for spring in self.index.waiting.split_off(first) {
            self.admit_spring(spring);
        }
        self.admit_new_springs();
    }

    /// Empties the slot of a particle; its springs wait from now on.
    fn let_go(&mut self, slot: usize) {
        if !self.index.particles.vacate(slot) {
            return;
        }
        let state = &mut self.simulation.state;
        state.particles.vacate(slot);
        for spring in state.springs.ending_at(slot) {
            self.suspend(self.index.springs.slots[spring]);
        }
    }

    /// Takes a spring out of its slot and lets it wait.
    fn suspend(&mut self, entity: Entity) {
        let Ok((_, mut slot)) = self.springs.get_mut(entity) else { return };
        let old = slot.get();
        slot.set(None);
        if let Some(old) = old {
            self.take_out(old);
            self.index.waiting.push(entity);
        }
    }

    fn take_out(&mut self, slot: usize) {
        if self.index.springs.vacate(slot) {
            self.simulation.state.springs.remove(slot);
            self.simulation.bounds_are_stale = true;
        }
    }

    /// Looks at the entries that came since the last look. `past(entity, old slot, new slot)` is where a
    /// particle was in the last tick.
    fn admit_particles(&mut self, mut past: impl FnMut(Entity, Option<usize>, usize) -> Option<Vec3>) {
        let mut entries = self.index.particles.new_entries();
        entries.retain_mut(|entry| {
            let Ok((particle, transform, velocity, force, pinned, quarantined, mut slot)) =
                self.particles.get_mut(entry.entity)
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
                self.index.excluded.push(entry.entity);
                self.index.warn_once(
                    entry.entity,
                    format_args!("particle {} is left out of the simulation: {problem}", entry.entity),
                );
                return true;
            }
            self.index.forgive(entry.entity);
            entry
                .initial
                .get_or_insert_with(|| InitialParticle::new(particle, transform, velocity, force, pinned));
            let new_slot = self.index.particles.slots.len();
            slot.set(Some(new_slot));
            let last_position = past(entry.entity, old_slot, new_slot);
            self.index.fresh.push(last_position.is_none());
            self.index.particles.slots.push(entry.entity);
            // The rest is filled in by the gather.
            let position = last_position.unwrap_or(transform.translation);
            self.simulation.state.particles.push(position, Vec3::ZERO, f32::INFINITY, 0.0);
            true
        });
        self.index.particles.put_back(entries);
    }

    fn admit_new_springs(&mut self) {
        let mut entries = self.index.springs.new_entries();
        entries.retain_mut(|entry| {
            let Ok((spring, mut slot)) = self.springs.get_mut(entry.entity) else { return false };
            if !entry.is_valid(&slot) {
                return false;
            }
            entry.initial.get_or_insert(*spring);
            slot.set(None);
            self.admit_spring(entry.entity);
            true
        });
        self.index.springs.put_back(entries);
    }

    /// Gives a spring a slot, or lets it wait.
    fn admit_spring(&mut self, entity: Entity) {
        let Ok((spring, mut slot)) = self.springs.get_mut(entity) else { return };
        if slot.get().is_some() {
            return;
        }
        match resolve_spring(spring, &self.particles) {
            Ok(Some([first, second])) => {
                let roster = &mut self.index.springs;
                slot.set(Some(roster.slots.len()));
                roster.slots.push(entity);
                let springs = &mut self.simulation.state.springs;
                springs.push(first, second, spring.rest_length, spring.stiffness, spring.damping);
                self.simulation.bounds_are_stale = true;
                self.index.forgive(entity);
            }
            Ok(None) => {
                self.index.forgive(entity);
                self.index.waiting.push(entity);
            }
            Err(problem) => {
                let message = format_args!("spring {entity} is left out of the simulation: {problem}");
                self.index.warn_once(entity, message);
                self.index.waiting.push(entity);
            }
        }
    }
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
