//! Contacts with colliders other than half-spaces, after a substep: each is resolved as a contact with the tangent plane of the surface
//! there (`plane.rs`).
//!
//! The contact point is a point of the net, Σ wᵢ xᵢ of up to three particles: a particle, a point of an edge, or one of a
//! face. An impulse λ n changes their velocities by λ wᵢ n / mᵢ, so that its effective mass is
//! 1 / Σ wᵢ²/mᵢ.
//!
//! Contact points of an edge and of the faces beside it share particles, so that an impulse on one moves the others. So impulses are
//! accumulated, and an iteration may reduce them again, down to 0 (projected Gauss–Seidel: Catto, *Iterative dynamics with temporal
//! coherence*, GDC 2005): no point leaves the surface because it was pushed twice. Within a tick the iteration starts from the impulses of
//! the substep before, each bounded by the impulse that the point would need alone.

use bevy::math::{Vec3, Vec3A};

use super::bodies::Body;
use super::response::{shortened, tangential};
use super::round::Following;
use crate::solver::particles::Particles;

/// Particles of a point, at most.
pub(super) const MAX_POINTS: usize = 3;

/// A point of the net that touches a collider.
#[derive(Debug, Clone, Copy)]
pub(super) struct Touch {
    /// The slots of its particles.
    pub slots: [u32; MAX_POINTS],
    /// The same among the bodies.
    pub bodies: [u32; MAX_POINTS],
    /// The first `count` have a part in it.
    pub count: u32,
    pub weights: [f32; MAX_POINTS],
    /// wᵢ/mᵢ / Σ wⱼ²/mⱼ: by how much a particle moves where the point moves by 1.
    pub shares: [f32; MAX_POINTS],
    /// The number of the collider.
    pub collider: u32,
    /// Of the surface, towards the point.
    pub normal: Vec3A,
    /// Where the point was when it was found, m, and how deep then.
    pub place: Vec3A,
    pub depth: f32,
    /// Its radius there, m.
    pub radius: f32,
    pub surface_velocity: Vec3A,
    pub target_velocity: f32,
    pub friction: f32,
    /// 1 / Σ wᵢ²/mᵢ, kg.
    pub mass: f32,
    /// Normal impulse given so far in this substep, N·s.
    pub impulse: f32,
    /// Used only where contacts may take back what they have given too much.
    pub accumulated: AccumulatedCorrection,
    /// Used only in the rounds of [`Integrator::Xpbd`](crate::solver::Integrator::Xpbd).
    pub following: Following,
    /// What names it among those of the substep before.
    pub key: u64,
}

/// What a contact has done so far in this substep; until it starts, what it did in the substep before.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct AccumulatedCorrection {
    /// Change of the velocity along the normal, m/s, >= 0, and by friction.
    velocity: f32,
    friction_velocity: Vec3,
    /// The same of the position, m.
    depth: f32,
    friction_displacement: Vec3,
}

/// Gives each contact what it did in the substep before, of which `last` has the keys in the same order.
pub(super) fn recall(touches: &mut [Touch], last: &[(u64, AccumulatedCorrection)]) {
    let mut last = last.iter().peekable();
    for touch in touches {
        while last.next_if(|(key, _)| *key < touch.key).is_some() {}
        if let Some((_, before)) = last.next_if(|(key, _)| *key == touch.key) {
            touch.accumulated = *before;
        }
    }
}

/// Whether any is of a point between particles, which others may be next to.
pub(super) fn are_coupled(touches: &[Touch]) -> bool {
    touches.iter().any(|touch| touch.count > 1)
}

impl Touch {
    /// Σ wᵢ · the value of each body.
    #[inline]
    fn sum(&self, bodies: &[Body], value: impl Fn(&Body) -> Vec3A) -> Vec3A {
        if self.count == 1 {
            return value(&bodies[self.bodies[0] as usize]);
        }
        let each = self.bodies[..self.count as usize].iter().zip(self.weights);
        each.map(|(body, weight)| value(&bodies[*body as usize]) * weight).sum()
    }

