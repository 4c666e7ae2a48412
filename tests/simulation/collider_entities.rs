//! `ParticleCollider` in an app: where it is, how it moves, what it meets, which messages tell of it.

use bevy::ecs::system::RunSystemOnce;
use bevy::prelude::*;
use bevy_mass_spring::collider::ColliderPart;
use bevy_mass_spring::prelude::*;

use crate::common::*;

fn floating(app: &mut App) {
    app.world_mut().resource_mut::<Environment>().gravity = Vec3::ZERO;
}

/// All that a ball of 0.1 m that comes down on each of these meets is at y = 0.5.
fn shapes() -> Vec<(&'static str, ColliderShape)> {
    let heights = vec![vec![0.5; 3]; 3];
    let block = |y: f32| ColliderPart {
        shape: Cuboid::new(0.4, 0.2, 0.4).into(),
        position: Vec3::Y * y,
        ..default()
    };
    vec![
        ("sphere", Sphere::new(0.5).into()),
        ("cuboid", Cuboid::new(1.0, 1.0, 1.0).into()),
        ("capsule", Capsule3d::new(0.2, 0.6).into()),
        ("cylinder", Cylinder::new(0.3, 1.0).into()),
        ("cone", Cone { radius: 0.3, height: 1.0 }.into()),
        ("frustum", ConicalFrustum { radius_top: 0.1, radius_bottom: 0.4, height: 1.0 }.into()),
        (
            "hull",
            ColliderShape::ConvexHull {
                points: [
                    Vec3::ONE,
                    -Vec3::ONE,
                    Vec3::new(1.0, 1.0, -1.0),
                    Vec3::new(-1.0, 1.0, 1.0),
                    Vec3::new(-1.0, 1.0, -1.0),
                ]
                .map(|point| 0.5 * point)
                .into_iter()
                .collect(),
            },
        ),
        ("heights", ColliderShape::HeightField { size: Vec2::splat(2.0), heights: heights.into() }),
        ("compound", ColliderShape::Compound { parts: vec![block(0.4), block(-0.4)].into() }),
    ]
}

#[test]
fn every_shape_is_met_where_it_is_seen() {
    for (name, shape) in shapes() {
        let mut app = app();
        floating(&mut app);
        // Under a parent, twice as large, and turned about y.
        let root = Transform::from_xyz(3.0, -1.0, 2.0).with_rotation(Quat::from_rotation_y(0.7));
        let root = app.world_mut().spawn(root.with_scale(Vec3::splat(2.0))).id();
        app.world_mut().spawn((
            ParticleCollider::new(shape),
            Transform::from_xyz(0.5, 0.0, 0.0),
            ChildOf(root),
        ));
        let centre = Vec3::new(3.0, -1.0, 2.0) + Quat::from_rotation_y(0.7) * Vec3::X;
        let ball = spawn(&mut app, 1.0, 0.1, centre + Vec3::Y * 1.3);
        app.world_mut().entity_mut(ball).insert(ParticleVelocity(Vec3::NEG_Y * 2.0));
        run(&mut app, 40);
        let found = position(&app, ball) - centre;
        assert!((found - Vec3::Y * 1.1).length() < 2e-5, "{name}: {found}");
        assert!(velocity(&app, ball).length() < 1e-4, "{name}: {}", velocity(&app, ball));
    }
}

