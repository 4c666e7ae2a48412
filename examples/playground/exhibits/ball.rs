//! A cloth on a ball that begins to turn.

use bevy::prelude::*;
use bevy_egui::egui::Ui;
use bevy_mass_spring::prelude::*;

use crate::frame::slider;
use crate::gallery::{AppExhibit, Exhibit};
use crate::stage::{Stage, View};

const EXHIBIT: Exhibit = Exhibit {
    name: "Turning ball",
    caption: "A cloth falls onto a ball on the floor; then the ball turns, and friction winds the cloth round it, fold on \
              fold (after Bridson, Fedkiw and Anderson 2002).",
    view: View { focus: Vec3::new(0.0, 0.45, 0.0), distance: 4.4, yaw: 0.4, pitch: 0.35 },
};

const RADIUS: f32 = 0.4;
/// When it begins to turn, s.
const BEGIN: f32 = 2.0;

pub fn plugin(app: &mut App) {
    app.insert_resource(Turning { speed: 2.0, since: 0.0 })
        .add_exhibit(EXHIBIT, spawn, draw)
        .add_systems(FixedUpdate, turn);
}

#[derive(Resource)]
struct Turning {
    /// rad/s
    speed: f32,
    /// The exhibit's own time, s.
    since: f32,
}

#[derive(Component)]
struct Ball;

fn spawn(mut stage: Stage, mut collisions: ResMut<CollisionSettings>, mut turning: ResMut<Turning>) {
    *collisions = CollisionSettings { friction: 0.3, ..default() };
    turning.since = 0.0;
    stage.floor();
    let paint = stage.paint(Color::srgb(0.75, 0.30, 0.18));
    let look = Mesh3d(stage.meshes.add(Sphere::new(RADIUS).mesh().ico(5).expect("few enough triangles")));
    let ball = ParticleCollider::from(Sphere::new(RADIUS)).with_friction(0.7);
    let place = Transform::from_xyz(0.0, RADIUS + 0.02, 0.0);
    stage.spawn((Ball, ball, ColliderMotion::default(), look, paint, place));
    let cloth = Cloth::from(Plane3d::new(Vec3::Y, Vec2::splat(1.05)))
        .with_cells(UVec2::splat(28))
        .with_radius(0.012)
        .with_material(ClothMaterial {
            area_density: 0.15,
            stretch_stiffness: 200.0,
            retardation_time: 3e-4,
            ..ClothMaterial::SILK
        });
    let paint = stage.cloth(Color::srgb(0.18, 0.36, 0.62));
    stage.spawn((cloth, NetMesh, paint, Transform::from_xyz(0.0, 2.0 * RADIUS + 0.15, 0.0)));
}

fn turn(mut turning: ResMut<Turning>, time: Res<Time>, mut balls: Query<&mut ColliderMotion, With<Ball>>) {
    turning.since += time.delta_secs();
    let begun = (turning.since - BEGIN).clamp(0.0, 1.0);
    for mut motion in &mut balls {
        motion.angular_velocity = Vec3::Y * (turning.speed * begun);
    }
}

fn draw(mut ui: InMut<Ui>, mut turning: ResMut<Turning>) {
    slider(&mut ui, "turns at", "rad/s", &mut turning.speed, -6.0..=6.0);
}
