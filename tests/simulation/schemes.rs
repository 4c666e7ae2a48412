//! The integration schemes: each beside its written recurrence, and their orders of convergence.

use bevy::math::{DVec3, Vec3};
use bevy_mass_spring::solver::{
    self, Collider, Integrator, PairRules, PinnedMotion, Solver, StepSettings, SubstepMode,
};

use crate::common::reference::Reference;

/// The largest relative error of one f32 rounding.
const ROUNDING: f64 = f32::EPSILON as f64 / 2.0;

/// A pinned particle that is carried along, and two free ones on damped springs; one is pushed.
fn swinging_chain() -> Solver {
    let mut state = Solver::default();
    state.add_particle(Vec3::new(0.1, 2.0, -0.2), Vec3::ZERO, f32::INFINITY, 0.0).unwrap();
    state.add_particle(Vec3::new(0.7, 1.4, 0.1), Vec3::new(0.5, -1.0, 2.0), 2.0, 0.0).unwrap();
    state.add_particle(Vec3::new(1.3, 1.2, -0.5), Vec3::new(-1.5, 1.0, 0.5), 0.5, 0.0).unwrap();
    state.set_applied_force(2, Vec3::new(0.3, 0.2, -0.4));
    state
        .add_spring(
            [0, 1],
            solver::Spring { rest_length: 0.8, stiffness: 80.0, damping: 1.5, ..solver::Spring::default() },
        )
        .unwrap();
    state
        .add_spring(
            [2, 1],
            solver::Spring { rest_length: 0.6, stiffness: 60.0, damping: 0.7, ..solver::Spring::default() },
        )
        .unwrap();
    state
}

/// The motion of the pinned particle in each tick of `time_step` seconds.
fn carry_pinned(state: &mut Solver, time_step: f32) {
    let start = state.position(0);
    let target = start + Vec3::new(0.3, -0.1, 0.2) * time_step;
    state.inputs_mut().pinned = vec![PinnedMotion { slot: 0, start, target }];
}

/// The largest difference between the solver and the recurrence of `expected`, in a component of any
/// position or velocity relative to 1 + its size, over 200 ticks under `scheme`. The recurrence starts
/// each tick from the solver's state, so that nothing but the tick itself is compared.
fn deviation_from_recurrence(scheme: Integrator, expected: Integrator) -> f64 {
    let settings = StepSettings {
        integrator: scheme,
        substeps: SubstepMode::Fixed(3),
        time_step: 1.0 / 64.0,
        gravity: Vec3::new(0.0, -9.81, 0.0),
        viscosity: 0.3,
        ..StepSettings::default()
    };
    let mut state = swinging_chain();
    let (mut worst, mut carried) = (0.0_f64, None);
    for tick in 0..200 {
        carry_pinned(&mut state, settings.time_step);
        let mut reference = Reference::of(&state);
        let PinnedMotion { start, target, .. } = state.inputs_mut().pinned[0];
        reference.velocity[0] = (target - start).as_dvec3() / f64::from(settings.time_step);
        reference.gravity = settings.gravity.as_dvec3();
        reference.viscosity = settings.viscosity.into();
        reference.carried_acceleration = carried.take();
        for _ in 0..3 {
            reference.step(expected, f64::from(settings.time_step) / 3.0);
        }
        state.step(&settings);
        // TR-BDF2 begins a tick with the accelerations at the end of the one before.
        if scheme == Integrator::TrBdf2 && expected == scheme {
            carried = reference.carried_acceleration.take();
        }
        let Reference { position, velocity, .. } = &reference;
        for slot in 0..3 {
            let found = [state.position(slot), state.velocity(slot)];
            for (found, expected) in found.into_iter().zip([position[slot], velocity[slot]]) {
                // The derivation of the tolerance below counts on these sizes.
                assert!(expected.length() < 10.0, "{scheme:?}, tick {tick}: {expected}");
                let difference = (found.as_dvec3() - expected).abs() / (1.0 + expected.abs());
                worst = worst.max(difference.max_element());
            }
        }
    }
    worst
}