#[test]
fn a_platform_that_moves_carries_a_ball_and_a_turning_one_takes_it_round() {
    for integrator in Integrator::ALL {
        let mut app = app();
        app.insert_resource(scheme(integrator, 4));
        let platform = ParticleCollider::from(Cuboid::new(4.0, 0.2, 4.0)).with_friction(2.0);
        let platform = app.world_mut().spawn((platform, Transform::from_xyz(0.0, -0.1, 0.0))).id();
        let ball = spawn(&mut app, 1.0, 0.1, Vec3::new(1.0, 0.1, 0.0));
        run(&mut app, 10);
        for _ in 0..64 {
            app.world_mut().get_mut::<Transform>(platform).unwrap().translation +=
                Vec3::new(0.5, 0.25, 0.0) * TICK;
            run(&mut app, 1);
        }
        let found = position(&app, ball);
        assert!(found.distance(Vec3::new(1.5, 0.35, 0.0)) < 0.02, "{integrator}: {found}");
        assert!(velocity(&app, ball).distance(Vec3::new(0.5, 0.25, 0.0)) < 0.01, "{integrator}");
        app.world_mut()
            .entity_mut(platform)
            .insert(ColliderMotion { angular_velocity: Vec3::Y, ..default() });
        run(&mut app, 64);
        // About (0.5, 0.25): a radian about the centre of the platform, 1 m away; it slips as it starts.
        let arm = position(&app, ball) - Vec3::new(0.5, 0.35, 0.0);
        let angle = f32::atan2(-arm.z, arm.x);
        assert!((angle - 1.0).abs() < 0.15 && (arm.length() - 1.0).abs() < 0.1, "{integrator}: {arm}");
    }
}

