//! The warnings about invalid values, which disturb nothing else.
//!
//! The log belongs to the process, so each test here holds [`Logged`] from its first line on.

use bevy::prelude::*;
use bevy_mass_spring::prelude::*;

use crate::common::logged::Logged;
use crate::common::*;

/// A chain of five hanging from a pinned particle, independent of what the tests change.
pub fn unrelated_chain(app: &mut App) -> Vec<Entity> {
    spawn_rope(app, Vec3::new(0.0, 20.0, 0.0), 5, 0.2, |spring| spring.with_stiffness(400.0))
}

/// The hash of that chain after `ticks` ticks in an app without anything else.
pub fn undisturbed(ticks: u32) -> u64 {
    let mut app = app();
    let chain = unrelated_chain(&mut app);
    run(&mut app, ticks);
    hash(&app, &chain)
}

#[track_caller]
pub fn assert_names(line: &str, entity: Entity, words: &[&str]) {
    assert!(line.contains(&entity.to_string()), "{line:?} does not name {entity}");
    for word in words {
        assert!(line.contains(word), "{line:?} does not contain {word:?}");
    }
}

#[test]
fn a_spring_left_dangling_is_named_exactly_once() {
    let logged = Logged::start();
    let mut app = app();
    app.insert_resource(OrphanedSprings::Keep);
    let chain = unrelated_chain(&mut app);
    let (first, second) = (spawn(&mut app, 1.0, 0.1, Vec3::ZERO), spawn(&mut app, 1.0, 0.1, Vec3::X));
    let spring = join(&mut app, Spring::new(first, second, 1.0));
    run(&mut app, 10);
    logged.assert_silent();
    app.world_mut().despawn(second);
    run(&mut app, 1);
    assert_names(&logged.take_one(), spring, &["spring", &second.to_string()]);
    // Neither ticks nor other changes of the topology repeat it.
    run(&mut app, 5);
    let unrelated = spawn(&mut app, 1.0, 0.1, Vec3::Y * -5.0);
    run(&mut app, 5);
    app.world_mut().despawn(unrelated);
    run(&mut app, 9);
    logged.assert_silent();
    assert_eq!(report(&app).springs, 4);
    assert_eq!(hash(&app, &chain), undisturbed(30));
}

#[test]
fn a_dangling_spring_that_finds_a_new_end_works_and_is_named_again_when_it_loses_it() {
    let logged = Logged::start();
    let mut app = app();
    app.insert_resource(OrphanedSprings::Keep);
    let (first, second) = (spawn(&mut app, 1.0, 0.1, Vec3::ZERO), spawn(&mut app, 1.0, 0.1, Vec3::X));
    let spring = join(&mut app, Spring::new(first, second, 1.0));
    run(&mut app, 1);
    app.world_mut().despawn(second);
    run(&mut app, 1);
    logged.take_one();
    let third = spawn(&mut app, 1.0, 0.1, Vec3::X);
    app.world_mut().get_mut::<Spring>(spring).unwrap().particles[1] = third;
    run(&mut app, 1);
    logged.assert_silent();
    assert_eq!(report(&app).springs, 1);
    app.world_mut().despawn(third);
    run(&mut app, 1);
    assert_names(&logged.take_one(), spring, &[&third.to_string()]);
}

#[test]
fn a_spring_to_itself_or_to_no_particle_is_named_once() {
    let logged = Logged::start();
    let mut app = app();
    let chain = unrelated_chain(&mut app);
    let particle = spawn(&mut app, 1.0, 0.1, Vec3::ZERO);
    let no_particle = app.world_mut().spawn(Transform::default()).id();
    let loop_spring = join(&mut app, Spring::new(particle, particle, 1.0));
    run(&mut app, 5);
    assert_names(&logged.take_one(), loop_spring, &["both"]);
    let stray = join(&mut app, Spring::new(particle, no_particle, 1.0));
    run(&mut app, 5);
    assert_names(&logged.take_one(), stray, &[&no_particle.to_string()]);
    assert_eq!(report(&app).springs, 4);
    assert_eq!(hash(&app, &chain), undisturbed(10));
}

