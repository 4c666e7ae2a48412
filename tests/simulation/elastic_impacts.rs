//! Elastic impacts, 1,000 in a row: energy and momentum.

use bevy::math::Vec3;
use bevy_mass_spring::solver::{Integrator, Shape, Solver, Spring, StepSettings, SubstepMode};

use crate::common::bodies::{Ball, floating, velocities, velocity, with_ground, world};
use crate::common::shapes::{resting, with};

const IMPACTS: usize = 1000;
const SPEED: f32 = 9.0;

/// Between two walls. The speed is kept to 0.5 %, and so the energy to 1 %; and what a tick changes of the momentum is what
/// the walls have given, as the contacts say.
#[test]
fn a_thousand_impacts_on_walls_keep_the_energy() {
    for scheme in Integrator::named() {
        let mut state = world([Ball { velocity: Vec3::X * SPEED, ..Ball::at(Vec3::ZERO) }]);
        for side in [-1.0, 1.0] {
            let wall = resting(Shape::cuboid(Vec3::new(0.1, 1.0, 1.0)), Vec3::X * side * 0.4);
            state.add_collider(with(wall, 1.0, 0.0));
        }
        state.outputs_mut().record_contacts = true;
        let mut impacts = 0;
        while impacts < IMPACTS {
            let before = velocity(&state, 0);
            state.step(&floating(scheme, 1.0));
            let struck = state.outputs().contacts.iter().filter(|contact| contact.impulse > 0.0);
            let given: Vec3 = struck.clone().map(|contact| contact.normal * contact.impulse).sum();
            impacts += struck.count();
            // Of 1 kg at 9 m/s, which turns round.
            let lost = (velocity(&state, 0) - before - given).length();
            assert!(lost < 1e-5 * 2.0 * SPEED, "{scheme:?}, impact {impacts}: {lost} kg·m/s");
        }
        let speed = velocity(&state, 0).length();
        assert!((speed / SPEED - 1.0).abs() < 0.005, "{scheme:?}: {speed} m/s");
    }
}

fn energy(state: &Solver) -> f32 {
    velocities(state).iter().map(|velocity| 0.5 * velocity.length_squared()).sum()
}

/// One ball in empty space strikes the next, which strikes the next, and so on: equal masses exchange their velocities. All
/// of the momentum and of the energy is in the last one at the end. A ball flies 3.75 cm in a substep and 5 cm from one to
/// the next.
#[test]
fn a_thousand_impacts_in_a_row_hand_on_momentum_and_energy() {
    for scheme in Integrator::named() {
        let balls = (0..=IMPACTS).map(|number| Ball {
            radius: 0.05,
            velocity: if number == 0 { Vec3::X * SPEED } else { Vec3::ZERO },
            ..Ball::at(Vec3::X * 0.15 * number as f32)
        });
        let mut state = world(balls);
        let settings = StepSettings { substeps: SubstepMode::Fixed(4), ..floating(scheme, 1.0) };
        let start = energy(&state);
        // A ball that strikes another one within a substep waits there for the next one: by half of it on average, 40 % of
        // the time between two impacts.
        let least_ticks = (IMPACTS as f32 * 0.05 / SPEED * 60.0) as u32;
        for tick in 0..2 * least_ticks {
            state.step(&settings);
            if velocity(&state, IMPACTS) != Vec3::ZERO {
                break;
            }
            let momentum: Vec3 = velocities(&state).iter().sum();
            let lost = (momentum - Vec3::X * SPEED).length();
            assert!(lost < 1e-5 * SPEED, "{scheme:?}, tick {tick}: {lost} kg·m/s");
            let kept = energy(&state) / start;
            assert!(
                (kept - 1.0).abs() < 0.01,
                "{scheme:?}, tick {tick}: the energy is {kept} of what it was"
            );
        }
        // Nothing is left behind.
        let last = velocity(&state, IMPACTS).x;
        assert!((last / SPEED - 1.0).abs() < 0.005, "{scheme:?}: {last} m/s");
    }
}

