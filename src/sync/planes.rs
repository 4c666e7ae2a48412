//! Planes into the solver's arrays.

use bevy::math::Affine3A;
use bevy::prelude::*;

use crate::collider::PlaneCollider;
use crate::solver::contacts::{Plane, Pose};

use super::Simulation;
use super::hierarchy::Hierarchy;
use super::index::Index;

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
    index: &mut Index,
    simulation: &mut Simulation,
    gathered_planes: &mut GatheredPlanes,
    planes: &Query<&PlaneCollider>,
    hierarchy: &Hierarchy,
) {
    simulation.state.contacts.planes.clear();
    gathered_planes.0.clear();
    let mut tracked = std::mem::take(&mut index.planes);
    for (entity, last_pose) in &mut tracked {
        let Ok(plane) = planes.get(*entity) else { continue };
        let (frame, _) = hierarchy.world_transform(*entity);
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
