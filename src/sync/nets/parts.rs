//! Parts of nets: their pins, forces and motions are applied to the nets before a tick, their places read back after it.

use std::sync::Arc;

use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::query::Allow;
use bevy::ecs::system::SystemParam;
use bevy::math::{Affine3A, DAffine3, DQuat};
use bevy::prelude::*;

use super::super::hierarchy::{to_local, to_world, world_transform};
use super::super::snapshot::InitialState;
use super::super::state::{MassSpringState, Warnings};
use super::gather::GatheredNets;
use crate::nets::{Arrays, NetPose, Part, PartState, ParticleNet, Parts};
use crate::particle::{AppliedForce, ParticleVelocity, Pinned};

/// All that a tick reads of a part.
type PartData = (
    Ref<'static, Part>,
    &'static mut PartState,
    &'static mut ParticleVelocity,
    Option<&'static AppliedForce>,
    Has<Pinned>,
);

/// Parts and the entities above them.
#[derive(SystemParam)]
pub(in crate::sync) struct PartQueries<'w, 's> {
    parts: Query<'w, 's, PartData>,
    transforms: Query<'w, 's, &'static mut Transform, Allow<Disabled>>,
    parents: Query<'w, 's, &'static ChildOf, Allow<Disabled>>,
}

impl PartQueries<'_, '_> {
    /// The frame of an entity's parent, and the number of its ancestors.
    fn parent_frame(&self, entity: Entity) -> (Affine3A, usize) {
        let parent_of = |entity| self.parents.get(entity).ok().map(ChildOf::parent);
        let Some(parent) = parent_of(entity) else { return (Affine3A::IDENTITY, 0) };
        let (frame, depth) = world_transform(parent, parent_of, |entity| self.transforms.get(entity).ok());
        (frame, depth + 1)
    }

    /// The pose of an entity in the world.
    fn world_pose(&self, entity: Entity) -> Option<(Vec3, Quat)> {
        let transform = self.transforms.get(entity).ok()?;
        Some(self.pose_in_world(entity, transform.translation, transform.rotation))
    }

    /// A pose in the frame of an entity's parent, seen from the world.
    fn pose_in_world(&self, entity: Entity, translation: Vec3, rotation: Quat) -> (Vec3, Quat) {
        let (frame, depth) = self.parent_frame(entity);
        if depth == 0 {
            return (translation, rotation);
        }
        let (_, parent, _) = frame.to_scale_rotation_translation();
        (to_world(&frame, translation), parent * rotation)
    }

    /// Moves an entity to a pose in the world; its rotation only if it has one.
    fn move_to(&mut self, entity: Entity, place: Vec3, rotation: Option<Quat>) {
        let (frame, depth) = self.parent_frame(entity);
        let Ok(mut transform) = self.transforms.get_mut(entity) else { return };
        let local = if depth == 0 { place } else { to_local(&frame, place) };
        if local.is_finite() && transform.translation != local {
            transform.translation = local;
        }
        let Some(rotation) = rotation else { return };
        let (_, parent, _) = frame.to_scale_rotation_translation();
        let local = if depth == 0 { rotation } else { (parent.inverse() * rotation).normalize() };
        if local.is_finite() && transform.rotation != local {
            transform.rotation = local;
        }
    }
}

/// Before the arrays are copied: resolves parts, and lets them act on the arrays of their nets.
pub(in crate::sync) fn gather_parts(
    mut state: ResMut<MassSpringState>,
    mut gathered: ResMut<GatheredNets>,
    (mut warnings, mut initial): (ResMut<Warnings>, ResMut<InitialState>),
    mut nets: Query<(Entity, &mut ParticleNet, Option<&Parts>)>,
    mut queries: PartQueries,
) {
    let mut frames = std::mem::take(&mut gathered.frames);
    let entries = &mut state.bypass_change_detection().nets.entries;
    frames.resize(entries.len(), None);
    for (entry, frame) in entries.iter_mut().zip(&mut frames) {
        let Ok((entity, mut net, parts)) = nets.get_mut(entry.entity) else { continue };
        let actions = net.bypass_change_detection().arrays_mut().parts;
        actions.held.clear();
        actions.forces.clear();
        let parts = parts.map_or(&[][..], Parts::entities);
        let mut acting = ActingParts {
            net_entity: entity,
            net: &mut net,
            gathered: &mut gathered,
            warnings: &mut warnings,
            initial: &mut initial,
            queries: &mut queries,
        };
        acting.resolve(parts);
        acting.follow(parts, &mut entry.frame, frame);
        parts.iter().for_each(|part| acting.act(*part));
        let held = &mut net.bypass_change_detection().arrays_mut().parts.held;
        held.sort_unstable();
        held.dedup();
    }
    gathered.frames = frames;
}

