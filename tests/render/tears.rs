//! Meshes of nets that tear.

use std::sync::Arc;

use bevy::mesh::VertexAttributeValues;
use bevy::prelude::*;
use bevy_mass_spring::nets::Topology;
use bevy_mass_spring::prelude::*;

use crate::scene::{
    app, assert_enclosed, crumple, mesh, move_particles, net, normals, positions, rope, sheet, triangles,
};

/// Lets the triangles right of column 2 go from the particles of that column, down to a row.
fn torn(topology: &Topology, rows: u32) -> Topology {
    let mut torn = topology.clone();
    for row in 0..rows {
        let old = row * 5 + 2;
        let new = torn.positions.len() as u32;
        torn.positions.push(torn.positions[old as usize]);
        torn.masses.push(0.005);
        for triangle in &mut torn.triangles {
            if triangle.iter().any(|corner| *corner < 20 && corner % 5 > 2) {
                *triangle = triangle.map(|corner| if corner == old { new } else { corner });
            }
        }
    }
    torn
}

fn tear(app: &mut App, cloth: Entity, topology: Topology) {
    let mut torn = net(topology);
    let old = app.world().get::<ParticleNet>(cloth).unwrap().positions().to_vec();
    torn.positions_mut()[..old.len()].copy_from_slice(&old);
    app.world_mut().entity_mut(cloth).insert(torn);
}

#[test]
fn a_mesh_opens_where_its_net_tears() {
    let mut app = app();
    let whole = sheet([4, 3]);
    let cloth = app.world_mut().spawn((net(whole.clone()), NetMesh)).id();
    app.update();
    let handle = app.world().get::<Mesh3d>(cloth).unwrap().clone();
    for rows in [1, 3] {
        let topology = torn(&whole, rows);
        tear(&mut app, cloth, topology.clone());
        move_particles(&mut app, cloth, crumple(rows));
        app.update();
        assert_eq!(app.world().get::<Mesh3d>(cloth), Some(&handle), "the mesh tears in place");
        let mesh = mesh(&app, cloth);
        let (positions, net) = (positions(mesh), app.world().get::<ParticleNet>(cloth).unwrap());
        // Each triangle is drawn where its particles are: there is no hole, and none bridges the tear.
        assert_eq!(triangles(mesh).len(), topology.triangles.len());
        for (drawn, particles) in triangles(mesh).iter().zip(&topology.triangles) {
            for (vertex, particle) in drawn.iter().zip(particles) {
                assert_eq!(positions[*vertex], net.positions()[*particle as usize]);
            }
        }
        // Both sides of the tear have the texture of before.
        let Some(VertexAttributeValues::Float32x2(uvs)) = mesh.attribute(Mesh::ATTRIBUTE_UV_0) else {
            panic!()
        };
        assert_eq!(uvs.len(), 20 + rows as usize);
        for row in 0..rows as usize {
            assert_eq!(uvs[20 + row], uvs[5 * row + 2]);
        }
        for normal in normals(mesh) {
            assert!((normal.length() - 1.0).abs() < 1e-6);
        }
        assert_enclosed(&app, cloth);
    }
}

#[test]
fn a_net_that_is_replaced_gets_another_mesh() {
    let mut app = app();
    let cloth = app.world_mut().spawn((net(sheet([4, 3])), NetMesh)).id();
    app.update();
    app.world_mut().entity_mut(cloth).insert(net(sheet([2, 2])));
    app.update();
    assert_eq!(positions(mesh(&app, cloth)).len(), 9);
    assert_enclosed(&app, cloth);
}

#[test]
fn a_rope_that_tears_is_drawn_in_two_pieces() {
    let mut app = app();
    let whole = rope(6);
    let tube = RopeMesh { rings: 1, cap_rings: 1, sides: 4, ..default() };
    let entity = app.world_mut().spawn((net(whole.clone()), tube)).id();
    app.update();
    let rings = |app: &App| positions(mesh(app, entity)).len() / 5;
    assert_eq!(rings(&app), 7 + 2);
    let mut torn = whole;
    torn.springs.remove(2);
    app.world_mut().entity_mut(entity).insert(ParticleNet::new(Arc::new(torn), &Transform::IDENTITY));
    app.update();
    assert_eq!(rings(&app), 7 + 4);
    // None of the triangles reaches across the gap between particles 2 and 3.
    let places = positions(mesh(&app, entity));
    for triangle in triangles(mesh(&app, entity)) {
        let sides = triangle.map(|corner| places[corner].x < 0.25);
        assert!(sides == [true; 3] || sides == [false; 3]);
    }
}