#[test]
fn an_invalid_particle_is_named_once_skipped_and_accepted_when_corrected() {
    let bad = [
        ("mass", Particle::new(0.0, 0.1)),
        ("mass", Particle::new(-1.0, 0.1)),
        ("mass", Particle::new(f32::INFINITY, 0.1)),
        ("mass", Particle::new(f32::NAN, 0.1)),
        ("radius", Particle::new(1.0, -0.1)),
        ("radius", Particle::new(1.0, f32::NAN)),
    ];
    let logged = Logged::start();
    let expected = undisturbed(12);
    for (field, particle) in bad {
        let mut app = app();
        let chain = unrelated_chain(&mut app);
        let invalid = app.world_mut().spawn((particle, Transform::from_xyz(5.0, 5.0, 0.0))).id();
        let friend = spawn(&mut app, 1.0, 0.1, Vec3::X * 9.0);
        join(&mut app, Spring::new(invalid, friend, 4.0).with_stiffness(0.0));
        run(&mut app, 6);
        assert_names(&logged.take_one(), invalid, &["particle", field]);
        assert_eq!((report(&app).particles, report(&app).springs), (6, 4), "{particle:?}");
        assert_eq!(position(&app, invalid), Vec3::new(5.0, 5.0, 0.0));
        *app.world_mut().get_mut::<Particle>(invalid).unwrap() = Particle::new(1.0, 0.1);
        run(&mut app, 6);
        logged.assert_silent();
        assert_eq!((report(&app).particles, report(&app).springs), (7, 5), "{particle:?}");
        assert!(velocity(&app, invalid).y < 0.0);
        assert_eq!(hash(&app, &chain), expected, "{particle:?}");
    }
}

#[test]
fn a_particle_that_becomes_invalid_while_it_runs_is_named_once() {
    let logged = Logged::start();
    let mut app = app();
    let chain = unrelated_chain(&mut app);
    let invalid = spawn(&mut app, 1.0, 0.1, Vec3::X * 5.0);
    run(&mut app, 5);
    app.world_mut().get_mut::<Particle>(invalid).unwrap().mass = -3.0;
    run(&mut app, 5);
    assert_names(&logged.take_one(), invalid, &["mass", "-3"]);
    assert_eq!(report(&app).particles, 5);
    let stopped = position(&app, invalid);
    run(&mut app, 5);
    assert_eq!(position(&app, invalid), stopped);
    app.world_mut().get_mut::<Particle>(invalid).unwrap().mass = 3.0;
    run(&mut app, 5);
    assert!(position(&app, invalid).y < stopped.y);
    assert_eq!(hash(&app, &chain), undisturbed(20));
    logged.assert_silent();
}

#[test]
fn an_invalid_spring_is_named_once_skipped_and_accepted_when_corrected() {
    let logged = Logged::start();
    let expected = undisturbed(15);
    for (field, value) in [
        ("rest_length", -1.0),
        ("rest_length", f32::NAN),
        ("stiffness", -5.0),
        ("stiffness", f32::INFINITY),
        ("damping", -0.1),
        ("damping", f32::NAN),
    ] {
        let mut app = app();
        let chain = unrelated_chain(&mut app);
        let (first, second) =
            (spawn(&mut app, 1.0, 0.1, Vec3::ZERO), spawn(&mut app, 1.0, 0.1, Vec3::X * 2.0));
        let good = Spring::new(first, second, 1.0);
        let spring = join(&mut app, good);
        run(&mut app, 5);
        let mut bad = app.world_mut().get_mut::<Spring>(spring).unwrap();
        match field {
            "rest_length" => bad.rest_length = value,
            "stiffness" => bad.stiffness = value,
            _ => bad.damping = value,
        }
        run(&mut app, 5);
        assert_names(&logged.take_one(), spring, &["spring", field]);
        assert_eq!(report(&app).springs, 4, "{field} {value}");
        *app.world_mut().get_mut::<Spring>(spring).unwrap() = good;
        run(&mut app, 5);
        logged.assert_silent();
        assert_eq!(report(&app).springs, 5, "{field} {value}");
        assert_eq!(hash(&app, &chain), expected, "{field} {value}");
    }
}