struct ActingParts<'a, 'n, 'w, 's> {
    net_entity: Entity,
    net: &'a mut Mut<'n, ParticleNet>,
    gathered: &'a mut GatheredNets,
    warnings: &'a mut Warnings,
    initial: &'a mut InitialState,
    queries: &'a mut PartQueries<'w, 's>,
}

impl ActingParts<'_, '_, '_, '_> {
    /// Finds the particles of parts that are new or were changed, or of a net that is or was.
    fn resolve(&mut self, parts: &[Entity]) {
        for &entity in parts {
            let Ok((part, mut state, velocity, force, is_pinned)) = self.queries.parts.get_mut(entity) else {
                continue;
            };
            if state.is_of(self.net) && !part.is_changed() {
                continue;
            }
            if state.written.is_none()
                && let Ok(transform) = self.queries.transforms.get(entity)
            {
                let data = (transform, velocity.0, force.copied(), is_pinned);
                self.initial.record_part(entity, self.net_entity, data, &state);
            }
            let found = part.particles(self.net.topology()).unwrap_or_default();
            if found.is_empty() {
                let net = self.net_entity;
                self.warnings
                    .warn_once(entity, format_args!("part {entity} of net {net}: the net has no {}", *part));
            } else {
                self.warnings.clear(entity);
            }
            state.structure = self.net.versions().structure;
            if state.particles != found {
                (state.particles, state.is_held) = (found, false);
                self.gathered.relinked_parts.insert(entity);
            }
        }
    }

    /// What is pinned moves with the entity of the net, unless it has another parent. `last` is where that was, if anything is
    /// pinned, and `known` where it was found before.
    fn follow(
        &mut self,
        parts: &[Entity],
        last: &mut Option<[f32; 12]>,
        known: &mut Option<(Transform, [f32; 12])>,
    ) {
        let is_carried = |queries: &PartQueries, part: Entity| {
            queries
                .parts
                .get(part)
                .is_ok_and(|(_, state, _, _, is_pinned)| is_pinned && state.written.is_some())
                && !queries.parents.contains(part)
        };
        let is_pinned = |queries: &PartQueries, part: &Entity| {
            queries
                .parts
                .get(*part)
                .is_ok_and(|(_, state, _, _, is_pinned)| is_pinned && !state.particles.is_empty())
        };
        if self.net.pinned().is_empty() && !parts.iter().any(|part| is_pinned(self.queries, part)) {
            *last = None;
            return;
        }
        let Ok(&own) = self.queries.transforms.get(self.net_entity) else {
            *last = None;
            return;
        };
        let is_child = self.queries.parents.contains(self.net_entity);
        let now = match known.filter(|(transform, _)| *transform == own && !is_child) {
            Some((_, frame)) => frame,
            None => {
                let frame = self.queries.parent_frame(self.net_entity).0 * own.compute_affine();
                let (_, rotation, translation) = frame.to_scale_rotation_translation();
                let now = Affine3A::from_rotation_translation(rotation, translation).to_cols_array();
                *known = (!is_child).then_some((own, now));
                now
            }
        };
        if *last == Some(now) {
            return;
        }
        let is_finite = now.iter().all(|number| number.is_finite());
        let Some(last) = last.replace(now).filter(|_| is_finite) else { return };
        let motion = as_double(&now) * as_double(&last).inverse();
        let Arrays { positions, pinned, .. } = self.net.bypass_change_detection().arrays_mut();
        for particle in pinned {
            let place = &mut positions[*particle as usize];
            *place = motion.transform_point3(place.as_dvec3()).as_vec3();
        }
        let turn = DQuat::from_mat3(&motion.matrix3);
        for &part in parts {
            if !is_carried(self.queries, part) {
                continue;
            }
            if let Ok(mut transform) = self.queries.transforms.get_mut(part) {
                transform.translation = motion.transform_point3(transform.translation.as_dvec3()).as_vec3();
                transform.rotation = (turn * transform.rotation.as_dquat()).normalize().as_quat();
            }
        }
    }

