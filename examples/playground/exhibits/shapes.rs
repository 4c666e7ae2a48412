//! One of each collider, and a cloth that falls onto it.

use bevy::prelude::*;
use bevy_egui::egui::Ui;
use bevy_mass_spring::nets::TriangleMesh;
use bevy_mass_spring::prelude::*;

use crate::frame::slider;
use crate::gallery::{AppExhibit, Exhibit};
use crate::stage::{Stage, View};

const EXHIBIT: Exhibit = Exhibit {
    name: "One of each",
    caption: "A ball, a capsule, a box, a cylinder, a cone, a frustum, a convex hull, a mesh and a height field, each \
              under a cloth of its own. The corners of the box do not pierce it. Drag a cloth away.",
    view: View { focus: Vec3::new(0.0, 0.45, 0.0), distance: 7.6, yaw: 0.5, pitch: 0.5 },
};

/// Softer than any cloth, so that nine of them take few substeps.
const SHEET: ClothMaterial = ClothMaterial {
    area_density: 0.12,
    stretch_stiffness: 100.0,
    shear_stiffness: 10.0,
    retardation_time: 3e-4,
    ..ClothMaterial::SILK
};

const DISTANCE: f32 = 1.6;
const PER_ROW: usize = 3;

pub fn plugin(app: &mut App) {
    app.add_exhibit(EXHIBIT, spawn, draw);
}

fn spawn(mut stage: Stage, mut collisions: ResMut<CollisionSettings>) {
    *collisions = CollisionSettings { friction: 0.3, ..default() };
    stage.floor();
    let stone = stage.paint(Color::srgb(0.52, 0.50, 0.47));
    let solids: [(ColliderShape, Mesh); 9] = [
        (Sphere::new(0.4).into(), Sphere::new(0.4).into()),
        (Capsule3d::new(0.25, 0.4).into(), Capsule3d::new(0.25, 0.4).into()),
        (Cuboid::new(0.7, 0.6, 0.5).into(), Cuboid::new(0.7, 0.6, 0.5).into()),
        (Cylinder::new(0.35, 0.7).into(), Cylinder::new(0.35, 0.7).into()),
        (Cone::new(0.4, 0.9).into(), Cone::new(0.4, 0.9).into()),
        frustum(),
        hull(),
        mesh(Torus::new(0.14, 0.42).mesh().minor_resolution(12).major_resolution(24).build()),
        height_field(),
    ];
    for (number, (shape, look)) in solids.into_iter().enumerate() {
        let [column, row] = [number % PER_ROW, number / PER_ROW].map(|place| place as f32 - 1.0);
        let place = Vec3::new(column * DISTANCE, 0.45, row * DISTANCE);
        let turn = if number == 2 { Quat::from_rotation_y(0.5) } else { Quat::IDENTITY };
        let look = Mesh3d(stage.meshes.add(look));
        let transform = Transform::from_translation(place).with_rotation(turn);
        stage.spawn((ParticleCollider::new(shape).with_friction(0.4), look, stone.clone(), transform));
        let color = Color::hsl(40.0 * number as f32, 0.55, 0.45);
        let cloth = Cloth::from(Plane3d::new(Vec3::Y, Vec2::splat(0.6)))
            .with_spacing(0.12)
            .with_radius(0.008)
            .with_material(SHEET);
        let paint = stage.cloth(color);
        stage.spawn((cloth, NetMesh, paint, Transform::from_translation(place + Vec3::Y * 0.75)));
    }
}

fn frustum() -> (ColliderShape, Mesh) {
    let frustum = ConicalFrustum { radius_top: 0.2, radius_bottom: 0.42, height: 0.7 };
    (frustum.into(), frustum.into())
}

/// The hull of a tetrahedron and its mirror image.
fn hull() -> (ColliderShape, Mesh) {
    let points: Vec<Vec3> =
        [Vec3::new(1.0, -0.8, 0.6), Vec3::new(-1.0, -0.8, 0.6), Vec3::new(0.0, -0.8, -1.1)]
            .into_iter()
            .flat_map(|corner| [0.42 * corner, -0.42 * corner])
            .collect();
    let shape = ColliderShape::ConvexHull { points: points.clone().into() };
    // An octahedron: each triangle joins three points of which no two are opposite ones.
    let mut vertices = Vec::new();
    for signs in 0..8_usize {
        let [a, b, c] = [0, 1, 2].map(|axis| points[2 * axis + (signs >> axis & 1)]);
        let outward = (b - a).cross(c - a).dot(a + b + c) > 0.0;
        vertices.extend(if outward { [a, b, c] } else { [a, c, b] });
    }
    let normals: Vec<Vec3> = vertices
        .chunks_exact(3)
        .flat_map(|corners| [(corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize(); 3])
        .collect();
    let mesh = Mesh::new(bevy::mesh::PrimitiveTopology::TriangleList, default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, vec![[0.0; 2]; vertices.len()])
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, vertices)
        .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, normals);
    (shape, mesh)
}

/// The triangles of a mesh, where vertices at seams are one.
fn mesh(look: Mesh) -> (ColliderShape, Mesh) {
    let triangles = TriangleMesh::from_mesh(&look).expect("a torus is made of triangles");
    (triangles.into(), look)
}

/// Gentle hills.
fn height_field() -> (ColliderShape, Mesh) {
    const POINTS: usize = 21;
    let size = Vec2::splat(1.2);
    let height = |row: usize, column: usize| {
        let [x, z] = [column, row].map(|number| 9.0 * number as f32 / (POINTS - 1) as f32);
        0.09 * x.sin() + 0.09 * z.cos() - 0.1
    };
    let heights: Vec<Vec<f32>> =
        (0..POINTS).map(|row| (0..POINTS).map(|column| height(row, column)).collect()).collect();
    let shape = ColliderShape::HeightField { size, heights: heights.into() };
    let mut look = Plane3d::new(Vec3::Y, 0.5 * size).mesh().subdivisions(POINTS as u32 - 2).build();
    if let Some(bevy::mesh::VertexAttributeValues::Float32x3(positions)) =
        look.attribute_mut(Mesh::ATTRIBUTE_POSITION)
    {
        for [x, y, z] in positions {
            let [column, row] = [*x, *z].map(|along| ((along / size.x + 0.5) * (POINTS - 1) as f32).round());
            *y = height(row as usize, column as usize);
        }
    }
    look.compute_smooth_normals();
    (shape, look)
}

fn draw(mut ui: InMut<Ui>, mut colliders: Query<&mut ParticleCollider>) {
    let Some(mut friction) = colliders.iter().last().map(|collider| collider.friction) else { return };
    if slider(&mut ui, "friction", "", &mut friction, 0.0..=1.0) {
        colliders.iter_mut().for_each(|mut collider| collider.friction = friction);
    }
}
