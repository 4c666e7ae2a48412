//! A lamp on a rope, a chain, a curtain in the wind, a ring of jelly from a mesh, and a die of jelly with its pips.
//! Drag any of them with the mouse.

use std::f32::consts::FRAC_PI_2;

use bevy::light::GlobalAmbientLight;
use bevy::prelude::*;
use bevy_mass_spring::prelude::*;

fn main() {
    App::new()
        .add_plugins((DefaultPlugins, MassSpringPlugin::default(), ParticleDragPlugin))
        .insert_resource(ClearColor(Color::srgb(0.74, 0.80, 0.87)))
        .insert_resource(GlobalAmbientLight { brightness: 500.0, ..default() })
        .insert_resource(Environment { wind: Vec3::new(0.3, 0.0, 1.0), air_density: 1.2, ..default() })
        .add_systems(Startup, (spawn_stage, spawn_ropes, spawn_curtain, spawn_jellies))
        .run();
}

type Meshes<'w> = ResMut<'w, Assets<Mesh>>;
type Materials<'w> = ResMut<'w, Assets<StandardMaterial>>;

fn spawn_stage(mut commands: Commands, mut meshes: Meshes, mut materials: Materials) {
    let eye = Transform::from_xyz(0.6, 2.0, 5.6).looking_at(Vec3::new(0.0, 1.2, 0.0), Vec3::Y);
    commands.spawn((Camera3d::default(), eye));
    let sun = DirectionalLight { illuminance: 9_500.0, shadow_maps_enabled: true, ..default() };
    commands.spawn((sun, Transform::from_xyz(2.0, 6.0, 4.0).looking_at(Vec3::ZERO, Vec3::Y)));
    let floor = Mesh3d(meshes.add(Plane3d::new(Vec3::Y, Vec2::splat(20.0))));
    let grey = MeshMaterial3d(materials.add(Color::srgb(0.63, 0.64, 0.62)));
    commands.spawn((ParticleCollider::default(), floor, grey));
    let beam = Mesh3d(meshes.add(Cuboid::new(4.6, 0.08, 0.08)));
    let wood = MeshMaterial3d(materials.add(Color::srgb(0.35, 0.22, 0.12)));
    commands.spawn((beam, wood, Transform::from_xyz(0.0, 2.44, 0.0)));
}

fn spawn_ropes(mut commands: Commands, mut meshes: Meshes, mut materials: Materials) {
    // A lamp of 2 kg, pulled aside.
    let bulb = Mesh3d(meshes.add(Sphere::new(0.12)));
    let light = StandardMaterial { emissive: LinearRgba::rgb(6.0, 4.5, 2.0), ..default() };
    let place = Transform::from_xyz(-2.1, 1.35, 0.7);
    let lamp = commands.spawn((Particle::new(2.0, 0.12), bulb, MeshMaterial3d(materials.add(light)), place));
    let lamp = lamp.id();
    let hook = Vec3::new(-2.1, 2.4, 0.0);
    let socket = place.translation + 0.12 * (hook - place.translation).normalize();
    commands.spawn((
        Rope::between(hook, socket).with_radius(0.012),
        RopeMesh::default(),
        MeshMaterial3d(materials.add(Color::srgb(0.70, 0.58, 0.38))),
        related!(Parts[(Part::Start, Pinned), (Part::End, Attachment::to(lamp))]),
    ));
    // A chain: each link is a copy of a ring, the y axis along it, turned by a quarter against the one before.
    let ring = Torus { minor_radius: 0.009, major_radius: 0.03 }.mesh().build();
    let ring = ring.rotated_by(Quat::from_rotation_x(FRAC_PI_2)).scaled_by(Vec3::new(1.0, 1.67, 1.0));
    let steel = StandardMaterial { metallic: 0.7, perceptual_roughness: 0.35, ..default() };
    let ring = (Mesh3d(meshes.add(ring)), MeshMaterial3d(materials.add(steel)), Visibility::Hidden);
    let ring = commands.spawn(ring).id();
    let slack = Rope::hanging(Vec3::new(-1.7, 2.4, 0.0), Vec3::new(-0.2, 2.4, 0.0), 0.5);
    let heavy = RopeMaterial { linear_density: 0.8, bending_stiffness: 0.0, ..RopeMaterial::HEMP };
    commands.spawn((
        slack.with_spacing(0.07).with_radius(0.02).with_material(heavy),
        RopeLinks::new(ring).with_twist(FRAC_PI_2),
        related!(Parts[(Part::Start, Pinned), (Part::End, Pinned)]),
    ));
}

