//! The tensions of nets that are at rest, as exactly as their loads.
//!
//! The positions of a stiff net say little about its tensions: at 1e6 N/m one ulp of a coordinate of 3 m is 0.24 N. What
//! rests is where forces balance, but for rounding. So the displacements δ are looked for that would balance them,
//!
//! ```text
//! K δ = f(x)      with K = Σ k c cᵀ ⊗ (n nᵀ + max(0, 1 − r/‖s‖) (1 − n nᵀ)),  n = s/‖s‖
//! ```
//!
//! by conjugate gradients. For a net that nothing holds, f is without the force that accelerates the net as a whole. Where the δ
//! change ‖s‖ by no more than rounding does, the tension is k (‖s‖ − r + n · Σ cᵢ δᵢ). The net moves, and its tensions are left
//! alone, where they change ‖s‖ by more; where the forces on an end, with those of dampers, exceed what rounding makes of them;
//! and where the ends turn about each other so fast that a part of the tension is centripetal. (Where a particle is too slow to
//! get to the next f32, a damper may bear a part of the load.)

use bevy::math::DVec3;

use super::{Elements, MAX_ENDS};
use crate::solver::particles::Particles;

/// Iterations of conjugate gradients, at most. What rounding does differs from particle to particle, and such errors go first.
const MAX_ITERATIONS: usize = 60;

/// The square of the part of the forces that may be left.
const TOLERANCE: f64 = 1e-14;

/// By how many ulp of the largest coordinate of its net the length of an element of a net at rest may differ: by one or two for
/// rounding, more where that makes the net vibrate.
pub(in crate::solver) const MAX_ULPS: f64 = 8.0;

/// The part of a tension that may bend the paths of the ends of an element of a net at rest, which vibrates at most.
const MAX_CENTRIPETAL: f64 = 1e-2;

/// A direction along which the stiffness is less than this part of that of the elements is one of a rigid motion.
const NO_CURVATURE: f64 = 1e-12;

/// Working memory.
#[derive(Debug, Clone, Default)]
pub(in crate::solver) struct Balance {
    links: Vec<Link>,
    is_free: Vec<bool>,
    /// Σ c² k of the elements at each particle, N/m.
    diagonal: Vec<f64>,
    residual: Vec<DVec3>,
    /// Mass times acceleration, N.
    inertia: Vec<DVec3>,
    displacement: Vec<DVec3>,
    direction: Vec<DVec3>,
    image: Vec<DVec3>,
    gradient: Vec<DVec3>,
    /// Of what hangs together each slot leads to another one, the last of them to itself.
    parent: Vec<u32>,
    /// By that last slot, of what nothing holds: force and mass, N and kg.
    fall: Vec<(DVec3, f64)>,
    /// By that last slot: the largest coordinate, m.
    reach: Vec<f32>,
}

/// An element that is taut or pushes.
#[derive(Debug, Clone, Copy)]
struct Link {
    number: u32,
    count: usize,
    ends: [u32; MAX_ENDS],
    weights: [f64; MAX_ENDS],
    /// k, N/m.
    stiffness: f64,
    /// k max(0, 1 − r/‖s‖), N/m.
    across: f64,
    along: DVec3,
    /// ‖s‖, m.
    length: f64,
    /// k (‖s‖ − r), N.
    tension: f64,
    /// c d‖s‖/dt, N.
    damping: f64,
    /// m ‖ds/dt‖² / ‖s‖ with 1/m = Σ c²/mᵢ, N.
    centripetal: f64,
}

impl Link {
    /// Its ends, each with its weight.
    fn ends(&self) -> impl Iterator<Item = (usize, f64)> + Clone + '_ {
        self.ends[..self.count].iter().map(|end| *end as usize).zip(self.weights)
    }

    /// Σ cᵢ vᵢ.
    fn combine(&self, values: &[DVec3]) -> DVec3 {
        self.ends().map(|(end, weight)| values[end] * weight).sum()
    }
}

