//! Nets: ropes, cloths, jellies and balloons, each many particles and elements on one entity.
//!
//! A recipe becomes a [`Topology`], a pure value; [`ParticleNet`] is the
//! state of one net that is laid out by it.
//!
#![doc = include_str!("../../docs/nets.md")]

mod attachment;
mod balloon;
#[cfg(feature = "render")]
mod bevy_mesh;
mod breaking;
mod cloth;
mod error;
mod haul;
mod icosphere;
mod inside;
mod jelly;
mod lattice;
mod laying;
mod material;
mod material_change;
mod measures;
mod membrane;
#[cfg(feature = "render")]
mod mesh_colliders;
mod missing_mesh;
mod moduli;
mod net;
mod part;
mod path;
mod places;
mod pose;
mod queries;
mod rope;
mod sheet;
mod solid;
mod spool;
mod tear;
mod topology;
mod triangle_mesh;
mod validation;
mod version;
mod weld;
mod winch;
mod yielding;

use crate::parameter::{self, InvalidParameter};

pub use attachment::Attachment;
pub(crate) use attachment::{Anchor, Tie};
pub use balloon::{Balloon, BalloonShape};
#[cfg(feature = "render")]
pub use bevy_mesh::ATTRIBUTE_PIN;
pub use breaking::Breaking;
pub(crate) use breaking::Damage;
pub use cloth::{Cloth, ClothShape};
pub use error::NetError;
pub use jelly::{Jelly, JellyShape};
pub use laying::RecipeMesh;
pub(crate) use laying::{build, change_materials, lay_out_now};
pub use material::{BalloonMaterial, ClothMaterial, JellyMaterial, RopeMaterial};
pub(crate) use net::Arrays;
pub use net::ParticleNet;
pub use part::{Part, PartOf, PartState, Parts};
pub use places::{Corner, Side};
pub(crate) use pose::NetPose;
pub use queries::NetHit;
pub(crate) use queries::{NetBody, NetFeature};
pub use rope::Rope;
pub use spool::Spool;
pub use tear::{Rupture, Split, Tear, pieces, tear};
pub use topology::{Air, Layout, MeshBinding, Topology};
pub use triangle_mesh::{MeshVertex, TriangleMesh};
pub use validation::InvalidTopology;
pub use winch::Winch;
pub use yielding::Yielding;

/// The number of cells of at most `spacing` along `length`, m. A length that is a multiple of the spacing but for its
/// rounding is one.
fn cells_along(length: f64, spacing: f32) -> u64 {
    ((length / f64::from(spacing) * (1.0 - 1e-6)).ceil() as u64).max(1)
}

/// Checks what recipes have in common, in the order of their fields.
fn check_numbers(
    radius: f32,
    material: Result<(), InvalidParameter>,
    max_stretch: Option<f32>,
    air: Air,
) -> Result<(), NetError> {
    parameter::non_negative("radius", radius)?;
    material?;
    max_stretch.map_or(Ok(()), |limit| parameter::non_negative("max_stretch", limit))?;
    Ok(air.validate()?)
}
