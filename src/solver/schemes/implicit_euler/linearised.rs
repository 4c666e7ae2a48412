//! An element with its damper during a step: its energy, force and stiffness at a position.

use bevy::math::DVec3;

use super::block::Symmetric;
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

impl Contribution {
    /// The second derivatives of an element with this `direction`.
    #[inline]
    pub fn block(&self, direction: DVec3) -> Symmetric {
        Symmetric::uniaxial(direction, self.along, self.across)
    }
}