/// With u the error of a rounding: a length of about 1 m is known to 4 u, so a tension of stiffness
/// 80 N/m to 320 u, an acceleration (two springs, masses >= 0.5 kg, and |a| < 100 m/s² rounded a few
/// times) to 2000 u, a change of velocity h a with h = 1/192 s to 11 u. The velocity itself, below
/// 10 m/s, is rounded by 10 u. Three substeps make 63 u = 3.8e-6.
const RECURRENCE_TOLERANCE: f64 = 5e-6;

#[test]
fn every_scheme_follows_its_recurrence() {
    for scheme in Integrator::named() {
        let deviation = deviation_from_recurrence(scheme, scheme);
        assert!(deviation < RECURRENCE_TOLERANCE, "{scheme:?} deviates by {deviation:e}");
    }
}

/// The test above distinguishes the schemes: none follows the recurrence of another.
#[test]
fn no_scheme_follows_the_recurrence_of_another() {
    for scheme in Integrator::named() {
        for other in Integrator::named().filter(|other| *other != scheme) {
            let deviation = deviation_from_recurrence(scheme, other);
            assert!(deviation > 3.0 * RECURRENCE_TOLERANCE, "{scheme:?} as {other:?}: {deviation:e}");
        }
    }
}

/// A ball that bounces far away changes nothing of the chain, not even a rounding.
#[test]
fn a_contact_elsewhere_changes_nothing() {
    for scheme in Integrator::named() {
        let settings = StepSettings {
            integrator: scheme,
            substeps: SubstepMode::Fixed(5),
            gravity: Vec3::Y * -9.81,
            viscosity: 0.3,
            pair_rules: Some(PairRules::default()),
            ..StepSettings::default()
        };
        let (mut alone, mut both) = (swinging_chain(), swinging_chain());
        both.add_collider(Collider::half_space(Vec3::Y * -20.0, Vec3::Y, 0.8, 0.1));
        both.add_particle(Vec3::new(100.0, -19.8, 0.0), Vec3::Y * -3.0, 1.0, 0.1).unwrap();
        let mut contacts = 0;
        for tick in 0..100 {
            for state in [&mut alone, &mut both] {
                carry_pinned(state, settings.time_step);
                state.step(&settings);
            }
            contacts += both.outputs().contact_count;
            for slot in 0..3 {
                let of = |state: &Solver| (state.position(slot), state.velocity(slot));
                assert_eq!(of(&alone), of(&both), "{scheme:?}, tick {tick}, slot {slot}");
            }
        }
        assert!(contacts > 0, "{scheme:?}");
    }
}

/// ω of a spring of rest length 0 between a pinned particle and one of 1 kg on the x axis, 1/s: a harmonic oscillator,
/// x'' = −ω² x − γ x', with nothing but relative roundings.
const OMEGA: f64 = std::f64::consts::TAU;
/// γ of it, 1/s.
const GAMMA: f32 = 0.5;

/// The time that the oscillator runs, s. Not a whole period (1 s undamped): the errors of the
/// symplectic scheme cancel there.
const DURATION: f32 = 0.7;

/// The distance |(x, v/ω) − exact| after `steps` steps, having started at x = 1 m, at rest.
fn oscillator_error(scheme: Integrator, steps: u32, damping: f32) -> f64 {
    let mut state = Solver::default();
    state.add_particle(Vec3::ZERO, Vec3::ZERO, f32::INFINITY, 0.0).unwrap();
    state.add_particle(Vec3::X, Vec3::ZERO, 1.0, 0.0).unwrap();
    let stiffness = (OMEGA * OMEGA) as f32;
    state
        .add_spring(
            [0, 1],
            solver::Spring { rest_length: 0.0, stiffness, damping, ..solver::Spring::default() },
        )
        .unwrap();
    let settings = StepSettings {
        substeps: SubstepMode::Fixed(1),
        integrator: scheme,
        time_step: DURATION / steps as f32,
        ..StepSettings::default()
    };
    for _ in 0..steps {
        state.step(&settings);
    }
    // x = e^(−γt/2) (cos ωd t + γ/(2 ωd) sin ωd t) and v = −ω²/ωd e^(−γt/2) sin ωd t, with the
    // stiffness and the time that the solver was really given.
    let time = f64::from(settings.time_step) * f64::from(steps);
    let omega_squared = f64::from(stiffness);
    let gamma = f64::from(damping);
    let damped_omega = (omega_squared - gamma * gamma / 4.0).sqrt();
    let decay = (-gamma * time / 2.0).exp();
    let (sine, cosine) = (damped_omega * time).sin_cos();
    let position = decay * (cosine + gamma / (2.0 * damped_omega) * sine);
    let velocity = -omega_squared / damped_omega * decay * sine;
    let found = (state.position(1).as_dvec3(), state.velocity(1).as_dvec3());
    assert_eq!([found.0.y, found.0.z, found.1.y, found.1.z], [0.0; 4], "nothing leaves the axis");
    (found.0.x - position).hypot((found.1.x - velocity) / OMEGA)
}

