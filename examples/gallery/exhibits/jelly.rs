//! Jelly cubes on a trampoline.

use bevy::prelude::*;
use bevy_egui::egui::Ui;
use bevy_mass_spring::prelude::*;

use crate::frame::log_slider;
use crate::gallery::{AppExhibit, Exhibit};
use crate::stage::{Stage, View};

const EXHIBIT: Exhibit = Exhibit {
    name: "Jelly",
    caption: "Cubes of firm gelatine fall onto a trampoline of rubber. Make them softer, and they quiver for longer.",
    view: View { focus: Vec3::new(0.0, 0.9, 0.0), distance: 5.2, yaw: 0.6, pitch: 0.32 },
};

/// Half of the width of the trampoline, m.
const HALF: f32 = 1.06;

pub fn plugin(app: &mut App) {
    app.add_exhibit(EXHIBIT, spawn, draw);
}

fn spawn(mut stage: Stage, mut collisions: ResMut<CollisionSettings>) {
    *collisions = CollisionSettings { friction: 0.5, ..default() };
    stage.floor();
    let steel = stage.metal(Color::srgb(0.25, 0.27, 0.31));
    for side in 0..4_u8 {
        let turn = Quat::from_rotation_y(std::f32::consts::FRAC_PI_2 * f32::from(side));
        let along = Transform::from_translation(turn * Vec3::new(0.0, 0.8, HALF))
            .with_rotation(turn * Quat::from_rotation_z(std::f32::consts::FRAC_PI_2));
        stage.solid(Capsule3d::new(0.05, 2.0 * HALF), steel.clone(), along);
        let leg = Transform::from_translation(turn * Vec3::new(HALF, 0.4, HALF));
        stage.solid(Cylinder::new(0.05, 0.8), steel.clone(), leg);
    }
    let blue = stage.cloth(Color::srgb(0.10, 0.16, 0.28));
    let mat = Cloth::from(Plane3d::new(Vec3::Y, Vec2::splat(HALF)))
        .with_spacing(0.106)
        .with_radius(0.02)
        .with_material(ClothMaterial {
            area_density: 1.2,
            stretch_stiffness: 5e3,
            shear_stiffness: 8e2,
            bending_stiffness: 0.0,
            retardation_time: 1e-3,
        });
    let edges = [Side::Left, Side::Right, Side::Bottom, Side::Top];
    let mat = stage.spawn((mat, NetMesh, blue, Transform::from_xyz(0.0, 0.8, 0.0)));
    for edge in edges {
        stage.spawn((PartOf(mat), Part::Edge(edge), Pinned));
    }
    for (number, color) in [(0.0, 0.02), (1.0, 0.33), (2.0, 0.12)] {
        let paint = StandardMaterial {
            base_color: Color::hsla(360.0 * color, 0.85, 0.5, 0.8),
            alpha_mode: AlphaMode::Blend,
            perceptual_roughness: 0.15,
            reflectance: 0.7,
            ..default()
        };
        let paint = MeshMaterial3d(stage.materials.add(paint));
        let cube = Jelly::from(Cuboid::from_length(0.32)).with_spacing(0.08).with_radius(0.015);
        let place = Vec3::new(0.45 * (number - 1.0), 1.4 + 0.6 * number, 0.25 * (1.0 - number));
        let turn = Quat::from_euler(EulerRot::XYZ, 0.3 + number, 0.5 * number, 0.2);
        let material =
            JellyMaterial { youngs_modulus: 5e4, retardation_time: 1e-3, ..JellyMaterial::GELATINE };
        stage.spawn((
            cube.with_material(material),
            NetMesh,
            paint,
            Transform::from_translation(place).with_rotation(turn),
        ));
    }
}

fn draw(mut ui: InMut<Ui>, mut jellies: Query<&mut Jelly>) {
    let Some(material) = jellies.iter().next().map(|jelly| jelly.material) else { return };
    let mut edited = material;
    log_slider(&mut ui, "Young's modulus", "Pa", &mut edited.youngs_modulus, 3e3..=1e6);
    log_slider(&mut ui, "retardation time", "s", &mut edited.retardation_time, 1e-4..=0.3);
    if edited != material {
        jellies.iter_mut().for_each(|mut jelly| jelly.material = edited);
    }
}
