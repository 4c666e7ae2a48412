//! Coulomb friction in an implicit step: where it sticks and where it slides.
//!
//! Its potential is μ N ‖u‖ of the slip u along the surface, but quadratic below a small slip, the *creep*. Newton's method follows one of its
//! two branches, by what the last linearisation was ([`FrictionState`]): what sticks slides as soon as more than μ N would be needed, and what
//! slides sticks as soon as its slip turns back. (The primal-dual active set method, which is a semi-smooth Newton method: Hintermüller, Ito
//! and Kunisch, *SIAM J. Optim.* 13, 865, 2002; of friction: Hüeber, Stadler and Wohlmuth, *SIAM J. Sci. Comput.* 30, 572, 2008.)
//!
//! Where faces touch, many contacts share one force, and that method does not settle: there it takes quadratics that touch the potential from
//! above, or, where the last two solutions say that less than the limit holds, the one of what sticks ([`FrictionHistory`]).

use bevy::math::DVec3;

use super::block::Symmetric;

/// What the friction of a contact was in the last linearisation.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) enum FrictionState {
    /// None yet.
    #[default]
    Unknown,
    Sticking,
    /// In this direction, a unit vector or zero.
    Sliding(DVec3),
}

/// The friction of one linearisation, and the slip there, m; the force by which it held in the solution before, N.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct FrictionHistory {
    slip: f64,
    stiffness: f64,
    force: f64,
}

/// A slip along a surface against a force of friction of at most `limit` N.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slip {
    /// m.
    pub displacement: DVec3,
    /// N, >= 0.
    pub limit: f64,
    /// Below this slip friction is viscous, m, > 0.
    pub creep: f64,
}

/// What friction contributes to a linearisation.
pub(super) struct Friction {
    /// N.
    pub force: DVec3,
    /// Along the surface, N/m.
    pub stiffness: f64,
    /// The direction in which it has no stiffness, or zero.
    pub free: DVec3,
}

impl FrictionState {
    /// What friction is now.
    pub fn next(self, Slip { displacement, limit, creep }: Slip) -> Self {
        match self {
            _ if limit == 0.0 => Self::Unknown,
            Self::Sticking if displacement.length_squared() <= creep * creep => Self::Sticking,
            Self::Sliding(direction) if displacement.dot(direction) < 0.0 => Self::Sticking,
            _ => Self::Sliding(displacement.normalize_or_zero()),
        }
    }

    /// Whether it sticks, or slides, where the other did not.
    pub fn differs(self, other: Self) -> bool {
        (self == Self::Sticking) != (other == Self::Sticking)
    }
}

impl FrictionHistory {
    /// What friction contributes, by a quadratic that touches its potential from above, so that a step never overshoots, or by that of what
    /// sticks.
    pub fn friction(&mut self, Slip { displacement, limit, creep }: Slip) -> Friction {
        let length = displacement.length();
        let sticks = self.will_stick(length, limit);
        let stiffness =
            if limit > 0.0 { limit / if sticks { creep } else { length.max(creep) } } else { 0.0 };
        *self = Self { slip: length, stiffness, force: self.stiffness * length };
        Friction { force: displacement * -stiffness, stiffness, free: DVec3::ZERO }
    }

    /// Whether a force of less than `limit` N will stop a slip that has become this, m.
    ///
    /// The quadratics come nearer to what sticks by a part of the way only, the nearer to sliding the slower. The force that stops it is
    /// extrapolated from the last two solutions, of which this one was held by `stiffness` · slip.
    fn will_stick(&self, slip: f64, limit: f64) -> bool {
        let force = self.stiffness * slip;
        let force_grew = slip < self.slip && force > self.force;
        force_grew && force + (force - self.force) * slip / (self.slip - slip) <= limit
    }
}

impl Slip {
    /// The potential, J.
    pub fn energy(self) -> f64 {
        let Self { displacement, limit, creep } = self;
        let length = displacement.length();
        match length < creep {
            true => 0.5 * limit / creep * length * length,
            false => limit * (length - 0.5 * creep),
        }
    }

    /// What friction contributes in a state. What sticks is as stiff as below the creep, at any slip.
    pub fn friction(self, state: FrictionState) -> Friction {
        let Self { displacement, limit, creep } = self;
        let length = displacement.length();
        let slides = state != FrictionState::Sticking && length > creep;
        let stiffness = limit / if slides { length } else { creep };
        let free = if slides { displacement / length } else { DVec3::ZERO };
        Friction { force: displacement * -stiffness, stiffness, free }
    }
}

impl Friction {
    /// Its stiffness with that of a contact, `along` N/m of its normal.
    pub fn block(&self, normal: DVec3, along: f64) -> Symmetric {
        let mut block = Symmetric::uniaxial(normal, along, self.stiffness);
        block += Symmetric::uniaxial(self.free, -self.stiffness, 0.0);
        block
    }
}
