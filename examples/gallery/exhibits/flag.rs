//! A flag in a gusty wind.

use bevy::prelude::*;
use bevy_egui::egui::Ui;
use bevy_mass_spring::prelude::*;

use crate::frame::slider;
use crate::gallery::{AppExhibit, Exhibit};
use crate::stage::{Stage, View};

const EXHIBIT: Exhibit = Exhibit {
    name: "Flag",
    caption: "A cotton flag held along the mast. Air pushes on each triangle: it flutters by itself, and gusts run \
              along it.",
    view: View { focus: Vec3::new(0.8, 2.5, 0.0), distance: 5.6, yaw: 0.45, pitch: 0.08 },
};

pub fn plugin(app: &mut App) {
    app.add_exhibit(EXHIBIT, spawn, draw);
}

fn spawn(mut stage: Stage, mut environment: ResMut<Environment>) {
    *environment = Environment {
        wind: Vec3::new(7.0, 0.0, 1.5),
        air_density: 1.225,
        gusts: Some(Gusts { strength: 3.0, ..default() }),
        ..default()
    };
    let steel = stage.metal(Color::srgb(0.75, 0.76, 0.78));
    stage.solid(Cylinder::new(0.035, 3.6), steel.clone(), Transform::from_xyz(-0.04, 1.8, 0.0));
    stage.solid(Sphere::new(0.07), steel, Transform::from_xyz(-0.04, 3.62, 0.0));
    let paint = stage.cloth(Color::srgb(0.80, 0.12, 0.10));
    let flag = Cloth::sheet(Rectangle::new(1.8, 1.2)).with_spacing(0.06).with_radius(0.005).with_material(
        ClothMaterial {
            stretch_stiffness: 1e3,
            // As little as the explicit schemes take in some tens of substeps.
            retardation_time: 2e-4,
            ..ClothMaterial::COTTON
        },
    );
    stage.spawn((
        flag,
        NetMesh,
        paint,
        Transform::from_xyz(0.9, 2.9, 0.0),
        related!(Parts[(Part::Edge(Side::Left), Pinned)]),
    ));
}

fn draw(mut ui: InMut<Ui>, mut environment: ResMut<Environment>, mut flags: Query<&mut Cloth>) {
    let mut edited = *environment;
    slider(&mut ui, "wind", "m/s", &mut edited.wind.x, 0.0..=25.0);
    if let Some(gusts) = &mut edited.gusts {
        slider(&mut ui, "gusts", "m/s", &mut gusts.strength, 0.0..=10.0);
    }
    environment.set_if_neq(edited);
    for mut flag in &mut flags {
        let mut material = flag.material;
        slider(&mut ui, "area density", "kg/m²", &mut material.area_density, 0.03..=1.0);
        if material != flag.material {
            flag.material = material;
        }
    }
}