impl Balance {
    /// Writes the tensions of the elements that are at rest, N, by their numbers.
    ///
    /// `load` is the force on the particle in a slot apart from elements and gases, N; `is_held` says of which it is not known, as
    /// it touches something.
    pub fn write_tensions(
        &mut self,
        elements: &Elements,
        particles: &Particles,
        load: impl Fn(usize) -> DVec3,
        is_held: &[bool],
        tensions: &mut [f64],
    ) {
        self.begin(elements, particles, load, is_held);
        self.solve();
        for link in &self.links {
            let net = find(&mut self.parent, link.ends[0] as usize);
            let limit = MAX_ULPS * f64::from(f32::EPSILON * self.reach[net]);
            let moved = link.combine(&self.displacement);
            let change = link.along.dot(moved);
            // Across it the length changes in second order.
            let neglected =
                if link.length > 0.0 { moved.length_squared() / (2.0 * link.length) } else { 0.0 };
            let is_at_rest = |(end, _): (usize, f64)| {
                !self.is_free[end] || self.inertia[end].length() <= limit * self.diagonal[end]
            };
            let is_bounded = (change.abs() + neglected - limit) * link.stiffness <= link.damping.abs();
            let tension = link.tension + link.stiffness * change;
            // What rounding makes vibrate has up to k times the square of that.
            let vibrating =
                if link.length > 0.0 { link.stiffness * limit * limit / link.length } else { 0.0 };
            let is_straight = link.centripetal <= vibrating.max(MAX_CENTRIPETAL * tension.abs());
            if is_bounded && is_straight && link.ends().all(is_at_rest) {
                tensions[link.number as usize] = tension;
            }
        }
    }

    /// Collects the elements, and the force on each free particle.
    fn begin(
        &mut self,
        elements: &Elements,
        particles: &Particles,
        load: impl Fn(usize) -> DVec3,
        is_held: &[bool],
    ) {
        let Self { links, is_free, diagonal, residual, displacement, gradient, .. } = self;
        let count = particles.len();
        links.clear();
        is_free.clear();
        is_free.extend((0..count).map(|slot| particles.is_movable(slot) && is_held.get(slot) != Some(&true)));
        diagonal.clear();
        diagonal.resize(count, 0.0);
        displacement.clear();
        displacement.resize(count, DVec3::ZERO);
        residual.clear();
        residual.extend((0..count).map(|slot| if is_free[slot] { load(slot) } else { DVec3::ZERO }));
        for (_, enclosure) in elements.gases().acting() {
            let at = |place: usize| particles.position.get(enclosure.slots[place] as usize).as_dvec3();
            let pressure = enclosure.gas.pressure_at(enclosure.measure(at, gradient));
            for (slot, gradient) in enclosure.slots.iter().zip(&*gradient) {
                residual[*slot as usize] += pressure * *gradient;
            }
        }
        elements.for_each_acting(|acting| {
            let (rates, rest_length, tension_only) = elements.coefficients(acting.number);
            let mut link = Link {
                number: acting.number,
                count: acting.ends.len(),
                ends: [0; MAX_ENDS],
                weights: [0.0; MAX_ENDS],
                stiffness: rates.stiffness.into(),
                across: 0.0,
                along: DVec3::ZERO,
                length: 0.0,
                tension: 0.0,
                damping: 0.0,
                centripetal: 0.0,
            };
            link.ends[..link.count].copy_from_slice(acting.ends);
            for (to, from) in link.weights.iter_mut().zip(acting.weights) {
                *to = (*from).into();
            }
            let [separation, rate]: [DVec3; 2] = [&particles.position, &particles.velocity]
                .map(|vectors| link.ends().map(|(end, weight)| vectors.get(end).as_dvec3() * weight).sum());
            let length = separation.length();
            if tension_only && length < rest_length || link.stiffness == 0.0 {
                return;
            }
            (link.along, link.length) = (separation.normalize_or_zero(), length);
            link.damping = f64::from(rates.damping) * rate.dot(link.along);
            link.tension = link.stiffness * (length - rest_length);
            link.across = if length > 0.0 { link.tension.max(0.0) / length } else { link.stiffness };
            let inverse_mass = |end: usize| f64::from(particles.inverse_mass()[end]);
            let lightness: f64 = link.ends().map(|(end, weight)| weight * weight * inverse_mass(end)).sum();
            if lightness > 0.0 && length > 0.0 {
                link.centripetal =
                    rate.reject_from_normalized(link.along).length_squared() / (lightness * length);
            }
            for (end, weight) in link.ends() {
                diagonal[end] += weight * weight * link.stiffness;
                residual[end] -= link.along * (link.tension * weight);
            }
            links.push(link);
        });
        self.let_fall(particles);
        let Self { links, is_free, diagonal, residual, inertia, .. } = self;
        inertia.clone_from(residual);
        for link in &*links {
            link.ends().for_each(|(end, weight)| inertia[end] -= link.along * (link.damping * weight));
        }
        for (slot, is_free) in is_free.iter().enumerate() {
            if !is_free || diagonal[slot] == 0.0 {
                residual[slot] = DVec3::ZERO;
            }
        }
    }

