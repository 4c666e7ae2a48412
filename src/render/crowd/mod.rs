//! Crowds of ropes: one tube for all that are alike, placed along the particles of each by the graphics card.
//!
//! ```text
//!  PostUpdate  prepare   (as all ropes)
//!              join      a place in the buffer, and the tube that all which are like it share
//!  Last        draw      particles and normals as they are in this frame (as all nets: only what moved and is seen)
//!              publish   … into the buffer that the vertex shader reads
//! ```
//! A rope of 50 links has 50 entries of 32 bytes there, where its own mesh has some thousand vertices of 48.

#[cfg(any(feature = "crowd", test))]
mod entries;
#[cfg(feature = "crowd")]
mod material;
#[cfg(any(feature = "crowd", test))]
mod places;
#[cfg(feature = "crowd")]
mod plugin;
#[cfg(any(feature = "crowd", test))]
mod tubes;

use bevy::prelude::*;

#[cfg(feature = "crowd")]
pub use material::{RopeCrowdExtension, RopeCrowdMaterial};
#[cfg(feature = "crowd")]
pub use plugin::MassSpringCrowdPlugin;

use super::tube::Tube;

/// Beside [`RopeMesh`](super::RopeMesh): the rope is drawn as one of a crowd.
///
/// Ropes of a crowd have no meshes of their own. All that are alike (as many links of the same rest lengths, the same
/// `RopeMesh`) share one, and a vertex shader places it: hundreds of ropes cost about what their particles do, in one
/// draw call a material. It looks as without this component. The `MeshMaterial3d<StandardMaterial>` of the entity is taken for its
/// `MeshMaterial3d<RopeCrowdMaterial>` and comes back when this component is removed; changes of the material are followed.
///
/// It acts with the feature `crowd` (part of `viewer`) on graphics cards with storage buffers in vertex shaders (native and
/// WebGPU; not WebGL), and on `RopeMesh`es in 3D; else the rope has a mesh of its own. Motion vectors are zero.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_mass_spring::prelude::*;
/// fn reeds(mut commands: Commands, material: MeshMaterial3d<StandardMaterial>) {
///     for x in 0..500 {
///         let root = Transform::from_xyz(0.02 * x as f32, 0.0, 0.0);
///         commands.spawn((Rope::new(1.0), RopeMesh::default(), RopeCrowd, material.clone(), root));
///     }
/// }
/// ```
#[derive(Component, Debug, Clone, Copy, Default, PartialEq, Eq, Reflect)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct RopeCrowd;

/// What the vertex shader reads of a particle: its place in the world, m, the cross-sections a link, the normal of its
/// frame, and the radius of the tube, m.
pub(super) type Entry = [f32; 8];

/// A rope that is one of a crowd.
#[derive(Debug)]
pub(super) struct CrowdShape {
    pub tube: Tube,
    /// As of this frame.
    #[cfg_attr(not(feature = "crowd"), allow(dead_code))]
    pub entries: Vec<Entry>,
    /// Whether it has a place in the buffer.
    #[cfg_attr(not(feature = "crowd"), allow(dead_code))]
    pub has_place: bool,
}

/// Exists where crowds can be drawn.
#[derive(Resource, Debug)]
pub(super) struct CrowdSupport;
