//! Sleep: what rests falls asleep and stays where it is, to the bit; what swings, creeps or is pulled slowly does not;
//! and everything that could move a sleeper wakes it.

use bevy::math::{Quat, UVec2, Vec3};
use bevy_mass_spring::nets::{Cloth, ClothMaterial, Rope};
use bevy_mass_spring::solver::{
    Collider, Integrator, Layers, PairRules, Pose, Shape, Skin, Sleep, Solver, Spring, StepSettings, SubstepMode,
};

use crate::common::bodies::{Ball, GRAVITY, add_net, positions, solver_bits, velocities, with_ground, world};

const RULES: PairRules = PairRules { restitution: 0.0, friction: 0.3 };

fn settings(integrator: Integrator) -> StepSettings {
    StepSettings {
        integrator,
        substeps: SubstepMode::Fixed(4),
        gravity: Vec3::NEG_Y * GRAVITY,
        pair_rules: Some(RULES),
        sleep: Some(Sleep::default()),
        ..StepSettings::default()
    }
}

/// Steps until all is asleep; the time that it took, s.
fn until_asleep(solver: &mut Solver, settings: &StepSettings, seconds: f32) -> f32 {
    let movable = (0..solver.particle_count()).filter(|slot| solver.inverse_mass(*slot) > 0.0).count();
    let ticks = (seconds / settings.time_step) as u32;
    for tick in 0..ticks {
        if solver.asleep_count() == movable {
            return tick as f32 * settings.time_step;
        }
        solver.step(settings);
    }
    panic!("after {seconds} s {} of {movable} sleep ({})", solver.asleep_count(), settings.integrator);
}

/// What sleeps does not move, by a single bit.
fn assert_stays(solver: &mut Solver, settings: &StepSettings) {
    let expected = solver_bits(solver);
    for _ in 0..100 {
        solver.step(settings);
        assert!(solver_bits(solver) == expected, "{}", settings.integrator);
    }
    let at_rest = |slot: usize| solver.inverse_mass(slot) == 0.0 || solver.velocity(slot) == Vec3::ZERO;
    assert!((0..solver.particle_count()).all(at_rest));
}

/// An open box of the ground and four walls with `side`³ balls of 0.1 m that are let fall into it.
fn pile(side: u16) -> Solver {
    let width = 0.22 * f32::from(side);
    let balls = (0..side.pow(3)).map(|ball| {
        let [x, y, z] = [ball % side, ball / side % side, ball / side / side].map(f32::from);
        let jitter =
            Vec3::new(f32::from(ball * 7 % 11), f32::from(ball * 3 % 5), f32::from(ball * 5 % 13)) * 0.0015;
        Ball::at(Vec3::new(x + 0.5, z + 0.6, y + 0.5) * 0.22 + jitter)
    });
    let mut solver = with_ground(world(balls), 0.0, 0.3);
    for (point, normal) in [
        (Vec3::ZERO, Vec3::X),
        (Vec3::ZERO, Vec3::Z),
        (Vec3::X * width, Vec3::NEG_X),
        (Vec3::Z * width, Vec3::NEG_Z),
    ] {
        solver.add_collider(Collider::half_space(point, normal, 0.0, 0.3));
    }
    solver
}

#[test]
fn a_pile_falls_asleep_and_stays_under_every_scheme() {
    for integrator in Integrator::ALL {
        let (mut solver, settings) = (pile(4), settings(integrator));
        until_asleep(&mut solver, &settings, 20.0);
        assert_stays(&mut solver, &settings);
        assert_eq!(solver.outputs().contact_count, 0);
    }
}

