//! `ParticleQueries`: rays, balls and closest points against colliders, particles and the bodies of nets.

use bevy::ecs::system::RunSystemOnce;
use bevy::prelude::*;
use bevy_mass_spring::collider::ColliderPart;
use bevy_mass_spring::prelude::*;

use crate::common::*;

/// What a gap that counts as none, 1e-7 m, and the rounding of some metres to f32 may change of a distance, m.
const EXACT: f32 = 1e-5;

/// Without gravity, so that all stays where it is.
fn floating() -> App {
    let mut app = app();
    app.world_mut().resource_mut::<Environment>().gravity = Vec3::ZERO;
    app
}

fn ray(origin: Vec3, towards: Vec3) -> Ray3d {
    Ray3d::new(origin, Dir3::new(towards).expect("a direction"))
}

fn cast(app: &mut App, ray: Ray3d, radius: f32) -> Option<ParticleHit> {
    let system = move |mut queries: ParticleQueries| queries.cast_sphere(radius, ray, 20.0, default());
    app.world_mut().run_system_once(system).expect("its parameters are valid")
}

fn all(app: &mut App, ray: Ray3d, layers: ContactLayers) -> Vec<Entity> {
    let system = move |mut queries: ParticleQueries| {
        let hits = queries.cast_ray_all(ray, f32::INFINITY, ParticleQueryFilter::from_layers(layers));
        hits.iter().map(|hit| hit.entity).collect::<Vec<Entity>>()
    };
    app.world_mut().run_system_once(system).expect("its parameters are valid")
}

fn closest(app: &mut App, point: Vec3, max_distance: f32) -> Option<ParticleHit> {
    let system = move |mut queries: ParticleQueries| queries.closest_point(point, max_distance, default());
    app.world_mut().run_system_once(system).expect("its parameters are valid")
}

#[track_caller]
fn check(hit: Option<ParticleHit>, entity: Entity, distance: f32, point: Vec3, normal: Vec3) -> ParticleHit {
    let hit = hit.expect("something is there");
    assert_eq!(hit.entity, entity, "{hit:?}");
    assert!((hit.distance - distance).abs() < EXACT, "{hit:?}");
    assert!(hit.point.distance(point) < EXACT && hit.normal.distance(normal) < 1e-4, "{hit:?}");
    hit
}

/// A cloth of 2 × 2 m in the plane y = 0 with particles 1 m apart: nothing but its faces is below 0.3 m beside its centre.
fn coarse_cloth(app: &mut App) -> Entity {
    let (corner, [x, z]) = (Vec3::new(-1.0, 0.0, -1.0), [Vec3::X, Vec3::Z].map(|axis| axis * 2.0));
    let cloth = Cloth { radius: 0.05, ..Cloth::grid(corner, x, z, UVec2::splat(2)) };
    let cloth = app.world_mut().spawn(cloth).id();
    run(app, 2);
    cloth
}

#[test]
fn what_goes_between_the_threads_of_a_cloth_meets_it() {
    let mut app = floating();
    let cloth = coarse_cloth(&mut app);
    let above = Vec3::new(0.3, 2.0, 0.4);
    let down = ray(above, Vec3::NEG_Y);
    let hit = check(cast(&mut app, down, 0.0), cloth, 1.95, above.with_y(0.05), Vec3::Y);
    // Of the nine, number 4 is in the middle.
    assert_eq!(hit.index, Some(4));
    let net = app.world().get::<ParticleNet>(cloth).unwrap();
    let corners = net.topology().triangles[hit.triangle.expect("it has faces") as usize];
    assert!(corners.contains(&4), "{corners:?}");
    check(cast(&mut app, down, 0.2), cloth, 1.75, above.with_y(0.05), Vec3::Y);
    let up = ray(above.with_y(-2.0), Vec3::Y);
    check(cast(&mut app, up, 0.0), cloth, 1.95, above.with_y(-0.05), Vec3::NEG_Y);
    check(closest(&mut app, above.with_y(0.25), 0.3), cloth, 0.2, above.with_y(0.05), Vec3::Y);
    assert_eq!(closest(&mut app, above.with_y(0.25), 0.19), None);
    // Inside of its thickness.
    check(closest(&mut app, above.with_y(-0.01), 1.0), cloth, -0.04, above.with_y(-0.05), Vec3::NEG_Y);
    // Beside its edge, which is round: 0.03 m beyond it is 0.04 m thick.
    let beside = Vec3::new(1.03, 2.0, 0.4);
    let normal = Vec3::new(0.6, 0.8, 0.0);
    check(cast(&mut app, ray(beside, Vec3::NEG_Y), 0.0), cloth, 1.96, beside.with_y(0.04), normal);
    assert_eq!(cast(&mut app, ray(Vec3::new(1.06, 2.0, 0.4), Vec3::NEG_Y), 0.0), None);
}

