//! The smallest scene with a picture: two balls on springs above the ground, drawn with gizmos.

use bevy::prelude::*;
use bevy_mass_spring::prelude::*;

fn main() {
    App::new()
        .add_plugins((DefaultPlugins, MassSpringPlugin::default(), MassSpringGizmosPlugin))
        .add_systems(Startup, |mut commands: Commands| {
            let ball = Particle::new(1.0, 0.1); // kg, m
            let anchor = commands.spawn((ball, Pinned, Transform::from_xyz(0.0, 3.0, 0.0))).id();
            let first = commands.spawn((ball, Transform::from_xyz(0.7, 2.3, 0.0))).id();
            let second = commands.spawn((ball, Transform::from_xyz(1.4, 1.6, 0.0))).id();
            commands.spawn(Spring::new(anchor, first, 1.0).with_stiffness(200.0).with_damping(2.0));
            commands.spawn(Spring::new(first, second, 1.0).with_stiffness(200.0).with_damping(2.0));
            commands.spawn(ParticleCollider::default()); // the ground, y = 0
            let eye = Transform::from_xyz(0.0, 2.5, 7.0).looking_at(Vec3::Y * 1.5, Vec3::Y);
            commands.spawn((Camera3d::default(), eye));
        })
        .run();
}
