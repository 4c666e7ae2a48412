//! Particles into arrays.

use std::sync::{Mutex, PoisonError};

use bevy::ecs::query::QueryData;
use bevy::ecs::system::SystemParam;
use bevy::platform::time::Instant;
use bevy::prelude::*;

use crate::collider::PlaneCollider;
use crate::parameter;
use crate::particle::{AppliedForce, Particle, ParticleVelocity, Pinned};
use crate::solver::particles::{cut_off, set};
use crate::solver::{self, PinnedMotion, SolverState, blocks};

use super::Simulation;
use super::hierarchy::{Hierarchy, to_world};
use super::index::Index;
use super::numbering::{self, Applicants, EditedSprings};
use super::planes::{GatheredPlanes, gather_planes};
use super::roster::Slot;

/// What this tick found out about single particles.
#[derive(Resource, Default)]
pub(super) struct Gathered {
    /// When the tick began.
    pub start: Option<Instant>,
    /// Particles with a parent: (number of ancestors, slot, entity).
    pub parented: Vec<(usize, usize, Entity)>,
    /// Slots whose position or velocity came in non-finite.
    pub faults: Vec<usize>,
    /// Particles whose applied force is not finite, in the last tick and in this one.
    bad_forces: [Vec<Entity>; 2],
    /// Rows of a table that are copied one by one.
    exceptions: Vec<usize>,
}

/// All that a tick reads of a particle.
type ParticleData = (
    Entity,
    &'static Slot<Particle>,
    &'static Particle,
    &'static Transform,
    &'static ParticleVelocity,
    Option<&'static AppliedForce>,
    Has<Pinned>,
);

/// The particles without and with a parent.
#[derive(SystemParam)]
pub(super) struct Particles<'w, 's> {
    free_standing: Query<'w, 's, ParticleData, Without<ChildOf>>,
    parented: Query<'w, 's, (ParticleData, &'static ChildOf)>,
}

/// The whole stage, one system: each costs more to start than what there is to do in a small scene.
pub(super) fn gather(
    mut index: ResMut<Index>,
    mut simulation: ResMut<Simulation>,
    mut gathered: ResMut<Gathered>,
    mut gathered_planes: ResMut<GatheredPlanes>,
    mut queries: ParamSet<(Query<EditedSprings>, Applicants, Particles)>,
    planes: Query<&PlaneCollider>,
    hierarchy: Hierarchy,
) {
    gathered.start = Some(Instant::now());
    let (index, simulation) = (&mut *index, &mut *simulation);
    let edits = numbering::copy_edited_springs(index, simulation, &queries.p0());
    numbering::refresh_slots(index, simulation, &edits, queries.p1());
    gather_particles(index, simulation, &mut gathered, &queries.p2(), &hierarchy);
    gather_planes(index, simulation, &mut gathered_planes, &planes, &hierarchy);
}

/// Copies all particles into their slots: those without a parent by whole tables, the others one by one.
fn gather_particles(
    index: &mut Index,
    simulation: &mut Simulation,
    gathered: &mut Gathered,
    particles: &Particles,
    hierarchy: &Hierarchy,
) {
    let Gathered {
        parented: parented_slots,
        faults,
        bad_forces: [old_bad_forces, bad_forces],
        exceptions,
        ..
    } = gathered;
    parented_slots.clear();
    faults.clear();
    std::mem::swap(old_bad_forces, bad_forces);
    bad_forces.clear();
    simulation.state.pinned.clear();
    simulation.state.particles.applied_force.fill(Vec3::ZERO);
    let mut gathering = Gathering { index, simulation, faults, bad_forces };
    let tables = particles.free_standing.contiguous_iter();
    for table in tables.expect("these components are all stored in tables") {
        gathering.copy_table(table, exceptions);
    }
    let mut known_parent = None;
    for (particle, &ChildOf(parent)) in &particles.parented {
        let (frame, depth) = match known_parent {
            Some((known, frame, depth)) if known == parent => (frame, depth),
            _ => hierarchy.world_transform(parent),
        };
        known_parent = Some((parent, frame, depth));
        gathering.copy(particle, to_world(&frame, particle.3.translation));
        if let Some(slot) = particle.1.get() {
            parented_slots.push((depth, slot, particle.0));
        }
    }
    // Parents first: a particle may be the parent of another.
    parented_slots.sort_unstable_by_key(|(depth, slot, _)| (*depth, *slot));
    index.fresh.fill(false);
    for entity in old_bad_forces.iter().filter(|entity| !bad_forces.contains(entity)) {
        index.forgive(*entity);
    }
}

struct Gathering<'a> {
    index: &'a mut Index,
    simulation: &'a mut Simulation,
    faults: &'a mut Vec<usize>,
    bad_forces: &'a mut Vec<Entity>,
}

