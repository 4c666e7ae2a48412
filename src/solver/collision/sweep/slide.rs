//! Slides: fast particles of nets, which slide along what they meet.
//!
//! A particle on springs that is put back to where it meets another one loses the rest of its substep, but its springs have accelerated it
//! all the while: energy from nowhere, and without end where they press it against the other one in each substep. So such a pair keeps
//! the plane in which it touches first: what its displacements lead through it is taken back, shared by masses, and the two
//! slide on along each other. Where they part again within the substep, they have had their impact there.
//!
//! What is pushed may meet others in turn, so pairs are searched again, until there are no new ones. What a few iterations leave, as where a
//! light particle is squeezed between heavy ones, is left to the contacts at the end of the substep.

use bevy::math::{Vec3, Vec3A};

use super::{Paths, SWEEP_THRESHOLD, Sweep, TOUCHING_DEPTH, first_touch};
use crate::solver::collision::grid::Grid;
use crate::solver::collision::record::{ContactPartner, ContactRecord};
use crate::solver::collision::response::{Approach, Rebound, friction, tangential};
use crate::solver::graph::Exclusions;
use crate::solver::particles::{Particles, Vectors};
use crate::solver::settings::PairRules;

/// The gap at the start of a substep up to which two particles touch, as a part of the sum of their radii.
const TOUCHING_GAP: f64 = 1e-3;

/// A relative displacement in single precision below this part of the least one that is swept is too short in double precision, too.
const SINGLE_PRECISION_PART: f32 = 0.9;

/// Number of searches at most.
const MAX_SEARCHES: u32 = 4;

/// Number of iterations over the pairs after each search.
const ITERATIONS: usize = 4;

/// What the response of a pair follows from.
#[derive(Clone, Copy)]
pub(in crate::solver::collision) struct Response<'a> {
    pub rules: PairRules,
    pub rebound: Rebound,
    /// Of the last evaluation of the forces, m/s².
    pub acceleration: &'a Vectors,
    pub exclusions: &'a Exclusions,
    /// Whether the particle in each slot stays where an implicit step has put it; empty if none does.
    pub is_implicit: &'a [bool],
}

impl Response<'_> {
    /// Whether an implicit step has put a particle where it is.
    fn is_implicit(&self, slot: usize) -> bool {
        self.is_implicit.get(slot) == Some(&true)
    }

    /// Whether springs move one of the two in an explicit scheme: then they slide.
    pub fn slides(&self, particles: &Particles, slots: [u32; 2]) -> bool {
        slots.into_iter().any(|slot| {
            let slot = slot as usize;
            self.exclusions.is_sprung(slot) && !particles.is_pinned(slot) && !self.is_implicit(slot)
        })
    }

    /// Whether springs pull at both, and they overlap from the start: to part them would stretch the springs.
    fn overlap_from_the_start(&self, particles: &Particles, slide: &Slide) -> bool {
        let reach: f32 = slide.slots.iter().map(|slot| particles.radius()[*slot]).sum();
        let overlap = slide.distance < (1.0 - TOUCHING_GAP as f32) * reach;
        overlap && slide.slots.iter().all(|slot| self.exclusions.is_sprung(*slot))
    }
}