/// The order observed when `steps` steps are doubled is log2 of the ratio of the errors.
///
/// An error C h^p (1 + D h + …) shows the order p + log2((1 + D h)/(1 + D h/2)), off by about
/// 0.72 D h; D h is a few times hω. Rounding adds at most 3 u a step to a state of size 1, which the
/// choice of steps keeps far below the truncation error (asserted).
fn assert_order(scheme: Integrator, order: f64, steps: u32, tolerance: f64) {
    assert_damped_order(scheme, order, (steps, GAMMA), tolerance);
}

fn assert_damped_order(scheme: Integrator, order: f64, (steps, damping): (u32, f32), tolerance: f64) {
    let [coarse, fine] = [steps, 2 * steps].map(|steps| oscillator_error(scheme, steps, damping));
    let rounding = 3.0 * ROUNDING * f64::from(2 * steps);
    assert!(fine > 20.0 * rounding, "{scheme:?}: the error {fine:e} is not above the rounding {rounding:e}");
    let observed = (coarse / fine).log2();
    assert!((observed - order).abs() < tolerance, "{scheme:?}: observed order {observed}");
}

#[test]
fn euler_and_taylor_schemes_are_of_first_order() {
    // hω = 0.017; amplitudes off by e^(hω²T/2) have D = ω²T/4: 0.014 in the order. Rounding spoils the
    // finer error by 5 % at most: 0.07 in the order.
    for scheme in [
        Integrator::ExplicitEuler,
        Integrator::SemiImplicitEuler,
        Integrator::SecondOrderTaylor,
        Integrator::ImplicitEuler,
        Integrator::Xpbd,
    ] {
        assert_order(scheme, 1.0, 256, 0.12);
    }
}

#[test]
fn velocity_verlet_is_of_second_order() {
    // hω = 0.14; without damping the next term is h² further on, with it D is about ζ ω = ω/25, which
    // makes 0.004 in the order; and rounding 0.07 as above.
    assert_order(Integrator::VelocityVerlet, 2.0, 32, 0.1);
}

#[test]
fn tr_bdf2_is_of_second_order() {
    // As above, with an error constant of 0.04. A damper by length is of no order where a spring of no rest length
    // passes through zero, so it is undamped here; the next test has dampers.
    assert_damped_order(Integrator::TrBdf2, 2.0, (32, 0.0), 0.1);
}

/// A damped strand that swings and oscillates, beside Runge–Kutta in f64 in 1/16 of the step (an error below 1e-8 m):
/// halving the step divides the error by 4. The error in 0.5 s is above 1e-4 m, its rounding below 64 · 1e-7 m.
#[test]
fn tr_bdf2_is_of_second_order_with_dampers_and_drag() {
    let error = |steps: u32| {
        let mut state = swinging_chain();
        let mut reference = Reference::of(&state);
        (reference.gravity, reference.viscosity) = (DVec3::Y * f64::from(-9.81_f32), f64::from(0.3_f32));
        let time_step = 0.5 / steps as f32;
        let settings = StepSettings {
            integrator: Integrator::TrBdf2,
            substeps: SubstepMode::Fixed(1),
            time_step,
            gravity: Vec3::Y * -9.81,
            viscosity: 0.3,
            ..StepSettings::default()
        };
        for _ in 0..steps {
            state.step(&settings);
            (0..16).for_each(|_| reference.step(Integrator::RungeKutta4, f64::from(time_step) / 16.0));
        }
        state.position(2).as_dvec3().distance(reference.position[2])
    };
    let (coarse, fine) = (error(32), error(64));
    assert!(fine > 1e-4 / 4.0, "{fine:e}");
    let observed = (coarse / fine).log2();
    assert!((observed - 2.0).abs() < 0.2, "observed order {observed}: {coarse:e}, {fine:e}");
}