/// A load on a damped spring falls asleep no further from its equilibrium m g / k than the documented bound,
/// m · 5.2 speed / (delay k), and the rounding of its place.
#[test]
fn a_load_on_a_spring_falls_asleep_at_its_equilibrium() {
    for integrator in Integrator::ALL {
        let (mass, stiffness) = (2.0, 400.0);
        let mut solver = Solver::default();
        let anchor = solver.add_particle(Vec3::Y, Vec3::ZERO, f32::INFINITY, 0.0).unwrap();
        let load = solver.add_particle(Vec3::ZERO, Vec3::ZERO, mass, 0.05).unwrap();
        let spring = Spring { rest_length: 1.0, stiffness, damping: 20.0, ..Spring::default() };
        solver.add_spring([anchor, load], spring).unwrap();
        let settings = StepSettings { substeps: SubstepMode::Fixed(8), ..settings(integrator) };
        until_asleep(&mut solver, &settings, 20.0);
        let Sleep { speed, delay } = Sleep::default();
        let off = solver.position(load).y + mass * GRAVITY / stiffness;
        assert!(off.abs() <= mass * 5.2 * speed / (delay * stiffness) + 1e-6, "{integrator}: off by {off} m");
        assert_stays(&mut solver, &settings);
    }
}

#[test]
fn a_hanging_rope_and_a_cloth_that_was_laid_down_fall_asleep() {
    for integrator in [Integrator::Auto, Integrator::TrBdf2, Integrator::ImplicitEuler, Integrator::Xpbd] {
        let mut solver = with_ground(Solver::default(), 0.0, 0.5);
        let rope = Rope::new(1.0).with_segments(12).topology().unwrap();
        add_net(&mut solver, &rope, Vec3::new(3.0, 2.0, 0.0), &[0]);
        let cloth =
            Cloth::grid(Vec3::ZERO, Vec3::X, Vec3::Z, UVec2::splat(6)).with_material(ClothMaterial::COTTON);
        add_net(&mut solver, &cloth.topology().unwrap(), Vec3::Y * 0.1, &[]);
        let settings = StepSettings { substeps: SubstepMode::Auto, viscosity: 0.002, ..settings(integrator) };
        until_asleep(&mut solver, &settings, 60.0);
        assert_stays(&mut solver, &settings);
    }
}

/// With sleep all is to the bit as without it, for so long.
fn assert_never_sleeps(
    solver: &Solver,
    settings: &StepSettings,
    seconds: f32,
    mut edit: impl FnMut(&mut Solver, u32),
) {
    let (mut with, mut without) = (solver.clone(), solver.clone());
    for tick in 0..(seconds / settings.time_step) as u32 {
        for (solver, sleep) in [(&mut with, settings.sleep), (&mut without, None)] {
            edit(solver, tick);
            solver.step(&StepSettings { sleep, ..*settings });
        }
        let (scheme, substeps) = (settings.integrator, settings.substeps);
        assert!(solver_bits(&with) == solver_bits(&without), "{scheme}, {substeps:?}, tick {tick}");
    }
}

/// A pendulum of 10 m that swings by 2 cm to either side is slower than the 10 mm/s of the limit for half a second at each
/// turning point, but by an acceleration of 20 mm/s² it moves by 0.6 mm in a quarter of a second.
#[test]
fn a_pendulum_does_not_fall_asleep_where_it_turns() {
    for integrator in Integrator::named() {
        let mut solver = Solver::default();
        let anchor = solver.add_particle(Vec3::ZERO, Vec3::ZERO, f32::INFINITY, 0.0).unwrap();
        let bob = solver.add_particle(Vec3::new(0.02, -10.0, 0.0), Vec3::ZERO, 1.0, 0.05).unwrap();
        let rest_length = 10.0 - GRAVITY / 5000.0;
        solver
            .add_spring([anchor, bob], Spring { rest_length, stiffness: 5000.0, ..Spring::default() })
            .unwrap();
        let settings = StepSettings { substeps: SubstepMode::Fixed(8), ..settings(integrator) };
        assert_never_sleeps(&solver, &settings, 20.0, |_, _| {});
    }
}

