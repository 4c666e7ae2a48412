//! Sleep: what rests falls asleep and stays where it is, to the bit; what swings, creeps or is pulled slowly does not;
//! and everything that could move a sleeper wakes it.

use std::time::Instant;

use bevy::math::{Quat, UVec2, Vec3};
use bevy_mass_spring::nets::{Cloth, ClothMaterial, Jelly, Rope};
use bevy_mass_spring::solver::{
    Collider, Integrator, Material, PairRules, Pose, Shape, Sleep, Solver, Spring, StepSettings, SubstepMode,
};

use crate::common::bodies::{Ball, GRAVITY, add_net, positions, solver_bits, velocities, with_ground, world};
use crate::common::colliding;
use crate::common::sleep::{assert_stays, pile, pile_in_cuboids, resting, settings, until_asleep};

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

/// A rope over a bar, a cloth and a jelly on a table: all of them lie on solids with corners and edges.
#[test]
fn nets_that_lie_on_solids_fall_asleep() {
    for integrator in [Integrator::Auto, Integrator::Xpbd] {
        let mut table = resting(Shape::cuboid(Vec3::new(2.0, 0.5, 2.0)), Vec3::NEG_Y * 0.5);
        table.material.friction = 0.5;
        let mut solver = Solver::default();
        solver.add_collider(table);
        let cloth =
            Cloth::grid(Vec3::ZERO, Vec3::X, Vec3::Z, UVec2::splat(6)).with_material(ClothMaterial::COTTON);
        add_net(&mut solver, &cloth.topology().unwrap(), Vec3::Y * 0.05, &[]);
        let rope = Rope::new(1.0).with_segments(12).topology().unwrap();
        add_net(&mut solver, &rope, Vec3::new(-1.5, 1.0, 0.0), &[]);
        let jelly = Jelly::default().topology().unwrap();
        add_net(&mut solver, &jelly, Vec3::new(-0.9, 0.6, -0.9), &[]);
        let settings = StepSettings { substeps: SubstepMode::Auto, viscosity: 0.002, ..settings(integrator) };
        until_asleep(&mut solver, &settings, 60.0);
        assert_stays(&mut solver, &settings);
    }
}

/// At the edges of a box contacts change from substep to substep, and particles beside them have velocities of some g h.
#[test]
fn a_cloth_over_the_edges_of_a_box_falls_asleep_and_again_when_that_has_turned() {
    for integrator in [Integrator::Auto, Integrator::Xpbd] {
        let mut solver = Solver::default();
        let pose = |angle: f32| Pose { point: Vec3::ZERO, rotation: Quat::from_rotation_z(angle) };
        solver.add_collider(Collider {
            material: Material { friction: 0.6, ..Material::default() },
            ..Collider::resting(Shape::cuboid(Vec3::splat(0.2)), pose(0.0))
        });
        let cloth = colliding::Cloth {
            cells: 8,
            size: 0.6,
            radius: 0.01,
            stiffness: 1e3,
            areal_density: 0.15,
            damping: 0.1,
        };
        cloth.add(&mut solver, Vec3::new(-0.3, 0.211, -0.3), [Vec3::X, Vec3::Z]);
        let settings = StepSettings {
            integrator,
            gravity: Vec3::NEG_Y * GRAVITY,
            // Drag per mass, 1/s.
            viscosity: 1.0 / solver.inverse_mass(0),
            sleep: Some(Sleep::default()),
            ..StepSettings::default()
        };
        until_asleep(&mut solver, &settings, 20.0);
        solver.inputs_mut().colliders[0].target = pose(0.01);
        solver.step(&settings);
        solver.inputs_mut().colliders[0].start = pose(0.01);
        assert_eq!(solver.asleep_count(), 0, "it wakes");
        until_asleep(&mut solver, &settings, 20.0);
        assert_stays(&mut solver, &settings);
    }
}

