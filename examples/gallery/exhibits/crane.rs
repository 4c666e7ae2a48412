//! A crane with a winch.

use bevy::prelude::*;
use bevy_egui::egui::Ui;
use bevy_mass_spring::prelude::*;

use crate::frame::{log_slider, slider};
use crate::gallery::{AppExhibit, Exhibit};
use crate::stage::{Stage, View};

const EXHIBIT: Exhibit = Exhibit {
    name: "Crane",
    caption: "The winch pays out and takes in a steel cable while the boom turns: links come and go at the top \
              without a jerk. With too heavy a load the winch stalls.",
    view: View { focus: Vec3::new(0.0, 1.7, 0.0), distance: 7.0, yaw: 0.5, pitch: 0.16 },
};

const TOP: f32 = 3.4;
const REACH: f32 = 1.6;

pub fn plugin(app: &mut App) {
    app.insert_resource(Operator { hoist: -0.4, slew: 0.35, by_itself: true })
        .add_exhibit(EXHIBIT, spawn, draw)
        .add_systems(FixedUpdate, operate);
}

/// What the levers say: speeds of the cable, m/s, and of the boom, rad/s.
#[derive(Resource)]
struct Operator {
    hoist: f32,
    slew: f32,
    by_itself: bool,
}

/// The boom, which turns about the mast.
#[derive(Component)]
struct Boom;

/// What hangs from the cable.
#[derive(Component)]
struct Load;

fn spawn(mut stage: Stage) {
    stage.floor();
    let yellow = stage.paint(Color::srgb(0.93, 0.68, 0.08));
    stage.solid(Cuboid::new(0.22, TOP, 0.22), yellow.clone(), Transform::from_xyz(0.0, 0.5 * TOP, 0.0));
    let boom = stage.spawn((Boom, Transform::from_xyz(0.0, TOP, 0.0), Visibility::default()));
    let beam = Mesh3d(stage.meshes.add(Cuboid::new(REACH + 0.9, 0.14, 0.14)));
    let drum = Mesh3d(stage.meshes.add(Cylinder::new(0.09, 0.2)));
    let grey = stage.metal(Color::srgb(0.4, 0.41, 0.44));
    let sideways = Quat::from_rotation_x(std::f32::consts::FRAC_PI_2);
    let end = Vec3::new(REACH, TOP - 0.1, 0.0);
    let crate_paint = stage.paint(Color::srgb(0.55, 0.36, 0.2));
    let crate_mesh = Mesh3d(stage.meshes.add(Cuboid::from_length(0.34)));
    let load = stage.spawn((
        Load,
        Particle::new(120.0, 0.2),
        crate_mesh,
        crate_paint,
        Transform::from_translation(end - Vec3::Y * 1.6),
    ));
    let hook = (Mesh3d(stage.meshes.add(Cylinder::new(0.02, 0.1))), grey.clone());
    stage.commands.entity(load).with_child((hook, Transform::from_xyz(0.0, 0.21, 0.0)));
    let cable = Rope::between(end, end - Vec3::Y * 1.36)
        .with_spacing(0.1)
        .with_radius(0.012)
        .with_material(RopeMaterial::STEEL_CABLE);
    let cable = stage.spawn((
        cable,
        RopeMesh::default(),
        grey.clone(),
        related!(Parts[(Part::End, Attachment::to(load))]),
    ));
    let winch = Winch { speed: 0.4, max_force: Some(4e3), min_length: 0.5, max_length: Some(2.6) };
    stage.commands.entity(boom).with_children(|boom| {
        boom.spawn((beam, yellow, Transform::from_xyz(0.5 * REACH - 0.3, 0.0, 0.0)));
        boom.spawn((drum, grey, Transform::from_xyz(REACH, -0.06, 0.0).with_rotation(sideways)));
        boom.spawn((PartOf(cable), Part::Start, Pinned, winch, Transform::from_xyz(REACH, -0.1, 0.0)));
    });
}

/// To and fro, up and down, or as the levers say.
fn operate(
    mut operator: ResMut<Operator>,
    time: Res<Time>,
    mut booms: Query<&mut Transform, With<Boom>>,
    mut winches: Query<&mut Winch>,
) {
    if operator.by_itself {
        operator.hoist = 0.45 * (0.5 * time.elapsed_secs()).sin();
        operator.slew = 0.45 * (0.31 * time.elapsed_secs()).cos();
    }
    for mut boom in &mut booms {
        boom.rotate_y(operator.slew * time.delta_secs());
    }
    for mut winch in &mut winches {
        if winch.speed != operator.hoist {
            winch.speed = operator.hoist;
        }
    }
}

fn draw(
    mut ui: InMut<Ui>,
    mut operator: ResMut<Operator>,
    mut loads: Query<&mut Particle, With<Load>>,
    cables: Query<&ParticleNet, With<RopeMesh>>,
) {
    ui.checkbox(&mut operator.by_itself, "by itself");
    let Operator { mut hoist, mut slew, .. } = *operator;
    let moved = slider(&mut ui, "cable", "m/s", &mut hoist, -1.0..=1.0);
    if slider(&mut ui, "boom", "rad/s", &mut slew, -1.0..=1.0) || moved {
        *operator = Operator { hoist, slew, by_itself: false };
    }
    for mut load in &mut loads {
        let mut mass = load.mass;
        if log_slider(&mut ui, "load", "kg", &mut mass, 1.0..=2000.0) {
            load.mass = mass;
        }
    }
    for cable in &cables {
        ui.label(format!("{:.2} m of cable", cable.length().unwrap_or_default()));
    }
}
