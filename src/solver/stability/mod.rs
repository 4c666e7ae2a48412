//! How large a substep may be: rigorous bounds on the frequencies of a net, and what follows from them.

mod cost;
mod gas;
#[cfg(test)]
mod modes;
mod plan;
mod surface;
mod tally;

use crate::solver::elements::Elements;
use crate::solver::graph::for_each_coupling;
#[cfg(test)]
use crate::solver::graph::has_loops;
use crate::solver::particles::Particles;
use crate::solver::settings::Integrator;
pub use plan::Plan;
pub(super) use plan::Planner;
use tally::Tally;

/// The part of the largest stable step that automatic substeps use.
///
/// The bound is that of the linear system. Half of it keeps h ω <= 1, below the resonances of
/// symplectic Euler at h ω = √2 and √3 that large motions can excite, and its phase error at 4 %.
const STABILITY_MARGIN: f32 = 0.5;

/// The least number of automatic substeps: contacts and free flight want some even without springs.
const MIN_SUBSTEPS: u32 = 4;

/// The number of automatic substeps of position-based dynamics on springs: each is one iteration over them.
const XPBD_SUBSTEPS: u32 = 20;

/// Velocity Verlet takes h ω <= 1.4 under `Auto`: its energy is right to (hω)²/8 of that of a mode; the
/// highest modes of a net hold little.
const VERLET_RESOLUTION: f64 = 1.4;

/// Semi-implicit Euler takes h ω <= 1 under `Auto` on springs: no mode is near a resonance.
const FIRST_ORDER_RESOLUTION: f64 = 1.0;

/// The part of its largest stable step that a scheme takes under `Auto`, where damping asks for shorter steps
/// than its resolution: the bound is rigorous.
const DAMPED_MARGIN: f32 = 0.95;

/// Minimal number of substeps of semi-implicit Euler under `Auto`: it is right to the first order only.
const MIN_FIRST_ORDER_SUBSTEPS: u32 = 16;

/// The number of automatic substeps of implicit Euler where the springs form loops.
const IMPLICIT_SUBSTEPS_WITH_LOOPS: u32 = 2;

/// The number of automatic substeps of TR-BDF2: with them the swing of a rope keeps 99.7 % of its energy in 20 s, and
/// a particle that touches something takes short enough steps of backward Euler.
const SECOND_ORDER_SUBSTEPS: u32 = 2;

/// The same on dampers without springs: with them the closed form is met within 10⁻³ at the end of every tick.
const DAMPER_SUBSTEPS: u32 = 8;

/// The highest frequency in rad/s that `Auto` resolves by an explicit scheme.
///
/// Each substep rounds positions of about 1 m by ε = 7·10⁻⁸ m, which gives a particle ½ (ωε)² of energy a kilogram:
/// with hω = 1.4, ω³ε²/2.8 in W/kg. At this frequency an undamped net is heated by 4 mW/kg, in 20 s by what it gains in
/// a fall of 8 mm.
const MAX_EXPLICIT_FREQUENCY: f64 = 13_000.0;

/// Number of substeps up to which all islands stay together: there is no need to find them.
const MAX_TOGETHER: u32 = 32;

/// The largest number of automatic substeps: a tick must end, whatever a scene asks for.
pub const MAX_SUBSTEPS: u32 = 65_536;

/// Bounds on the frequencies of a net of damped springs in a viscous medium.
///
/// With the mass matrix M, the stiffness matrix K and the damping matrix C of the net, whatever its
/// geometry and deformation. For a spring (i, j) let D_i = Σ k / m_i over the springs of i; the largest
/// eigenvalue of M⁻¹K is at most max (D_i + D_j): Gershgorin's theorem on the matrix of the springs
/// (for graphs: Anderson and Morley, *Linear and Multilinear Algebra* 18, 141, 1985). It is never above
/// the more familiar max 2 D_i, and below where masses differ.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct FrequencyBounds {
    /// Bound on the angular frequency ω, ω² >= the largest eigenvalue of M⁻¹K; rad/s.
    pub angular_frequency: f64,
    /// Bound on the damping rate γ, >= the largest eigenvalue of M⁻¹C; 1/s.
    pub damping_rate: f64,
    /// τ such that C >= τ K: every motion against a spring is damped at least so much; s.
    /// Infinite where there are no springs.
    pub retardation_time: f64,
    /// Whether the springs between free particles close a loop, or bends couple them as a loop would. Ropes, with
    /// bends along them or without, chains and trees have none; their implicit equations are solved directly.
    pub has_loops: bool,
}

impl Default for FrequencyBounds {
    /// Those of free particles in vacuum.
    fn default() -> Self {
        Self { angular_frequency: 0.0, damping_rate: 0.0, retardation_time: f64::INFINITY, has_loops: false }
    }
}

