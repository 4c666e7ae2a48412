//! Nets in two dimensions: ropes as ribbons, and a cloth in the plane of the picture into which a ball falls.
//! Drag them with the mouse.
//!
//! A metre is a pixel here: lengths and radii are in px, gravity is in px/s². z of each `Transform` is the layer on which
//! a net is drawn.

use bevy::prelude::*;
use bevy_mass_spring::drag::ParticleDragSettings;
use bevy_mass_spring::prelude::*;

const GROUND: f32 = -300.0;

fn main() {
    App::new()
        .add_plugins((DefaultPlugins, MassSpringPlugin::default(), ParticleDragPlugin))
        .insert_resource(ClearColor(Color::srgb(0.93, 0.91, 0.86)))
        .insert_resource(Dimensions::Two)
        .insert_resource(Environment { gravity: Vec3::NEG_Y * 981.0, viscosity: 0.02, ..default() })
        .insert_resource(CollisionSettings { restitution: 0.2, friction: 0.4, ..default() })
        // A metre is a pixel for the pointer, too: it must be stronger than gravity.
        .insert_resource(ParticleDragSettings { max_acceleration: 40_000.0, ..default() })
        .add_systems(Startup, (spawn_ground, spawn_ropes, spawn_cloth))
        .run();
}

/// Meshes and colours.
#[derive(bevy::ecs::system::SystemParam)]
struct Paints<'w> {
    meshes: ResMut<'w, Assets<Mesh>>,
    materials: ResMut<'w, Assets<ColorMaterial>>,
}

impl Paints<'_> {
    fn color(&mut self, color: Color) -> MeshMaterial2d<ColorMaterial> {
        MeshMaterial2d(self.materials.add(ColorMaterial::from_color(color)))
    }
}

fn spawn_ground(mut commands: Commands, mut paints: Paints) {
    commands.spawn(Camera2d);
    let earth = paints.color(Color::srgb(0.42, 0.36, 0.31));
    let mesh = Mesh2d(paints.meshes.add(Rectangle::new(3000.0, 400.0)));
    // The particles are above y = 0 of the plane, what is drawn of it is below.
    commands.spawn((
        ParticleCollider::half_space().with_restitution(0.2).with_friction(0.5),
        Transform::from_xyz(0.0, GROUND, -1.0),
        Visibility::default(),
        children![(mesh, earth, Transform::from_xyz(0.0, -200.0, 0.0))],
    ));
}

/// A rope between two hooks, and one that holds a ball.
fn spawn_ropes(mut commands: Commands, mut paints: Paints) {
    let material = RopeMaterial {
        linear_density: 0.02,
        stretch_stiffness: 4e5,
        bending_stiffness: 0.0,
        retardation_time: 2e-3,
    };
    let blue = paints.color(Color::srgb(0.16, 0.35, 0.62));
    let slack = Rope::hanging(Vec3::new(-560.0, 260.0, 0.0), Vec3::new(-140.0, 300.0, 0.0), 0.3);
    commands.spawn((
        slack.with_spacing(14.0).with_radius(4.0).with_material(material),
        RopeRibbon { width: Some(9.0), ..default() },
        blue,
        related!(Parts[(Part::Start, Pinned), (Part::End, Pinned)]),
    ));
    let orange = paints.color(Color::srgb(0.86, 0.45, 0.12));
    let mesh = Mesh2d(paints.meshes.add(Circle::new(34.0)));
    let start = Vec3::new(-330.0, 320.0, 1.0);
    let along = Vec3::new(-0.8, -0.6, 0.0);
    let end = start + along * 260.0;
    let place = Transform::from_translation(end + along * 34.0 + Vec3::Z);
    let ball = commands.spawn((Particle::new(12.0, 34.0), mesh, orange.clone(), place)).id();
    commands.spawn((
        Rope::between(start, end).with_spacing(14.0).with_radius(4.0).with_material(material),
        RopeRibbon { width: Some(7.0), ..default() },
        orange,
        related!(Parts[(Part::Start, Pinned), (Part::End, Attachment::to(ball))]),
    ));
}

/// A banner in the plane of the picture, into which a ball falls.
fn spawn_cloth(mut commands: Commands, mut paints: Paints) {
    let red = paints.color(Color::srgb(0.72, 0.16, 0.2));
    let banner = Cloth::sheet(Rectangle::new(420.0, 280.0)).with_spacing(20.0).with_radius(5.0);
    commands.spawn((
        banner.with_material(ClothMaterial {
            area_density: 2e-4,
            stretch_stiffness: 2e3,
            shear_stiffness: 600.0,
            bending_stiffness: 0.0,
            retardation_time: 2e-3,
        }),
        NetMesh,
        Breaking { strain: Some(0.3), ..default() },
        red,
        Transform::from_xyz(300.0, 60.0, 2.0),
        related!(Parts[(Part::Edge(Side::Top), Pinned)]),
    ));
    let iron = paints.color(Color::srgb(0.25, 0.26, 0.3));
    let mesh = Mesh2d(paints.meshes.add(Circle::new(30.0)));
    commands.spawn((Particle::new(20.0, 30.0), mesh, iron, Transform::from_xyz(330.0, 420.0, 3.0)));
}
