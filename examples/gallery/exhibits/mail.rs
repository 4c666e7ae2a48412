//! Chain mail.

use bevy::prelude::*;
use bevy_egui::egui::Ui;
use bevy_mass_spring::prelude::*;

use crate::frame::{log_slider, slider};
use crate::gallery::{AppExhibit, Exhibit};
use crate::stage::{Stage, View};

const EXHIBIT: Exhibit = Exhibit {
    name: "Chain mail",
    caption: "Rings of steel, each joined to its four neighbours by cables: they pull and never push, so the mail has \
              no stiffness at all until it is taut. It lies over a ball.",
    view: View { focus: Vec3::new(0.0, 0.9, 0.0), distance: 4.2, yaw: 0.5, pitch: 0.35 },
};

const RINGS: usize = 30;
const PITCH: f32 = 0.055;
const BALL: f32 = 0.5;

pub fn plugin(app: &mut App) {
    app.add_exhibit(EXHIBIT, spawn, draw).add_systems(Update, turn_rings);
}

/// A ring, with its place in the mail; every other one is turned the other way.
#[derive(Component)]
struct Ring(usize, usize);

/// The rings of the mail, row by row.
#[derive(Resource)]
struct Mail(Vec<Entity>);

fn spawn(mut stage: Stage, mut collisions: ResMut<CollisionSettings>) {
    *collisions = CollisionSettings { friction: 0.15, ..default() };
    stage.floor();
    let marble = stage.paint(Color::srgb(0.75, 0.20, 0.13));
    let ball = Mesh3d(stage.meshes.add(Sphere::new(BALL - 0.02)));
    stage.spawn((Particle::new(1.0, BALL), Pinned, ball, marble, Transform::from_xyz(0.0, 0.75, 0.0)));
    let steel = stage.metal(Color::srgb(0.68, 0.70, 0.74));
    let ring = Mesh3d(stage.meshes.add(Torus { minor_radius: 0.006, major_radius: 0.56 * PITCH }));
    let place = |index: usize| (index as f32 - 0.5 * (RINGS - 1) as f32) * PITCH;
    let mut rings = Vec::new();
    for row in 0..RINGS {
        for column in 0..RINGS {
            let transform = Transform::from_xyz(place(column), 1.5, place(row));
            let particle = Particle::new(0.012, 0.5 * PITCH);
            rings.push(stage.spawn((Ring(row, column), particle, ring.clone(), steel.clone(), transform)));
        }
    }
    for row in 0..RINGS {
        for column in 0..RINGS {
            let index = row * RINGS + column;
            let right = (column + 1 < RINGS).then(|| rings[index + 1]);
            let below = (row + 1 < RINGS).then(|| rings[index + RINGS]);
            for other in [right, below].into_iter().flatten() {
                let cable = Spring { tension_only: true, ..Spring::new(rings[index], other, PITCH) };
                stage.spawn(cable.with_stiffness(4e3).with_damping(1.0));
            }
        }
    }
    stage.commands.insert_resource(Mail(rings));
}

/// Turns each ring into the surface of the mail, tilted against it to one side or the other.
fn turn_rings(mail: Option<Res<Mail>>, mut rings: Query<(&Ring, &mut Transform)>) {
    let Some(mail) = mail else { return };
    let place = |row: usize, column: usize| {
        let ring = mail.0[row.min(RINGS - 1) * RINGS + column.min(RINGS - 1)];
        rings.get(ring).map_or(Vec3::ZERO, |(_, transform)| transform.translation)
    };
    let turned: Vec<Quat> = (0..RINGS * RINGS)
        .map(|index| {
            let (row, column) = (index / RINGS, index % RINGS);
            let across = place(row, column + 1) - place(row, column.saturating_sub(1));
            let down = place(row + 1, column) - place(row.saturating_sub(1), column);
            let normal = down.cross(across).normalize_or(Vec3::Y);
            let tilt = if (row + column) % 2 == 0 { 0.55 } else { -0.55 };
            let axis = across.normalize_or(Vec3::X);
            Quat::from_axis_angle(axis, tilt) * Quat::from_rotation_arc(Vec3::Y, normal)
        })
        .collect();
    for (ring, mut transform) in &mut rings {
        transform.rotation = turned[ring.0 * RINGS + ring.1];
    }
}

fn draw(mut ui: InMut<Ui>, mut collisions: ResMut<CollisionSettings>, mut springs: Query<&mut Spring>) {
    let mut friction = collisions.friction;
    if slider(&mut ui, "friction", "", &mut friction, 0.0..=1.0) {
        collisions.friction = friction;
    }
    let Some(stiffness) = springs.iter().next().map(|spring| spring.stiffness) else { return };
    let mut edited = stiffness;
    if log_slider(&mut ui, "stiffness of a ring", "N/m", &mut edited, 100.0..=1e5) {
        springs.iter_mut().for_each(|mut spring| spring.stiffness = edited);
    }
}
