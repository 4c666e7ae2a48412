//! What is fast does not pass through other particles, under any scheme.

use bevy::math::Vec3;
use bevy_mass_spring::solver::{Integrator, PairRules, Solver, Spring, StepSettings, SubstepMode};

use crate::common::bodies::{
    Ball, floating, positions, solver_bits, step_past_contact, velocities, velocity, world,
};

/// Balls of 5 cm and 1 kg.
fn small(position: Vec3, velocity: Vec3) -> Ball {
    Ball { radius: 0.05, velocity, ..Ball::at(position) }
}

fn momentum(state: &Solver) -> Vec3 {
    velocities(state).into_iter().sum()
}

fn kinetic_energy(state: &Solver) -> f32 {
    velocities(state).iter().map(|velocity| 0.5 * velocity.length_squared()).sum()
}

/// The closed form of an impact: equal masses exchange velocities for ε = 1, and share them for ε = 0. At the moment of
/// the impact they are put 1e-4 of their distance into each other; the velocities are computed from ones of up to
/// 1,000 m/s in some roundings of 6e-8 each.
#[test]
fn head_on_impacts_are_exact_at_any_speed() {
    for scheme in Integrator::named() {
        for substeps in [1, 4] {
            for speed in [20.0, 100.0, 1000.0_f32] {
                for restitution in [0.0_f32, 0.5, 1.0] {
                    let settings = StepSettings {
                        substeps: SubstepMode::Fixed(substeps),
                        ..floating(scheme, restitution)
                    };
                    let ball = small(Vec3::X * -0.37 * speed / 100.0 - Vec3::X, Vec3::X * speed);
                    let mut state = world([ball, small(Vec3::ZERO, Vec3::ZERO)]);
                    step_past_contact(&mut state, &settings, 100);
                    let case =
                        format!("{scheme}, {substeps} substeps, {speed} m/s, restitution {restitution}");
                    let expected =
                        [0.5 * (1.0 - restitution), 0.5 * (1.0 + restitution)].map(|part| part * speed);
                    for (slot, expected) in expected.into_iter().enumerate() {
                        let error = (velocity(&state, slot) - Vec3::X * expected).length();
                        assert!(error < 1e-5 * speed, "{case}: {:?}", velocities(&state));
                    }
                    let places = positions(&state);
                    assert!(places[0].x < places[1].x, "{case}: {places:?}");
                }
            }
        }
    }
}

/// With the offset b of their lines the normal is at the angle φ to the motion, sin φ = b / 2r: of equal masses and
/// ε = 1 the moving one keeps v sin φ across the normal, the other one gets v cos φ along it.
#[test]
fn oblique_impacts_are_those_of_the_moment_at_which_they_touch() {
    for offset in [0.0, 0.03, 0.06, 0.08_f32] {
        let mut state =
            world([small(Vec3::new(-7.3, offset, 0.0), Vec3::X * 300.0), small(Vec3::ZERO, Vec3::ZERO)]);
        step_past_contact(&mut state, &floating(Integrator::SemiImplicitEuler, 1.0), 10);
        // The depth of 1e-4 at which the normal is taken turns it by that part of tan φ, 1.3 at most.
        let (sin, cos) = (offset / 0.1, (1.0 - (offset / 0.1).powi(2)).sqrt());
        let struck = Vec3::new(cos, -sin, 0.0) * cos * 300.0;
        assert!((velocity(&state, 1) - struck).length() < 1e-3 * 300.0, "{offset}: {:?}", velocities(&state));
        assert!((momentum(&state) - Vec3::X * 300.0).length() < 1e-3);
        // The depth is projected away, which keeps angular momentum and so turns the velocities a little.
        assert!((kinetic_energy(&state) / 45_000.0 - 1.0).abs() < 1e-3, "{offset}");
    }
}

/// Against what is pinned, and what is pinned against it.
#[test]
fn pinned_particles_stop_or_push_what_is_fast() {
    for scheme in Integrator::named() {
        for restitution in [0.0_f32, 1.0] {
            let pinned = Ball { mass: f32::INFINITY, ..small(Vec3::ZERO, Vec3::ZERO) };
            let mut state = world([pinned, small(Vec3::X * -3.0, Vec3::X * 1000.0)]);
            for _ in 0..3 {
                state.step(&floating(scheme, restitution));
            }
            let speed = velocity(&state, 1).x;
            assert!((speed + 1000.0 * restitution).abs() < 0.1, "{scheme}, {restitution}: {speed} m/s");
            assert!(positions(&state)[1].x < -0.099, "{scheme}: {:?}", positions(&state));
        }
    }
    // A bat of 240 m/s: the ball is never behind it.
    let bat = Ball { mass: f32::INFINITY, ..small(Vec3::X * -1.0, Vec3::ZERO) };
    let mut state = world([bat, small(Vec3::ZERO, Vec3::ZERO)]);
    let settings =
        StepSettings { substeps: SubstepMode::Fixed(2), ..floating(Integrator::VelocityVerlet, 0.0) };
    for _ in 0..5 {
        state.move_pinned(0, state.position(0) + Vec3::X * 4.0);
        state.step(&settings);
        let places = positions(&state);
        assert!(places[1].x > places[0].x, "{places:?}");
    }
    assert!((velocity(&state, 1).x - 240.0).abs() < 1.0, "{:?}", velocities(&state));
}

