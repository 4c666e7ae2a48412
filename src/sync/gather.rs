//! Components into arrays.

use std::time::Instant;

use bevy::math::Affine3A;
use bevy::prelude::*;

use crate::collider::PlaneCollider;
use crate::parameter;
use crate::particle::{AppliedForce, Particle, ParticleVelocity, Pinned};
use crate::solver::contacts::{Plane, Pose};
use crate::solver::{PinnedMotion, SolverState};

use super::Simulation;
use super::hierarchy::{to_world, world_transform};
use super::index::Index;
use super::roster::Slot;

/// What this tick found out about single particles.
#[derive(Resource, Default)]
pub(super) struct Gathered {
    /// When the tick began.
    pub start: Option<Instant>,
    /// When the scatter stage began.
    pub scatter_start: Option<Instant>,
    /// Particles with a parent: (number of ancestors, slot, entity).
    pub parented: Vec<(usize, usize, Entity)>,
    /// Slots whose position or velocity came in non-finite.
    pub faults: Vec<usize>,
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

/// Copies all particles into their slots.
pub(super) fn gather_particles(
    mut index: ResMut<Index>,
    mut simulation: ResMut<Simulation>,
    mut gathered: ResMut<Gathered>,
    free_standing: Query<ParticleData, Without<ChildOf>>,
    parented: Query<(ParticleData, &ChildOf)>,
    parents: Query<&ChildOf>,
    transforms: Query<&Transform>,
) {
    let Gathered { parented: parented_slots, faults, .. } = &mut *gathered;
    parented_slots.clear();
    faults.clear();
    let simulation = &mut *simulation;
    simulation.state.pinned.clear();
    let mut gathering = Gathering { index: &mut index, simulation, faults };
    for particle in &free_standing {
        let translation = particle.3.translation;
        gathering.copy(particle, translation);
    }
    let mut known_parent = None;
    for (particle, &ChildOf(parent)) in &parented {
        let (frame, depth) = match known_parent {
            Some((known, frame, depth)) if known == parent => (frame, depth),
            _ => world_transform(parent, &parents, |entity| transforms.get(entity).ok()),
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
}

struct Gathering<'a> {
    index: &'a mut Index,
    simulation: &'a mut Simulation,
    faults: &'a mut Vec<usize>,
}

impl Gathering<'_> {
    /// Copies one particle that stands at `position` in the world.
    fn copy(
        &mut self,
        particle: <ParticleData as bevy::ecs::query::QueryData>::Item<'_, '_>,
        position: Vec3,
    ) {
        let (entity, slot, particle, _, velocity, force, pinned) = particle;
        let Some(slot) = slot.get() else { return };
        let state = &mut self.simulation.state;
        if particle.validate().is_ok() {
            let inverse_mass = if pinned { 0.0 } else { 1.0 / particle.mass };
            if state.particles.inverse_mass[slot] != inverse_mass {
                state.particles.inverse_mass[slot] = inverse_mass;
                state.contacts.invalidate();
                self.simulation.bounds_are_stale = true;
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
            return Vec3::ZERO;
        }
        self.index.forgive(entity);
        force
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

/// Enrolls a plane.
pub(super) fn enroll_plane(added: On<Add, PlaneCollider>, mut index: ResMut<Index>) {
    index.planes.push((added.entity, None));
}

/// Strikes a plane off.
pub(super) fn leave_plane(removed: On<Remove, PlaneCollider>, mut index: ResMut<Index>) {
    index.planes.retain(|(entity, _)| *entity != removed.entity);
}

/// Copies all planes, moving from where they were in the last tick to where they are.
pub(super) fn gather_planes(
    mut index: ResMut<Index>,
    mut simulation: ResMut<Simulation>,
    mut gathered_planes: ResMut<GatheredPlanes>,
    planes: Query<&PlaneCollider>,
    parents: Query<&ChildOf>,
    transforms: Query<&Transform>,
) {
    simulation.state.contacts.planes.clear();
    gathered_planes.0.clear();
    let mut tracked = std::mem::take(&mut index.planes);
    for (entity, last_pose) in &mut tracked {
        let Ok(plane) = planes.get(*entity) else { continue };
        let (frame, _) = world_transform(*entity, &parents, |entity| transforms.get(entity).ok());
        let pose = pose_of(&frame);
        let problem = match pose {
            None => Some("its transform is not finite".to_owned()),
            Some(_) => plane.validate().err().map(|problem| problem.to_string()),
        };
        if let Some(problem) = problem {
            index.warn_once(*entity, format_args!("plane {entity} is left out of the simulation: {problem}"));
            *last_pose = None;
            continue;
        }
        index.forgive(*entity);
        let Some(target) = pose else { continue };
        let start = last_pose.replace(target).unwrap_or(target);
        let PlaneCollider { restitution, friction } = *plane;
        simulation.state.contacts.planes.push(Plane { start, target, restitution, friction });
        gathered_planes.0.push(*entity);
    }
    index.planes = tracked;
}

/// The entity of each of the solver's planes.
#[derive(Resource, Default)]
pub(super) struct GatheredPlanes(pub Vec<Entity>);

/// A plane's pose: the image of +Y is the normal, whatever the scale.
fn pose_of(frame: &Affine3A) -> Option<Pose> {
    let (_, rotation, point) = frame.to_scale_rotation_translation();
    (point.is_finite() && rotation.is_finite()).then_some(Pose { point, rotation })
}
