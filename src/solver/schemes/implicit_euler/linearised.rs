//! An element with its damper during a step: its energy, force and stiffness at a position.

use bevy::math::DVec3;
use wide::{CmpEq, CmpLe};

use super::block::Symmetric;
use super::lanes::{LANES, LaneVectors, Lanes};
use crate::solver::elements::Potential;

/// An element with its damper during one step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Linearised {
    potential: Potential,
    /// The direction where it was linearised last; zero where it had none.
    pub direction: DVec3,
}

/// What an element contributes at a position.
pub(super) struct Contribution {
    /// ½ k (‖s‖ − r)², J.
    pub energy: f64,
    /// The pull: the force on an end of weight 1, N.
    pub force: DVec3,
    /// Second derivatives along and across its direction, made non-negative, N/m.
    pub along: f64,
    pub across: f64,
}

impl Linearised {
    /// One that is linearised first with the direction of `start`, a separation of this `length`.
    #[inline]
    pub fn new(potential: Potential, start: DVec3, length: f64) -> Self {
        Self { potential, direction: if length > 0.0 { start / length } else { DVec3::ZERO } }
    }

    /// How much longer than at rest it is at the separation s, m; 0 for a slack cable.
    fn elongation(&self, separation: DVec3) -> f64 {
        let elongation = separation.length() - self.potential.rest_length;
        if self.potential.tension_only { elongation.max(0.0) } else { elongation }
    }

    /// Its energy at the separation s, J.
    pub fn energy(&self, separation: DVec3) -> f64 {
        0.5 * self.potential.stiffness * self.elongation(separation).powi(2)
    }

    /// Whether it pushes at the separation s.
    pub fn is_pressed(&self, separation: DVec3) -> bool {
        let Potential { rest_length, tension_only, .. } = self.potential;
        !tension_only && separation.length_squared() < rest_length * rest_length
    }

    /// Its tension at the separation s, N.
    pub fn tension(&self, separation: DVec3) -> f64 {
        self.potential.stiffness * self.elongation(separation)
    }

    /// Linearises it at the separation s.
    ///
    /// The Hessian of its energy is k d dᵀ + (T/l) (I − d dᵀ) with the tension T and l = ‖s‖. A step that turns the
    /// element lengthens it, in second order, and a stiff one then seems to be under a tension that the
    /// next step takes away again; as a stiffness against turning it would only be in the way. So T is
    /// the tension that the last linearisation predicts for this place: Newton's method for position
    /// and tension as two unknowns, which converges alike for every stiffness. T < 0 counts as 0, so
    /// that the Hessian is positive semi-definite.
    #[inline]
    pub fn linearise(&mut self, separation: DVec3) -> Contribution {
        let Potential { stiffness, rest_length, tension_only } = self.potential;
        let squared = separation.length_squared();
        if tension_only && squared <= rest_length * rest_length {
            self.direction = if squared > 0.0 { separation / squared.sqrt() } else { DVec3::ZERO };
            return Contribution { energy: 0.0, force: DVec3::ZERO, along: 0.0, across: 0.0 };
        }
        if squared == 0.0 {
            self.direction = DVec3::ZERO;
            let across = if rest_length == 0.0 { stiffness } else { 0.0 };
            let energy = 0.5 * stiffness * rest_length * rest_length;
            return Contribution { energy, force: DVec3::ZERO, along: across, across };
        }
        let length = squared.sqrt();
        let inverse_length = 1.0 / length;
        let predicted_length = match rest_length == 0.0 {
            true => length,
            false => self.direction.dot(separation),
        };
        let elongation = length - rest_length;
        self.direction = separation * inverse_length;
        let tension = stiffness * elongation;
        let across = stiffness * ((predicted_length - rest_length) * inverse_length).max(0.0);
        Contribution {
            energy: 0.5 * tension * elongation,
            force: self.direction * -tension,
            along: stiffness,
            across,
        }
    }
}