#[test]
fn an_invalid_force_is_named_once_each_time_it_becomes_invalid() {
    let logged = Logged::start();
    let mut app = app();
    let chain = unrelated_chain(&mut app);
    let invalid = spawn(&mut app, 1.0, 0.1, Vec3::X * 5.0);
    for (good, bad) in [(Some(Vec3::X), f32::NAN), (None, f32::NAN), (Some(Vec3::ZERO), f32::INFINITY)] {
        app.world_mut().entity_mut(invalid).insert(AppliedForce(Vec3::X * bad));
        run(&mut app, 5);
        assert_names(&logged.take_one(), invalid, &["particle", "applied force"]);
        match good {
            Some(force) => app.world_mut().entity_mut(invalid).insert(AppliedForce(force)),
            None => app.world_mut().entity_mut(invalid).remove::<AppliedForce>(),
        };
        run(&mut app, 5);
        logged.assert_silent();
    }
    // Five ticks of 1 N on 1 kg, and none of the invalid forces.
    assert!((velocity(&app, invalid).x - 5.0 * TICK).abs() < 1e-6);
    assert_eq!(report(&app).particles, 6);
    assert_eq!(hash(&app, &chain), undisturbed(30));
}

#[test]
fn a_plane_that_cuts_no_line_into_two_dimensions_is_named_once() {
    let logged = Logged::start();
    let mut app = app();
    app.insert_resource(Dimensions::Two);
    let facing = Transform::from_rotation(Quat::from_rotation_x(std::f32::consts::FRAC_PI_2));
    let wall = app.world_mut().spawn((ParticleCollider::default(), facing)).id();
    run(&mut app, 3);
    assert_names(&logged.take_one(), wall, &["collider", "parallel"]);
    app.world_mut().get_mut::<Transform>(wall).unwrap().rotation = Quat::IDENTITY;
    run(&mut app, 3);
    logged.assert_silent();
}

#[test]
fn an_invalid_plane_is_named_once_and_holds_nothing() {
    let logged = Logged::start();
    let mut app = app();
    let ball = spawn(&mut app, 1.0, 0.1, Vec3::Y * 0.1);
    let ground =
        app.world_mut().spawn(ParticleCollider { restitution: 1.5, friction: 0.0, ..default() }).id();
    run(&mut app, 5);
    assert_names(&logged.take_one(), ground, &["collider", "restitution", "1.5"]);
    assert!(position(&app, ball).y < 0.1);
    place(&mut app, ball, Vec3::Y * 0.1);
    app.world_mut().get_mut::<ParticleVelocity>(ball).unwrap().0 = Vec3::ZERO;
    app.world_mut().get_mut::<ParticleCollider>(ground).unwrap().restitution = 0.5;
    run(&mut app, 5);
    assert_eq!(position(&app, ball).y, 0.1);
    app.world_mut().get_mut::<Transform>(ground).unwrap().translation.y = f32::NAN;
    run(&mut app, 5);
    assert_names(&logged.take_one(), ground, &["collider"]);
    assert!(position(&app, ball).is_finite());
}

#[test]
fn invalid_settings_are_named_once_and_are_ignored() {
    let logged = Logged::start();
    let mut app = app();
    let ball = spawn(&mut app, 1.0, 0.1, Vec3::ZERO);
    app.world_mut().resource_mut::<Environment>().viscosity = -1.0;
    run(&mut app, 5);
    assert!(logged.take_one().contains("viscosity"));
    assert_eq!(velocity(&app, ball), Vec3::ZERO);
    *app.world_mut().resource_mut::<Environment>() = Environment::default();
    app.world_mut().resource_mut::<CollisionSettings>().restitution = f32::NAN;
    run(&mut app, 5);
    assert!(logged.take_one().contains("restitution"));
    assert!(velocity(&app, ball).y < 0.0, "gravity acts again");
    *app.world_mut().resource_mut::<CollisionSettings>() = CollisionSettings::default();
    app.insert_resource(scheme(Integrator::SemiImplicitEuler, 0));
    run(&mut app, 5);
    assert!(logged.take_one().contains("substeps"));
    assert_eq!(report(&app).substeps, 1);
}

