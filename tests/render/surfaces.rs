//! Meshes that nets move: positions, normals, tangents, bounds.

use std::f32::consts::PI;

use bevy::camera::primitives::Aabb;
use bevy::math::ops;
use bevy::mesh::{Indices, VertexAttributeValues};
use bevy::prelude::*;
use bevy_mass_spring::nets::{MeshBinding, Topology};
use bevy_mass_spring::prelude::*;
use bevy_mass_spring::render::RestMesh;

use crate::scene::{
    app, assert_enclosed, crumple, mesh, move_particles, net, normals, positions, sheet, triangles, vectors,
};

#[test]
fn a_net_without_a_mesh_gets_one_of_its_triangles() {
    let mut app = app();
    let topology = sheet([4, 3]);
    let expected = topology.positions.clone();
    let cloth = app.world_mut().spawn((net(topology), NetMesh)).id();
    app.update();
    let mesh = mesh(&app, cloth);
    assert_eq!(positions(mesh), expected);
    assert_eq!(triangles(mesh).len(), 24);
    for normal in normals(mesh) {
        assert!(normal.distance(Vec3::Z) <= f32::EPSILON);
    }
    // The texture is upright: (0, 0) is the upper left corner, as on Bevy's rectangles.
    let Some(VertexAttributeValues::Float32x2(uvs)) = mesh.attribute(Mesh::ATTRIBUTE_UV_0) else { panic!() };
    assert_eq!((uvs[0], uvs[4], uvs[19]), ([0.0, 0.0], [1.0, 0.0], [1.0, 1.0]));
    let Some(VertexAttributeValues::Float32x4(tangents)) = mesh.attribute(Mesh::ATTRIBUTE_TANGENT) else {
        panic!()
    };
    for tangent in tangents {
        assert!(Vec4::from(*tangent).distance(Vec4::new(1.0, 0.0, 0.0, 1.0)) <= 4.0 * f32::EPSILON);
    }
}

/// A sheet rolled to a cylinder: the normals are radial, the tangents go around. Of a chord that spans the angle a, the
/// mean of the two at a vertex is exact inside; at the edges it is off by a / 2.
#[test]
fn normals_and_tangents_of_a_cylinder() {
    let mut app = app();
    let cloth = app.world_mut().spawn((net(sheet([40, 4])), NetMesh)).id();
    app.update();
    let radius = 4.0 / PI; // a half circle
    let angle = |x: f32| x / radius;
    move_particles(&mut app, cloth, |_, place| {
        let (sin, cos) = ops::sin_cos(angle(place.x));
        Vec3::new(radius * sin, place.y, radius * cos)
    });
    app.update();
    let mesh = mesh(&app, cloth);
    let tangents = vectors(mesh, Mesh::ATTRIBUTE_TANGENT);
    let half_step = 0.5 * angle(0.1);
    for (number, normal) in normals(mesh).iter().enumerate() {
        let column = number % 41;
        let (sin, cos) = ops::sin_cos(angle(column as f32 * 0.1));
        let radial = Vec3::new(sin, 0.0, cos);
        // The diagonals weight the two sides of a vertex 1 to 2 at the upper and lower edge: off by a third of half a
        // step. Else both weigh the same.
        let is_corner_row = number < 41 || number >= 4 * 41;
        let bound = match column {
            0 | 40 => half_step,
            _ if is_corner_row => half_step / 3.0,
            _ => 0.0,
        };
        assert!(normal.angle_between(radial) < 1.01 * bound + 1e-3, "{number}: {normal} {radial}");
        let around = Vec3::new(cos, 0.0, -sin);
        assert!(tangents[number].angle_between(around) < 1.01 * bound + 0.5 * angle(0.1), "{number}");
        assert!(tangents[number].dot(*normal).abs() < 1e-6);
    }
}

/// The same as Bevy's own function of the same weights, up to rounding; near its smooth normals, which weight by angles.
#[test]
fn normals_are_those_of_bevy() {
    let mut app = app();
    let cloth = app.world_mut().spawn((net(sheet([12, 9])), NetMesh)).id();
    app.update();
    move_particles(&mut app, cloth, crumple(3));
    app.update();
    let mut reference = mesh(&app, cloth).clone();
    let ours = normals(&reference);
    reference.compute_area_weighted_normals();
    for (ours, theirs) in ours.iter().zip(normals(&reference)) {
        assert!(ours.distance(theirs) < 1e-6, "{ours} {theirs}");
    }
    // Crumpled by less than a third of a cell: angles and areas differ by less than that.
    reference.compute_smooth_normals();
    let angles: Vec<f32> =
        ours.iter().zip(normals(&reference)).map(|(ours, theirs)| ours.angle_between(theirs)).collect();
    let mean = angles.iter().sum::<f32>() / angles.len() as f32;
    assert!(mean < 0.1, "{mean}");
}

