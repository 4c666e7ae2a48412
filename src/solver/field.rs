//! What acts on every particle, apart from elements: gravity, the medium, the air and gases.

use bevy::math::{DVec3, Vec3};

use crate::solver::particles::{Particles, Vectors};
use crate::solver::settings::StepSettings;

/// What acts on every particle, apart from elements.
#[derive(Debug, Clone, Copy)]
pub(super) struct Field<'a> {
    /// Acceleration of gravity, m/s².
    pub gravity: Vec3,
    /// Viscosity of the medium ν, N·s/m.
    pub viscosity: f32,
    /// The air; `None`: it acts on nothing.
    pub air: Option<&'a AirLoad>,
    /// The forces of gases on the particle in each slot, N, where a scheme evaluates them.
    pub gas: Option<&'a Vectors>,
}

/// The force b − d v of the air on each particle in a substep, by slot.
#[derive(Debug, Clone, Default)]
pub(super) struct AirLoad {
    /// b/m, m/s².
    pub push: Vectors,
    /// d/m, 1/s.
    pub rate: Vec<f32>,
    /// 1 / (1 + h d/m), with the substep h of explicit schemes.
    pub gain: Vec<f32>,
}

impl AirLoad {
    /// Turns accelerations a without air of the particles from slot `start` into (a + (b − d v)/m) / (1 + h d/m) along one axis:
    /// after h seconds at these the velocity v' is that of (v' − v)/h = a + (b − d v')/m.
    #[inline(always)]
    pub fn brake(&self, axis: usize, start: usize, velocity: &[f32], acceleration: &mut [f32]) {
        let count = acceleration.len();
        let slots = start..start + count;
        let (push, velocity) = (&self.push.axes()[axis][slots.clone()], &velocity[..count]);
        let (rate, gain) = (&self.rate[slots.clone()], &self.gain[slots]);
        for index in 0..count {
            let drag = push[index] - rate[index] * velocity[index];
            acceleration[index] = gain[index] * (acceleration[index] + drag);
        }
    }
}

impl<'a> Field<'a> {
    /// That of a tick with this load of the air.
    pub fn of(settings: &StepSettings, air: Option<&'a AirLoad>) -> Self {
        Self { gravity: settings.gravity, viscosity: settings.viscosity, air, gas: None }
    }

    /// The acceleration of the free particle in a slot that does not depend on its motion, user's force apart, m/s².
    pub fn acceleration(&self, slot: usize) -> DVec3 {
        let push = self.air.map(|air| air.push.get(slot).as_dvec3());
        self.gravity.as_dvec3() + push.unwrap_or(DVec3::ZERO)
    }

    /// How fast the medium and the air stop the particle in a slot, of this inverse mass (1/kg), 1/s.
    pub fn decay_rate(&self, slot: usize, inverse_mass: f64) -> f64 {
        f64::from(self.viscosity) * inverse_mass + self.air.map_or(0.0, |air| f64::from(air.rate[slot]))
    }

    /// The same of one of this mass, as a drag, N·s/m.
    pub fn drag(&self, slot: usize, mass: f64) -> f64 {
        f64::from(self.viscosity) + self.air.map_or(0.0, |air| mass * f64::from(air.rate[slot]))
    }

    /// The inverse mass with which a free particle answers to an impulse within a substep, 1/kg: air brakes it.
    pub fn mobility(&self, slot: usize, inverse_mass: f64) -> f64 {
        self.air.map_or(inverse_mass, |air| inverse_mass * f64::from(air.gain[slot]))
    }

    /// The velocity of a free particle after `h` seconds without elements, in m/s; see
    /// [`velocity_after`](Self::velocity_after).
    pub fn free_velocity(&self, particles: &Particles, slot: usize, h: f64) -> DVec3 {
        self.velocity_after(particles, slot, particles.velocity.get(slot).as_dvec3(), h)
    }

    /// Position and velocity of a free particle after `h` seconds without elements, in m and m/s. The force is constant
    /// and the drag in proportion to v, so this is exact.
    pub fn free_motion(&self, particles: &Particles, slot: usize, h: f64) -> [DVec3; 2] {
        let inverse_mass = f64::from(particles.inverse_mass()[slot]);
        let push = self.acceleration(slot) + inverse_mass * particles.applied_force.get(slot).as_dvec3();
        let (position, velocity) =
            (particles.position.get(slot).as_dvec3(), particles.velocity.get(slot).as_dvec3());
        let [decay, mean, double_mean] = decay(h * self.decay_rate(slot, inverse_mass));
        [position + h * (mean * velocity + h * double_mean * push), decay * velocity + h * mean * push]
    }

    /// The velocity of a free particle `h` seconds after it had `velocity` v, in m/s, by backward Euler: (v + h (g + f/m)) / (1 + h ν/m); air adds to
    /// f and ν.
    pub fn velocity_after(&self, particles: &Particles, slot: usize, velocity: DVec3, h: f64) -> DVec3 {
        let inverse_mass = f64::from(particles.inverse_mass()[slot]);
        let force = particles.applied_force.get(slot).as_dvec3();
        (velocity + h * (self.acceleration(slot) + inverse_mass * force))
            / (1.0 + h * self.decay_rate(slot, inverse_mass))
    }
}

/// e^−x, its mean ∫ e^−xt dt and ∫ (1 − t) e^−xt dt from 0 to 1, for x >= 0.
fn decay(x: f64) -> [f64; 3] {
    if x > 700.0 {
        let mean = 1.0 / x;
        return [0.0, mean, (1.0 - mean) * mean];
    }
    // The power series of a small argument, which is doubled: without a library's exponential the bits are the same
    // everywhere.
    let (mut small, mut doublings) = (x, 0);
    while small > 0.5 {
        (small, doublings) = (0.5 * small, doublings + 1);
    }
    let double_mean = (2..16).rev().fold(0.0, |sum, term| (1.0 - small * sum) / f64::from(term));
    let mut mean = 1.0 - small * double_mean;
    let mut decay = 1.0 - small * mean;
    for _ in 0..doublings {
        (mean, decay) = (mean * 0.5 * (1.0 + decay), decay * decay);
    }
    [decay, mean, if doublings == 0 { double_mean } else { (1.0 - mean) / x }]
}
