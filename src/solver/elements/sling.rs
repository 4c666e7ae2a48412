//! A kind for tests alone, which shows what one takes: this file, and a line in [`for_each_kind`](super::for_each_kind).
//!
//! A sling draws a particle to the middle between two others: the separation s = x₀ − ½ (x₁ + x₂), and the energy
//! ½ k ‖s‖².

use bevy::math::{DVec3, Vec3};

use super::{Element, Potential, Rates};

#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(in crate::solver) struct Sling {
    /// k, N/m.
    pub stiffness: f32,
    /// Along the separation, N·s/m.
    pub damping: f32,
}

impl Element<3> for Sling {
    fn weights(&self) -> [f32; 3] {
        [1.0, -0.5, -0.5]
    }

    #[inline(always)]
    fn pull(&self, separation: Vec3, rate: Vec3) -> Vec3 {
        let squared = separation.length_squared();
        let damped = if squared > 0.0 { self.damping * rate.dot(separation) / squared } else { 0.0 };
        separation * -(self.stiffness + damped)
    }

    fn energy(&self, separation: DVec3) -> f64 {
        0.5 * f64::from(self.stiffness) * separation.length_squared()
    }

    fn potential(&self, start: f64, step: f64) -> Potential {
        let (stiffness, damping_rate) = (f64::from(self.stiffness), f64::from(self.damping) / step);
        let sum = stiffness + damping_rate;
        let rest_length = if sum > 0.0 { damping_rate * start / sum } else { 0.0 };
        Potential { stiffness: sum, rest_length, tension_only: false }
    }

    fn rates(&self) -> Rates {
        Rates { stiffness: self.stiffness, damping: self.damping }
    }

    fn rest_length(&self) -> f64 {
        0.0
    }

    fn between(&self, other: &Self, share: f32) -> Self {
        let mix = |from: f32, to: f32| from + share * (to - from);
        Self { stiffness: mix(self.stiffness, other.stiffness), damping: mix(self.damping, other.damping) }
    }
}