/// What two elements contribute, side by side.
pub(super) struct Contributions {
    pub energy: Lanes,
    pub direction: LaneVectors,
    pub force: LaneVectors,
    pub along: Lanes,
    pub across: Lanes,
}

impl Linearised {
    /// One that does nothing.
    pub const NONE: Self = Self {
        potential: Potential { stiffness: 0.0, rest_length: 0.0, tension_only: false },
        direction: DVec3::ZERO,
    };

    /// The same as [`Self::linearise`] for two of them.
    #[inline(always)]
    pub fn linearise_both([first, second]: [&Self; LANES], separation: LaneVectors) -> Contributions {
        let squared = separation.dot(separation);
        let rest_length = Lanes::new([first.potential.rest_length, second.potential.rest_length]);
        // No separation is shorter than −1.
        let least = |element: &Self| {
            let Potential { rest_length, tension_only, .. } = element.potential;
            if tension_only { rest_length * rest_length } else { -1.0 }
        };
        let is_slack = squared.cmp_le(Lanes::new([least(first), least(second)]));
        let stiffness = Lanes::new([first.potential.stiffness, second.potential.stiffness]);
        let stiffness = is_slack.blend(Lanes::ZERO, stiffness);
        let length = squared.sqrt();
        let is_none = squared.cmp_eq(Lanes::ZERO);
        let inverse_length = is_none.blend(Lanes::ZERO, Lanes::ONE / length);
        let predicted = LaneVectors::new([first.direction, second.direction]).dot(separation);
        let has_no_rest_length = rest_length.cmp_eq(Lanes::ZERO);
        let predicted_length = has_no_rest_length.blend(length, predicted);
        let elongation = length - rest_length;
        let direction = separation * inverse_length;
        let tension = stiffness * elongation;
        let across = stiffness * ((predicted_length - rest_length) * inverse_length).fast_max(Lanes::ZERO);
        // What has no direction has none to pull in, and is stiff in all, if it has no rest length.
        let across = is_none.blend(has_no_rest_length & stiffness, across);
        Contributions {
            energy: Lanes::HALF * tension * elongation,
            direction,
            force: direction * (Lanes::ZERO - tension),
            along: is_none.blend(across, stiffness),
            across,
        }
    }
}

impl Contribution {
    /// The second derivatives of an element with this `direction`.
    #[inline]
    pub fn block(&self, direction: DVec3) -> Symmetric {
        Symmetric::uniaxial(direction, self.along, self.across)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cables and springs, with and without a rest length, that are stretched, slack or compressed, turned, and of no length.
    #[test]
    fn two_elements_side_by_side_contribute_what_each_does_alone() {
        let mut elements = Vec::new();
        for rest_length in [0.0, 0.5] {
            for tension_only in [false, true] {
                for separation in [0.0, 0.2, 0.4, 0.9].map(|length| DVec3::new(0.6, 0.0, 0.8) * length) {
                    for start in [DVec3::ZERO, DVec3::new(0.3, 0.4, 0.0), separation * 1.5] {
                        let potential = Potential { stiffness: 37.0, rest_length, tension_only };
                        elements.push((Linearised::new(potential, start, start.length()), separation));
                    }
                }
            }
        }
        for shift in 0..elements.len() {
            let others = elements.iter().cycle().skip(shift);
            for (first, second) in elements.iter().zip(others) {
                let pair = [first, second];
                let separations = LaneVectors::new(pair.map(|(_, separation)| *separation));
                let found = Linearised::linearise_both([&first.0, &second.0], separations);
                for (lane, (element, separation)) in pair.into_iter().enumerate() {
                    let mut alone = *element;
                    let expected = alone.linearise(*separation);
                    let of = |lanes: Lanes| lanes.to_array()[lane];
                    assert_eq!(found.direction.split()[lane], alone.direction);
                    assert_eq!(found.force.split()[lane], expected.force);
                    assert_eq!(of(found.energy), expected.energy);
                    assert_eq!([of(found.along), of(found.across)], [expected.along, expected.across]);
                }
            }
        }
    }
}
