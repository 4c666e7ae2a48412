//! Colliders of every shape.

use bevy::math::{Quat, Vec3};
use bevy_mass_spring::solver::{Collider, Material, Pose, Shape};

/// A collider at rest.
pub fn resting(shape: Shape, point: Vec3) -> Collider {
    Collider::resting(shape, Pose { point, rotation: Quat::IDENTITY })
}

/// The same with a material.
pub fn with(collider: Collider, restitution: f32, friction: f32) -> Collider {
    Collider { material: Material { restitution, friction, ..Material::default() }, ..collider }
}

/// The tetrahedron of these half extents, closed.
pub fn tetrahedron(size: f32) -> Shape {
    let corners = [
        Vec3::new(1.0, 1.0, 1.0),
        Vec3::new(-1.0, -1.0, 1.0),
        Vec3::new(-1.0, 1.0, -1.0),
        Vec3::new(1.0, -1.0, -1.0),
    ];
    let vertices = corners.map(|corner| corner * size);
    Shape::mesh(&vertices, &[[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], false).unwrap()
}

/// The sphere of radius 1 m as a mesh: `rings` × 2 `rings` cells.
pub fn sphere_mesh(radius: f32, rings: u32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let columns = 2 * rings;
    let mut vertices = vec![Vec3::Y * radius, Vec3::NEG_Y * radius];
    for ring in 1..rings {
        let (sin, cos) = bevy::math::ops::sin_cos(std::f32::consts::PI * ring as f32 / rings as f32);
        for column in 0..columns {
            let (s, c) = bevy::math::ops::sin_cos(std::f32::consts::TAU * column as f32 / columns as f32);
            vertices.push(Vec3::new(sin * c, cos, sin * s) * radius);
        }
    }
    let at = |ring: u32, column: u32| 2 + (ring - 1) * columns + column % columns;
    let mut triangles = Vec::new();
    for column in 0..columns {
        triangles.push([0, at(1, column + 1), at(1, column)]);
        triangles.push([1, at(rings - 1, column), at(rings - 1, column + 1)]);
        for ring in 1..rings - 1 {
            let [a, b] = [at(ring, column), at(ring, column + 1)];
            let [c, d] = [at(ring + 1, column), at(ring + 1, column + 1)];
            triangles.extend([[a, b, c], [b, d, c]]);
        }
    }
    (vertices, triangles)
}

/// Every shape, with a name, its top at y = `top` above its centre there, flat or round.
pub fn shapes() -> Vec<(&'static str, Shape, f32)> {
    let (vertices, triangles) = sphere_mesh(0.5, 16);
    let cube = [Vec3::ONE, -Vec3::ONE].map(|sign| sign * 0.5);
    let cube = (0..8).map(|bits| Vec3::from_array([0, 1, 2].map(|axis| cube[bits >> axis & 1][axis])));
    let grid = Shape::mesh(
        &[
            Vec3::new(-1.0, 0.0, -1.0),
            Vec3::new(-1.0, 0.0, 1.0),
            Vec3::new(1.0, 0.0, -1.0),
            Vec3::new(1.0, 0.0, 1.0),
        ],
        &[[0, 1, 2], [2, 1, 3]],
        false,
    );
    vec![
        ("ball", Shape::ball(0.5), 0.5),
        ("capsule", Shape::capsule(0.2, 0.3), 0.5),
        ("box", Shape::cuboid(Vec3::new(0.7, 0.5, 0.4)), 0.5),
        ("cylinder", Shape::frustum([0.4, 0.4], 0.5), 0.5),
        ("frustum", Shape::frustum([0.5, 0.3], 0.25), 0.25),
        ("mesh", Shape::mesh(&vertices, &triangles, false).unwrap(), 0.5),
        ("hull", Shape::convex_hull(&cube.collect::<Vec<Vec3>>()).unwrap(), 0.5),
        ("sheet", grid.unwrap(), 0.0),
        (
            "compound",
            Shape::compound([(Vec3::Y * 0.25, Quat::IDENTITY, Shape::cuboid(Vec3::splat(0.25)))]),
            0.5,
        ),
    ]
}
