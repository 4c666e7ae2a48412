//! The bend: N ends, energy ½ k (‖Σ cᵢ xᵢ‖ − r)².
//!
//! Three ends with c = (1, −2, 1) resist the bending of a rod, four those of the hinge between two triangles
//! (Bergou et al., *A quadratic bending model for inextensible surfaces*, 2006).

use bevy::math::{DVec3, Vec3};

use super::{Element, Potential, Rates};

/// The parameters of a bend; those of the default are zero: it exerts no force.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub struct Bend<const N: usize> {
    /// The norm r of the separation without force, m, >= 0: 0 for what is straight or flat at rest.
    pub rest_length: f32,
    /// Stiffness k, N/m, >= 0.
    pub stiffness: f32,
    /// Damping along the separation, N·s/m, >= 0.
    pub damping: f32,
    /// The weights cᵢ, which add up to 0.
    #[cfg_attr(feature = "serialize", serde(with = "weights"))]
    pub weights: [f32; N],
}

/// Arrays of any length; serde supports those up to a fixed length only.
#[cfg(feature = "serialize")]
mod weights {
    use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};

    pub fn serialize<S: Serializer, const N: usize>(weights: &[f32; N], to: S) -> Result<S::Ok, S::Error> {
        weights.as_slice().serialize(to)
    }

    pub fn deserialize<'de, D: Deserializer<'de>, const N: usize>(from: D) -> Result<[f32; N], D::Error> {
        let weights = Vec::<f32>::deserialize(from)?;
        weights.try_into().map_err(|_| D::Error::custom("a bend has another number of weights"))
    }
}

impl<const N: usize> Default for Bend<N> {
    fn default() -> Self {
        Self { rest_length: 0.0, stiffness: 0.0, damping: 0.0, weights: [0.0; N] }
    }
}

/// Separations with a square below this have no direction: its inverse would overflow, m².
const NO_DIRECTION: f32 = 1e-36;

impl<const N: usize> Bend<N> {
    /// The pull, as [`Element::pull`] is to have it, of a bend that is `CURVED` (r > 0) and `DAMPED` (c > 0), or not:
    /// then what is zero is left out, which changes no bit.
    ///
    /// With the separation s it is −k (‖s‖ − r) s/‖s‖ − c (ṡ · s) s/‖s‖².
    #[inline(always)]
    pub(in crate::solver) fn pull_of<const CURVED: bool, const DAMPED: bool>(
        [rest_length, stiffness, damping]: [f32; 3],
        separation: Vec3,
        rate: Vec3,
    ) -> Vec3 {
        if !(CURVED || DAMPED) {
            return separation * -stiffness;
        }
        let squared = separation.length_squared();
        let inverse = if squared > NO_DIRECTION { 1.0 / squared } else { 0.0 };
        let beyond = if CURVED { 1.0 - rest_length * inverse.sqrt() } else { 1.0 };
        let damped = if DAMPED { damping * rate.dot(separation) * inverse } else { 0.0 };
        separation * -(stiffness * beyond + damped)
    }

    /// Rest length, stiffness and damping.
    #[inline(always)]
    pub(in crate::solver) fn material(&self) -> [f32; 3] {
        [self.rest_length, self.stiffness, self.damping]
    }
}

impl<const N: usize> Element<N> for Bend<N> {
    const HAS_RUNS: bool = true;

    #[inline(always)]
    fn weights(&self) -> [f32; N] {
        self.weights
    }

    #[inline(always)]
    fn pull(&self, separation: Vec3, rate: Vec3) -> Vec3 {
        let material @ [rest_length, _, damping] = self.material();
        if rest_length == 0.0 && damping == 0.0 {
            return Self::pull_of::<false, false>(material, separation, rate);
        }
        Self::pull_of::<true, true>(material, separation, rate)
    }

    fn energy(&self, separation: DVec3) -> f64 {
        let beyond = separation.length() - f64::from(self.rest_length);
        0.5 * f64::from(self.stiffness) * beyond * beyond
    }

    fn potential(&self, start: f64, step: f64) -> Potential {
        let (stiffness, damping_rate) = (f64::from(self.stiffness), f64::from(self.damping) / step);
        let (sum, rest_length) = (stiffness + damping_rate, f64::from(self.rest_length));
        let rest_length = match damping_rate > 0.0 {
            true => (stiffness * rest_length + damping_rate * start) / sum,
            false => rest_length,
        };
        Potential { stiffness: sum, rest_length, tension_only: false }
    }