    fn act(&mut self, entity: Entity) {
        let Ok((_, state, velocity, force, is_pinned)) = self.queries.parts.get(entity) else { return };
        if state.particles.is_empty() {
            return;
        }
        let (velocity, force) = (velocity.0, force.map_or(Vec3::ZERO, |force| force.0));
        match is_pinned {
            true => self.hold(entity),
            false => self.move_free(entity, velocity, force),
        }
    }

    /// A pinned part holds its particles where it is.
    fn hold(&mut self, entity: Entity) {
        let Ok((_, state, ..)) = self.queries.parts.get(entity) else { return };
        if !state.is_held {
            self.take_hold(entity);
        }
        let Some((place, rotation)) = self.queries.world_pose(entity) else { return };
        let Ok((_, state, ..)) = self.queries.parts.get(entity) else { return };
        if !(place.is_finite() && rotation.is_finite()) {
            self.warnings
                .warn_once(entity, format_args!("part {entity}: its Transform is not finite; it is ignored"));
            let held = &mut self.net.bypass_change_detection().arrays_mut().parts.held;
            held.extend(&state.particles);
            return;
        }
        let arrays = self.net.bypass_change_detection().arrays_mut();
        for (number, particle) in state.particles.iter().enumerate() {
            let offset = state.offsets.get(number).map_or(Vec3::ZERO, |offset| rotation * *offset);
            arrays.positions[*particle as usize] = place + offset;
        }
        arrays.parts.held.extend(&state.particles);
    }

    /// A part that is pinned from now on remembers how its particles are about it. A new one that was not placed is put
    /// where they are.
    fn take_hold(&mut self, entity: Entity) {
        let Ok((_, state, ..)) = self.queries.parts.get(entity) else { return };
        let Ok(transform) = self.queries.transforms.get(entity).copied() else { return };
        let (is_single, is_new) = (state.particles.len() == 1, state.written.is_none());
        let guess = self.queries.world_pose(entity).map_or(Quat::IDENTITY, |(_, rotation)| rotation);
        let pose = pose_of(self.net, &state.particles, if is_new { Quat::IDENTITY } else { guess });
        let (centre, rotation) = (pose.centre.as_vec3(), pose.rotation.as_quat());
        let inverse = rotation.inverse();
        let positions = self.net.positions();
        let place = |particle: &u32| inverse * (positions[*particle as usize] - centre);
        let offsets = if is_single { Vec::new() } else { state.particles.iter().map(place).collect() };
        let is_unplaced = transform.translation == Vec3::ZERO && transform.rotation == Quat::IDENTITY;
        if is_new && is_unplaced {
            let centre = if is_single { positions[state.particles[0] as usize] } else { centre };
            self.queries.move_to(entity, centre, (!is_single).then_some(rotation));
        }
        if let Ok((_, mut state, ..)) = self.queries.parts.get_mut(entity) {
            state.is_held = true;
            state.offsets = offsets;
        }
    }

    /// A free part that was moved or pushed since the last tick moves its particles.
    fn move_free(&mut self, entity: Entity, velocity: Vec3, force: Vec3) {
        let Ok(transform) = self.queries.transforms.get(entity).copied() else { return };
        let pose = self.queries.world_pose(entity);
        let Ok((_, mut state, ..)) = self.queries.parts.get_mut(entity) else { return };
        state.is_held = false;
        let written = state.written;
        let old_pose = written.map(|(place, rotation)| self.queries.pose_in_world(entity, place, rotation));
        let Ok((_, state, ..)) = self.queries.parts.get(entity) else { return };
        let present = (transform.translation, transform.rotation);
        let is_moved = state.written.is_some_and(|written| written != present);
        let change = velocity - state.written_velocity;
        if let (true, Some((place, rotation)), Some((old_place, old_rotation))) = (is_moved, pose, old_pose) {
            let is_single = state.particles.len() == 1;
            let turn = (rotation != old_rotation).then(|| rotation * old_rotation.inverse());
            for particle in &state.particles {
                let position = &mut self.net.positions_mut()[*particle as usize];
                let arm = *position - old_place;
                *position = if is_single { place } else { place + turn.map_or(arm, |turn| turn * arm) };
            }
        }
        if change != Vec3::ZERO {
            for particle in &state.particles {
                self.net.velocities_mut()[*particle as usize] += change;
            }
        }
        if force != Vec3::ZERO {
            let masses = state.particles.iter().map(|particle| self.net.masses()[*particle as usize]);
            let total: f32 = masses.sum();
            let topology = Arc::clone(self.net.topology());
            let share = |particle: &u32| (*particle, force * (topology.masses[*particle as usize] / total));
            let forces = &mut self.net.bypass_change_detection().arrays_mut().parts.forces;
            forces.extend(state.particles.iter().map(share));
        }
    }
}