fn spawn_curtain(mut commands: Commands, mut materials: Materials) {
    let red = Color::srgb(0.60, 0.10, 0.12);
    let matt = StandardMaterial { perceptual_roughness: 0.9, ..StandardMaterial::from(red) };
    let both_sides = StandardMaterial { double_sided: true, cull_mode: None, ..matt };
    let light = ClothMaterial { stretch_stiffness: 500.0, retardation_time: 5e-4, ..ClothMaterial::SILK };
    commands.spawn((
        Cloth::sheet(Rectangle::new(1.4, 1.6)).with_spacing(0.08).with_material(light),
        NetMesh,
        MeshMaterial3d(materials.add(both_sides)),
        Transform::from_xyz(0.9, 1.6, 0.0),
        related!(Parts[(Part::Edge(Side::Top), Pinned)]),
    ));
}

fn spawn_jellies(mut commands: Commands, mut meshes: Meshes, mut materials: Materials) {
    // A mesh that cubes of 9 cm fill and move.
    let tilted = Transform::from_xyz(-1.0, 0.8, 0.6).with_rotation(Quat::from_rotation_x(0.7));
    commands.spawn((
        Mesh3d(meshes.add(Torus { minor_radius: 0.13, major_radius: 0.3 })),
        MeshMaterial3d(materials.add(Color::srgb(0.25, 0.55, 0.20))),
        Jelly::fill_mesh(0.09).with_material(JellyMaterial::BALLISTIC_GELATINE),
        NetMesh,
        tilted,
    ));
    // A coarse die, and on its surface a fine mesh: the pips.
    let die = Jelly::cuboid(Cuboid::from_length(0.5)).with_cells(UVec3::splat(3));
    let white = MeshMaterial3d(materials.add(Color::srgb(0.85, 0.83, 0.78)));
    let thrown =
        Transform::from_xyz(0.3, 1.0, 1.0).with_rotation(Quat::from_euler(EulerRot::XYZ, 0.5, 0.4, 0.3));
    let die =
        commands.spawn((die.with_material(JellyMaterial::BALLISTIC_GELATINE), NetMesh, white, thrown)).id();
    let black = MeshMaterial3d(materials.add(Color::srgb(0.02, 0.02, 0.02)));
    commands.spawn((NetSkin(die), Mesh3d(meshes.add(pips())), black));
}

/// The pips of a die of 0.5 m, 3 mm above its faces.
fn pips() -> Mesh {
    let mut pips = Vec::new();
    for (number, normal) in (1..).zip([Vec3::Z, Vec3::X, Vec3::Y, -Vec3::Y, -Vec3::X, -Vec3::Z]) {
        for (x, y) in (-1..=1).flat_map(|x| (-1..=1).map(move |y| (x, y))) {
            let is_there = match x * y {
                1 => number >= 2,
                -1 => number >= 4,
                _ if x == y => number % 2 == 1,
                _ => number == 6 && y == 0,
            };
            if is_there {
                let place = Vec3::new(0.13 * x as f32, 0.13 * y as f32, 0.253);
                let pip = Circle::new(0.045).mesh().build().translated_by(place);
                pips.push(pip.rotated_by(Quat::from_rotation_arc(Vec3::Z, normal)));
            }
        }
    }
    let all = pips.into_iter().reduce(|mut all, pip| {
        all.merge(&pip).expect("all have the same attributes");
        all
    });
    all.expect("there are 21")
}