    /// Finds what hangs together; takes the force that accelerates it as a whole off what is not held.
    fn let_fall(&mut self, particles: &Particles) {
        let Self { links, is_free, residual, parent, fall, reach, .. } = self;
        parent.clear();
        parent.extend(0..is_free.len() as u32);
        for link in &*links {
            let last = link.ends().map(|(end, _)| find(parent, end)).min();
            for (end, _) in link.ends() {
                let other = find(parent, end);
                parent[other] = last.unwrap_or(other) as u32;
            }
        }
        fall.clear();
        fall.resize(is_free.len(), (DVec3::ZERO, 0.0));
        reach.clear();
        reach.resize(is_free.len(), 0.0);
        for (slot, is_free) in is_free.iter().enumerate() {
            let net = find(parent, slot);
            reach[net] = reach[net].max(particles.position.get(slot).abs().max_element());
            let (force, mass) = &mut fall[net];
            *force += residual[slot];
            // What is held weighs infinitely much.
            *mass += if *is_free { 1.0 / f64::from(particles.inverse_mass()[slot]) } else { f64::INFINITY };
        }
        for (slot, residual) in residual.iter_mut().enumerate().filter(|(slot, _)| is_free[*slot]) {
            let (force, mass) = fall[find(parent, slot)];
            *residual -= force * (1.0 / (mass * f64::from(particles.inverse_mass()[slot])));
        }
    }

    /// Conjugate gradients, preconditioned by the diagonal.
    fn solve(&mut self) {
        let Self { links, is_free, diagonal, residual, displacement, direction, image, .. } = self;
        let conditioned = |slot: usize, force: DVec3| match diagonal[slot] > 0.0 {
            true => force / diagonal[slot],
            false => DVec3::ZERO,
        };
        direction.clear();
        direction.extend(residual.iter().enumerate().map(|(slot, force)| conditioned(slot, *force)));
        let measure = |residual: &[DVec3]| -> f64 {
            residual.iter().enumerate().map(|(slot, force)| force.dot(conditioned(slot, *force))).sum()
        };
        let start = measure(residual);
        let mut left = start;
        for _ in 0..MAX_ITERATIONS {
            if left.is_nan() || left <= TOLERANCE * start {
                return;
            }
            image.clear();
            image.resize(direction.len(), DVec3::ZERO);
            for link in &*links {
                let moved = link.combine(direction);
                let along = link.along * link.along.dot(moved);
                let force = along * link.stiffness + (moved - along) * link.across;
                link.ends().for_each(|(end, weight)| image[end] += force * weight);
            }
            for (image, _) in image.iter_mut().zip(&*is_free).filter(|(_, is_free)| !**is_free) {
                *image = DVec3::ZERO;
            }
            let curvature: f64 = direction.iter().zip(&*image).map(|(one, other)| one.dot(*other)).sum();
            let largest: f64 =
                direction.iter().zip(&*diagonal).map(|(one, k)| one.length_squared() * k).sum();
            // Nothing holds the net: it falls.
            if curvature.is_nan() || curvature <= NO_CURVATURE * largest {
                return;
            }
            let step = left / curvature;
            for (slot, image) in image.iter().enumerate() {
                displacement[slot] += direction[slot] * step;
                residual[slot] -= *image * step;
            }
            let next = measure(residual);
            for (slot, direction) in direction.iter_mut().enumerate() {
                *direction = conditioned(slot, residual[slot]) + *direction * (next / left);
            }
            left = next;
        }
    }
}

/// The last slot to which `slot` leads; halves the way there.
fn find(parent: &mut [u32], mut slot: usize) -> usize {
    while parent[slot] as usize != slot {
        parent[slot] = parent[parent[slot] as usize];
        slot = parent[slot] as usize;
    }
    slot
}
