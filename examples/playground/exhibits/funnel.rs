//! A funnel full of ropes.

use bevy::asset::RenderAssetUsages;
use bevy::mesh::{Indices, PrimitiveTopology};
use bevy::prelude::*;
use bevy_egui::egui::Ui;
use bevy_mass_spring::nets::TriangleMesh;
use bevy_mass_spring::prelude::*;

use crate::frame::slider;
use crate::gallery::{AppExhibit, Exhibit};
use crate::stage::{Stage, View};

const EXHIBIT: Exhibit = Exhibit {
    name: "Funnel",
    caption: "Ropes slide through a funnel, a mesh of triangles, and pile up on the floor. They collide with it and with each \
              other along their length. Friction decides whether they get stuck.",
    view: View { focus: Vec3::new(0.0, 1.0, 0.0), distance: 5.0, yaw: 0.4, pitch: 0.25 },
};

const SIDES: u32 = 48;
/// Height and radius of the rings of the funnel, m, from its mouth down.
const RINGS: [[f32; 2]; 4] = [[2.1, 0.9], [1.3, 0.2], [0.9, 0.16], [0.85, 0.16]];
/// Number of ropes that fall into it.
const ROPES: u8 = 14;

pub fn plugin(app: &mut App) {
    app.add_exhibit(EXHIBIT, spawn, draw);
}

#[derive(Component)]
struct Funnel;

fn spawn(mut stage: Stage, mut collisions: ResMut<CollisionSettings>) {
    *collisions = CollisionSettings { friction: 0.1, ..default() };
    stage.floor();
    let look = funnel();
    let triangles = TriangleMesh::from_mesh(&look).expect("a funnel is made of triangles");
    let glass = StandardMaterial {
        base_color: Color::srgba(0.75, 0.85, 0.9, 0.35),
        alpha_mode: AlphaMode::Blend,
        double_sided: true,
        cull_mode: None,
        perceptual_roughness: 0.2,
        ..default()
    };
    let glass = MeshMaterial3d(stage.materials.add(glass));
    let look = Mesh3d(stage.meshes.add(look));
    stage.spawn((Funnel, ParticleCollider::new(triangles).with_friction(0.05), look, glass));
    for number in 0..ROPES {
        let angle = 2.4 * f32::from(number);
        let height = 2.0 + 0.13 * f32::from(number);
        let way = Vec3::new(angle.cos(), 0.0, angle.sin());
        let rope = Rope::between(-0.45 * way + Vec3::Y * height, 0.45 * way + Vec3::Y * height)
            .with_spacing(0.04)
            .with_radius(0.025)
            .with_material(RopeMaterial {
                linear_density: 0.3,
                stretch_stiffness: 2e3,
                retardation_time: 2e-4,
                ..default()
            });
        let paint = stage.paint(Color::hsl(25.0 * f32::from(number), 0.6, 0.45));
        stage.spawn((rope, RopeMesh::default(), paint));
    }
}

/// A sheet of revolution.
fn funnel() -> Mesh {
    let mut positions = Vec::new();
    for [height, radius] in RINGS {
        positions.extend((0..SIDES).map(|side| {
            let angle = std::f32::consts::TAU * side as f32 / SIDES as f32;
            [radius * angle.cos(), height, radius * angle.sin()]
        }));
    }
    let mut indices = Vec::new();
    for ring in 0..RINGS.len() as u32 - 1 {
        for side in 0..SIDES {
            let next = (side + 1) % SIDES;
            let [a, b] = [side, next].map(|side| ring * SIDES + side);
            indices.extend([a, b, a + SIDES, b, b + SIDES, a + SIDES]);
        }
    }
    let mut mesh = Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, vec![[0.0; 2]; positions.len()])
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
        .with_inserted_indices(Indices::U32(indices));
    mesh.compute_smooth_normals();
    mesh
}

fn draw(
    mut ui: InMut<Ui>,
    mut funnel: Single<&mut ParticleCollider, With<Funnel>>,
    mut collisions: ResMut<CollisionSettings>,
) {
    let mut friction = funnel.friction;
    if slider(&mut ui, "friction of the funnel", "", &mut friction, 0.0..=1.0) {
        funnel.friction = friction;
    }
    let mut friction = collisions.friction;
    if slider(&mut ui, "friction of the ropes", "", &mut friction, 0.0..=1.0) {
        collisions.friction = friction;
    }
}
