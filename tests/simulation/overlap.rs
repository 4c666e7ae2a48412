//! Balls that springs pull into each other: when they collide, and that they gain no energy.

use bevy::math::Vec3;
use bevy::prelude::{Entity, World};
use bevy_mass_spring::prelude::{CollisionSettings, ParticleVelocity, Spring};
use bevy_mass_spring::solver::{self, Integrator, PairRules, Solver, StepSettings, SubstepMode};

use crate::common::bodies::{Ball, GRAVITY, floating, position, positions, velocities, velocity, world};
use crate::common::{self, app, join, plain, run, spawn};

/// The chain of `assets/scenes/chain.scene.ron` with other radii.
fn chain(radius: f32) -> Solver {
    let mut state = world((0..20_u16).map(|number| Ball {
        mass: if number == 0 { f32::INFINITY } else { 0.05 },
        radius,
        ..Ball::at(Vec3::Y * 3.0 + Vec3::new(0.08, -0.06, 0.0) * f32::from(number))
    }));
    for number in 1..20 {
        state
            .add_spring(
                [number - 1, number],
                solver::Spring {
                    rest_length: 0.1,
                    stiffness: 2000.0,
                    damping: 0.5,
                    ..solver::Spring::default()
                },
            )
            .unwrap();
    }
    state
}

/// A net of 10 by 10 balls without diagonal springs, `stretch` times as wide as at rest, held at two
/// corners: nothing but contacts keeps the diagonals of its meshes apart.
fn net(radius: f32, stretch: f32) -> Solver {
    let size = 10_usize;
    let mut state = world((0..size * size).map(|number| {
        let (row, column) = (number / size, number % size);
        Ball {
            mass: if row == 0 && column % (size - 1) == 0 { f32::INFINITY } else { 0.05 },
            radius,
            ..Ball::at(Vec3::new(column as f32, 0.0, row as f32) * 0.1 * stretch)
        }
    }));
    for number in 0..size * size {
        if number % size > 0 {
            state
                .add_spring(
                    [number - 1, number],
                    solver::Spring {
                        rest_length: 0.1,
                        stiffness: 1000.0,
                        damping: 0.5,
                        ..solver::Spring::default()
                    },
                )
                .unwrap();
        }
        if number >= size {
            state
                .add_spring(
                    [number - size, number],
                    solver::Spring {
                        rest_length: 0.1,
                        stiffness: 1000.0,
                        damping: 0.5,
                        ..solver::Spring::default()
                    },
                )
                .unwrap();
        }
    }
    state
}

/// Semi-implicit Euler with its automatic substeps, in air of 0.005 N·s/m.
fn automatic() -> StepSettings {
    StepSettings {
        integrator: Integrator::SemiImplicitEuler,
        substeps: SubstepMode::Auto,
        gravity: Vec3::NEG_Y * GRAVITY,
        viscosity: 0.005,
        pair_rules: Some(PairRules::default()),
        ..StepSettings::default()
    }
}

