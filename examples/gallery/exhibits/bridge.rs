//! A rope bridge.

use bevy::prelude::*;
use bevy_egui::egui::Ui;
use bevy_mass_spring::prelude::*;

use crate::frame::log_slider;
use crate::gallery::{AppExhibit, Exhibit};
use crate::stage::{Stage, View};

const EXHIBIT: Exhibit = Exhibit {
    name: "Rope bridge",
    caption: "Two ropes carry planks, two more are the handrails. Three balls run down to the middle: the bridge sags \
              under each. Drag a ball and let go: the wave runs along the bridge.",
    view: View { focus: Vec3::new(0.0, 1.5, 0.0), distance: 7.6, yaw: 0.45, pitch: 0.2 },
};

const HALF_SPAN: f32 = 2.4;
const HALF_WIDTH: f32 = 0.35;
const DECK: f32 = 1.6;
const RAIL: f32 = 0.75;
const SEGMENTS: u32 = 48;
/// Number of particles of the ropes from one plank to the next.
const PLANK: u32 = 1;
/// Number of planks from one hanger to the next.
const HANGER: u32 = 4;

/// Softer than hemp and with less damping of its own, so that the explicit schemes take it in some tens of substeps.
const CORD: RopeMaterial = RopeMaterial {
    linear_density: 0.3,
    stretch_stiffness: 3e4,
    retardation_time: 1e-4,
    ..RopeMaterial::HEMP
};

pub fn plugin(app: &mut App) {
    app.add_exhibit(EXHIBIT, spawn, draw).add_systems(Update, lay_planks);
}

/// A plank lies on two parts, one of each rope.
#[derive(Component)]
struct Plank([Entity; 2]);

#[derive(Component)]
struct Ball;

fn spawn(mut stage: Stage, mut collisions: ResMut<CollisionSettings>, mut environment: ResMut<Environment>) {
    // Particles do not rotate: balls that roll are balls with hardly any friction.
    *collisions = CollisionSettings { friction: 0.03, restitution: 0.4, ..default() };
    // In place of the damping of hemp and wood.
    environment.viscosity = 0.1;
    stage.floor();
    let wood = stage.paint(Color::srgb(0.48, 0.33, 0.2));
    let stone = stage.paint(Color::srgb(0.45, 0.44, 0.42));
    for side in [-1.0, 1.0] {
        let tower = Transform::from_xyz(side * (HALF_SPAN + 0.42), 0.5 * DECK - 0.03, 0.0);
        stage.solid(Cuboid::new(0.8, DECK - 0.06, 1.4), stone.clone(), tower);
        for z in [-HALF_WIDTH, HALF_WIDTH] {
            let post = Transform::from_xyz(side * (HALF_SPAN + 0.04), DECK - 0.06 + 0.5 * (RAIL + 0.12), z);
            stage.solid(Cylinder::new(0.04, RAIL + 0.12), wood.clone(), post);
        }
    }
    let hemp = stage.paint(Color::srgb(0.70, 0.58, 0.38));
    let mut carriers = Vec::new();
    let mut rails = Vec::new();
    for z in [-HALF_WIDTH, HALF_WIDTH] {
        let carrier = RopeMaterial { linear_density: 1.2, ..CORD };
        carriers.push(spawn_rope(&mut stage, &hemp, (DECK, z), 0.02, carrier));
        rails.push(spawn_rope(&mut stage, &hemp, (DECK + RAIL, z), 0.016, CORD));
    }
    let mesh = Mesh3d(stage.meshes.add(Cuboid::new(0.075, 0.025, 2.0 * HALF_WIDTH + 0.1)));
    for index in (PLANK..SEGMENTS).step_by(PLANK as usize) {
        let ends = [0, 1].map(|side| stage.spawn((PartOf(carriers[side]), Part::Particle(index))));
        // It keeps the ropes apart, and carries what rolls over it.
        stage.spawn(Spring::new(ends[0], ends[1], 2.0 * HALF_WIDTH).with_stiffness(2e4).with_damping(20.0));
        stage.spawn((Plank(ends), mesh.clone(), wood.clone(), Transform::default()));
        let x = (2.0 * index as f32 / SEGMENTS as f32 - 1.0) * HALF_SPAN;
        for share in [-0.66, -0.33, 0.0, 0.33, 0.66_f32] {
            let place = Transform::from_xyz(x, DECK, share * HALF_WIDTH);
            let knot = stage.spawn((Particle::new(0.4, 0.05), place));
            for (end, side) in ends.into_iter().zip([-1.0, 1.0]) {
                let length = (side - share).abs() * HALF_WIDTH;
                stage.spawn(Spring::new(end, knot, length).with_stiffness(2e4).with_damping(10.0));
            }
        }
        if index % (PLANK * HANGER) == 0 {
            for side in [0, 1] {
                let rail = stage.spawn((PartOf(rails[side]), Part::Particle(index)));
                let z = [-HALF_WIDTH, HALF_WIDTH][side];
                let hanger = Rope::between(Vec3::new(x, DECK + RAIL, z), Vec3::new(x, DECK, z));
                let hanger = hanger.with_segments(5).with_radius(0.007).with_material(CORD);
                stage.spawn((
                    hanger,
                    RopeMesh::default(),
                    hemp.clone(),
                    related!(Parts[
                        (Part::Start, Attachment::to(rail).with_stiffness(1e4)),
                        (Part::End, Attachment::to(ends[side]).with_stiffness(1e4)),
                    ]),
                ));
            }
        }
    }
    for (number, color) in [(0.0, 0.1), (1.0, 0.5), (2.0, 0.75)] {
        let radius = 0.17 + 0.03 * number;
        let paint = stage.metal(Color::hsl(360.0 * color, 0.7, 0.5));
        let mesh = Mesh3d(stage.meshes.add(Sphere::new(radius)));
        let place = Transform::from_xyz(-1.3 + 1.2 * number, DECK + 0.3, 0.0);
        let ball = (Ball, Particle::new(10.0 + 6.0 * number, radius), mesh, paint, place);
        stage.spawn((ball, ParticleVelocity(Vec3::X * (1.2 - 0.9 * number))));
    }
}

