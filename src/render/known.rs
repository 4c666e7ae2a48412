//! What was known of a net when something was made for it.

use std::sync::{Arc, Weak};

use crate::nets::{ParticleNet, Topology};

/// A net as it was.
///
/// It holds the topology weakly: a net that alone has its topology changes it in place, and would have to copy it if
/// it were held here. What is changed so gets another address all the same, and no other gets this one.
#[derive(Debug, Clone, Default)]
pub(super) struct Known {
    topology: Weak<Topology>,
    broken: Vec<u32>,
}

impl Known {
    pub fn new(net: &ParticleNet) -> Self {
        Self { topology: Arc::downgrade(net.topology()), broken: net.broken().to_vec() }
    }

    /// Whether the net has the same topology and the same broken springs.
    pub fn is_same(&self, net: &ParticleNet) -> bool {
        Weak::as_ptr(&self.topology) == Arc::as_ptr(net.topology()) && self.broken == net.broken()
    }
}

/// The particles of a net at rest, condensed: different for others.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Particles {
    count: usize,
    hash: u64,
}

impl Particles {
    pub fn new(topology: &Topology) -> Self {
        Self::first(topology, topology.positions.len())
    }

    /// Whether the net has these particles, and perhaps more.
    pub fn are_in(&self, topology: &Topology) -> bool {
        self.count <= topology.positions.len() && Self::first(topology, self.count) == *self
    }

    /// The first particles of a net, by the hash of Fowler, Noll and Vo (FNV-1a, 64 bits) of their places at rest.
    fn first(topology: &Topology, count: usize) -> Self {
        let bits = topology.positions[..count].iter().flat_map(|place| place.to_array()).map(f32::to_bits);
        let hash = bits.fold(0xcbf2_9ce4_8422_2325, |hash: u64, bits| {
            (hash ^ u64::from(bits)).wrapping_mul(0x0000_0100_0000_01b3)
        });
        Self { count, hash }
    }
}