fn pose_of(net: &ParticleNet, particles: &[u32], guess: Quat) -> NetPose {
    net.pose_of(particles.iter().map(|particle| *particle as usize), guess, Vec3::ONE)
}

fn as_double(columns: &[f32; 12]) -> DAffine3 {
    DAffine3::from_cols_array(&columns.map(f64::from))
}

/// After a tick: writes where parts are, and where nets are without anything pinned.
pub(in crate::sync) fn scatter_parts(
    state: Res<MassSpringState>,
    nets: Query<(Ref<ParticleNet>, Option<&Parts>)>,
    mut queries: PartQueries,
    mut sorted: Local<Vec<(usize, Entity, Entity)>>,
) {
    sorted.clear();
    for entry in state.nets.entries.iter().filter(|entry| entry.place.is_some()) {
        let Ok((net, parts)) = nets.get(entry.entity) else { continue };
        if entry.frame.is_none() && net.is_changed() {
            show_net(entry.entity, &net, &mut queries);
        }
        for &part in parts.map_or(&[][..], Parts::entities) {
            sorted.push((queries.parent_frame(part).1, part, entry.entity));
        }
    }
    // Parents first: a part may be the parent of another.
    sorted.sort_by_key(|(depth, ..)| *depth);
    for &(_, part, net) in &*sorted {
        if let Ok((net, _)) = nets.get(net) {
            show_part(part, &net, &mut queries);
        }
    }
}

/// A net of which nothing is pinned takes its entity along.
fn show_net(entity: Entity, net: &ParticleNet, queries: &mut PartQueries) {
    let Ok(transform) = queries.transforms.get(entity) else { return };
    let (scale, guess, _) =
        (queries.parent_frame(entity).0 * transform.compute_affine()).to_scale_rotation_translation();
    let pose = net.pose_of(0..net.len(), guess, scale);
    let place = pose.centre - pose.rotation * pose.rest_centre;
    queries.move_to(entity, place.as_vec3(), Some(pose.rotation.as_quat()));
}

fn show_part(entity: Entity, net: &ParticleNet, queries: &mut PartQueries) {
    let Some((_, guess)) = queries.world_pose(entity) else { return };
    let Ok((_, state, _, _, is_pinned)) = queries.parts.get(entity) else { return };
    let Some(&first) = state.particles.first().filter(|_| state.is_of(net)) else { return };
    let single = (state.particles.len() == 1).then_some(first as usize);
    let (mut speed, mut mass) = (Vec3::ZERO, 0.0);
    for particle in state.particles.iter().map(|particle| *particle as usize) {
        speed += net.velocities()[particle] * net.masses()[particle];
        mass += net.masses()[particle];
    }
    let speed = single.map_or(speed / mass, |particle| net.velocities()[particle]);
    if !is_pinned {
        match single {
            Some(particle) => queries.move_to(entity, net.positions()[particle], None),
            None => {
                let pose = pose_of(net, &state.particles, guess);
                queries.move_to(entity, pose.centre.as_vec3(), Some(pose.rotation.as_quat()));
            }
        }
    }
    let Ok(transform) = queries.transforms.get(entity).copied() else { return };
    if let Ok((_, mut state, mut velocity, ..)) = queries.parts.get_mut(entity) {
        state.written = Some((transform.translation, transform.rotation));
        state.written_velocity = speed;
        velocity.set_if_neq(ParticleVelocity(speed));
    }
}
