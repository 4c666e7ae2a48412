//! Nets: ropes, cloths, jellies and balloons, each many particles and elements on one entity.
//!
//! A recipe becomes a [`Topology`], a pure value; [`ParticleNet`] is the
//! state of one net that is laid out by it.

mod net;
mod spool;
mod tear;
mod topology;

pub use net::ParticleNet;
pub use spool::Spool;
pub use tear::{Rupture, Split, Tear, pieces, tear};
pub use topology::{Air, Layout, MeshBinding, Topology};