impl FrequencyBounds {
    /// Bounds for a whole net in a medium of `viscosity` in N·s/m.
    pub(super) fn of(elements: &Elements, particles: &Particles, viscosity: f32, has_loops: bool) -> Self {
        let mut tally = Tally::default();
        particles.inverse_mass().iter().for_each(|inverse| tally.add_particle(*inverse));
        for_each_coupling(elements, particles, |coupling| tally.add_coupling(&coupling));
        tally.bounds(viscosity, has_loops)
    }

    /// Those with a gas of this ω² at most (1/s²) besides: K is a sum of two, and of sums the largest eigenvalue is at
    /// most the sum of the largest. A gas is not damped.
    fn with_gas(mut self, frequency_squared: f64) -> Self {
        if frequency_squared > 0.0 {
            self.angular_frequency = (self.angular_frequency.powi(2) + frequency_squared).sqrt();
            self.retardation_time = 0.0;
        }
        self
    }

    /// The largest substep in s at which `scheme` is stable for every net within these bounds; may be
    /// infinite, and is 0 where the scheme is never stable (explicit Euler without damping).
    ///
    /// From the Jury conditions on the step matrix of one mode x'' = −ω² x − γ x', taken at the
    /// worst mode within the bounds. They are exact for whole nets too (every eigenvalue solves the scalar
    /// equation with its own Rayleigh quotients), but for Runge–Kutta, where they are those of modes
    /// which the damping does not couple. Those of velocity Verlet are of its substeps within a tick; that the
    /// forces are evaluated anew when a tick begins leaves every mode stable, too (tested).
    pub fn largest_stable_step(&self, scheme: Integrator) -> f32 {
        let Self { angular_frequency: omega, damping_rate: gamma, retardation_time, .. } = *self;
        let real_limit = 2.0 / gamma;
        let limit = match scheme {
            // 1 − hγ + h²ω² <= 1, and hγ < 2
            Integrator::ExplicitEuler => real_limit.min(retardation_time),
            // h²ω² + 2hγ < 4
            Integrator::SemiImplicitEuler => 4.0 / (gamma + gamma.hypot(2.0 * omega)),
            // 1 − hγ + h²ω²/2 <= 1, and hγ < 2
            Integrator::SecondOrderTaylor => real_limit.min(2.0 * retardation_time),
            // h²ω² + 4hγ < 4, from λ³ + (h²ω² + 3/2 hγ − 2) λ² + (1 − 2hγ) λ + hγ/2 = 0
            Integrator::VelocityVerlet => 2.0 / (gamma + gamma.hypot(omega)),
            Integrator::RungeKutta4 => 2.0 * RUNGE_KUTTA_4_RADIUS / (gamma + gamma.hypot(2.0 * omega)),
            Integrator::Auto | Integrator::ImplicitEuler | Integrator::TrBdf2 | Integrator::Xpbd => {
                f64::INFINITY
            }
        };
        limit as f32
    }

    /// The explicit scheme that takes a tick of `time_step` seconds on springs through well, and its substeps, `least`
    /// at least.
    ///
    /// It is velocity Verlet: its energy oscillates less than that of the Euler schemes. The exception is damped springs that need many
    /// substeps: there semi-implicit Euler, which is stable with fewer, is accurate too and costs less.
    fn cheapest_explicit(&self, time_step: f32, least: u32) -> (Integrator, u32) {
        let verlet = self.verlet_substeps(time_step).max(least);
        match self.damped_substeps(time_step).map(|substeps| substeps.max(least)) {
            // Each is one evaluation of the forces; velocity Verlet needs another one in each tick.
            Some(damped) if damped <= verlet => (Integrator::SemiImplicitEuler, damped),
            _ => (Integrator::VelocityVerlet, verlet),
        }
    }

    /// Without springs semi-implicit Euler, or TR-BDF2 where something is damped: it is exact for single particles.
    fn cheapest_without_springs(&self, has_elements: bool, least: u32) -> (Integrator, u32) {
        match (self.damping_rate > 0.0, has_elements) {
            (false, _) => (Integrator::SemiImplicitEuler, MIN_SUBSTEPS.max(least)),
            (true, false) => (Integrator::TrBdf2, MIN_SUBSTEPS.max(least)),
            (true, true) => (Integrator::TrBdf2, DAMPER_SUBSTEPS.max(least)),
        }
    }

    /// Whether rounding would heat the net under an explicit scheme, see [`MAX_EXPLICIT_FREQUENCY`]; not where the
    /// user asks for `least` substeps that resolve it.
    fn is_too_fast(&self, time_step: f32, least: u32) -> bool {
        self.angular_frequency > MAX_EXPLICIT_FREQUENCY && self.verlet_substeps(time_step) > least
    }