    fn rates(&self) -> Rates {
        Rates { stiffness: self.stiffness, damping: self.damping }
    }

    fn rest_length(&self) -> f64 {
        self.rest_length.into()
    }

    fn between(&self, other: &Self, share: f32) -> Self {
        let mix = |from: f32, to: f32| from + share * (to - from);
        Self {
            rest_length: mix(self.rest_length, other.rest_length),
            stiffness: mix(self.stiffness, other.stiffness),
            damping: mix(self.damping, other.damping),
            weights: other.weights,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Spring;
    use super::super::sling::Sling;
    use super::*;
    use crate::solver::energy::measure;
    use crate::solver::outputs::Outputs;
    use crate::solver::particles::Vectors;
    use crate::solver::settings::{Integrator, StepSettings, SubstepMode};
    use crate::solver::state::State;
    use crate::solver::step::{Caches, Inputs, step};

    const STEP: f64 = 1.0 / 64.0;
    const STIFFNESS: f64 = 50.0;
    const DAMPING: f64 = 1.5;

    fn tick(state: &mut State, caches: &mut Caches, integrator: Integrator) -> Outputs {
        let time_step = STEP as f32;
        let settings =
            StepSettings { integrator, substeps: SubstepMode::Fixed(1), time_step, ..Default::default() };
        let mut outputs = Outputs::default();
        outputs.record_forces = true;
        step(state, &Inputs::default(), caches, &mut outputs, &settings);
        outputs
    }

    /// Particles on a line, displaced by their weights over their masses, so that they move as one mode; and Σ c²/m.
    fn bent<const N: usize>(weights: [f32; N], masses: [f32; N]) -> (State, f64) {
        let mut state = State::default();
        for (weight, mass) in weights.into_iter().zip(masses) {
            state.add_particle(Vec3::Y * (0.1 * weight / mass), Vec3::ZERO, 1.0 / mass, 0.0);
        }
        let terms = weights.iter().zip(masses);
        (state, terms.map(|(weight, mass)| f64::from(weight * weight / mass)).sum())
    }

    /// The height of Σ cᵢ xᵢ, and its rate.
    fn mode(state: &State, weights: &[f32]) -> [f64; 2] {
        let particles = &state.particles;
        [&particles.position, &particles.velocity].map(|vectors| {
            let terms = weights.iter().enumerate();
            terms.map(|(slot, weight)| f64::from(*weight) * f64::from(vectors.get(slot).y)).sum()
        })
    }

    /// A step on s'' = −ω² s − γ s', which is what the bend makes of its mode.
    fn recurrence(integrator: Integrator, [x, v]: [f64; 2], [squared, rate]: [f64; 2]) -> [f64; 2] {
        let h = STEP;
        let a = |x: f64, v: f64| -squared * x - rate * v;
        match integrator {
            Integrator::ExplicitEuler => [x + h * v, v + h * a(x, v)],
            Integrator::SemiImplicitEuler => {
                let v = v + h * a(x, v);
                [x + h * v, v]
            }
            Integrator::SecondOrderTaylor => [x + h * v + 0.5 * h * h * a(x, v), v + h * a(x, v)],
            Integrator::VelocityVerlet => {
                let old = a(x, v);
                let new_x = x + h * v + 0.5 * h * h * old;
                [new_x, v + 0.5 * h * (old + a(new_x, v + h * old))]
            }
            Integrator::RungeKutta4 => {
                let slope = |[x, v]: [f64; 2]| [v, a(x, v)];
                let at = |k: [f64; 2], share: f64| [x + share * h * k[0], v + share * h * k[1]];
                let k1 = slope([x, v]);
                let k2 = slope(at(k1, 0.5));
                let k3 = slope(at(k2, 0.5));
                let k4 = slope(at(k3, 1.0));
                [0, 1].map(|i| [x, v][i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]))
            }
            Integrator::TrBdf2 => {
                let (s, w) = ((1.0 - 0.5_f64.sqrt()) * h, 0.5 * (2.0_f64.sqrt() - 1.0));
                let solve = |[x, v]: [f64; 2]| {
                    let v = (v - s * squared * x) / (1.0 + s * rate + s * s * squared);
                    [x + s * v, v]
                };
                let middle = solve([x + s * v, v + s * a(x, v)]);
                solve([0, 1].map(|i| (1.0 + w) * middle[i] - w * [x, v][i]))
            }
            // One element alone is solved for exactly by position-based dynamics, too.
            _ => {
                let v = (v - h * squared * x) / (1.0 + h * rate + h * h * squared);
                [x + h * v, v]
            }
        }
    }

    /// Sums of up to N · 100 numbers below 1, each rounded by 2⁻²⁴: 4 · 100 · 6e-8.
    fn follows_its_recurrence<E: Element<N>, const N: usize>(
        masses: [f32; N],
        element: impl Fn([f32; 2]) -> E,
    ) where
        super::super::Elements: super::super::Holds<E, N>,
    {
        let weights = element([0.0; 2]).weights();
        for integrator in Integrator::named() {
            let (mut state, mobility) = bent(weights, masses);
            let ends = std::array::from_fn(|end| end as u32);
            // The dampers of these go by ‖s‖, which is not linear where s passes through zero.
            let goes_by_length = integrator.is_implicit() || integrator == Integrator::Xpbd;
            let damping = if goes_by_length { 0.0 } else { DAMPING };
            state.elements.push(ends, element([STIFFNESS as f32, damping as f32]));
            let rates = [STIFFNESS * mobility, damping * mobility];
            let mut expected = mode(&state, &weights);
            let mut caches = Caches::default();
            for number in 1..=100 {
                tick(&mut state, &mut caches, integrator);
                expected = recurrence(integrator, expected, rates);
                let found = mode(&state, &weights);
                for (found, expected) in found.into_iter().zip(expected) {
                    assert!(
                        (found - expected).abs() < 2.4e-5,
                        "{integrator}, step {number}: {found}, {expected}"
                    );
                }
            }
            assert!(expected[0].abs() > 1e-4, "{integrator}: it still moves");
        }
    }

    fn bend<const N: usize>(weights: [f32; N]) -> impl Fn([f32; 2]) -> Bend<N> {
        move |[stiffness, damping]| Bend { rest_length: 0.0, stiffness, damping, weights }
    }

    #[test]
    fn a_kind_of_one_file_and_one_line_follows_its_recurrence_in_every_scheme() {
        let sling = |[stiffness, damping]: [f32; 2]| Sling { stiffness, damping };
        follows_its_recurrence([3.0, 8.0, 4.0], sling);
    }

    #[test]
    fn a_rod_of_three_ends_follows_its_recurrence_in_every_scheme() {
        follows_its_recurrence([3.0, 8.0, 4.0], bend([1.0, -2.0, 1.0]));
    }

    #[test]
    fn a_hinge_of_four_ends_follows_its_recurrence_in_every_scheme() {
        follows_its_recurrence([2.0, 1.0, 4.0, 0.5], bend([0.5, 0.75, -1.5, 0.25]));
    }

    /// A rope with rods along it, its first particle pinned: springs, bends and a pinned end in one island.
    fn rope() -> State {
        let mut state = State::default();
        for link in 0..12_u8 {
            let bent =
                Vec3::new(f32::from(link) * 0.1, f32::from(link % 3) * 0.03, f32::from(link % 2) * 0.02);
            let (velocity, inverse_mass) = if link == 0 { (Vec3::ZERO, 0.0) } else { (Vec3::X * 0.2, 10.0) };
            state.add_particle(bent, velocity, inverse_mass, 0.0);
        }
        for link in 0..11 {
            state.add_spring(
                [link, link + 1],
                Spring { rest_length: 0.1, stiffness: 4.0, damping: 0.3, ..Spring::default() },
            );
        }
        for link in 0..10 {
            let bend = Bend { rest_length: 0.0, stiffness: 1.0, damping: 0.05, weights: [1.0, -2.0, 1.0] };
            state.elements.push([link, link + 1, link + 2], bend);
        }
        state
    }

    /// One step is backward Euler: v' = v + h a(x', v'), with the damper's mean rate over the step. Checked in f64
    /// at the positions that came out: 1/h² turns their rounding (2⁻²⁴ m) into 2.4e-4 m/s²; the iteration stops at
    /// 5e-4 of the displacement, 0.2 h · 5e-4 / h² = 6.4e-3.
    #[test]
    fn springs_and_bends_together_solve_backward_euler() {
        let (mut state, before) = (rope(), rope());
        tick(&mut state, &mut Caches::default(), Integrator::ImplicitEuler);
        let place = |state: &State, slot: usize| state.particles.position.get(slot).as_dvec3();
        let mut force = vec![DVec3::ZERO; 12];
        let mut add = |ends: &[usize], weights: &[f64], [k, c, rest]: [f64; 3]| {
            let separation = |state: &State| -> DVec3 {
                ends.iter().zip(weights).map(|(end, weight)| place(state, *end) * *weight).sum()
            };
            let (new, old) = (separation(&state), separation(&before));
            let tension = k * (new.length() - rest) + c * (new.length() - old.length()) / STEP;
            for (end, weight) in ends.iter().zip(weights) {
                force[*end] -= new.normalize_or_zero() * tension * *weight;
            }
        };
        let rounded = |value: f32| f64::from(value);
        for link in 0..11 {
            add(&[link, link + 1], &[1.0, -1.0], [4.0, rounded(0.3), rounded(0.1)]);
        }
        for link in 0..10 {
            add(&[link, link + 1, link + 2], &[1.0, -2.0, 1.0], [1.0, rounded(0.05), 0.0]);
        }
        for (slot, force) in force.iter().enumerate().skip(1) {
            let moved = place(&state, slot) - place(&before, slot);
            let start = before.particles.velocity.get(slot).as_dvec3();
            let residual = (moved / STEP - start) / STEP - *force * 10.0;
            assert!(residual.length() < 1e-2, "slot {slot}: {residual} m/s²");
        }
    }

    /// Every scheme keeps the momentum of a free rope with bends, and publishes what its elements do.
    #[test]
    fn momentum_is_kept_and_energy_and_forces_are_known_in_every_scheme() {
        for integrator in Integrator::named() {
            let mut state = rope();
            state.set_particle(0, 10.0, 0.0);
            let start = measure(&state, Vec3::ZERO);
            let mut caches = Caches::default();
            let outputs =
                (0..20).map(|_| tick(&mut state, &mut caches, integrator)).last().expect("20 ticks");
            let end = measure(&state, Vec3::ZERO);
            // 12 particles, 20 steps, each velocity rounded once or twice.
            assert!((end.momentum - start.momentum).length() < 12.0 * 20.0 * 1.2e-7 * 0.1, "{integrator}");
            assert!(start.elastic_energy > 0.0 && end.elastic_energy < start.elastic_energy, "{integrator}");
            let bent = |vectors: &Vectors| {
                let [a, b, c] = [0, 1, 2].map(|slot| vectors.get(slot).as_dvec3());
                a - 2.0 * b + c
            };
            let (separation, rate) = (bent(&state.particles.position), bent(&state.particles.velocity));
            let tension =
                separation.length() + f64::from(0.05_f32) * rate.dot(separation) / separation.length();
            assert_eq!(outputs.tensions.len(), 21);
            // Implicit schemes damp by the mean rate of the last step: of first order in it.
            let tolerance = if integrator.is_implicit() { 0.05 * tension.abs() } else { 1e-7 };
            let found = f64::from(outputs.tensions[11]);
            assert!((found - tension).abs() < tolerance, "{integrator}: {found} {tension}");
        }
    }

    /// The bound of one element alone is exact: ω² = k Σ c²/m.
    #[test]
    fn the_frequency_bound_of_one_bend_is_exact() {
        let (mut state, mobility) = bent([1.0, -2.0, 1.0], [3.0, 8.0, 4.0]);
        let bend = Bend { rest_length: 0.0, stiffness: 50.0, damping: 1.5, weights: [1.0, -2.0, 1.0] };
        state.elements.push([0, 1, 2], bend);
        let bounds = Caches::default().frequency_bounds(&state, 0.0);
        assert!((bounds.angular_frequency.powi(2) / (50.0 * mobility) - 1.0).abs() < 1e-6);
        assert!((bounds.damping_rate / (1.5 * mobility) - 1.0).abs() < 1e-6);
        assert!(!bounds.has_loops, "rods are solved for directly");
    }
}
