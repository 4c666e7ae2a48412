//! Extended position-based dynamics: each element in turn draws its ends together. First order; stable for every
//! substep.
//!
//! Macklin, Müller and Chentanez, *XPBD: position-based simulation of compliant constrained dynamics*
//! (2016), with one iteration over the elements in each substep, as in Macklin et al., *Small steps in physics
//! simulation* (2019). From where the particles fly without elements, one of stiffness k and damping c, with
//! weights cᵢ at ends of inverse masses wᵢ, displaces these along the direction d of its separation s by cᵢ wᵢ Δλ:
//!
//! Δλ = −(k h² (‖s‖ − l0) + c h d·Δ) / (1 + (k h² + c h) Σ cᵢ² wᵢ)
//!
//! where Δ is how much s has changed in this substep. That is equation 26 of the paper with the compliance
//! α = 1/k and β = c, times k h², so that k may be 0. The elements are solved for one at a time, so a long stiff
//! net needs many substeps until it is as stiff as they are.
//!
//! The gases come first, all at once: their pressures are those at the end of their own push. Air adds h d to the mass
//! with which a particle answers, as its drag is implicit.
//!
//! On many threads each takes blocks of particles, as the forces do: the elements within a block first, then,
//! in a row, the few between two blocks. In each of these they are ordered by colour.

use bevy::math::{DVec3, Vec3};

use super::Net;
use crate::solver::elements::{Elements, Gases};
use crate::solver::field::Field;
use crate::solver::graph::{Blocks, Linked};
use crate::solver::parallel;
use crate::solver::particles::{Particles, Vectors, set};

/// The particles in f64, one entry a slot: working memory.
#[derive(Debug, Clone, Default)]
pub(super) struct Xpbd {
    /// Positions before the substep, m.
    start: Vec<DVec3>,
    /// Velocities without elements, m/s.
    velocity: Vec<DVec3>,
    position: Vec<DVec3>,
    /// How far the elements have displaced each particle, m.
    displacement: Vec<DVec3>,
    /// Of the volume of a gas, m².
    gradient: Vec<DVec3>,
}

/// The particles of one block, or all.
struct Piece<'a> {
    /// The first slot.
    first: usize,
    start: &'a mut [DVec3],
    velocity: &'a mut [DVec3],
    position: &'a mut [DVec3],
    displacement: &'a mut [DVec3],
}

impl Xpbd {
    pub fn advance(
        &mut self,
        net: Net,
        blocks: &Blocks,
        particles: &mut Particles,
        acceleration: &mut Vectors,
        substep: f32,
    ) {
        let Net { elements, colouring, field, .. } = net;
        let h = f64::from(substep);
        // Even few blocks are worth it: an element costs several times what it does where only forces are computed.
        let is_shared = blocks.blocks.len() > 1;
        self.resize(particles.len());
        let sizes = || blocks.blocks.iter().map(|block| block.slots.len());
        let has_gas = elements.gases().any_act();
        if has_gas {
            let pieces = self.pieces(sizes());
            parallel::for_each(pieces, is_shared, |mut piece| piece.predict(particles, field, h));
            self.blow_up(elements.gases(), particles, field, h);
        }
        let within = self.pieces(sizes()).zip(colouring.within_blocks());
        parallel::for_each(within, is_shared, |(mut piece, listed)| {
            if !has_gas {
                piece.predict(particles, field, h);
            }
            piece.solve(listed, elements, (particles, field), h);
        });
        for mut all in self.pieces([particles.len()].into_iter()) {
            all.solve(colouring.between_blocks(), elements, (particles, field), h);
        }
        let (position, velocity, inverse_mass) = particles.answers_mut();
        let written = blocks.split(position.axes_mut()).zip(blocks.split(velocity.axes_mut()));
        let parts = self.pieces(sizes()).zip(written.zip(blocks.split(acceleration.axes_mut())));
        parallel::for_each(parts, is_shared, |(piece, ((position, velocity), acceleration))| {
            piece.finish(inverse_mass, [position, velocity, acceleration], h);
        });
    }

    /// Lets the gases push the particles, each at the pressure that it has after that; along their gradients the
    /// equation is quadratic.
    fn blow_up(&mut self, gases: &Gases, particles: &Particles, field: Field, h: f64) {
        let Self { position, displacement, gradient, .. } = self;
        for (_, enclosure) in gases.acting() {
            let volume = enclosure.measure(|place| position[enclosure.slots[place] as usize], gradient);
            let inverse_mass = |slot: usize| f64::from(particles.inverse_mass()[slot]);
            let pushed = || enclosure.slots.iter().map(|slot| *slot as usize).zip(&*gradient);
            let yields: f64 =
                pushed().map(|(slot, gradient)| yields_by(field, slot, inverse_mass(slot), *gradient)).sum();
            let impulse = enclosure.gas.implicit_pressure(volume, h * h * yields) * (h * h);
            for (slot, gradient) in pushed() {
                let moved = field.answer(slot, inverse_mass(slot), *gradient, impulse);
                position[slot] += moved;
                displacement[slot] += moved;
            }
        }
    }

