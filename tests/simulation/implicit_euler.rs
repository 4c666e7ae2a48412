//! What backward Euler is for: stiff springs, large ratios of masses, one step a tick.

use bevy::math::{DVec3, Vec3};
use bevy_mass_spring::solver::{self, Integrator, Solver, StepSettings, SubstepMode};

use crate::common::reference::Reference;

const GRAVITY: f64 = 9.81;

/// One step of 1/60 s a tick, under gravity.
fn settings() -> StepSettings {
    StepSettings {
        substeps: SubstepMode::Fixed(1),
        integrator: Integrator::ImplicitEuler,
        gravity: Vec3::NEG_Y * GRAVITY as f32,
        ..StepSettings::default()
    }
}

/// `links` springs of 0.1 m and `stiffness` (which depends on their number), from a pinned particle at
/// the origin along `direction`; particles of `mass`.
fn chain(links: usize, direction: Vec3, mass: f32, stiffness: impl Fn(usize) -> f32) -> Solver {
    let mut state = Solver::default();
    state.add_particle(Vec3::ZERO, Vec3::ZERO, f32::INFINITY, 0.0).unwrap();
    for link in 0..links {
        state.add_particle(direction * 0.1 * (link + 1) as f32, Vec3::ZERO, mass, 0.0).unwrap();
        state
            .add_spring(
                [link, link + 1],
                solver::Spring {
                    rest_length: 0.1,
                    stiffness: stiffness(link),
                    damping: 0.0,
                    ..solver::Spring::default()
                },
            )
            .unwrap();
    }
    state
}

fn run(state: &mut Solver, settings: &StepSettings, ticks: u32) {
    for _ in 0..ticks {
        state.step(settings);
    }
}

fn position(state: &Solver, slot: usize) -> DVec3 {
    state.position(slot).as_dvec3()
}

/// The pull of spring `index` on its second end, N.
fn tension(state: &Solver, index: usize) -> DVec3 {
    let ([first, second], spring) = state.spring(index);
    let separation = position(state, first) - position(state, second);
    let elongation = separation.length() - f64::from(spring.rest_length);
    separation.normalize() * f64::from(spring.stiffness) * elongation
}

/// XPBD (2016) needs 1,000 iterations for an error of 0.5 %.
#[test]
fn every_link_of_a_settled_chain_carries_what_hangs_below() {
    let mut state = chain(20, Vec3::NEG_Y, 1.0, |_| 1e5);
    run(&mut state, &settings(), 600);
    let weight = 20.0 * GRAVITY;
    for link in 0..20 {
        let below = (20 - link) as f64 * GRAVITY;
        // Positions of 2 m are rounded by 1.2e-7 m, two of them by 0.024 N: 0.012 % of the weight.
        let error = (tension(&state, link).y - below).abs() / weight;
        assert!(error < 2e-4, "link {link}: {error}");
    }
}

/// *Small Steps in Physics Simulation* (2019): 1 kg links that carry 100,000 kg.
fn heavy_chain(direction: Vec3) -> Solver {
    let mut state = chain(20, direction, 1.0, |_| 1e9);
    state.set_mass(20, 1e5).unwrap();
    state
}

#[test]
fn light_links_carry_a_hundred_tons() {
    let mut state = heavy_chain(Vec3::NEG_Y);
    run(&mut state, &settings(), 300);
    // Each link stretches by (10⁵ kg and what is below) g / k = 0.981 mm and a little.
    let equilibrium = -2.0 - 20.0 * 1e5 * GRAVITY / 1e9 - 190.0 * GRAVITY / 1e9;
    assert!((position(&state, 20).y - equilibrium).abs() < 0.03, "{}", position(&state, 20));
}

/// Released from horizontal, the chain is a pendulum, whose quarter period is K(1/√2) √(L/g) = 0.837 s
/// with Legendre's K(1/√2) = 1.854075.
#[test]
fn a_hundred_tons_swing_as_a_pendulum() {
    let mut state = heavy_chain(Vec3::X);
    let (mut lowest, mut time) = (0.0, 0.0);
    for tick in 1..=70 {
        state.step(&settings());
        if position(&state, 20).y < lowest {
            (lowest, time) = (position(&state, 20).y, f64::from(tick) / 60.0);
        }
    }
    let expected = 1.854_075 * (2.0 / GRAVITY).sqrt();
    assert!((time / expected - 1.0).abs() < 0.03, "{time} s");
    assert!((lowest / -2.0 - 1.0).abs() < 0.03, "{lowest} m");
}

#[test]
fn a_stiff_strand_does_not_stretch() {
    let mut state = chain(20, Vec3::X, 0.1, |_| 1e8);
    state.set_mass(20, 1e3).unwrap();
    for tick in 1..=600 {
        state.step(&settings());
        let stretch = state.measure(Vec3::ZERO).max_stretch;
        assert!(stretch < 0.02, "tick {tick}: {stretch}");
    }
}

