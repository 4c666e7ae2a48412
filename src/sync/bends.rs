//! Bends: registered, copied, pending and removed as springs are.

use bevy::ecs::entity::{EntityMapper, MapEntities};
use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::query::Allow;
use bevy::prelude::*;

use crate::bend::Bend;
use crate::parameter::InvalidParameter;
use crate::settings::OrphanedSprings;
use crate::solver;

use super::Simulation;
use super::registry::{Registry, Slot};
use super::slots::{Assignment, Candidates, PartOfNet, ParticleData};
use super::springs::{EndProblem, slot_of_end};
use super::state::{MassSpringState, Registered, Warnings};

/// The bends in the order of spawning. Their slots are the numbers of rods in the solver, among which those of nets
/// have the placeholder.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct BendRegistry {
    pub all: Registry,
    /// Those that wait for an end, to be corrected or enabled.
    pub pending: Vec<Entity>,
}

impl BendRegistry {
    /// Takes all slots away.
    pub fn reset_slots(&mut self) {
        self.all.reset_slots();
        self.pending.clear();
    }
}

impl MapEntities for BendRegistry {
    fn map_entities<M: EntityMapper>(&mut self, mapper: &mut M) {
        self.all.map_entities(mapper);
        self.pending.iter_mut().for_each(|entity| *entity = mapper.get_mapped(*entity));
    }
}

impl Registered for Bend {
    fn registry(state: &mut MassSpringState) -> &mut Registry {
        &mut state.bends.all
    }
}

/// All that the assignment reads of a bend.
pub(super) type BendData = (&'static Bend, Has<Disabled>, &'static mut Slot<Bend>);

/// Bends and whether they were edited.
pub(super) type EditedBends<'w, 's> = Query<'w, 's, (Entity, Ref<'static, Bend>, &'static Slot<Bend>)>;

