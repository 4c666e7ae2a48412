//! Paddles that turn among balls and ropes.

use bevy::prelude::*;
use bevy_egui::egui::Ui;
use bevy_mass_spring::prelude::*;

use crate::frame::slider;
use crate::gallery::{AppExhibit, Exhibit};
use crate::stage::{Stage, View};

const EXHIBIT: Exhibit = Exhibit {
    name: "Paddle",
    caption: "A wheel of four paddles hits balls on a conveyor belt, and ropes that hang in its way. What moves is felt as \
              what it is: nothing gets through a thin paddle at any speed.",
    view: View { focus: Vec3::new(0.0, 0.8, 0.0), distance: 6.0, yaw: 0.5, pitch: 0.3 },
};

const ARM: f32 = 0.8;

/// As stiff as the explicit schemes take in some tens of substeps.
const ROPE: RopeMaterial = RopeMaterial {
    linear_density: 0.2,
    stretch_stiffness: 4e3,
    retardation_time: 2e-4,
    ..RopeMaterial::HEMP
};

pub fn plugin(app: &mut App) {
    app.add_exhibit(EXHIBIT, spawn, draw);
}

fn spawn(mut stage: Stage, mut collisions: ResMut<CollisionSettings>) {
    *collisions = CollisionSettings { restitution: 0.4, friction: 0.2, ..default() };
    stage.floor();
    let steel = stage.metal(Color::srgb(0.3, 0.32, 0.36));
    let paddle = Cuboid::new(ARM, 0.02, 0.9);
    let parts: Vec<ColliderPart> = (0..4_u8)
        .map(|number| {
            let rotation = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2 * f32::from(number));
            ColliderPart { shape: paddle.into(), position: rotation * Vec3::X * 0.5 * ARM, rotation }
        })
        .collect();
    let shape = ColliderShape::Compound { parts: parts.clone().into() };
    let motion = ColliderMotion { angular_velocity: Vec3::Z * 2.5, ..default() };
    let place = Transform::from_xyz(0.9, 1.1, 0.0);
    let wheel = ParticleCollider::new(shape).with_restitution(0.5).with_friction(0.2);
    let wheel = stage.spawn((wheel, motion, place, Visibility::default()));
    for part in parts {
        let look = (Mesh3d(stage.meshes.add(paddle)), steel.clone());
        let place = Transform::from_translation(part.position).with_rotation(part.rotation);
        stage.commands.entity(wheel).with_child((look, place));
    }
    let rubber = stage.paint(Color::srgb(0.14, 0.14, 0.15));
    let belt = Cuboid::new(3.0, 0.12, 1.0);
    let look = Mesh3d(stage.meshes.add(belt));
    let moving = ParticleCollider::from(belt).with_friction(0.8).with_surface_velocity(Vec3::X * 0.8);
    stage.spawn((moving, look, rubber, Transform::from_xyz(-1.0, 0.18, 0.0)));
    for number in 0..24_u8 {
        let radius = 0.07 + 0.012 * f32::from(number % 4);
        let look = Mesh3d(stage.meshes.add(Sphere::new(radius)));
        let paint = stage.metal(Color::hsl(15.0 * f32::from(number), 0.7, 0.5));
        let [column, row] = [number % 8, number / 8].map(f32::from);
        let place = Transform::from_xyz(-2.3 + 0.3 * column, 0.4 + 0.03 * column, 0.3 * (row - 1.0));
        stage.spawn((Particle::new(4000.0 * radius.powi(3), radius), look, paint, place));
    }
    let hemp = stage.paint(Color::srgb(0.70, 0.58, 0.38));
    for number in 0..5_u8 {
        let top = Vec3::new(1.55, 3.0, 0.2 * (f32::from(number) - 2.0));
        let rope =
            Rope::between(top, top - Vec3::Y * 1.9).with_spacing(0.06).with_radius(0.025).with_material(ROPE);
        let hook = related!(Parts[(Part::Start, Pinned)]);
        stage.spawn((rope, RopeMesh::default(), hemp.clone(), hook));
    }
}

fn draw(
    mut ui: InMut<Ui>,
    mut wheel: Single<&mut ColliderMotion>,
    mut belts: Query<&mut ParticleCollider, Without<ColliderMotion>>,
) {
    let mut speed = wheel.angular_velocity.z;
    if slider(&mut ui, "wheel", "rad/s", &mut speed, -20.0..=20.0) {
        wheel.angular_velocity.z = speed;
    }
    for mut belt in belts.iter_mut().filter(|belt| belt.shape != ColliderShape::HalfSpace) {
        let mut speed = belt.surface_velocity.x;
        if slider(&mut ui, "belt", "m/s", &mut speed, -3.0..=3.0) {
            belt.surface_velocity.x = speed;
        }
    }
}
