//! Carries out [`Teleport`](crate::teleport::Teleport).

use bevy::ecs::entity::{EntityHashMap, EntityHashSet};
use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::query::Allow;
use bevy::math::{Affine3A, DVec3};
use bevy::prelude::*;

use crate::bend::Bend;
use crate::collider::{ParticleCollider, pose_of};
use crate::nets::{PartOf, PartState, ParticleNet, Parts};
use crate::particle::{Particle, ParticleVelocity, Pinned};
use crate::settings::Dimensions;
use crate::spring::Spring;

use super::hierarchy::{to_local, to_world, world_transform};
use super::rigid::RigidMotion;
use super::state::{MassSpringState, touch};
use super::view::{SAMPLE, View, choose_origin};
use super::{Simulation, easing};

/// What is moved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Scope {
    /// One particle, net or collider.
    Entity(Entity),
    /// A particle, part or net and all that springs join to it.
    Net(Entity),
    /// All particles, nets and colliders.
    Everything,
}

/// Puts particles and colliders to another place.
pub(crate) fn relocate(world: &mut World, scope: Scope, isometry: Isometry3d) {
    if !world.contains_resource::<MassSpringState>() {
        log::warn!("Teleport: nothing is moved: the app is without MassSpringPlugin");
    } else if !(isometry.translation.is_finite() && isometry.rotation.is_finite()) {
        log::warn!("Teleport: nothing is moved: {isometry:?} is not finite");
    } else {
        let Members { particles, nets, colliders } = members(world, scope);
        if let (Scope::Entity(entity) | Scope::Net(entity), true) =
            (scope, particles.is_empty() && nets.is_empty() && colliders.is_empty())
        {
            log::warn!("Teleport: nothing is moved: {entity} is neither a particle, a net nor a collider");
            return;
        }
        let motion = RigidMotion::of_isometry(isometry, Vec3::ZERO);
        world.resource_scope(|world, mut state: Mut<MassSpringState>| {
            let colliders =
                colliders.iter().filter_map(|collider| MovingCollider::start(world, *collider, &motion));
            let mut colliders: Vec<MovingCollider> = colliders.collect();
            move_particles(
                world,
                &mut state,
                (&particles, &nets),
                &motion,
                matches!(scope, Scope::Entity(_)),
            );
            nets.iter().for_each(|net| move_frame(world, &mut state, *net, &motion));
            colliders.sort_by_key(|collider| collider.depth);
            let view = View::new(state.solver.origin, *world.resource::<Dimensions>());
            colliders.iter().for_each(|collider| collider.arrive(world, &mut state, view));
            touch(&mut state, &mut world.resource_mut::<Simulation>());
        });
    }
}

/// What is moved.
struct Members {
    particles: Vec<Entity>,
    nets: Vec<Entity>,
    colliders: Vec<Entity>,
}

/// The particles, nets and colliders of a scope.
fn members(world: &mut World, scope: Scope) -> Members {
    let mut all_particles = world.query_filtered::<Entity, (With<Particle>, Allow<Disabled>)>();
    let mut all_colliders = world.query_filtered::<Entity, (With<ParticleCollider>, Allow<Disabled>)>();
    let mut all_nets = world.query_filtered::<Entity, (With<ParticleNet>, Allow<Disabled>)>();
    let [mut particles, mut nets, mut colliders]: [Vec<Entity>; 3] = [
        all_particles.iter(world).collect(),
        all_nets.iter(world).collect(),
        all_colliders.iter(world).collect(),
    ];
    match scope {
        Scope::Everything => {}
        Scope::Entity(entity) => {
            particles.retain(|other| *other == entity);
            nets.retain(|other| *other == entity);
            colliders.retain(|other| *other == entity);
        }
        Scope::Net(entity) => {
            let net = net_of(world, entity);
            particles.retain(|particle| net.contains(particle));
            nets.retain(|other| net.contains(other));
            colliders.clear();
        }
    }
    Members { particles, nets, colliders }
}

