//! Nets as meshes: what is drawn of a [`ParticleNet`](crate::nets::ParticleNet), without a window or a renderer.
//!
//! | component | draws |
//! | --- | --- |
//! | [`NetMesh`] | the mesh of its entity, moved by the net; or one made of the triangles of the net |
//! | [`RopeMesh`] | a tube with rounded ends around a rope |
//! | [`RopeRibbon`] | a rope as a flat ribbon |
//! | [`RopeLinks`] | a copy of an entity for each link of a rope |
//! | [`RopeCrowd`] | beside `RopeMesh`: the tube as one of a crowd, by a vertex shader (feature `crowd`) |
//! | [`NetSkin`] | a fine mesh, on an entity of its own, that the surface of a coarse net moves |
//!
//! Recipes that are made from a mesh get that of their entity as their [`RecipeMesh`](crate::nets::RecipeMesh).
//!
//! They read components only. Between ticks they show the way from the last tick but one to the last, as Bevy's fixed
//! time steps have it, where [`MassSpringInterpolationPlugin`](crate::MassSpringInterpolationPlugin) acts (feature
//! `interpolation`). The `Aabb` of what they draw encloses all vertices in every frame; vertices are computed only
//! for nets that moved and that a view sees.

mod binding;
mod crowd;
mod drawing;
pub(crate) mod easing;
mod fine;
mod frame;
mod generated;
mod known;
mod links;
mod net_mesh;
mod own_mesh;
mod recipe_mesh;
mod rope_mesh;
mod skin;
mod strands;
mod surface;
mod tangents;
mod tube;

use bevy::asset::AssetEventSystems;
use bevy::camera::visibility::VisibilitySystems;
use bevy::prelude::*;

pub use binding::NetMeshError;
pub use crowd::RopeCrowd;
#[cfg(feature = "crowd")]
pub use crowd::{MassSpringCrowdPlugin, RopeCrowdExtension, RopeCrowdMaterial};
pub use links::{RopeLink, RopeLinks};
pub use net_mesh::{NetMesh, RestMesh};
pub use rope_mesh::{RopeMesh, RopeMeshError, RopeRibbon};
pub use skin::NetSkin;

use drawing::Drawing;

/// Draws nets, in apps with meshes (Bevy's `MeshPlugin` and `CameraPlugin`, which are part of `DefaultPlugins`).
///
/// [`MassSpringPlugin`](crate::MassSpringPlugin) adds it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct MassSpringRenderPlugin;

/// When nets are drawn in a frame.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum NetRenderSystems {
    /// Meshes are made, and torn; in [`PostUpdate`].
    Prepare,
    /// `Aabb`s are computed; in [`PostUpdate`], before Bevy finds out what is seen.
    Bound,
    /// The vertices of what is seen are written; in [`Last`].
    Draw,
}

impl Plugin for MassSpringRenderPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<(NetMesh, NetSkin, RestMesh, RopeLink, RopeLinks, RopeMesh, RopeRibbon)>()
            .configure_sets(
                PostUpdate,
                (
                    NetRenderSystems::Prepare
                        .before(AssetEventSystems)
                        .before(TransformSystems::Propagate)
                        .before(NetRenderSystems::Bound),
                    NetRenderSystems::Bound
                        .after(TransformSystems::Propagate)
                        .before(VisibilitySystems::CheckVisibility),
                ),
            )
            .add_systems(
                PostUpdate,
                (
                    (net_mesh::prepare_net_meshes, rope_mesh::prepare_ropes, skin::prepare_skins)
                        .chain()
                        .in_set(NetRenderSystems::Prepare)
                        .run_if(resource_exists::<Assets<Mesh>>),
                    (links::prepare_links, links::place_links).chain().in_set(NetRenderSystems::Prepare),
                    drawing::bound_nets.in_set(NetRenderSystems::Bound),
                ),
            )
            .init_resource::<recipe_mesh::ReadMeshes>()
            .add_systems(PostStartup, recipe_mesh::read_meshes.run_if(resource_exists::<Assets<Mesh>>))
            .add_systems(
                PostUpdate,
                recipe_mesh::read_meshes
                    .before(NetRenderSystems::Prepare)
                    .run_if(resource_exists::<Assets<Mesh>>),
            )
            .add_systems(
                Last,
                drawing::draw_nets.in_set(NetRenderSystems::Draw).run_if(resource_exists::<Assets<Mesh>>),
            )
            .add_observer(stop_drawing::<NetMesh>)
            .add_observer(stop_drawing::<NetSkin>)
            .add_observer(links::stop_links)
            .add_observer(stop_drawing::<RopeMesh>)
            .add_observer(stop_drawing::<RopeCrowd>)
            .add_observer(stop_drawing::<RopeRibbon>)
            .add_observer(stop_drawing::<crate::nets::ParticleNet>);
    }
}

/// What is drawn no longer keeps its mesh as it is.
fn stop_drawing<C: Component>(removed: On<Remove, C>, mut commands: Commands) {
    commands.entity(removed.entity).try_remove::<Drawing>();
}
