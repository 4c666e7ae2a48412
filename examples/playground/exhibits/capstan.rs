//! Ropes over a fixed capsule.

use bevy::prelude::*;
use bevy_egui::egui::Ui;
use bevy_mass_spring::prelude::*;

use crate::frame::slider;
use crate::gallery::{AppExhibit, Exhibit};
use crate::stage::{Stage, View};

const EXHIBIT: Exhibit = Exhibit {
    name: "Capstan",
    caption: "Ropes lie half a turn over a beam, a weight at each end. Friction holds them up to e^(μπ) times the \
              lighter weight (Euler and Eytelwein): at μ = 0.3 that is 2.57. The first has twice, the second three times \
              as much on one side. Make the beam smoother or rougher.",
    view: View { focus: Vec3::new(0.0, 1.3, 0.0), distance: 5.4, yaw: 0.35, pitch: 0.18 },
};

const BEAM: f32 = 2.0;
const RADIUS: f32 = 0.22;
const ROPE: f32 = 0.02;
const HANGING: f32 = 0.8;
/// The mass of the lighter load, kg.
const LIGHT: f32 = 1.0;
/// How many times as heavy the other load is, for each rope.
const RATIOS: [f32; 3] = [2.0, 3.0, 1.0];

pub fn plugin(app: &mut App) {
    app.add_exhibit(EXHIBIT, spawn, draw);
}

#[derive(Component)]
struct Beam;

fn spawn(mut stage: Stage) {
    stage.floor();
    let wood = stage.paint(Color::srgb(0.48, 0.33, 0.2));
    let beam = Capsule3d::new(RADIUS, 1.9);
    let look = Mesh3d(stage.meshes.add(beam));
    let across =
        Transform::from_xyz(0.0, BEAM, 0.0).with_rotation(Quat::from_rotation_z(std::f32::consts::FRAC_PI_2));
    for x in [-1.1, 1.1] {
        let post = Cylinder::new(0.07, BEAM - RADIUS);
        stage.solid(post, wood.clone(), Transform::from_xyz(x, 0.5 * (BEAM - RADIUS), 0.0));
    }
    stage.spawn((Beam, ParticleCollider::from(beam).with_friction(0.3), look, wood, across));
    let hemp = stage.paint(Color::srgb(0.70, 0.58, 0.38));
    let iron = stage.metal(Color::srgb(0.3, 0.3, 0.33));
    for (ratio, x) in RATIOS.into_iter().zip([-0.6, 0.0, 0.6]) {
        let rope = Rope { path: path(x), spacing: 0.04, radius: ROPE, ..default() };
        let material = RopeMaterial {
            linear_density: 0.1,
            stretch_stiffness: 3e3,
            bending_stiffness: 0.0,
            // Explicit schemes are the most exact ones where friction decides; this is what they bear.
            retardation_time: 1e-4,
        };
        let rope = stage.spawn((rope.with_material(material), RopeMesh::default(), hemp.clone()));
        for (end, mass, z) in [(Part::Start, LIGHT, -1.0), (Part::End, LIGHT * ratio, 1.0)] {
            let end = stage.spawn((PartOf(rope), end));
            let radius = 0.09 * mass.cbrt();
            let place = Vec3::new(x, BEAM - HANGING - radius, z * (RADIUS + ROPE));
            let look = Mesh3d(stage.meshes.add(Sphere::new(radius)));
            let place = Transform::from_translation(place);
            let load = stage.spawn((Particle::new(mass, radius), look, iron.clone(), place));
            stage.spawn(Spring::new(end, load, radius).with_stiffness(2e4).with_damping(1.0));
        }
    }
}

/// Up, half round the beam, and down.
fn path(x: f32) -> Vec<Vec3> {
    const STEPS: u8 = 40;
    let radius = RADIUS + ROPE;
    let arc = (0..=STEPS).map(|step| {
        let angle = std::f32::consts::PI * f32::from(step) / f32::from(STEPS);
        Vec3::new(x, BEAM + radius * angle.sin(), -radius * angle.cos())
    });
    let [start, end] = [-radius, radius].map(|z| Vec3::new(x, BEAM - HANGING, z));
    std::iter::once(start).chain(arc).chain([end]).collect()
}

fn draw(mut ui: InMut<Ui>, mut beam: Single<&mut ParticleCollider, With<Beam>>) {
    let mut friction = beam.friction;
    if slider(&mut ui, "friction of the beam", "", &mut friction, 0.0..=0.8) {
        beam.friction = friction;
    }
    let most = (friction * std::f32::consts::PI).exp();
    ui.label(format!("It holds up to {most:.2} times the lighter weight."));
}
