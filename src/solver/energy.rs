//! Energy, momentum and extremes of a state, accumulated in f64.

use bevy::ecs::reflect::ReflectResource;
use bevy::ecs::resource::Resource;
use bevy::math::{DVec3, Vec3};
use bevy::reflect::Reflect;
use bevy::reflect::prelude::ReflectDefault;
#[cfg(feature = "serialize")]
use bevy::reflect::{ReflectDeserialize, ReflectSerialize};

use crate::solver::state::State;

/// Physical quantities of a whole simulation at the end of the last tick.
///
/// In an app they are computed only while this resource exists: add
/// [`MassSpringDiagnosticsPlugin`](crate::MassSpringDiagnosticsPlugin), or insert it. Sums are accumulated in f64.
/// Pinned particles have no energy and no momentum.
#[derive(Resource, Reflect, Debug, Clone, Copy, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[reflect(Resource, Default, Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Measurements {
    /// Σ ½ m v², J.
    pub kinetic_energy: f64,
    /// Σ ½ k (l − l0)² of springs, Σ ½ k (‖Σ cᵢ xᵢ‖ − r)² of bends, and −p₀ V₀ ln (V / V₀) of gases, J.
    pub elastic_energy: f64,
    /// −Σ m g·x, J: zero at the origin; zero where gravity is switched off.
    pub gravitational_energy: f64,
    /// Σ m v, N·s.
    pub momentum: DVec3,
    /// The largest speed of a free particle, m/s.
    pub max_speed: f64,
    /// The largest |l − l0| / l0 of the springs with l0 > 0.
    pub max_stretch: f64,
    /// The mean |l − l0| / l0 of the springs with l0 > 0.
    pub mean_stretch: f64,
}

impl Measurements {
    /// Kinetic, elastic and gravitational energy together, J.
    pub fn total_energy(&self) -> f64 {
        self.kinetic_energy + self.elastic_energy + self.gravitational_energy
    }
}

/// Sums up `state` in the gravity field `gravity` (m/s²).
pub(crate) fn measure(state: &State, gravity: Vec3) -> Measurements {
    let mut measurements = Measurements::default();
    add_particles(state, gravity.as_dvec3(), &mut measurements);
    add_elements(state, &mut measurements);
    measurements
}

fn add_particles(state: &State, gravity: DVec3, measurements: &mut Measurements) {
    let particles = &state.particles;
    for slot in (0..particles.len()).filter(|slot| particles.is_movable(*slot)) {
        let mass = 1.0 / f64::from(particles.own_inverse_mass()[slot]);
        let position = state.origin.as_dvec3() + particles.position.get(slot).as_dvec3();
        let velocity = particles.velocity.get(slot).as_dvec3();
        measurements.kinetic_energy += 0.5 * mass * velocity.length_squared();
        measurements.gravitational_energy -= mass * gravity.dot(position);
        measurements.momentum += mass * velocity;
        measurements.max_speed = measurements.max_speed.max(velocity.length());
    }
}

fn add_elements(state: &State, measurements: &mut Measurements) {
    let (elements, position) = (&state.elements, &state.particles.position);
    elements.for_each_energy(position, |energy| measurements.elastic_energy += energy);
    let mut stretched = 0_usize;
    elements.for_each_spring(position, |length, rest_length| {
        if rest_length > 0.0 {
            let stretch = (length - rest_length).abs() / rest_length;
            measurements.max_stretch = measurements.max_stretch.max(stretch);
            measurements.mean_stretch += stretch;
            stretched += 1;
        }
    });
    for (_, enclosure) in state.elements.gases().acting() {
        let position =
            |place: usize| state.particles.position.get(enclosure.slots[place] as usize).as_dvec3();
        measurements.elastic_energy += enclosure.gas.energy_at(enclosure.volume(position));
    }
    measurements.mean_stretch /= stretched.max(1) as f64;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solver::elements::Spring;

    #[test]
    fn sums_of_two_particles_and_a_spring() {
        let mut state = State::default();
        state.add_particle(Vec3::new(0.0, 3.0, 0.0), Vec3::new(3.0, 4.0, 0.0), 0.5, 0.0);
        state.add_particle(Vec3::new(0.0, 1.0, 0.0), Vec3::ONE, 0.0, 0.0);
        state.add_spring(
            [0, 1],
            Spring { rest_length: 1.6, stiffness: 50.0, damping: 1.0, ..Spring::default() },
        );
        let found = measure(&state, Vec3::new(0.0, -10.0, 0.0));
        assert_eq!(found.kinetic_energy, 25.0);
        assert_eq!(found.gravitational_energy, 60.0);
        assert_eq!(found.momentum, DVec3::new(6.0, 8.0, 0.0));
        assert_eq!(found.max_speed, 5.0);
        assert!((found.elastic_energy - 4.0).abs() < 1e-6);
        assert!((found.max_stretch - 0.25).abs() < 1e-6);
        assert_eq!(found.max_stretch, found.mean_stretch);
    }

    #[test]
    fn an_empty_state_has_none() {
        assert_eq!(measure(&State::default(), Vec3::NEG_Y), Measurements::default());
    }
}