/// What a ball is pressed onto by its spring.
#[derive(Debug, Clone, Copy)]
enum Onto {
    HalfSpace,
    Cuboid,
    PinnedBall,
    /// Another one, which its own spring presses the other way.
    Ball,
}

/// A ball of radius 0.1 m and 1 kg, 0.6 m above what it is pressed onto, which it touches at y = 0.1 m, on a spring without which it would rest
/// at y = `rest`, m.
fn pressed(onto: Onto, rest: f32, stiffness: f32, restitution: f32) -> Solver {
    let ball = |y: f32, mass: f32| Ball { mass, radius: 0.1, ..Ball::at(Vec3::Y * y) };
    let anchor = |y: f32| Ball { mass: f32::INFINITY, radius: 0.0, ..Ball::at(Vec3::Y * y) };
    let mut balls = vec![ball(0.7, 1.0), anchor(-3.0)];
    match onto {
        Onto::HalfSpace | Onto::Cuboid => {}
        Onto::PinnedBall => balls.push(ball(-0.1, f32::INFINITY)),
        Onto::Ball => balls.extend([ball(-0.7, 1.0), anchor(3.0)]),
    }
    let mut state = world(balls);
    let spring = Spring::elastic(3.0 + rest, stiffness, 0.0);
    state.add_spring([0, 1], spring).unwrap();
    match onto {
        Onto::HalfSpace => state = with_ground(state, restitution, 0.0),
        Onto::Cuboid => {
            let floor = resting(Shape::cuboid(Vec3::new(1.0, 0.1, 1.0)), Vec3::NEG_Y * 0.1);
            state.add_collider(with(floor, restitution, 0.0));
        }
        Onto::PinnedBall => {}
        Onto::Ball => state.add_spring([2, 3], spring).map(drop).unwrap(),
    }
    state
}

/// hω = 0.2 to 0.9 of the spring. The energy that semi-implicit Euler conserves differs from the true one by ± hω/2, so that it shows at most
/// (1 + hω/2) / (1 − hω/2) of it, that of Verlet lies below it by (hω/2)² of its elastic part, and a tenth is for where in a substep the
/// impacts are. Runge–Kutta 4 loses (hω)⁶/72 a step; a hundredth is for that its last evaluation is where it nearly ends.
#[test]
fn what_springs_press_onto_something_gains_no_energy() {
    let all = [Onto::HalfSpace, Onto::Cuboid, Onto::PinnedBall, Onto::Ball];
    for scheme in [Integrator::SemiImplicitEuler, Integrator::VelocityVerlet, Integrator::RungeKutta4] {
        for onto in all {
            for share in [0.2, 0.5, 0.9_f32] {
                for (rest, restitution) in [(-1.0, 1.0), (-0.2, 1.0), (0.3, 1.0), (-1.0, 0.8_f32)] {
                    let mut state = pressed(onto, rest, (60.0 * share).powi(2), restitution);
                    let energy = |state: &Solver| {
                        let now = state.measure(Vec3::ZERO);
                        now.kinetic_energy + now.elastic_energy
                    };
                    let start = energy(&state);
                    let half = 0.5 * f64::from(share);
                    let limit = match scheme {
                        Integrator::SemiImplicitEuler => 1.1 * (1.0 + half) / (1.0 - half),
                        Integrator::VelocityVerlet => 1.1 / (1.0 - half * half),
                        _ => 1.01,
                    };
                    for tick in 0..600 {
                        state.step(&floating(scheme, restitution));
                        let part = energy(&state) / start;
                        let case = format!("{scheme}, {onto:?}, hω {share}, rest {rest}, ε {restitution}");
                        assert!(part < limit, "{case}, tick {tick}: {part}");
                    }
                }
            }
        }
    }
}
