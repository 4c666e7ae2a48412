//! A step of backward Euler that ends with more energy than it began with.
//!
//! A converged step dissipates: E' <= E for a convex potential. A step that has not converged may gain energy, as where a sheet on a
//! curved collider has more contacts than Newton's method finds in its iterations, and the rebound, which is one linear solution from
//! there, may gain many times the energy before. Then the rebound is left out. Where the elements alone have more energy than before, the
//! step is shortened; the remaining excess is taken from the motion relative to the centre of mass, so that momentum is kept. What edges and
//! faces gain as they are pushed out of an overlap is no excess: else what has got into one at rest would stay there.

use bevy::math::{DVec3, Vec3};

use super::contact::Partner;
use super::tr_bdf2::{Context, Motion};
use super::{Island, Step, write};
use crate::solver::particles::{Particles, Vectors};

/// How much energy a step may gain, as a part of the kinetic energy: what is left of an error of the solution.
pub(super) const MAX_GAIN: f64 = 1e-3;

/// Below this part of it a step is left out.
pub(super) const MIN_PART: f64 = 1e-3;

impl Island {
    /// Whether a solution of the step is known to have no more energy than there was before: it touches nothing, encloses no gas, and
    /// no element is pressed together.
    ///
    /// With the tension T' of each element and its damper at the end, and the direction d' there, a solution has
    /// m (v' − v) = −h Σ T' d', so that
    ///
    /// E' − E = −Σ ½ m ‖v' − v‖² + Σ (V' − V − T' d' · (s' − s))
    ///
    /// d' · s is at most the length l = ‖s‖ before. So the last product is at least T' (l' − l) where T' >= 0, and
    /// V' − V − T' (l' − l) = −½ k (l' − l)² − (c/h) (l' − l)² <= 0. Of a cable that is slack before
    /// or after it is at most 0, too.
    pub(super) fn dissipates(&self) -> bool {
        let Self { elimination, system, .. } = self;
        !system.contacts.any() && elimination.gases.is_empty() && !system.any_pressed(elimination)
    }

    /// Whether nothing that moves by itself has done work on it: no pinned particle of it and nothing that holds it moves.
    pub(super) fn is_left_alone(&self, particles: &Particles) -> bool {
        let rests = |slot: usize| particles.velocity.get(slot) == Vec3::ZERO;
        let pinned = &self.elimination.slots[self.elimination.free..];
        let is_at_rest = |contact: &super::contact::Contact| match &contact.partner {
            Partner::Obstacle(obstacle) => {
                let point = contact.point(&self.system.start);
                obstacle.motion_at(point) == DVec3::ZERO && obstacle.sliding() == DVec3::ZERO
            }
            Partner::Node { .. } => true,
            Partner::Surface { .. } => contact.outer_part() == 0.0,
        };
        let mut held = self.system.contacts.contacts.iter().filter(|contact| contact.force > 0.0);
        pinned.iter().all(|slot| rests(*slot as usize)) && held.all(is_at_rest)
    }

    /// The energy at the start of the step, and what it may end with; to be called before it is written back.
    pub(super) fn energy_before(&self, step: Step, particles: &Particles) -> [f64; 2] {
        let motion = |node: usize| {
            let velocity = particles.velocity.get(self.elimination.slots[node] as usize).as_dvec3();
            Motion { position: self.system.start[node], velocity }
        };
        self.energy(step, particles, motion)
    }

    fn energy(&self, step: Step, particles: &Particles, motion: impl Fn(usize) -> Motion) -> [f64; 2] {
        let Self { elimination, system, .. } = self;
        let [kinetic, potential] = energy(step.context(elimination), particles, &motion);
        let of_gases = system.gases.energy(elimination, |node| motion(node).position);
        [kinetic, potential + of_gases]
    }

    /// The velocities at the start of the step, m/s.
    pub(super) fn start_velocities(&self, particles: &Particles) -> Vec<Vec3> {
        self.slots().map(|slot| particles.velocity.get(slot)).collect()
    }

    /// Writes back the motion without its rebound; it began with the velocities `start`.
    pub(super) fn finish_without_rebound(
        &self,
        particles: &mut Particles,
        acceleration: &mut Vectors,
        (start, h): (&[Vec3], f64),
    ) {
        for (node, (slot, start)) in self.slots().zip(start).enumerate() {
            let position = self.system.position[node];
            particles.velocity.set(slot, *start);
            write(particles, acceleration, slot, [position, (position - self.system.start[node]) / h], h);
        }
    }

    /// Whether the present motion has more energy than there was `before`; how much there may be, J.
    pub(super) fn excess(&self, step: Step, particles: &Particles, before: [f64; 2]) -> Option<f64> {
        let motion = |node: usize| {
            let slot = self.elimination.slots[node] as usize;
            Motion { position: self.system.position[node], velocity: particles.velocity.get(slot).as_dvec3() }
        };
        let [kinetic, potential] = self.energy(step, particles, motion);
        let [old_kinetic, old_potential] = before;
        let allowed = old_kinetic + old_potential + MAX_GAIN * old_kinetic;
        // `None` for NaN.
        (kinetic + potential > allowed).then_some(allowed)
    }

