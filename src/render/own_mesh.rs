//! The mesh that an entity has for itself.

use std::error::Error;

use bevy::ecs::system::SystemParam;
use bevy::prelude::*;

use super::crowd::CrowdSupport;
use crate::settings::Dimensions;

/// Which kind of mesh entities get.
#[derive(SystemParam)]
pub(super) struct OwnMesh<'w> {
    dimensions: Option<Res<'w, Dimensions>>,
    crowds: Option<Res<'w, CrowdSupport>>,
}

impl OwnMesh<'_> {
    /// Whether ropes can be drawn as crowds.
    pub fn has_crowds(&self) -> bool {
        self.crowds.is_some()
    }

    /// Whether an entity without a mesh gets a `Mesh2d`.
    pub fn is_flat(&self, has_3d: bool, has_2d: bool) -> bool {
        has_2d || !has_3d && self.dimensions.as_deref() == Some(&Dimensions::Two)
    }

    /// Gives the entity this mesh.
    pub fn give(
        &self,
        entity: Entity,
        mesh: Handle<Mesh>,
        has_3d: bool,
        has_2d: bool,
        commands: &mut Commands,
    ) {
        let mut entity = commands.entity(entity);
        if self.is_flat(has_3d, has_2d) {
            entity.try_insert(Mesh2d(mesh));
        } else {
            entity.try_insert(Mesh3d(mesh));
        }
    }
}

/// Says in the log, once, what is wrong.
pub(super) fn report(entity: Entity, name: Option<&Name>, error: &dyn Error) {
    match name {
        Some(name) => log::error!("the net \"{name}\" ({entity}) is not drawn: {error}"),
        None => log::error!("the net {entity} is not drawn: {error}"),
    }
}
