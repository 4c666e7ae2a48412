//! The sums and extremes that bounds on frequencies are made of.

use super::FrequencyBounds;

/// For each particle Σ k / m in 1/s², and Σ c / m in 1/s, over its springs.
pub(super) fn rates(
    inverse_mass: &[f32],
    springs: impl Iterator<Item = (usize, usize, f32, f32)>,
) -> Vec<[f64; 2]> {
    let mut rates = vec![[0.0; 2]; inverse_mass.len()];
    for (first, second, stiffness, damping) in springs {
        for end in [first, second] {
            rates[end][0] += f64::from(stiffness) * f64::from(inverse_mass[end]);
            rates[end][1] += f64::from(damping) * f64::from(inverse_mass[end]);
        }
    }
    rates
}

/// What [`FrequencyBounds`] are made of, as particles and springs are added.
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

    /// Adds a spring between ends of these [`rates`].
    pub fn add_spring(&mut self, [first, second]: [[f64; 2]; 2], stiffness: f32, damping: f32) {
        self.frequency_squared = self.frequency_squared.max(first[0] + second[0]);
        self.damping_rate = self.damping_rate.max(first[1] + second[1]);
        if stiffness > 0.0 {
            self.retardation_time = self.retardation_time.min(f64::from(damping) / f64::from(stiffness));
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
