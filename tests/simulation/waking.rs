//! What wakes sleepers in the pure solver, and what does not.

use bevy::math::{Quat, Vec3};
use bevy_mass_spring::solver::{
    Collider, ContactProperties, Integrator, Layers, Material, Shape, Solver, Spring, StepSettings,
    SubstepMode,
};

use crate::common::bodies::{Ball, GRAVITY, with_ground, world};
use crate::common::sleep::{resting, settings, until_asleep};

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

/// Does something, runs two ticks, and compares which particles are awake.
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

/// A ball on a table, one on the ground far from it, and a stick whose edge lies on two rods that touch neither of its ends;
/// all asleep.
fn asleep_on_colliders() -> Asleep {
    let mut solver = world([Ball::at(Vec3::Y * 0.6), Ball::at(Vec3::new(-5.0, 0.1, 0.0))]);
    for x in [3.0, 4.0] {
        solver.add_particle(Vec3::new(x, 1.07, 0.0), Vec3::ZERO, 1.0, 0.05).unwrap();
    }
    let spring = Spring { rest_length: 1.0, stiffness: 1000.0, damping: 10.0, ..Spring::default() };
    solver.add_spring([STICK, STICK + 1], spring).unwrap();
    solver.add_collider(resting(Shape::cuboid(Vec3::new(0.5, 0.25, 0.5)), Vec3::Y * 0.25));
    for x in [3.3, 3.7] {
        let mut rod = resting(Shape::capsule(0.02, 0.5), Vec3::new(x, 1.0, 0.0));
        (rod.start.rotation, rod.target.rotation) = (LYING, LYING);
        rod.material.friction = 0.5;
        solver.add_collider(rod);
    }
    let mut solver = with_ground(solver, 0.0, 0.3);
    let settings = StepSettings { collide_springs: true, ..settings(Integrator::SemiImplicitEuler) };
    until_asleep(&mut solver, &settings, 10.0);
    let stick = solver.position(STICK);
    assert!((stick.y - 1.07).abs() < 1e-3, "the stick lies on the rods: {stick}");
    Asleep { solver, settings }
}

const ON_TABLE: usize = 0;
const ON_PLAIN: usize = 1;
const STICK: usize = 2;
const LYING: Quat =
    Quat::from_xyzw(std::f32::consts::FRAC_1_SQRT_2, 0.0, 0.0, std::f32::consts::FRAC_1_SQRT_2);
const TABLE: usize = 0;
const ROD: usize = 1;

/// Changes colliders or skins, runs a tick, and compares which particles are awake.
#[track_caller]
fn assert_change_wakes(
    slots: &[usize],
    change: impl FnOnce(&mut Vec<Collider>, &mut Vec<ContactProperties>),
) {
    let Asleep { mut solver, settings } = asleep_on_colliders();
    let inputs = solver.inputs_mut();
    change(&mut inputs.colliders, &mut inputs.contact_properties);
    solver.step(&settings);
    let awake: Vec<usize> =
        [ON_TABLE, ON_PLAIN, STICK].into_iter().filter(|slot| !solver.is_asleep(*slot)).collect();
    assert_eq!(awake, slots);
}

#[test]
fn colliders_wake_what_they_touch_when_they_move_or_change() {
    assert_change_wakes(&[], |_, _| {});
    assert_change_wakes(&[ON_TABLE], |colliders, _| colliders[TABLE].target.point.y -= 1e-4);
    assert_change_wakes(&[ON_TABLE], |colliders, _| {
        colliders[TABLE].start.point.z += 0.1;
        colliders[TABLE].target.point.z += 0.1;
    });
    assert_change_wakes(&[STICK], |colliders, _| {
        colliders[ROD].target.rotation = Quat::from_rotation_y(0.1) * LYING;
    });
    assert_change_wakes(&[ON_TABLE], |colliders, _| colliders[TABLE].material.friction = 0.9);
    assert_change_wakes(&[ON_TABLE], |colliders, _| colliders[TABLE].shape = Shape::ball(0.1));
    assert_change_wakes(&[ON_TABLE], |colliders, _| colliders[TABLE].surface_velocity.x = 1.0);
    assert_change_wakes(&[STICK], |colliders, _| colliders[ROD].is_sensor = true);
    assert_change_wakes(&[ON_TABLE], |colliders, _| {
        colliders[TABLE].layers = Layers::new(0, 0);
    });
}