/// The entities that springs and bends join to one, and itself.
fn net_of(world: &mut World, entity: Entity) -> EntityHashSet {
    let mut joined: EntityHashMap<Vec<Entity>> = EntityHashMap::default();
    let mut springs = world.query_filtered::<&Spring, Allow<Disabled>>();
    for &Spring { particles: [first, second], .. } in springs.iter(world) {
        joined.entry(first).or_default().push(second);
        joined.entry(second).or_default().push(first);
    }
    let mut parts = world.query_filtered::<(Entity, &PartOf), Allow<Disabled>>();
    for (part, &PartOf(net)) in parts.iter(world) {
        joined.entry(part).or_default().push(net);
        joined.entry(net).or_default().push(part);
    }
    let mut bends = world.query_filtered::<&Bend, Allow<Disabled>>();
    for &Bend { particles: [first, middle, last], .. } in bends.iter(world) {
        for (one, other) in [(first, middle), (middle, last)] {
            joined.entry(one).or_default().push(other);
            joined.entry(other).or_default().push(one);
        }
    }
    let mut net = EntityHashSet::default();
    let mut found = vec![entity];
    while let Some(entity) = found.pop() {
        if net.insert(entity) {
            found.extend(joined.get(&entity).into_iter().flatten());
        }
    }
    net
}

/// A particle on its way.
struct Traveller {
    entity: Entity,
    /// Its number in the net of the entity; `None` of a loose particle.
    number: Option<usize>,
    /// Number of its ancestors.
    depth: usize,
    slot: Option<usize>,
    /// Whether it will be where its `Transform`, in the world, is rounded to.
    is_rounded: bool,
    /// Where it comes to in the world, m.
    place: DVec3,
}

fn move_particles(
    world: &mut World,
    state: &mut MassSpringState,
    (particles, nets): (&[Entity], &[Entity]),
    motion: &RigidMotion,
    clears_contacts: bool,
) {
    let slot_of: EntityHashMap<usize> = state.particles.slots.iter().copied().zip(0..).collect();
    let dimensions = *world.resource::<Dimensions>();
    let view = View::new(state.solver.origin, dimensions);
    let positions = &state.solver.particles.position;
    let mut travellers: Vec<Traveller> = particles
        .iter()
        .filter_map(|&entity| {
            let slot = slot_of.get(&entity).copied();
            let (frame, depth) = frame_of(world, entity);
            let translation = easing::exact_translation(world, world.entity(entity))?;
            let seen = view.frame_to_solver(frame);
            // As exactly as the solver stores it, unless it was moved since.
            let known = slot
                .map(|slot| positions.get(slot))
                .filter(|position| translate(view, depth, &seen, *position, translation) == translation);
            let place = match known {
                Some(position) => position.as_dvec3() + view.origin.as_dvec3(),
                None => to_world(&frame, translation).as_dvec3(),
            };
            let is_rounded = depth == 0 && world.entity(entity).contains::<Pinned>();
            Some(Traveller { entity, number: None, depth, slot, is_rounded, place: motion.apply(place) })
        })
        .collect();
    nets.iter().for_each(|net| add_net(world, state, *net, view, motion, &mut travellers));
    // Parents first: a particle may be the parent of another.
    travellers.sort_by_key(|traveller| traveller.depth);
    round_nets(state, &mut world.resource_mut::<Simulation>(), &mut travellers);
    move_origin(state, &travellers);
    let view = View::new(state.solver.origin, dimensions);
    if clears_contacts {
        strain_nets(state, &mut world.resource_mut::<Simulation>(), &travellers);
    }
    for traveller in &travellers {
        arrive(world, state, traveller, motion, view, clears_contacts);
    }
}

/// Adds the particles of a net.
fn add_net(
    world: &World,
    state: &MassSpringState,
    entity: Entity,
    view: View,
    motion: &RigidMotion,
    travellers: &mut Vec<Traveller>,
) {
    let Some(net) = world.get::<ParticleNet>(entity) else { return };
    let place = state.nets.get(entity).and_then(|known| known.place.as_ref());
    for (number, position) in net.positions().iter().enumerate() {
        let slot = place.map(|place| place.slot(number));
        let known = slot.map(|slot| state.solver.particles.position.get(slot));
        let known = known.filter(|known| view.to_world(*known, *position) == *position);
        let place = match known {
            Some(known) => known.as_dvec3() + view.origin.as_dvec3(),
            None => position.as_dvec3(),
        };
        let is_rounded = net.is_pinned(number as u32);
        let place = motion.apply(place);
        travellers.push(Traveller { entity, number: Some(number), depth: 0, slot, is_rounded, place });
    }
}