impl Gathering<'_> {
    /// Copies the particles of one table, which stand in the world without a parent.
    fn copy_table(
        &mut self,
        table: <ParticleData as bevy::ecs::query::ContiguousQueryData>::Contiguous<'_, '_>,
        exceptions: &mut Vec<usize>,
    ) {
        let (entities, slots, particles, transforms, velocities, forces, pinned) = table;
        exceptions.clear();
        if pinned || forces.is_some() {
            exceptions.extend(0..entities.len());
        } else {
            let rows = Rows { slots, particles, transforms, velocities };
            rows.copy_unchanged(&mut self.simulation.state.particles, exceptions);
        }
        for &row in &*exceptions {
            let force = forces.map(|forces| &forces[row]);
            let (transform, velocity) = (&transforms[row], &velocities[row]);
            let data = (entities[row], &slots[row], &particles[row], transform, velocity, force, pinned);
            self.copy(data, transform.translation);
        }
    }

    /// Copies one particle that stands at `position` in the world.
    fn copy(&mut self, particle: <ParticleData as QueryData>::Item<'_, '_>, position: Vec3) {
        let (entity, slot, particle, _, velocity, force, pinned) = particle;
        let Some(slot) = slot.get() else { return };
        let state = &mut self.simulation.state;
        if particle.validate().is_ok() {
            let inverse_mass = if pinned { 0.0 } else { 1.0 / particle.mass };
            if state.particles.inverse_mass[slot] != inverse_mass {
                state.particles.inverse_mass[slot] = inverse_mass;
                state.contacts.invalidate();
                // Springs that came with it have said so themselves.
                self.simulation.bounds_are_stale |= !self.index.fresh[slot];
            }
            if state.particles.radius[slot] != particle.radius {
                state.particles.radius[slot] = particle.radius;
                state.contacts.invalidate();
            }
        } else {
            // The last good values serve for this tick; the next one leaves the particle out.
            self.index.changed = true;
        }
        let finite = position.is_finite() && velocity.is_finite();
        if !finite {
            self.faults.push(slot);
        }
        let force = self.checked_force(entity, force);
        let state = &mut self.simulation.state;
        state.particles.applied_force.set(slot, force);
        if pinned {
            pin(state, slot, position, self.index.fresh[slot], finite);
        } else if finite {
            state.particles.position.set(slot, position);
            state.particles.velocity.set(slot, velocity.0);
        } else {
            state.particles.velocity.set(slot, Vec3::ZERO);
        }
    }

    fn checked_force(&mut self, entity: Entity, force: Option<&AppliedForce>) -> Vec3 {
        let force = force.map_or(Vec3::ZERO, |force| force.0);
        if let Err(problem) = parameter::finite("applied force", force) {
            self.index.warn_once(entity, format_args!("particle {entity} is not pushed: {problem}"));
            self.bad_forces.push(entity);
            return Vec3::ZERO;
        }
        force
    }
}

/// So many rows of a table are copied as one part.
pub(super) const ROWS: usize = 4096;

/// From so many rows on the parts are shared among threads: to wake one takes a third of the time in which they
/// are copied one way.
pub(super) const WORTH_SHARING: usize = 16_384;

/// A table of free particles.
struct Rows<'a> {
    slots: &'a [Slot<Particle>],
    particles: &'a [Particle],
    transforms: &'a [Transform],
    velocities: &'a [ParticleVelocity],
}

impl Rows<'_> {
    /// Copies those with which all is well and whose parameters are known already. The others are
    /// `exceptions`, in order.
    fn copy_unchanged(&self, to: &mut solver::Particles, exceptions: &mut Vec<usize>) {
        let solver::Particles { position, velocity, inverse_mass, radius, .. } = to;
        let (count, size) = (self.slots.len(), if self.are_in_order() { ROWS } else { self.slots.len() });
        let (mut positions, mut velocities, mut passed) = (position.axes_mut(), velocity.axes_mut(), 0);
        let parts = (0..count).step_by(size.max(1)).map(|first| {
            // A part owns the slots up to the first one of the next part.
            let end = self.slots.get(first + size).and_then(Slot::get).unwrap_or(inverse_mass.len());
            let start = std::mem::replace(&mut passed, end);
            let rows = first..count.min(first + size);
            (rows, start, cut_off(&mut positions, end - start), cut_off(&mut velocities, end - start))
        });
        let found = Mutex::new(&mut *exceptions);
        blocks::for_each(parts, count >= WORTH_SHARING, |(rows, start, mut positions, mut velocities)| {
            for row in rows {
                let Some(slot) = self.slots[row].get() else { continue };
                let (particle, position, velocity) =
                    (&self.particles[row], self.transforms[row].translation, self.velocities[row].0);
                // Zero times a finite number is zero; the sum is finite unless one of the six is not, or
                // nearly so.
                let checksum = (position + velocity).element_sum() * 0.0;
                let known = 1.0 / particle.mass == inverse_mass[slot] && particle.radius == radius[slot];
                let place = slot.wrapping_sub(start);
                if known && checksum == 0.0 && place < positions[0].len() {
                    set(&mut positions, place, position);
                    set(&mut velocities, place, velocity);
                } else {
                    found.lock().unwrap_or_else(PoisonError::into_inner).push(row);
                }
            }
        });
        exceptions.sort_unstable();
    }

    /// Whether the first rows of all parts are in the order of their slots.
    fn are_in_order(&self) -> bool {
        let mut firsts = self.slots.iter().step_by(ROWS).map(Slot::get);
        firsts.all(|slot| slot.is_some()) && self.slots.iter().step_by(ROWS).is_sorted_by_key(Slot::get)
    }
}

/// Sends a pinned particle from where it was to `target`.
fn pin(state: &mut SolverState, slot: usize, target: Vec3, fresh: bool, finite: bool) {
    let last = state.particles.position.get(slot);
    let target = if finite { target } else { last };
    let start = if fresh { target } else { last };
    state.particles.position.set(slot, start);
    state.pinned.push(PinnedMotion { slot, start, target });
}
