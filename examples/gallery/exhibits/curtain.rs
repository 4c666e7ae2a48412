//! A curtain that is drawn.

use bevy::prelude::*;
use bevy_egui::egui::Ui;
use bevy_mass_spring::prelude::*;

use crate::frame::{log_slider, slider};
use crate::gallery::{AppExhibit, Exhibit};
use crate::stage::{Stage, View};

const EXHIBIT: Exhibit = Exhibit {
    name: "Curtain",
    caption: "Thirteen rings on a rail hold the upper edge. Draw the curtain: the cloth between the rings lays \
              itself into folds.",
    view: View { focus: Vec3::new(0.0, 1.45, 0.0), distance: 5.4, yaw: 0.3, pitch: 0.08 },
};

const WIDTH: f32 = 2.6;
const HEIGHT: f32 = 2.2;
const RAIL: f32 = 2.7;
const CELLS: UVec2 = UVec2::new(36, 18);
const RINGS: u32 = 12;

pub fn plugin(app: &mut App) {
    app.insert_resource(Drawn { target: 0.55, present: 0.0, by_itself: true })
        .add_exhibit(EXHIBIT, spawn, draw)
        .add_systems(FixedUpdate, move_rings)
        .add_systems(PreUpdate, crease);
}

/// How far the curtain is drawn: 0 is closed, 1 is open.
#[derive(Resource)]
struct Drawn {
    target: f32,
    present: f32,
    by_itself: bool,
}

/// A ring, and its share of the width.
#[derive(Component)]
struct Ring(f32);

/// A curtain that hangs in a plane yet: nothing would bend it out of that, to one side or the other.
#[derive(Component)]
struct Flat;

/// Lays the curtain into shallow folds, one between each two rings, to and fro.
fn crease(mut curtains: Query<(Entity, &mut ParticleNet), With<Flat>>, mut commands: Commands) {
    for (entity, mut net) in &mut curtains {
        let columns = CELLS.x + 1;
        for (number, place) in (0..).zip(net.positions_mut()) {
            let [across, below] = [number % columns, CELLS.y - number / columns];
            let fold = std::f32::consts::PI * (across * RINGS) as f32 / CELLS.x as f32;
            // Near the rail it is as flat as the rings hold it.
            place.z += 0.015 * fold.sin() * (below as f32 / 4.0).min(1.0);
        }
        commands.entity(entity).remove::<Flat>();
    }
}

fn spawn(mut stage: Stage, mut drawn: ResMut<Drawn>, mut environment: ResMut<Environment>) {
    *environment = Environment { air_density: 1.2, ..default() };
    *drawn = Drawn { target: 0.0, present: 0.0, by_itself: true };
    let brass = stage.metal(Color::srgb(0.75, 0.6, 0.3));
    let across = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2);
    stage.solid(
        Cylinder::new(0.022, WIDTH + 0.4),
        brass.clone(),
        Transform::from_xyz(0.0, RAIL + 0.05, 0.0).with_rotation(across),
    );
    let velvet = stage.cloth(Color::srgb(0.42, 0.05, 0.10));
    let curtain = Cloth::sheet(Rectangle::new(WIDTH, HEIGHT))
        .with_cells(CELLS)
        .with_radius(0.003)
        .with_material(ClothMaterial {
            stretch_stiffness: 1e3,
            bending_stiffness: 2e-5,
            // As little as the explicit schemes take in some tens of substeps.
            retardation_time: 2e-4,
            ..ClothMaterial::COTTON
        });
    let place = Transform::from_xyz(0.0, RAIL - 0.5 * HEIGHT, 0.0);
    let curtain = stage.spawn((curtain, Flat, NetMesh, velvet, place));
    let ring_mesh = Mesh3d(stage.meshes.add(Torus { minor_radius: 0.008, major_radius: 0.045 }));
    for ring in 0..=RINGS {
        let share = ring as f32 / RINGS as f32;
        let first = CELLS.y * (CELLS.x + 1);
        let particle = first + ring * CELLS.x / RINGS;
        let holder = stage.spawn((
            Ring(share),
            Transform::from_xyz((share - 0.5) * WIDTH, RAIL, 0.0),
            Visibility::default(),
        ));
        let look =
            (ring_mesh.clone(), brass.clone(), Transform::from_xyz(0.0, 0.05, 0.0).with_rotation(across));
        stage.commands.entity(holder).with_child(look).with_child((
            PartOf(curtain),
            Part::Particle(particle),
            Pinned,
        ));
    }
}

/// Moves the rings along the rail at 0.7 m/s at most.
fn move_rings(mut drawn: ResMut<Drawn>, time: Res<Time>, mut rings: Query<(&Ring, &mut Transform)>) {
    if drawn.by_itself {
        drawn.target = 0.5 - 0.5 * (0.35 * time.elapsed_secs()).cos();
    }
    let step = 0.7 * time.delta_secs() / WIDTH;
    drawn.present += (drawn.target - drawn.present).clamp(-step, step);
    for (ring, mut transform) in &mut rings {
        let width = WIDTH * (1.0 - 0.72 * drawn.present);
        transform.translation.x = -0.5 * WIDTH + ring.0 * width;
    }
}

fn draw(mut ui: InMut<Ui>, mut drawn: ResMut<Drawn>, mut curtains: Query<&mut Cloth>) {
    ui.checkbox(&mut drawn.by_itself, "to and fro by itself");
    let mut target = drawn.target;
    if slider(&mut ui, "drawn", "", &mut target, 0.0..=1.0) {
        (drawn.target, drawn.by_itself) = (target, false);
    }
    for mut curtain in &mut curtains {
        let mut bending = curtain.material.bending_stiffness * 1e6;
        if log_slider(&mut ui, "bending stiffness", "µN·m", &mut bending, 0.1..=2e3) {
            curtain.material.bending_stiffness = bending * 1e-6;
        }
    }
}
