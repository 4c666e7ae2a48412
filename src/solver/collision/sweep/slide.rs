//! Slides: particles on springs that touch another particle when a substep begins.
//!
//! If a particle that its springs press against another one were put back to where it touches, it would stay there while they accelerate
//! it, substep after substep: energy from nowhere. So the two lose the approach of their displacements, and that of their velocities, along the
//! normal at the start of the substep, and slide on along each other. What a few iterations leave of it, as where a light particle is
//! squeezed between heavy ones, is left to the contacts at the end of the substep.

use bevy::math::Vec3A;

use super::{Paths, SWEPT_WAY, Sweep};
use crate::solver::collision::grid::Grid;
use crate::solver::collision::response::{Approach, Rebound, friction, tangential};
use crate::solver::particles::{Particles, Vectors};
use crate::solver::settings::PairRules;

/// The gap at the start of a substep up to which two particles touch, as a part of the sum of their radii.
const TOUCHING_GAP: f32 = 1e-3;

/// Number of iterations over the pairs.
const ITERATIONS: usize = 4;

/// What the response of a pair follows from.
#[derive(Clone, Copy)]
pub(in crate::solver::collision) struct Response<'a> {
    pub rules: PairRules,
    pub rebound: Rebound,
    /// Of the last evaluation of the forces, m/s².
    pub acceleration: &'a Vectors,
}

/// A pair that touches when the substep begins, and would pass into each other.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slide {
    slots: [usize; 2],
    inverse_masses: [f32; 2],
    /// From the second to the first at the start of the substep.
    normal: Vec3A,
    /// The gap at the start, m, >= 0.
    gap: f32,
    /// What the velocity along the normal becomes at least, m/s.
    target_velocity: f32,
    /// The normal impulse so far, N·s.
    impulse: f32,
}

impl Sweep {
    /// Makes the pairs that touch since `previous`, the positions at the start of the substep in m, slide along each other; only
    /// particles that are swept, and pairs that `may_slide`. To be called after [`Self::find_fast`]; whether there are any.
    pub fn slide(
        &mut self,
        (grid, listed): (&mut Grid, Option<&[(u32, u32)]>),
        particles: &mut Particles,
        previous: &Vectors,
        is_swept: impl Fn(usize) -> bool,
        may_slide: impl Fn(&Particles, [u32; 2]) -> bool + Sync,
        response: Response,
    ) -> bool {
        let Self { is_fast, sliding, slides: all, common, .. } = self;
        let paths = Paths { particles, previous, common: *common, stops: &[] };
        let slides = |a: u32, b: u32| {
            let any_fast = is_fast[a as usize] || is_fast[b as usize];
            let slots = [a.min(b), a.max(b)];
            any_fast && paths.slide(slots).is_some() && may_slide(particles, slots)
        };
        if let Some(listed) = listed {
            sliding.clear();
            sliding.extend(listed.iter().filter(|(a, b)| slides(*a, *b)));
        } else {
            paths.find_pairs(grid, is_fast, &is_swept, slides, sliding);
        }
        sliding.iter_mut().for_each(|(a, b)| (*a, *b) = (*a.min(b), *a.max(b)));
        sliding.sort_unstable();
        all.clear();
        all.extend(sliding.iter().filter_map(|(a, b)| paths.slide([*a, *b])));
        for slide in &mut *all {
            slide.set_target_velocity(particles, response);
        }
        for _ in 0..ITERATIONS {
            for slide in &mut *all {
                slide.correct(particles, previous, response.rules.friction);
            }
        }
        !all.is_empty()
    }
}

impl Paths<'_> {
    /// How a pair slides, if it touches at the start and would pass into each other.
    fn slide(self, slots: [u32; 2]) -> Option<Slide> {
        let slots = slots.map(|slot| slot as usize);
        let [one, other] = slots;
        let reach = self.particles.radius()[one] + self.particles.radius()[other];
        let way = Vec3A::from(self.way(one) - self.way(other));
        let separation = Vec3A::from(self.previous.get(one) - self.previous.get(other));
        let distance = separation.length();
        let swept_way = SWEPT_WAY * reach;
        let touches = distance > 0.0 && distance < (1.0 + TOUCHING_GAP) * reach;
        if !(touches && way.length_squared() > swept_way * swept_way && separation.dot(way) < 0.0) {
            return None;
        }
        let inverse_masses = slots.map(|slot| self.particles.inverse_mass()[slot]);
        let gap = (distance - reach).max(0.0);
        Some(Slide {
            slots,
            inverse_masses,
            normal: separation / distance,
            gap,
            target_velocity: 0.0,
            impulse: 0.0,
        })
    }
}

impl Slide {
    /// The relative velocity, m/s.
    fn velocity(&self, particles: &Particles) -> Vec3A {
        let [one, other] = self.slots.map(|slot| Vec3A::from(particles.velocity.get(slot)));
        one - other
    }

