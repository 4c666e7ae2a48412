//! A hammock and what lies in it.

use bevy::prelude::*;
use bevy_egui::egui::Ui;
use bevy_mass_spring::prelude::*;

use crate::frame::log_slider;
use crate::gallery::{AppExhibit, Exhibit};
use crate::stage::{Stage, View};

const EXHIBIT: Exhibit = Exhibit {
    name: "Hammock",
    caption: "A sheet gathered by ropes at both ends, and a heavy load in it. The strings of each end pull as much \
              as their directions say.",
    view: View { focus: Vec3::new(0.0, 1.1, 0.0), distance: 5.4, yaw: 0.5, pitch: 0.22 },
};

const CELLS: UVec2 = UVec2::new(24, 12);
const SIZE: Vec2 = Vec2::new(2.0, 0.9);
const HEIGHT: f32 = 1.25;
const STRINGS: u32 = 6;
const HOOK: Vec3 = Vec3::new(1.9, 1.75, 0.0);

pub fn plugin(app: &mut App) {
    app.add_exhibit(EXHIBIT, spawn, draw);
}

/// What lies in the hammock.
#[derive(Component)]
struct Load;

fn spawn(mut stage: Stage, mut collisions: ResMut<CollisionSettings>, mut environment: ResMut<Environment>) {
    // In place of the damping of canvas and hemp.
    environment.viscosity = 0.02;
    *collisions = CollisionSettings { friction: 0.6, ..default() };
    stage.floor();
    let wood = stage.paint(Color::srgb(0.36, 0.25, 0.15));
    for side in [-1.0, 1.0] {
        let post = Transform::from_xyz(side * (HOOK.x + 0.06), 1.0, 0.0);
        stage.solid(Cylinder::new(0.06, 2.0), wood.clone(), post);
    }
    let canvas = stage.cloth(Color::srgb(0.83, 0.72, 0.48));
    let sheet =
        Cloth::from(Plane3d::new(Vec3::Y, 0.5 * SIZE)).with_cells(CELLS).with_radius(0.012).with_material(
            ClothMaterial { stretch_stiffness: 1e4, retardation_time: 1e-4, ..ClothMaterial::DENIM },
        );
    let sheet = stage.spawn((sheet, NetMesh, canvas, Transform::from_xyz(0.0, HEIGHT, 0.0)));
    let hemp = stage.paint(Color::srgb(0.72, 0.62, 0.42));
    for side in [-1.0, 1.0] {
        for string in 0..=STRINGS {
            let row = string * CELLS.y / STRINGS;
            let column = if side < 0.0 { 0 } else { CELLS.x };
            let z = SIZE.y * (0.5 - row as f32 / CELLS.y as f32);
            let edge = stage.spawn((PartOf(sheet), Part::Particle(row * (CELLS.x + 1) + column)));
            let (hook, end) = (HOOK * Vec3::new(side, 1.0, 1.0), Vec3::new(0.5 * side * SIZE.x, HEIGHT, z));
            let rope =
                Rope::between(hook, end).with_segments(10).with_radius(0.008).with_material(RopeMaterial {
                    linear_density: 0.3,
                    stretch_stiffness: 1e4,
                    bending_stiffness: 0.0,
                    retardation_time: 1e-4,
                });
            stage.spawn((
                rope,
                RopeMesh::default(),
                hemp.clone(),
                related!(Parts[(Part::Start, Pinned), (Part::End, Attachment::to(edge).with_stiffness(6e3))]),
            ));
        }
    }
    let melon = stage.paint(Color::srgb(0.18, 0.42, 0.16));
    for (x, radius, mass) in [(-0.35, 0.17, 14.0), (0.1, 0.2, 20.0), (0.5, 0.15, 9.0)] {
        let mesh = Mesh3d(stage.meshes.add(Sphere::new(radius)));
        let place = Transform::from_xyz(x, HEIGHT + 0.3, 0.0);
        stage.spawn((Load, Particle::new(mass, radius), mesh, melon.clone(), place));
    }
}

fn draw(mut ui: InMut<Ui>, mut loads: Query<&mut Particle, With<Load>>) {
    let total: f32 = loads.iter().map(|load| load.mass).sum();
    let mut edited = total;
    if log_slider(&mut ui, "load", "kg", &mut edited, 1.0..=500.0) {
        loads.iter_mut().for_each(|mut load| load.mass *= edited / total);
    }
}
