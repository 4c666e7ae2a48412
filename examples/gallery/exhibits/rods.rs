//! Rods of rising bending stiffness.

use bevy::prelude::*;
use bevy_egui::egui::Ui;
use bevy_mass_spring::prelude::*;

use crate::frame::log_slider;
use crate::gallery::{AppExhibit, Exhibit};
use crate::stage::{Stage, View};

const EXHIBIT: Exhibit = Exhibit {
    name: "Rods",
    caption: "Seven rods of the same mass, clamped at one end; each is three times as stiff against bending as the \
              one before. The stiffest nearly stands out straight, the softest hangs as a rope.",
    view: View { focus: Vec3::new(0.45, 1.25, 0.0), distance: 4.4, yaw: 0.75, pitch: 0.22 },
};

const COUNT: u8 = 7;
const SEGMENTS: u32 = 40;
const LENGTH: f32 = 1.2;
const SOFTEST: f32 = 2e-3; // N·m²

pub fn plugin(app: &mut App) {
    app.add_exhibit(EXHIBIT, spawn, draw);
}

/// How many times three a rod is stiffer than the softest.
#[derive(Component)]
struct Step(u8);

fn spawn(mut stage: Stage) {
    stage.floor();
    let wood = stage.paint(Color::srgb(0.42, 0.29, 0.18));
    for (bar, height) in [(Cuboid::new(0.12, 0.3, 2.3), 1.7), (Cuboid::new(0.12, 1.55, 0.3), 0.775)] {
        let solid = stage.solid(bar, wood.clone(), Transform::from_xyz(-0.06, height, 0.0));
        stage.commands.entity(solid).insert(ParticleCollider::from(bar));
    }
    for step in 0..COUNT {
        let share = f32::from(step) / f32::from(COUNT - 1);
        let z = 1.8 * (share - 0.5);
        let paint = stage.metal(Color::hsl(30.0 + 190.0 * share, 0.65, 0.5));
        let rod = Rope::between(Vec3::ZERO, Vec3::X * LENGTH)
            .with_segments(SEGMENTS)
            .with_radius(0.014)
            .with_material(RopeMaterial {
                linear_density: 0.08,
                stretch_stiffness: 2e4,
                bending_stiffness: SOFTEST * 3.0_f32.powi(step.into()),
                retardation_time: 0.02,
            });
        stage.spawn((
            rod,
            Step(step),
            RopeMesh::default(),
            paint,
            Transform::from_xyz(0.0, 1.7, z),
            // Two particles in a row hold the direction, too.
            related!(Parts[(Part::Particle(0), Pinned), (Part::Particle(1), Pinned)]),
        ));
    }
}

fn draw(mut ui: InMut<Ui>, mut rods: Query<(&mut Rope, &Step)>) {
    let Some(softest) = rods.iter().find(|(_, step)| step.0 == 0).map(|(rod, _)| rod.material) else {
        return;
    };
    let mut edited = softest;
    log_slider(&mut ui, "EI of the softest", "N·m²", &mut edited.bending_stiffness, 1e-5..=1.0);
    log_slider(&mut ui, "mass", "kg/m", &mut edited.linear_density, 0.01..=1.0);
    log_slider(&mut ui, "retardation time", "s", &mut edited.retardation_time, 1e-4..=1.0);
    if edited != softest {
        for (mut rod, step) in &mut rods {
            let bending_stiffness = edited.bending_stiffness * 3.0_f32.powi(step.0.into());
            rod.material = RopeMaterial { bending_stiffness, ..edited };
        }
    }
}
