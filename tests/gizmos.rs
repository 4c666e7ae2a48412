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
    (gizmos.planes, gizmos.contacts) = (colliders, contacts);
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