/// A strand of springs of 10⁴ and 10⁸ N/m by turns between two anchors.
#[test]
fn soft_and_stiff_links_share_one_horizontal_tension() {
    let mut state = chain(20, Vec3::X, 100.0, |link| [1e4, 1e8][link % 2]);
    state.set_mass(20, f32::INFINITY).unwrap();
    run(&mut state, &settings(), 3600);
    let pull = |link| tension(&state, link).x.abs();
    let mean = (0..20).map(pull).sum::<f64>() / 20.0;
    // The weight of 1,900 kg makes kilonewtons; a rounding of two positions makes 24 N at most.
    assert!(mean > 1250.0, "{mean} N");
    for link in 0..20 {
        assert!((pull(link) / mean - 1.0).abs() < 0.02, "link {link}: {} N of {mean} N", pull(link));
    }
}

/// A square net in the plane z = 0, `size` particles wide, 0.1 m apart, with diagonals.
fn net(size: usize, mass: f32, stiffness: f32, damping: f32) -> Solver {
    let mut state = Solver::default();
    for slot in 0..size * size {
        let place = Vec3::new((slot % size) as f32, (slot / size) as f32, 0.0);
        state.add_particle(0.1 * place, Vec3::ZERO, mass, 0.0).unwrap();
    }
    for slot in 0..size * size {
        let (x, y) = (slot % size, slot / size);
        let mut join = |other: usize, length: f32| {
            state
                .add_spring(
                    [slot, other],
                    solver::Spring { rest_length: length, stiffness, damping, ..solver::Spring::default() },
                )
                .unwrap()
        };
        if x + 1 < size {
            join(slot + 1, 0.1);
        }
        if y + 1 < size {
            join(slot + size, 0.1);
        }
        if x + 1 < size && y + 1 < size {
            join(slot + size + 1, 0.02_f32.sqrt());
        }
        if x > 0 && y + 1 < size {
            join(slot + size - 1, 0.02_f32.sqrt());
        }
    }
    state
}

/// Moves the particles apart pseudo-randomly.
fn shake(state: &mut Solver, speed: f32) {
    for slot in 0..state.particle_count() {
        let phase = slot as f32;
        let velocity = Vec3::new((3.7 * phase).sin(), (5.1 * phase).cos(), (2.3 * phase + 1.0).sin());
        state.set_velocity(slot, velocity * speed);
    }
}

/// A net is solved by conjugate gradients, which stop early; what they leave moves no particle by more
/// than a thousandth of the step.
#[test]
fn a_net_follows_the_equations_to_a_thousandth_of_the_step() {
    for stiffness in [1e3, 1e5] {
        let mut state = net(4, 0.05, stiffness, 0.5);
        state.set_mass(12, f32::INFINITY).unwrap();
        shake(&mut state, 0.3);
        state.set_velocity(12, Vec3::ZERO);
        for tick in 0..40 {
            let mut reference = Reference::of(&state);
            reference.gravity = DVec3::NEG_Y * GRAVITY as f32 as f64;
            let start = reference.position.clone();
            reference.step(Integrator::ImplicitEuler, f64::from(settings().time_step));
            state.step(&settings());
            let square = |vectors: Vec<DVec3>| vectors.iter().map(|v| v.length_squared()).sum::<f64>();
            let slots = 0..16;
            let step = square(slots.clone().map(|slot| reference.position[slot] - start[slot]).collect());
            let error = square(slots.map(|slot| position(&state, slot) - reference.position[slot]).collect());
            // Positions below 1 m are rounded by 3e-8 m.
            let tolerance = 1e-3 * step.sqrt() + 4.0 * 3e-8;
            assert!(error.sqrt() < tolerance, "{stiffness:e} N/m, tick {tick}: {:e}", (error / step).sqrt());
        }
    }
}

#[test]
fn a_free_stiff_net_keeps_its_momentum() {
    let mut state = net(10, 0.01, 1e7, 0.0);
    shake(&mut state, 2.0);
    let settings = StepSettings { gravity: Vec3::ZERO, ..settings() };
    let start = state.measure(Vec3::ZERO).momentum;
    let scale: f64 = (0..100).map(|slot| 0.01 * state.velocity(slot).as_dvec3().length()).sum();
    run(&mut state, &settings, 600);
    let drift = (state.measure(Vec3::ZERO).momentum - start).length();
    // Each velocity is rounded in each step: 600 · u of the speeds.
    assert!(drift < 600.0 * 6e-8 * scale, "{drift:e} of {scale}");
}

