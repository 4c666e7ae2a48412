//! The response of two bodies to an impact: restitution along the normal, and friction.
//!
//! The normal n points from the second body to the first; speeds along it are negative while the
//! bodies approach. A plane is a second body of infinite mass.

use bevy::math::Vec3A;

/// The relative motion along the normal when a contact is found, at the end of a substep.
#[derive(Debug, Clone, Copy)]
pub(super) struct Approach {
    /// Relative velocity along the normal, m/s.
    pub velocity: f32,
    /// Relative acceleration along the normal, m/s².
    pub acceleration: f32,
    /// How deep the bodies overlap, m, >= 0.
    pub depth: f32,
}

/// How impacts rebound in one substep.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rebound {
    /// Coefficient of restitution ε, 0 to 1.
    pub restitution: f32,
    /// The substep h, s.
    pub substep: f32,
    /// Below this speed nothing rebounds, m/s: what gravity gives in a substep.
    pub resting_speed: f32,
    /// Pairs that rest stay in contact over a gap up to this one, m: else the rounding of a pile would
    /// take away its support every other substep. The distance of free fall in a substep; 0 without gravity.
    pub slop: f32,
    /// [`Integrator::velocity_lag`](crate::solver::Integrator::velocity_lag).
    pub velocity_lag: f32,
}

impl Rebound {
    /// The velocity along the normal that a contact must have at least when it is solved.
    pub fn least_velocity_after(&self, approach: Approach) -> f32 {
        if approach.velocity < 0.0 { self.velocity_after(approach) } else { 0.0 }
    }

    /// The velocity along the normal after the contact.
    ///
    /// The rule is v̂ = v − (1 + ε)(v·n) n, that is v·n becomes −ε (v·n), for bodies that approach;
    /// others keep their velocity. In a field of force two things are added to it, both of the order
    /// of a h and gone without acceleration:
    /// - The contact is found when the bodies overlap by `depth` already, so the speed to rebound with
    ///   is that at the surface, u² = v² + 2 a depth. Putting the body back onto the surface with the
    ///   speed it had below would create energy.
    /// - What would rebound for less than a substep rests instead.
    pub fn velocity_after(&self, approach: Approach) -> f32 {
        let Approach { velocity, acceleration, depth } = approach;
        if velocity >= 0.0 {
            return velocity;
        }
        let lag = self.velocity_lag * self.substep * acceleration;
        let speed_squared = (velocity + lag) * (velocity + lag);
        let surface_speed = (speed_squared + 2.0 * acceleration.min(0.0) * depth).max(0.0).sqrt();
        let rebound_speed = self.restitution * surface_speed;
        if rebound_speed <= self.resting_speed.max(-acceleration * self.substep) {
            return 0.0;
        }
        (rebound_speed - lag).max(0.0)
    }
}

/// The relative motion along the normal of what springs pull at, where the acceleration changes within a substep.
#[derive(Debug, Clone, Copy)]
pub(super) struct SprungApproach {
    /// Relative velocity at the end of the substep, m/s.
    pub velocity: f32,
    /// Relative accelerations at its start and at its end, m/s².
    pub accelerations: [f32; 2],
    /// Relative displacement in it, m.
    pub displacement: f32,
    /// How deep the bodies overlap at its end, m, >= 0.
    pub depth: f32,
}

impl Rebound {
    /// The same as [`Self::velocity_after`] for a particle on springs. At the surface the acceleration is interpolated along the displacement,
    /// which is exact for linear springs.
    ///
    /// The velocity before the impact lags by the acceleration at the end, that after it by the one at the surface, and the work of the springs
    /// between the two places is that of their mean. Only so does a leapfrog keep its energy: with the acceleration at the start
    /// alone, a spring that presses a particle onto a plane at hω = 0.5 and ε = 1 multiplied it by 1,000 in 600 steps.
    pub fn velocity_after_on_springs(&self, approach: SprungApproach) -> f32 {
        let SprungApproach { velocity, accelerations: [start, end], displacement, depth } = approach;
        let lag = self.velocity_lag * self.substep;
        if velocity >= 0.0 || velocity + lag * end >= 0.0 {
            // It leaves already.
            return velocity;
        }
        // What has turned round within the substep has hardly moved on the whole.
        let displacement = displacement.min(0.25 * velocity * self.substep);
        let share = (depth / -displacement).min(1.0);
        let surface = end + (start - end) * share;
        let speed_squared = (velocity + lag * end) * (velocity + lag * end);
        let given = (end.min(0.0) + surface.min(0.0)) * depth;
        let rebound_speed = self.restitution * (speed_squared + given).max(0.0).sqrt();
        if rebound_speed <= self.resting_speed.max(-surface * self.substep) {
            return 0.0;
        }
        (rebound_speed - lag * surface).max(0.0)
    }
}

/// The change of a tangential velocity by Coulomb friction: against it, at most `limit`.
///
/// Also used for the tangential displacement of a substep, which static friction undoes.
#[inline]
pub(super) fn friction(tangential: Vec3A, limit: f32) -> Vec3A {
    -shortened(tangential, limit)
}

/// `vector` shortened to the length `limit`, if it is longer. Without a branch: in a pile, what sticks and what
/// slips lie side by side.
#[inline]
pub(super) fn shortened(vector: Vec3A, limit: f32) -> Vec3A {
    // Of NaN (0 / 0) and 1 the smaller is 1.
    vector * (limit / vector.length()).min(1.0)
}

