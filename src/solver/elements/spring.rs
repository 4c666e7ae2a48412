//! The damped spring: two ends, Hooke's law and a dashpot along it.

use bevy::math::{DVec3, Vec3};

use super::{Element, Plasticity, Potential, Rates};

/// The parameters of a damped spring between two particles; those of the default are zero: it exerts no force.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub struct Spring {
    /// The length l0 without force, m, >= 0.
    pub rest_length: f32,
    /// Stiffness k, N/m, >= 0.
    pub stiffness: f32,
    /// Damping c along the spring, N·s/m, >= 0.
    pub damping: f32,
    /// Whether it only pulls, as a cable does: no force, nor that of the damper, while it is shorter than l0, and
    /// none that pushes.
    pub tension_only: bool,
    /// The strain limit: it is never longer than (1 + this) · l0 at the end of a tick; finite and >= 0.
    pub max_stretch: Option<f32>,
    /// The tension, damper included, beyond which it breaks: it is removed at the end of the substep. In N, finite
    /// and >= 0; `None`: never.
    pub breaking_force: Option<f32>,
    /// Whether it is only reported when it breaks, once a tick, and goes on until its owner removes it: of surfaces,
    /// which are torn apart in another way.
    pub tears: bool,
    /// How it yields; `None`: not at all.
    pub plasticity: Option<Plasticity>,
}

impl Spring {
    /// An elastic spring: rest length in m, stiffness in N/m, damping in N·s/m.
    pub const fn elastic(rest_length: f32, stiffness: f32, damping: f32) -> Self {
        let (tension_only, max_stretch, breaking_force, tears, plasticity) = (false, None, None, false, None);
        Self { rest_length, stiffness, damping, tension_only, max_stretch, breaking_force, tears, plasticity }
    }
}

impl Element<2> for Spring {
    const HAS_RUNS: bool = true;

    #[inline(always)]
    fn weights(&self) -> [f32; 2] {
        [1.0, -1.0]
    }

    /// With d the direction of the separation s = x₁ − x₂, the ideal spring pulls the first end with
    /// −k (‖s‖ − l0) d (Hooke's law) and the damper with −c (ṡ · d) d. Without a direction there is no force.
    #[inline(always)]
    fn pull(&self, separation: Vec3, rate: Vec3) -> Vec3 {
        let length = separation.length();
        let direction = separation * if length == 0.0 { 0.0 } else { 1.0 / length };
        let rest_length = self.length_at_rest();
        let tension = self.stiffness * (length - rest_length) + self.damping * rate.dot(direction);
        let is_slack = self.tension_only && (length <= rest_length || tension < 0.0);
        direction * if is_slack { 0.0 } else { -tension }
    }

    fn tension(&self, separation: DVec3, rate: DVec3) -> f64 {
        let (length, rest_length) = (separation.length(), self.rest_length());
        let speed = if length > 0.0 { rate.dot(separation) / length } else { 0.0 };
        let tension = f64::from(self.stiffness) * (length - rest_length) + f64::from(self.damping) * speed;
        let is_slack = self.tension_only && (length <= rest_length || tension < 0.0);
        if is_slack { 0.0 } else { tension }
    }

    fn energy(&self, separation: DVec3) -> f64 {
        let elongation = separation.length() - self.rest_length();
        let elongation = if self.tension_only { elongation.max(0.0) } else { elongation };
        0.5 * f64::from(self.stiffness) * elongation * elongation
    }

    /// Spring and damper together are those of one spring of k + c/h and (k l0 + c/h l) / (k + c/h), with the
    /// length l at the start of the step: the damper's elongation rate is (l' − l)/h. The damper of one that only
    /// pulls is extended from l0 on, so that its force begins with 0.
    #[inline]
    fn potential(&self, start: f64, step: f64) -> Potential {
        let (stiffness, rest_length) = (f64::from(self.stiffness), self.rest_length());
        let damping_rate = f64::from(self.damping) / step;
        let sum = stiffness + damping_rate;
        let start = if self.tension_only { start.max(rest_length) } else { start };
        let rest_length = match damping_rate > 0.0 {
            true => (stiffness * rest_length + damping_rate * start) / sum,
            false => rest_length,
        };
        Potential { stiffness: sum, rest_length, tension_only: self.tension_only }
    }