/// A spring of 10 N/m creeps back against a damper of 1000 N·s/m: at 0.05 mm/s when it is 5 mm long, and for 100 s it
/// is pulled by more than the 2 speed / delay · 1 kg = 4 mN of the documented bound.
#[test]
fn what_creeps_does_not_fall_asleep() {
    for (damping, viscosity) in [(1000.0, 0.0), (0.0, 1000.0)] {
        let mut solver = Solver::default();
        let anchor = solver.add_particle(Vec3::ZERO, Vec3::ZERO, f32::INFINITY, 0.0).unwrap();
        let end = solver.add_particle(Vec3::X * 1.005, Vec3::ZERO, 1.0, 0.0).unwrap();
        let spring = Spring { rest_length: 1.0, stiffness: 10.0, damping, ..Spring::default() };
        solver.add_spring([anchor, end], spring).unwrap();
        let settings = StepSettings { gravity: Vec3::ZERO, viscosity, ..settings(Integrator::ImplicitEuler) };
        assert_never_sleeps(&solver, &settings, 100.0, |_, _| {});
    }
}

/// A constant motion is no rest from a fifth of the speed on.
#[test]
fn what_drifts_does_not_fall_asleep() {
    let ball = Ball { velocity: Vec3::X * 2.1e-4, ..Ball::at(Vec3::ZERO) };
    let settings = StepSettings { gravity: Vec3::ZERO, ..settings(Integrator::VelocityVerlet) };
    assert_never_sleeps(&world([ball]), &settings, 10.0, |_, _| {});
}

/// A winch takes in 0.05 mm in a second: less than what counts as drift, but its load never falls asleep.
#[test]
fn a_slow_winch_goes_on() {
    let mut solver = Solver::default();
    let anchor = solver.add_particle(Vec3::Y, Vec3::ZERO, f32::INFINITY, 0.0).unwrap();
    let load = solver.add_particle(Vec3::ZERO, Vec3::ZERO, 1.0, 0.05).unwrap();
    let spring = Spring { rest_length: 1.0, stiffness: 981.0, damping: 60.0, ..Spring::default() };
    solver.add_spring([anchor, load], spring).unwrap();
    assert_never_sleeps(&solver, &settings(Integrator::VelocityVerlet), 20.0, |solver, tick| {
        let rest_length = 1.0 - 0.00005 / 60.0 * tick as f32;
        solver.set_spring(0, Spring { rest_length, ..spring }).unwrap();
    });
}

/// A ball that lies on the ground, a ball beside it on a pinned ball, and a load on a spring; all asleep.
struct Asleep {
    solver: Solver,
    settings: StepSettings,
}

const ON_GROUND: usize = 0;
const SUPPORT: usize = 1;
const ON_SUPPORT: usize = 2;
const ANCHOR: usize = 3;
const LOAD: usize = 4;
const FAR: usize = 5;

fn asleep() -> Asleep {
    let pinned = |position| Ball { mass: f32::INFINITY, ..Ball::at(position) };
    let mut solver = with_ground(
        world([
            Ball::at(Vec3::Y * 0.1),
            pinned(Vec3::new(1.0, 0.5, 0.0)),
            Ball::at(Vec3::new(1.0, 0.7, 0.0)),
            pinned(Vec3::new(3.0, 3.0, 0.0)),
            Ball::at(Vec3::new(3.0, 2.0 - GRAVITY / 1000.0, 0.0)),
            Ball::at(Vec3::new(-5.0, 0.1, 0.0)),
        ]),
        0.0,
        0.3,
    );
    let spring = Spring { rest_length: 1.0, stiffness: 1000.0, damping: 30.0, ..Spring::default() };
    solver.add_spring([ANCHOR, LOAD], spring).unwrap();
    let settings = settings(Integrator::SemiImplicitEuler);
    until_asleep(&mut solver, &settings, 10.0);
    Asleep { solver, settings }
}

/// Does something, runs two ticks, and compares who is awake.
fn assert_wakes(what: &str, slots: &[usize], act: impl FnOnce(&mut Solver, &mut StepSettings)) {
    let Asleep { mut solver, mut settings } = asleep();
    act(&mut solver, &mut settings);
    solver.step(&settings);
    let awake = |solver: &Solver| -> Vec<usize> {
        [ON_GROUND, ON_SUPPORT, LOAD, FAR].into_iter().filter(|slot| !solver.is_asleep(*slot)).collect()
    };
    assert_eq!(awake(&solver), slots, "{what}");
}

