//! Tubes and ribbons around ropes.

use std::collections::BTreeMap;
use std::f32::consts::TAU;

use bevy::math::ops;
use bevy::mesh::VertexAttributeValues;
use bevy::prelude::*;
use bevy_mass_spring::nets::{Layout, Topology};
use bevy_mass_spring::prelude::*;
use bevy_mass_spring::render::RopeLink;
use bevy_mass_spring::solver;

use crate::scene::{
    app, assert_enclosed, crumple, mesh, move_particles, net, normals, positions, rope, triangles, vectors,
};

/// The vertices of a mesh by place: those in the same place, to the bit, are one.
fn welded(places: &[Vec3]) -> Vec<usize> {
    let mut known: BTreeMap<[u32; 3], usize> = BTreeMap::new();
    let number = |place: &Vec3| {
        let count = known.len();
        *known.entry(place.to_array().map(|value| (value + 0.0).to_bits())).or_insert(count)
    };
    places.iter().map(number).collect()
}

/// Asserts that each edge has one triangle on each side, and that the surface faces outward.
fn assert_closed(mesh: &Mesh) -> f32 {
    let places = positions(mesh);
    let points = welded(&places);
    let mut edges: BTreeMap<(usize, usize), i32> = BTreeMap::new();
    let mut volume = 0.0;
    for triangle in triangles(mesh) {
        let [a, b, c] = triangle.map(|corner| points[corner]);
        assert!(a != b && b != c && c != a, "{triangle:?} has no area");
        for (from, to) in [(a, b), (b, c), (c, a)] {
            *edges.entry((from, to)).or_insert(0) += 1;
        }
        let [a, b, c] = triangle.map(|corner| places[corner]);
        volume += a.dot(b.cross(c)) / 6.0;
        let facing = (b - a).cross(c - a);
        for corner in triangle {
            assert!(facing.dot(normals(mesh)[corner]) > 0.0, "a triangle faces against its normals");
        }
    }
    for ((from, to), count) in &edges {
        assert_eq!((*count, edges.get(&(*to, *from))), (1, Some(&1)), "the edge {from} {to}");
    }
    volume
}

/// A straight tube of 12 sides and two half balls: its volume is that of the prism and of the stacks of its caps.
#[test]
fn a_straight_rope_is_a_closed_capsule() {
    let mut app = app();
    let entity = app.world_mut().spawn((net(rope(4)), RopeMesh::default().with_sides(12))).id();
    app.update();
    let volume = assert_closed(mesh(&app, entity));
    // Of a circle's area the polygon has sin(2π/n) / (2π/n).
    let (radius, sides) = (0.02_f32, 12.0);
    let polygon = 0.5 * sides * ops::sin(TAU / sides);
    let prism = polygon * radius * radius * 0.4;
    // The frustum between two rings of the cap: h (R² + R r + r²) / 3.
    let ring = |number: f32| {
        let (sin, cos) = ops::sin_cos(TAU / 4.0 * number / 3.0);
        (radius * sin, radius * cos)
    };
    let cap: f32 = [0.0, 1.0, 2.0]
        .into_iter()
        .map(|number| {
            let ((low, wide), (high, narrow)) = (ring(number), ring(number + 1.0));
            polygon * (high - low) * (wide * wide + wide * narrow + narrow * narrow) / 3.0
        })
        .sum();
    let expected = prism + 2.0 * cap;
    assert!((volume / expected - 1.0).abs() < 1e-4, "{volume} {expected}");
}

#[test]
fn a_bent_rope_is_closed_and_enclosed() {
    let mut app = app();
    for rings in [1, 3] {
        let tube = RopeMesh::default().with_rings(rings).with_radius(0.005);
        let entity = app.world_mut().spawn((net(rope(20)), tube)).id();
        for seed in 0..10 {
            move_particles(&mut app, entity, crumple(seed));
            app.update();
            assert_closed(mesh(&app, entity));
            assert_enclosed(&app, entity);
        }
    }
}

/// Each cross-section is a circle about its particle, across the rope.
#[test]
fn cross_sections_are_circles_about_the_particles() {
    let mut app = app();
    let tube = RopeMesh { rings: 1, cap_rings: 0, ..default() };
    let entity = app.world_mut().spawn((net(rope(10)), tube)).id();
    move_particles(&mut app, entity, crumple(5));
    app.update();
    let particles = app.world().get::<ParticleNet>(entity).unwrap().positions().to_vec();
    let mesh = mesh(&app, entity);
    let (places, facings) = (positions(mesh), normals(mesh));
    let tangents = vectors(mesh, Mesh::ATTRIBUTE_TANGENT);
    for (vertex, place) in places.iter().enumerate() {
        let out = *place - particles[vertex / 9];
        assert!((out.length() / 0.02 - 1.0).abs() < 1e-4);
        assert!(facings[vertex].distance(out / 0.02) < 1e-4);
        assert!(tangents[vertex].dot(facings[vertex]).abs() < 1e-5);
    }
    // v is the rest length over the circumference, whatever the rope does.
    let Some(VertexAttributeValues::Float32x2(uvs)) = mesh.attribute(Mesh::ATTRIBUTE_UV_0) else { panic!() };
    for (vertex, [u, v]) in uvs.iter().enumerate() {
        assert_eq!(*u, (vertex % 9) as f32 / 8.0);
        let expected = 0.1 * (vertex / 9) as f32 / (TAU * 0.02);
        assert!((v - expected).abs() < 1e-5 * expected.max(1.0));
    }
}

