//! Which version of its topology a net has.
//!
//! What is derived from a topology has to know whether that has changed. A comparison would read all of it; a shared
//! pointer would keep a net from changing its topology in place, which one on a winch does in every tick.

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
    /// Elements have other parameters.
    pub fn touch_parameters(&mut self) {
        self.parameters = next();
    }

    /// Other particles are joined.
    pub fn touch_structure(&mut self) {
        *self = Self::default();
    }
}

fn next() -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(1);
    NEXT.fetch_add(1, Ordering::Relaxed)
}
