//! How fast the elements let each of them move: the sums over neighbours of the stability bounds.

use crate::solver::elements::{Acting, Elements, Rates};
use crate::solver::particles::Particles;

/// What a bound must know of an element and those beside it.
#[derive(Debug, Clone, Copy)]
pub(in crate::solver) struct Coupling {
    /// The slot of a free end; any, as all are in one island.
    pub free_slot: usize,
    /// Its own coefficients.
    pub rates: Rates,
    /// Σ |cᵢ| Dᵢ over its ends, with Dᵢ = Σ k |c| / mᵢ over the elements of end i, 1/s²: by Gershgorin's theorem
    /// none of its island's ω² is above the largest of these.
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
        for (&end, weight) in ends.iter().zip(weights) {
            let share = f64::from(weight.abs()) * f64::from(inverse_mass[end as usize]);
            let [by_stiffness, by_damping] = &mut sums[end as usize];
            *by_stiffness += f64::from(stiffness) * share;
            *by_damping += f64::from(damping) * share;
        }
    });
    elements.for_each_acting(|Acting { ends, weights, rates, .. }| {
        let Some(free) = ends.iter().find(|end| inverse_mass[**end as usize] > 0.0) else { return };
        let sum = |which: usize| -> f64 {
            let terms = ends.iter().zip(weights);
            terms.map(|(end, weight)| f64::from(weight.abs()) * sums[*end as usize][which]).sum()
        };
        let (frequency_squared, damping_rate) = (sum(0), sum(1));
        visit(Coupling { free_slot: *free as usize, rates, frequency_squared, damping_rate });
    });
}
