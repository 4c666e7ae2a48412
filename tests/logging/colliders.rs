//! The warnings about bad colliders, each left out by itself until it is corrected.

use bevy::prelude::*;
use bevy_mass_spring::prelude::*;

use crate::common::logged::Logged;
use crate::common::*;
use crate::warnings::{assert_names, undisturbed, unrelated_chain};

/// A bad collider, and what the warning says.
type Case = (ParticleCollider, Transform, &'static [&'static str]);

fn mesh(vertices: &[Vec3], triangles: &[[u32; 3]]) -> ColliderShape {
    let vertices = vertices.iter().copied().collect();
    ColliderShape::Mesh { vertices, triangles: triangles.iter().copied().collect(), one_sided: false }
}

/// The corners of a tetrahedron and a fifth point, in line with two of them.
const CORNERS: [Vec3; 5] = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z, Vec3::new(2.0, 0.0, 0.0)];

/// Counterclockwise seen from inside.
const INSIDE_OUT: [[u32; 3]; 4] = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]];

fn bad_shapes() -> Vec<(ColliderShape, &'static [&'static str])> {
    let heights = |heights: Vec<Vec<f32>>| ColliderShape::HeightField {
        size: Vec2::splat(2.0),
        heights: heights.into(),
    };
    let part = |shape: ColliderShape| ColliderPart { shape, ..default() };
    let compound = |parts: Vec<ColliderPart>| ColliderShape::Compound { parts: parts.into() };
    let sphere = || part(Sphere::new(1.0).into());
    let misplaced = ColliderPart { position: Vec3::NAN, ..sphere() };
    let unturned = ColliderPart { rotation: Quat::from_xyzw(0.0, 0.0, 0.0, 0.0), ..sphere() };
    let turned = mesh(&CORNERS, &[[0, 1, 2], [0, 1, 3]]).one_sided();
    vec![
        (Sphere { radius: 0.0 }.into(), &["radius is 0"]),
        (Sphere { radius: f32::NAN }.into(), &["radius is NaN"]),
        (Capsule3d { radius: 1.0, half_length: -1.0 }.into(), &["half_length is -1"]),
        (Cuboid { half_size: Vec3::new(1.0, 0.0, 1.0) }.into(), &["half_size", "> 0"]),
        (Cuboid { half_size: Vec3::new(1.0, f32::NAN, 1.0) }.into(), &["half_size", "NaN"]),
        (Cylinder { radius: 1.0, half_height: f32::INFINITY }.into(), &["half_height is inf"]),
        (Cone { radius: 1.0, height: 0.0 }.into(), &["height is 0"]),
        (ConicalFrustum { radius_top: 0.0, radius_bottom: 0.0, height: 1.0 }.into(), &["radius_bottom is 0"]),
        #[cfg(feature = "parry")]
        (ColliderShape::ConvexHull { points: CORNERS[..3].to_vec().into() }, &["points", "one plane"]),
        #[cfg(feature = "parry")]
        (
            ColliderShape::ConvexHull { points: vec![Vec3::ZERO, Vec3::NAN].into() },
            &["points", "point 1 is not"],
        ),
        (mesh(&CORNERS, &INSIDE_OUT), &["triangles", "inside out"]),
        (mesh(&CORNERS, &[[0, 1, 4]]), &["triangles", "no triangle has an area"]),
        (mesh(&CORNERS, &[[0, 1, 9]]), &["triangles", "the corner 9"]),
        (mesh(&CORNERS, &[[0, 1, 1]]), &["triangles", "same corner twice"]),
        (mesh(&[Vec3::X, Vec3::NAN], &[]), &["vertices", "vertex 1"]),
        (turned, &["triangles", "face the same side"]),
        (Rhombus::new(1.0, 0.0).into(), &["triangles", "no triangle has an area"]),
        (heights(vec![vec![0.0, 1.0]]), &["heights", "1 rows"]),
        (heights(vec![vec![0.0, 1.0], vec![0.0, f32::NAN]]), &["heights", "NaN"]),
        (compound(vec![]), &["parts is empty"]),
        (compound(vec![part(compound(vec![sphere()]))]), &["parts is a compound"]),
        (compound(vec![sphere(), misplaced]), &["position", "NaN"]),
        (compound(vec![unturned]), &["rotation"]),
        (compound(vec![part(Sphere { radius: -1.0 }.into())]), &["radius is -1"]),
    ]
}

