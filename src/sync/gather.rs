//! Particles into arrays.

use std::sync::{Mutex, PoisonError};

use bevy::ecs::query::QueryData;
use bevy::ecs::system::SystemParam;
use bevy::platform::time::Instant;
use bevy::prelude::*;

use crate::parameter;
use crate::particle::{AppliedForce, Particle, ParticleVelocity, Pinned};
use crate::settings::Dimensions;
use crate::solver::particles::{self, set, split_off};
use crate::solver::{PinnedMotion, parallel};

use super::Simulation;
use super::colliders::{ColliderData, GatheredColliders, Motions, gather_colliders};
use super::contact_properties::{ContactPropertiesQueries, gather_contact_properties};
use super::easing::Easing;
use super::exemptions::GatheredExemptions;
use super::hierarchy::Hierarchy;
use super::nets::{GatheredNets, gather_nets};
use super::registry::Slot;
use super::slots::{self, Bookkeeping, Candidates, NetQuery};
use super::springs::{self, SpringQueries};
use super::state::{MassSpringState, Warnings};
use super::teleport::{self, Moved};
use super::view::{SAMPLE, View, choose_origin};

/// What this tick found out about single particles.
#[derive(Resource, Default)]
pub(super) struct Gathered {
    /// When the tick began.
    pub start: Option<Instant>,
    /// Particles with a parent: (number of ancestors, slot, entity).
    pub parented: Vec<(usize, usize, Entity)>,
    /// Free particles that were moved since the last tick.
    moved: Vec<Moved>,
    /// Slots where a position or velocity came in non-finite.
    pub faults: Vec<usize>,
    /// Particles with an applied force that is not finite, in the last tick and in this one.
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

/// A particle and its position, as the solver sees it.
struct Seen {
    position: Vec3,
    /// Whether its `Transform` is what the last tick wrote.
    is_unmoved: bool,
}

/// The particles without and with a parent.
#[derive(SystemParam)]
pub(super) struct Particles<'w, 's> {
    free_standing: Query<'w, 's, ParticleData, Without<ChildOf>>,
    parented: Query<'w, 's, (ParticleData, &'static ChildOf)>,
    /// Those without a parent; what is looked up one by one is faster without what is not needed.
    places: Query<'w, 's, &'static Transform, (With<Slot<Particle>>, Without<ChildOf>)>,
}

/// The whole stage, one system: each costs more to start than what there is to do in a small scene.
pub(super) fn gather(
    mut state: ResMut<MassSpringState>,
    mut simulation: ResMut<Simulation>,
    mut gathered: ResMut<Gathered>,
    mut gathered_colliders: ResMut<GatheredColliders>,
    mut queries: ParamSet<(SpringQueries, Candidates, Particles, NetQuery, ContactPropertiesQueries)>,
    mut bookkeeping: Bookkeeping,
    colliders: Query<ColliderData>,
    hierarchy: Hierarchy,
    (dimensions, time, mut easing, mut gathered_nets): (
        Res<Dimensions>,
        Res<Time>,
        Easing,
        ResMut<GatheredNets>,
    ),
    mut exemptions: Local<GatheredExemptions>,
) {
    gathered.start = Some(Instant::now());
    bookkeeping.initial.drop_despawned(bookkeeping.entities);
    let (state, simulation) = (&mut *state, &mut *simulation);
    let mut edits = springs::copy_edited_springs(state, simulation, &mut bookkeeping.warnings, &queries.p0());
    if !gathered_nets.relinked_parts.is_empty() {
        edits.relinked.extend(queries.p0().ending_in(&gathered_nets.relinked_parts));
        edits.retry = true;
        gathered_nets.relinked_parts.clear();
    }
    slots::refresh_slots(state, simulation, edits, queries.p1(), &mut gathered_nets, &mut bookkeeping);
    let warnings = &mut bookkeeping.warnings;
    let places = sample_nets(state, &gathered_nets, &queries.p3());
    let particles = queries.p2();
    move_origin(state, simulation, &particles, &hierarchy, places);
    let view = View::new(state.solver.origin, *dimensions);
    gather_particles(state, simulation, &mut gathered, warnings, &particles, &hierarchy, view);
    let Gathered { moved, .. } = &mut *gathered;
    gather_nets(state, simulation, &mut gathered_nets, warnings, &queries.p3(), view, moved);
    let motion_of_all = teleport::settle(state, simulation, &gathered.moved, view, &mut easing);
    let motions = Motions { view, of_all: motion_of_all, time_step: time.delta_secs() };
    let surfaces = queries.p4();
    exemptions.gather(&surfaces.1, &hierarchy);
    gather_colliders(
        state,
        simulation,
        &mut gathered_colliders,
        &mut bookkeeping,
        &colliders,
        (&hierarchy, &mut easing, &mut exemptions, &surfaces.1),
        motions,
    );
    gather_contact_properties(
        state,
        simulation,
        &mut bookkeeping.warnings,
        &surfaces,
        (&mut exemptions, &hierarchy),
    );
}

/// Where those particles of the sample are that belong to nets.
fn sample_nets(state: &MassSpringState, gathered: &GatheredNets, nets: &NetQuery) -> [Option<Vec3>; SAMPLE] {
    let mut places = [None; SAMPLE];
    if state.nets.entries.is_empty() {
        return places;
    }
    let slots = &state.particles.slots;
    let sample = slots.iter().enumerate().step_by(slots.len().div_ceil(SAMPLE).max(1));
    for (place, (slot, entity)) in places.iter_mut().zip(sample) {
        let particle = gathered.particle_at(state, *entity, slot);
        let net = nets.get(*entity).ok().map(|(net, ..)| net);
        *place =
            net.zip(particle).and_then(|(net, particle)| net.positions().get(particle as usize).copied());
    }
    places
}

/// Moves the solver's origin to where the particles are, if they are far from it.
fn move_origin(
    state: &mut MassSpringState,
    simulation: &mut Simulation,
    particles: &Particles,
    hierarchy: &Hierarchy,
    places_of_nets: [Option<Vec3>; SAMPLE],
) {
    let slots = &state.particles.slots;
    let places = slots.iter().step_by(slots.len().div_ceil(SAMPLE).max(1)).filter_map(|entity| {
        if let Ok(transform) = particles.places.get(*entity) {
            return Some(transform.translation);
        }
        let ((_, _, _, transform, ..), ChildOf(parent)) = particles.parented.get(*entity).ok()?;
        Some(hierarchy.world_transform(*parent).0.transform_point3(transform.translation))
    });
    let places = places.chain(places_of_nets.into_iter().flatten());
    let origin = choose_origin(state.solver.origin, places);
    simulation.unshifted.resize(0);
    if origin != state.solver.origin {
        simulation.unshifted.copy_from(&state.solver.particles.position);
        simulation.shift = origin - state.solver.origin;
        state.solver.move_origin(origin);
    }
}

/// Copies all particles into their slots: those without a parent by whole tables, the others one by one.
fn gather_particles(
    state: &mut MassSpringState,
    simulation: &mut Simulation,
    gathered: &mut Gathered,
    warnings: &mut Warnings,
    particles: &Particles,
    hierarchy: &Hierarchy,
    view: View,
) {
    let Gathered {
        parented: parented_slots,
        moved,
        faults,
        bad_forces: [old_bad_forces, bad_forces],
        exceptions,
        ..
    } = gathered;
    parented_slots.clear();
    faults.clear();
    std::mem::swap(old_bad_forces, bad_forces);
    bad_forces.clear();
    simulation.inputs.pinned.clear();
    state.solver.particles.applied_force.fill(Vec3::ZERO);
    moved.clear();
    if view.is_flat {
        state.solver.particles.position.z.fill(0.0);
    }
    let mut gathering = Gathering { state, simulation, warnings, moved, faults, bad_forces, view };
    let tables = particles.free_standing.contiguous_iter();
    for table in tables.expect("these components are all stored in tables") {
        gathering.copy_table(table, exceptions);
    }
    let mut known_parent = None;
    for (particle, &ChildOf(parent)) in &particles.parented {
        let (frame, depth) = match known_parent {
            Some((known, frame, depth)) if known == parent => (frame, depth),
            _ => {
                let (frame, depth) = hierarchy.world_transform(parent);
                (view.frame_to_solver(frame), depth)
            }
        };
        known_parent = Some((parent, frame, depth));
        let local = particle.3.translation;
        let is_unmoved = particle.1.get().is_some_and(|slot| {
            let last = gathering.state.solver.particles.position.get(slot);
            view.solver_to_child(&frame, last, local) == local
        });
        gathering.copy(particle, Seen { position: view.child_to_solver(&frame, local), is_unmoved });
        if let Some(slot) = particle.1.get() {
            parented_slots.push((depth, slot, particle.0));
        }
    }
    // Parents first: a particle may be the parent of another.
    parented_slots.sort_unstable_by_key(|(depth, slot, _)| (*depth, *slot));
    for entity in old_bad_forces.iter().filter(|entity| !bad_forces.contains(entity)) {
        warnings.clear(*entity);
    }
}

struct Gathering<'a> {
    state: &'a mut MassSpringState,
    simulation: &'a mut Simulation,
    warnings: &'a mut Warnings,
    moved: &'a mut Vec<Moved>,
    faults: &'a mut Vec<usize>,
    bad_forces: &'a mut Vec<Entity>,
    view: View,
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
            rows.copy_unmoved(&mut self.state.solver.particles, self.view, exceptions);
        }
        for &row in &*exceptions {
            let force = forces.map(|forces| &forces[row]);
            let (transform, velocity) = (&transforms[row], &velocities[row]);
            let data = (entities[row], &slots[row], &particles[row], transform, velocity, force, pinned);
            let Some(slot) = slots[row].get() else { continue };
            let last = self.state.solver.particles.position.get(slot);
            let translation = transform.translation;
            let is_unmoved = self.view.to_world(last, translation) == translation;
            self.copy(data, Seen { position: self.view.to_solver(translation), is_unmoved });
        }
    }

    /// Copies one particle.
    fn copy(&mut self, particle: <ParticleData as QueryData>::Item<'_, '_>, seen: Seen) {
        let Seen { position, is_unmoved } = seen;
        let (entity, slot, particle, _, velocity, force, pinned) = particle;
        let Some(slot) = slot.get() else { return };
        if particle.validate().is_ok() {
            let inverse_mass = if pinned { 0.0 } else { 1.0 / particle.mass };
            self.state.solver.set_particle(slot, inverse_mass, particle.radius);
        } else {
            // The last good values serve for this tick; the next one leaves the particle out.
            self.state.is_outdated = true;
        }
        let velocity = self.view.flatten(velocity.0);
        let finite = position.is_finite() && velocity.is_finite();
        if !finite {
            self.faults.push(slot);
        }
        let force = self.checked_force(entity, force);
        let solver = &mut self.state.solver;
        solver.particles.applied_force.set(slot, force);
        if pinned {
            self.pin(slot, position, finite);
        } else if finite {
            if self.simulation.fresh[slot] {
                solver.particles.position.set(slot, position);
            } else if !is_unmoved {
                let keeps_velocity = solver.particles.velocity.get(slot) != velocity;
                self.moved.push(Moved { slot, position, keeps_velocity });
            }
            solver.particles.velocity.set(slot, velocity);
        } else {
            solver.particles.velocity.set(slot, Vec3::ZERO);
        }
    }

    /// Sends a pinned particle from where it was to `target`.
    fn pin(&mut self, slot: usize, target: Vec3, finite: bool) {
        let position = &mut self.state.solver.particles.position;
        let last = position.get(slot);
        let target = if finite { target } else { last };
        let start = if self.simulation.fresh[slot] { target } else { last };
        position.set(slot, start);
        self.simulation.inputs.pinned.push(PinnedMotion { slot, start, target });
    }

    fn checked_force(&mut self, entity: Entity, force: Option<&AppliedForce>) -> Vec3 {
        let force = self.view.flatten(force.map_or(Vec3::ZERO, |force| force.0));
        if let Err(problem) = parameter::finite("applied force", force) {
            self.warnings.warn_once(entity, format_args!("particle {entity} is not pushed: {problem}"));
            self.bad_forces.push(entity);
            return Vec3::ZERO;
        }
        force
    }
}

