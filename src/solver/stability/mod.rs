//! How large a substep may be: rigorous bounds on the frequencies of a net, and what follows from them.

#[cfg(test)]
mod modes;
mod plan;
mod tally;

use crate::solver::elements::Elements;
use crate::solver::graph::{for_each_coupling, has_loops};
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

/// Number of substeps up to which velocity Verlet costs less than implicit Euler with its automatic ones.
///
/// Measured in ns for a spring: a substep of velocity Verlet about 2, or 4 where there are contacts; one of
/// implicit Euler 200 where it is solved directly (two Newton steps), about 1,400 by conjugate gradients on
/// a stiff sheet.
const MAX_EXPLICIT_WITHOUT_LOOPS: u32 = 192;

/// See [`MAX_EXPLICIT_WITHOUT_LOOPS`]. The cost would allow twice as many, but the rounding of positions
/// to f32, which stiff springs amplify, then heats a sheet that nothing damps.
const MAX_EXPLICIT_WITH_LOOPS: u32 = 320;

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
pub struct FrequencyBounds {
    /// Bound on the angular frequency ω, ω² >= the largest eigenvalue of M⁻¹K; rad/s.
    pub angular_frequency: f64,
    /// Bound on the damping rate γ, >= the largest eigenvalue of M⁻¹C; 1/s.
    pub damping_rate: f64,
    /// τ such that C >= τ K: every motion against a spring is damped at least so much; s.
    /// Infinite where there are no springs.
    pub retardation_time: f64,
    /// Whether the springs between free particles close a loop. Ropes, chains and trees have none;
    /// their implicit equations are solved directly.
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
    pub(super) fn of(elements: &Elements, particles: &Particles, viscosity: f32) -> Self {
        let mut tally = Tally::default();
        particles.inverse_mass().iter().for_each(|inverse| tally.add_particle(*inverse));
        for_each_coupling(elements, particles, |coupling| tally.add_coupling(&coupling));
        tally.bounds(viscosity, has_loops(elements, particles))
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
            Integrator::Auto | Integrator::ImplicitEuler | Integrator::Xpbd => f64::INFINITY,
        };
        limit as f32
    }

    /// The scheme that takes a tick of `time_step` seconds through well at the least cost, and its
    /// substeps, `least` at least.
    ///
    /// On springs velocity Verlet, whose energy does not waver with the velocities as that of the Euler
    /// schemes does; unless they are damped and ask for so many substeps that semi-implicit Euler, which
    /// damping makes stable with fewer, is accurate too and costs less; or for so many that implicit Euler,
    /// which is stable whatever they are, does. Without springs semi-implicit Euler.
    pub(super) fn cheapest(&self, time_step: f32, least: u32) -> (Integrator, u32) {
        if self.angular_frequency == 0.0 {
            return (
                Integrator::SemiImplicitEuler,
                self.auto_substeps(Integrator::SemiImplicitEuler, time_step).max(least),
            );
        }
        if !self.is_stiff(time_step, least) {
            let verlet = self.verlet_substeps(time_step).max(least);
            return match self.damped_substeps(time_step).map(|substeps| substeps.max(least)) {
                // Each is one evaluation of the forces; velocity Verlet needs another one in each tick.
                Some(damped) if damped <= verlet => (Integrator::SemiImplicitEuler, damped),
                _ => (Integrator::VelocityVerlet, verlet),
            };
        }
        let implicit = self.auto_substeps(Integrator::ImplicitEuler, time_step);
        (Integrator::ImplicitEuler, implicit.max(least))
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

    /// Whether a tick of `time_step` seconds, of `least` substeps at least, costs less by implicit Euler.
    fn is_stiff(&self, time_step: f32, least: u32) -> bool {
        let most = if self.has_loops { MAX_EXPLICIT_WITH_LOOPS } else { MAX_EXPLICIT_WITHOUT_LOOPS };
        self.verlet_substeps(time_step) > most.max(least)
    }

    /// Whether some islands of a net within these bounds may want another scheme than the whole of it: if not,
    /// there is no need to find them.
    pub(super) fn may_divide(&self, time_step: f32, least: u32) -> bool {
        Self { has_loops: false, ..*self }.is_stiff(time_step, least)
    }

    /// The number of substeps of a tick of `time_step` seconds that keeps `scheme` at half of its
    /// stability bound, from 4 to [`MAX_SUBSTEPS`]; 2 of the implicit scheme where it is dear; 20 of
    /// position-based dynamics on springs.
    ///
    /// A scheme that is never stable gets the substeps of semi-implicit Euler.
    pub fn auto_substeps(&self, scheme: Integrator, time_step: f32) -> u32 {
        match scheme {
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
        FrequencyBounds::of(&elements, &particles, viscosity)
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
            assert_eq!(bounds.auto_substeps(scheme, 1.0 / 60.0), MIN_SUBSTEPS);
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
    fn the_cheapest_scheme_is_implicit_where_springs_are_stiff() {
        let bounds = |stiffness| bounds_of(&[0.0, 1.0], &[(0, 1, stiffness, 0.0)], 0.0);
        // hω <= 1.4: √k / 89.6 substeps.
        let cheapest = |omega: f32, least| bounds(omega * omega).cheapest(1.0 / 64.0, least);
        assert_eq!(cheapest(890.0, 1), (Integrator::VelocityVerlet, 10));
        assert_eq!(cheapest(890.0, 12), (Integrator::VelocityVerlet, 12));
        assert_eq!(cheapest(1.0, 1), (Integrator::VelocityVerlet, 4));
        assert_eq!(cheapest(89_000.0, 1), (Integrator::ImplicitEuler, 4));
        assert_eq!(cheapest(89_000.0, 12), (Integrator::ImplicitEuler, 12));
        assert_eq!(cheapest(89_000.0, 2000), (Integrator::VelocityVerlet, 2000));
        assert_eq!(FrequencyBounds::default().cheapest(1.0 / 64.0, 1), (Integrator::SemiImplicitEuler, 4));
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
