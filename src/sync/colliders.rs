//! Colliders into the solver's inputs.

use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::query::Allow;
use bevy::math::Affine3A;
use bevy::prelude::*;

use crate::collider::{ColliderShape, ContactLayers, ParticleCollider};
use crate::particle::SimulationOrder;
use crate::settings::Dimensions;
use crate::solver::{self, Layers, Material, Pose, Shape};

use super::hierarchy::Hierarchy;
use super::rigid::RigidMotion;
use super::slots::Bookkeeping;
use super::state::{MassSpringState, RegisteredCollider, touch};
use super::view::View;
use super::{Simulation, teleport};

/// Registers a collider.
pub(super) fn register_collider(
    added: On<Add, ParticleCollider>,
    mut state: ResMut<MassSpringState>,
    mut simulation: ResMut<Simulation>,
    orders: Query<&SimulationOrder, Allow<Disabled>>,
) {
    touch(&mut state, &mut simulation);
    state.colliders.push(RegisteredCollider::new(added.entity));
    if orders.contains(added.entity) {
        sort(&mut state, &orders);
    }
}

/// Removes a collider from the registry.
pub(super) fn unregister_collider(
    removed: On<Remove, ParticleCollider>,
    mut state: ResMut<MassSpringState>,
    mut simulation: ResMut<Simulation>,
) {
    touch(&mut state, &mut simulation);
    state.colliders.retain(|collider| collider.entity != removed.entity);
}

/// Sorts the colliders when one of them gets a number.
pub(super) fn sort_colliders(
    inserted: On<Insert, SimulationOrder>,
    mut state: ResMut<MassSpringState>,
    mut simulation: ResMut<Simulation>,
    orders: Query<&SimulationOrder, Allow<Disabled>>,
) {
    if state.colliders.iter().any(|collider| collider.entity == inserted.entity) {
        touch(&mut state, &mut simulation);
        sort(&mut state, &orders);
    }
}

fn sort(state: &mut MassSpringState, orders: &Query<&SimulationOrder, Allow<Disabled>>) {
    let order_of =
        |collider: &RegisteredCollider| orders.get(collider.entity).map_or(u64::MAX, |order| order.0);
    state.colliders.sort_by_key(order_of);
}