#[test]
fn colliders_wake_what_they_touch_when_they_come_or_go() {
    assert_change_wakes(&[ON_TABLE], |colliders, _| _ = colliders.remove(TABLE));
    assert_change_wakes(&[STICK], |colliders, _| _ = colliders.remove(ROD));
    assert_change_wakes(&[ON_TABLE, ON_PLAIN, STICK], |colliders, _| colliders.clear());
    let ball = |x: f32| resting(Shape::ball(0.2), Vec3::new(x, 0.3, 0.0));
    assert_change_wakes(&[ON_PLAIN], |colliders, _| colliders.insert(0, ball(-5.0)));
    assert_change_wakes(&[], |colliders, _| colliders.insert(1, ball(-8.0)));
    // It is where the stick is between its ends.
    assert_change_wakes(&[STICK], |colliders, _| {
        colliders.push(resting(Shape::ball(0.01), Vec3::new(3.5, 1.07, 0.0)));
    });
}

/// A thin blade is on one side of a ball when a tick begins, and on the other when it ends.
#[test]
fn a_collider_wakes_what_it_passes_through() {
    let blade = |y: f32| {
        let mut blade = resting(Shape::cuboid(Vec3::new(0.001, 0.5, 0.5)), Vec3::new(-6.0, y, 0.0));
        blade.target.point.x = -4.0;
        blade
    };
    assert_change_wakes(&[ON_PLAIN], |colliders, _| colliders.push(blade(0.6)));
    assert_change_wakes(&[], |colliders, _| colliders.push(blade(3.0)));
}

#[test]
fn another_surface_of_a_particle_wakes_it() {
    let slippery = ContactProperties { material: Some(Material::default()), ..ContactProperties::default() };
    assert_change_wakes(&[ON_TABLE], |_, properties| properties.push(slippery));
    assert_change_wakes(&[STICK], |_, properties| {
        properties.resize(STICK, ContactProperties::default());
        properties.push(ContactProperties { layers: Layers::new(0, 0), ..ContactProperties::default() });
    });
    assert_change_wakes(&[], |_, properties| properties.resize(4, ContactProperties::default()));
}

/// A fan turns beside sleepers without touching them; a sensor, a lift and a conveyor keep awake what touches them.
#[test]
fn what_moves_keeps_awake_what_it_touches_and_no_other() {
    let Asleep { mut solver, settings } = asleep_on_colliders();
    let fan =
        solver.add_collider(resting(Shape::cuboid(Vec3::new(0.5, 0.05, 0.05)), Vec3::new(-3.0, 0.6, 0.0)));
    for tick in 0..100 {
        let fan = &mut solver.inputs_mut().colliders[fan];
        fan.start = fan.target;
        fan.target.rotation = Quat::from_rotation_y(0.3 * tick as f32);
        solver.step(&settings);
        assert_eq!(solver.asleep_count(), 4, "tick {tick}");
    }
    // A lift at 0.06 mm/s: less than what counts as drift.
    for tick in 0..300 {
        let table = &mut solver.inputs_mut().colliders[TABLE];
        table.start = table.target;
        table.target.point.y += 1e-6;
        solver.step(&settings);
        assert!(!solver.is_asleep(ON_TABLE), "tick {tick}");
    }
    let table = &mut solver.inputs_mut().colliders[TABLE];
    table.start = table.target;
    until_asleep(&mut solver, &settings, 2.0);
    // Without friction a conveyor moves nothing, but it might.
    solver.inputs_mut().colliders[TABLE].surface_velocity = Vec3::X;
    for tick in 0..120 {
        solver.step(&settings);
        assert!(!solver.is_asleep(ON_TABLE), "tick {tick}");
    }
}