/// Nothing is NaN where a spring has no direction, or rest length 0.
#[test]
fn coincident_particles_and_springs_of_no_length() {
    for rest_length in [0.0, 0.1] {
        let mut state = Solver::default();
        state.add_particle(Vec3::ZERO, Vec3::ZERO, f32::INFINITY, 0.0).unwrap();
        state.add_particle(Vec3::ZERO, Vec3::ZERO, 1.0, 0.0).unwrap();
        state.add_particle(Vec3::ZERO, Vec3::ZERO, 1.0, 0.0).unwrap();
        for (first, second) in [(0, 1), (1, 2), (2, 0)] {
            state
                .add_spring(
                    [first, second],
                    solver::Spring {
                        rest_length,
                        stiffness: 1e6,
                        damping: 10.0,
                        ..solver::Spring::default()
                    },
                )
                .unwrap();
        }
        let still = StepSettings { gravity: Vec3::ZERO, ..settings() };
        run(&mut state, &still, 3);
        let has_moved = position(&state, 1) != DVec3::ZERO;
        assert_eq!(has_moved, rest_length > 0.0, "a rest length parts its ends, in whatever direction");
        run(&mut state, &settings(), 200);
        for slot in 0..3 {
            assert!(position(&state, slot).length() < 0.2, "{}", position(&state, slot));
        }
    }
}

/// What `Auto` runs.
fn automatic(time_step: f32) -> StepSettings {
    StepSettings { integrator: Integrator::Auto, substeps: SubstepMode::Auto, time_step, ..settings() }
}

/// An undamped sheet, held at two corners, falls from horizontal for 6 s: it never has more energy than
/// at the start but by 0.01 J for each newton of its weight, the height of a centimetre.
fn sheet_gains_no_energy(stiffness: f32, time_step: f32) {
    let mut state = net(25, 0.01, stiffness, 0.0);
    for slot in 0..625 {
        let Vec3 { x, y, .. } = state.position(slot);
        state.set_position(slot, Vec3::new(x, 0.0, y));
    }
    state.set_mass(0, f32::INFINITY).unwrap();
    state.set_mass(24, f32::INFINITY).unwrap();
    let settings = automatic(time_step);
    let total = |state: &Solver| {
        let totals = state.measure(settings.gravity);
        totals.kinetic_energy + totals.elastic_energy + totals.gravitational_energy
    };
    let start = total(&state);
    let weight = 623.0 * 0.01 * GRAVITY;
    for tick in 1..=(6.0 / time_step) as u32 {
        state.step(&settings);
        let gain = total(&state) - start;
        assert!(gain < 0.01 * weight, "{stiffness:e} N/m, {settings:?}, tick {tick}: {gain} J");
    }
}

#[test]
#[cfg_attr(debug_assertions, ignore = "takes minutes unoptimised")]
fn a_sheet_gains_no_energy_whatever_its_stiffness() {
    for stiffness in [1e2, 1e4, 1e8] {
        for time_step in [1.0 / 60.0, 1.0 / 30.0] {
            sheet_gains_no_energy(stiffness, time_step);
        }
    }
}

/// The stiffnesses between, which take longer.
#[test]
#[ignore = "takes a minute"]
fn a_sheet_gains_no_energy_at_any_stiffness() {
    for stiffness in [1e3, 1e5, 1e6, 1e7] {
        for time_step in [1.0 / 60.0, 1.0 / 30.0] {
            sheet_gains_no_energy(stiffness, time_step);
        }
    }
}

/// A soft undamped pendulum, that swings from 60° and stretches by a fifth, keeps its energy.
#[test]
fn a_soft_pendulum_keeps_its_energy() {
    let mut state = Solver::default();
    state.add_particle(Vec3::ZERO, Vec3::ZERO, f32::INFINITY, 0.0).unwrap();
    state.add_particle(Vec3::new(0.75_f32.sqrt(), -0.5, 0.0), Vec3::ZERO, 1.0, 0.0).unwrap();
    state
        .add_spring(
            [0, 1],
            solver::Spring { rest_length: 1.0, stiffness: 50.0, damping: 0.0, ..solver::Spring::default() },
        )
        .unwrap();
    let settings = automatic(1.0 / 60.0);
    let total = |state: &Solver| {
        let totals = state.measure(settings.gravity);
        totals.kinetic_energy + totals.elastic_energy + totals.gravitational_energy
    };
    // What it may lose: from the start down to hanging at rest, stretched by mg/k.
    let start = total(&state);
    let rest = -GRAVITY - 0.5 * GRAVITY * GRAVITY / 50.0;
    for tick in 1..=1200 {
        state.step(&settings);
        // The energy of a symplectic scheme oscillates; it must not drift.
        let lost = (start - total(&state)) / (start - rest);
        assert!(lost.abs() < 0.05, "tick {tick}: {lost}");
    }
}
