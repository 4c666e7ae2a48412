//! Colliders of every shape: single impacts, slopes, shots, motion; in the pure solver, under every scheme.

use std::f32::consts::FRAC_PI_2;

use bevy::math::{Quat, Vec3};
use bevy_mass_spring::solver::{
    Collider, CombineRule, ContactPartner, Integrator, Layers, Material, Pose, Shape, Skin, Solver,
    StepSettings,
};

use crate::common::bodies::{
    Ball, GRAVITY, falling, floating, position, solver_bits, step_past_contact, velocity, world,
};

/// The tetrahedron of these half extents, closed.
fn tetrahedron(size: f32) -> Shape {
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
fn shapes() -> Vec<(&'static str, Shape, f32)> {
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

fn run(state: &mut Solver, settings: &StepSettings, ticks: std::ops::Range<u32>) {
    for _ in ticks {
        state.step(settings);
    }
}

fn resting(shape: Shape, point: Vec3) -> Collider {
    Collider::resting(shape, Pose { point, rotation: Quat::IDENTITY })
}

fn with(collider: Collider, restitution: f32, friction: f32) -> Collider {
    Collider { material: Material { restitution, friction, ..Material::default() }, ..collider }
}

/// v' = −ε v along the normal of the place that it falls on, at no acceleration: what the formula says, to roundings.
#[test]
fn a_ball_rebounds_from_every_shape_as_from_a_plane() {
    for scheme in Integrator::named() {
        for (name, shape, top) in shapes() {
            for restitution in [0.0, 0.5, 1.0] {
                let start = Ball { velocity: Vec3::NEG_Y * 3.0, ..Ball::at(Vec3::Y * (top + 0.25)) };
                let mut state = world([start]);
                state.add_collider(with(resting(shape.clone(), Vec3::ZERO), restitution, 0.0));
                step_past_contact(&mut state, &floating(scheme, 0.0), 60);
                let expected = Vec3::Y * (3.0 * restitution);
                let found = velocity(&state, 0);
                let case = format!("{scheme:?}, {name}, ε = {restitution}");
                // The facets next to the pole of the mesh are as good as level: 1 − cos of their tilt, and its sine.
                let tilt = if name == "mesh" { 0.12 * 3.0 * (1.0 + restitution) } else { 0.0 };
                assert!((found - expected).length() < 2e-5 + tilt, "{case}: {found}");
                let record = state.outputs().contacts[0];
                assert_eq!(record.other, ContactPartner::Collider(0), "{case}");
                assert!(
                    (record.impulse - 3.0 * (1.0 + restitution)).abs() < 1e-3 + tilt,
                    "{case}: {record:?}"
                );
                assert!(position(&state, 0).y - 0.1 >= top - 1e-6 - 0.01 * tilt, "{case}");
            }
        }
    }
}

/// The closed form of a fall: it rests where it should, and neither sinks nor creeps.
#[test]
fn a_ball_comes_to_rest_on_every_flat_shape() {
    for scheme in Integrator::named() {
        for (name, shape, top) in shapes() {
            if ["ball", "capsule", "mesh"].contains(&name) {
                continue;
            }
            let point = Vec3::new(0.3, -7.7, 0.2);
            let mut state = world([Ball::at(point + Vec3::new(0.05, top + 0.1, 0.02))]);
            state.add_collider(with(resting(shape, point), 0.0, 0.5));
            let start = position(&state, 0);
            for tick in 0..300 {
                state.step(&falling(scheme, 4));
                let case = format!("{scheme:?}, {name}, tick {tick}");
                assert!(velocity(&state, 0).length() < 1e-6, "{case}: {}", velocity(&state, 0));
                assert!(position(&state, 0).distance(start) < 4e-6, "{case}: {}", position(&state, 0));
            }
        }
    }
}

/// Holds below tan θ = μ; above it slides with a = g (sin θ − μ cos θ).
#[test]
fn a_ball_on_the_side_of_a_box_holds_or_slides() {
    for scheme in Integrator::named() {
        for slope in [0.2_f32, 0.5] {
            let turn = Quat::from_rotation_z(-bevy::math::ops::atan(slope));
            let box_at = |friction| {
                let pose = Pose { point: turn * Vec3::NEG_Y, rotation: turn };
                with(Collider::resting(Shape::cuboid(Vec3::new(50.0, 1.0, 5.0)), pose), 0.0, friction)
            };
            let mut state = world([Ball::at(turn * Vec3::Y * 0.1)]);
            state.add_collider(box_at(1.05 * slope));
            let start = position(&state, 0);
            run(&mut state, &falling(scheme, 4), 0..300);
            assert!(position(&state, 0).distance(start) < 1e-4, "{scheme:?}, slope {slope}");
            let mut state = world([Ball::at(turn * Vec3::Y * 0.1)]);
            state.add_collider(box_at(0.5 * slope));
            run(&mut state, &falling(scheme, 4), 0..120);
            let cosine = 1.0 / (1.0 + slope * slope).sqrt();
            let expected = 2.0 * GRAVITY * cosine * 0.5 * slope;
            let found = velocity(&state, 0).dot(turn * Vec3::X);
            assert!(
                (found - expected).abs() < 0.02 * expected,
                "{scheme:?}, slope {slope}: {found}, not {expected}"
            );
        }
    }
}

/// A rough sequence of numbers from 0 to 1, the same on every machine.
struct Numbers(u32);

impl Numbers {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (self.0 >> 8) as f32 / 16_777_216.0
    }

    fn direction(&mut self) -> Vec3 {
        loop {
            let place = Vec3::new(self.next(), self.next(), self.next()) * 2.0 - 1.0;
            if (0.01..1.0).contains(&place.length_squared()) {
                return place.normalize();
            }
        }
    }
}

/// Thin ones too: 10,000 shots in all of balls and points at 10 to 1,000 m/s. None is through (on the far side while it
/// flew at the middle), none inside a tick later by more than 1 % of its radius.
#[test]
fn nothing_passes_through_any_shape_at_any_speed() {
    let (vertices, triangles) = sphere_mesh(0.5, 12);
    let closed = Shape::mesh(&vertices, &triangles, false).unwrap();
    let thin: Vec<(&str, Shape)> = vec![
        ("ball", Shape::ball(0.2)),
        ("capsule", Shape::capsule(0.05, 0.6)),
        ("wall", Shape::cuboid(Vec3::new(1.0, 1.0, 0.001))),
        ("disc", Shape::frustum([1.0, 1.0], 0.001)),
        ("cone", Shape::frustum([0.8, 0.0], 0.4)),
        ("mesh", closed),
        ("tetrahedron", tetrahedron(0.6)),
    ];
    let schemes = [
        Integrator::SemiImplicitEuler,
        Integrator::ImplicitEuler,
        Integrator::Xpbd,
        Integrator::VelocityVerlet,
    ];
    let mut numbers = Numbers(7);
    let mut shots = 0;
    for (name, shape) in &thin {
        for scheme in schemes {
            for radius in [0.0, 0.002, 0.05] {
                let count = 120;
                let mut state = Solver::default();
                let mut aims = Vec::new();
                for shot in 0..count {
                    let direction = numbers.direction();
                    let speed = 10.0 * bevy::math::ops::powf(100.0, numbers.next());
                    // Each at a place of its own, at a copy of the shape.
                    let centre = Vec3::new(5.0 * (shot % 12) as f32, 5.0 * (shot / 12) as f32, 0.0) - 25.0;
                    let turn = Quat::from_axis_angle(numbers.direction(), 6.0 * numbers.next());
                    let target = centre + 0.02 * numbers.direction();
                    let start = target - direction * 1.7;
                    state.add_particle(start, direction * speed, 1.0, radius).unwrap();
                    state.add_collider(Collider::resting(
                        shape.clone(),
                        Pose { point: centre, rotation: turn },
                    ));
                    aims.push((start, centre, turn, speed));
                    shots += 1;
                }
                let settings = StepSettings { pair_rules: None, ..floating(scheme, 0.0) };
                for tick in 0..12 {
                    state.step(&settings);
                    for (slot, (start, centre, turn, speed)) in aims.iter().enumerate() {
                        let place = position(&state, slot);
                        let case = format!(
                            "{name}, {scheme:?}, radius {radius}, shot {slot} at {speed} m/s, tick {tick}"
                        );
                        assert!(place.is_finite(), "{case}");
                        let local = turn.as_dquat().inverse() * (place - *centre).as_dvec3();
                        let depth = shape.depth(local, radius) as f32;
                        assert!(depth < 0.01 * radius + 2e-5, "{case}: {depth} m deep");
                        let _ = start;
                    }
                }
                for (slot, (start, centre, turn, speed)) in aims.iter().enumerate() {
                    // Having met it, it has lost what led into it: it never comes out straight on at full speed.
                    let way = (*centre - *start).normalize();
                    // Along a thin wall or disc it may pass beside it.
                    let along = (turn.inverse() * way).abs();
                    if (*name == "wall" && along.z < 0.1) || (*name == "disc" && along.y < 0.1) {
                        continue;
                    }
                    let kept = velocity(&state, slot).dot(way) / speed;
                    assert!(
                        kept < 0.999,
                        "{name}, {scheme:?}, radius {radius}, shot {slot}: kept {kept} of {speed} m/s"
                    );
                }
            }
        }
    }
    assert!(shots >= 10_000, "{shots}");
}

/// In its frame the impact is the usual one: v' = (1 + ε) V.
#[test]
fn a_paddle_hits_and_a_fast_one_passes_nothing_by() {
    for scheme in Integrator::named() {
        for speed in [3.0_f32, 400.0] {
            let mut paddle =
                with(resting(Shape::cuboid(Vec3::new(0.5, 0.01, 0.5)), Vec3::NEG_Y * 0.05), 0.5, 0.0);
            paddle.target.point += Vec3::Y * speed / 60.0;
            let mut state = world([Ball::at(Vec3::Y * 0.1)]);
            state.add_collider(paddle);
            state.step(&floating(scheme, 0.0));
            if speed / 60.0 < 0.04 {
                continue;
            }
            let found = velocity(&state, 0);
            assert!((found - Vec3::Y * 1.5 * speed).length() < 1e-4 * speed, "{scheme:?}: {found}");
            assert!(
                position(&state, 0).y >= state.inputs_mut().colliders[0].target.point.y + 0.11 - 1e-4,
                "{scheme:?}"
            );
        }
    }
}

/// What lies on a belt, or on a turning drum, comes to move with it: at μ g, then no faster.
#[test]
fn a_belt_carries_and_a_drum_rubs() {
    for scheme in Integrator::named() {
        let belt = Collider {
            surface_velocity: Vec3::X * 2.0,
            ..with(resting(Shape::cuboid(Vec3::new(20.0, 0.5, 1.0)), Vec3::NEG_Y * 0.5), 0.0, 0.4)
        };
        let mut state = world([Ball::at(Vec3::Y * 0.1)]);
        state.add_collider(belt);
        run(&mut state, &falling(scheme, 4), 0..15);
        let expected = 0.25 * 0.4 * GRAVITY;
        let found = velocity(&state, 0).x;
        assert!((found - expected).abs() < 0.02 * expected, "{scheme:?}: {found}, not {expected}");
        run(&mut state, &falling(scheme, 4), 0..60);
        assert!((velocity(&state, 0) - Vec3::X * 2.0).length() < 1e-3, "{scheme:?}: {}", velocity(&state, 0));
        // Turning about z at 4 rad/s, its top moves at −2 m/s.
        let drum = with(resting(Shape::frustum([0.5, 0.5], 1.0), Vec3::ZERO), 0.0, 0.4);
        let mut state = world([Ball::at(Vec3::Y * 0.6)]);
        state.add_collider(drum);
        let turned =
            |tick: u32| Quat::from_rotation_z(4.0 * tick as f32 / 60.0) * Quat::from_rotation_x(FRAC_PI_2);
        for tick in 0..6 {
            let drum = &mut state.inputs_mut().colliders[0];
            (drum.start.rotation, drum.target.rotation) = (turned(tick), turned(tick + 1));
            state.step(&falling(scheme, 4));
        }
        let expected = -0.1 * 0.4 * GRAVITY;
        let found = velocity(&state, 0).x;
        assert!((found - expected).abs() < 0.05 * expected.abs(), "{scheme:?}: {found}, not {expected}");
    }
}

#[test]
fn layers_sensors_and_rules_decide() {
    for scheme in Integrator::named() {
        let floor = with(resting(Shape::cuboid(Vec3::new(9.0, 0.5, 9.0)), Vec3::NEG_Y * 0.5), 0.0, 0.8);
        let drop = |floor: Collider, skin: Skin| {
            let mut state = world([Ball { velocity: Vec3::new(2.0, -1.0, 0.0), ..Ball::at(Vec3::Y * 0.11) }]);
            state.outputs_mut().record_contacts = true;
            state.add_collider(floor);
            state.inputs_mut().skins = vec![skin];
            let mut told = false;
            for _ in 0..10 {
                state.step(&floating(scheme, 0.0));
                told |= !state.outputs().contacts.is_empty();
            }
            (velocity(&state, 0), told)
        };
        let layers = |memberships, filters| Layers { memberships, filters };
        let apart = Collider { layers: layers(1, 2), ..floor.clone() };
        let skin = Skin { layers: layers(1, 1), ..Skin::default() };
        assert_eq!(drop(apart.clone(), skin), (Vec3::new(2.0, -1.0, 0.0), false), "{scheme:?}");
        let skin = Skin { layers: layers(2, 1), ..Skin::default() };
        assert!(drop(apart, skin).0.y > -1e-6, "{scheme:?}");
        let sensor = Collider { is_sensor: true, ..floor.clone() };
        assert_eq!(drop(sensor, Skin::default()), (Vec3::new(2.0, -1.0, 0.0), true), "{scheme:?}");
        // The impact of 1 m/s takes μ · 1 m/s of the slip.
        let rough = Material { friction: 0.2, friction_rule: CombineRule::Minimum, ..Material::default() };
        for (material, friction) in [(None, 0.8), (Some(rough), 0.2)] {
            let found = drop(floor.clone(), Skin { material, ..Skin::default() }).0.x;
            assert!((found - (2.0 - friction)).abs() < 1e-3, "{scheme:?}: {found}");
        }
    }
}

/// Far colliders change no bit and nothing by order; colliders that pass from place to place neither.
#[test]
fn what_is_far_changes_no_bit() {
    let bits_with = |far: u32| {
        let mut state = world((0..40_u8).map(|ball| Ball {
            velocity: Vec3::new(f32::from(ball % 7) - 3.0, -2.0, f32::from(ball % 5) - 2.0),
            ..Ball::at(Vec3::new(0.3 * f32::from(ball % 8), 0.8, 0.3 * f32::from(ball / 8)))
        }));
        for (number, (_, shape, _)) in shapes().into_iter().enumerate() {
            state.add_collider(with(resting(shape, Vec3::new(0.3 * number as f32, 0.0, 0.5)), 0.3, 0.3));
        }
        for number in 0..far {
            let place = Vec3::new(200.0 + 3.0 * number as f32, 0.0, 0.0);
            state.add_collider(resting(Shape::ball(1.0), place));
        }
        run(&mut state, &falling(Integrator::SemiImplicitEuler, 4), 0..90);
        solver_bits(&state)
    };
    assert_eq!(bits_with(0), bits_with(300));
}

/// Elastic impacts, 1,000 in a row, between two walls: nothing is gained or lost but roundings.
#[test]
fn a_thousand_elastic_impacts_keep_the_energy() {
    for scheme in
        [Integrator::SemiImplicitEuler, Integrator::VelocityVerlet, Integrator::RungeKutta4, Integrator::Xpbd]
    {
        let mut state = world([Ball { velocity: Vec3::new(9.0, 0.0, 0.0), ..Ball::at(Vec3::ZERO) }]);
        for side in [-1.0, 1.0] {
            let wall = resting(Shape::cuboid(Vec3::new(0.1, 1.0, 1.0)), Vec3::X * side * 0.4);
            state.add_collider(with(wall, 1.0, 0.0));
        }
        state.outputs_mut().record_contacts = true;
        let mut impacts = 0;
        while impacts < 1000 {
            state.step(&floating(scheme, 1.0));
            impacts += state.outputs().contacts.iter().filter(|contact| contact.impulse > 0.0).count();
        }
        let speed = velocity(&state, 0).length();
        assert!((speed - 9.0).abs() < 0.04, "{scheme:?}: {speed} m/s");
    }
}