    #[inline]
    fn rates(&self) -> Rates {
        Rates { stiffness: self.stiffness, damping: self.damping }
    }

    #[inline]
    fn rest_length(&self) -> f64 {
        self.length_at_rest().into()
    }

    #[inline]
    fn tension_only(&self) -> bool {
        self.tension_only
    }

    fn max_stretch(&self) -> Option<f32> {
        self.max_stretch
    }

    fn may_fail(&self) -> bool {
        self.breaking_force.is_some() || self.plasticity.is_some()
    }

    fn between(&self, other: &Self, share: f32) -> Self {
        let mix = |from: f32, to: f32| from + share * (to - from);
        let rest_length = mix(self.rest_length, other.rest_length);
        Self {
            rest_length,
            stiffness: mix(self.stiffness, other.stiffness),
            damping: mix(self.damping, other.damping),
            plasticity: self.plasticity_between(other, share, rest_length),
            ..*other
        }
    }

    /// Runs are of cables or of none: an empty place in one changes nothing.
    fn emptied(&self) -> Self {
        Self { tension_only: self.tension_only, ..Self::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPRING: Spring = Spring::elastic(1.0, 200.0, 3.0);

    #[test]
    fn a_stretched_spring_pulls_its_ends_together() {
        assert_eq!(SPRING.pull(Vec3::X * 1.5, Vec3::ZERO), Vec3::X * -100.0);
        assert_eq!(SPRING.pull(Vec3::X * 0.5, Vec3::ZERO), Vec3::X * 100.0);
        assert_eq!(SPRING.energy(DVec3::Y * 1.5), 25.0);
    }

    #[test]
    fn the_damper_acts_along_the_spring_only() {
        let rate = Vec3::new(5.0, 2.0, 7.0);
        assert_eq!(SPRING.pull(Vec3::Y, rate), Vec3::Y * -6.0);
        assert_eq!(SPRING.tension(DVec3::Y, rate.as_dvec3()), 6.0);
    }

    #[test]
    fn a_cable_pulls_when_it_is_taut_and_never_pushes() {
        let cable = Spring { tension_only: true, ..SPRING };
        assert_eq!(cable.pull(Vec3::X * 1.5, Vec3::ZERO), SPRING.pull(Vec3::X * 1.5, Vec3::ZERO));
        assert_eq!(cable.tension(DVec3::X * 1.5, DVec3::X), 103.0);
        // Slack, or drawn together faster than it is taut: neither spring nor damper acts.
        for (length, speed) in [(0.5, 0.0), (0.5, 100.0), (1.0, 5.0), (1.5, -40.0)] {
            assert_eq!(cable.pull(Vec3::X * length, Vec3::X * speed), Vec3::ZERO);
            assert_eq!(cable.tension(DVec3::X * f64::from(length), DVec3::X * f64::from(speed)), 0.0);
        }
        assert_eq!(cable.energy(DVec3::X * 0.5), 0.0);
        assert_eq!(cable.energy(DVec3::X * 1.5), SPRING.energy(DVec3::X * 1.5));
        // From slack, the damper acts on what is beyond l0 only.
        assert_eq!(cable.potential(0.5, 0.01).rest_length, 1.0);
        assert!(cable.potential(1.5, 0.01).rest_length > 1.2);
    }

    #[test]
    fn coincident_ends_feel_no_force() {
        assert_eq!(SPRING.pull(Vec3::ZERO, Vec3::ONE), Vec3::ZERO);
    }
}
