//! The sums and extremes from which the bounds on frequencies are computed.

use super::FrequencyBounds;
use crate::solver::graph::Coupling;

/// What [`FrequencyBounds`] are made of, as particles and elements are added.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tally {
    frequency_squared: f64,
    damping_rate: f64,
    retardation_time: f64,
    /// The least and the largest inverse mass of a free particle.
    inverse_mass: [f64; 2],
}

impl Default for Tally {
    fn default() -> Self {
        let inverse_mass = [f64::INFINITY, 0.0];
        Self { frequency_squared: 0.0, damping_rate: 0.0, retardation_time: f64::INFINITY, inverse_mass }
    }
}

impl Tally {
    pub fn add_particle(&mut self, inverse_mass: f32) {
        if inverse_mass > 0.0 {
            let [least, largest] = self.inverse_mass;
            self.inverse_mass = [least.min(inverse_mass.into()), largest.max(inverse_mass.into())];
        }
    }

    /// Adds an element.
    pub fn add_coupling(&mut self, coupling: &Coupling) {
        self.frequency_squared = self.frequency_squared.max(coupling.frequency_squared);
        self.damping_rate = self.damping_rate.max(coupling.damping_rate);
        let [stiffness, damping] = [coupling.rates.stiffness, coupling.rates.damping].map(f64::from);
        if stiffness > 0.0 {
            self.retardation_time = self.retardation_time.min(damping / stiffness);
        }
    }

    pub fn bounds(&self, viscosity: f32, has_loops: bool) -> FrequencyBounds {
        let Self { frequency_squared, damping_rate, mut retardation_time, inverse_mass } = *self;
        let viscosity = f64::from(viscosity);
        if frequency_squared > 0.0 {
            // C >= ν and K <= ω² M <= ω² max m, hence the medium alone damps by C >= (ν / (ω² max m)) K.
            retardation_time += viscosity * inverse_mass[0] / frequency_squared;
        }
        FrequencyBounds {
            angular_frequency: frequency_squared.sqrt(),
            damping_rate: damping_rate + viscosity * inverse_mass[1],
            retardation_time,
            has_loops,
        }
    }
}