    #[inline]
    fn each<'a>(&'a self, bodies: &'a mut [Body], mut change: impl FnMut(&mut Body, f32)) {
        for (body, share) in self.bodies[..self.count as usize].iter().zip(self.shares) {
            change(&mut bodies[*body as usize], share);
        }
    }

    /// Gives the point its velocity after the contact, unless it moves away already, and friction; by how much the velocity along
    /// the normal changes, m/s. It `takes_back` what iterations before have given too much.
    pub fn solve_velocity(&mut self, bodies: &mut [Body], takes_back: bool) -> f32 {
        let relative = self.sum(bodies, |body| body.velocity) - self.surface_velocity;
        let accumulated = if takes_back { self.accumulated } else { AccumulatedCorrection::default() };
        let change = (self.target_velocity - relative.dot(self.normal)).max(-accumulated.velocity);
        let velocity = accumulated.velocity + change;
        if change.is_nan() || velocity <= 0.0 && accumulated.velocity <= 0.0 {
            return 0.0;
        }
        let old = Vec3A::from(accumulated.friction_velocity);
        let friction_velocity = shortened(old - tangential(relative, self.normal), self.friction * velocity);
        let change_of_velocity = self.normal * change + (friction_velocity - old);
        if takes_back {
            (self.accumulated.velocity, self.accumulated.friction_velocity) =
                (velocity, friction_velocity.into());
        }
        self.each(bodies, |body, share| body.velocity += change_of_velocity * share);
        self.impulse += change * self.mass;
        change.abs()
    }

    /// Begins with the impulse of the substep before.
    pub fn start_velocity(&mut self, bodies: &mut [Body]) {
        let relative = self.sum(bodies, |body| body.velocity) - self.surface_velocity;
        let AccumulatedCorrection { velocity, friction_velocity, .. } = self.accumulated;
        (self.accumulated.velocity, self.accumulated.friction_velocity) = Default::default();
        let change = velocity.min(self.target_velocity - relative.dot(self.normal));
        if change > 0.0 {
            let friction_velocity =
                shortened(tangential(friction_velocity.into(), self.normal), self.friction * change);
            (self.accumulated.velocity, self.accumulated.friction_velocity) =
                (change, friction_velocity.into());
            self.impulse += change * self.mass;
            let change_of_velocity = self.normal * change + friction_velocity;
            self.each(bodies, |body, share| body.velocity += change_of_velocity * share);
        }
    }

    /// Has the point approach the surface no longer; the impulse of that, N·s.
    pub fn stop_approaching(&self, particles: &mut Particles) -> f32 {
        let slots = || self.slots[..self.count as usize].iter().map(|slot| *slot as usize);
        let velocities = slots().map(|slot| Vec3A::from(particles.velocity.get(slot)));
        let velocity: Vec3A = velocities.zip(self.weights).map(|(velocity, weight)| velocity * weight).sum();
        let approach = (self.surface_velocity - velocity).dot(self.normal);
        if approach > 0.0 {
            for (slot, share) in slots().zip(self.shares) {
                let velocity = Vec3A::from(particles.velocity.get(slot)) + self.normal * (approach * share);
                particles.velocity.set(slot, velocity.into());
            }
        }
        approach.max(0.0) * self.mass
    }

    /// Begins with the correction of the substep before.
    pub fn start_position(&mut self, bodies: &mut [Body]) {
        let AccumulatedCorrection { depth, friction_displacement, .. } = self.accumulated;
        (self.accumulated.depth, self.accumulated.friction_displacement) = Default::default();
        let depth = depth.min(self.depth_among(bodies));
        if depth > 0.0 {
            let friction_displacement =
                shortened(tangential(friction_displacement.into(), self.normal), self.friction * depth);
            (self.accumulated.depth, self.accumulated.friction_displacement) =
                (depth, friction_displacement.into());
            let correction = self.normal * depth + friction_displacement;
            self.each(bodies, |body, share| body.position += correction * share);
        }
    }

    /// Moves the point by `depth` along the normal and by friction; in a `round` of this many seconds the velocity follows.
    fn displace(
        &mut self,
        bodies: &mut [Body],
        depth: f32,
        friction_displacement: Vec3A,
        round: Option<f32>,
    ) {
        let correction = self.normal * depth + friction_displacement;
        let mut change_of_velocity = Vec3A::ZERO;
        if let Some(substep) = round {
            let (change, friction) =
                self.following.follow([depth, self.friction, substep], friction_displacement);
            change_of_velocity = self.normal * change + friction;
            self.impulse += change * self.mass;
        }
        self.each(bodies, |body, share| {
            body.position += correction * share;
            body.velocity += change_of_velocity * share;
        });
    }

    /// Takes note how fast the point approaches, before contacts have changed anything.
    pub fn begin_round(&mut self, bodies: &[Body]) {
        let relative = self.sum(bodies, |body| body.velocity) - self.surface_velocity;
        self.following = Following::new(-relative.dot(self.normal));
    }

    /// How deep the point is now, m.
    fn depth_among(&self, bodies: &[Body]) -> f32 {
        let place = self.sum(bodies, |body| body.position);
        self.depth - (place - self.place).dot(self.normal)
    }

    /// Takes note whether the point slips, at more than `tolerance` m/s, or is moved along.
    pub fn note_slip(&self, bodies: &mut [Body], tolerance: f32) {
        let relative = self.sum(bodies, |body| body.velocity) - self.surface_velocity;
        let slip = tangential(relative, self.normal);
        let slips = self.friction == 0.0 || slip.length_squared() > tolerance * tolerance;
        if (self.impulse > 0.0 && slips) || self.surface_velocity != Vec3A::ZERO {
            self.each(bodies, |body, _| body.slips = true);
        }
    }

    /// Puts the point back onto the surface; static friction, back to where it stuck. In a `round` the velocity follows.
    pub fn solve_position(&mut self, bodies: &mut [Body], substep: f32, [takes_back, in_round]: [bool; 2]) {
        let accumulated = if takes_back { self.accumulated } else { AccumulatedCorrection::default() };
        let change = self.depth_among(bodies).max(-accumulated.depth);
        let depth = accumulated.depth + change;
        if change.is_nan() || depth <= 0.0 && accumulated.depth <= 0.0 {
            return;
        }
        let old = Vec3A::from(accumulated.friction_displacement);
        let mut friction_displacement = old;
        if self.friction > 0.0 {
            let slip = self.sum(bodies, Body::moved) - self.surface_velocity * substep;
            friction_displacement = shortened(old - tangential(slip, self.normal), self.friction * depth);
        }
        if takes_back {
            (self.accumulated.depth, self.accumulated.friction_displacement) =
                (depth, friction_displacement.into());
        }
        self.displace(bodies, change, friction_displacement - old, in_round.then_some(substep));
    }
}