#[test]
fn what_goes_between_the_particles_of_a_rope_meets_it() {
    let mut app = floating();
    let rope = Rope::between(Vec3::ZERO, Vec3::X * 4.0).with_segments(4).with_radius(0.05);
    let rope = app.world_mut().spawn(rope).id();
    run(&mut app, 2);
    let above = Vec3::new(1.4, 2.0, 0.0);
    let hit = check(cast(&mut app, ray(above, Vec3::NEG_Y), 0.0), rope, 1.95, above.with_y(0.05), Vec3::Y);
    assert_eq!((hit.index, hit.triangle), (Some(1), None));
    // By 0.03 m beside its axis; a ball of 0.2 m by 0.15 m.
    let beside = above.with_z(0.03);
    let normal = Vec3::new(0.0, 0.8, 0.6);
    check(cast(&mut app, ray(beside, Vec3::NEG_Y), 0.0), rope, 1.96, beside.with_y(0.04), normal);
    let beside = above.with_z(0.15);
    let point = Vec3::new(1.4, 0.04, 0.03);
    check(cast(&mut app, ray(beside, Vec3::NEG_Y), 0.2), rope, 2.0 - 0.2, point, normal);
    assert_eq!(cast(&mut app, ray(above.with_z(0.06), Vec3::NEG_Y), 0.0), None);
    check(
        closest(&mut app, Vec3::new(2.5, -0.5, 0.0), 1.0),
        rope,
        0.45,
        Vec3::new(2.5, -0.05, 0.0),
        Vec3::NEG_Y,
    );
}

/// The simulation and the queries see the same body: where a ball has come to rest on a cloth, the query finds it touching, to
/// how far it falls in a tick.
#[test]
fn queries_find_a_net_where_the_simulation_stops_at_it() {
    let mut app = app();
    let cloth = coarse_cloth(&mut app);
    let mut net = app.world_mut().get_mut::<ParticleNet>(cloth).unwrap();
    (0..9).for_each(|particle| net.set_pinned(particle, true));
    let ball = spawn(&mut app, 1.0, 0.1, Vec3::new(0.3, 0.2, 0.4));
    run(&mut app, 64);
    let centre = position(&app, ball);
    let slack = 0.5 * 9.81 * TICK * TICK;
    let system = move |mut queries: ParticleQueries| {
        let is_other = |entity: Entity| entity != ball;
        let filter = ParticleQueryFilter::default().with_predicate(&is_other);
        let touching = queries.overlap_sphere(centre, 0.1 + slack, filter);
        (touching, queries.overlap_sphere(centre, 0.1 - slack, filter))
    };
    let (touching, apart) = app.world_mut().run_system_once(system).unwrap();
    assert!(apart.is_empty(), "{apart:?}");
    assert_eq!(touching.iter().map(|hit| hit.entity).collect::<Vec<_>>(), [cloth]);
    assert!(touching[0].normal.distance(Vec3::Y) < 1e-4, "{touching:?}");
}