/// Runs 20 s of `state`. Its energy H may never exceed that of the start, apart from the oscillation of
/// the scheme: semi-implicit Euler conserves H + (h/2) v·F to its order. By Cauchy and Schwarz, v·F is
/// at most √(2 T) ω √(2 V) for the springs (T kinetic, V elastic energy; `Auto` keeps h ω <= 1) and
/// g √(2 T M) for the weight of the whole mass M.
///
/// Returns the mean kinetic energies of the first and of the last 5 s.
fn mean_kinetic_energies(mut state: Solver, case: &str) -> [f64; 2] {
    let settings = automatic();
    let substep = f64::from(settings.time_step) / f64::from(state.plan(&settings).substeps);
    let inverse_masses = (0..state.particle_count()).map(|slot| state.inverse_mass(slot));
    let mass: f64 =
        inverse_masses.filter(|inverse| *inverse > 0.0).map(|inverse| 1.0 / f64::from(inverse)).sum();
    let totals = |state: &Solver| {
        let totals = state.measure(settings.gravity);
        let sum = totals.kinetic_energy + totals.elastic_energy + totals.gravitational_energy;
        (sum, totals.kinetic_energy, totals.elastic_energy)
    };
    let (start, ..) = totals(&state);
    let mut kinetic_energies = Vec::new();
    for tick in 0..1200 {
        state.step(&settings);
        let (sum, kinetic, elastic) = totals(&state);
        let swapped =
            (kinetic * elastic).sqrt() + 0.5 * substep * f64::from(GRAVITY) * (2.0 * kinetic * mass).sqrt();
        // In f32 each of the sums of up to 100 J is known to 1e-5.
        assert!(sum < start + swapped + 1e-3, "{case}, tick {tick}: {sum} J after {start} J");
        kinetic_energies.push(kinetic);
    }
    [&kinetic_energies[..300], &kinetic_energies[900..]]
        .map(|energies| energies.iter().sum::<f64>() / energies.len() as f64)
}

/// Springs of 0.1 m: above a radius of 0.05 m neighbours overlap at rest, above 0.1 m the ones after.
#[test]
fn a_chain_of_any_radius_comes_to_rest() {
    for radius in [0.0, 0.04, 0.05, 0.06, 0.08, 0.1, 0.12, 0.15, 0.2] {
        let [early, late] = mean_kinetic_energies(chain(radius), &format!("chain of radius {radius}"));
        assert!(late < 0.5 * early, "radius {radius}: {early} J in the first 5 s, {late} J in the last");
    }
}

/// Above 0.07 m the diagonals of the meshes overlap too, which no spring joins.
#[test]
fn a_net_of_any_radius_comes_to_rest() {
    for radius in [0.0, 0.04, 0.06, 0.08, 0.1, 0.12, 0.15, 0.2] {
        let [early, late] = mean_kinetic_energies(net(radius, 1.0), &format!("net of radius {radius}"));
        assert!(late < 0.5 * early, "radius {radius}: {early} J in the first 5 s, {late} J in the last");
    }
}

/// Nothing overlaps at the start, but the springs press everything together, with up to 900 J.
#[test]
fn a_net_that_contracts_gains_no_energy() {
    for (radius, stretch) in [(0.06, 1.5), (0.08, 1.5), (0.08, 2.0), (0.09, 2.0)] {
        let case = format!("net of radius {radius}, stretched {stretch} times");
        let [early, late] = mean_kinetic_energies(net(radius, stretch), &case);
        assert!(late < early, "{case}: {early} J in the first 5 s, {late} J in the last");
    }
}

/// Two balls of radius 0.1 m, 0.3 m apart, that approach with 1 m/s each, joined by a spring.
fn joined_pair(rest_length: f32, radius: f32) -> Solver {
    let mut state = world([-1.0_f32, 1.0].map(|side| Ball {
        radius,
        velocity: Vec3::X * -side,
        ..Ball::at(Vec3::X * 0.15 * side)
    }));
    state
        .add_spring(
            [0, 1],
            solver::Spring { rest_length, stiffness: 100.0, damping: 0.0, ..solver::Spring::default() },
        )
        .unwrap();
    state
}

/// The closest that the centres come in 2 s.
fn closest(state: &mut Solver) -> f32 {
    let mut closest = f32::INFINITY;
    for _ in 0..120 {
        state.step(&floating(Integrator::SemiImplicitEuler, 0.0));
        closest = closest.min(position(state, 0).distance(position(state, 1)));
    }
    closest
}