/// Moves the entity of a net and its parts along, so that nothing pinned seems to have moved. Those with a parent are
/// where that is.
fn move_frame(world: &mut World, state: &mut MassSpringState, net: Entity, motion: &RigidMotion) {
    let parts = world.get::<Parts>(net).map(|parts| parts.entities().to_vec()).unwrap_or_default();
    for entity in std::iter::once(net).chain(parts) {
        if world.get::<ChildOf>(entity).is_some() {
            continue;
        }
        let Some(mut transform) = world.get_mut::<Transform>(entity) else { continue };
        transform.translation = motion.apply(transform.translation.as_dvec3()).as_vec3();
        transform.rotation = motion.turn_rotation(transform.rotation);
        let present = (transform.translation, transform.rotation);
        if let Some(mut part) = world.get_mut::<PartState>(entity) {
            part.written = part.written.map(|_| present);
        }
    }
    let now = net_frame(world, net);
    for known in state.nets.entries.iter_mut().filter(|known| known.entity == net) {
        known.frame = known.frame.and(now);
    }
}

/// Where the entity of a net is in the world.
fn net_frame(world: &World, net: Entity) -> Option<[f32; 12]> {
    let (frame, _) = frame_of(world, net);
    let (_, rotation, translation) =
        (frame * world.get::<Transform>(net)?.compute_affine()).to_scale_rotation_translation();
    Some(Affine3A::from_rotation_translation(rotation, translation).to_cols_array())
}

/// Moves each net by what the place of its first pinned particle is rounded, so that the two agree exactly.
fn round_nets(state: &MassSpringState, simulation: &mut Simulation, travellers: &mut [Traveller]) {
    let mut number_of = vec![None; state.particles.slots.len()];
    for (number, traveller) in travellers.iter().enumerate() {
        traveller.slot.iter().for_each(|slot| number_of[*slot] = Some(number));
    }
    for net in simulation.caches.nets(&state.solver).all() {
        let numbers = || net.iter().filter_map(|slot| number_of[*slot as usize]);
        let Some(first) = numbers().find(|number| travellers[*number].is_rounded) else { continue };
        let place = travellers[first].place;
        let rounding = place.as_vec3().as_dvec3() - place;
        numbers().for_each(|number| travellers[number].place += rounding);
    }
}

/// Takes note that springs are longer or shorter where only a part of a net is moved.
fn strain_nets(state: &mut MassSpringState, simulation: &mut Simulation, travellers: &[Traveller]) {
    let slots: Vec<u32> = travellers.iter().filter_map(|traveller| Some(traveller.slot? as u32)).collect();
    let nets = simulation.caches.nets(&state.solver).all();
    for slot in nets.filter(|net| slots.iter().any(|slot| net.contains(slot))).flatten() {
        state.solver.strain(*slot as usize);
    }
}

/// Moves the solver's origin to where the particles will be.
fn move_origin(state: &mut MassSpringState, travellers: &[Traveller]) {
    let solver = &mut state.solver;
    let mut places: Vec<Vec3> =
        (0..solver.particles.len()).map(|slot| solver.particles.position.get(slot) + solver.origin).collect();
    for Traveller { slot, place, .. } in travellers {
        slot.iter().for_each(|slot| places[*slot] = place.as_vec3());
    }
    let live =
        places.iter().zip(&state.particles.slots).filter(|(_, entity)| **entity != Entity::PLACEHOLDER);
    let step = places.len().div_ceil(SAMPLE).max(1);
    let origin = choose_origin(solver.origin, live.step_by(step).map(|(place, _)| *place));
    if origin != solver.origin {
        solver.move_origin(origin);
    }
}

