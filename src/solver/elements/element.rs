//! The contract of a kind of element.

use std::fmt::Debug;

use bevy::math::{DVec3, Vec3};

/// What the solver asks of a kind of element with `N` ends.
///
/// All forces are along the separation s = Σ cᵢ xᵢ; end i feels cᵢ times the *pull*. Its law is that of a spring and a damper,
/// k (‖s‖ − r) + c d‖s‖/dt, maybe one-sided: so it has a [`Potential`], [`Rates`], and one tension.
pub(in crate::solver) trait Element<const N: usize>:
    Copy + Default + PartialEq + Debug + Send + Sync + 'static
{
    /// Whether the graph sorts elements of this kind into runs, for which the kernel has code of its own. Those of other
    /// kinds are computed one by one.
    const HAS_RUNS: bool = false;

    /// The weights c, which add up to 0. Those of an element of two ends are (1, −1).
    fn weights(&self) -> [f32; N];

    /// The pull in N, from s in m and its rate in m/s. Compiled into the vectorised kernel.
    fn pull(&self, separation: Vec3, rate: Vec3) -> Vec3;

    /// The potential energy in J.
    fn energy(&self, separation: DVec3) -> f64;

    /// The same with its damper, as one [`Potential`] of a step of backward Euler of `step` seconds that begins
    /// with the length `start` = ‖s‖ (m).
    fn potential(&self, start: f64, step: f64) -> Potential;

    /// Coefficients for the bounds on frequencies, and for position-based dynamics.
    fn rates(&self) -> Rates;

    /// The ‖s‖ without force, m.
    fn rest_length(&self) -> f64;

    /// Whether it exerts no force where ‖s‖ is below its rest length.
    fn tension_only(&self) -> bool {
        false
    }

    /// The limit of ‖s‖, as a part of the rest length by which it may be longer; `None` without one.
    fn max_stretch(&self) -> Option<f32> {
        None
    }

    /// Whether it may break or yield.
    fn may_fail(&self) -> bool {
        false
    }

    /// The element between this one (`share` 0) and `other` (1). One without intermediate values changes at once.
    fn between(&self, other: &Self, _share: f32) -> Self {
        *other
    }

    /// What stands in its place when it is removed: it exerts no force.
    fn emptied(&self) -> Self {
        Self::default()
    }

    /// Whether it exerts any force: an empty place does not.
    fn acts(&self) -> bool {
        let Rates { stiffness, damping } = self.rates();
        stiffness > 0.0 || damping > 0.0
    }

    /// The force along s in N with which it draws its ends together, damper included; negative where it pushes.
    fn tension(&self, separation: DVec3, rate: DVec3) -> f64 {
        let length = separation.length();
        let Rates { stiffness, damping } = self.rates();
        let speed = if length > 0.0 { rate.dot(separation) / length } else { 0.0 };
        f64::from(stiffness) * (length - self.rest_length()) + f64::from(damping) * speed
    }
}

/// The energy ½ k (‖s‖ − r)² of an element and its damper during one step; of one that only pulls, where ‖s‖ > r.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::solver) struct Potential {
    /// k, N/m.
    pub stiffness: f64,
    /// r, m.
    pub rest_length: f64,
    /// Whether it is 0 where ‖s‖ < r.
    pub tension_only: bool,
}

/// How strongly an element reacts.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(in crate::solver) struct Rates {
    /// The largest second derivative of the energy by s, N/m.
    pub stiffness: f32,
    /// The damping along s, N·s/m.
    pub damping: f32,
}