#[test]
fn in_two_dimensions_depth_does_not_count() {
    let mut app = floating();
    app.insert_resource(Dimensions::Two);
    let circle = (ParticleCollider::from(Circle::new(0.5)), Transform::from_xyz(2.0, 0.0, 7.0));
    let circle = app.world_mut().spawn(circle).id();
    let ball = spawn(&mut app, 1.0, 0.25, Vec3::new(0.0, 3.0, -4.0));
    let rope = Rope::between(Vec3::new(-3.0, -1.0, 5.0), Vec3::new(-3.0, 1.0, 5.0));
    let rope = app.world_mut().spawn(rope.with_segments(2).with_radius(0.1)).id();
    // A box that is tilted about x is as high in the plane as it is thick along the tilted axis there: 1 m · √2 / 2 above.
    let tilted =
        Transform::from_xyz(0.0, -4.0, 9.0).with_rotation(Quat::from_rotation_x(std::f32::consts::FRAC_PI_4));
    let tilted = app.world_mut().spawn((ParticleCollider::from(Cuboid::new(2.0, 1.0, 9.0)), tilted)).id();
    run(&mut app, 2);
    let origin = Vec3::new(0.0, 0.0, -2.0);
    // Points are in the layer of the ray.
    check(cast(&mut app, ray(origin, Vec3::X), 0.0), circle, 1.5, Vec3::new(1.5, 0.0, -2.0), Vec3::NEG_X);
    check(cast(&mut app, ray(origin, Vec3::X), 0.5), circle, 1.0, Vec3::new(1.5, 0.0, -2.0), Vec3::NEG_X);
    check(cast(&mut app, ray(origin, Vec3::Y), 0.0), ball, 2.75, Vec3::new(0.0, 2.75, -2.0), Vec3::NEG_Y);
    let hit = check(
        cast(&mut app, ray(origin + Vec3::Y * 0.6, Vec3::NEG_X), 0.0),
        rope,
        2.9,
        Vec3::new(-2.9, 0.6, -2.0),
        Vec3::X,
    );
    assert_eq!(hit.index, Some(2));
    let top = -4.0 + std::f32::consts::FRAC_1_SQRT_2;
    check(cast(&mut app, ray(origin, Vec3::NEG_Y), 0.0), tilted, -top, Vec3::new(0.0, top, -2.0), Vec3::Y);
    // A direction counts by its x and y, one along z is a point.
    check(
        cast(&mut app, ray(origin, Vec3::new(1.0, 0.0, 5.0)), 0.0),
        circle,
        1.5,
        Vec3::new(1.5, 0.0, -2.0),
        Vec3::NEG_X,
    );
    assert_eq!(cast(&mut app, ray(origin, Vec3::Z), 0.0), None);
    let hit = cast(&mut app, ray(Vec3::new(2.3, 0.0, 50.0), Vec3::NEG_Z), 0.0);
    check(hit, circle, 0.0, Vec3::new(2.5, 0.0, 50.0), Vec3::X);
    check(
        closest(&mut app, Vec3::new(1.0, 0.0, 1.0), 1.0),
        circle,
        0.5,
        Vec3::new(1.5, 0.0, 1.0),
        Vec3::NEG_X,
    );
    // In three dimensions nothing of them is there.
    app.insert_resource(Dimensions::Three);
    assert_eq!(cast(&mut app, ray(origin, Vec3::X), 0.0), None);
}

#[test]
fn layers_count_of_colliders_particles_and_nets() {
    let mut app = floating();
    let ball = spawn(&mut app, 1.0, 0.5, Vec3::X * 2.0);
    app.world_mut().entity_mut(ball).insert(ContactLayers::new(1, u32::MAX));
    let rope = Rope::between(Vec3::new(4.0, -1.0, 0.0), Vec3::new(4.0, 1.0, 0.0)).with_radius(0.1);
    let rope = app.world_mut().spawn((rope, ContactLayers::new(2, u32::MAX))).id();
    let wall = (ParticleCollider::from(Cuboid::new(1.0, 4.0, 4.0)), ContactLayers::new(4, 0b1001));
    let wall = app.world_mut().spawn((wall, Transform::from_xyz(6.0, 0.0, 0.0))).id();
    run(&mut app, 2);
    let along = ray(Vec3::ZERO, Vec3::X);
    let mut found = |memberships, filters| all(&mut app, along, ContactLayers::new(memberships, filters));
    assert_eq!(found(u32::MAX, u32::MAX), [ball, rope, wall]);
    assert_eq!(found(u32::MAX, 1), [ball]);
    assert_eq!(found(u32::MAX, 2 | 4), [rope, wall]);
    // The wall does not filter layer 2.
    assert_eq!(found(2, u32::MAX), [ball, rope]);
    assert_eq!(found(8, 4), [wall]);
    assert!(found(u32::MAX, 0).is_empty());
}

