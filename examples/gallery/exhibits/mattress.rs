//! A spring mattress.

use bevy::prelude::*;
use bevy_egui::egui::Ui;
use bevy_mass_spring::prelude::*;

use crate::frame::log_slider;
use crate::gallery::{AppExhibit, Exhibit};
use crate::stage::{Stage, View};

const EXHIBIT: Exhibit = Exhibit {
    name: "Mattress",
    caption: "Coils of steel under a cover of cloth. Each coil is one spring with its stiffness in N/m: the balls sink \
              in by their weight.",
    view: View { focus: Vec3::new(0.0, 0.4, 0.0), distance: 4.0, yaw: 0.55, pitch: 0.26 },
};

const COLUMNS: u32 = 12;
const ROWS: u32 = 8;
const PITCH: f32 = 0.15;
const HEIGHT: f32 = 0.34;
/// The cells of the cover between two coils.
const FINENESS: u32 = 2;

pub fn plugin(app: &mut App) {
    app.add_exhibit(EXHIBIT, spawn, draw).add_systems(Update, stretch_coils);
}

/// A coil stands on a point of the floor and carries a part of the cover.
#[derive(Component)]
struct Coil {
    base: Vec3,
    top: Entity,
}

/// The spring of a coil.
#[derive(Component)]
struct CoilSpring;

#[derive(Component)]
struct Ball;

fn spawn(mut stage: Stage, mut collisions: ResMut<CollisionSettings>) {
    *collisions = CollisionSettings { friction: 0.5, restitution: 0.1, ..default() };
    stage.floor();
    let size = Vec2::new(COLUMNS as f32, ROWS as f32) * PITCH;
    let cells = UVec2::new(COLUMNS, ROWS) * FINENESS;
    let ticking = stage.cloth(Color::srgb(0.50, 0.58, 0.72));
    let cover = Cloth::from(Plane3d::new(Vec3::Y, 0.5 * size))
        .with_cells(cells)
        .with_radius(0.015)
        .with_material(ClothMaterial {
            area_density: 1.0,
            stretch_stiffness: 2e3,
            retardation_time: 3e-4,
            ..ClothMaterial::DENIM
        });
    let cover = stage.spawn((cover, NetMesh, ticking, Transform::from_xyz(0.0, HEIGHT, 0.0)));
    let steel = stage.metal(Color::srgb(0.30, 0.31, 0.34));
    let coil_mesh = Mesh3d(stage.meshes.add(coil_mesh()));
    for row in 0..=ROWS {
        for column in 0..=COLUMNS {
            let (column_cell, row_cell) = (column * FINENESS, row * FINENESS);
            let top = Part::Particle(row_cell * (cells.x + 1) + column_cell);
            let top = stage.spawn((PartOf(cover), top));
            let x = (column as f32 - 0.5 * COLUMNS as f32) * PITCH;
            let z = (0.5 * ROWS as f32 - row as f32) * PITCH;
            let base_place = Vec3::new(x, 0.0, z);
            let place = Transform::from_translation(base_place);
            let base = stage.spawn((Particle::new(1.0, 0.0), Pinned, place));
            let spring = Spring::new(base, top, HEIGHT).with_stiffness(900.0).with_damping(6.0);
            stage.spawn((CoilSpring, spring));
            // Sideways, a coil is softer than along itself.
            for (dx, dz) in [(0.3, 0.0), (0.0, 0.3)] {
                let place = base_place + Vec3::new(dx, 0.0, dz);
                let stay = stage.spawn((Particle::new(1.0, 0.0), Pinned, Transform::from_translation(place)));
                let length = (Vec3::new(x, HEIGHT, z) - place).length();
                stage.spawn(Spring::new(stay, top, length).with_stiffness(60.0).with_damping(2.0));
            }
            let coil = Coil { base: base_place, top };
            stage.spawn((coil, coil_mesh.clone(), steel.clone(), Transform::default()));
        }
    }
    for (x, z, radius, mass, hue) in
        [(-0.45, 0.1, 0.2, 12.0, 10.0), (0.35, -0.2, 0.16, 6.0, 200.0), (0.1, 0.3, 0.12, 3.0, 90.0)]
    {
        let mesh = Mesh3d(stage.meshes.add(Sphere::new(radius)));
        let paint = stage.metal(Color::hsl(hue, 0.65, 0.5));
        let place = Transform::from_xyz(x, 1.0 + 0.05 * mass, z);
        stage.spawn((Ball, Particle::new(mass, radius), mesh, paint, place));
    }
}

/// A helix of 1 m height and five turns, as a tube.
fn coil_mesh() -> Mesh {
    use bevy::asset::RenderAssetUsages;
    use bevy::mesh::{Indices, PrimitiveTopology};

    const TURNS: f32 = 5.0;
    const STEPS: u16 = 90;
    const SIDES: u16 = 6;
    const RADIUS: f32 = 0.045;
    let (mut positions, mut normals, mut indices) = (Vec::new(), Vec::new(), Vec::new());
    for step in 0..=STEPS {
        let share = f32::from(step) / f32::from(STEPS);
        let angle = std::f32::consts::TAU * TURNS * share;
        let out = Vec3::new(angle.cos(), 0.0, angle.sin());
        for side in 0..SIDES {
            let around = std::f32::consts::TAU * f32::from(side) / f32::from(SIDES);
            let normal = out * around.cos() + Vec3::Y * around.sin();
            // The coil is scaled to a third of its height.
            let place = out * RADIUS + Vec3::Y * share + normal * Vec3::new(0.006, 0.018, 0.006);
            positions.push(place.to_array());
            normals.push(normal.to_array());
            if step < STEPS {
                let (a, b) = (step * SIDES + side, step * SIDES + (side + 1) % SIDES);
                indices.extend([a, b, a + SIDES, b, b + SIDES, a + SIDES]);
            }
        }
    }
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
        .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, normals)
        .with_inserted_indices(Indices::U16(indices))
}

/// Draws each coil from its base to the cover.
fn stretch_coils(mut coils: Query<(&Coil, &mut Transform)>, tops: Query<&Transform, Without<Coil>>) {
    for (coil, mut transform) in &mut coils {
        let Ok(top) = tops.get(coil.top) else { continue };
        let along = top.translation - coil.base;
        *transform = Transform::from_translation(coil.base)
            .with_rotation(Quat::from_rotation_arc(Vec3::Y, along.normalize_or(Vec3::Y)))
            // Its wire lies below the cover, where that is bent, too.
            .with_scale(Vec3::new(1.0, (along.length() - 0.045).max(0.01), 1.0));
    }
}

fn draw(
    mut ui: InMut<Ui>,
    mut coils: Query<&mut Spring, With<CoilSpring>>,
    mut balls: Query<&mut Particle, With<Ball>>,
) {
    if let Some(stiffness) = coils.iter().next().map(|spring| spring.stiffness) {
        let mut edited = stiffness;
        if log_slider(&mut ui, "stiffness of a coil", "N/m", &mut edited, 100.0..=2e4) {
            coils.iter_mut().for_each(|mut spring| spring.stiffness = edited);
        }
    }
    let total: f32 = balls.iter().map(|ball| ball.mass).sum();
    let mut edited = total;
    if log_slider(&mut ui, "balls", "kg", &mut edited, 1.0..=300.0) {
        balls.iter_mut().for_each(|mut ball| ball.mass *= edited / total);
    }
}