    /// Takes what is more than the energy `allowed`, J, from a step that has been written back: goes back along it to where
    /// elements have no more than that, and slows the motion down.
    pub(super) fn shed(
        &mut self,
        step: Step,
        particles: &mut Particles,
        acceleration: &mut Vectors,
        allowed: f64,
    ) {
        let velocity = |particles: &Particles, node: usize| {
            particles.velocity.get(self.elimination.slots[node] as usize).as_dvec3()
        };
        let potential_at = |position: &[DVec3], particles: &Particles| {
            let motion =
                |node: usize| Motion { position: position[node], velocity: velocity(particles, node) };
            self.energy(step, particles, motion)[1]
        };
        // What nothing holds keeps the motion of its centre of mass.
        let is_held = self.elimination.is_anchored() || self.system.contacts.are_held_from_outside();
        let own = if is_held { 0.0 } else { self.own_energy(particles) };
        let allowed_potential = (allowed - own).max(0.0);
        let mut position = self.system.position.clone();
        let mut potential = potential_at(&position, particles);
        let (mut part, free) = (1.0, 0..self.elimination.free);
        while potential > allowed_potential && part > 0.0 {
            part = if part > MIN_PART { 0.5 * part } else { 0.0 };
            for node in free.clone() {
                position[node] = self.system.start[node].lerp(self.system.position[node], part);
            }
            potential = potential_at(&position, particles);
        }
        if part < 1.0 {
            self.system.position = position;
            for node in free {
                let slot = self.elimination.slots[node] as usize;
                particles.position.set(slot, self.system.position[node].as_vec3());
            }
        }
        self.slow_down((allowed - potential).max(0.0), particles, acceleration, step.h);
    }

    /// The momentum, kg·m/s, and the mass, kg.
    fn momentum(&self, particles: &Particles) -> (DVec3, f64) {
        self.slots().fold((DVec3::ZERO, 0.0), |(momentum, total), slot| {
            let mass = 1.0 / f64::from(particles.inverse_mass()[slot]);
            (momentum + mass * particles.velocity.get(slot).as_dvec3(), total + mass)
        })
    }

    /// The kinetic energy of the motion of its centre of mass, J.
    fn own_energy(&self, particles: &Particles) -> f64 {
        let (momentum, mass) = self.momentum(particles);
        0.5 * momentum.length_squared() / mass
    }

    /// Slows it down to a kinetic energy of `allowed` J, and not its centre of mass.
    pub(super) fn slow_down(
        &self,
        allowed: f64,
        particles: &mut Particles,
        acceleration: &mut Vectors,
        h: f64,
    ) {
        let slots = || self.slots();
        let mass = |particles: &Particles, slot: usize| 1.0 / f64::from(particles.inverse_mass()[slot]);
        let (momentum, total) = self.momentum(particles);
        let centre = momentum / total;
        let relative: f64 = slots()
            .map(|slot| {
                let velocity = particles.velocity.get(slot).as_dvec3() - centre;
                0.5 * mass(particles, slot) * velocity.length_squared()
            })
            .sum();
        let own = 0.5 * total * centre.length_squared();
        let part = ((allowed - own) / relative).max(0.0).sqrt();
        // What has the centre of mass too fast has been thrown by what it touches.
        let centre = if own > allowed { centre * (allowed / own).sqrt() } else { centre };
        if !part.is_finite() || !centre.is_finite() {
            return;
        }
        for slot in slots() {
            let old = particles.velocity.get(slot).as_dvec3();
            let velocity = centre + part * (old - momentum / total);
            particles.velocity.set(slot, velocity.as_vec3());
            let change = (velocity - old) / h;
            acceleration.set(slot, acceleration.get(slot) + change.as_vec3());
        }
    }
}

/// Kinetic energy, and that of elements, gravity, the push of the air and applied forces, J.
pub(super) fn energy(context: Context, particles: &Particles, motion: impl Fn(usize) -> Motion) -> [f64; 2] {
    let Context { elimination, elements, field, .. } = context;
    let (mut kinetic, mut potential) = (0.0, 0.0);
    for (node, slot) in elimination.slots[..elimination.free].iter().enumerate() {
        let (slot, Motion { position, velocity }) = (*slot as usize, motion(node));
        let mass = 1.0 / f64::from(particles.inverse_mass()[slot]);
        kinetic += 0.5 * mass * velocity.length_squared();
        potential -=
            (mass * field.acceleration(slot) + particles.applied_force.get(slot).as_dvec3()).dot(position);
    }
    let mut stretch = |number: u32, separation: DVec3| {
        let (rates, rest_length, tension_only) = elements.coefficients(number);
        let elongation = separation.length() - rest_length;
        let elongation = if tension_only { elongation.max(0.0) } else { elongation };
        potential += 0.5 * f64::from(rates.stiffness) * elongation.powi(2);
    };
    for (&number, &[first, second]) in elimination.elements.iter().zip(&elimination.ends) {
        stretch(number, motion(first as usize).position - motion(second as usize).position);
    }
    for nodes in &elimination.compounds {
        let ends = nodes.ends().iter().zip(elements.weights(nodes.element));
        stretch(nodes.element, ends.map(|(node, weight)| motion(*node as usize).position * weight).sum());
    }
    [kinetic, potential]
}
