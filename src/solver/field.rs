//! What acts on every particle, apart from elements: gravity, the medium, the air and gases.

use bevy::math::{DMat3, DVec3, Mat3, Vec3};

use crate::solver::particles::{Particles, Vectors, set};
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
    /// At particles in which filaments end, in ascending order of their slots: there `push` and `rate` are 0, and `gain` is 1.
    pub filaments: Vec<FilamentLoad>,
}

/// The force on a particle at which filaments end: b − d v − D v with a matrix D, as nothing brakes along them.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct FilamentLoad {
    pub slot: u32,
    /// The velocity u of the air, m/s: b is (d + D) u, and the lift of faces.
    air: Vec3,
    /// The lift of faces by the mass, m/s².
    lift: Vec3,
    /// d/m, of faces, 1/s.
    face_rate: f32,
    /// D/m, 1/s.
    across: DMat3,
    /// G = (I + h (d + D)/m)⁻¹, with the substep h of explicit schemes.
    gain: Mat3,
    /// G (d + D)/m, 1/s.
    pull: Mat3,
}

impl FilamentLoad {
    /// Without a force yet.
    pub fn of(slot: u32) -> Self {
        Self { slot, ..Self::default() }
    }

    /// Of d/m and lift by the mass of faces, and D/m, for explicit substeps of `substep` seconds.
    pub fn new(slot: u32, air: Vec3, faces: (f32, Vec3), across: DMat3, substep: f32) -> Self {
        let (face_rate, lift) = faces;
        let rate = DMat3::from_diagonal(DVec3::splat(face_rate.into())) + across;
        let gain = (DMat3::IDENTITY + rate * f64::from(substep)).inverse();
        // In f64, so that rounding pulls along no filament.
        Self { slot, air, lift, face_rate, across, gain: gain.as_mat3(), pull: (gain * rate).as_mat3() }
    }

    /// D/m, 1/s, and the velocity of the air, m/s.
    pub fn across(&self) -> (DMat3, DVec3) {
        (self.across, self.air.as_dvec3())
    }
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

    /// The same at filaments, along all axes.
    #[inline]
    pub fn brake_filaments(&self, start: usize, velocity: [&[f32]; 3], acceleration: &mut [&mut [f32]; 3]) {
        let end = start + acceleration[0].len();
        let first = self.filaments.partition_point(|load| (load.slot as usize) < start);
        for load in self.filaments[first..].iter().take_while(|load| (load.slot as usize) < end) {
            let place = load.slot as usize - start;
            let vacuum = Vec3::from(acceleration.each_ref().map(|axis| axis[place]));
            let relative = load.air - Vec3::from(velocity.map(|axis| axis[place]));
            set(acceleration, place, load.gain * (vacuum + load.lift) + load.pull * relative);
        }
    }

    #[inline]
    fn filament(&self, slot: usize) -> Option<&FilamentLoad> {
        let place = self.filaments.binary_search_by_key(&(slot as u32), |load| load.slot).ok()?;
        Some(&self.filaments[place])
    }
}

impl<'a> Field<'a> {
    /// That of a tick with this load of the air.
    pub fn of(settings: &StepSettings, air: Option<&'a AirLoad>) -> Self {
        Self { gravity: settings.gravity, viscosity: settings.viscosity, air, gas: None }
    }