#[test]
fn sensors_and_what_a_predicate_leaves_out_are_not_found() {
    let mut app = floating();
    let gate = ParticleCollider::from(Sphere::new(0.5)).as_sensor();
    let gate = app.world_mut().spawn((gate, Transform::from_xyz(2.0, 0.0, 0.0))).id();
    let player = spawn(&mut app, 1.0, 0.5, Vec3::ZERO);
    let block = |y: f32| ColliderPart {
        shape: Cuboid::from_length(1.0).into(),
        position: Vec3::new(0.0, y, 0.0),
        ..default()
    };
    let wall = ParticleCollider::new(ColliderShape::Compound { parts: vec![block(0.5), block(-0.5)].into() });
    let wall = app.world_mut().spawn((wall, Transform::from_xyz(5.0, 0.0, 0.0))).id();
    let system = move |mut queries: ParticleQueries| {
        let (eye, all) = (ray(Vec3::ZERO, Vec3::X), ParticleQueryFilter::default());
        let is_other = |entity: Entity| entity != player;
        let others = all.with_predicate(&is_other);
        let hits = queries.cast_ray_all(eye, 10.0, all.with_sensors());
        // From near to far, each once; the ray starts inside of the player.
        let expected = [(player, 0.0), (gate, 1.5), (wall, 4.5)];
        assert_eq!(hits.iter().map(|hit| hit.entity).collect::<Vec<_>>(), expected.map(|(entity, _)| entity));
        hits.iter().zip(expected).for_each(|(hit, (_, distance))| {
            assert!((hit.distance - distance).abs() < EXACT, "{hit:?}");
        });
        assert_eq!(queries.cast_ray_all(eye, 4.4, others.with_sensors()).len(), 1);
        // From the centre, the surface is as near on all sides: that where the ray comes from counts.
        check(queries.cast_ray(eye, 10.0, all), player, 0.0, Vec3::X * -0.5, Vec3::NEG_X);
        check(queries.cast_ray(eye, 10.0, others), wall, 4.5, Vec3::X * 4.5, Vec3::NEG_X);
        let with_sensors = others.with_sensors();
        check(queries.cast_ray(eye, 10.0, with_sensors), gate, 1.5, Vec3::X * 1.5, Vec3::NEG_X);
        let near = Vec3::X * 1.0;
        check(queries.closest_point(near, 1.0, with_sensors), gate, 0.5, Vec3::X * 1.5, Vec3::NEG_X);
        assert_eq!(queries.closest_point(near, 1.0, others), None);
        let touched: Vec<Entity> =
            queries.overlap_sphere(Vec3::X, 1.0, all.with_sensors()).iter().map(|hit| hit.entity).collect();
        let both = if player < gate { [player, gate] } else { [gate, player] };
        assert_eq!(touched, both, "both are 0.5 m away");
    };
    app.world_mut().run_system_once(system).unwrap();
}

#[test]
fn numbers_that_are_none_find_nothing() {
    let mut app = floating();
    app.world_mut().spawn(ParticleCollider::half_space());
    let odd = app.world_mut().spawn((Particle { mass: 1.0, radius: f32::NAN }, Transform::default())).id();
    let system = move |mut queries: ParticleQueries| {
        let all = ParticleQueryFilter::default();
        for bad in [f32::NAN, -1.0] {
            assert_eq!(queries.cast_ray(ray(Vec3::Y, Vec3::NEG_Y), bad, all), None);
            assert_eq!(queries.cast_sphere(bad, ray(Vec3::Y, Vec3::NEG_Y), 10.0, all), None);
            assert_eq!(queries.closest_point(Vec3::Y, bad, all), None);
            assert!(queries.overlap_sphere(Vec3::Y, bad, all).is_empty());
        }
        assert_eq!(queries.cast_ray(ray(Vec3::NAN, Vec3::NEG_Y), 10.0, all), None);
        assert_eq!(queries.closest_point(Vec3::NAN, 10.0, all), None);
        let hits = queries.cast_ray_all(ray(Vec3::Y, Vec3::NEG_Y), f32::INFINITY, all);
        assert!(hits.len() == 1 && hits[0].entity != odd, "{hits:?}");
        assert!((hits[0].distance - 1.0).abs() < EXACT, "{hits:?}");
    };
    app.world_mut().run_system_once(system).unwrap();
}
