//! The damped spring: two ends, Hooke's law and a dashpot along it.

use bevy::math::{DVec3, Vec3};

use super::{Element, Potential, Rates};

/// The parameters of a damped spring between two particles.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub struct Spring {
    /// The length l0 without force, m, >= 0.
    pub rest_length: f32,
    /// Stiffness k, N/m, >= 0.
    pub stiffness: f32,
    /// Damping c along the spring, N·s/m, >= 0.
    pub damping: f32,
}

impl Element<2> for Spring {
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
        let tension = self.stiffness * (length - self.rest_length) + self.damping * rate.dot(direction);
        direction * -tension
    }

    fn energy(&self, separation: DVec3) -> f64 {
        let elongation = separation.length() - f64::from(self.rest_length);
        0.5 * f64::from(self.stiffness) * elongation * elongation
    }

    /// Spring and damper together are those of one spring of k + c/h and (k l0 + c/h l) / (k + c/h), with the
    /// length l at the start of the step: the damper's elongation rate is (l' − l)/h.
    #[inline]
    fn potential(&self, start: DVec3, step: f64) -> Potential {
        let (stiffness, rest_length) = (f64::from(self.stiffness), f64::from(self.rest_length));
        let damping_rate = f64::from(self.damping) / step;
        let sum = stiffness + damping_rate;
        let rest_length = match damping_rate > 0.0 {
            true => (stiffness * rest_length + damping_rate * start.length()) / sum,
            false => rest_length,
        };
        Potential { stiffness: sum, rest_length }
    }

    #[inline]
    fn rates(&self) -> Rates {
        Rates { stiffness: self.stiffness, damping: self.damping }
    }

    #[inline]
    fn rest_length(&self) -> f64 {
        self.rest_length.into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPRING: Spring = Spring { rest_length: 1.0, stiffness: 200.0, damping: 3.0 };

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
    fn coincident_ends_feel_no_force() {
        assert_eq!(SPRING.pull(Vec3::ZERO, Vec3::ONE), Vec3::ZERO);
    }
}
