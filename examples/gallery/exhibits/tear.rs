//! A sheet that tears.

use bevy::prelude::*;
use bevy_egui::egui::Ui;
use bevy_mass_spring::prelude::*;

use crate::frame::slider;
use crate::gallery::{AppExhibit, Exhibit};
use crate::stage::{Stage, View};

const EXHIBIT: Exhibit = Exhibit {
    name: "Tear",
    caption: "A cannonball flies into a banner. Where a thread is stretched beyond its limit it breaks, and the mesh \
              opens along the tear. Drag what is left.",
    view: View { focus: Vec3::new(0.0, 1.5, 0.0), distance: 5.6, yaw: 0.65, pitch: 0.12 },
};

pub fn plugin(app: &mut App) {
    app.insert_resource(Pieces(1)).add_exhibit(EXHIBIT, spawn, draw).add_observer(count_pieces);
}

/// The number of pieces of the banner.
#[derive(Resource)]
struct Pieces(u32);

fn count_pieces(broke: On<Broke>, mut pieces: ResMut<Pieces>) {
    pieces.0 = broke.pieces.unwrap_or(pieces.0);
}

fn spawn(mut stage: Stage, mut pieces: ResMut<Pieces>) {
    pieces.0 = 1;
    stage.floor();
    let steel = stage.metal(Color::srgb(0.3, 0.3, 0.33));
    for side in [-1.0, 1.0] {
        stage.solid(Cylinder::new(0.04, 2.7), steel.clone(), Transform::from_xyz(1.14 * side, 1.35, 0.0));
    }
    let paint = stage.cloth(Color::srgb(0.92, 0.86, 0.72));
    let banner = Cloth::sheet(Rectangle::new(2.2, 1.6)).with_spacing(0.1).with_radius(0.006).with_material(
        ClothMaterial {
            stretch_stiffness: 2e3,
            area_density: 0.3,
            retardation_time: 3e-4,
            ..ClothMaterial::COTTON
        },
    );
    stage.spawn((
        banner,
        NetMesh,
        Breaking { strain: Some(0.25), ..default() },
        paint,
        Transform::from_xyz(0.0, 1.75, 0.0),
        related!(Parts[(Part::Edge(Side::Left), Pinned), (Part::Edge(Side::Right), Pinned)]),
    ));
    let ball = Mesh3d(stage.meshes.add(Sphere::new(0.16)));
    stage.spawn((
        Particle::new(8.0, 0.16),
        ParticleVelocity(Vec3::new(0.0, 3.0, -14.0)),
        ball,
        steel,
        Transform::from_xyz(0.25, 1.4, 4.0),
    ));
}

fn draw(mut ui: InMut<Ui>, mut banners: Query<&mut Breaking>, pieces: Res<Pieces>) {
    for mut breaking in &mut banners {
        let mut strain = breaking.strain.unwrap_or(1.0);
        if slider(&mut ui, "breaking strain", "", &mut strain, 0.02..=1.0) {
            breaking.strain = Some(strain);
        }
    }
    ui.label(format!("{} pieces", pieces.0));
}