    /// What the air does to the particle in a slot, if filaments end there.
    #[inline]
    pub fn filament(&self, slot: usize) -> Option<&'a FilamentLoad> {
        self.air.and_then(|air| air.filament(slot))
    }

    /// The acceleration of the free particle in a slot that does not depend on its motion, user's force apart, m/s².
    pub fn acceleration(&self, slot: usize) -> DVec3 {
        let even = self.acceleration_without_filaments(slot);
        self.filament(slot).map_or(even, |load| even + load.across * load.air.as_dvec3())
    }

    /// The same without what filaments add, D u.
    #[inline]
    pub fn acceleration_without_filaments(&self, slot: usize) -> DVec3 {
        let push = self.air.map(|air| air.push.get(slot).as_dvec3());
        let even = self.gravity.as_dvec3() + push.unwrap_or(DVec3::ZERO);
        self.filament(slot).map_or(even, |load| {
            even + load.lift.as_dvec3() + load.air.as_dvec3() * f64::from(load.face_rate)
        })
    }

    /// How fast the medium and the air stop the particle in a slot, of this inverse mass (1/kg), in all directions alike,
    /// 1/s.
    #[inline]
    pub fn decay_rate(&self, slot: usize, inverse_mass: f64) -> f64 {
        f64::from(self.viscosity) * inverse_mass
            + self.air.map_or(0.0, |air| f64::from(air.rate[slot]))
            + self.face_rate(slot)
    }

    /// The same of one of this mass, as a drag, N·s/m.
    #[inline]
    pub fn drag(&self, slot: usize, mass: f64) -> f64 {
        f64::from(self.viscosity)
            + self.air.map_or(0.0, |air| mass * f64::from(air.rate[slot]))
            + mass * self.face_rate(slot)
    }

    #[inline]
    fn face_rate(&self, slot: usize) -> f64 {
        self.filament(slot).map_or(0.0, |load| load.face_rate.into())
    }

    /// How the medium and the air brake the particle in a slot, of this inverse mass (1/kg), at a velocity (m/s), m/s².
    pub fn braking(&self, slot: usize, inverse_mass: f64, velocity: DVec3) -> DVec3 {
        let even = self.decay_rate(slot, inverse_mass) * velocity;
        self.filament(slot).map_or(even, |load| even + load.across * velocity)
    }

    /// The inverse mass with which a free particle answers to an impulse along a unit vector within a substep, 1/kg: air
    /// brakes it.
    pub fn mobility(&self, slot: usize, inverse_mass: f64, direction: DVec3) -> f64 {
        match self.filament(slot) {
            Some(load) => inverse_mass * direction.dot(load.gain.as_dmat3() * direction),
            None => self.mobility_without_filaments(slot, inverse_mass),
        }
    }

    /// How its velocity answers to the impulse `factor` · `impulse`.
    pub fn answer(&self, slot: usize, inverse_mass: f64, impulse: DVec3, factor: f64) -> DVec3 {
        match self.filament(slot) {
            Some(load) => load.gain.as_dmat3() * impulse * (factor * inverse_mass),
            None => impulse * (factor * self.mobility_without_filaments(slot, inverse_mass)),
        }
    }

    fn mobility_without_filaments(&self, slot: usize, inverse_mass: f64) -> f64 {
        self.air.map_or(inverse_mass, |air| inverse_mass * f64::from(air.gain[slot]))
    }

    /// The velocity of a free particle after `h` seconds without elements, in m/s; see
    /// [`velocity_after`](Self::velocity_after).
    pub fn free_velocity(&self, particles: &Particles, slot: usize, h: f64) -> DVec3 {
        self.velocity_after(particles, slot, particles.velocity.get(slot).as_dvec3(), h)
    }

    /// Position and velocity of a free particle after `h` seconds without elements, in m and m/s. The force is constant
    /// and the drag in proportion to v, so this is exact; but for filaments, at their first-order formula.
    pub fn free_motion(&self, particles: &Particles, slot: usize, h: f64) -> [DVec3; 2] {
        let inverse_mass = f64::from(particles.inverse_mass()[slot]);
        let push = self.acceleration(slot) + inverse_mass * particles.applied_force.get(slot).as_dvec3();
        let (position, velocity) =
            (particles.position.get(slot).as_dvec3(), particles.velocity.get(slot).as_dvec3());
        if self.filament(slot).is_some() {
            let velocity = self.velocity_after(particles, slot, velocity, h);
            return [position + h * velocity, velocity];
        }
        let [decay, mean, double_mean] = decay(h * self.decay_rate(slot, inverse_mass));
        [position + h * (mean * velocity + h * double_mean * push), decay * velocity + h * mean * push]
    }

    /// The velocity of a free particle `h` seconds after it had `velocity` v, in m/s, by backward Euler: (v + h (g + f/m)) / (1 + h ν/m); air adds to
    /// f and ν.
    pub fn velocity_after(&self, particles: &Particles, slot: usize, velocity: DVec3, h: f64) -> DVec3 {
        let Some(load) = self.filament(slot) else {
            return self.velocity_without_filaments(particles, slot, velocity, h);
        };
        let inverse_mass = f64::from(particles.inverse_mass()[slot]);
        let force = particles.applied_force.get(slot).as_dvec3();
        let decay = 1.0 + h * self.decay_rate(slot, inverse_mass);
        let matrix = DMat3::from_diagonal(DVec3::splat(decay)) + load.across * h;
        matrix.inverse() * (velocity + h * (self.acceleration(slot) + inverse_mass * force))
    }

    /// The same without filaments.
    #[inline]
    pub fn velocity_without_filaments(
        &self,
        particles: &Particles,
        slot: usize,
        velocity: DVec3,
        h: f64,
    ) -> DVec3 {
        let inverse_mass = f64::from(particles.inverse_mass()[slot]);
        let force = particles.applied_force.get(slot).as_dvec3();
        (velocity + h * (self.acceleration_without_filaments(slot) + inverse_mass * force))
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
