//! Colliders of every shape: single impacts, slopes, motion; in the pure solver, under every scheme.

use std::f32::consts::FRAC_PI_2;

use bevy::math::{Quat, Vec3};
use bevy_mass_spring::solver::{
    Collider, CombineRule, ContactPartner, ContactProperties, Integrator, Layers, Material, Pose, Shape,
    Solver, StepSettings,
};

use crate::common::bodies::{
    Ball, GRAVITY, falling, floating, position, solver_bits, step_past_contact, velocity, world,
};
use crate::common::shapes::{resting, shapes, with};

fn run(state: &mut Solver, settings: &StepSettings, ticks: std::ops::Range<u32>) {
    for _ in ticks {
        state.step(settings);
    }
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
        let drop = |floor: Collider, own_properties: ContactProperties| {
            let mut state = world([Ball { velocity: Vec3::new(2.0, -1.0, 0.0), ..Ball::at(Vec3::Y * 0.11) }]);
            state.outputs_mut().record_contacts = true;
            state.add_collider(floor);
            state.inputs_mut().contact_properties = vec![own_properties];
            let mut told = false;
            for _ in 0..10 {
                state.step(&floating(scheme, 0.0));
                told |= !state.outputs().contacts.is_empty();
            }
            (velocity(&state, 0), told)
        };
        let layers = Layers::new;
        let apart = Collider { layers: layers(1, 2), ..floor.clone() };
        let own_properties = ContactProperties { layers: layers(1, 1), ..ContactProperties::default() };
        assert_eq!(drop(apart.clone(), own_properties), (Vec3::new(2.0, -1.0, 0.0), false), "{scheme:?}");
        let own_properties = ContactProperties { layers: layers(2, 1), ..ContactProperties::default() };
        assert!(drop(apart, own_properties).0.y > -1e-6, "{scheme:?}");
        let sensor = Collider { is_sensor: true, ..floor.clone() };
        assert_eq!(
            drop(sensor, ContactProperties::default()),
            (Vec3::new(2.0, -1.0, 0.0), true),
            "{scheme:?}"
        );
        // The impact of 1 m/s takes μ · 1 m/s of the slip.
        let rough = Material { friction: 0.2, friction_rule: CombineRule::Minimum, ..Material::default() };
        for (material, friction) in [(None, 0.8), (Some(rough), 0.2)] {
            let found =
                drop(floor.clone(), ContactProperties { material, ..ContactProperties::default() }).0.x;
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
