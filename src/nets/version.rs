//! Which version of its topology a net has.
//!
//! Caches of a topology compare versions, as a comparison of topologies would read all of them. The address of a shared pointer does not
//! serve: a net on a winch changes its topology in place in every tick.

use bevy::platform::sync::atomic::{AtomicU64, Ordering};

/// The numbers of the present version, which no other content has or ever had. They are no part of the value of a net:
/// all are equal.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Versions {
    /// Of all that the topology says.
    pub parameters: u64,
    /// Of the particles, what joins them, the surface, and which springs broke.
    pub structure: u64,
}

/// Of something new.
impl Default for Versions {
    fn default() -> Self {
        let number = next();
        Self { parameters: number, structure: number }
    }
}

impl PartialEq for Versions {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl Versions {
    /// To be called when parameters of elements have changed.
    pub fn touch_parameters(&mut self) {
        self.parameters = next();
    }

    /// To be called when elements join other particles.
    pub fn touch_structure(&mut self) {
        *self = Self::default();
    }
}

fn next() -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(1);
    NEXT.fetch_add(1, Ordering::Relaxed)
}