fn spawn_rope(
    stage: &mut Stage,
    paint: &MeshMaterial3d<StandardMaterial>,
    (height, z): (f32, f32),
    radius: f32,
    material: RopeMaterial,
) -> Entity {
    let rope = Rope::between(Vec3::new(-HALF_SPAN, height, z), Vec3::new(HALF_SPAN, height, z))
        .with_segments(SEGMENTS)
        .with_radius(radius)
        .with_material(material);
    stage.spawn((
        rope,
        RopeMesh::default(),
        paint.clone(),
        related!(Parts[(Part::Start, Pinned), (Part::End, Pinned)]),
    ))
}

/// Lays each plank on its two parts.
fn lay_planks(mut planks: Query<(&Plank, &mut Transform)>, places: Query<&Transform, Without<Plank>>) {
    for (plank, mut transform) in &mut planks {
        let Ok([a, b]) = places.get_many(plank.0) else { continue };
        let along = (b.translation - a.translation).normalize_or(Vec3::Z);
        *transform = Transform::from_translation(a.translation.midpoint(b.translation))
            .with_rotation(Quat::from_rotation_arc(Vec3::Z, along));
    }
}

fn draw(mut ui: InMut<Ui>, mut balls: Query<&mut Particle, With<Ball>>, mut ropes: Query<&mut Rope>) {
    let total: f32 = balls.iter().map(|ball| ball.mass).sum();
    let mut edited = total;
    if log_slider(&mut ui, "balls", "kg", &mut edited, 1.0..=400.0) {
        balls.iter_mut().for_each(|mut ball| ball.mass *= edited / total);
    }
    let Some(stiffness) = ropes.iter().next().map(|rope| rope.material.stretch_stiffness) else { return };
    let mut edited = stiffness;
    if log_slider(&mut ui, "EA", "N", &mut edited, 3e3..=1e6) {
        ropes.iter_mut().for_each(|mut rope| rope.material.stretch_stiffness *= edited / stiffness);
    }
}
