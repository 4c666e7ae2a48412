//! Colliders between ticks: they are drawn with what they carry, and the simulation sees where they are, not where they are
//! drawn.

use std::time::Duration;

use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_mass_spring::prelude::*;
use bevy_transform_interpolation::prelude::{
    RotationInterpolation, TransformInterpolation, TranslationInterpolation,
};

use crate::common::*;

/// An app whose frames are a quarter of a tick.
fn app(interpolation: bool) -> App {
    let mut app = app_with(MassSpringPlugin::default().with_interpolation(interpolation));
    let frame = Duration::from_secs_f32(TICK / 4.0);
    app.insert_resource(TimeUpdateStrategy::ManualDuration(frame));
    app
}

/// A rough platform that moves, and a ball on it of the same velocity.
fn platform_and_ball(app: &mut App, motion: ColliderMotion) -> [Entity; 2] {
    let platform = ParticleCollider::from(Cuboid::new(4.0, 0.2, 4.0)).with_friction(2.0);
    let platform = app.world_mut().spawn((platform, Transform::from_xyz(0.0, -0.1, 0.0), motion)).id();
    let ball = spawn(app, 1.0, 0.1, Vec3::new(1.0, 0.1, 0.0));
    app.world_mut().entity_mut(ball).insert(ParticleVelocity(motion.velocity));
    [platform, ball]
}

/// The bits of all transforms at the end of each tick.
#[derive(Resource, Default, PartialEq, Debug)]
struct Ticks(Vec<Vec<[u32; 7]>>);

fn record(app: &mut App, entities: Vec<Entity>) {
    app.init_resource::<Ticks>().add_systems(
        FixedLast,
        move |mut ticks: ResMut<Ticks>, transforms: Query<&Transform>| {
            let bits = entities.iter().map(|entity| {
                let Transform { translation, rotation, .. } = transforms.get(*entity).unwrap();
                let [x, y, z] = translation.to_array().map(f32::to_bits);
                let [i, j, k, w] = rotation.to_array().map(f32::to_bits);
                [x, y, z, i, j, k, w]
            });
            ticks.0.push(bits.collect());
        },
    );
}

/// The ticks of the same scene with and without interpolation are the same to the bit; it ran for a second.
#[track_caller]
fn assert_same_ticks(scene: impl Fn(&mut App) -> Vec<Entity>) {
    let [eased, straight] = [true, false].map(|interpolation| {
        let mut app = app(interpolation);
        let entities = scene(&mut app);
        record(&mut app, entities);
        run(&mut app, 4 * 64);
        app.world_mut().remove_resource::<Ticks>().unwrap()
    });
    assert_eq!(eased.0.len(), 64);
    for (tick, (one, other)) in eased.0.iter().zip(&straight.0).enumerate() {
        assert_eq!(one, other, "tick {tick}");
    }
}

#[test]
fn a_platform_is_drawn_under_its_load() {
    let velocity = Vec3::new(3.0, 0.0, 0.0);
    for shifted in [false, true] {
        let mut app = app(true);
        let motion = ColliderMotion { velocity, ..default() };
        let [platform, ball] = platform_and_ball(&mut app, motion);
        if shifted {
            // A floating origin: all is moved in the twentieth tick.
            let shift = |mut tick: Local<u32>, mut places: Query<&mut Transform>| {
                *tick += 1;
                if *tick == 20 {
                    places.iter_mut().for_each(|mut place| place.translation.x -= 64.0);
                }
            };
            app.add_systems(FixedUpdate, shift);
        }
        // A platform has no velocity in its first tick: the ball slips, by less than a centimetre.
        run(&mut app, 4 * 15);
        let mut last = position(&app, platform).x;
        let gap = position(&app, ball) - position(&app, platform);
        assert!((gap - Vec3::new(1.0, 0.2, 0.0)).length() < 0.01, "{gap}");
        for frame in 0..80 {
            run(&mut app, 1);
            let [under, on] = [platform, ball].map(|entity| position(&app, entity));
            // Rounding of coordinates of up to 64 m; without easing it is up to 3 / 64 m · 3/4 = 35 mm.
            assert!((on - under - gap).length() < 5e-5, "frame {frame}: {under}, {on}");
            let step = (under.x - last + 32.0).rem_euclid(64.0) - 32.0;
            assert!((step - velocity.x * TICK / 4.0).abs() < 2e-5, "frame {frame}: {step} m");
            last = under.x;
        }
    }
}

#[test]
fn the_simulation_does_not_depend_on_what_is_drawn() {
    assert_same_ticks(|app| {
        let motion = ColliderMotion { velocity: Vec3::X, angular_velocity: Vec3::new(0.0, 2.0, 0.1) };
        platform_and_ball(app, motion).to_vec()
    });
}

