//! Gizmos in a headless app: what is drawn of colliders and contacts, and when contacts are collected.

use std::any::TypeId;

use bevy::asset::AssetPlugin;
use bevy::gizmos::{GizmoAsset, GizmoHandles, GizmoPlugin};
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_mass_spring::prelude::*;

/// A ball that rests on the ground, with gizmos of colliders and contacts only, or without any.
fn app() -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, TransformPlugin, AssetPlugin::default(), MeshPlugin, GizmoPlugin))
        .add_plugins((MassSpringPlugin::default(), MassSpringGizmosPlugin))
        .insert_resource(TimeUpdateStrategy::FixedTimesteps(1));
    app.world_mut().spawn(ParticleCollider::half_space());
    app.world_mut().spawn((Particle::new(2.0, 0.1), Transform::from_xyz(3.0, 0.1, 0.0)));
    draw(&mut app, false, false);
    app.finish();
    app.cleanup();
    app
}

fn draw(app: &mut App, colliders: bool, contacts: bool) {
    let mut store = app.world_mut().resource_mut::<GizmoConfigStore>();
    let (_, gizmos) = store.config_mut::<MassSpringGizmos>();
    (gizmos.particles, gizmos.springs) = (false, false);
    (gizmos.colliders, gizmos.contacts) = (colliders, contacts);
}

/// The colours of all lines of the last frame.
fn colors(app: &App) -> Vec<LinearRgba> {
    let handles = app.world().resource::<GizmoHandles>().handles();
    let Some(Some(handle)) = handles.get(&TypeId::of::<MassSpringGizmos>()) else { return Vec::new() };
    let lines = app.world().resource::<Assets<GizmoAsset>>().get(handle).expect("drawn").buffer();
    // What separates strips has a colour that is not a number.
    let strips = lines.strip_colors.iter().filter(|color| color.red.is_finite());
    lines.list_colors.iter().chain(strips).copied().collect()
}

/// The ends of all lines of the last frame.
fn drawn(app: &App) -> Vec<Vec3> {
    let handles = app.world().resource::<GizmoHandles>().handles();
    let Some(Some(handle)) = handles.get(&TypeId::of::<MassSpringGizmos>()) else { return Vec::new() };
    let lines = app.world().resource::<Assets<GizmoAsset>>().get(handle).expect("drawn").buffer();
    let strips = lines.strip_positions.iter().filter(|place| place.is_finite());
    lines.list_positions.iter().chain(strips).copied().collect()
}

#[test]
fn contacts_are_drawn_and_collected_as_long_as_they_are_switched_on() {
    let mut app = app();
    for _ in 0..20 {
        app.update();
    }
    assert!(drawn(&app).is_empty());
    assert!(!app.world().contains_resource::<Messages<Contact>>(), "nothing is collected");

    draw(&mut app, false, true);
    for _ in 0..3 {
        app.update();
    }
    let places = drawn(&app);
    let foot = Vec3::X * 3.0;
    assert!(places.iter().all(|place| place.distance(foot) < 0.4), "{places:?}");
    // The impulse of its weight in a tick, at 1 m for each N·s.
    let weight = 2.0 * 9.81 / 64.0;
    let top = places.iter().map(|place| place.y).fold(0.0, f32::max);
    assert!((top / weight - 1.0).abs() < 0.02, "the arrow is {top} m long, expected {weight}");

    draw(&mut app, false, false);
    for _ in 0..3 {
        app.update();
    }
    assert!(drawn(&app).is_empty());
    assert!(!app.world().contains_resource::<Messages<Contact>>(), "nothing is collected any more");
}

#[test]
fn what_the_app_asks_for_stays() {
    let mut app = app();
    app.add_message::<Contact>();
    for contacts in [false, true, false] {
        draw(&mut app, false, contacts);
        for _ in 0..3 {
            app.update();
        }
        assert!(!app.world().resource::<Messages<Contact>>().is_empty());
    }
}

