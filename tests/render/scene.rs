//! The app, and nets for it.

use std::sync::Arc;

use bevy::asset::AssetPlugin;
use bevy::camera::CameraPlugin;
use bevy::camera::primitives::Aabb;
use bevy::math::ops;
use bevy::mesh::{MeshPlugin, VertexAttributeValues};
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_mass_spring::nets::{Layout, Topology};
use bevy_mass_spring::prelude::*;
use bevy_mass_spring::solver;

/// An app with a camera at z = 5 that looks at the origin.
pub fn app() -> App {
    app_with(|_| ())
}

/// The same with more plugins.
pub fn app_with(build: impl FnOnce(&mut App)) -> App {
    let mut app = App::new();
    app.add_plugins((
        MinimalPlugins,
        TransformPlugin,
        AssetPlugin::default(),
        MeshPlugin,
        CameraPlugin,
        MassSpringRenderPlugin,
    ))
    .insert_resource(TimeUpdateStrategy::FixedTimesteps(1));
    app.world_mut().spawn((Camera3d::default(), Transform::from_xyz(0.0, 0.0, 5.0)));
    build(&mut app);
    app.finish();
    app.cleanup();
    app
}

/// A sheet of so many cells in the xy plane, its rows from the top, with cells of 0.1 m.
pub fn sheet(cells: [u32; 2]) -> Topology {
    let [columns, rows] = cells;
    let number = |column: u32, row: u32| row * (columns + 1) + column;
    let mut triangles = Vec::new();
    let mut positions = Vec::new();
    for row in 0..=rows {
        for column in 0..=columns {
            positions.push(Vec3::new(column as f32 * 0.1, row as f32 * -0.1, 0.0));
            if column < columns && row < rows {
                let (here, right) = (number(column, row), number(column + 1, row));
                let (below, across) = (number(column, row + 1), number(column + 1, row + 1));
                triangles.extend([[here, below, across], [here, across, right]]);
            }
        }
    }
    Topology {
        masses: vec![0.01; positions.len()],
        positions,
        triangles,
        radius: 0.01,
        layout: Layout::Grid { cells },
        ..Topology::default()
    }
}

/// A rope of so many links of 0.1 m along x.
pub fn rope(links: u32) -> Topology {
    let spring = solver::Spring { rest_length: 0.1, ..solver::Spring::default() };
    Topology {
        positions: (0..=links).map(|number| Vec3::X * 0.1 * number as f32).collect(),
        masses: vec![0.01; links as usize + 1],
        radius: 0.02,
        springs: (0..links).map(|number| ([number, number + 1], spring)).collect(),
        layout: Layout::Rope { is_closed: false },
        ..Topology::default()
    }
}

/// A net of this topology, laid out at the origin.
pub fn net(topology: Topology) -> ParticleNet {
    ParticleNet::new(Arc::new(topology), &Transform::IDENTITY)
}

/// Something that is nowhere straight, and different for each seed.
pub fn crumple(seed: u32) -> impl Fn(usize, Vec3) -> Vec3 {
    move |number, place| {
        let phase = number as f32 * 0.37 + seed as f32;
        place
            + 0.03
                * Vec3::new(ops::sin(1.3 * phase), ops::sin(2.1 * phase + 1.0), ops::sin(1.7 * phase + 2.0))
    }
}

/// Moves each particle of a net.
pub fn move_particles(app: &mut App, net: Entity, motion: impl Fn(usize, Vec3) -> Vec3) {
    let mut net = app.world_mut().get_mut::<ParticleNet>(net).unwrap();
    for (number, place) in net.positions_mut().iter_mut().enumerate() {
        *place = motion(number, *place);
    }
}

/// The mesh that an entity has now.
pub fn mesh(app: &App, entity: Entity) -> &Mesh {
    let world = app.world();
    let handle = match world.get::<Mesh3d>(entity) {
        Some(mesh) => &mesh.0,
        None => &world.get::<Mesh2d>(entity).unwrap().0,
    };
    world.resource::<Assets<Mesh>>().get(handle).unwrap()
}

/// A vector attribute of a mesh.
pub fn vectors(mesh: &Mesh, attribute: bevy::mesh::MeshVertexAttribute) -> Vec<Vec3> {
    match mesh.attribute(attribute).unwrap() {
        VertexAttributeValues::Float32x3(values) => values.iter().map(|value| Vec3::from(*value)).collect(),
        VertexAttributeValues::Float32x4(values) => {
            values.iter().map(|[x, y, z, _]| Vec3::new(*x, *y, *z)).collect()
        }
        other => panic!("{other:?}"),
    }
}

pub fn positions(mesh: &Mesh) -> Vec<Vec3> {
    vectors(mesh, Mesh::ATTRIBUTE_POSITION)
}

pub fn normals(mesh: &Mesh) -> Vec<Vec3> {
    vectors(mesh, Mesh::ATTRIBUTE_NORMAL)
}

/// The triangles of a mesh, by vertex.
pub fn triangles(mesh: &Mesh) -> Vec<[usize; 3]> {
    let corners: Vec<usize> = mesh.indices().unwrap().iter().collect();
    corners.as_chunks().0.to_vec()
}

/// Asserts that the box of an entity encloses all of its vertices, exactly.
pub fn assert_enclosed(app: &App, entity: Entity) {
    let aabb = app.world().get::<Aabb>(entity).unwrap();
    for place in positions(mesh(app, entity)) {
        let place = bevy::math::Vec3A::from(place);
        assert!(place.cmpge(aabb.min()).all() && place.cmple(aabb.max()).all(), "{place} is not in {aabb:?}");
    }
}