/// What is written to the arrays of a net is checked as components are: the warning names the net, the particle and the field.
#[test]
fn a_bad_value_of_a_net_is_named_with_net_and_number() {
    let logged = Logged::start();
    let mut app = app();
    let chain = unrelated_chain(&mut app);
    let rope = Rope::new(1.0).with_segments(9).topology().unwrap();
    let net = app.world_mut().spawn(ParticleNet::new(rope.into(), &Transform::IDENTITY)).id();
    run(&mut app, 10);
    logged.assert_silent();
    let bad = [
        ("position", Vec3::new(f32::NAN, 0.0, 0.0)),
        ("velocity", Vec3::new(0.0, f32::INFINITY, 0.0)),
        ("applied force", Vec3::NAN),
    ];
    for (field, value) in bad {
        let mut arrays = app.world_mut().get_mut::<ParticleNet>(net).unwrap();
        match field {
            "position" => arrays.positions_mut()[6] = value,
            "velocity" => arrays.velocities_mut()[6] = value,
            _ => arrays.applied_forces_mut()[6] = value,
        }
        run(&mut app, 1);
        assert_names(&logged.take_one(), net, &["particle 6 of net", field]);
        app.world_mut().get_mut::<ParticleNet>(net).unwrap().clear_applied_forces();
        run(&mut app, 4);
        logged.assert_silent();
    }
    assert_eq!((report(&app).faults, report(&app).springs), (0, 13));
    assert_eq!(hash(&app, &chain), undisturbed(25));
}

/// What a net bears and how it yields: a bad value is named once each time that it is written, and the ones before stay.
#[test]
fn bad_strengths_of_nets_are_named_once() {
    let logged = Logged::start();
    let mut app = app();
    let strengths =
        (Breaking { force: Some(1e3), ..default() }, Yielding { strain: Some(0.1), max_strain: None });
    let rope = app.world_mut().spawn((Rope::new(1.0), Transform::from_xyz(0.0, 9.0, 0.0), strengths)).id();
    run(&mut app, 3);
    logged.assert_silent();
    for max_strain in [-0.5, f32::NAN] {
        app.world_mut().entity_mut(rope).insert(Yielding { strain: Some(0.1), max_strain: Some(max_strain) });
        run(&mut app, 5);
        assert_names(&logged.take_one(), rope, &["Yielding", "max_strain", &format!("{max_strain:?}")]);
    }
    app.world_mut().entity_mut(rope).insert(Breaking { force: None, strain: Some(-2.0) });
    run(&mut app, 5);
    assert_names(&logged.take_one(), rope, &["Breaking", "strain", "-2.0"]);
    app.world_mut().entity_mut(rope).insert(Yielding { strain: Some(f32::INFINITY), max_strain: None });
    run(&mut app, 5);
    assert_names(&logged.take_one(), rope, &["Yielding", "strain", "inf"]);
    let (_, spring) = app.world().get::<ParticleNet>(rope).unwrap().topology().springs[0];
    assert_eq!((spring.breaking_force, spring.plasticity.unwrap().yield_strain), (Some(1e3), 0.1));
    app.world_mut().entity_mut(rope).insert(Yielding { strain: Some(0.2), max_strain: None });
    run(&mut app, 5);
    logged.assert_silent();
    let (_, spring) = app.world().get::<ParticleNet>(rope).unwrap().topology().springs[0];
    assert_eq!(spring.plasticity.unwrap().yield_strain, 0.2);
}
