//! Bodies that do not touch each other, whatever their layers.

use bevy::prelude::*;
use bevy_mass_spring::prelude::*;
use bevy_mass_spring::solver::Exemptions;

use crate::common::*;

/// A character 1 m wide, its collider below it, the top of which is at y = 0.5.
fn spawn_character(app: &mut App) -> Entity {
    let character = app.world_mut().spawn(Transform::from_xyz(0.0, -1.0, 0.0)).id();
    let body = ParticleCollider::from(Cuboid::new(1.0, 1.0, 1.0));
    app.world_mut().spawn((body, Transform::from_xyz(0.0, 1.0, 0.0), ChildOf(character)));
    character
}

fn exempt(app: &mut App, entity: Entity, from: impl IntoIterator<Item = Entity>) {
    app.world_mut().entity_mut(entity).insert(ContactExemptions::from(from));
}

/// One ball falls through the character, whichever of the two names the other, the one beside it does not.
#[test]
fn a_particle_passes_what_it_is_exempt_from_under_every_scheme() {
    for integrator in Integrator::ALL {
        for names_character in [true, false] {
            let mut app = app();
            app.insert_resource(scheme(integrator, 2));
            let character = spawn_character(&mut app);
            let [passing, lying] = [-0.3, 0.3].map(|x| spawn(&mut app, 1.0, 0.1, Vec3::new(x, 0.7, 0.0)));
            match names_character {
                true => exempt(&mut app, passing, [character]),
                false => exempt(&mut app, character, [passing]),
            }
            run(&mut app, 64);
            let case = format!("{integrator}, {names_character}");
            // It has fallen freely for a second: 4.9 m.
            assert!(position(&app, passing).y < -3.0, "{case}: {}", position(&app, passing));
            assert!((position(&app, lying).y - 0.6).abs() < 0.01, "{case}: {}", position(&app, lying));
        }
    }
}

/// Two ropes fall across a bar of the character, along their links; one is exempt from it. A third one, which is exempt from the first, lies
/// where the first one falls through it.
#[test]
fn nets_pass_colliders_and_nets_that_they_are_exempt_from() {
    for integrator in [Integrator::Auto, Integrator::Xpbd, Integrator::TrBdf2] {
        let mut app = app();
        app.insert_resource(scheme(integrator, 4));
        app.world_mut().resource_mut::<CollisionSettings>().particles = true;
        let character = spawn_character(&mut app);
        let rope = |z: f32, y: f32| {
            let along_x = Rope::between(Vec3::new(-0.45, y, z), Vec3::new(0.45, y, z));
            along_x.with_segments(6).with_radius(0.02)
        };
        let passing = app.world_mut().spawn(rope(0.2, 0.7)).id();
        let lying = app.world_mut().spawn(rope(-0.2, 0.7)).id();
        let below = app.world_mut().spawn(rope(0.2, 0.6)).id();
        exempt(&mut app, passing, [character, below]);
        run(&mut app, 64);
        let heights = |net: Entity| {
            let net = app.world().get::<ParticleNet>(net).unwrap();
            net.positions()
                .iter()
                .map(|place| place.y)
                .fold((f32::MAX, f32::MIN), |(low, high), y| (low.min(y), high.max(y)))
        };
        assert!(heights(passing).1 < -3.0, "{integrator}: {:?}", heights(passing));
        for net in [lying, below] {
            let (low, high) = heights(net);
            assert!(low > 0.515 && high < 0.53, "{integrator}: {low} to {high}");
        }
    }
}

/// What sleeps on the character falls through it when it becomes exempt, and stays where it is when it is no longer.
#[test]
fn a_new_exemption_wakes_what_sleeps() {
    let mut app = app();
    app.insert_resource(SleepSettings { enabled: true, ..default() });
    let character = spawn_character(&mut app);
    let ball = spawn(&mut app, 1.0, 0.1, Vec3::Y * 0.6);
    run(&mut app, 200);
    assert_eq!(report(&app).asleep, 1);
    exempt(&mut app, character, [ball]);
    run(&mut app, 32);
    assert!(position(&app, ball).y < 0.0, "{}", position(&app, ball));
    app.world_mut().entity_mut(character).remove::<ContactExemptions>();
    let again = spawn(&mut app, 1.0, 0.1, Vec3::Y * 0.6);
    run(&mut app, 64);
    assert!((position(&app, again).y - 0.6).abs() < 0.01, "{}", position(&app, again));
}

/// A hierarchy in another one that is named by itself, and more bodies than one may be exempt from: the first ones count.
#[test]
fn parts_of_bodies_and_too_many_bodies() {
    let mut app = app();
    app.world_mut().resource_mut::<Environment>().gravity = Vec3::NEG_Y * 9.81;
    let character = spawn_character(&mut app);
    let part = app.world().get::<Children>(character).unwrap()[0];
    let [through_all, through_part] = [-0.3, 0.3].map(|x| spawn(&mut app, 1.0, 0.1, Vec3::new(x, 0.7, 0.0)));
    let unmet = spawn(&mut app, 1.0, 0.1, Vec3::new(0.0, 0.7, 0.3));
    exempt(&mut app, through_all, [character]);
    exempt(&mut app, through_part, [part]);
    let others: Vec<Entity> =
        (0..Exemptions::MAX).map(|_| app.world_mut().spawn(Transform::default()).id()).collect();
    exempt(&mut app, unmet, others.into_iter().chain([character]));
    run(&mut app, 64);
    assert!(position(&app, through_all).y < -3.0 && position(&app, through_part).y < -3.0);
    assert!((position(&app, unmet).y - 0.6).abs() < 0.01, "the eighth does not count");
}

#[test]
fn snapshots_hold_exemptions() {
    let mut app = app();
    let character = spawn_character(&mut app);
    let ball = spawn(&mut app, 1.0, 0.1, Vec3::Y * 0.7);
    exempt(&mut app, ball, [character]);
    run(&mut app, 10);
    let snapshot = Snapshot::take(app.world());
    run(&mut app, 20);
    let expected = bits(&app, ball);
    app.world_mut().entity_mut(ball).remove::<ContactExemptions>();
    snapshot.restore(app.world_mut());
    assert_eq!(app.world().get(ball), Some(&ContactExemptions(vec![character])));
    run(&mut app, 20);
    assert_eq!(bits(&app, ball), expected);
}
