//! The coupling of each element with its neighbours: the row sums of the stability bounds (Gershgorin).

use crate::solver::elements::{Acting, Elements, Rates};
use crate::solver::particles::Particles;

/// What a bound must know of an element and those beside it.
#[derive(Debug, Clone, Copy)]
pub(in crate::solver) struct Coupling {
    /// The slot of a free end; any, as all are in one island.
    pub free_slot: usize,
    /// Its own coefficients.
    pub rates: Rates,
    /// Σ |cᵢ| Dᵢ / g over its ends, with Dᵢ = Σ k |c| g / mᵢ over the elements of end i, 1/s²: none of its island's ω²
    /// is above the largest of these.
    ///
    /// That is Gershgorin's theorem on the matrix of the elements, with rows and columns scaled by any numbers
    /// g > 0. With g = ½ Σ |cᵢ|, which is 1 for springs, a soft element of large weights raises no bound: a rope of
    /// springs k and rods k' on masses m has ω² <= (4 k + 16 k') / m, the exact supremum.
    pub frequency_squared: f64,
    /// The same with dampings, 1/s.
    pub damping_rate: f64,
}

/// Calls `visit` for each acting element that has a free end.
pub(in crate::solver) fn for_each_coupling(
    elements: &Elements,
    particles: &Particles,
    mut visit: impl FnMut(Coupling),
) {
    let inverse_mass = particles.inverse_mass();
    let mut sums = vec![[0.0; 2]; particles.len()];
    elements.for_each_acting(|Acting { ends, weights, rates: Rates { stiffness, damping }, .. }| {
        let scale = scale(weights);
        for (&end, weight) in ends.iter().zip(weights) {
            let share = scale * f64::from(weight.abs()) * f64::from(inverse_mass[end as usize]);
            let [by_stiffness, by_damping] = &mut sums[end as usize];
            *by_stiffness += f64::from(stiffness) * share;
            *by_damping += f64::from(damping) * share;
        }
    });
    elements.for_each_acting(|Acting { ends, weights, rates, .. }| {
        let Some(free) = ends.iter().find(|end| inverse_mass[**end as usize] > 0.0) else { return };
        let sum = |which: usize| -> f64 {
            let terms = ends.iter().zip(weights);
            let sum: f64 =
                terms.map(|(end, weight)| f64::from(weight.abs()) * sums[*end as usize][which]).sum();
            sum / scale(weights)
        };
        let (frequency_squared, damping_rate) = (sum(0), sum(1));
        visit(Coupling { free_slot: *free as usize, rates, frequency_squared, damping_rate });
    });
}

/// g, see [`Coupling`]; not 0, as the weights of an element that acts are not.
fn scale(weights: &[f32]) -> f64 {
    let sum: f64 = weights.iter().map(|weight| f64::from(weight.abs())).sum();
    (0.5 * sum).max(f64::MIN_POSITIVE)
}