/// A mesh with a seam: the vertices of the middle column are there twice.
fn seamed_mesh() -> (Mesh, Topology) {
    let topology = sheet([4, 3]);
    let mut mesh =
        Mesh::new(bevy::mesh::PrimitiveTopology::TriangleList, bevy::asset::RenderAssetUsages::default());
    let twins: Vec<u32> = (0..20).filter(|number| number % 5 == 2).collect();
    let particle_of: Vec<u32> = (0..20).chain(twins.iter().copied()).collect();
    let places: Vec<Vec3> =
        particle_of.iter().map(|particle| topology.positions[*particle as usize]).collect();
    // What is right of the seam takes the twins.
    let corners = topology.triangles.iter().flat_map(|triangle| {
        let is_right = triangle.iter().any(|corner| corner % 5 > 2);
        triangle.map(|corner| match twins.iter().position(|twin| *twin == corner) {
            Some(number) if is_right => 20 + number as u32,
            _ => corner,
        })
    });
    mesh.insert_indices(Indices::U32(corners.collect()));
    let colours: Vec<[f32; 4]> = (0..24).map(|vertex| [vertex as f32, 0.0, 0.0, 1.0]).collect();
    mesh.insert_attribute(Mesh::ATTRIBUTE_COLOR, colours);
    mesh.insert_attribute(Mesh::ATTRIBUTE_POSITION, places);
    let binding = Some(MeshBinding::Welded(particle_of));
    (mesh, Topology { binding, ..topology })
}

#[test]
fn seams_do_not_gape() {
    let mut app = app();
    let (mesh_at_rest, topology) = seamed_mesh();
    let handle = app.world_mut().resource_mut::<Assets<Mesh>>().add(mesh_at_rest.clone());
    let cloth = app.world_mut().spawn((net(topology), NetMesh, Mesh3d(handle.clone()))).id();
    for seed in 0..10 {
        move_particles(&mut app, cloth, crumple(seed));
        app.update();
        let mesh = mesh(&app, cloth);
        let (positions, normals) = (positions(mesh), normals(mesh));
        for (twin, vertex) in [2, 7, 12, 17].into_iter().enumerate() {
            assert_eq!(positions[vertex], positions[20 + twin]);
            assert_eq!(normals[vertex], normals[20 + twin]);
        }
        assert_eq!(mesh.attribute(Mesh::ATTRIBUTE_COLOR), mesh_at_rest.attribute(Mesh::ATTRIBUTE_COLOR));
        assert_eq!(triangles(mesh), triangles(&mesh_at_rest));
    }
    // The mesh that others may have is what it was.
    let kept = app.world().resource::<Assets<Mesh>>().get(&handle).unwrap();
    assert_eq!(*kept, mesh_at_rest);
    assert_eq!(app.world().get::<RestMesh>(cloth), Some(&RestMesh(handle)));
}

#[test]
fn a_mesh_of_another_net_is_left_alone() {
    let mut app = app();
    let handle = app.world_mut().resource_mut::<Assets<Mesh>>().add(Cuboid::default());
    let cloth = app.world_mut().spawn((net(sheet([4, 3])), NetMesh, Mesh3d(handle.clone()))).id();
    app.update();
    move_particles(&mut app, cloth, crumple(1));
    app.update();
    assert_eq!(app.world().get::<Mesh3d>(cloth), Some(&Mesh3d(handle)));
    assert_eq!(*mesh(&app, cloth), Mesh::from(Cuboid::default()));
}

/// The entity may be anywhere: its particles are where they are in the world.
#[test]
fn vertices_are_where_the_particles_are() {
    for place in [
        Transform::from_xyz(1.0, 0.5, -2.0),
        Transform::from_xyz(-1.0, 2.0, 0.5).with_rotation(Quat::from_rotation_x(1.0)),
        Transform::from_xyz(0.3, 0.0, 0.0).with_scale(Vec3::new(2.0, 0.5, 1.0)),
    ] {
        let mut app = app();
        let cloth = app.world_mut().spawn((net(sheet([4, 3])), NetMesh, place)).id();
        app.update();
        move_particles(&mut app, cloth, crumple(2));
        app.update();
        let drawn = positions(mesh(&app, cloth));
        for (vertex, particle) in drawn.iter().zip(app.world().get::<ParticleNet>(cloth).unwrap().positions())
        {
            let vertex = place.transform_point(*vertex);
            // A few roundings of coordinates below 4.
            assert!(vertex.distance(*particle) < 16.0 * 4.0 * f32::EPSILON, "{vertex} {particle}");
        }
        assert_enclosed(&app, cloth);
    }
}