/// A turning wheel that the game moves in each frame turns at its rate; so does a particle fall that it turns.
#[test]
fn what_the_game_writes_between_ticks_holds_and_the_rest_goes_on() {
    let scene = |app: &mut App| {
        let wheel = ColliderMotion { angular_velocity: Vec3::Z * 2.0, ..default() };
        let [wheel, ball] = platform_and_ball(app, wheel);
        let plain = ParticleCollider::from(Sphere::new(0.5));
        let plain = app.world_mut().spawn((plain, Transform::from_xyz(0.0, 5.0, 0.0))).id();
        let turned = spawn(app, 1.0, 0.1, Vec3::X * 20.0);
        app.add_systems(Update, move |mut frame: Local<u16>, mut places: Query<&mut Transform>| {
            *frame += 1;
            let x = 0.004 * f32::from(*frame);
            places.get_mut(wheel).unwrap().translation.x = x;
            places.get_mut(plain).unwrap().translation.x = -x;
            places.get_mut(turned).unwrap().rotation = Quat::from_rotation_z(x);
        });
        vec![wheel, ball, plain, turned]
    };
    assert_same_ticks(scene);
    let mut app = app(true);
    let [wheel, _, plain, turned] = scene(&mut app)[..] else { panic!("four") };
    run(&mut app, 4 * 30);
    let shown = |entity| *app.world().get::<Transform>(entity).unwrap();
    // The last frame is at the end of a tick, and shows its start: 29 ticks. Each turn is rounded.
    let angle = shown(wheel).rotation.to_axis_angle();
    assert!((angle.1 - 2.0 * 29.0 * TICK).abs() < 30.0 * 4.0 * f32::EPSILON, "{angle:?}");
    let x: f32 = 0.004 * 120.0;
    assert_eq!([shown(wheel), shown(plain)].map(|place| place.translation.x), [x, -x]);
    // v = g t after each tick of semi-implicit or better: at least what semi-implicit Euler falls, less a tick's.
    let fallen = -shown(turned).translation.y;
    let exact = 0.5 * 9.81 * (29.0 * TICK).powi(2);
    assert!((fallen - exact).abs() < 9.81 * TICK * 29.0 * TICK, "{fallen} m, {exact} m");
    assert_eq!(shown(turned).rotation, Quat::from_rotation_z(x));
}

/// One that the game moves in `FixedUpdate` is eased where it asks for that.
#[test]
fn colliders_that_the_game_moves_in_fixed_update_are_eased_on_request() {
    let scene = |app: &mut App| {
        let [platform, ball] = platform_and_ball(app, ColliderMotion::default());
        app.world_mut().entity_mut(platform).remove::<ColliderMotion>().insert(TransformInterpolation);
        app.add_systems(FixedUpdate, move |mut places: Query<&mut Transform>| {
            let mut place = places.get_mut(platform).unwrap();
            place.translation.x += 0.5 * TICK;
            place.rotate_y(0.5 * TICK);
            place.scale.z += 0.5 * TICK;
        });
        vec![platform, ball]
    };
    assert_same_ticks(scene);
    let mut app = app(true);
    let platform = scene(&mut app)[0];
    run(&mut app, 8);
    let mut last = *app.world().get::<Transform>(platform).unwrap();
    for frame in 0..40 {
        run(&mut app, 1);
        let now = *app.world().get::<Transform>(platform).unwrap();
        // Of a small turn: twice the sine of its half.
        let turn = 2.0 * (now.rotation * last.rotation.inverse()).xyz().length();
        for step in [now.translation.x - last.translation.x, now.scale.z - last.scale.z] {
            assert!((step - 0.125 * TICK).abs() < 1e-6, "frame {frame}: {step}");
        }
        assert!((turn - 0.125 * TICK).abs() < 2e-6, "frame {frame}: {turn} rad");
        last = now;
    }
}

/// Taken in the middle of a tick, snapshots and teleports know where colliders are.
#[test]
fn snapshots_and_teleports_between_ticks_are_exact() {
    let motion = ColliderMotion { velocity: Vec3::X, angular_velocity: Vec3::new(0.0, 2.0, 0.1) };
    let run_with = |interpolation: bool, change: &dyn Fn(&mut App)| {
        let mut app = app(interpolation);
        let entities = platform_and_ball(&mut app, motion).to_vec();
        record(&mut app, entities);
        run(&mut app, 4 * 20 + 2);
        change(&mut app);
        run(&mut app, 4 * 20);
        app.world_mut().remove_resource::<Ticks>().unwrap().0
    };
    let undisturbed = run_with(false, &|_| {});
    let restored = run_with(true, &|app| {
        let snapshot = Snapshot::take(app.world());
        run(app, 4 * 5);
        app.world_mut().resource_mut::<Ticks>().0.truncate(20);
        snapshot.restore(app.world_mut());
    });
    assert_eq!(restored[19..], undisturbed[19..]);
    let teleport = |app: &mut App| {
        let motion = Isometry3d::new(Vec3::new(8.0, 0.0, 2.0), Quat::from_rotation_y(0.5));
        Teleport::everything(motion).apply(app.world_mut());
    };
    let [eased, straight] = [true, false].map(|interpolation| run_with(interpolation, &teleport));
    assert_eq!(eased, straight);
    assert_ne!(eased[20], undisturbed[20], "it was moved");
}

#[test]
fn colliders_with_a_motion_are_eased_where_particles_are() {
    for interpolation in [false, true] {
        let mut app = App::new();
        let plugin = MassSpringPlugin::default().with_interpolation(interpolation);
        app.add_plugins((MinimalPlugins, plugin));
        let spawn = |app: &mut App| {
            app.world_mut().spawn((ParticleCollider::half_space(), ColliderMotion::default())).id()
        };
        let before = spawn(&mut app);
        app.finish();
        app.cleanup();
        let after = spawn(&mut app);
        let fixed = app.world_mut().spawn(ParticleCollider::half_space()).id();
        app.update();
        for (entity, expected) in [(before, interpolation), (after, interpolation), (fixed, false)] {
            let entity = app.world().entity(entity);
            assert_eq!(entity.contains::<TranslationInterpolation>(), expected);
            assert_eq!(entity.contains::<RotationInterpolation>(), expected);
        }
    }
}
