//! How vertices are expected to go on.

use bevy::math::Vec3A;

use super::search::Moving;
use crate::solver::particles::Vectors;

/// How far vertices are expected to go in a substep.
#[derive(Clone, Copy)]
pub(super) struct Steps<'a> {
    from: &'a Vectors,
    to: &'a Vectors,
}

impl<'a> Steps<'a> {
    /// As far as in the substep before.
    pub fn of_places([from, to]: &'a [Vectors; 2]) -> Self {
        Self { from, to }
    }

    /// As far as in this one.
    pub fn of_moving(Moving { start: from, end: to, .. }: Moving<'a>) -> Self {
        Self { from, to }
    }

    /// By slot, m; 0 for what has been nowhere.
    #[inline(always)]
    pub fn of(self, slot: usize) -> Vec3A {
        if slot >= self.from.len() || slot >= self.to.len() {
            return Vec3A::ZERO;
        }
        let step = Vec3A::from(self.to.get(slot) - self.from.get(slot));
        if step.is_finite() { step } else { Vec3A::ZERO }
    }
}