    /// The substeps of semi-implicit Euler in a tick of `time_step` seconds under `Auto`, if the net is damped
    /// and they are many enough to be accurate.
    fn damped_substeps(&self, time_step: f32) -> Option<u32> {
        let substeps =
            self.resolving_substeps(Integrator::SemiImplicitEuler, FIRST_ORDER_RESOLUTION, time_step);
        (self.damping_rate > 0.0 && substeps >= MIN_FIRST_ORDER_SUBSTEPS).then_some(substeps)
    }

    /// The substeps of velocity Verlet in a tick of `time_step` seconds under `Auto`.
    fn verlet_substeps(&self, time_step: f32) -> u32 {
        self.resolving_substeps(Integrator::VelocityVerlet, VERLET_RESOLUTION, time_step).max(MIN_SUBSTEPS)
    }

    /// The number of substeps of an explicit scheme with which h ω <= `resolution` and damping leaves it stable.
    fn resolving_substeps(&self, scheme: Integrator, resolution: f64, time_step: f32) -> u32 {
        let resolved = (resolution / self.angular_frequency) as f32;
        (time_step / resolved.min(DAMPED_MARGIN * self.largest_stable_step(scheme))).ceil() as u32
    }

    /// Whether some islands of a net within these bounds may want another scheme than the whole of it: if not,
    /// there is no need to find them.
    fn may_divide(&self, time_step: f32, least: u32) -> bool {
        self.verlet_substeps(time_step) > MAX_TOGETHER.max(least)
    }

    /// The number of substeps of a tick of `time_step` seconds that keeps `scheme` at half of its
    /// stability bound, from 4 to [`MAX_SUBSTEPS`]; 2 of TR-BDF2, and of implicit Euler where springs form loops; 20 of
    /// position-based dynamics on springs.
    ///
    /// A scheme that is never stable gets the substeps of semi-implicit Euler.
    pub fn auto_substeps(&self, scheme: Integrator, time_step: f32) -> u32 {
        match scheme {
            Integrator::TrBdf2 => return SECOND_ORDER_SUBSTEPS,
            Integrator::ImplicitEuler if self.has_loops => return IMPLICIT_SUBSTEPS_WITH_LOOPS,
            Integrator::Xpbd if self.angular_frequency > 0.0 => return XPBD_SUBSTEPS,
            _ => {}
        }
        let own = self.largest_stable_step(scheme);
        let limit = if own > 0.0 { own } else { self.largest_stable_step(Integrator::SemiImplicitEuler) };
        let wanted = (time_step / (STABILITY_MARGIN * limit)).ceil();
        // A float too large for u32 saturates; NaN cannot occur as both are > 0.
        (wanted as u32).clamp(MIN_SUBSTEPS, MAX_SUBSTEPS)
    }
}

/// The radius of the largest half-disk of the left half-plane in which |1 + z + z²/2 + z³/6 + z⁴/24| <= 1.
const RUNGE_KUTTA_4_RADIUS: f64 = 2.615;

#[cfg(test)]
mod tests {
    use super::modes::{quadratic_radius, spectral_radius};
    use super::*;

    use super::plan::tests::net;

    const PAIR: [(u32, u32, f32, f32); 1] = [(0, 1, 800.0, 4.0)];

    fn bounds_of(inverse_mass: &[f32], springs: &[(u32, u32, f32, f32)], viscosity: f32) -> FrequencyBounds {
        let (elements, particles) = net(inverse_mass, springs);
        FrequencyBounds::of(&elements, &particles, viscosity, has_loops(&elements, &particles))
    }

    #[test]
    fn bounds_of_a_spring_between_two_masses_are_exact() {
        // ω² = k (1/m1 + 1/m2), γ = c (1/m1 + 1/m2)
        let bounds = bounds_of(&[0.5, 0.25], &PAIR, 0.0);
        assert!((bounds.angular_frequency - 600.0_f64.sqrt()).abs() < 1e-12);
        assert_eq!(bounds.damping_rate, 3.0);
        assert_eq!(bounds.retardation_time, 4.0 / 800.0);
    }

    #[test]
    fn a_pinned_end_and_a_viscous_medium() {
        let bounds = bounds_of(&[0.0, 0.5], &PAIR, 6.0);
        assert_eq!(bounds.angular_frequency, 20.0);
        assert_eq!(bounds.damping_rate, 2.0 + 3.0);
        assert_eq!(bounds.retardation_time, 4.0 / 800.0 + 6.0 / 800.0);
    }

