//! Keys that switch on and off what acts, and what is drawn of it; every window with the panel has them.

use bevy::prelude::*;
use bevy_mass_spring::prelude::*;

/// Adds the keys.
pub fn plugin(app: &mut App) {
    app.add_systems(Update, (toggle_physics, toggle_contacts));
}

/// g toggles gravity, v the viscosity, c the collisions.
fn toggle_physics(
    keys: Res<ButtonInput<KeyCode>>,
    mut environment: ResMut<Environment>,
    mut collisions: ResMut<CollisionSettings>,
) {
    if keys.just_pressed(KeyCode::KeyG) {
        environment.gravity_enabled ^= true;
    }
    if keys.just_pressed(KeyCode::KeyV) {
        environment.viscosity_enabled ^= true;
    }
    if keys.just_pressed(KeyCode::KeyC) {
        let on = !(collisions.ground || collisions.particles);
        (collisions.ground, collisions.particles) = (on, on);
    }
}

/// o toggles the outlines of colliders, and the points, normals and impulses of contacts.
fn toggle_contacts(keys: Res<ButtonInput<KeyCode>>, mut store: ResMut<GizmoConfigStore>) {
    if keys.just_pressed(KeyCode::KeyO) {
        let (_, gizmos) = store.config_mut::<MassSpringGizmos>();
        let on = !(gizmos.colliders || gizmos.contacts);
        (gizmos.colliders, gizmos.contacts) = (on, on);
    }
}
