//! Extended position-based dynamics: each spring in turn pulls its ends towards each other. First order;
//! stable for every substep.
//!
//! Macklin, Müller and Chentanez, *XPBD: position-based simulation of compliant constrained dynamics*
//! (2016), with one round over the springs in each substep, as in Macklin et al., *Small steps in physics
//! simulation* (2019). From where the particles fly without springs, a spring of stiffness k and damping c
//! between the inverse masses w displaces its ends along its direction d by w Δλ:
//!
//! Δλ = −(k h² (l − l0) + c h d·Δ) / (1 + (k h² + c h) (w₁ + w₂))
//!
//! where Δ is how far the ends have moved relative to each other in this substep. That is equation 26 of
//! the paper with the compliance α = 1/k and β = c, times k h², so that k may be 0. The springs are
//! solved for one at a time, so a long stiff net needs many substeps until it is as stiff as they are.

use bevy::math::{DVec3, Vec3};

use super::super::SolverState;
use super::super::forces::Field;
use super::super::particles::Particles;
use super::super::springs::Springs;
use super::free_velocity;

/// What is kept from substep to substep.
#[derive(Debug, Clone, Default)]
pub(super) struct Xpbd {
    colors: Colors,
    motion: Motion,
}

/// The particles in f64, one entry a slot.
#[derive(Debug, Clone, Default)]
struct Motion {
    /// Positions before the substep, m.
    start: Vec<DVec3>,
    /// Velocities without springs, m/s.
    velocity: Vec<DVec3>,
    position: Vec<DVec3>,
    /// How far the springs have displaced each particle, m.
    displacement: Vec<DVec3>,
}

/// The springs by colour: no two of one colour share a free particle, so that their order among
/// themselves changes nothing.
#[derive(Debug, Clone, Default)]
struct Colors {
    order: Vec<u32>,
    first: Vec<u32>,
    second: Vec<u32>,
    free: Vec<bool>,
}

impl Colors {
    fn refresh(&mut self, springs: &Springs, inverse_mass: &[f32]) {
        let known = self.first == springs.first()
            && self.second == springs.second()
            && self.free.len() == inverse_mass.len()
            && self.free.iter().zip(inverse_mass).all(|(free, inverse)| *free == (*inverse > 0.0));
        if known {
            return;
        }
        self.first.clear();
        self.first.extend_from_slice(springs.first());
        self.second.clear();
        self.second.extend_from_slice(springs.second());
        self.free.clear();
        self.free.extend(inverse_mass.iter().map(|inverse| *inverse > 0.0));
        self.paint(springs);
    }

    /// Gives each spring in turn the first colour that none has at its ends, and sorts by colour.
    fn paint(&mut self, springs: &Springs) {
        let mut taken: Vec<Vec<u32>> = vec![Vec::new(); self.free.len()];
        let mut colored: Vec<(u32, u32)> = Vec::with_capacity(springs.len());
        for spring in 0..springs.len() {
            let (first, second) = springs.ends(spring);
            let ends = [first, second].map(|end| self.free[end].then_some(end));
            let is_free = |color: &u32| ends.iter().flatten().all(|end| !taken[*end].contains(color));
            let color = (0..).find(is_free).unwrap_or(0);
            for end in ends.into_iter().flatten() {
                taken[end].push(color);
            }
            colored.push((color, spring as u32));
        }
        colored.sort_unstable();
        self.order.clear();
        self.order.extend(colored.into_iter().map(|(_, spring)| spring));
    }
}

pub(super) fn advance(state: &mut SolverState, field: Field, substep: f32) {
    let SolverState { particles, springs, scratch, .. } = state;
    let h = f64::from(substep);
    let Xpbd { colors, motion } = &mut scratch.xpbd;
    colors.refresh(springs, &particles.inverse_mass);
    motion.predict(particles, field, h);
    for &spring in &colors.order {
        let spring = spring as usize;
        let (first, second) = springs.ends(spring);
        let inverse_mass = [first, second].map(|end| f64::from(particles.inverse_mass[end]));
        let impulse = motion.impulse(springs, spring, inverse_mass[0] + inverse_mass[1], h);
        motion.displace(first, impulse * inverse_mass[0]);
        motion.displace(second, impulse * -inverse_mass[1]);
    }
    motion.finish(particles, h);
}

impl Motion {
    /// Lets the particles fly, and pinned ones go where they will be.
    fn predict(&mut self, particles: &Particles, field: Field, h: f64) {
        self.start.clear();
        self.velocity.clear();
        self.position.clear();
        self.displacement.clear();
        self.displacement.resize(particles.len(), DVec3::ZERO);
        for slot in 0..particles.len() {
            let start = particles.position.get(slot).as_dvec3();
            let velocity = match particles.inverse_mass[slot] > 0.0 {
                true => free_velocity(particles, slot, field, h),
                false => particles.velocity.get(slot).as_dvec3(),
            };
            self.start.push(start);
            self.velocity.push(velocity);
            self.position.push(start + h * velocity);
        }
    }

    /// Δλ d of a spring, kg·m: on its first end.
    fn impulse(&self, springs: &Springs, spring: usize, inverse_mass: f64, h: f64) -> DVec3 {
        let (first, second) = springs.ends(spring);
        let separation = self.position[first] - self.position[second];
        let length = separation.length();
        if length == 0.0 {
            return DVec3::ZERO;
        }
        let direction = separation / length;
        let stiffness = f64::from(springs.stiffness()[spring]) * h * h;
        let damping = f64::from(springs.damping()[spring]) * h;
        let elongation = length - f64::from(springs.rest_length()[spring]);
        let moved = direction.dot(separation - (self.start[first] - self.start[second]));
        let pull = stiffness * elongation + damping * moved;
        direction * (-pull / (1.0 + (stiffness + damping) * inverse_mass))
    }

    fn displace(&mut self, slot: usize, displacement: DVec3) {
        self.position[slot] += displacement;
        self.displacement[slot] += displacement;
    }

    /// Writes positions, velocities and accelerations back.
    fn finish(&mut self, particles: &mut Particles, h: f64) {
        for slot in 0..particles.len() {
            if particles.inverse_mass[slot] == 0.0 {
                particles.acceleration.set(slot, Vec3::ZERO);
                continue;
            }
            let velocity = self.velocity[slot] + self.displacement[slot] / h;
            let acceleration = (velocity - particles.velocity.get(slot).as_dvec3()) / h;
            particles.position.set(slot, self.position[slot].as_vec3());
            particles.velocity.set(slot, velocity.as_vec3());
            particles.acceleration.set(slot, acceleration.as_vec3());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn springs_of_one_colour_share_no_free_particle() {
        let mut springs = Springs::default();
        for (first, second) in [(0, 1), (1, 2), (2, 3), (3, 1), (0, 3)] {
            springs.push(first, second, 1.0, 1.0, 0.0);
        }
        let mut colors = Colors::default();
        colors.refresh(&springs, &[0.0, 1.0, 1.0, 1.0]);
        // The colours are 0, 1, 0, 2, 1.
        assert_eq!(colors.order, [0, 2, 1, 4, 3]);
    }
}