#[test]
fn a_pair_collides_unless_its_spring_is_shorter() {
    for rest_length in [0.2, 0.25, 0.3] {
        let distance = closest(&mut joined_pair(rest_length, 0.1));
        assert!((distance - 0.2).abs() < 1e-6, "rest length {rest_length}: {distance} m apart");
    }
    for rest_length in [0.0, 0.1, 0.19] {
        // To the bit as if they had no radius.
        let (mut with, mut without) = (joined_pair(rest_length, 0.1), joined_pair(rest_length, 0.0));
        assert_eq!(closest(&mut with), closest(&mut without), "rest length {rest_length}");
        assert_eq!(velocities(&with), velocities(&without), "rest length {rest_length}");
    }
}

/// Two balls that overlap at first contact, each on a spring of its own: they stay, and collide once they
/// have separated.
#[test]
fn overlaps_held_by_springs_are_not_pushed_apart() {
    let anchor = |x: f32| Ball { mass: f32::INFINITY, radius: 0.0, ..Ball::at(Vec3::X * x) };
    let mut state = world([anchor(-1.0), anchor(1.0), Ball::at(Vec3::X * -0.05), Ball::at(Vec3::X * 0.05)]);
    state
        .add_spring(
            [0, 2],
            solver::Spring { rest_length: 0.95, stiffness: 100.0, damping: 5.0, ..solver::Spring::default() },
        )
        .unwrap();
    state
        .add_spring(
            [1, 3],
            solver::Spring { rest_length: 0.95, stiffness: 100.0, damping: 5.0, ..solver::Spring::default() },
        )
        .unwrap();
    let places = positions(&state);
    let settings = floating(Integrator::SemiImplicitEuler, 0.0);
    for _ in 0..60 {
        state.step(&settings);
    }
    assert_eq!(positions(&state), places, "the springs are at rest");

    state.set_velocity(3, Vec3::X * 3.0);
    let distance = |state: &Solver| position(state, 2).distance(position(state, 3));
    let (mut apart, mut contacts) = (false, 0);
    for _ in 0..300 {
        state.step(&settings);
        apart |= distance(&state) > 0.2;
        contacts += state.outputs().contact_count;
    }
    assert!(apart && contacts > 0, "{contacts} contacts");
    assert!(distance(&state) > 0.2 * 0.99, "{} m apart at the end", distance(&state));
    assert!(velocity(&state, 3).length() < 1e-3);
}

fn rest_length_becomes(world: &mut World, spring: Entity, rest_length: f32) {
    world.get_mut::<Spring>(spring).expect("the spring exists").rest_length = rest_length;
}

/// Whether a joined pair collides follows its rest length while the app runs.
#[test]
fn a_changed_rest_length_takes_effect() {
    let mut app = app();
    plain(&mut app);
    app.world_mut().resource_mut::<CollisionSettings>().particles = true;
    let balls = [-0.15, 0.15].map(|x| spawn(&mut app, 1.0, 0.1, Vec3::X * x));
    let spring =
        join(&mut app, Spring::new(balls[0], balls[1], 0.3).with_stiffness(100.0).with_damping(10.0));
    let closest = |app: &mut bevy::app::App| {
        for (ball, direction) in balls.into_iter().zip([Vec3::X, Vec3::NEG_X]) {
            let mut velocity = app.world_mut().get_mut::<ParticleVelocity>(ball).expect("the ball exists");
            velocity.0 = direction * 3.0;
        }
        let mut closest = f32::INFINITY;
        for _ in 0..128 {
            run(app, 1);
            closest = closest.min(common::position(app, balls[0]).distance(common::position(app, balls[1])));
        }
        closest
    };
    let colliding = closest(&mut app);
    assert!((colliding - 0.2).abs() < 1e-6, "{colliding} m apart");
    rest_length_becomes(app.world_mut(), spring, 0.19);
    assert!(closest(&mut app) < 0.15);
    // The spring drives them apart before the next throw.
    rest_length_becomes(app.world_mut(), spring, 0.3);
    run(&mut app, 128);
    let colliding = closest(&mut app);
    assert!((colliding - 0.2).abs() < 1e-6, "{colliding} m apart");
}