/// In a plane a frame without twist does not turn about the rope: on a circle a corner of the section keeps its distance
/// from the plane.
#[test]
fn the_texture_does_not_twist() {
    let mut app = app();
    let tube = RopeMesh { rings: 1, cap_rings: 0, sides: 8, ..default() };
    let entity = app.world_mut().spawn((net(rope(40)), tube)).id();
    move_particles(&mut app, entity, |_, place| {
        let (sin, cos) = ops::sin_cos(1.5 * place.x);
        Vec3::new(sin, cos, 0.0)
    });
    app.update();
    let places = positions(mesh(&app, entity));
    for (vertex, place) in places.iter().enumerate() {
        // 40 steps, each of which rounds a few times.
        assert!((place.z - places[vertex % 9].z).abs() < 40.0 * 4.0 * f32::EPSILON * 0.02 + 1e-7, "{vertex}");
    }
}

/// A loop out of the plane, around which a frame without twist does not come back to itself.
#[test]
fn a_loop_is_closed_without_a_seam() {
    let mut app = app();
    let count = 30_u32;
    let spring = solver::Spring { rest_length: 0.1, ..default() };
    let place = |number: u32| {
        let angle = TAU * number as f32 / count as f32;
        let (sin, cos) = ops::sin_cos(angle);
        Vec3::new(0.5 * cos, 0.5 * sin, 0.2 * ops::sin(2.0 * angle + 0.5))
    };
    let ring = Topology {
        positions: (0..count).map(place).collect(),
        masses: vec![1.0; count as usize],
        radius: 0.03,
        springs: (0..count).map(|number| ([number, (number + 1) % count], spring)).collect(),
        layout: Layout::Rope { is_closed: true },
        ..default()
    };
    let entity = app.world_mut().spawn((net(ring), RopeMesh::default())).id();
    app.update();
    let volume = assert_closed(mesh(&app, entity));
    assert!(volume > 0.0);
    assert_enclosed(&app, entity);
}

#[test]
fn a_ribbon_faces_where_it_is_told_to() {
    let mut app = app();
    let ribbon = RopeRibbon { width: Some(0.1), facing: Some(Vec3::Z), rings: 1, ..default() };
    let place = Transform::from_xyz(0.2, 0.0, 0.0).with_rotation(Quat::from_rotation_z(0.8));
    let entity = app.world_mut().spawn((net(rope(10)), ribbon, place)).id();
    move_particles(&mut app, entity, |number, place| place.with_y(0.02 * (number % 3) as f32));
    app.update();
    let mesh = mesh(&app, entity);
    for normal in normals(mesh) {
        assert!(normal.distance(Vec3::Z) < 1e-6);
    }
    for sides in positions(mesh).as_chunks::<2>().0 {
        assert!((sides[0].distance(sides[1]) - 0.1).abs() < 1e-6);
    }
    assert_enclosed(&app, entity);
}

#[test]
fn what_cannot_be_drawn_is_not() {
    let mut app = app();
    let entity = app.world_mut().spawn((net(rope(3)), RopeMesh::default().with_radius(f32::NAN))).id();
    app.update();
    assert!(!app.world().entity(entity).contains::<Mesh3d>());
    app.world_mut().get_mut::<RopeMesh>(entity).unwrap().radius = Some(0.1);
    app.update();
    assert!(app.world().entity(entity).contains::<Mesh3d>());
    assert_enclosed(&app, entity);
}

#[test]
fn links_are_copies_that_lie_along_the_rope() {
    let mut app = app();
    let look = (Mesh3d::default(), Visibility::Hidden, children![Name::new("part")]);
    let template = (Transform::from_scale(Vec3::splat(2.0)), look);
    let template = app.world_mut().spawn(template).id();
    let place = Transform::from_xyz(0.0, 1.0, 0.0).with_rotation(Quat::from_rotation_z(1.0));
    let whole = rope(6);
    let entity = app.world_mut().spawn((net(whole.clone()), RopeLinks::new(template), place)).id();
    move_particles(&mut app, entity, crumple(4));
    app.update();
    let links = |app: &mut App| -> Vec<(Entity, RopeLink, GlobalTransform)> {
        let mut query = app.world_mut().query::<(Entity, &RopeLink, &GlobalTransform)>();
        query.iter(app.world()).map(|(entity, link, place)| (entity, *link, *place)).collect()
    };
    let before = links(&mut app);
    assert_eq!(before.len(), 6);
    let particles = app.world().get::<ParticleNet>(entity).unwrap().positions().to_vec();
    for (link, RopeLink { particles: ends }, place) in &before {
        let [from, to] = ends.map(|end| particles[end as usize]);
        assert!(place.translation().distance(0.5 * (from + to)) < 1e-6);
        assert!((place.rotation() * Vec3::Y).distance((to - from).normalize()) < 1e-5);
        assert!(place.scale().distance(Vec3::splat(2.0)) < 1e-5);
        let link = app.world().entity(*link);
        assert!(link.contains::<Mesh3d>());
        assert_eq!(link.get::<Visibility>(), Some(&Visibility::Inherited));
        let part = link.get::<Children>().unwrap()[0];
        assert_eq!(app.world().get::<ChildOf>(part), Some(&ChildOf(link.id())));
        assert_eq!(app.world().get::<Name>(part), Some(&Name::new("part")));
    }
    let mut torn = whole;
    torn.springs.remove(2);
    app.world_mut().entity_mut(entity).insert(net(torn));
    app.update();
    let after = links(&mut app);
    assert_eq!(after.len(), 5);
    for (link, ends, _) in &after {
        assert!(before.iter().any(|(old, was, _)| old == link && was == ends), "links that hold are kept");
    }
    app.world_mut().entity_mut(entity).remove::<RopeLinks>();
    app.update();
    assert_eq!(links(&mut app).len(), 0);
}
