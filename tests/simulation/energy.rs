//! Conserved and bounded quantities: energy of each scheme, and momentum.

use bevy::math::{DVec3, Vec3};
use bevy_mass_spring::solver::{self, Integrator, Solver, StepSettings, SubstepMode};

/// The largest relative error of one f32 rounding.
const ROUNDING: f64 = f32::EPSILON as f64 / 2.0;

/// ω² of the oscillator, 1/s².
const STIFFNESS: f32 = 256.0;
/// The step h, s: hω = 1/4.
const STEP: f32 = 1.0 / 64.0;
/// h²ω², exact.
const A: f64 = 1.0 / 16.0;

/// An undamped spring of rest length 0 between a pinned particle and one of 1 kg that is let go at
/// x = 1 m: x'' = −ω² x, with nothing but relative roundings.
fn oscillator() -> Solver {
    let mut state = Solver::default();
    state.add_particle(Vec3::ZERO, Vec3::ZERO, f32::INFINITY, 0.0).unwrap();
    state.add_particle(Vec3::X, Vec3::ZERO, 1.0, 0.0).unwrap();
    state
        .add_spring(
            [0, 1],
            solver::Spring {
                rest_length: 0.0,
                stiffness: STIFFNESS,
                damping: 0.0,
                ..solver::Spring::default()
            },
        )
        .unwrap();
    state
}

fn settings(scheme: Integrator) -> StepSettings {
    StepSettings {
        substeps: SubstepMode::Fixed(1),
        integrator: scheme,
        time_step: STEP,
        ..StepSettings::default()
    }
}

/// Position times ω, and velocity: E = (q² + v²) / 2.
fn phase(state: &Solver) -> (f64, f64) {
    let omega = f64::from(STIFFNESS).sqrt();
    let (position, velocity) = (state.position(1), state.velocity(1));
    (omega * f64::from(position.x), f64::from(velocity.x))
}

/// In the plane of q = ω x and v a step is a 2×2 matrix. The test has for each scheme its
/// determinant and the quadratic form Q that a step multiplies by it; energy stays between the values
/// that Q allows. Each step rounds q and v by a few u, so Q by less than 8 u.
fn assert_form_grows(
    scheme: Integrator,
    factor_per_step: f64,
    form: impl Fn(f64, f64) -> f64,
    steps: u32,
) -> Vec<f64> {
    let mut state = oscillator();
    let (q, v) = phase(&state);
    let start = form(q, v);
    let mut energies = Vec::new();
    for count in 1..=steps {
        state.step(&settings(scheme));
        let (q, v) = phase(&state);
        let expected = start * factor_per_step.powi(count as i32);
        let deviation = (form(q, v) / expected - 1.0).abs();
        let tolerance = 8.0 * ROUNDING * f64::from(count);
        assert!(deviation < tolerance, "{scheme:?}, step {count}: off by {deviation:e}");
        let energy = 0.5 * (q * q + v * v);
        let totals = state.measure(Vec3::ZERO);
        assert!((totals.kinetic_energy + totals.elastic_energy - energy).abs() < 1e-12 * energy);
        energies.push(energy);
    }
    energies
}

/// Q = q² + v² = 2 E, factor 1 + h²ω².
#[test]
fn explicit_euler_gains_energy_by_the_known_factor() {
    assert_form_grows(Integrator::ExplicitEuler, 1.0 + A, |q, v| q * q + v * v, 300);
}

/// Q = q² + v² − hω q v, factor 1: 2 E lies within Q / (1 ± hω/2). Over 50,000 steps, 2,000 periods.
#[test]
fn semi_implicit_euler_keeps_energy_within_bounds() {
    let h_omega = A.sqrt();
    let form = |q: f64, v: f64| q * q + v * v - h_omega * q * v;
    let energies = assert_form_grows(Integrator::SemiImplicitEuler, 1.0, form, 50_000);
    let conserved = 0.5 * f64::from(STIFFNESS);
    // 50,000 steps of 8 u.
    let slack = 1.0 + 8.0 * ROUNDING * 50_000.0;
    let (low, high) = (conserved / (1.0 + h_omega / 2.0), conserved / (1.0 - h_omega / 2.0));
    let (least, most) = energies.iter().fold((f64::MAX, 0.0_f64), |(a, b), e| (a.min(*e), b.max(*e)));
    assert!(low / slack <= least && most <= high * slack, "{least} to {most}, not {low} to {high}");
    // It does oscillate between the two.
    assert!(most - least > 0.9 * (high - low));
}

/// Q = v² + (1 − a/4) q², factor 1.
#[test]
fn velocity_verlet_keeps_energy_within_bounds() {
    let form = |q: f64, v: f64| v * v + (1.0 - A / 4.0) * q * q;
    let energies = assert_form_grows(Integrator::VelocityVerlet, 1.0, form, 50_000);
    let start = 0.5 * f64::from(STIFFNESS);
    let slack = 1.0 + 8.0 * ROUNDING * 50_000.0;
    for energy in energies {
        assert!(energy <= start * slack && energy >= start * (1.0 - A / 4.0) / slack, "{energy}");
    }
}