#[test]
fn the_box_encloses_all_vertices_in_every_frame() {
    let mut app = app();
    let cloth = app.world_mut().spawn((net(sheet([6, 5])), NetMesh)).id();
    for seed in 0..50 {
        move_particles(&mut app, cloth, crumple(seed));
        app.update();
        assert_enclosed(&app, cloth);
    }
    // And no more than that: by a part in a hundred thousand.
    let aabb = *app.world().get::<Aabb>(cloth).unwrap();
    let exact = Aabb::enclosing(positions(mesh(&app, cloth))).unwrap();
    assert!((aabb.half_extents - exact.half_extents).max_element() < 1e-5);
}

/// A cube of 8 vertices each of which has three normals, on a tetrahedron that is stretched: an affine motion, of which
/// the vertices and normals are known.
#[test]
fn a_fine_mesh_follows_a_coarse_net() {
    let mut app = app();
    let cube = Mesh::from(Cuboid::from_length(0.5));
    let corners = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
    let weights = |place: Vec3| ([1, 2, 3, 0], place.to_array());
    let binding = positions(&cube).into_iter().map(weights).collect();
    let topology = Topology {
        positions: corners.to_vec(),
        masses: vec![1.0; 4],
        binding: Some(MeshBinding::Skinned(binding)),
        ..Topology::default()
    };
    let (places, facings) = (positions(&cube), normals(&cube));
    let handle = app.world_mut().resource_mut::<Assets<Mesh>>().add(cube);
    let jelly = app.world_mut().spawn((net(topology), NetMesh, Mesh3d(handle))).id();
    let stretch =
        Mat3::from_cols(Vec3::new(1.5, 0.2, 0.0), Vec3::new(-0.3, 0.8, 0.1), Vec3::new(0.0, 0.4, 1.2));
    move_particles(&mut app, jelly, |_, place| stretch * place);
    app.update();
    let mesh = mesh(&app, jelly);
    // Normals turn by the inverse transpose; the flat faces of a cube stay flat, its edges sharp.
    let turn = stretch.inverse().transpose();
    for (vertex, (place, facing)) in places.iter().zip(&facings).enumerate() {
        assert!(positions(mesh)[vertex].distance(stretch * *place) < 1e-6);
        assert!(normals(mesh)[vertex].distance((turn * *facing).normalize()) < 1e-5);
    }
    assert_enclosed(&app, jelly);
}

#[test]
fn in_two_dimensions_it_is_a_mesh_2d() {
    let mut app = app();
    let empty = app.world_mut().spawn((net(sheet([2, 2])), NetMesh, Mesh2d::default())).id();
    app.update();
    assert_eq!(positions(mesh(&app, empty)).len(), 9);
    assert!(!app.world().entity(empty).contains::<Mesh3d>());
    app.insert_resource(Dimensions::Two);
    let flat = app.world_mut().spawn((net(sheet([2, 2])), NetMesh)).id();
    app.update();
    assert!(app.world().entity(flat).contains::<Mesh2d>());
}

/// A wavy mesh of 441 vertices over a flat net of 9 that rolls up: rigid motions of the net are those of its skin.
#[test]
fn a_skin_keeps_its_place_over_a_net() {
    let mut app = app();
    let sheet = sheet([2, 2]);
    let cloth = app.world_mut().spawn(net(sheet)).id();
    let fine = Plane3d::new(Vec3::Z, Vec2::splat(0.1)).mesh().subdivisions(19).build();
    let raise = |place: Vec3| place.with_z(0.02 * ops::sin(40.0 * place.x)) + Vec3::new(0.1, -0.1, 0.0);
    let raised: Vec<Vec3> = positions(&fine).into_iter().map(raise).collect();
    let fine = fine.with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, raised.clone());
    let handle = app.world_mut().resource_mut::<Assets<Mesh>>().add(fine);
    let place = Transform::from_xyz(0.0, 0.3, 0.0);
    let skin = app.world_mut().spawn((NetSkin(cloth), Mesh3d(handle), place)).id();
    let turn = Transform::from_xyz(0.3, 0.2, 0.1).with_rotation(Quat::from_rotation_x(0.8));
    move_particles(&mut app, cloth, |_, place| turn.transform_point(place));
    app.update();
    for (drawn, rest) in positions(mesh(&app, skin)).iter().zip(&raised) {
        let drawn = place.transform_point(*drawn);
        assert!(drawn.distance(turn.transform_point(*rest)) < 1e-6);
    }
    for seed in 0..10 {
        move_particles(&mut app, cloth, crumple(seed));
        app.update();
        assert_enclosed(&app, skin);
    }
}
