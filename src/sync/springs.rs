//! Springs: which were edited, what they do, and what can be wrong with them.

use bevy::ecs::entity::EntityHashSet;
use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::query::Allow;
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;

use crate::nets::PartState;
use crate::parameter::InvalidParameter;
use crate::particle::Particle;
use crate::solver;
use crate::spring::{Plasticity, Spring};

use super::Simulation;
use super::bends::{EditedBends, copy_edited_bends};
use super::registry::Slot;
use super::slots::{PartOfNet, ParticleData};
use super::state::{MassSpringState, Warnings};

/// Springs and whether they were edited.
type EditedSprings = (Entity, Ref<'static, Spring>, &'static Slot<Spring>);

/// Springs and bends that may have been edited, and the slots of their ends.
#[derive(SystemParam)]
pub(super) struct SpringQueries<'w, 's> {
    springs: Query<'w, 's, EditedSprings>,
    bends: EditedBends<'w, 's>,
    particles: Query<'w, 's, &'static Slot<Particle>>,
    parts: Query<'w, 's, &'static PartState>,
}

impl SpringQueries<'_, '_> {
    /// The slot of a particle, or of a part of one.
    fn slot_of(&self, end: Entity) -> Option<usize> {
        let of_part = || self.parts.get(end).ok().and_then(|part| part.slot).map(|slot| slot as usize);
        self.particles.get(end).map_or_else(|_| of_part(), Slot::get)
    }

    /// The springs in the simulation that end in one of these entities, in their order.
    pub fn ending_in(&self, ends: &EntityHashSet) -> Vec<Entity> {
        let springs = self
            .springs
            .iter()
            .filter(|(_, spring, _)| spring.particles.iter().any(|end| ends.contains(end)));
        let mut found: Vec<(usize, Entity)> =
            springs.filter_map(|(entity, _, slot)| Some((slot.get()?, entity))).collect();
        found.sort_unstable();
        found.into_iter().map(|(_, entity)| entity).collect()
    }
}

/// What became of the springs that were edited.
#[derive(Default)]
pub(super) struct Edits {
    /// Springs in the simulation that are now bad, or have other ends.
    pub relinked: Vec<Entity>,
    /// Bends likewise.
    pub relinked_bends: Vec<Entity>,
    /// Whether springs may have been corrected.
    pub retry: bool,
}

/// Copies the parameters of the springs that were edited.
pub(super) fn copy_edited_springs(
    state: &mut MassSpringState,
    simulation: &Simulation,
    warnings: &mut Warnings,
    queries: &SpringQueries,
) -> Edits {
    let mut edits = Edits::default();
    if state.version != simulation.version {
        // The slots are not those of this state yet: `Assignment::adopt` copies all springs.
        return edits;
    }
    for table in queries.springs.contiguous_iter().expect("these components are all stored in tables") {
        let (entities, springs, slots) = table;
        let (last_run, this_run) = (springs.last_run_tick(), springs.this_run_tick());
        for (row, tick) in springs.changed_ticks_slice().iter().enumerate() {
            if !tick.is_newer_than(last_run, this_run) {
                continue;
            }
            let slot_of = |end| queries.slot_of(end);
            let copied =
                slots[row].get().map(|slot| copy_spring(&springs[row], slot, slot_of, &mut state.solver));
            match copied {
                Some(true) => warnings.clear(entities[row]),
                Some(false) => edits.relinked.push(entities[row]),
                None => {}
            }
            edits.retry |= copied != Some(true);
        }
    }
    let slot_of = |end| queries.slot_of(end);
    edits.retry |=
        copy_edited_bends(state, simulation, warnings, &queries.bends, slot_of, &mut edits.relinked_bends);
    edits
}

/// Copies the parameters of a spring that joins the same particles as before; returns whether it does.
pub(super) fn copy_spring(
    spring: &Spring,
    slot: usize,
    slot_of: impl Fn(Entity) -> Option<usize>,
    solver: &mut solver::State,
) -> bool {
    let [Some(first), Some(second)] = spring.particles.map(slot_of) else { return false };
    if !solver.spring_joins(slot, [first, second]) || spring.validate().is_err() {
        return false;
    }
    solver.set_spring(slot, parameters(spring));
    true
}

pub(super) fn parameters(spring: &Spring) -> solver::Spring {
    let Spring { rest_length, stiffness, damping, tension_only, max_stretch, breaking_force, .. } = *spring;
    let plasticity = spring.plasticity.map(|Plasticity { yield_strain, max_strain, strain }| {
        solver::Plasticity { yield_strain, max_strain, strain }
    });
    solver::Spring {
        rest_length,
        stiffness,
        damping,
        tension_only,
        max_stretch,
        breaking_force,
        plasticity,
        tears: false,
    }
}

/// What can be wrong with a spring.
#[derive(Debug, thiserror::Error)]
pub(super) enum SpringProblem {
    #[error(transparent)]
    Parameter(#[from] InvalidParameter),
    #[error(transparent)]
    End(#[from] EndProblem),
    #[error("both of its ends are {0}")]
    Loop(Entity),
    #[error("both of its ends, the parts {0} and {1}, are particle {2} of a net")]
    SameParticle(Entity, Entity, u32),
}

/// What can be wrong with an end of a spring or bend.
#[derive(Debug, thiserror::Error)]
pub(super) enum EndProblem {
    #[error("its end {0} is not a particle")]
    MissingParticle(Entity),
    #[error("its end {0} is a part of {1} particles, expected one")]
    Several(Entity, usize),
}

/// The slot of an end: a particle, or a part of one. `None` if it takes no part at present.
pub(super) fn slot_of_end(
    entity: Entity,
    particles: &Query<ParticleData, Allow<Disabled>>,
    parts: &Query<PartOfNet, Allow<Disabled>>,
) -> Result<Option<usize>, EndProblem> {
    if let Ok((.., slot)) = particles.get(entity) {
        return Ok(slot.get());
    }
    match parts.get(entity) {
        Ok((_, part)) if part.particles.len() > 1 => Err(EndProblem::Several(entity, part.particles.len())),
        Ok((_, part)) => Ok(part.slot.map(|slot| slot as usize)),
        Err(_) => Err(EndProblem::MissingParticle(entity)),
    }
}

/// The slots of a spring's ends; `None` if an end is a particle that takes no part at present.
pub(super) fn resolve_spring(
    spring: &Spring,
    particles: &Query<ParticleData, Allow<Disabled>>,
    parts: &Query<PartOfNet, Allow<Disabled>>,
) -> Result<Option<[usize; 2]>, SpringProblem> {
    spring.validate()?;
    let [first, second] = spring.particles;
    if first == second {
        return Err(SpringProblem::Loop(first));
    }
    let slot_of = |entity| slot_of_end(entity, particles, parts);
    let ends = [first, second];
    let (first, second) = (slot_of(first)?, slot_of(second)?);
    if first.is_some() && first == second {
        let particle = parts.get(ends[0]).ok().and_then(|(_, part)| part.particles.first().copied());
        return Err(SpringProblem::SameParticle(ends[0], ends[1], particle.unwrap_or_default()));
    }
    Ok(first.zip(second).map(|(first, second)| [first, second]))
}
