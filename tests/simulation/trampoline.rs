//! Balls on stiff nets: a particle without springs is solved for together with the net that it meets.

use bevy::math::Vec3;
use bevy_mass_spring::solver::{self, PairRules, Solver, StepSettings};

const GRAVITY: f32 = 9.81;
const SIDE: usize = 9;
const SPACING: f32 = 0.08;
const MASS: f32 = 0.005;

/// A horizontal net held at its corners, and a ball above it; with `beside`, a soft pendulum far away, so that two
/// schemes share the tick.
fn trampoline(stiffness: f32, ball: f32, beside: bool) -> Solver {
    let mut state = Solver::default();
    let at = |i: usize, j: usize| Vec3::new(i as f32 - 4.0, 0.0, j as f32 - 4.0) * SPACING;
    for (i, j) in (0..SIDE).flat_map(|i| (0..SIDE).map(move |j| (i, j))) {
        let mass = if i % (SIDE - 1) == 0 && j % (SIDE - 1) == 0 { f32::INFINITY } else { MASS };
        state.add_particle(at(i, j), Vec3::ZERO, mass, 0.02).unwrap();
    }
    for (i, j) in (0..SIDE).flat_map(|i| (0..SIDE).map(move |j| (i, j))) {
        for (di, dj) in [(0, 1), (1, 0), (1, 1), (1, -1)] {
            let (k, l) = (i + di, j as isize + dj);
            if k < SIDE && (0..SIDE as isize).contains(&l) {
                let l = l as usize;
                let rest_length = at(i, j).distance(at(k, l));
                let spring = solver::Spring { rest_length, stiffness, ..Default::default() };
                state.add_spring([i * SIDE + j, k * SIDE + l], spring).unwrap();
            }
        }
    }
    state.add_particle(Vec3::new(0.01, 0.5, 0.02), Vec3::ZERO, ball, 0.1).unwrap();
    if beside {
        let anchor = state.add_particle(Vec3::X * 50.0, Vec3::ZERO, f32::INFINITY, 0.0).unwrap();
        let bob = state.add_particle(Vec3::X * 51.0, Vec3::ZERO, 1.0, 0.0).unwrap();
        let spring = solver::Spring { rest_length: 1.0, stiffness: 1000.0, ..Default::default() };
        state.add_spring([anchor, bob], spring).unwrap();
    }
    state
}

/// The ball and the net never have more energy than the ball brought, and the ball comes to lie on it: its corners carry
/// all of the weight, and the contacts that of the ball.
#[test]
fn a_ball_lies_on_a_stiff_net() {
    for (stiffness, ball) in [(1e6, 0.1), (1e6, 10.0), (1e8, 1.0), (1e9, 1.0)] {
        for beside in [false, true] {
            let mut state = trampoline(stiffness, ball, beside);
            let settings = StepSettings {
                gravity: Vec3::NEG_Y * GRAVITY,
                pair_rules: Some(PairRules { restitution: 0.0, friction: 0.5 }),
                ..StepSettings::default()
            };
            let label = format!("{stiffness:e} N/m, {ball} kg, beside {beside}");
            let before = state.measure(settings.gravity).total_energy();
            for tick in 0..400 {
                let plan = state.step(&settings).plan;
                assert_eq!(plan.stiff_substeps > 0, beside, "{label}");
                let now = state.measure(settings.gravity);
                // The soft pendulum wavers by some parts in a thousand of its 10 J.
                let allowed = before + 1e-3 * before.abs() + if beside { 0.1 } else { 0.0 };
                assert!(now.total_energy() < allowed, "{label}, tick {tick}: {now:?}, before {before}");
            }
            let number = SIDE * SIDE;
            let (place, speed) = (state.position(number), state.velocity(number).length());
            assert!(place.y > -0.1 && place.y < 0.12 && speed < 0.02, "{label}: {place}, {speed} m/s");
            state.outputs_mut().record_contacts = true;
            let mut impulse = 0.0;
            for _ in 0..10 {
                for contact in &state.step(&settings).contacts {
                    let is_ball =
                        contact.slot == number || contact.other == solver::ContactPartner::Particle(number);
                    impulse += if is_ball { (contact.impulse * contact.normal.y).abs() } else { 0.0 };
                }
            }
            let carried = impulse / (10.0 * settings.time_step * ball * GRAVITY);
            assert!((carried - 1.0).abs() < 0.05, "{label}: {carried} of its weight");
        }
    }
}
