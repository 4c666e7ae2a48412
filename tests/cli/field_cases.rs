//! Scenes of `tests/scenes`: what people reported as broken in programs of this kind, each with its right value.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::workplace::{Row, Workplace, errors, rows, status};

fn case(name: &str) -> Workplace {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scenes");
    Workplace::with_scene(&fs::read_to_string(folder.join(format!("{name}.scene.ron"))).unwrap())
}

/// The states that such a run writes.
fn states(place: &Workplace, arguments: &[&str]) -> Vec<Row> {
    let output = place.run(&[arguments, &["--csv", "-"]].concat());
    assert_eq!(status(&output), 0, "{}", errors(&output));
    rows(std::str::from_utf8(&output.stdout).unwrap())
}

fn position(row: &Row) -> [f64; 3] {
    [0, 1, 2].map(|axis| row.state[axis].into())
}

fn distance(one: &Row, other: &Row) -> f64 {
    let (one, other) = (position(one), position(other));
    (0..3).map(|axis| (one[axis] - other[axis]).powi(2)).sum::<f64>().sqrt()
}

fn energy(summary: &Value) -> f64 {
    ["kinetic_energy", "elastic_energy", "gravitational_energy"]
        .map(|name| summary[name].as_f64().unwrap())
        .iter()
        .sum()
}

/// Head on, with a coefficient of restitution of 1: it flies back as fast. What is left of the substep of the impact is
/// lost, at most 1/60 s.
#[test]
fn a_fast_ball_bounces_off_a_pinned_one() {
    let states = states(&case("ball-ball-v100"), &["--duration", "1", "--every", "60"]);
    let [x, y, z, velocity, ..] = states.last().unwrap().state;
    let exact = -0.1 - 100.0 * (1.0 - 0.019);
    assert!((exact - 0.1..exact + 100.0 / 60.0).contains(&x) && [y, z] == [0.0; 2], "{x} {y} {z}");
    assert!((velocity + 100.0).abs() < 0.01, "{velocity} m/s");
}

/// Each link is as long as what hangs on it makes it: 0.1 m + m g / k. Swinging, which dampers along the links hardly
/// take from, it is still straight to 1 %.
#[test]
fn a_rope_that_starts_in_one_place_unfolds() {
    let states = states(&case("coincident-pinned"), &["--duration", "300", "--every", "18000"]);
    let hanging = &states[5..];
    let lengths: Vec<f64> = hanging.windows(2).map(|ends| distance(&ends[0], &ends[1])).collect();
    for (link, length) in lengths.iter().enumerate() {
        let below = 0.1 * (4 - link) as f64;
        let expected = 0.1 + below * 9.81 / 200.0;
        assert!((length / expected - 1.0).abs() < 0.05, "link {link}: {length} m instead of {expected} m");
    }
    let straight: f64 = lengths.iter().sum();
    assert!(distance(&hanging[0], &hanging[4]) > 0.99 * straight, "{hanging:?}");
    assert!(position(&hanging[4])[1] < 2.0 - 0.9 * straight, "{hanging:?}");
}

/// It falls with 2.3 J: springs never hold more, and none is stretched by 0.4 %. In the end it lies still.
#[test]
fn a_stiff_cube_lands_without_stretching() {
    let place = case("cube-k1e07");
    let states = states(&place, &["--duration", "2"]);
    let (start, ticks) = states.split_at(8);
    for tick in ticks.chunks(8) {
        let mut elastic_energy = 0.0;
        for (a, b) in (0..8).flat_map(|a| (a + 1..8).map(move |b| (a, b))) {
            let rest_length = distance(&start[a], &start[b]);
            let strain = distance(&tick[a], &tick[b]) / rest_length - 1.0;
            assert!(strain.abs() < 0.004, "{strain} in tick {}", tick[0].tick);
            elastic_energy += 0.5e7 * (strain * rest_length).powi(2);
        }
        assert!(elastic_energy < 2.3, "{elastic_energy} J in tick {}", tick[0].tick);
    }
    let summary = place.summary(&["--duration", "10"]);
    assert!(summary["kinetic_energy"].as_f64().unwrap() < 1e-9, "{summary}");
    assert!(summary["max_stretch"].as_f64().unwrap() < 1e-5, "{summary}");
}

/// Let go at 60°, it swings for minutes: of m g h = 49 J the 30 s of about ten periods take less than 1 %.
#[test]
fn a_heavy_load_keeps_swinging() {
    let place = case("heavy-load-swing");
    let [before, after] = ["0", "1800"].map(|ticks| energy(&place.summary(&["--ticks", ticks])));
    assert!((after - before).abs() < 0.49, "{before} J and {after} J");
}

/// c/m = 1e8 1/s: the velocity is gone at once, after a way of m v / c = 1e-7 m.
#[test]
fn a_pure_damper_stops_at_once() {
    for row in &states(&case("pure-damper"), &["--duration", "0.5"])[2..] {
        let expected = if row.particle == 0 { [0.0; 6] } else { [2.0, 0.0, 0.0, 0.0, 0.0, 0.0] };
        for (found, expected) in row.state.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-5, "{row:?}");
        }
    }
}

/// No torque acts on them: 4e-3 kg m²/s and 4e-4 J stay, also where their springs press them together.
#[test]
fn touching_balls_turn_on() {
    let place = case("two-balls-turning");
    for integrator in ["Auto", "SemiImplicitEuler", "VelocityVerlet", "RungeKutta4"] {
        let arguments = ["--integrator", integrator, "--duration", "60"];
        let states = states(&place, &[&arguments[..], &["--every", "3600"]].concat());
        let turning = states[3..].iter().map(|row| {
            let [x, y, _, velocity_x, velocity_y, _] = row.state.map(f64::from);
            x * velocity_y - y * velocity_x
        });
        let angular_momentum: f64 = turning.sum();
        assert!((angular_momentum / 4e-3 - 1.0).abs() < 0.01, "{integrator}: {angular_momentum} kg m²/s");
        let energy = place.summary(&arguments)["kinetic_energy"].as_f64().unwrap();
        assert!((energy / 4e-4 - 1.0).abs() < 0.01, "{integrator}: {energy} J");
    }
}