#[test]
fn runge_kutta_is_of_fourth_order() {
    // hω = 0.55: the next term is of the size (hω)/6 · ζ + (hω)²/6 = 0.05, hence 0.04 in the order; and
    // rounding 0.07 as above.
    assert_order(Integrator::RungeKutta4, 4.0, 8, 0.12);
}

/// With h = 2⁻⁶ s and g = −157/16 m/s² every position of the fall is a multiple of 2⁻¹⁷ m below
/// 2⁷ m, and every velocity has few bits: the closed form is a float, and must come out to the bit.
#[test]
fn free_fall_is_exact() {
    const GRAVITY: f64 = -9.8125;
    for scheme in [Integrator::SecondOrderTaylor, Integrator::VelocityVerlet] {
        let settings = StepSettings {
            substeps: SubstepMode::Fixed(1),
            integrator: scheme,
            time_step: 1.0 / 64.0,
            gravity: Vec3::Y * GRAVITY as f32,
            ..StepSettings::default()
        };
        let mut state = Solver::default();
        state.add_particle(Vec3::new(3.0, 100.0, 0.0), Vec3::new(2.0, 1.5, -0.25), 0.7, 0.1).unwrap();
        for tick in 1..=288 {
            state.step(&settings);
            let time = f64::from(tick) / 64.0;
            let start = DVec3::new(3.0, 100.0, 0.0);
            let velocity = DVec3::new(2.0, 1.5, -0.25);
            let gravity = DVec3::Y * GRAVITY;
            let expected = start + velocity * time + gravity * time * time / 2.0;
            assert_eq!(state.position(0).as_dvec3(), expected, "{scheme:?}, tick {tick}");
            assert_eq!(state.velocity(0).as_dvec3(), velocity + gravity * time, "{scheme:?}");
        }
    }
}

/// With the real g nothing is a float any more, but a step of any length lands within two roundings:
/// one of the increment h v + h²/2 g (its parts are rounded too: three), one of the sum.
#[test]
fn one_taylor_step_of_any_length_is_as_exact_as_a_float() {
    for milliseconds in [1_u16, 7, 16, 100, 333, 1000, 2500] {
        let time_step = f32::from(milliseconds) / 1000.0;
        let gravity = Vec3::new(0.0, -9.81, 0.0);
        let settings = StepSettings {
            substeps: SubstepMode::Fixed(1),
            integrator: Integrator::SecondOrderTaylor,
            time_step,
            gravity,
            ..StepSettings::default()
        };
        let mut state = Solver::default();
        state.add_particle(Vec3::Y * 50.0, Vec3::Y * 3.0, 1.0, 0.0).unwrap();
        state.step(&settings);
        let (time, gravity) = (f64::from(time_step), f64::from(gravity.y));
        let expected = 50.0 + 3.0 * time + gravity * time * time / 2.0;
        let found = f64::from(state.position(0).y);
        let parts = 3.0 * time + gravity.abs() * time * time / 2.0;
        let tolerance = ROUNDING * (expected.abs() + 4.0 * parts);
        assert!((found - expected).abs() <= tolerance, "{milliseconds} ms: {found} instead of {expected}");
    }
}

/// Free fall does not depend on the mass, not even by a rounding.
#[test]
fn feather_and_hammer_fall_alike() {
    for scheme in Integrator::named() {
        let mut state = Solver::default();
        for mass in [0.003, 1.0, 1.32, 1e6] {
            state.add_particle(Vec3::Y * 10.0, Vec3::X, mass, 0.0).unwrap();
        }
        let settings = StepSettings {
            integrator: scheme,
            gravity: Vec3::Y * -9.81,
            substeps: SubstepMode::Fixed(3),
            ..StepSettings::default()
        };
        for _ in 0..100 {
            state.step(&settings);
            for slot in 1..4 {
                assert_eq!(state.position(slot), state.position(0), "{scheme:?}");
            }
        }
        assert!(state.position(0).y < 0.0);
    }
}
