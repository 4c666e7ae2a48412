//! A balloon on a string.

use bevy::prelude::*;
use bevy_egui::egui::Ui;
use bevy_mass_spring::prelude::*;

use crate::frame::{log_slider, slider};
use crate::gallery::{AppExhibit, Exhibit};
use crate::stage::{Stage, View};

const EXHIBIT: Exhibit = Exhibit {
    name: "Balloon",
    caption: "Gas holds the membranes out: p V is constant. Helium lifts the red balloon on its string, a fist \
              presses the blue one. Let some gas out.",
    view: View { focus: Vec3::new(0.2, 1.1, 0.0), distance: 5.0, yaw: 0.3, pitch: 0.12 },
};

const RADIUS: f32 = 0.35;

pub fn plugin(app: &mut App) {
    app.add_exhibit(EXHIBIT, spawn, draw).add_systems(FixedUpdate, press);
}

/// What presses the blue balloon, and since when, s.
#[derive(Component, Default)]
struct Fist(f32);

/// Up and down.
fn press(time: Res<Time>, mut fists: Query<(&mut Fist, &mut Transform)>) {
    for (mut fist, mut transform) in &mut fists {
        fist.0 += time.delta_secs();
        transform.translation.y = 1.16 + 0.19 * (1.2 * fist.0).cos();
    }
}

fn spawn(mut stage: Stage, mut environment: ResMut<Environment>) {
    *environment = Environment { wind: Vec3::new(0.8, 0.0, 0.3), air_density: 1.225, ..default() };
    stage.floor();
    let material = BalloonMaterial { area_density: 0.05, retardation_time: 1e-4, ..BalloonMaterial::LATEX };
    let red = stage.metal(Color::srgb(0.85, 0.08, 0.12));
    let balloon = Balloon::sphere(Sphere::new(RADIUS)).with_subdivisions(3).with_material(material);
    let bottom = balloon.topology().map_or(0, |topology| topology.nearest(Vec3::NEG_Y * RADIUS).unwrap_or(0));
    // The lift of the air that it displaces, less the weight of the helium.
    let volume = Sphere::new(RADIUS).volume();
    let lift = AppliedForce(Vec3::Y * volume * (1.225 - 0.18) * 9.81);
    let balloon = stage.spawn((balloon, NetMesh, red, Transform::from_xyz(-0.7, 1.9, 0.0)));
    stage.spawn((PartOf(balloon), Part::All, lift));
    let knot = stage.spawn((PartOf(balloon), Part::Particle(bottom)));
    let white = stage.paint(Color::srgb(0.9, 0.9, 0.88));
    let string = Rope::between(Vec3::new(-0.7, 0.02, 0.0), Vec3::new(-0.7, 1.9 - RADIUS, 0.0))
        .with_segments(15)
        .with_radius(0.006)
        .with_material(RopeMaterial {
            linear_density: 0.003,
            stretch_stiffness: 50.0,
            bending_stiffness: 0.0,
            retardation_time: 3e-4,
        });
    stage.spawn((
        string,
        RopeMesh::default(),
        white,
        related!(Parts[(Part::Start, Pinned), (Part::End, Attachment::to(knot))]),
    ));
    let blue = stage.metal(Color::srgb(0.1, 0.3, 0.8));
    let ball = Balloon::sphere(Sphere::new(0.45))
        .with_subdivisions(3)
        .with_material(BalloonMaterial { pressure: 60.0, ..material });
    let ball = Balloon { radius: 0.02, ..ball };
    // It is glued to the ground, so that it does not roll away under the fist.
    let places = ball.topology().map(|topology| topology.positions).unwrap_or_default();
    let foot = (0..).zip(places).filter(|(_, place)| place.y < -0.9 * 0.45).map(|(number, _)| number);
    let foot = Part::Particles(foot.collect());
    let ball = stage.spawn((ball, NetMesh, blue, Transform::from_xyz(0.8, 0.48, 0.0)));
    stage.spawn((PartOf(ball), foot, Pinned));
    let lead = stage.metal(Color::srgb(0.3, 0.3, 0.33));
    let weight = Mesh3d(stage.meshes.add(Sphere::new(0.18)));
    stage.spawn((
        Fist::default(),
        Particle::new(3.0, 0.18),
        Pinned,
        weight,
        lead,
        Transform::from_xyz(0.8, 1.35, 0.0),
    ));
}

fn draw(mut ui: InMut<Ui>, mut balloons: Query<&mut Balloon>, mut environment: ResMut<Environment>) {
    for (mut balloon, name) in balloons.iter_mut().zip(["pressure, red", "pressure, blue"]) {
        let mut pressure = balloon.material.pressure;
        if log_slider(&mut ui, name, "Pa", &mut pressure, 10.0..=3e3) {
            balloon.material.pressure = pressure;
        }
    }
    let mut wind = environment.wind.x;
    if slider(&mut ui, "wind", "m/s", &mut wind, 0.0..=5.0) {
        environment.wind.x = wind;
    }
}