#[derive(Resource, Default)]
struct Told(Vec<(&'static str, Entity, Entity)>);

#[test]
fn what_begins_and_ends_to_touch_is_told_once() {
    let mut app = app();
    floating(&mut app);
    app.add_message::<ContactStarted>().add_message::<ContactEnded>().init_resource::<Told>();
    let gate = ParticleCollider::from(Cuboid::new(1.0, 1.0, 1.0)).as_sensor();
    let gate = app.world_mut().spawn((gate, ContactEvents)).id();
    app.add_observer(|event: On<ContactStarted>, mut told: ResMut<Told>| {
        told.0.push(("started", event.entity, event.other));
    });
    app.add_observer(|event: On<ContactEnded>, mut told: ResMut<Told>| {
        told.0.push(("ended", event.entity, event.other));
    });
    let ball = spawn(&mut app, 1.0, 0.1, Vec3::X * -1.0);
    app.world_mut().entity_mut(ball).insert(ParticleVelocity(Vec3::X * 2.0));
    let (mut started, mut ended) = (Vec::new(), Vec::new());
    for tick in 0..64 {
        run(&mut app, 1);
        let x = position(&app, ball).x;
        let (begun, ceased) = (messages::<ContactStarted>(&mut app), messages::<ContactEnded>(&mut app));
        assert!(begun.is_empty() || (-0.6..-0.6 + 2.0 * TICK + 1e-5).contains(&x), "tick {tick} at {x} m");
        started.extend(begun);
        ended.extend(ceased);
    }
    assert_eq!(started.iter().map(|event| (event.entity, event.other)).collect::<Vec<_>>(), [(ball, gate)]);
    assert_eq!(ended.iter().map(|event| (event.entity, event.other)).collect::<Vec<_>>(), [(ball, gate)]);
    assert!((velocity(&app, ball) - Vec3::X * 2.0).length() < 1e-6, "a sensor lets through");
    let told = &app.world().resource::<Told>().0;
    assert_eq!(*told, [("started", gate, ball), ("ended", gate, ball)]);
}

#[test]
fn layers_and_materials_of_particles_and_nets_count() {
    let mut app = app();
    app.world_mut().spawn((
        ParticleCollider::from(Cuboid::new(9.0, 1.0, 9.0)),
        Transform::from_xyz(0.0, -0.5, 0.0),
        ContactLayers::new(1, 1),
    ));
    let through = spawn(&mut app, 1.0, 0.1, Vec3::new(-2.0, 0.2, 0.0));
    app.world_mut().entity_mut(through).insert(ContactLayers::new(2, 2));
    let resting = spawn(&mut app, 1.0, 0.1, Vec3::new(-1.0, 0.2, 0.0));
    app.world_mut().entity_mut(resting).insert(ContactMaterial {
        friction: 1.0,
        restitution: 0.0,
        ..default()
    });
    let rope = |x: f32| Rope::between(Vec3::new(x, 0.3, -0.5), Vec3::new(x, 0.3, 0.5)).with_segments(8);
    let falling = app.world_mut().spawn((rope(1.0), ContactLayers::new(2, u32::MAX))).id();
    let lying = app.world_mut().spawn((rope(2.0), ContactLayers::new(1, 1))).id();
    run(&mut app, 64);
    assert!(position(&app, through).y < -1.0 && position(&app, resting).y > 0.09);
    let height = |net| app.world().get::<ParticleNet>(net).unwrap().positions()[4].y;
    assert!(height(falling) < -1.0, "{}", height(falling));
    assert!(height(lying) > -0.01, "{}", height(lying));
}

#[test]
fn a_circle_and_a_rectangle_in_two_dimensions_leave_layers_alone() {
    for integrator in Integrator::ALL {
        let mut app = app();
        app.insert_resource(scheme(integrator, 4)).insert_resource(Dimensions::Two);
        app.world_mut().spawn((ParticleCollider::from(Circle::new(0.5)), Transform::from_xyz(0.0, 0.0, 7.0)));
        let tilted = Transform::from_xyz(0.0, -2.0, -3.0).with_rotation(Quat::from_rotation_z(0.1));
        app.world_mut().spawn((ParticleCollider::from(Rectangle::new(9.0, 1.0)).with_friction(1.0), tilted));
        app.world_mut()
            .spawn((ParticleCollider::from(RegularPolygon::new(0.5, 5)), Transform::from_xyz(2.0, 0.0, 1.0)));
        let balls = [0.02, 1.9].map(|x| spawn(&mut app, 1.0, 0.1, Vec3::new(x, 1.5, 5.5)));
        let mut lowest = f32::INFINITY;
        for _ in 0..100 {
            run(&mut app, 1);
            let place = position(&app, balls[0]);
            assert_eq!(place.z.to_bits(), 5.5_f32.to_bits(), "{integrator}");
            assert!(place.truncate().length() > 0.6 - 1e-4, "{integrator}: {place}");
            lowest = lowest.min(place.y);
        }
        // It slid off the circle onto the rectangle, and stays.
        assert!(lowest < 0.0 && lowest > -2.2, "{integrator}: {lowest}");
    }
}

#[test]
fn rays_balls_and_points_find_what_is_there() {
    let mut app = app();
    floating(&mut app);
    let wall = ParticleCollider::from(Cuboid::new(1.0, 4.0, 4.0));
    let wall =
        app.world_mut().spawn((wall, Transform::from_xyz(5.0, 0.0, 0.0), ContactLayers::new(1, 1))).id();
    let ball = spawn(&mut app, 1.0, 0.5, Vec3::X * 2.0);
    app.world_mut().entity_mut(ball).insert(ContactLayers::new(2, u32::MAX));
    let rope = Rope::between(Vec3::new(-2.0, -1.0, 0.0), Vec3::new(-2.0, 1.0, 0.0))
        .with_segments(4)
        .with_radius(0.1);
    let rope = app.world_mut().spawn(rope).id();
    run(&mut app, 2);
    type Found = (
        Option<ParticleHit>,
        Option<ParticleHit>,
        Option<ParticleHit>,
        Option<ParticleHit>,
        Option<ParticleHit>,
    );
    let ask = move |mut queries: ParticleQueries| -> Found {
        let all = ParticleQueryFilter::default();
        let ray = Ray3d::new(Vec3::ZERO, Dir3::X);
        (
            queries.cast_ray(ray, 10.0, all),
            queries.cast_ray(ray, 10.0, ParticleQueryFilter::from_layers(ContactLayers::new(1, 1))),
            queries.cast_sphere(0.25, Ray3d::new(Vec3::Y * 1.9, Dir3::X), 10.0, all),
            queries.cast_ray(Ray3d::new(Vec3::ZERO, Dir3::NEG_X), 10.0, all),
            queries.closest_point(Vec3::new(4.0, 0.5, 0.0), 1.0, all),
        )
    };
    let (first, layered, wide, back, near) = app.world_mut().run_system_once(ask).unwrap();
    let check = |hit: Option<ParticleHit>, entity: Entity, distance: f32, normal: Vec3| {
        let hit = hit.expect("something is there");
        assert_eq!(hit.entity, entity);
        assert!((hit.distance - distance).abs() < 1e-4 && hit.normal.distance(normal) < 1e-4, "{hit:?}");
    };
    check(first, ball, 1.5, Vec3::NEG_X);
    // The ball is in layer 2 only, and does not hide the wall.
    check(layered, wall, 4.5, Vec3::NEG_X);
    check(wide, wall, 4.25, Vec3::NEG_X);
    check(back, rope, 1.9, Vec3::X);
    assert_eq!(back.unwrap().index, Some(2));
    check(near, wall, 0.5, Vec3::NEG_X);
    assert_eq!(near.unwrap().point, Vec3::new(4.5, 0.5, 0.0));
}

#[test]
fn a_snapshot_holds_colliders() {
    let mut app = app();
    let ground = ParticleCollider::from(Cuboid::new(9.0, 1.0, 9.0)).with_friction(0.3);
    let turning = ColliderMotion { angular_velocity: Vec3::Y * 0.5, ..default() };
    let ground = app.world_mut().spawn((ground, Transform::from_xyz(0.0, -0.5, 0.0), turning)).id();
    let balls: Vec<Entity> =
        (0..5_u8).map(|ball| spawn(&mut app, 1.0, 0.1, Vec3::new(0.3 * f32::from(ball), 0.5, 0.0))).collect();
    run(&mut app, 30);
    let snapshot = Snapshot::take(app.world());
    let bits = |app: &App| {
        balls.iter().map(|ball| position(app, *ball).to_array().map(f32::to_bits)).collect::<Vec<_>>()
    };
    run(&mut app, 30);
    let expected = bits(&app);
    app.world_mut().get_mut::<ParticleCollider>(ground).unwrap().friction = 0.0;
    app.world_mut().get_mut::<Transform>(ground).unwrap().translation.y = 3.0;
    run(&mut app, 5);
    snapshot.restore(app.world_mut());
    run(&mut app, 30);
    assert_eq!(bits(&app), expected);
}

/// A sphere comes up by 1 m in a tick, past a ball 0.5 m above, a stick turns by half a radian: both strike in the very first one.
#[test]
fn a_moving_collider_strikes_in_its_first_tick() {
    for integrator in Integrator::ALL {
        let mut app = app();
        floating(&mut app);
        app.insert_resource(scheme(integrator, 4));
        let rising = ColliderMotion { velocity: Vec3::Y / TICK, ..default() };
        app.world_mut().spawn((ParticleCollider::from(Sphere::new(0.1)), rising));
        let hit = spawn(&mut app, 1.0, 0.05, Vec3::Y * 0.5);
        let parent = app.world_mut().spawn(Transform::from_xyz(5.0, 0.0, 0.0)).id();
        let turning = ColliderMotion { angular_velocity: Vec3::Y * 0.5 / TICK, ..default() };
        let stick = Transform::from_rotation(Quat::from_rotation_z(std::f32::consts::FRAC_PI_2));
        app.world_mut().spawn((
            ParticleCollider::from(Capsule3d::new(0.05, 2.0)),
            stick,
            turning,
            ChildOf(parent),
        ));
        let swept = spawn(&mut app, 1.0, 0.05, Vec3::new(5.8, 0.0, -0.2));
        run(&mut app, 1);
        assert!(velocity(&app, hit).y > 0.9 / TICK, "{integrator}: {}", velocity(&app, hit));
        assert!(velocity(&app, swept).length() > 0.3 / TICK, "{integrator}: {}", velocity(&app, swept));
    }
}

/// What is restarted begins where it began, not a tick later.
#[test]
fn a_restart_puts_moving_colliders_back() {
    let mut app = app();
    let moving = ColliderMotion { velocity: Vec3::X, ..default() };
    let platform = app.world_mut().spawn((ParticleCollider::from(Cuboid::new(1.0, 0.2, 1.0)), moving)).id();
    spawn(&mut app, 1.0, 0.1, Vec3::Y);
    run(&mut app, 10);
    RestoreInitialState.apply(app.world_mut());
    run(&mut app, 1);
    let place = app.world().get::<Transform>(platform).unwrap().translation.x;
    assert!((place - TICK).abs() < 1e-6, "{place} m");
}