/// A pair that touches within the substep and would pass into each other.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slide {
    /// The smaller first.
    slots: [usize; 2],
    /// From the second to the first when they touch first.
    normal: Vec3A,
    /// The distance along the normal that they keep, m.
    distance: f32,
    /// What the velocity along the normal becomes at least, m/s.
    target_velocity: f32,
    /// The normal impulse, N·s, >= 0.
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
        for search in 1..=MAX_SEARCHES {
            let Self { is_fast, sliding, slides, pairs, common, .. } = self;
            let paths = Paths { particles, previous, common: *common, stops: &[] };
            let known = &sliding[..];
            let may_slide = |a: u32, b: u32| {
                let slots = (a.min(b), a.max(b));
                (is_fast[a as usize] || is_fast[b as usize])
                    && paths
                        .slide(slots.into())
                        .is_some_and(|slide| !response.overlap_from_the_start(particles, &slide))
                    && may_slide(particles, slots.into())
                    && known.binary_search(&slots).is_err()
            };
            paths.find_pairs((&mut *grid, listed), is_fast, &is_swept, may_slide, pairs);
            if pairs.is_empty() {
                break;
            }
            pairs.iter_mut().for_each(|(a, b)| (*a, *b) = (*a.min(b), *a.max(b)));
            pairs.sort_unstable();
            let from = slides.len();
            slides.extend(pairs.iter().filter_map(|(a, b)| paths.slide([*a, *b])));
            slides[from..].iter_mut().for_each(|slide| slide.set_target_velocity(particles, response));
            sliding.extend_from_slice(pairs);
            sliding.sort_unstable();
            for _ in 0..ITERATIONS {
                slides.iter().for_each(|slide| slide.separate(particles, response));
            }
            if search == MAX_SEARCHES || !self.find_fast(particles, previous, &is_swept) {
                break;
            }
        }
        for _ in 0..ITERATIONS {
            for slide in &mut self.slides {
                if slide.has_parted(particles) {
                    slide.correct_velocities(particles, response.rules.friction);
                }
            }
        }
        !self.slides.is_empty()
    }

    /// Calls `visit` with the slots of the particles that have slid along another one in the last substep.
    pub fn for_each_sliding(&self, mut visit: impl FnMut(usize)) {
        self.sliding.iter().for_each(|(a, b)| [a, b].into_iter().for_each(|slot| visit(*slot as usize)));
    }

    /// Appends the contacts of the pairs that have parted again in the last substep.
    pub fn record(&self, particles: &Particles, records: &mut Vec<ContactRecord>) {
        for slide in self.slides.iter().filter(|slide| slide.impulse > 0.0) {
            let ([slot, other], normal) = (slide.slots, Vec3::from(slide.normal));
            records.push(ContactRecord {
                slot,
                other: ContactPartner::Particle(other),
                point: particles.position.get(slot) - normal * particles.radius()[slot],
                normal,
                impulse: slide.impulse,
            });
        }
    }
}

impl Paths<'_> {
    /// How a pair slides, if it touches within the substep and would pass into each other; the smaller slot first.
    fn slide(self, slots: [u32; 2]) -> Option<Slide> {
        let slots = slots.map(|slot| slot as usize);
        // Most pairs move alike, which a look in single precision shows.
        let [displacement, other_displacement] = slots.map(|slot| self.displacement(slot));
        let sweep_threshold = SINGLE_PRECISION_PART
            * SWEEP_THRESHOLD
            * (self.particles.radius()[slots[0]] + self.particles.radius()[slots[1]]);
        if displacement.distance_squared(other_displacement) < sweep_threshold * sweep_threshold {
            return None;
        }
        let [(start, displacement), (other_start, other_displacement)] = slots.map(|slot| {
            let start = self.previous.get(slot).as_dvec3();
            (start, self.particles.position.get(slot).as_dvec3() - start)
        });
        let reach: f64 = slots.iter().map(|slot| f64::from(self.particles.radius()[*slot])).sum();
        let (separation, change) = (start - other_start, displacement - other_displacement);
        let first_distance = separation.length();
        let depth = TOUCHING_DEPTH * reach;
        let touches = first_distance < (1.0 + TOUCHING_GAP) * reach;
        let time = if touches {
            let sweep_threshold = f64::from(SWEEP_THRESHOLD) * reach;
            let is_fast = change.length_squared() > sweep_threshold * sweep_threshold;
            let approaches = separation.dot(change) < 0.0;
            (is_fast && approaches && first_distance > 0.0).then_some(0.0)
        } else {
            first_touch(separation, change, 1.0, reach, depth)
        };
        let normal = (separation + time? * change).normalize();
        let distance = (reach - depth).min(first_distance);
        Some(Slide {
            slots,
            normal: normal.as_vec3a(),
            distance: distance as f32,
            target_velocity: 0.0,
            impulse: 0.0,
        })
    }
}

impl Slide {
    /// The difference of a vector of the two.
    fn relative(&self, vectors: &Vectors) -> Vec3A {
        let [one, other] = self.slots.map(|slot| Vec3A::from(vectors.get(slot)));
        one - other
    }

    fn set_target_velocity(&mut self, particles: &Particles, response: Response) {
        let velocity = self.relative(&particles.velocity).dot(self.normal);
        let acceleration = self.relative(response.acceleration).dot(self.normal);
        let approach = Approach { velocity, acceleration, depth: 0.0 };
        self.target_velocity = response.rebound.least_velocity_after(approach);
    }

