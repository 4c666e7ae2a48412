//! Contacts of edges and faces with colliders in the round of [`Integrator::Xpbd`](crate::solver::Integrator::Xpbd).
//!
//! There positions are solved for, of the elements first, then of the contacts, and the velocity of a particle is what it has moved by in
//! the substep, divided by that. So contacts that displace a particle change its velocity by as much (Macklin et al., *Small steps in
//! physics simulation*, 2019; Müller et al., *Detailed rigid body simulation with extended position based dynamics*, 2020): were it
//! changed by impulses that only stop the approach, a cloth over an edge would move by what the iterations leave of the one and of the
//! other, and never come to rest. As with the elements, each round starts from nothing: what contacts did in the one before is not
//! repeated.
//!
//! Two things are left to the impulses of `solve.rs`, which follow: the rebound, and what is left of the approach. And a displacement that
//! undoes an overlap from before the substep gives no velocity: it is bounded by the approach.
//!
//! Where particles alone touch colliders, one contact changes nothing of another, and impulses are exact: they do not show how positions
//! are rounded.

use bevy::math::{Vec3, Vec3A};

use super::ContactCaches;
use super::response::shortened;
use super::solve::POSITION_ITERATIONS;

/// What a contact has changed in a round so far.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Following {
    /// How fast the two approached before, m/s, >= 0.
    approach: f32,
    /// By how much they were displaced along the normal, m, and by friction, m.
    depth: f32,
    friction_displacement: Vec3,
    /// The changes of their velocity that follow, along the normal, 0 to `approach`, and by friction, m/s.
    velocity: f32,
    friction_velocity: Vec3,
}

impl Following {
    /// That of two which approach at this velocity, m/s, if that is positive.
    pub fn new(approach: f32) -> Self {
        Self { approach: approach.max(0.0), ..Self::default() }
    }

    /// Adds a displacement by `depth` along the normal, and by friction, in a substep; the changes of the velocity that follow along
    /// the normal, and by friction of this coefficient.
    pub fn follow(&mut self, [depth, coefficient, substep]: [f32; 3], friction: Vec3A) -> (f32, Vec3A) {
        self.depth += depth;
        let displacement = Vec3A::from(self.friction_displacement) + friction;
        let velocity = (self.depth / substep).clamp(0.0, self.approach);
        let friction_velocity = shortened(displacement / substep, coefficient * velocity);
        let change = (velocity - self.velocity, friction_velocity - Vec3A::from(self.friction_velocity));
        self.friction_displacement = displacement.into();
        (self.velocity, self.friction_velocity) = (velocity, friction_velocity.into());
        change
    }
}

impl ContactCaches {
    /// Solves the positions of the contacts of nets with colliders at the end of a round of `substep` seconds, and the velocities that
    /// follow.
    pub(super) fn solve_round(&mut self, substep: f32) {
        let takes_back = self.takes_back();
        let Self { touches, bodies, .. } = self;
        touches.all.iter_mut().for_each(|touch| touch.begin_round(bodies));
        for _ in 0..POSITION_ITERATIONS {
            touches
                .all
                .iter_mut()
                .for_each(|touch| touch.solve_position(bodies, substep, [takes_back, true]));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SUBSTEP: f32 = 0.01;

    /// Two that approach at 2 m/s; by 10, 8 and −5 mm along the normal, and 3 mm across it each time.
    #[test]
    fn the_velocity_follows_a_displacement_up_to_the_approach_and_back() {
        let mut following = Following::new(2.0);
        let across = Vec3A::X * 3e-3;
        let mut total = (0.0, Vec3A::ZERO);
        for (depth, along, rubbed) in [(0.01, 1.0, 0.3), (0.008, 1.8, 0.54), (-0.005, 1.3, 0.39)] {
            let (change, friction) = following.follow([depth, 0.3, SUBSTEP], across);
            total = (total.0 + change, total.1 + friction);
            assert!((total.0 - along).abs() < 1e-6, "{} m/s", total.0);
            // Coulomb's limit; the displacement across would give 0.3, 0.6 and 0.9 m/s.
            assert!((total.1 - Vec3A::X * rubbed).length() < 1e-6, "{} m/s", total.1);
        }
    }

    #[test]
    fn an_overlap_from_before_gives_no_velocity() {
        for approach in [-1.0, 0.0] {
            let change = Following::new(approach).follow([0.1, 0.5, SUBSTEP], Vec3A::X);
            assert_eq!(change, (0.0, Vec3A::ZERO));
        }
        let (change, _) = Following::new(0.5).follow([0.1, 0.5, SUBSTEP], Vec3A::ZERO);
        assert_eq!(change, 0.5);
    }
}