/// What wakes goes on where it is. Asleep it was kept from moving by less than the drift d = 0.2 speed · delay in the delay; so
/// awake again it moves by less than twice that in the next one, beside the free fall of a substep that contacts take to
/// take its weight again.
#[test]
fn nothing_jumps_when_it_wakes() {
    for integrator in [Integrator::Auto, Integrator::TrBdf2, Integrator::Xpbd, Integrator::VelocityVerlet] {
        let mut solver = pile(4);
        if integrator != Integrator::VelocityVerlet {
            // For an explicit scheme it is too stiff.
            let rope = Rope::new(1.0).with_segments(12).topology().unwrap();
            add_net(&mut solver, &rope, Vec3::new(0.3, 6.0, 0.3), &[0]);
        }
        let spring = Spring { rest_length: 1.0, stiffness: 400.0, damping: 20.0, ..Spring::default() };
        let anchor = solver.add_particle(Vec3::new(0.6, 6.0, 0.6), Vec3::ZERO, f32::INFINITY, 0.0).unwrap();
        let load = solver.add_particle(Vec3::new(0.6, 5.0, 0.6), Vec3::ZERO, 2.0, 0.05).unwrap();
        solver.add_spring([anchor, load], spring).unwrap();
        let settings = StepSettings { substeps: SubstepMode::Auto, viscosity: 0.002, ..settings(integrator) };
        until_asleep(&mut solver, &settings, 60.0);
        let before = positions(&solver);
        let settings = StepSettings { viscosity: 0.0021, ..settings };
        let Sleep { speed, delay } = Sleep::default();
        for tick in 0..(delay / settings.time_step) as u32 {
            solver.step(&settings);
            let substep = settings.time_step / solver.outputs().plan.substeps as f32;
            let allowed = 2.0 * 0.2 * speed * delay + GRAVITY * substep * substep;
            assert!(tick > 0 || solver.asleep_count() == 0);
            for (slot, (now, before)) in positions(&solver).iter().zip(&before).enumerate() {
                let moved = now.distance(*before);
                assert!(moved <= allowed, "{integrator}, tick {tick}, slot {slot}: {moved} m");
            }
        }
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

/// A string of 3 particles vibrates by 0.3 mm at 40 to 200 Hz, on the spot and without touching anything: it never rests.
#[test]
fn a_small_net_that_vibrates_does_not_fall_asleep() {
    for integrator in [Integrator::VelocityVerlet, Integrator::RungeKutta4] {
        for stiffness in [600.0, 16_000.0] {
            let mut solver = Solver::default();
            for number in 0..5_u8 {
                let mass = if number % 4 == 0 { f32::INFINITY } else { 0.01 };
                let place = Vec3::new(f32::from(number) * 0.1, if number == 2 { 0.0003 } else { 0.0 }, 0.0);
                solver.add_particle(place, Vec3::ZERO, mass, 0.005).unwrap();
            }
            // Taut, to twice its length at rest.
            let spring = Spring { rest_length: 0.05, stiffness, ..Spring::default() };
            (0..4).for_each(|first| _ = solver.add_spring([first, first + 1], spring).unwrap());
            let settings = StepSettings {
                gravity: Vec3::ZERO,
                substeps: SubstepMode::Fixed(40),
                ..settings(integrator)
            };
            assert_never_sleeps(&solver, &settings, 10.0, |_, _| {});
        }
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

/// The bar of the issue: 10,000 balls in a box of cuboids are at rest within 20 s, overlap by less than 1 % of their
/// radius on average and by 5 % nowhere, and cost next to nothing then. The time is that of the fastest tick, ten times what it
/// takes on an idle machine.
#[test]
fn ten_thousand_balls_in_a_box_fall_asleep() {
    let (mut solver, settings) = (pile_in_cuboids(22), settings(Integrator::Auto));
    let seconds = until_asleep(&mut solver, &settings, 20.0);
    let (places, radius) = (positions(&solver), 0.1);
    let mut columns = std::collections::BTreeMap::<[i32; 3], Vec<usize>>::new();
    let cell = |place: Vec3| (place / 0.2).floor().to_array().map(|coordinate| coordinate as i32);
    places.iter().enumerate().for_each(|(slot, place)| columns.entry(cell(*place)).or_default().push(slot));
    let (mut overlaps, mut count, mut worst) = (0.0, 0.0, 0.0_f32);
    for (slot, place) in places.iter().enumerate() {
        let [x, y, z] = cell(*place);
        let around = (0..27).map(|near| [x + near % 3 - 1, y + near / 3 % 3 - 1, z + near / 9 - 1]);
        for other in around.filter_map(|cell| columns.get(&cell)).flatten().filter(|other| **other > slot) {
            let overlap = 2.0 * radius - place.distance(places[*other]);
            if overlap > 0.0 {
                (overlaps, count, worst) = (overlaps + overlap, count + 1.0, worst.max(overlap));
            }
        }
    }
    let (mean, worst) = (overlaps / count / radius, worst / radius);
    assert!(mean < 0.01 && worst < 0.05, "overlaps: {mean} on average, {worst} at worst");
    let cost = (0..100).map(|_| {
        let start = Instant::now();
        solver.step(&settings);
        start.elapsed()
    });
    let cost = cost.min().unwrap();
    println!(
        "asleep after {seconds} s; overlaps of {count} contacts: mean {mean}, worst {worst}; a tick takes {cost:?}"
    );
    assert!(cost.as_micros() < 500, "{cost:?}");
}
