//! Planes into the solver's inputs.

use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::query::Allow;
use bevy::math::Affine3A;
use bevy::prelude::*;

use crate::collider::PlaneCollider;
use crate::particle::SimulationOrder;
use crate::solver::{Plane, Pose};

use super::hierarchy::Hierarchy;
use super::rigid::RigidMotion;
use super::slots::Bookkeeping;
use super::state::{MassSpringState, RegisteredPlane, touch};
use super::view::View;
use super::{Simulation, teleport};

/// Registers a plane.
pub(super) fn register_plane(
    added: On<Add, PlaneCollider>,
    mut state: ResMut<MassSpringState>,
    mut simulation: ResMut<Simulation>,
    orders: Query<&SimulationOrder, Allow<Disabled>>,
) {
    touch(&mut state, &mut simulation);
    state.planes.push(RegisteredPlane::new(added.entity));
    if orders.contains(added.entity) {
        sort(&mut state, &orders);
    }
}

/// Removes a plane from the registry.
pub(super) fn unregister_plane(
    removed: On<Remove, PlaneCollider>,
    mut state: ResMut<MassSpringState>,
    mut simulation: ResMut<Simulation>,
) {
    touch(&mut state, &mut simulation);
    state.planes.retain(|plane| plane.entity != removed.entity);
}

/// Sorts the planes when one of them gets a number.
pub(super) fn sort_planes(
    inserted: On<Insert, SimulationOrder>,
    mut state: ResMut<MassSpringState>,
    mut simulation: ResMut<Simulation>,
    orders: Query<&SimulationOrder, Allow<Disabled>>,
) {
    if state.planes.iter().any(|plane| plane.entity == inserted.entity) {
        touch(&mut state, &mut simulation);
        sort(&mut state, &orders);
    }
}

fn sort(state: &mut MassSpringState, orders: &Query<&SimulationOrder, Allow<Disabled>>) {
    let order_of = |plane: &RegisteredPlane| orders.get(plane.entity).map_or(u64::MAX, |order| order.0);
    state.planes.sort_by_key(order_of);
}

/// What planes need to know of the particles.
#[derive(Clone, Copy)]
pub(super) struct Motions {
    pub view: View,
    /// The motion by which all of them were moved since the last tick.
    pub of_all: Option<RigidMotion>,
}

/// Copies all planes, moving from where they were in the last tick to where they are. A plane that is disabled or
/// left out has no past when it is back.
pub(super) fn gather_planes(
    state: &mut MassSpringState,
    simulation: &mut Simulation,
    gathered_planes: &mut GatheredPlanes,
    bookkeeping: &mut Bookkeeping,
    planes: &Query<(&PlaneCollider, &Transform)>,
    hierarchy: &Hierarchy,
    Motions { view, of_all }: Motions,
) {
    simulation.inputs.planes.clear();
    gathered_planes.0.clear();
    for RegisteredPlane { entity, last_pose, is_recorded } in &mut state.planes {
        let Ok((plane, transform)) = planes.get(*entity) else {
            *last_pose = None;
            continue;
        };
        if !std::mem::replace(is_recorded, true) {
            bookkeeping.initial.record_plane(*entity, *plane, transform);
        }
        let (frame, _) = hierarchy.world_transform(*entity);
        let pose = pose_of(&frame);
        let flat_pose = pose.and_then(|pose| view.flatten_pose(pose));
        let problem = match (pose, flat_pose) {
            (None, _) => Some("its transform is not finite".to_owned()),
            (_, None) => Some("it is parallel to the plane in which particles move".to_owned()),
            _ => plane.validate().err().map(|problem| problem.to_string()),
        };
        if let Some(problem) = problem {
            let message = format_args!("plane {entity} is left out of the simulation: {problem}");
            bookkeeping.warnings.warn_once(*entity, message);
            *last_pose = None;
            continue;
        }
        bookkeeping.warnings.clear(*entity);
        let Some(target) = flat_pose else { continue };
        let mut start = last_pose.replace(target).unwrap_or(target);
        if let Some(motion) = &of_all {
            start = teleport::start_of_plane(motion, start, target, view);
        }
        let PlaneCollider { restitution, friction } = *plane;
        let plane = Plane { start, target, restitution, friction };
        simulation.inputs.planes.push(view.plane_to_solver(plane));
        gathered_planes.0.push(*entity);
    }
}

/// The entity of each of the solver's planes.
#[derive(Resource, Default)]
pub(super) struct GatheredPlanes(pub Vec<Entity>);

/// A plane's pose: the image of +Y is the normal, whatever the scale.
pub(super) fn pose_of(frame: &Affine3A) -> Option<Pose> {
    let (_, rotation, point) = frame.to_scale_rotation_translation();
    (point.is_finite() && rotation.is_finite()).then_some(Pose { point, rotation })
}