/// Number of rows of a table that are copied as one part.
pub(super) const ROWS: usize = 4096;

/// Number of rows from which on the parts are shared among threads: to wake one takes a third of the time in which
/// they are copied one way.
pub(super) const MIN_SHARED: usize = 16_384;

/// A table of free particles.
struct Rows<'a> {
    slots: &'a [Slot<Particle>],
    particles: &'a [Particle],
    transforms: &'a [Transform],
    velocities: &'a [ParticleVelocity],
}

impl Rows<'_> {
    /// Copies the velocities of those with good values and known parameters that are where the last tick left them.
    /// The others are `exceptions`, in order.
    fn copy_unmoved(&self, to: &mut particles::Particles, view: View, exceptions: &mut Vec<usize>) {
        let (position, velocity, inverse_mass, radius) = to.motion_mut();
        let (count, size) = (self.slots.len(), if self.are_in_order() { ROWS } else { self.slots.len() });
        let (mut velocities, mut passed) = (velocity.axes_mut(), 0);
        let parts = (0..count).step_by(size.max(1)).map(|first| {
            // A part owns the slots up to the first one of the next part.
            let end = self.slots.get(first + size).and_then(Slot::get).unwrap_or(inverse_mass.len());
            let start = std::mem::replace(&mut passed, end);
            let rows = first..count.min(first + size);
            (rows, start, split_off(&mut velocities, end - start))
        });
        let found = Mutex::new(&mut *exceptions);
        parallel::for_each(parts, count >= MIN_SHARED, |(rows, start, mut velocities)| {
            for row in rows {
                let Some(slot) = self.slots[row].get() else { continue };
                let (particle, translation, velocity) =
                    (&self.particles[row], self.transforms[row].translation, self.velocities[row].0);
                // Zero times a finite number is zero; the sum is finite unless one of the six is not, or
                // nearly so.
                let checksum = (translation + velocity).element_sum() * 0.0;
                let is_known = 1.0 / particle.mass == inverse_mass[slot] && particle.radius == radius[slot];
                let place = slot.wrapping_sub(start);
                let is_ours = is_known && checksum == 0.0 && place < velocities[0].len();
                if is_ours && view.to_world(position.get(slot), translation) == translation {
                    set(&mut velocities, place, view.flatten(velocity));
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
