//! Colliders from Bevy's meshes, in an app.

use std::time::Duration;

use bevy::asset::RenderAssetUsages;
use bevy::mesh::PrimitiveTopology;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_mass_spring::nets::NetError;
use bevy_mass_spring::prelude::*;

/// Where a ball of 0.1 m is, that starts at rest and falls for 2 s.
fn fallen(shape: ColliderShape, start: Vec3) -> Vec3 {
    let mut app = App::new();
    let tick = Duration::from_secs_f64(1.0 / 64.0);
    app.add_plugins((MinimalPlugins, MassSpringPlugin::default()))
        .insert_resource(TimeUpdateStrategy::ManualDuration(tick))
        .insert_resource(Time::<Fixed>::from_duration(tick));
    app.finish();
    app.cleanup();
    app.world_mut().spawn(ParticleCollider::new(shape));
    let ball = app.world_mut().spawn((Particle::new(1.0, 0.1), Transform::from_translation(start))).id();
    for _ in 0..129 {
        app.update();
    }
    app.world().get::<Transform>(ball).unwrap().translation
}

/// A square of 4 m about the origin, which faces up.
fn floor() -> Mesh {
    Plane3d::default().mesh().size(4.0, 4.0).subdivisions(3).build()
}

#[track_caller]
fn assert_at(found: Vec3, expected: Vec3) {
    // The ball comes to rest within the overlap that a tick of gravity makes, g / 64², at most.
    assert!(found.distance(expected) < 9.81 / 4096.0, "{found}, expected {expected}");
}

#[test]
fn closed_meshes_are_solids() {
    let cube = ColliderShape::mesh(&Mesh::from(Cuboid::new(2.0, 1.0, 2.0))).unwrap();
    assert_at(fallen(cube.clone(), Vec3::new(0.3, 1.0, 0.2)), Vec3::new(0.3, 0.6, 0.2));
    assert_at(fallen(cube, Vec3::new(0.3, 0.3, 0.2)), Vec3::new(0.3, 0.6, 0.2));
}

/// Half in front of a sheet a ball is held by either; just behind it, a sheet holds it there, and lets it fall.
#[test]
fn one_sided_meshes_are_solid_behind() {
    let sheet = ColliderShape::mesh(&floor()).unwrap();
    let ground = ColliderShape::one_sided_mesh(&floor()).unwrap();
    let [above, behind] = [0.5, -0.05].map(|y| Vec3::new(0.3, y, 0.2));
    let resting = Vec3::new(0.3, 0.1, 0.2);
    assert_at(fallen(sheet.clone(), above), resting);
    assert_at(fallen(ground.clone(), above), resting);
    assert_at(fallen(ground, behind), resting);
    assert!(fallen(sheet, behind).y < -9.0, "it falls for 2 s below a sheet");
}

/// Through the hole of a ring a ball falls, on its hull it lies.
#[cfg(feature = "parry")]
#[test]
fn the_hull_of_a_ring_has_no_hole() {
    let ring = Mesh::from(Torus::new(0.5, 1.5));
    let start = Vec3::new(0.0, 1.0, 0.0);
    assert!(fallen(ColliderShape::mesh(&ring).unwrap(), start).y < -9.0);
    assert_at(fallen(ColliderShape::convex_hull(&ring).unwrap(), start), Vec3::Y * 0.6);
}

#[test]
fn bad_meshes_are_refused_by_name() {
    let refused = |found: Result<ColliderShape, NetError>| found.expect_err("refused").to_string();
    let lines = Mesh::new(PrimitiveTopology::LineList, RenderAssetUsages::default());
    for found in [ColliderShape::mesh(&lines), ColliderShape::one_sided_mesh(&lines)] {
        assert_eq!(refused(found), "the mesh cannot be read: it is not a list of triangles");
    }
    assert_eq!(refused(ColliderShape::convex_hull(&lines)), "the mesh cannot be read: it has no positions");
    let cube = Mesh::from(Cuboid::default());
    let inside_out = cube.clone().with_inverted_winding().unwrap();
    assert!(refused(ColliderShape::mesh(&inside_out)).contains("inside out"));
    let triangle = |corners: [[f32; 3]; 3]| {
        Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, corners.to_vec())
    };
    let thin = triangle([[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]);
    assert!(refused(ColliderShape::mesh(&thin)).contains("no triangle has an area"));
    let broken = triangle([[0.0; 3], [1.0, 0.0, 0.0], [0.0, f32::NAN, 0.0]]);
    assert_eq!(refused(ColliderShape::mesh(&broken)), "vertex 2 of the mesh is not finite");
    // Two triangles of a sheet that face different sides.
    let mut torn = floor();
    torn.merge(&floor().with_inverted_winding().unwrap().translated_by(Vec3::X * 4.0)).unwrap();
    assert!(refused(ColliderShape::one_sided_mesh(&torn)).contains("do not all face the same side"));
    assert!(ColliderShape::mesh(&torn).is_ok());
    if cfg!(feature = "parry") {
        assert!(refused(ColliderShape::convex_hull(&floor())).contains("all are in one plane"));
        assert!(ColliderShape::convex_hull(&inside_out).is_ok(), "only points count");
    } else {
        assert!(refused(ColliderShape::convex_hull(&cube)).contains("feature `parry`"));
    }
}
