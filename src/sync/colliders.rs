//! Colliders into the solver's inputs.

use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::query::Allow;
use bevy::prelude::*;

use crate::collider::{ColliderMotion, ColliderShape, ContactLayers, ParticleCollider};
use crate::particle::SimulationOrder;
use crate::settings::Dimensions;
use crate::solver::{self, Layers, Material, Shape};

use super::easing::Easing;
use super::exemptions::{ExemptionQueries, GatheredExemptions};
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
pub(super) type ColliderData = (
    Ref<'static, ParticleCollider>,
    Ref<'static, Transform>,
    Option<&'static ContactLayers>,
    Option<&'static ColliderMotion>,
    Has<ChildOf>,
);

/// What colliders need to know of the particles.
#[derive(Clone, Copy)]
pub(super) struct Motions {
    pub view: View,
    /// The motion by which all of them were moved since the last tick.
    pub of_all: Option<RigidMotion>,
    /// s.
    pub time_step: f32,
}

/// The colliders of the solver: the entity of each, and what is known of all that are registered.
#[derive(Resource, Default)]
pub(super) struct GatheredColliders {
    /// By the numbers of the solver.
    pub entities: Vec<Entity>,
    /// Those that are invalid.
    pub left_out: Vec<Entity>,
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
    /// As the solver had it, in the world, if it was at rest.
    resting: Option<solver::Collider>,
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
            let built = described.build_for(scale, dimensions == Dimensions::Two);
            self.built = built.map_err(|problem| problem.to_string());
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
    around: (&Hierarchy, &mut Easing, &mut GatheredExemptions, &ExemptionQueries),
    motions: Motions,
) {
    let GatheredColliders { entities, left_out, known } = gathered;
    let (hierarchy, easing, exemptions, exempt) = around;
    simulation.inputs.colliders.clear();
    entities.clear();
    left_out.clear();
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
            let initial = data.3.map_or(*data.1, |motion| motion.before(&data.1, motions.time_step));
            bookkeeping.initial.record_collider(entry.entity, (*data.0).clone(), &initial);
        }
        let around = (hierarchy, &mut *easing, &mut *exemptions, exempt);
        let found = gather_collider(entry, known, bookkeeping, data, around, motions);
        let Some(collider) = found else {
            left_out.push(entry.entity);
            continue;
        };
        simulation.inputs.colliders.push(motions.view.collider_to_solver(collider));
        entities.push(entry.entity);
    }
}

/// A collider as it is in this tick, in the world; `None` of an invalid one.
fn gather_collider(
    entry: &mut RegisteredCollider,
    known: &mut Known,
    bookkeeping: &mut Bookkeeping,
    (collider, transform, layers, motion, has_parent): <ColliderData as bevy::ecs::query::QueryData>::Item<
        '_,
        '_,
    >,
    (hierarchy, easing, exemptions, exempt): (
        &Hierarchy,
        &mut Easing,
        &mut GatheredExemptions,
        &ExemptionQueries,
    ),
    Motions { view, of_all, time_step }: Motions,
) -> Option<solver::Collider> {
    let ContactLayers { memberships, filters } = layers.copied().unwrap_or_default();
    let exemptions = exemptions.of(entry.entity, exempt, hierarchy);
    let layers = Layers { exemptions, ..Layers::new(memberships, filters) };
    let is_same = !(has_parent || collider.is_changed() || transform.is_changed()) && of_all.is_none();
    if let (true, Some(resting)) = (is_same, &known.resting)
        && entry.last_pose == Some(resting.target)
        && resting.layers == layers
        && known.dimensions == view.dimensions()
    {
        return Some(resting.clone());
    }
    known.resting = None;
    let entity = entry.entity;
    let (frame, _) = hierarchy.world_transform(entity);
    let found = collider.shape.place(&frame, view.is_flat).and_then(|(pose, scale)| {
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
    let mut start = entry.last_pose.replace(target).unwrap_or_else(|| {
        // A new one has come from where it was spawned.
        let Some(motion) = motion else { return target };
        let before = hierarchy.frame_of(entity, &motion.before(&transform, time_step));
        collider.shape.place(&before, view.is_flat).map_or(target, |(pose, _)| pose)
    });
    if let Some(motion) = &of_all {
        let carried = teleport::start_of_collider(motion, start, target, view);
        if carried != start && !has_parent {
            match view.dimensions() {
                Dimensions::Three => easing.restart_at(entity, carried),
                // The solver's pose is flat, the transform is not.
                Dimensions::Two => easing.restart(entity),
            }
        }
        start = carried;
    }
    let ParticleCollider { restitution, friction, restitution_rule, friction_rule, .. } = *collider;
    let gathered = solver::Collider {
        shape,
        start,
        target,
        material: Material { restitution, friction, restitution_rule, friction_rule },
        surface_velocity: view.flatten(collider.surface_velocity),
        layers,
        is_sensor: collider.is_sensor,
    };
    if start == target {
        known.resting = Some(gathered.clone());
    }
    Some(gathered)
}