fn bad_scales() -> Vec<(ColliderShape, Vec3, &'static [&'static str])> {
    let wide = Vec3::new(2.0, 1.0, 1.0);
    let parts = vec![ColliderPart { shape: Sphere::new(1.0).into(), ..default() }];
    let compound = ColliderShape::Compound { parts: parts.into() };
    vec![
        (Sphere::new(1.0).into(), wide, &["scale", "of a sphere"]),
        (Capsule3d::new(1.0, 1.0).into(), wide, &["scale", "of a capsule"]),
        (Cylinder::new(1.0, 1.0).into(), wide, &["scale", "axis of a cylinder"]),
        (Cone::new(1.0, 1.0).into(), wide, &["scale", "axis of a cone"]),
        (ConicalFrustum::default().into(), wide, &["scale", "axis of a frustum"]),
        (compound.clone(), wide, &["scale", "of a compound"]),
        (compound, Vec3::splat(-1.0), &["scale", "of a compound"]),
        (Cuboid::new(1.0, 1.0, 1.0).into(), Vec3::new(1.0, 0.0, 1.0), &["scale is 0"]),
        (Cuboid::new(1.0, 1.0, 1.0).into(), Vec3::new(1.0, f32::NAN, 1.0), &["transform", "finite"]),
    ]
}

fn cases() -> Vec<Case> {
    let of_shape = |(shape, words)| (ParticleCollider::new(shape), Transform::default(), words);
    let of_scale =
        |(shape, scale, words)| (ParticleCollider::new(shape), Transform::from_scale(scale), words);
    let ball = || ParticleCollider::from(Sphere::new(1.0));
    let at_nan = Transform::from_xyz(0.0, f32::NAN, 0.0);
    let mut cases: Vec<Case> = bad_shapes().into_iter().map(of_shape).collect();
    cases.extend(bad_scales().into_iter().map(of_scale));
    cases.push((ball(), at_nan, &["transform is not finite"]));
    cases.push((ball().with_restitution(-0.5), default(), &["restitution is -0.5"]));
    cases.push((ball().with_friction(f32::NAN), default(), &["friction is NaN"]));
    cases.push((ball().with_surface_velocity(Vec3::NAN), default(), &["surface_velocity"]));
    cases
}

#[test]
fn a_bad_collider_is_named_once_holds_nothing_and_works_when_corrected() {
    let logged = Logged::start();
    let expected = undisturbed(10);
    for (collider, place, words) in cases() {
        let mut app = app();
        app.init_resource::<InvalidColliders>();
        let chain = unrelated_chain(&mut app);
        let ball = spawn(&mut app, 1.0, 0.1, Vec3::Y * 0.5);
        let bad = app.world_mut().spawn((collider, place)).id();
        run(&mut app, 5);
        assert_names(&logged.take_one(), bad, &[&["collider"], words].concat());
        assert_eq!(app.world().resource::<InvalidColliders>().all, [bad], "{words:?}");
        // It falls as if there were nothing: 5 ticks of g, as no scheme changes by more than a rounding.
        let fallen = velocity(&app, ball).y;
        assert!((fallen + 9.81 * 5.0 * TICK).abs() < 1e-6, "{words:?}: {fallen} m/s");
        app.world_mut()
            .entity_mut(bad)
            .insert((ParticleCollider::from(Sphere::new(1.0)), Transform::default()));
        run(&mut app, 5);
        logged.assert_silent();
        assert!(app.world().resource::<InvalidColliders>().all.is_empty(), "{words:?}");
        assert!(position(&app, ball).y > 1.1 - 1e-3, "{words:?}: the ball is pushed out of the sphere");
        assert_eq!(hash(&app, &chain), expected, "{words:?}");
    }
}

/// Three turns and scales of a parent, of which only one shears.
#[test]
fn a_sheared_collider_is_named_once() {
    let logged = Logged::start();
    let mut app = app();
    let wide = Transform::from_scale(Vec3::new(2.0, 1.0, 1.0));
    let parent = app.world_mut().spawn(wide).id();
    let turned = |angle: f32| Transform::from_rotation(Quat::from_rotation_z(angle));
    let cuboid = || ParticleCollider::from(Cuboid::new(1.0, 1.0, 1.0));
    let straight = turned(std::f32::consts::FRAC_PI_2);
    app.world_mut().spawn((cuboid(), straight, ChildOf(parent)));
    run(&mut app, 3);
    logged.assert_silent();
    let sheared = app.world_mut().spawn((cuboid(), turned(0.5), ChildOf(parent))).id();
    run(&mut app, 3);
    assert_names(&logged.take_one(), sheared, &["collider", "sheared"]);
    app.world_mut().get_mut::<Transform>(parent).unwrap().scale = Vec3::splat(2.0);
    run(&mut app, 3);
    logged.assert_silent();
}