    fn resize(&mut self, count: usize) {
        for vectors in [&mut self.start, &mut self.velocity, &mut self.position, &mut self.displacement] {
            vectors.resize(count, DVec3::ZERO);
        }
    }

    /// The particles in consecutive pieces of these sizes.
    fn pieces(&mut self, sizes: impl Iterator<Item = usize>) -> impl Iterator<Item = Piece<'_>> {
        let Self { start, velocity, position, displacement, .. } = self;
        let mut rest = [&mut start[..], &mut velocity[..], &mut position[..], &mut displacement[..]];
        let mut first = 0;
        sizes.map(move |size| {
            let pieces = rest.each_mut().map(|vectors| vectors.split_off_mut(..size));
            let [start, velocity, position, displacement] =
                pieces.map(|piece| piece.expect("the pieces are no longer than the vectors"));
            first += size;
            Piece { first: first - size, start, velocity, position, displacement }
        })
    }
}

impl Piece<'_> {
    /// Lets the particles fly, and pinned ones go where they will be.
    fn predict(&mut self, particles: &Particles, field: Field, h: f64) {
        self.displacement.fill(DVec3::ZERO);
        for place in 0..self.start.len() {
            let slot = self.first + place;
            if particles.is_pinned(slot) {
                [self.start[place], self.position[place]] = pinned_path(particles, slot, h);
                continue;
            }
            self.start[place] = particles.position.get(slot).as_dvec3();
            self.velocity[place] = field.free_velocity(particles, slot, h);
            self.position[place] = self.start[place] + h * self.velocity[place];
        }
    }

    /// Solves for the `listed` elements, one after the other; all their free ends are in the piece.
    fn solve(
        &mut self,
        listed: &[Linked],
        elements: &Elements,
        (particles, field): (&Particles, Field),
        h: f64,
    ) {
        let inverse_mass = |slot: usize| f64::from(particles.inverse_mass()[slot]);
        for linked in listed {
            let weights = elements.weights(linked.element);
            let ends = || linked.ends().iter().map(|end| *end as usize).zip(weights);
            let (mut separation, mut start) = (DVec3::ZERO, DVec3::ZERO);
            for (end, weight) in ends() {
                let [at_start, position] = self.ends_of_path(particles, end, h);
                separation += weight * position;
                start += weight * at_start;
            }
            let length = separation.length();
            if length == 0.0 {
                continue;
            }
            let direction = separation / length;
            let mut mobility = 0.0;
            for (end, weight) in ends() {
                mobility += weight * weight * field.mobility(end, inverse_mass(end), direction);
            }
            let (rates, rest_length, tension_only) = elements.coefficients(linked.element);
            let (stiffness, damping) = (f64::from(rates.stiffness) * h * h, f64::from(rates.damping) * h);
            let mut stretched = direction.dot(separation - start);
            if tension_only {
                // The damper acts on what is beyond the rest length.
                stretched = stretched.min(length - rest_length);
            }
            let pull = stiffness * (length - rest_length) + damping * stretched;
            if tension_only && pull <= 0.0 {
                continue;
            }
            let impulse = direction * (-pull / (1.0 + (stiffness + damping) * mobility));
            for (end, weight) in ends() {
                let place = end.wrapping_sub(self.first);
                if place < self.position.len() {
                    let displacement = field.answer(end, inverse_mass(end), impulse, weight);
                    self.position[place] += displacement;
                    self.displacement[place] += displacement;
                }
            }
        }
    }

    /// Where a particle was before the substep, and where it is now. One of another piece is pinned.
    #[inline]
    fn ends_of_path(&self, particles: &Particles, slot: usize, h: f64) -> [DVec3; 2] {
        let place = slot.wrapping_sub(self.first);
        match (self.start.get(place), self.position.get(place)) {
            (Some(start), Some(position)) => [*start, *position],
            _ => pinned_path(particles, slot, h),
        }
    }

    /// Writes positions, velocities and accelerations back.
    fn finish(&self, inverse_mass: &[f32], vectors: [[&mut [f32]; 3]; 3], h: f64) {
        let [mut position, mut velocity, mut acceleration] = vectors;
        for place in 0..self.start.len() {
            if inverse_mass[self.first + place] == 0.0 {
                set(&mut acceleration, place, Vec3::ZERO);
                continue;
            }
            let old = Vec3::from(velocity.each_ref().map(|axis| axis[place])).as_dvec3();
            let new = self.velocity[place] + self.displacement[place] / h;
            set(&mut position, place, self.position[place].as_vec3());
            set(&mut velocity, place, new.as_vec3());
            set(&mut acceleration, place, ((new - old) / h).as_vec3());
        }
    }
}

/// The square of a gradient, weighed by the mobility along it.
fn yields_by(field: Field, slot: usize, inverse_mass: f64, gradient: DVec3) -> f64 {
    let squared = gradient.length_squared();
    field.mobility(slot, inverse_mass, gradient.normalize_or_zero()) * squared
}

/// Where a pinned particle is before and after a substep of `h` seconds.
fn pinned_path(particles: &Particles, slot: usize, h: f64) -> [DVec3; 2] {
    let start = particles.position.get(slot).as_dvec3();
    [start, start + h * particles.velocity.get(slot).as_dvec3()]
}