    /// Takes back what has led the two through the plane in which they touched.
    fn separate(&self, particles: &mut Particles, response: Response) {
        let depth = self.distance - self.relative(&particles.position).dot(self.normal);
        let inverse_masses = self
            .slots
            .map(|slot| if response.is_implicit(slot) { 0.0 } else { particles.inverse_mass()[slot] });
        let sum = inverse_masses[0] + inverse_masses[1];
        if depth > 0.0 && sum > 0.0 {
            self.apply(&mut particles.position, self.normal * (depth / sum), inverse_masses);
        }
    }

    /// Whether the two are apart at the end of the substep.
    fn has_parted(&self, particles: &Particles) -> bool {
        let reach: f32 = self.slots.iter().map(|slot| particles.radius()[*slot]).sum();
        self.relative(&particles.position).length_squared() > reach * reach
    }

    /// Gives the two the impulse of their contact, with friction.
    fn correct_velocities(&mut self, particles: &mut Particles, coefficient: f32) {
        let inverse_masses = self.slots.map(|slot| particles.inverse_mass()[slot]);
        let reduced_mass = 1.0 / (inverse_masses[0] + inverse_masses[1]);
        let velocity = self.relative(&particles.velocity);
        let missing = self.target_velocity - velocity.dot(self.normal);
        let change = (self.impulse + missing * reduced_mass).max(0.0) - self.impulse;
        self.impulse += change;
        let mut impulse = self.normal * change;
        if change > 0.0 {
            impulse += friction(tangential(velocity, self.normal) * reduced_mass, coefficient * change);
        }
        self.apply(&mut particles.velocity, impulse, inverse_masses);
    }

    /// Adds `change` times their inverse mass to a vector of the first, and takes it from that of the second.
    fn apply(&self, vectors: &mut Vectors, change: Vec3A, inverse_masses: [f32; 2]) {
        let signed = [inverse_masses[0], -inverse_masses[1]];
        for (slot, inverse_mass) in self.slots.into_iter().zip(signed) {
            vectors.set(slot, (Vec3A::from(vectors.get(slot)) + change * inverse_mass).into());
        }
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::Vec3;

    use super::*;

    /// How deep they are put into each other, m.
    const DEPTH: f32 = 2e-5;

    /// A particle of 3 kg that moves by `displacement`, at this velocity in m/s, and touches one of 1 kg that stands still; where both are
    /// afterwards, and how fast.
    fn slide(displacement: Vec3, rules: PairRules) -> [[Vec3; 2]; 2] {
        let (mut particles, mut previous) = (Particles::default(), Vectors::default());
        for (start, displacement, mass) in
            [(Vec3::ZERO, displacement, 3.0_f32), (Vec3::X * 0.2, Vec3::ZERO, 1.0)]
        {
            particles.push(start + displacement, displacement, 1.0 / mass, 0.1);
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
        let exclusions = &Exclusions::default();
        let response = Response { rules, rebound, acceleration: &acceleration, exclusions, is_implicit: &[] };
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
            assert!((is - should_be).length() < 1.1 * DEPTH, "{is} instead of {should_be}");
        }
    }

    /// It rebounds with ε = 1, and the impulse J = 2 m v of the reduced mass of 0.75 kg lets friction give μ J.
    #[test]
    fn it_rebounds_and_rubs() {
        let rules = PairRules { restitution: 1.0, friction: 0.1 };
        let [places, velocities] = slide(Vec3::new(0.4, 0.3, 0.0), rules);
        assert!((places[1].x - places[0].x - 0.2).abs() < 1.1 * DEPTH, "no approach is left: {places:?}");
        let impulse = Vec3::new(0.6, 0.06, 0.0);
        let expected = [Vec3::new(0.4, 0.3, 0.0) - impulse / 3.0, impulse];
        for (is, should_be) in velocities.into_iter().zip(expected) {
            assert!((is - should_be).length() < 1e-6, "{is} instead of {should_be}");
        }
    }

    #[test]
    fn what_is_slow_or_parts_or_is_apart_is_left_alone() {
        let rules = PairRules { restitution: 0.0, friction: 0.0 };
        for displacement in [Vec3::X * 0.09, Vec3::new(-0.4, 0.3, 0.0), Vec3::Y * 0.4] {
            assert_eq!(slide(displacement, rules)[0], [displacement, Vec3::X * 0.2]);
        }
    }
}
