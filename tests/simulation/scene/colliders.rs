//! The colliders of scene files: what is read, what becomes of it, what is refused.

use bevy::prelude::*;
use bevy_mass_spring::prelude::*;

/// The example of the contract, to the letter.
const EXAMPLE: &str = "(
    particles: [],
    colliders: [                         // rotation (0, 0, 0, 1) as (x, y, z, w), velocities, restitution and friction 0 are the defaults
        (shape: Sphere(radius: 1.0), position: (0.0, 0.0, 0.0), rotation: (0.0, 0.0, 0.0, 1.0),
         velocity: (0.0, 0.0, 0.0),      // it moves with these, about `position`: m/s, rad/s
         angular_velocity: (0.0, 0.0, 0.0), restitution: 0.0, friction: 0.0),
        (shape: HalfSpace, position: (0.0, 0.0, 0.0)),                    // below local y = 0
        (shape: Cuboid(half_size: (1.0, 1.0, 1.0)), position: (0.0, 0.0, 0.0)),
        (shape: Capsule(radius: 0.1, half_length: 1.0), position: (0.0, 0.0, 0.0)),      // along local y, as Bevy's Capsule3d
        (shape: Cylinder(radius: 0.1, half_height: 1.0), position: (0.0, 0.0, 0.0)),     // along local y
        (shape: Cone(radius: 0.5, height: 1.0), position: (0.0, 0.0, 0.0)),              // along local y, centred as Bevy's Cone
        (shape: ConvexHull(points: [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]), position: (0.0, 0.0, 0.0)),
        (shape: Mesh(vertices: [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)], triangles: [(0, 2, 1)]), position: (0.0, 0.0, 0.0)),
        (shape: HeightField(size: (10.0, 10.0), heights: [[0.0, 0.0], [0.0, 0.5]]), position: (0.0, 0.0, 0.0)), // rows along z, columns along x, centred
    ],
)";

#[test]
fn the_example_of_the_contract_is_read_and_written_back() {
    let scene = MassSpringScene::from_ron(EXAMPLE).unwrap();
    assert_eq!(scene.colliders.len(), 9);
    assert_eq!(scene.colliders[0].shape, ColliderShape::Sphere { radius: 1.0 });
    assert_eq!(scene.colliders[3].rotation, Quat::IDENTITY);
    assert_eq!(MassSpringScene::from_ron(&scene.to_ron()).unwrap(), scene);
}

#[test]
fn colliders_become_entities_that_move_by_themselves() {
    let text = "(particles: [], colliders: [
        (shape: Cone(radius: 0.5, height: 1.0), position: (1, 2, 3), rotation: (0, 0, 2, 0), restitution: 0.25,
         friction: 0.5, velocity: (0, 1, 0), angular_velocity: (0, 0, 3)),
        (shape: HalfSpace, position: (0, 0, 0)),
    ])";
    let scene = MassSpringScene::from_ron(text).unwrap();
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, MassSpringPlugin::default()));
    let spawned = scene.spawn(&mut app.world_mut().commands());
    app.world_mut().flush();
    let world = app.world();
    let cone = world.get::<ParticleCollider>(spawned.colliders[0]).unwrap();
    let expected = ColliderShape::Cone { radius: 0.5, height: 1.0 };
    assert_eq!((&cone.shape, cone.restitution, cone.friction), (&expected, 0.25, 0.5));
    let place = world.get::<Transform>(spawned.colliders[0]).unwrap();
    assert_eq!(
        (place.translation, place.rotation),
        (Vec3::new(1.0, 2.0, 3.0), Quat::from_xyzw(0.0, 0.0, 1.0, 0.0))
    );
    let motion = world.get::<ColliderMotion>(spawned.colliders[0]).unwrap();
    assert_eq!((motion.velocity, motion.angular_velocity), (Vec3::Y, Vec3::Z * 3.0));
    assert!(world.get::<ColliderMotion>(spawned.colliders[1]).is_none());
    assert!(spawned.iter().any(|entity| entity == spawned.colliders[1]));
}

#[test]
fn bad_colliders_are_refused_with_index_and_field() {
    let cases = [
        ("(shape: Sphere(radius: §0), position: (0, 0, 0))", "colliders[1].shape.radius is 0.0"),
        ("(shape: Sphere(radius: 1), position: §(0, NaN, 0))", "colliders[1].position is [0.0, NaN, 0.0]"),
        ("(shape: Sphere(radius: 1), position: (0, 0, 0), friction: §-1)", "colliders[1].friction is -1.0"),
        (
            "(shape: Sphere(radius: 1), position: (0, 0, 0), restitution: §2)",
            "colliders[1].restitution is 2.0",
        ),
        (
            "(shape: Sphere(radius: 1), position: (0, 0, 0), rotation: §(0, 0, 0, 0))",
            "colliders[1].rotation is",
        ),
        (
            "(shape: Sphere(radius: 1), position: (0, 0, 0), velocity: §(inf, 0, 0))",
            "colliders[1].velocity is",
        ),
        ("(shape: Cuboid(half_size: §(1, 0, 1)), position: (0, 0, 0))", "colliders[1].shape.half_size is"),
        (
            "(shape: Capsule(radius: 1, half_length: §-1), position: (0, 0, 0))",
            "colliders[1].shape.half_length is -1.0",
        ),
        (
            "(shape: Cylinder(radius: 1, half_height: §NaN), position: (0, 0, 0))",
            "colliders[1].shape.half_height is NaN",
        ),
        ("(shape: Cone(radius: 1, height: §0), position: (0, 0, 0))", "colliders[1].shape.height is 0.0"),
        (
            "(shape: ConvexHull(points: §[(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)]), position: (0, 0, 0))",
            "colliders[1].shape.points is",
        ),
        (
            "(shape: Mesh(vertices: [(0, 0, 0), (1, 0, 0), (0, 0, 1)], triangles: §[(0, 2, 3)]), position: (0, 0, 0))",
            "colliders[1].shape.triangles is",
        ),
        (
            "(shape: Mesh(vertices: [(0, 0, 0), (1, 0, 0), (2, 0, 0)], triangles: §[(0, 2, 1)]), position: (0, 0, 0))",
            "colliders[1].shape.triangles is",
        ),
        (
            "(shape: HeightField(size: §(0, 1), heights: [[0, 0], [0, 0]]), position: (0, 0, 0))",
            "colliders[1].shape.size is",
        ),
        (
            "(shape: HeightField(size: (1, 1), heights: §[[0, 0], [0]]), position: (0, 0, 0))",
            "colliders[1].shape.heights is",
        ),
    ];
    for (collider, expected) in cases {
        let text = format!(
            "(particles: [], colliders: [\n(shape: HalfSpace, position: (0, 0, 0)),\n{collider},\n])"
        );
        let column = text.lines().nth(2).unwrap().chars().position(|letter| letter == '§').unwrap() + 1;
        let error = MassSpringScene::from_ron(&text.replace('§', "")).expect_err(collider);
        assert!(error.to_string().contains(expected), "{collider}: {error}");
        let position = error.position.expect("its place is known");
        assert_eq!((position.line, position.column), (3, column), "{collider}: {error}");
    }
    let unknown = "(particles: [], colliders: [(shape: Torus(radius: 1), position: (0, 0, 0))])";
    assert!(MassSpringScene::from_ron(unknown).is_err());
    let missing = "(particles: [], colliders: [(shape: HalfSpace)])";
    assert!(MassSpringScene::from_ron(missing).is_err(), "a position is required");
}
