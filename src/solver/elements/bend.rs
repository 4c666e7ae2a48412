//! The bend: N ends, energy ½ k ‖Σ cᵢ xᵢ‖². A kind for tests only, which shows what the contract carries.
//!
//! Three ends with c = (1, −2, 1) resist the bending of a rod, four those of the hinge between two triangles
//! (Bergou et al., *A quadratic bending model for inextensible surfaces*, 2006).

use bevy::math::{DVec3, Vec3};

use super::{Element, Potential, Rates};

/// The parameters of a bend.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(in crate::solver) struct Bend<const N: usize> {
    /// Stiffness k, N/m.
    pub stiffness: f32,
    /// Damping along the separation, N·s/m.
    pub damping: f32,
    /// The weights, which add up to 0.
    #[cfg_attr(feature = "serialize", serde(skip, default = "no_weights"))]
    pub weights: [f32; N],
}

#[cfg(feature = "serialize")]
fn no_weights<const N: usize>() -> [f32; N] {
    [0.0; N]
}

impl<const N: usize> Default for Bend<N> {
    fn default() -> Self {
        Self { stiffness: 0.0, damping: 0.0, weights: [0.0; N] }
    }
}

impl<const N: usize> Element<N> for Bend<N> {
    fn weights(&self) -> [f32; N] {
        self.weights
    }

    fn pull(&self, separation: Vec3, rate: Vec3) -> Vec3 {
        let squared = separation.length_squared();
        let along = if squared > 0.0 { rate.dot(separation) / squared } else { 0.0 };
        separation * -(self.stiffness + self.damping * along)
    }

    fn energy(&self, separation: DVec3) -> f64 {
        0.5 * f64::from(self.stiffness) * separation.length_squared()
    }

    fn potential(&self, start: DVec3, step: f64) -> Potential {
        let (stiffness, damping_rate) = (f64::from(self.stiffness), f64::from(self.damping) / step);
        let sum = stiffness + damping_rate;
        let rest_length = if damping_rate > 0.0 { damping_rate * start.length() / sum } else { 0.0 };
        Potential { stiffness: sum, rest_length }
    }

    fn rates(&self) -> Rates {
        Rates { stiffness: self.stiffness, damping: self.damping }
    }

    fn rest_length(&self) -> f64 {
        0.0
    }
}