/// The part of `vector` perpendicular to the unit vector `normal`.
#[inline]
pub(super) fn tangential(vector: Vec3A, normal: Vec3A) -> Vec3A {
    vector - normal * vector.dot(normal)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rebound(restitution: f32) -> Rebound {
        Rebound { restitution, substep: 0.01, resting_speed: 0.0, slop: 0.0, velocity_lag: 0.0 }
    }

    fn free(velocity: f32) -> Approach {
        Approach { velocity, acceleration: 0.0, depth: 0.003 }
    }

    #[test]
    fn without_acceleration_the_rule_is_exact() {
        assert_eq!(rebound(0.5).velocity_after(free(-4.0)), 2.0);
        assert_eq!(rebound(1.0).velocity_after(free(-4.0)), 4.0);
        assert_eq!(rebound(0.0).velocity_after(free(-4.0)), 0.0);
    }

    #[test]
    fn a_leaving_body_keeps_its_velocity() {
        assert_eq!(rebound(1.0).velocity_after(free(3.0)), 3.0);
        assert_eq!(rebound(1.0).velocity_after(free(0.0)), 0.0);
    }

    #[test]
    fn the_rebound_starts_with_the_speed_at_the_surface() {
        // Fallen from rest by 1 m + depth with a = −10: u² = v² − 2 · 10 · depth = 20 at the surface.
        let depth = 0.05_f32;
        let approach = Approach { velocity: -(20.0 * (1.0 + depth)).sqrt(), acceleration: -10.0, depth };
        let velocity = rebound(0.5).velocity_after(approach);
        assert!((velocity - 0.5 * 20.0_f32.sqrt()).abs() < 1e-6);
    }

    #[test]
    fn a_body_pressed_onto_the_surface_rests() {
        for velocity_lag in [-0.5, 0.0, 0.5] {
            let rule =
                Rebound { restitution: 1.0, substep: 0.01, resting_speed: 0.0, slop: 0.0, velocity_lag };
            let approach = Approach { velocity: -0.1, acceleration: -10.0, depth: 0.001 };
            assert_eq!(rule.velocity_after(approach), 0.0);
        }
    }

    /// A scheme, ω = 1/s: a particle on a spring at rest at `rest`, above or below the surface, from 1 m with this velocity.
    /// The most energy in 1,000 substeps of `h` seconds, as a part of that at the start.
    fn most_energy(is_exact: bool, h: f32, rest: f32, start: f32) -> f32 {
        let velocity_lag = if is_exact { 0.0 } else { 0.5 };
        let rule = Rebound { substep: h, velocity_lag, ..rebound(1.0) };
        let energy =
            |place: f32, velocity: f32| 0.5 * (velocity * velocity + (place - rest) * (place - rest));
        let (mut place, mut velocity) = (1.0, start);
        let first = energy(place, velocity);
        let mut most = first;
        for _ in 0..1000 {
            let before = place;
            let acceleration = rest - place;
            if is_exact {
                let (sine, cosine) = h.sin_cos();
                (place, velocity) = (
                    rest + (place - rest) * cosine + velocity * sine,
                    velocity * cosine - (place - rest) * sine,
                );
            } else {
                velocity += h * acceleration;
                place += h * velocity;
            }
            if place < 0.0 && velocity < 0.0 {
                let accelerations = [acceleration, rest - place];
                let displacement = place - before;
                let approach = SprungApproach { velocity, accelerations, displacement, depth: -place };
                velocity = velocity.max(rule.velocity_after_on_springs(approach));
            }
            place = place.max(0.0);
            most = most.max(energy(place, velocity));
        }
        most / first
    }

    /// The energy that semi-implicit Euler conserves differs from the one that shows by ±hω/2: (1 + hω/2) / (1 − hω/2) of it at most.
    /// A tenth more for where the impacts are put, which differs from one to the next. What moves exactly keeps its energy but for rounding.
    #[test]
    fn what_springs_press_gains_no_energy() {
        for h in [0.1, 0.3, 0.5, 0.8, 1.0] {
            let limit = 1.1 * (1.0 + 0.5 * h) / (1.0 - 0.5 * h);
            for rest in [-2.0, -0.7, 0.0, 0.3, 1.5] {
                for start in [-3.0, -1.0, 0.5, 2.0] {
                    let most = most_energy(false, h, rest, start);
                    assert!(most < limit, "hω = {h}, rest {rest}, start {start}: {most}");
                    let most = most_energy(true, h, rest, start);
                    assert!(most < 1.0 + 1e-3, "exact, hω = {h}, rest {rest}, start {start}: {most}");
                }
            }
        }
    }

    #[test]
    fn friction_stops_or_opposes() {
        assert_eq!(friction(Vec3A::X * 0.3, 0.4), Vec3A::X * -0.3);
        assert_eq!(friction(Vec3A::X * 4.0, 0.5), Vec3A::X * -0.5);
        assert_eq!(friction(Vec3A::ZERO, 0.0), Vec3A::ZERO);
        assert_eq!(tangential(Vec3A::new(1.0, 2.0, 3.0), Vec3A::Y), Vec3A::new(1.0, 0.0, 3.0));
    }
}
