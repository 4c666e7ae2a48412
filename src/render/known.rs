//! The version of a net for which a mesh or links were made.

use crate::nets::{ParticleNet, Topology};

/// A net as it was.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Known {
    structure: u64,
}

impl Known {
    pub fn new(net: &ParticleNet) -> Self {
        Self { structure: net.versions().structure }
    }

    /// Whether the net has the same particles, joined by the same springs, of which the same broke.
    pub fn is_same(&self, net: &ParticleNet) -> bool {
        *self == Self::new(net)
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