/// Two dumbbells: a ball of the first, all of which moves along x, hits one of the second, which stands still, free or pinned, and passes
/// by the other. The springs of k = 0.1 N/m are across the way, so that balls of m = 1 kg get the velocities of a free impact but for
/// what the springs give in four ticks, T = 1/15 s, at the end of which they are v T longer: k T² / m = 0.05 % of the speed at most. Three
/// ticks more are for implicit steps, which spread an impact over two, and whose contacts are 1,000 times as stiff as the inertia: they
/// miss 0.1 % of a change of velocity of up to twice the speed. Momentum is kept to the roundings of 28 steps.
#[test]
fn what_springs_pull_at_is_hit_at_any_speed() {
    for scheme in Integrator::named() {
        for (substeps, is_pinned) in [(1, false), (4, false), (1, true), (2, true)] {
            for (speed, restitution) in
                [(20.0, 0.0), (20.0, 1.0), (100.0, 0.0), (1000.0, 1.0_f32), (1000.0, 0.0)]
            {
                let start = -Vec3::X * (0.37 * speed / 100.0 + 1.0);
                let mass = if is_pinned { f32::INFINITY } else { 1.0 };
                let mut state = world([
                    small(start, Vec3::X * speed),
                    small(start + Vec3::Z, Vec3::X * speed),
                    Ball { mass, ..small(Vec3::ZERO, Vec3::ZERO) },
                    small(Vec3::Y, Vec3::ZERO),
                ]);
                for ends in [[0, 1], [2, 3]] {
                    state.add_spring(ends, Spring::elastic(1.0, 0.1, 0.0)).unwrap();
                }
                let settings =
                    StepSettings { substeps: SubstepMode::Fixed(substeps), ..floating(scheme, restitution) };
                step_past_contact(&mut state, &settings, 100);
                for _ in 0..3 {
                    state.step(&settings);
                }
                let case = format!(
                    "{scheme}, {substeps} substeps, {speed} m/s, restitution {restitution}, pinned {is_pinned}"
                );
                let shares = match is_pinned {
                    true => [-restitution, 1.0, 0.0, 0.0],
                    false => [0.5 * (1.0 - restitution), 1.0, 0.5 * (1.0 + restitution), 0.0],
                };
                for (slot, share) in shares.into_iter().enumerate() {
                    let error = (velocity(&state, slot) - Vec3::X * share * speed).length();
                    assert!(error < 0.0025 * speed, "{case}: {:?}", velocities(&state));
                }
                if !is_pinned {
                    assert!((momentum(&state) - 2.0 * Vec3::X * speed).length() < 1e-5 * speed, "{case}");
                }
                let places = positions(&state);
                assert!(places[0].x < places[2].x, "{case}: {places:?}");
            }
        }
    }
}

/// Dumbbells that cross each other's ways at up to 250 m/s. With hω = 0.12 of their springs the energy that semi-implicit Euler shows
/// wavers by (1 + hω/2) / (1 − hω/2), 13 %, that of the others by less than its square.
#[test]
fn fast_dumbbells_gain_no_energy() {
    for scheme in [Integrator::SemiImplicitEuler, Integrator::VelocityVerlet, Integrator::RungeKutta4] {
        for restitution in [0.0, 1.0_f32] {
            let mut state = world(scattered().take(160));
            for first in (0..160).step_by(2) {
                let length = state.position(first).distance(state.position(first + 1));
                state.add_spring([first, first + 1], Spring::elastic(length, 1000.0, 0.0)).unwrap();
            }
            let settings = StepSettings { substeps: SubstepMode::Fixed(6), ..floating(scheme, restitution) };
            let start = state.measure(Vec3::ZERO);
            let energy = start.kinetic_energy + start.elastic_energy;
            state.outputs_mut().record_contacts = true;
            let mut contacts = 0;
            for tick in 0..60 {
                state.step(&settings);
                contacts += state.outputs().contacts.len();
                let now = state.measure(Vec3::ZERO);
                let part = (now.kinetic_energy + now.elastic_energy) / energy;
                let limit = if scheme == Integrator::SemiImplicitEuler { 1.13 } else { 1.015 };
                assert!(part < limit, "{scheme}, restitution {restitution}, tick {tick}: {part}");
            }
            assert!(contacts > 20, "{contacts}");
        }
    }
}