/// What can be wrong with a bend.
#[derive(Debug, thiserror::Error)]
enum BendProblem {
    #[error(transparent)]
    Parameter(#[from] InvalidParameter),
    #[error(transparent)]
    End(#[from] EndProblem),
    #[error("two of its ends are {0}")]
    Loop(Entity),
    #[error("two of its ends, one of them {0}, are the same particle of a net")]
    SameParticle(Entity),
}

fn parameters(bend: &Bend) -> solver::Bend<3> {
    let Bend { stiffness, damping, .. } = *bend;
    solver::Bend { rest_length: 0.0, stiffness, damping, weights: [1.0, -2.0, 1.0] }
}

/// Copies the parameters of a bend that joins the same particles as before; returns whether it does.
fn copy_bend(
    bend: &Bend,
    slot: usize,
    slot_of: impl Fn(Entity) -> Option<usize>,
    solver: &mut solver::State,
) -> bool {
    let ends = solver.rod_ends(slot);
    let is_same = bend.particles.map(slot_of) == ends.map(Some) && bend.validate().is_ok();
    if is_same {
        solver.set_rod(slot, parameters(bend));
    }
    is_same
}

/// Copies the parameters of the bends that were edited; those that are now bad or have other ends are `relinked`.
/// Returns whether bends may have been corrected.
pub(super) fn copy_edited_bends(
    state: &mut MassSpringState,
    simulation: &Simulation,
    warnings: &mut Warnings,
    bends: &EditedBends,
    slot_of: impl Fn(Entity) -> Option<usize>,
    relinked: &mut Vec<Entity>,
) -> bool {
    let mut retry = false;
    if state.version != simulation.version {
        return retry;
    }
    for (entity, bend, slot) in bends.iter().filter(|(_, bend, _)| bend.is_changed()) {
        let copied = slot.get().map(|slot| copy_bend(&bend, slot, &slot_of, &mut state.solver));
        match copied {
            Some(true) => warnings.clear(entity),
            Some(false) => relinked.push(entity),
            None => {}
        }
        retry |= copied != Some(true);
    }
    retry
}

/// The slots of a bend's ends; `None` if an end is a particle that takes no part at present.
fn resolve(
    bend: &Bend,
    particles: &Query<ParticleData, Allow<Disabled>>,
    parts: &Query<PartOfNet, Allow<Disabled>>,
) -> Result<Option<[usize; 3]>, BendProblem> {
    bend.validate()?;
    let mut slots = [None; 3];
    for (index, end) in bend.particles.into_iter().enumerate() {
        if bend.particles[..index].contains(&end) {
            return Err(BendProblem::Loop(end));
        }
        let slot = slot_of_end(end, particles, parts)?;
        if slot.is_some() && slots[..index].contains(&slot) {
            return Err(BendProblem::SameParticle(end));
        }
        slots[index] = slot;
    }
    let [first, middle, last] = slots;
    Ok(first.zip(middle).zip(last).map(|((first, middle), last)| [first, middle, last]))
}

impl Assignment<'_, '_, '_, '_, '_> {
    /// Empties the slots of the bends that were removed, or are now bad.
    pub fn remove_bends(&mut self, relinked: &[Entity]) {
        for slot in std::mem::take(&mut self.state.bends.all.removed) {
            self.remove_bend(slot as usize);
        }
        relinked.iter().for_each(|bend| self.suspend_bend(*bend));
    }

    /// Takes the bends at a particle out: they are pending from now on.
    pub fn suspend_bends_at(&mut self, particle: usize) {
        let MassSpringState { bends, solver, .. } = &*self.state;
        let slots = bends.all.slots.iter().enumerate().filter(|(_, bend)| **bend != Entity::PLACEHOLDER);
        let at = slots.filter(|(slot, _)| solver.rod_ends(*slot).contains(&particle));
        let bends: Vec<Entity> = at.map(|(_, bend)| *bend).collect();
        bends.into_iter().for_each(|bend| self.suspend_bend(bend));
    }

    /// Takes a bend out of its slot; it is pending from now on.
    pub fn suspend_bend(&mut self, entity: Entity) {
        let Ok((.., mut slot)) = self.candidates.bends.get_mut(entity) else { return };
        let old = slot.get();
        slot.set(None);
        if let Some(old) = old {
            self.remove_bend(old);
            self.state.bends.pending.push(entity);
        }
    }

    fn remove_bend(&mut self, slot: usize) {
        if self.state.bends.all.vacate(slot) {
            self.state.solver.remove_rod(slot);
        }
    }

    /// Adds the bends that were added since the last time, and those that were pending before if one of their ends
    /// may have come: `retry`.
    pub fn add_bends(&mut self, retry: bool) {
        if retry {
            for bend in std::mem::take(&mut self.state.bends.pending) {
                self.add_bend(bend);
            }
        }
        let mut entries = self.state.bends.all.take_new();
        entries.retain_mut(|entry| {
            let Ok((bend, _, mut slot)) = self.candidates.bends.get_mut(entry.entity) else { return false };
            if !entry.is_valid(&slot) {
                return false;
            }
            if !std::mem::replace(&mut entry.is_recorded, true) {
                self.bookkeeping.initial.record_bend(entry.entity, *bend);
            }
            slot.set(None);
            self.add_bend(entry.entity);
            true
        });
        self.state.bends.all.put_back(entries);
    }

    /// Gives a bend a slot, or leaves it pending.
    fn add_bend(&mut self, entity: Entity) {
        let Candidates { particles, parts, bends, .. } = &mut self.candidates;
        let Ok((bend, is_disabled, mut slot)) = bends.get_mut(entity) else { return };
        if slot.get().is_some() {
            return;
        }
        let bookkeeping = &mut *self.bookkeeping;
        let is_orphan = bend.particles.iter().any(|end| self.state.despawned.contains(end));
        if is_orphan && *bookkeeping.orphaned_springs == OrphanedSprings::Despawn {
            bookkeeping.commands.entity(entity).try_despawn();
            return;
        }
        let resolved = if is_disabled { Ok(None) } else { resolve(bend, particles, parts) };
        if let Err(problem) = resolved {
            let message = format_args!("bend {entity} is left out of the simulation: {problem}");
            bookkeeping.warnings.warn_once(entity, message);
            self.state.bends.pending.push(entity);
            return;
        }
        if !is_disabled {
            bookkeeping.warnings.clear(entity);
        }
        let Ok(Some(ends)) = resolved else {
            self.state.bends.pending.push(entity);
            return;
        };
        let number = self.state.solver.add_rod(ends, parameters(bend));
        slot.set(Some(number));
        self.state.bends.all.slots.resize(number, Entity::PLACEHOLDER);
        self.state.bends.all.slots.push(entity);
    }

    /// The bends in the simulation, with the parameters that they had in the last tick.
    pub fn past_bends(&self) -> Vec<(Entity, solver::Bend<3>)> {
        let entities = self.state.bends.all.slots.iter().copied();
        let past = entities.zip(self.state.solver.past_rods());
        past.filter(|(entity, _)| *entity != Entity::PLACEHOLDER).collect()
    }

    /// Bends that were in the simulation before go on from the parameters that they had in the last tick.
    pub fn remember_bends(&mut self, past: &[(Entity, solver::Bend<3>)]) {
        for (entity, past) in past {
            let slot = self.candidates.bends.get(*entity).ok().and_then(|(.., slot)| slot.get());
            if let Some(slot) = slot {
                self.state.solver.set_past_rod(slot, *past);
            }
        }
    }

    /// Takes over the bends of a state that was put back.
    pub fn adopt_bends(&mut self) {
        let bends = &mut self.candidates.bends;
        bends.iter_mut().for_each(|(.., mut slot)| *slot = Slot::default());
        let mut disabled = Vec::new();
        self.state.bends.all.adopt(|entry, slot, _| {
            let Ok((_, is_disabled, mut to)) = bends.get_mut(entry.entity) else { return false };
            entry.assign(&mut *to, slot);
            disabled.extend((is_disabled && slot.is_some()).then_some(entry.entity));
            true
        });
        disabled.into_iter().for_each(|bend| self.suspend_bend(bend));
    }

    /// Copies the parameters of all bends in the simulation; those with other ends are pending from now on.
    pub fn copy_all_bends(&mut self) {
        let Candidates { particles, parts, bends, .. } = &self.candidates;
        let mut relinked = Vec::new();
        for &entity in self.state.bends.all.slots.iter().filter(|entity| **entity != Entity::PLACEHOLDER) {
            let Ok((bend, _, slot)) = bends.get(entity) else { continue };
            let slot_of = |end| slot_of_end(end, particles, parts).ok().flatten();
            if slot.get().is_some_and(|slot| !copy_bend(bend, slot, slot_of, &mut self.state.solver)) {
                relinked.push(entity);
            }
        }
        relinked.into_iter().for_each(|bend| self.suspend_bend(bend));
    }
}
