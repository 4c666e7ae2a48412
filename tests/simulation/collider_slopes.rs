//! Coulomb friction on slopes of every kind of collider: balls, the ends of ropes, the corners of cloths.

use bevy::math::{Quat, Vec3};
use bevy_mass_spring::solver::{Collider, Integrator, Pose, Shape, Solver};

use crate::common::bodies::{Ball, GRAVITY, falling, position, velocity};
use crate::common::colliding::{Cloth, rope};
use crate::common::shapes::with;

/// What lies on a slope, at its top, with the slots that are looked at: a ball, a rope down the slope and its ends, a cloth
/// and its corners. Ropes and cloths collide along their edges and faces, too.
fn lying(name: &str, down: Vec3, normal: Vec3) -> (Solver, Vec<usize>) {
    let across = normal.cross(down);
    let mut state = Solver::default();
    let seen = match name {
        "ball" => {
            let Ball { mass, radius, .. } = Ball::at(Vec3::ZERO);
            vec![state.add_particle(normal * radius, Vec3::ZERO, mass, radius).unwrap()]
        }
        "rope" => {
            let links = rope(&mut state, [normal * 0.02, normal * 0.02 + down * 0.8], 8, (0.05, 0.02), 400.0);
            vec![links[0], links[8]]
        }
        _ => {
            let cloth = Cloth {
                cells: 4,
                size: 0.4,
                radius: 0.02,
                stiffness: 100.0,
                areal_density: 1.0,
                damping: 0.02,
            };
            cloth.add(&mut state, normal * 0.02, [down, across]);
            vec![0, 4, 20, 24]
        }
    };
    (state, seen)
}

/// The slope that falls towards +x by tan θ = `slope`, through the origin.
fn slopes(slope: f32) -> (Vec3, Vec3, Vec<(&'static str, Collider)>) {
    let turn = Quat::from_rotation_z(-bevy::math::ops::atan(slope));
    let (down, normal) = (turn * Vec3::X, turn * Vec3::Y);
    // The level square of 40 m in 10 × 10 cells of two triangles, so that what slides crosses edges and corners of it.
    let place = |number: u32| 4.0 * number as f32 - 19.1;
    let vertices: Vec<Vec3> = (0..11_u32)
        .flat_map(|row| (0..11_u32).map(move |column| Vec3::new(place(column), 0.0, place(row))))
        .collect();
    let cells = (0..10_u32).flat_map(|row| (0..10_u32).map(move |column| row * 11 + column));
    let triangles: Vec<[u32; 3]> = cells
        .flat_map(|first| [[first, first + 11, first + 1], [first + 1, first + 11, first + 12]])
        .collect();
    let at = |shape: Shape, point: Vec3| Collider::resting(shape, Pose { point, rotation: turn });
    let slopes = vec![
        ("plane", Collider::half_space(Vec3::ZERO, normal, 0.0, 0.0)),
        ("box", at(Shape::cuboid(Vec3::new(20.0, 1.0, 20.0)), -normal)),
        ("mesh", at(Shape::mesh(&vertices, &triangles, true).unwrap(), Vec3::ZERO)),
    ];
    (down, normal, slopes)
}

/// A scheme and what it is tried with.
type Choice = fn(Integrator, &str) -> bool;

/// All but nets by the implicit schemes; and by what amplifies their vibrations, which says nothing of friction.
const EXPLICIT: Choice = |scheme, net| {
    net == "ball"
        || !matches!(
            scheme,
            Integrator::ExplicitEuler
                | Integrator::SecondOrderTaylor
                | Integrator::ImplicitEuler
                | Integrator::TrBdf2
        )
};

const IMPLICIT: Choice =
    |scheme, net| net != "ball" && matches!(scheme, Integrator::ImplicitEuler | Integrator::TrBdf2);

fn each_case(is_tried: Choice, mut test: impl FnMut(&str, Integrator, f32, [Vec3; 2], &Collider, &str)) {
    for scheme in Integrator::named() {
        for slope in [0.2_f32, 0.7] {
            let (down, normal, slopes) = slopes(slope);
            for (name, collider) in &slopes {
                for net in ["ball", "rope", "cloth"] {
                    if is_tried(scheme, net) {
                        let case = format!("{net} on a {name}, {scheme:?}, slope {slope}");
                        test(net, scheme, slope, [down, normal], collider, &case);
                    }
                }
            }
        }
    }
}

/// Below tan θ = μ all of it stays: for 3 s, within 0.1 mm (a substep without friction would move it by g h² sin θ = 0.1 mm).
#[test]
fn what_lies_on_a_rough_slope_holds() {
    holds(EXPLICIT);
}

#[test]
fn nets_on_a_rough_slope_hold_in_implicit_steps() {
    holds(IMPLICIT);
}

fn holds(is_tried: Choice) {
    let mut failures = Vec::new();
    each_case(is_tried, |net, scheme, slope, [down, normal], collider, case| {
        let (mut state, seen) = lying(net, down, normal);
        state.add_collider(with(collider.clone(), 0.0, 1.05 * slope));
        let starts: Vec<Vec3> = seen.iter().map(|slot| position(&state, *slot)).collect();
        for _ in 0..180 {
            state.step(&falling(scheme, 4));
        }
        for (slot, start) in seen.iter().zip(starts) {
            let crept = position(&state, *slot).distance(start);
            if crept.is_nan() || crept >= 1e-4 {
                failures.push(format!("{case}, particle {slot}: {crept} m"));
            }
        }
    });
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// Above it all of it slides at a = g (sin θ − μ cos θ): over 2 s, within 2 %.
#[test]
fn what_lies_on_a_smooth_slope_slides() {
    slides(EXPLICIT, 0.9);
}

/// Nearer to the slope at which it holds a rope is too fast by 3 %.
#[test]
fn nets_on_a_smooth_slope_slide_in_implicit_steps() {
    slides(IMPLICIT, 0.5);
}

fn slides(is_tried: Choice, roughest: f32) {
    let mut failures = Vec::new();
    each_case(is_tried, |net, scheme, slope, [down, normal], collider, case| {
        for friction in [0.0, 0.5, roughest].map(|part| part * slope) {
            let (mut state, seen) = lying(net, down, normal);
            state.add_collider(with(collider.clone(), 0.0, friction));
            let starts: Vec<Vec3> = seen.iter().map(|slot| position(&state, *slot)).collect();
            for _ in 0..120 {
                state.step(&falling(scheme, 4));
            }
            let cosine = 1.0 / (1.0 + slope * slope).sqrt();
            let expected = GRAVITY * cosine * (slope - friction);
            for (slot, start) in seen.iter().zip(starts) {
                let by_speed = velocity(&state, *slot).dot(down) / 2.0;
                let by_way = (position(&state, *slot) - start).dot(down) / 2.0;
                for found in [by_speed, by_way] {
                    let error = (found / expected - 1.0).abs();
                    if error.is_nan() || error >= 0.02 {
                        failures.push(format!(
                            "{case}, μ {friction}, particle {slot}: {found} m/s², not {expected}"
                        ));
                    }
                }
            }
        }
    });
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}
