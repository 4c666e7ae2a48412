//! The triangles of meshes, for recipes that are made from them.

use std::sync::{Arc, Weak};

use bevy::platform::collections::HashMap;
use bevy::prelude::*;

use super::RestMesh;
use super::drawing::Drawing;
use crate::nets::{Balloon, Cloth, Jelly, RecipeMesh, TriangleMesh};

/// The meshes that were read: entities with the same one share its triangles.
#[derive(Resource, Default)]
pub(super) struct ReadMeshes(HashMap<AssetId<Mesh>, Weak<TriangleMesh>>);

impl ReadMeshes {
    /// Removes the meshes that changed, and returns them.
    fn remove_changed(&mut self, events: &mut MessageReader<AssetEvent<Mesh>>) -> Vec<AssetId<Mesh>> {
        if self.0.is_empty() {
            events.clear();
            return Vec::new();
        }
        let changed = events.read().filter_map(|event| match event {
            AssetEvent::Modified { id } | AssetEvent::Removed { id } => self.0.remove(id).map(|_| *id),
            _ => None,
        });
        changed.collect()
    }
}

/// Which mesh an entity's [`RecipeMesh`] was read from.
#[derive(Component, Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct ReadFrom(AssetId<Mesh>);

type Recipes<'w, 's> = Query<
    'w,
    's,
    (
        Entity,
        (Option<&'static Cloth>, Option<&'static Jelly>, Option<&'static Balloon>),
        (Option<&'static Mesh3d>, Option<&'static Mesh2d>),
        (Option<&'static RestMesh>, Option<&'static Drawing>),
        (Option<&'static ReadFrom>, Option<&'static RecipeMesh>),
        Option<&'static Name>,
    ),
    Or<(With<Cloth>, With<Jelly>, With<Balloon>)>,
>;

/// Gives the recipes that need one the mesh of their entity, once it is loaded, and again when it is another one or has
/// other triangles. A [`RecipeMesh`] that the game inserted stays.
pub(super) fn read_meshes(
    recipes: Recipes,
    meshes: Res<Assets<Mesh>>,
    mut read: ResMut<ReadMeshes>,
    mut events: MessageReader<AssetEvent<Mesh>>,
    mut commands: Commands,
) {
    let changed = read.remove_changed(&mut events);
    for (entity, (cloth, jelly, balloon), (mesh_3d, mesh_2d), (rest, drawing), (from, own), name) in &recipes
    {
        let (kind, needs_mesh) = match (cloth, jelly, balloon) {
            (Some(cloth), ..) => ("cloth", cloth.needs_mesh()),
            (_, Some(jelly), _) => ("jelly", jelly.needs_mesh()),
            (.., balloon) => ("balloon", balloon.is_some_and(Balloon::needs_mesh)),
        };
        if !needs_mesh || (own.is_some() && from.is_none()) {
            continue;
        }
        let Some(shown) = mesh_3d.map(|mesh| &mesh.0).or(mesh_2d.map(|mesh| &mesh.0)) else { continue };
        // What is drawn is a copy, which moves.
        let is_copy = drawing.is_some_and(|drawing| drawing.mesh == *shown);
        let id = rest.filter(|_| is_copy).map_or(shown, |rest| &rest.0).id();
        if from == Some(&ReadFrom(id)) && !changed.contains(&id) {
            continue;
        }
        let Some(mesh) = meshes.get(id) else { continue };
        commands.entity(entity).try_insert(ReadFrom(id));
        let known = read.0.get(&id).and_then(Weak::upgrade);
        match known.map_or_else(|| TriangleMesh::from_mesh(mesh).map(Arc::new), Ok) {
            Ok(triangles) => {
                read.0.insert(id, Arc::downgrade(&triangles));
                if own.is_none_or(|own| *own.0 != *triangles) {
                    commands.entity(entity).try_insert(RecipeMesh(triangles));
                } else if let Some(RecipeMesh(own)) = own {
                    read.0.insert(id, Arc::downgrade(own));
                }
            }
            Err(problem) => {
                let name = name.map(|name| format!(" \"{name}\"")).unwrap_or_default();
                log::error!("the {kind}{name} ({entity}) is not laid out: {problem}");
            }
        }
    }
    read.0.retain(|_, triangles| triangles.strong_count() > 0);
}