#[test]
fn what_happens_to_a_sleeper_wakes_it_and_no_other() {
    assert_wakes("nothing", &[], |_, _| {});
    assert_wakes("a force", &[ON_GROUND], |solver, _| solver.set_applied_force(ON_GROUND, Vec3::X * 1e-3));
    assert_wakes("a velocity", &[ON_GROUND], |solver, _| solver.set_velocity(ON_GROUND, Vec3::X * 1e-3));
    assert_wakes("a place", &[FAR], |solver, _| solver.set_position(FAR, Vec3::new(-5.0, 1.0, 0.0)));
    assert_wakes("a mass", &[LOAD], |solver, _| solver.set_mass(LOAD, 2.0).unwrap());
    assert_wakes("a radius", &[FAR], |solver, _| solver.set_radius(FAR, 0.2).unwrap());
    assert_wakes("an anchor that moves", &[LOAD], |solver, _| {
        solver.move_pinned(ANCHOR, Vec3::new(3.0, 3.001, 0.0));
    });
    assert_wakes("an anchor that is freed", &[LOAD], |solver, _| solver.set_mass(ANCHOR, 1.0).unwrap());
    assert_wakes("a support that moves", &[ON_SUPPORT], |solver, _| {
        solver.move_pinned(SUPPORT, Vec3::new(1.0, 0.499, 0.0));
    });
    assert_wakes("a support that is put elsewhere", &[ON_SUPPORT], |solver, _| {
        solver.set_position(SUPPORT, Vec3::new(1.0, 0.5, 9.0));
    });
    assert_wakes("a support that shrinks", &[ON_SUPPORT], |solver, _| {
        solver.set_radius(SUPPORT, 0.05).unwrap()
    });
    assert_wakes("a pinned ball that comes", &[ON_GROUND], |solver, _| {
        solver.add_particle(Vec3::Y * 0.25, Vec3::ZERO, f32::INFINITY, 0.1).unwrap();
    });
    let spring = Spring { rest_length: 0.5, stiffness: 1000.0, damping: 30.0, ..Spring::default() };
    assert_wakes("a spring that changes", &[LOAD], |solver, _| solver.set_spring(0, spring).unwrap());
    assert_wakes("a spring that goes", &[LOAD], |solver, _| solver.remove_spring(0));
    assert_wakes("a spring that comes", &[ON_GROUND, FAR], |solver, _| {
        solver.add_spring([ON_GROUND, FAR], spring).unwrap();
    });
    assert_wakes("a ball that comes", &[FAR], |solver, _| {
        solver.add_particle(Vec3::new(-5.0, 0.5, 0.0), Vec3::NEG_Y * 15.0, 1.0, 0.1).unwrap();
    });
    assert_wakes("a ball that does not", &[], |solver, _| {
        solver.add_particle(Vec3::new(-5.0, 0.5, 0.0), Vec3::Y, 1.0, 0.1).unwrap();
    });
}

#[test]
fn changed_settings_and_planes_wake_what_they_concern() {
    let all = [ON_GROUND, ON_SUPPORT, LOAD, FAR];
    assert_wakes("gravity", &all, |_, settings| settings.gravity.y = -3.0);
    assert_wakes("viscosity", &all, |_, settings| settings.viscosity = 0.1);
    assert_wakes("wind", &all, |_, settings| settings.wind.x = 1.0);
    assert_wakes("the scheme", &all, |_, settings| settings.integrator = Integrator::RungeKutta4);
    assert_wakes("the substeps", &all, |_, settings| settings.substeps = SubstepMode::Fixed(5));
    assert_wakes("the rules of pairs", &all, |_, settings| settings.pair_rules = None);
    assert_wakes("sleep", &all, |_, settings| settings.sleep = None);
    assert_wakes("the length of a tick", &[], |_, settings| settings.time_step = 1.0 / 64.0);
    let ground = [ON_GROUND, FAR];
    assert_wakes("a plane that moves", &ground, |solver, _| {
        solver.inputs_mut().colliders[0].target.point.y = 1e-4
    });
    assert_wakes("a plane that tilts", &ground, |solver, _| {
        solver.inputs_mut().colliders[0].target.rotation = Quat::from_rotation_z(0.01);
    });
    assert_wakes("a plane that goes", &ground, |solver, _| solver.inputs_mut().colliders.clear());
    assert_wakes("a plane that is another", &ground, |solver, _| {
        solver.inputs_mut().colliders[0].material.friction = 0.0
    });
    assert_wakes("a plane that comes", &[FAR], |solver, _| {
        solver.add_collider(Collider::half_space(Vec3::X * -4.9, Vec3::X, 0.0, 0.0));
    });
    assert_wakes("a plane that comes elsewhere", &[], |solver, _| {
        solver.add_collider(Collider::half_space(Vec3::X * -9.0, Vec3::X, 0.0, 0.0));
    });
}