    fn set_target_velocity(&mut self, particles: &Particles, response: Response) {
        let [one, other] = self.slots.map(|slot| Vec3A::from(response.acceleration.get(slot)));
        let velocity = self.velocity(particles).dot(self.normal);
        let acceleration = (one - other).dot(self.normal);
        let approach = Approach { velocity, acceleration, depth: 0.0 };
        self.target_velocity = response.rebound.least_velocity_after(approach);
    }

    /// Takes back the approach of the displacements since `previous`, and corrects the velocities.
    fn correct(&mut self, particles: &mut Particles, previous: &Vectors, coefficient: f32) {
        let Self { slots: [one, other], inverse_masses: [first, second], normal, gap, .. } = *self;
        let reduced_mass = 1.0 / (first + second);
        let moved = |slot: usize| Vec3A::from(particles.position.get(slot) - previous.get(slot));
        let approached = -(moved(one) - moved(other)).dot(normal) - gap;
        let displacement = normal * (approached.max(0.0) * reduced_mass);
        let velocity = self.velocity(particles);
        let missing = self.target_velocity - velocity.dot(normal);
        let impulse = (self.impulse + missing * reduced_mass).max(0.0) - self.impulse;
        self.impulse += impulse;
        let mut change = normal * impulse;
        if impulse > 0.0 {
            change += friction(tangential(velocity, normal) * reduced_mass, coefficient * impulse);
        }
        for (slot, inverse_mass) in [(one, first), (other, -second)] {
            let vectors = [(&mut particles.position, displacement), (&mut particles.velocity, change)];
            for (vector, correction) in vectors {
                vector.set(slot, (Vec3A::from(vector.get(slot)) + correction * inverse_mass).into());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::Vec3;

    use super::*;

    /// A particle of 3 kg that moves by `way`, at this velocity in m/s, and touches one of 1 kg that stands still; where both are
    /// afterwards and how fast, and what they were.
    fn slide(way: Vec3, rules: PairRules) -> [[Vec3; 2]; 2] {
        let (mut particles, mut previous) = (Particles::default(), Vectors::default());
        for (start, way, mass) in [(Vec3::ZERO, way, 3.0_f32), (Vec3::X * 0.2, Vec3::ZERO, 1.0)] {
            particles.push(start + way, way, 1.0 / mass, 0.1);
            previous.push(start);
        }
        let mut acceleration = Vectors::default();
        (0..2).for_each(|_| acceleration.push(Vec3::ZERO));
        let rebound = Rebound {
            restitution: rules.restitution,
            substep: 1.0,
            resting_speed: 0.0,
            slop: 0.0,
            velocity_lag: 0.0,
        };
        let (mut sweep, around) = (Sweep::default(), (&mut Grid::default(), None));
        sweep.find_fast(&particles, &previous, |_| true);
        let response = Response { rules, rebound, acceleration: &acceleration };
        sweep.slide(around, &mut particles, &previous, |_| true, |_, _| true, response);
        let of = |vectors: &Vectors| [0, 1].map(|slot| vectors.get(slot));
        [of(&particles.position), of(&particles.velocity)]
    }

    /// They share what they approach by, by their masses: 3/4 of it is the displacement and the velocity of both.
    #[test]
    fn a_pair_that_touches_slides_along_each_other() {
        let rules = PairRules { restitution: 0.0, friction: 0.0 };
        let [places, velocities] = slide(Vec3::new(0.4, 0.3, 0.0), rules);
        let expected = [Vec3::new(0.3, 0.3, 0.0), Vec3::new(0.3, 0.0, 0.0)];
        let errors = [(places[0], expected[0]), (places[1] - Vec3::X * 0.2, expected[1])];
        for (is, should_be) in errors.into_iter().chain(velocities.into_iter().zip(expected)) {
            assert!((is - should_be).length() < 1e-6, "{is} instead of {should_be}");
        }
    }

    /// It rebounds with ε = 1, and the impulse J = 2 m v of the reduced mass of 0.75 kg lets friction give μ J.
    #[test]
    fn it_rebounds_and_rubs() {
        let rules = PairRules { restitution: 1.0, friction: 0.1 };
        let [places, velocities] = slide(Vec3::new(0.4, 0.3, 0.0), rules);
        assert!((places[1].x - places[0].x - 0.2).abs() < 1e-6, "no approach is left: {places:?}");
        let impulse = Vec3::new(0.6, 0.06, 0.0);
        let expected = [Vec3::new(0.4, 0.3, 0.0) - impulse / 3.0, impulse];
        for (is, should_be) in velocities.into_iter().zip(expected) {
            assert!((is - should_be).length() < 1e-6, "{is} instead of {should_be}");
        }
    }

    #[test]
    fn what_is_slow_or_parts_or_is_apart_is_left_alone() {
        let rules = PairRules { restitution: 0.0, friction: 0.0 };
        for way in [Vec3::X * 0.09, Vec3::new(-0.4, 0.3, 0.0), Vec3::Y * 0.4] {
            assert_eq!(slide(way, rules)[0], [way, Vec3::X * 0.2]);
        }
    }
}