fn arrive(
    world: &mut World,
    state: &mut MassSpringState,
    &Traveller { entity, number, depth, slot, place, .. }: &Traveller,
    motion: &RigidMotion,
    view: View,
    clears_contacts: bool,
) {
    let position = view.flatten((place - view.origin.as_dvec3()).as_vec3());
    if let Some(number) = number {
        arrive_in_net(world, state, (entity, number, slot), position, motion, (view, clears_contacts));
        return;
    }
    let (frame, _) = frame_of(world, entity);
    let seen = view.frame_to_solver(frame);
    let mut entity = world.entity_mut(entity);
    let is_pinned = entity.contains::<Pinned>();
    let Some(mut transform) = entity.get_mut::<Transform>() else { return };
    let translation = translate(view, depth, &seen, position, transform.translation);
    transform.translation = translation;
    let velocity = entity.get_mut::<ParticleVelocity>().map(|mut velocity| {
        velocity.0 = view.flatten(motion.turn(velocity.0));
        velocity.0
    });
    easing::reset(&mut entity);
    let Some(slot) = slot else { return };
    // A pinned particle is exactly where its transform is.
    let position = match is_pinned {
        true if depth == 0 => view.to_solver(translation),
        true => view.child_to_solver(&seen, translation),
        false => position,
    };
    match clears_contacts {
        true => state.solver.teleport(slot, position),
        false => state.solver.carry(slot, position, |vector| motion.turn(vector)),
    }
    if let Some(velocity) = velocity {
        state.solver.particles.velocity.set(slot, velocity);
    }
}

fn arrive_in_net(
    world: &mut World,
    state: &mut MassSpringState,
    (entity, number, slot): (Entity, usize, Option<usize>),
    position: Vec3,
    motion: &RigidMotion,
    (view, clears_contacts): (View, bool),
) {
    let Some(mut net) = world.get_mut::<ParticleNet>(entity) else { return };
    let is_pinned = net.is_pinned(number as u32);
    let translation = view.to_world(position, net.positions()[number]);
    let velocity = view.flatten(motion.turn(net.velocities()[number]));
    net.positions_mut()[number] = translation;
    net.velocities_mut()[number] = velocity;
    let Some(slot) = slot else { return };
    let position = if is_pinned { view.to_solver(translation) } else { position };
    match clears_contacts {
        true => state.solver.teleport(slot, position),
        false => state.solver.carry(slot, position, |vector| motion.turn(vector)),
    }
    state.solver.particles.velocity.set(slot, velocity);
}

/// The translation of a particle that the solver has at `position`; `present` is the one that it has.
fn translate(view: View, depth: usize, seen: &Affine3A, position: Vec3, present: Vec3) -> Vec3 {
    if depth == 0 { view.to_world(position, present) } else { view.solver_to_child(seen, position, present) }
}

/// The frame of an entity's parent, and the number of its ancestors.
fn frame_of(world: &World, entity: Entity) -> (Affine3A, usize) {
    let parent_of = |entity| world.get::<ChildOf>(entity).map(ChildOf::parent);
    let Some(parent) = parent_of(entity) else { return (Affine3A::IDENTITY, 0) };
    let (frame, depth) = world_transform(parent, parent_of, |entity| world.get::<Transform>(entity));
    (frame, depth + 1)
}

/// A collider on its way.
struct MovingCollider {
    entity: Entity,
    depth: usize,
    point: Vec3,
    rotation: Quat,
}

impl MovingCollider {
    fn start(world: &World, entity: Entity, motion: &RigidMotion) -> Option<Self> {
        let (frame, depth) = frame_of(world, entity);
        let transform = easing::exact_transform(world, world.entity(entity))?;
        let (_, rotation, point) = (frame * transform.compute_affine()).to_scale_rotation_translation();
        let (point, rotation) = (motion.apply(point.as_dvec3()).as_vec3(), motion.turn_rotation(rotation));
        Some(Self { entity, depth, point, rotation })
    }

    fn arrive(&self, world: &mut World, state: &mut MassSpringState, view: View) {
        let (frame, _) = frame_of(world, self.entity);
        let mut entity = world.entity_mut(self.entity);
        let Some(mut transform) = entity.get_mut::<Transform>() else { return };
        (transform.translation, transform.rotation) = (self.point, self.rotation);
        if self.depth > 0 {
            let (_, parent, _) = frame.to_scale_rotation_translation();
            transform.translation = to_local(&frame, self.point);
            transform.rotation = parent.inverse() * self.rotation;
        }
        let pose = pose_of(&(frame * transform.compute_affine())).and_then(|pose| view.flatten_pose(pose));
        easing::reset(&mut entity);
        for known in state.colliders.iter_mut().filter(|known| known.entity == self.entity) {
            known.last_pose = known.last_pose.and(pose);
        }
    }
}