/// A ball of 3 m/s against a row of sleeping ones: as against a row that does not sleep.
#[test]
fn an_impact_on_sleepers_is_as_one_on_what_is_awake() {
    for integrator in Integrator::named() {
        for restitution in [0.0, 1.0] {
            let rules = PairRules { restitution, friction: 0.0 };
            let gravity = Vec3::ZERO;
            let settings = StepSettings { pair_rules: Some(rules), gravity, ..settings(integrator) };
            let mut solver = world((0..6).map(|ball| Ball::at(Vec3::X * 0.2 * f32::from(ball as u8))));
            until_asleep(&mut solver, &settings, 5.0);
            let mut awake = world((0..6).map(|ball| Ball::at(Vec3::X * 0.2 * f32::from(ball as u8))));
            for solver in [&mut solver, &mut awake] {
                solver.add_particle(Vec3::X * -0.5, Vec3::X * 3.0, 1.0, 0.1).unwrap();
            }
            for _ in 0..60 {
                solver.step(&settings);
                awake.step(&StepSettings { sleep: None, ..settings });
            }
            let momentum: Vec3 = velocities(&solver).into_iter().sum();
            assert!((momentum - Vec3::X * 3.0).length() < 1e-5, "{integrator}, {restitution}: {momentum}");
            for (one, other) in positions(&solver).into_iter().zip(positions(&awake)) {
                assert!(one.distance(other) < 1e-5, "{integrator}, {restitution}: {one} and {other}");
            }
        }
    }
}

/// A state in which some sleep goes on as the solver did, without caches, and after it was put back.
#[test]
fn sleep_is_a_part_of_the_state() {
    let (mut solver, settings) = (pile(3), settings(Integrator::SemiImplicitEuler));
    let thrown = |solver: &mut Solver, tick: u32| {
        if tick % 300 == 299 {
            let place = Vec3::new(0.3, 2.0, 0.3);
            solver.add_particle(place, Vec3::NEG_Y * 3.0, 1.0, 0.05).unwrap();
        }
    };
    let (mut without, mut kept) = (solver.clone(), None);
    let (mut slept, mut woke, mut history) = (0, 0, Vec::new());
    for tick in 0..1000 {
        if tick == 290 {
            kept = Some(solver.state().clone());
        }
        without.drop_caches();
        let before = solver.asleep_count();
        for solver in [&mut solver, &mut without] {
            thrown(solver, tick);
            solver.step(&settings);
        }
        slept += u32::from(solver.asleep_count() > before);
        woke += u32::from(solver.asleep_count() < before);
        assert!(solver_bits(&solver) == solver_bits(&without), "tick {tick}");
        assert_eq!(solver.asleep_count(), without.asleep_count());
        history.push(solver_bits(&solver));
    }
    assert!(slept > 1 && woke > 1, "{slept}, {woke}");
    solver.restore(kept.expect("a state was kept"));
    for tick in 290..1000 {
        thrown(&mut solver, tick);
        solver.step(&settings);
        assert!(solver_bits(&solver) == history[tick as usize], "tick {tick}");
    }
}
