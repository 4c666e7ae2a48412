//! Recipes that wait for a mesh which does not come: named in the log.

use bevy::prelude::*;

use super::{ParticleNet, RecipeMesh};

/// The recipes that were not laid out for want of a mesh: the entity, what it is, and whether it waited in the last frame
/// already.
#[derive(Resource, Default)]
pub(super) struct MissingMeshes(Vec<(Entity, &'static str, bool)>);

impl MissingMeshes {
    pub fn note(&mut self, entity: Entity, kind: &'static str) {
        self.0.retain(|(other, ..)| *other != entity);
        self.0.push((entity, kind, false));
    }
}

/// A mesh that the feature `render` reads once it is loaded.
#[cfg(feature = "render")]
type Readable = Or<(With<Mesh3d>, With<Mesh2d>)>;

/// Without that feature nothing is read.
#[cfg(not(feature = "render"))]
type Readable = With<RecipeMesh>;

#[cfg(feature = "render")]
const REMEDY: &str = "it has neither a Mesh3d nor a Mesh2d nor a RecipeMesh; insert one";

#[cfg(not(feature = "render"))]
const REMEDY: &str =
    "it has no RecipeMesh; insert one, or switch on the feature `render`, which makes it from a Mesh3d";

pub(super) fn any_missing(missing: Res<MissingMeshes>) -> bool {
    !missing.0.is_empty()
}

/// At the end of a frame: names what has waited since the frame before and has nothing to wait for, once for each insertion
/// of the recipe.
pub(super) fn warn_of_missing_meshes(
    mut missing: ResMut<MissingMeshes>,
    existing: Query<(), Without<ParticleNet>>,
    supplied: Query<(), Or<(With<RecipeMesh>, Readable)>>,
) {
    missing.0.retain_mut(|(entity, kind, has_waited)| {
        if !existing.contains(*entity) || supplied.contains(*entity) {
            return false;
        }
        if *has_waited {
            log::warn!("{kind} {entity} is made from the mesh of its entity and is not laid out: {REMEDY}");
        }
        !std::mem::replace(has_waited, true)
    });
}
