//! Commands that move single entities, or nothing; and what is shown of a jump.

use bevy::prelude::*;
use bevy_mass_spring::prelude::*;

use crate::common::*;

/// A pinned particle jumps by command: what hangs from it stays behind, and is not kicked by any velocity.
#[test]
fn single_entities_jump_by_command() {
    let mut app = app();
    plain(&mut app);
    app.world_mut().resource_mut::<CollisionSettings>().ground = true;
    let rope =
        spawn_rope(&mut app, Vec3::ZERO, 2, 1.0, |spring| spring.with_stiffness(0.0).with_damping(9.0));
    let plane =
        app.world_mut().spawn((ParticleCollider::default(), Transform::from_xyz(0.0, -9.0, 0.0))).id();
    let ball = spawn(&mut app, 1.0, 0.5, Vec3::new(9.0, 3.5, 0.0));
    run(&mut app, 2);
    Teleport::entity(rope[0], Vec3::NEG_X).apply(app.world_mut());
    Teleport::entity(plane, Vec3::Y * 12.0).apply(app.world_mut());
    Teleport::entity(plane, Vec3::ZERO).apply(app.world_mut());
    run(&mut app, 2);
    // Only dampers would feel a velocity; the plane is below the ball now, not under the rope.
    assert_eq!(position(&app, rope[0]), Vec3::NEG_X);
    assert_eq!(velocity(&app, rope[0]), Vec3::ZERO);
    assert_eq!(position(&app, ball), Vec3::new(9.0, 3.5, 0.0));
    assert_eq!(velocity(&app, ball), Vec3::ZERO);
}

/// Commands that make no sense change nothing.
#[test]
fn a_senseless_command_changes_nothing() {
    let mut app = app();
    let rope = spawn_rope(&mut app, Vec3::ZERO, 3, 1.0, |spring| spring);
    run(&mut app, 2);
    let before = hash(&app, &rope);
    let gone = app.world_mut().spawn_empty().id();
    let other = app.world_mut().spawn(Transform::default()).id();
    app.world_mut().despawn(gone);
    for entity in [gone, other] {
        Teleport::entity(entity, Vec3::X).apply(app.world_mut());
        Teleport::net(entity, Vec3::X).apply(app.world_mut());
    }
    Teleport::everything(Vec3::NAN).apply(app.world_mut());
    assert_eq!(hash(&app, &rope), before);
    Teleport::everything(Vec3::X).apply(App::new().world_mut());
}

/// Easing shows what was moved in `FixedUpdate` where it is, not on the way.
#[cfg(feature = "interpolation")]
#[test]
fn no_easing_shows_the_way() {
    use std::time::Duration;

    use bevy::time::TimeUpdateStrategy;

    #[derive(Resource, Default)]
    struct Ticks(u32);

    for by_command in [false, true] {
        let mut app = app_with(MassSpringPlugin::default().with_interpolation(true));
        let rope = spawn_rope(&mut app, Vec3::ZERO, 5, 1.0, |spring| spring.with_stiffness(1e4));
        app.init_resource::<Ticks>();
        let leap = move |mut particles: Query<&mut Transform, With<Particle>>,
                         mut ticks: ResMut<Ticks>,
                         mut commands: Commands| {
            ticks.0 += 1;
            if ticks.0 == 10 && by_command {
                commands.queue(Teleport::everything(Vec3::X * 100.0));
            } else if ticks.0 == 10 {
                particles.iter_mut().for_each(|mut transform| transform.translation.x += 100.0);
            }
        };
        app.add_systems(FixedUpdate, leap);
        app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_secs_f32(0.3 * TICK)));
        for _ in 0..60 {
            run(&mut app, 1);
            let places = rope.iter().map(|knot| position(&app, *knot).x);
            assert!(places.clone().all(|x| x < 1.0) || places.clone().all(|x| x > 99.0), "{by_command}");
        }
        assert!(position(&app, rope[4]).x > 99.0);
    }
}
