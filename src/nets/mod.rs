//! Nets: ropes, cloths, jellies and balloons, each many particles and elements on one entity.
//!
//! A recipe becomes a [`Topology`], a pure value; [`ParticleNet`] is the
//! state of one net that is laid out by it.

mod measures;
mod net;
mod queries;
mod topology;
mod validation;

pub(crate) use net::Arrays;
pub use net::ParticleNet;
pub use queries::NetHit;
pub use topology::{Air, Layout, MeshBinding, Topology};
pub use validation::InvalidTopology;