    #[test]
    fn free_particles_have_no_limit() {
        let bounds = bounds_of(&[1.0], &[], 0.0);
        assert_eq!(bounds, FrequencyBounds::default());
        for scheme in Integrator::named() {
            assert_eq!(bounds.largest_stable_step(scheme), f32::INFINITY, "{scheme:?}");
            let substeps = if scheme == Integrator::TrBdf2 { SECOND_ORDER_SUBSTEPS } else { MIN_SUBSTEPS };
            assert_eq!(bounds.auto_substeps(scheme, 1.0 / 60.0), substeps);
        }
    }

    #[test]
    fn every_mode_within_the_bounds_is_stable_at_the_largest_stable_step() {
        for scheme in Integrator::named() {
            for (omega, gamma) in [(30.0, 0.0), (30.0, 1.0), (30.0, 20.0), (30.0, 60.0), (30.0, 300.0)] {
                let retardation_time = gamma / (omega * omega);
                let bounds = FrequencyBounds {
                    angular_frequency: omega,
                    damping_rate: gamma,
                    retardation_time,
                    ..Default::default()
                };
                let limit = f64::from(bounds.largest_stable_step(scheme).min(1e3));
                for share in 1..=50 {
                    let omega = omega * f64::from(share) / 50.0;
                    let least_gamma = match scheme {
                        Integrator::ExplicitEuler | Integrator::SecondOrderTaylor => {
                            retardation_time * omega * omega
                        }
                        _ => 0.0,
                    };
                    for blend in 0..=20 {
                        let gamma = least_gamma + (gamma - least_gamma) * f64::from(blend) / 20.0;
                        let radius = spectral_radius(scheme, omega, gamma, limit * (1.0 - 1e-6));
                        assert!(radius <= 1.0 + 1e-9, "{scheme:?} ω {omega} γ {gamma}: {radius}");
                    }
                }
            }
        }
    }

    /// Whole ticks of velocity Verlet, with A = h²ω² and G = hγ on the bound A + 4 G = 4 and below: the first
    /// substep takes a(x, v), the others the a of the one before.
    #[test]
    fn ticks_of_velocity_verlet_are_stable_whatever_their_substeps() {
        for (damping, part) in (0..=50).flat_map(|damping| [1.0, 0.7, 0.3, 0.05].map(|part| (damping, part)))
        {
            let g_bound = f64::from(damping) / 50.0;
            for (a, g) in [0.0, 0.5, 1.0].map(|share| (part * 4.0 * (1.0 - g_bound), share * g_bound)) {
                // The columns of the matrix of the tick: what becomes of (x, v) = (1, 0) and (0, 1).
                let mut columns = [[1.0, 0.0, -a], [0.0, 1.0, -g]];
                for substeps in 1..=32 {
                    for [x, v, slope] in &mut columns {
                        *x += *v + 0.5 * *slope;
                        let next = -a * *x - g * (*v + *slope);
                        *v += 0.5 * (*slope + next);
                        *slope = next;
                    }
                    let [[xx, vx, _], [xv, vv, _]] = columns;
                    let is_stable = quadratic_radius(xx + vv, xx * vv - xv * vx) <= 1.0 + 1e-9;
                    assert!(is_stable, "A {a}, G {g}, {substeps} substeps");
                }
            }
        }
    }

    #[test]
    fn the_bound_is_sharp_for_one_mode() {
        for (scheme, gamma) in [
            (Integrator::ExplicitEuler, 20.0),
            (Integrator::SemiImplicitEuler, 20.0),
            (Integrator::SecondOrderTaylor, 20.0),
            (Integrator::VelocityVerlet, 20.0),
        ] {
            let bounds = FrequencyBounds {
                angular_frequency: 30.0,
                damping_rate: gamma,
                retardation_time: gamma / 900.0,
                ..Default::default()
            };
            let limit = f64::from(bounds.largest_stable_step(scheme));
            assert!(spectral_radius(scheme, 30.0, gamma, limit * 1.01) > 1.0, "{scheme:?}");
        }
    }

    #[test]
    fn automatic_substeps_keep_half_of_the_bound() {
        // One mass on a pinned spring with ω = 1000 rad/s: the limit is 2 ms, half of it 1 ms.
        let bounds = bounds_of(&[0.0, 1.0], &[(0, 1, 1e6, 0.0)], 0.0);
        assert_eq!(bounds.auto_substeps(Integrator::SemiImplicitEuler, 0.0165), 17);
        assert_eq!(bounds.auto_substeps(Integrator::ExplicitEuler, 0.0165), 17);
        let absurd = bounds_of(&[0.0, f32::MAX], &[(0, 1, f32::MAX, 0.0)], 0.0);
        assert_eq!(absurd.auto_substeps(Integrator::SemiImplicitEuler, 1.0), MAX_SUBSTEPS);
    }
}