/// All that a tick reads of a collider.
pub(super) type ColliderData =
    (Ref<'static, ParticleCollider>, Ref<'static, Transform>, Option<&'static ContactLayers>, Has<ChildOf>);

/// What colliders need to know of the particles.
#[derive(Clone, Copy)]
pub(super) struct Motions {
    pub view: View,
    /// The motion by which all of them were moved since the last tick.
    pub of_all: Option<RigidMotion>,
}

/// The colliders of the solver: the entity of each, and what is known of all that are registered.
#[derive(Resource, Default)]
pub(super) struct GatheredColliders {
    /// By the numbers of the solver.
    pub entities: Vec<Entity>,
    /// By their places in the registry.
    known: Vec<Known>,
}

/// What the last tick found out about a collider: a cache.
struct Known {
    entity: Entity,
    scale: Vec3,
    dimensions: Dimensions,
    described: ColliderShape,
    built: Result<Shape, String>,
    /// As the solver had it, in the world, if it was at rest, and its layers.
    resting: Option<(solver::Collider, Option<ContactLayers>)>,
}

impl Known {
    fn new(entity: Entity) -> Self {
        Self {
            entity,
            scale: Vec3::ONE,
            dimensions: Dimensions::Three,
            described: ColliderShape::HalfSpace,
            built: Ok(Shape::HALF_SPACE),
            resting: None,
        }
    }

    /// The shape at a scale; it is built where it is another one than in the last tick.
    fn shape(
        &mut self,
        described: &ColliderShape,
        scale: Vec3,
        dimensions: Dimensions,
    ) -> Result<Shape, String> {
        let is_known = self.scale == scale && self.dimensions == dimensions && self.described == *described;
        if !is_known {
            (self.scale, self.dimensions, self.described) = (scale, dimensions, described.clone());
            let built = described.build(scale).map_err(|problem| problem.to_string());
            self.built = match dimensions {
                Dimensions::Two => built.map(Shape::in_plane),
                Dimensions::Three => built,
            };
        }
        self.built.clone()
    }
}

/// Copies all colliders, moving from where they were in the last tick to where they are. One that is disabled or
/// left out has no past when it is back.
pub(super) fn gather_colliders(
    state: &mut MassSpringState,
    simulation: &mut Simulation,
    gathered: &mut GatheredColliders,
    bookkeeping: &mut Bookkeeping,
    colliders: &Query<ColliderData>,
    hierarchy: &Hierarchy,
    motions: Motions,
) {
    let GatheredColliders { entities, known } = gathered;
    simulation.inputs.colliders.clear();
    entities.clear();
    known.truncate(state.colliders.len());
    for (place, entry) in state.colliders.iter_mut().enumerate() {
        match known.get(place) {
            Some(known) if known.entity == entry.entity => {}
            Some(_) => known[place] = Known::new(entry.entity),
            None => known.push(Known::new(entry.entity)),
        }
        let known = &mut known[place];
        let Ok(data) = colliders.get(entry.entity) else {
            (entry.last_pose, known.resting) = (None, None);
            continue;
        };
        if !std::mem::replace(&mut entry.is_recorded, true) {
            bookkeeping.initial.record_collider(entry.entity, (*data.0).clone(), &data.1);
        }
        if let Some(collider) = gather_collider(entry, known, bookkeeping, data, hierarchy, motions) {
            simulation.inputs.colliders.push(motions.view.collider_to_solver(collider));
            entities.push(entry.entity);
        }
    }
}

/// A collider as it is in this tick, in the world.
fn gather_collider(
    entry: &mut RegisteredCollider,
    known: &mut Known,
    bookkeeping: &mut Bookkeeping,
    (collider, transform, layers, has_parent): <ColliderData as bevy::ecs::query::QueryData>::Item<'_, '_>,
    hierarchy: &Hierarchy,
    Motions { view, of_all }: Motions,
) -> Option<solver::Collider> {
    let is_same = !(has_parent || collider.is_changed() || transform.is_changed()) && of_all.is_none();
    if let (true, Some((resting, known_layers))) = (is_same, &known.resting)
        && entry.last_pose == Some(resting.target)
        && *known_layers == layers.copied()
        && known.dimensions == view.dimensions()
    {
        return Some(resting.clone());
    }
    known.resting = None;
    let entity = entry.entity;
    let (frame, _) = hierarchy.world_transform(entity);
    let found = place(&frame, &collider, view).and_then(|(pose, scale)| {
        collider.validate_surface().map_err(|problem| problem.to_string())?;
        Ok((pose, known.shape(&collider.shape, scale, view.dimensions())?))
    });
    let (target, shape) = match found {
        Ok(found) => found,
        Err(problem) => {
            let message = format_args!("collider {entity} is left out of the simulation: {problem}");
            bookkeeping.warnings.warn_once(entity, message);
            entry.last_pose = None;
            return None;
        }
    };
    bookkeeping.warnings.clear(entity);
    let mut start = entry.last_pose.replace(target).unwrap_or(target);
    if let Some(motion) = &of_all {
        start = teleport::start_of_collider(motion, start, target, view);
    }
    let ParticleCollider { restitution, friction, restitution_rule, friction_rule, .. } = *collider;
    let ContactLayers { memberships, filters } = layers.copied().unwrap_or_default();
    let gathered = solver::Collider {
        shape,
        start,
        target,
        material: Material { restitution, friction, restitution_rule, friction_rule },
        surface_velocity: view.flatten(collider.surface_velocity),
        layers: Layers { memberships, filters },
        is_sensor: collider.is_sensor,
    };
    if start == target {
        known.resting = Some((gathered.clone(), layers.copied()));
    }
    Some(gathered)
}

/// Where a collider is, and its scale.
fn place(frame: &Affine3A, collider: &ParticleCollider, view: View) -> Result<(Pose, Vec3), String> {
    let pose = pose_of(frame).ok_or("its transform is not finite")?;
    if collider.shape == ColliderShape::HalfSpace {
        let pose = view.flatten_pose(pose).ok_or("it is parallel to the plane in which particles move")?;
        return Ok((pose, Vec3::ONE));
    }
    let (scale, ..) = frame.to_scale_rotation_translation();
    let [x, y, z] = [frame.matrix3.x_axis, frame.matrix3.y_axis, frame.matrix3.z_axis];
    let is_sheared = [(x, y), (y, z), (z, x)]
        .into_iter()
        .any(|(one, other)| one.dot(other).abs() > MAX_SHEAR * one.length() * other.length());
    if is_sheared {
        return Err("it is sheared by the scale of a parent".to_owned());
    }
    // The scale comes rounded from the matrix: what is one is taken for one, so that a turn builds nothing anew.
    let rounded = (scale * SCALE_STEPS).round() / SCALE_STEPS;
    let is_near = (scale - rounded).abs().max_element() <= 1e-5 * scale.abs().max_element();
    Ok((view.flatten_solid(pose), if is_near { rounded } else { scale }))
}

/// The cosine of the angle between two axes from which on they count as sheared.
const MAX_SHEAR: f32 = 1e-3;

/// Scales next to multiples of the inverse of this are taken for them.
const SCALE_STEPS: f32 = 4096.0;

/// A collider's pose, whatever its scale.
pub(super) fn pose_of(frame: &Affine3A) -> Option<Pose> {
    let (_, rotation, point) = frame.to_scale_rotation_translation();
    (point.is_finite() && rotation.is_finite()).then_some(Pose { point, rotation })
}