/// x' = (1 − a/2) x + h v, v' = v − hω² x: the determinant is 1 + a/2, and Q = q² + v² − hω/2 q v.
#[test]
fn the_taylor_scheme_gains_half_as_much_as_explicit_euler() {
    let form = |q: f64, v: f64| q * q + v * v - A.sqrt() / 2.0 * q * v;
    assert_form_grows(Integrator::SecondOrderTaylor, 1.0 + A / 2.0, form, 300);
}

/// The amplification of a rotation by i hω is |1 + z + z²/2 + z³/6 + z⁴/24|² = 1 − a³/72 + a⁴/576.
#[test]
fn runge_kutta_loses_energy_by_the_known_factor() {
    let factor = 1.0 - A.powi(3) / 72.0 + A.powi(4) / 576.0;
    let energies = assert_form_grows(Integrator::RungeKutta4, factor, |q, v| q * q + v * v, 20_000);
    // The loss, 6.7 %, is far above the tolerance of 0.95 %.
    assert!(energies[19_999] < 0.94 * energies[0]);
}

/// A net of 24 particles without external forces; some springs damp, all particles drift.
fn free_net() -> Solver {
    let mut state = Solver::default();
    let mut random = 1_u32;
    let mut next = || {
        // A linear congruential generator (Numerical Recipes), the high bits of it.
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (random >> 8) as f32 / (1 << 24) as f32
    };
    for slot in 0..24 {
        let grid = Vec3::new((slot % 4) as f32, (slot / 4 % 3) as f32, (slot / 12) as f32);
        let velocity = Vec3::new(next(), next(), next()) * 4.0 - 1.0;
        state.add_particle(grid * 0.5, velocity, 0.2 + 3.0 * next(), 0.0).unwrap();
    }
    for first in 0..24 {
        for second in first + 1..24 {
            let distance = state.position(first).distance(state.position(second));
            if distance < 0.8 {
                state
                    .add_spring(
                        [first, second],
                        solver::Spring {
                            rest_length: 0.9 * distance,
                            stiffness: 150.0 * next(),
                            damping: 0.02 * next(),
                            ..solver::Spring::default()
                        },
                    )
                    .unwrap();
            }
        }
    }
    state
}

/// Σ m v, and Σ m |v| as its scale.
fn momentum(state: &Solver) -> (DVec3, f64) {
    let mut scale = 0.0;
    for slot in 0..state.particle_count() {
        let speed = state.velocity(slot).as_dvec3().length();
        scale += speed / f64::from(state.inverse_mass(slot));
    }
    (state.measure(Vec3::ZERO).momentum, scale)
}

/// The pulls of a spring on its two ends cancel to the bit, so only the rounding of m v is left: u m|v|
/// a particle and substep, of either sign. Over n substeps of N particles it adds up like a random
/// walk, to √(n / N) u of Σ m|v|: 8e-7 here for one rounding a substep, 2e-6 for the six of the
/// Runge–Kutta scheme. 1e-5 is five times that.
#[test]
fn a_free_net_keeps_its_momentum() {
    // Explicit Euler needs the smaller step: it must not explode within the 2,000 ticks.
    for (scheme, time_step) in Integrator::named().map(|scheme| (scheme, 1.0 / 1024.0)) {
        let settings = StepSettings {
            integrator: scheme,
            time_step,
            substeps: SubstepMode::Fixed(2),
            ..StepSettings::default()
        };
        let mut state = free_net();
        let (start, scale) = momentum(&state);
        for tick in 1..=2000 {
            state.step(&settings);
            let (now, _) = momentum(&state);
            let drift = (now - start).length() / scale;
            assert!(drift < 1e-5, "{scheme:?}, tick {tick}: momentum drifts by {drift:e}");
        }
        // The springs have exchanged momentum far above the tolerance.
        let exchanged = state.velocity(0) - free_net().velocity(0);
        assert!(exchanged.length() > 0.1, "{scheme:?}");
    }
}

/// A damped spring loses energy in every step of a scheme that resolves it.
#[test]
fn a_damped_spring_loses_its_energy() {
    for scheme in Integrator::named() {
        let mut state = oscillator();
        // ζ = c / (2 √(k m)) = 1/8, hω = 1/64: e^(−2ζωt) is below 1e-6 after ωt = 56, 3584 steps.
        let damped = solver::Spring {
            rest_length: 0.0,
            stiffness: STIFFNESS,
            damping: 4.0,
            ..solver::Spring::default()
        };
        state.set_spring(0, damped).unwrap();
        let settings = StepSettings { time_step: STEP / 16.0, ..settings(scheme) };
        let total = |state: &Solver| {
            let totals = state.measure(Vec3::ZERO);
            totals.kinetic_energy + totals.elastic_energy
        };
        let start = total(&state);
        for _ in 0..3600 {
            state.step(&settings);
        }
        let end = total(&state) / start;
        // First-order schemes change the damping rate by at most hω / (2ζ) = 6 % of it, that is the
        // exponent 14 by 0.9; the phase adds a factor of at most (1 + ζ)/(1 − ζ): 3.2 in all.
        let expected = (-2.0 * 16.0 / 8.0 * 3600.0 * f64::from(STEP) / 16.0_f64).exp();
        assert!(end < 3.2 * expected && end > expected / 3.2, "{scheme:?}: {end:e}, not {expected:e}");
    }
}
