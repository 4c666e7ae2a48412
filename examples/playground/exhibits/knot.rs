//! A knot that is pulled tight.

use bevy::math::curve::{FunctionCurve, Interval};
use bevy::prelude::*;
use bevy_egui::egui::Ui;
use bevy_mass_spring::prelude::*;

use crate::frame::{log_slider, slider};
use crate::gallery::{AppExhibit, Exhibit};
use crate::stage::{Stage, View};

const EXHIBIT: Exhibit = Exhibit {
    name: "Knot",
    caption: "An overhand knot is pulled tight in a rope that meets itself along its length. With friction it holds; \
              without, the rope runs through the knot until that is small.",
    view: View { focus: Vec3::new(0.0, 1.3, 0.0), distance: 4.2, yaw: 0.15, pitch: 0.15 },
};

const HEIGHT: f32 = 1.3;
/// The speed at which each end is pulled, m/s.
const SPEED: f32 = 0.25;
/// The distance by which each end is pulled, m.
const WAY: f32 = 1.2;

pub fn plugin(app: &mut App) {
    app.insert_resource(Pull { way: WAY }).add_exhibit(EXHIBIT, spawn, draw).add_systems(FixedUpdate, pull);
}

#[derive(Resource)]
struct Pull {
    /// How far the ends go, m.
    way: f32,
}

/// An end of the rope: where it began, and where it is pulled to.
#[derive(Component)]
struct End {
    start: Vec3,
    direction: Vec3,
    moved: f32,
}

fn spawn(
    mut stage: Stage,
    mut collisions: ResMut<CollisionSettings>,
    mut environment: ResMut<Environment>,
    mut pulling: ResMut<Pull>,
) {
    // In place of the damping of hemp.
    environment.viscosity = 0.01;
    *collisions = CollisionSettings { friction: 0.3, ..default() };
    pulling.way = WAY;
    stage.floor();
    // The trefoil of Shastri (1992), which is open at its ends: x = t³ − 3 t, y = t⁴ − 4 t², z = t⁵ − 10 t.
    let domain = Interval::new(-2.25, 2.25).expect("the first number is the smaller one");
    let trefoil = FunctionCurve::new(domain, |t: f32| {
        let [x, y, z] = [t.powi(3) - 3.0 * t, t.powi(4) - 4.0 * t * t, t.powi(5) - 10.0 * t];
        Vec3::new(0.11 * x, HEIGHT + 0.09 * y, 0.026 * z)
    });
    let rope = Rope::along(trefoil).with_spacing(0.025).with_radius(0.02).with_material(RopeMaterial {
        linear_density: 0.2,
        stretch_stiffness: 3e3,
        retardation_time: 1e-4,
        ..default()
    });
    let [start, end] = [rope.path[0], rope.path[rope.path.len() - 1]];
    let paint = stage.paint(Color::srgb(0.75, 0.25, 0.2));
    let rope = stage.spawn((rope, RopeMesh::default(), paint));
    for (part, start, direction) in [(Part::Start, start, start.x), (Part::End, end, end.x)] {
        let direction = Vec3::X * direction.signum();
        stage.spawn((PartOf(rope), part, Pinned, End { start, direction, moved: 0.0 }));
    }
}

fn pull(pulling: Res<Pull>, time: Res<Time>, mut ends: Query<(&mut End, &mut Transform)>) {
    let step = SPEED * time.delta_secs();
    for (mut end, mut transform) in &mut ends {
        end.moved += (pulling.way - end.moved).clamp(-step, step);
        // Down to the height of the knot on the way.
        let mut place = end.start + end.direction * end.moved;
        place.y += (HEIGHT - place.y) * (end.moved / WAY).clamp(0.0, 1.0);
        transform.translation = place;
    }
}

fn draw(
    mut ui: InMut<Ui>,
    mut collisions: ResMut<CollisionSettings>,
    mut pulling: ResMut<Pull>,
    mut ropes: Query<&mut Rope>,
) {
    let mut friction = collisions.friction;
    if slider(&mut ui, "friction", "", &mut friction, 0.0..=1.0) {
        collisions.friction = friction;
    }
    for mut rope in &mut ropes {
        let mut stiffness = rope.material.stretch_stiffness;
        if log_slider(&mut ui, "stretch stiffness", "N", &mut stiffness, 3e2..=1e5) {
            rope.material.stretch_stiffness = stiffness;
        }
    }
    slider(&mut ui, "ends pulled by", "m", &mut pulling.way, 0.0..=WAY);
}