/// Balls that fly about.
fn scattered() -> impl Iterator<Item = Ball> {
    (0..200_usize).map(|slot| {
        let place = Vec3::new((slot * 7 % 11) as f32, (slot * 5 % 13) as f32, (slot % 17) as f32) * 0.13;
        let way =
            Vec3::new((slot * 3 % 7) as f32 - 3.0, (slot % 5) as f32 - 2.0, (slot * 11 % 3) as f32 - 1.0);
        small(place, way * 40.0)
    })
}

/// Rows, ropes and piles: momentum is kept, no energy is gained, and nothing that was in front is behind.
#[test]
fn bullets_go_through_no_pile() {
    for scheme in [Integrator::ExplicitEuler, Integrator::SemiImplicitEuler, Integrator::VelocityVerlet] {
        for (speed, restitution) in [(100.0, 0.0), (1000.0, 0.0), (1000.0, 0.5), (400.0, 1.0_f32)] {
            let mut balls = vec![small(Vec3::X * -5.0, Vec3::X * speed)];
            for slot in 0..75_usize {
                let [x, y, z] = [slot / 25, slot % 5, slot / 5 % 5].map(|place| place as f32);
                balls.push(small(Vec3::new(x, y - 2.0, z - 2.0) * 0.1, Vec3::ZERO));
            }
            let mut state = world(balls);
            let settings = StepSettings { substeps: SubstepMode::Fixed(4), ..floating(scheme, restitution) };
            let energy = kinetic_energy(&state);
            for tick in 0..60 {
                state.step(&settings);
                let case = format!("{scheme}, {speed} m/s, restitution {restitution}, tick {tick}");
                assert!((momentum(&state) - Vec3::X * speed).length() < 1e-4 * speed, "{case}");
                assert!(kinetic_energy(&state) < energy * (1.0 + 1e-4), "{case}");
                let places = positions(&state);
                let foremost = places[1..].iter().map(|place| place.x).fold(f32::MIN, f32::max);
                assert!(places[0].x < foremost, "{case}: {}", places[0]);
            }
        }
    }
}

/// What lies far away moves to the bit as without the impact.
#[test]
fn impacts_concern_nothing_else() {
    let rest = || {
        (0..30)
            .map(|slot| small(Vec3::new(0.3 * slot as f32, 9.0, 0.0), Vec3::new(0.1 * slot as f32, 0.0, 0.0)))
    };
    let bullets = [small(Vec3::X * -8.0, Vec3::X * 500.0), small(Vec3::ZERO, Vec3::ZERO)];
    let at = |ball: Ball, offset: Vec3| Ball { position: ball.position + offset, ..ball };
    let dumbbells = bullets.into_iter().flat_map(|ball| [3.0, 4.0].map(|z| at(ball, Vec3::Z * z)));
    let (mut alone, mut both) = (world(rest()), world(rest().chain(bullets).chain(dumbbells)));
    for first in [32, 34] {
        both.add_spring([first, first + 1], Spring::elastic(1.0, 10.0, 0.0)).unwrap();
    }
    let rules = PairRules { restitution: 0.5, friction: 0.2 };
    let settings = StepSettings { pair_rules: Some(rules), ..floating(Integrator::SemiImplicitEuler, 0.5) };
    for _ in 0..30 {
        alone.step(&settings);
        both.step(&settings);
        for slot in 0..30 {
            assert_eq!(
                (alone.position(slot), alone.velocity(slot)),
                (both.position(slot), both.velocity(slot))
            );
        }
    }
    assert!([31, 34, 35].iter().all(|slot| velocity(&both, *slot).x > 100.0));
}

/// The same bits with new caches in every tick.
#[test]
fn sweeps_follow_from_the_state() {
    let mut solvers = [0, 1].map(|_| {
        let mut state = world(scattered());
        for first in (0..60).step_by(2) {
            state.add_spring([first, first + 1], Spring::elastic(0.5, 1000.0, 0.0)).unwrap();
        }
        state
    });
    let settings =
        StepSettings { substeps: SubstepMode::Fixed(3), ..floating(Integrator::SemiImplicitEuler, 0.9) };
    let mut contacts = 0;
    for tick in 0..40 {
        solvers[1].drop_caches();
        for solver in &mut solvers {
            solver.step(&settings);
        }
        contacts += solvers[0].outputs().contact_count;
        assert!(solver_bits(&solvers[0]) == solver_bits(&solvers[1]), "tick {tick}");
    }
    assert!(contacts > 0);
}