#[test]
fn colliders_are_drawn_where_they_are() {
    let mut app = app();
    app.world_mut().spawn((ParticleCollider::from(Sphere::new(0.5)), Transform::from_xyz(0.0, 20.0, 0.0)));
    draw(&mut app, true, false);
    app.update();
    app.update();
    let high: Vec<Vec3> = drawn(&app).into_iter().filter(|place| place.y > 10.0).collect();
    assert!(high.len() > 10, "the ball has an outline");
    assert!(high.iter().all(|place| (place.distance(Vec3::Y * 20.0) - 0.5).abs() < 1e-3));
}

/// The corners of a box of 1 m.
fn corners() -> impl Iterator<Item = Vec3> {
    (0..8_u8).map(|corner| [1, 2, 4].map(|bit| f32::from(u8::from(corner & bit != 0)) - 0.5).into())
}

/// Drawn by its twelve edges, none of them the diagonal of a face, in whatever frame, and again where its points change.
#[cfg(feature = "parry")]
#[test]
fn convex_hulls_are_drawn_by_their_edges() {
    let mut app = app();
    let place = Transform::from_xyz(0.0, 20.0, 0.0).with_scale(Vec3::new(1.0, 2.0, 3.0));
    let inside = [Vec3::ZERO, Vec3::new(0.2, 0.1, 0.3)];
    let hull = |scale: f32| ColliderShape::ConvexHull {
        points: corners().map(|point| scale * point).chain(inside).collect(),
    };
    let collider = app.world_mut().spawn((ParticleCollider::new(hull(1.0)), place)).id();
    draw(&mut app, true, false);
    for scale in [1.0, 1.0, 2.0] {
        app.world_mut().get_mut::<ParticleCollider>(collider).unwrap().shape = hull(scale);
        app.update();
        app.update();
        let ends: Vec<Vec3> = drawn(&app).into_iter().filter(|place| place.y > 10.0).collect();
        assert_eq!(ends.len(), 24);
        for ends in ends.chunks(2) {
            let [x, y, z] = (ends[1] - ends[0]).abs().to_array();
            let along = [(x, 1.0, y + z), (y, 2.0, x + z), (z, 3.0, x + y)];
            // Rounding at 20 m.
            let is_edge = |(length, size, rest): (f32, f32, f32)| (length - scale * size).abs() + rest < 1e-5;
            assert!(along.into_iter().any(is_edge), "{ends:?}");
        }
    }
}

/// Points in one plane have no hull: each is a cross, in the colour of what is left out.
#[test]
fn sensors_and_invalid_colliders_have_colours_of_their_own() {
    let gizmos = MassSpringGizmos::default();
    let flat = ColliderShape::ConvexHull { points: corners().map(|point| point.with_y(0.0)).collect() };
    let sphere = || ParticleCollider::from(Sphere::new(0.5));
    let wide = Transform::from_scale(Vec3::new(1.0, 2.0, 1.0));
    let cases = [
        (sphere(), Transform::default(), gizmos.collider_color),
        (sphere().as_sensor(), Transform::default(), gizmos.sensor_color),
        (sphere(), wide, gizmos.invalid_color),
        (sphere().as_sensor(), wide, gizmos.invalid_color),
        (sphere().with_friction(-1.0), Transform::default(), gizmos.invalid_color),
        (ParticleCollider::new(flat), Transform::default(), gizmos.invalid_color),
    ];
    for (collider, place, expected) in cases {
        let mut app = app();
        let ground =
            app.world_mut().query_filtered::<Entity, With<ParticleCollider>>().single(app.world()).unwrap();
        app.world_mut().despawn(ground);
        let entity = app.world_mut().spawn((collider, place)).id();
        draw(&mut app, true, false);
        for _ in 0..3 {
            app.update();
        }
        let found = colors(&app);
        assert!(!found.is_empty(), "{expected:?}");
        assert!(found.iter().all(|color| *color == expected.to_linear()), "{expected:?}: {found:?}");
        app.world_mut().entity_mut(entity).insert((sphere(), Transform::default()));
        app.update();
        app.update();
        assert!(colors(&app).iter().all(|color| *color == gizmos.collider_color.to_linear()), "corrected");
    }
}
