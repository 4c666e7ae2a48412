//! Two dimensions: ropes of sprites on layers, a lantern, and balls on a ground. Drag them with the mouse.
//!
//! A metre is a pixel here: gravity is in px/s², radii and lengths are in px. z of each `Transform` is the layer on
//! which its sprite is drawn.

use bevy::prelude::*;
use bevy_mass_spring::drag::ParticleDragSettings;
use bevy_mass_spring::prelude::*;

const LINK: f32 = 26.0;
const BACK: f32 = 0.0;
const FRONT: f32 = 10.0;

fn main() {
    App::new()
        .add_plugins((DefaultPlugins, MassSpringPlugin::default(), ParticleDragPlugin))
        .insert_resource(ClearColor(Color::srgb(0.09, 0.1, 0.14)))
        .insert_resource(Dimensions::Two)
        .insert_resource(Environment { gravity: Vec3::NEG_Y * 981.0, viscosity: 0.2, ..default() })
        .insert_resource(CollisionSettings { restitution: 0.3, friction: 0.4, ..default() })
        // A metre is a pixel for the pointer, too: it must be stronger than gravity.
        .insert_resource(ParticleDragSettings { max_acceleration: 40_000.0, ..default() })
        .add_systems(Startup, (spawn_ropes, spawn_ground))
        .run();
}

/// Two ropes that cross on their layers, and what hangs from them.
fn spawn_ropes(mut commands: Commands) {
    commands.spawn(Camera2d);
    let blue = Color::srgb(0.25, 0.5, 0.9);
    let orange = Color::srgb(0.95, 0.6, 0.2);
    spawn_rope(&mut commands, Vec2::new(-330.0, 300.0), Vec2::new(0.8, -0.6), 18, (BACK, blue));
    let last = spawn_rope(&mut commands, Vec2::new(120.0, 320.0), Vec2::new(-0.6, -0.8), 12, (FRONT, orange));
    let lantern = (Particle::new(6.0, 34.0), Transform::from_xyz(-86.0, 46.0, FRONT + 1.0));
    let lantern =
        commands.spawn((lantern, Sprite::from_color(Color::srgb(1.0, 0.9, 0.5), Vec2::splat(68.0)))).id();
    commands.spawn(Spring::new(last, lantern, 40.0).with_stiffness(4000.0).with_damping(8.0));
}

/// Spawns a rope that hangs from a pinned sprite; returns its last particle.
fn spawn_rope(
    commands: &mut Commands,
    start: Vec2,
    direction: Vec2,
    links: u8,
    (layer, color): (f32, Color),
) -> Entity {
    let hook = (
        Sprite::from_color(Color::WHITE, Vec2::splat(20.0)),
        Transform::from_translation(start.extend(layer)),
    );
    let mut last = commands.spawn((Particle::new(1.0, 8.0), Pinned, hook)).id();
    for link in 1..=links {
        let place = start + direction * LINK * f32::from(link);
        let sprite = Sprite::from_color(color, Vec2::splat(18.0));
        let knot = (Particle::new(0.3, 8.0), sprite, Transform::from_translation(place.extend(layer)));
        let knot = commands.spawn(knot).id();
        commands.spawn(Spring::new(last, knot, LINK).with_stiffness(4000.0).with_damping(4.0));
        last = knot;
    }
    last
}

/// The ground, a slope, and balls of all layers that fall onto them.
fn spawn_ground(mut commands: Commands) {
    let ground = ParticleCollider { restitution: 0.2, friction: 0.5, ..default() };
    let grey = Sprite::from_color(Color::srgb(0.25, 0.27, 0.32), Vec2::new(3000.0, 400.0));
    for transform in [
        Transform::from_xyz(0.0, -280.0, BACK - 1.0),
        Transform::from_xyz(-560.0, -280.0, BACK - 1.0).with_rotation(Quat::from_rotation_z(-0.7)),
    ] {
        // The particles are above y = 0 of the plane, its sprite is below.
        let below = (grey.clone(), Transform::from_xyz(0.0, -200.0, 0.0));
        commands.spawn((ground.clone(), transform, Visibility::default(), children![below]));
    }
    for ball in 0..24_u8 {
        let number = f32::from(ball);
        let radius = 12.0 + 4.0 * (number % 3.0);
        let place = Vec3::new(
            180.0 + 37.0 * (number % 6.0) + 0.7 * number,
            -200.0 + 50.0 * (number / 6.0).floor(),
            number % 5.0,
        );
        let sprite = Sprite::from_color(Color::hsl(15.0 * number, 0.6, 0.6), Vec2::splat(1.7 * radius));
        let ball = Particle::new(radius * radius * 0.002, radius);
        commands.spawn((ball, sprite, Transform::from_translation(place)));
    }
}
