//! The simulation, run by the command line.

use std::fs;

use serde_json::Value;

use crate::workplace::{Row, Workplace, errors, rows, shipped, status};

/// A ball in free fall beside a pinned one that stays, no ground.
const FREE_FALL: &str = "(
    solver: (time_step: 0.0078125, integrator: SecondOrderTaylor, substeps: Fixed(1)),
    particles: [
        (position: (0.1, 100.0, -0.3), velocity: (1.0, 2.0, 0.0), mass: 3.0, radius: 0.05),
        (position: (5.0, 5.0, 5.0), mass: 1.0, radius: 0.05, pinned: true),
    ],
)";

/// Undamped, stiff, and integrated by explicit Euler in one substep: it explodes.
const EXPLOSION: &str = "(
    solver: (integrator: ExplicitEuler, substeps: Fixed(1)),
    particles: [
        (position: (0.0, 0.0, 0.0), mass: 1.0, pinned: true),
        (position: (0.0, -1.1, 0.0), mass: 0.001),
    ],
    springs: [(particles: (0, 1), rest_length: 1.0, stiffness: 1e6)],
)";

#[test]
fn free_fall_is_exact() {
    let place = Workplace::with_scene(FREE_FALL);
    let output = place.run(&["--ticks", "256", "--csv", "-"]);
    assert_eq!(status(&output), 0, "{}", errors(&output));
    let states = rows(std::str::from_utf8(&output.stdout).unwrap());
    assert_eq!(states.len(), 257 * 2);
    for Row { time, particle, state, .. } in states {
        let time = time as f32;
        let expected = match particle {
            0 => {
                [0.1 + time, 100.0 + 2.0 * time - 0.5 * 9.81 * time * time, -0.3, 1.0, 2.0 - 9.81 * time, 0.0]
            }
            _ => [5.0, 5.0, 5.0, 0.0, 0.0, 0.0],
        };
        for (found, expected) in state.into_iter().zip(expected) {
            // Each tick rounds once: a few units in the last place of 100.
            assert!((found - expected).abs() < 3e-4, "{found} instead of {expected} at {time} s");
        }
    }
}

#[test]
fn the_scheme_and_its_substeps_can_be_replaced() {
    let place = Workplace::with_scene(&shipped("chain"));
    let ran = |arguments: &[&str]| {
        let summary = place.summary(&[&["--ticks", "2"], arguments].concat());
        (summary["integrator"].as_str().unwrap().to_owned(), summary["substeps"].as_u64().unwrap())
    };
    assert_eq!(ran(&["--integrator", "VelocityVerlet", "--substeps", "9"]), ("VelocityVerlet".to_owned(), 9));
    let (scheme, automatic) = ran(&[]);
    assert_eq!(scheme, "VelocityVerlet");
    assert!(automatic >= 4);
    assert_eq!(ran(&["--substeps", "auto"]), (scheme, automatic));
    // What is said before the first tick is what runs.
    let planned = place.summary(&["--ticks", "0"]);
    assert_eq!((&planned["integrator"], &planned["substeps"]), (&"VelocityVerlet".into(), &automatic.into()));
}

#[test]
fn a_long_time_step_is_run_whole() {
    // Longer than the 250 ms to which Bevy cuts a frame.
    let place = Workplace::with_scene(FREE_FALL);
    let arguments = ["--ticks", "4", "--time-step", "0.5", "--csv", "-", "--every", "4"];
    let output = place.run(&arguments);
    assert_eq!(status(&output), 0, "{}", errors(&output));
    let states = rows(std::str::from_utf8(&output.stdout).unwrap());
    let height = states[2].state[1];
    assert!((height - (100.0 + 2.0 * 2.0 - 0.5 * 9.81 * 4.0)).abs() < 1e-4, "{height}");
}

#[test]
fn an_explosion_is_exit_status_1_with_all_outputs_written() {
    let place = Workplace::with_scene(EXPLOSION);
    let output = place.run(&["--ticks", "100", "--csv", "states.csv", "--json", "summary.json"]);
    assert_eq!(status(&output), 1, "{}", errors(&output));
    let summary: Value =
        serde_json::from_str(&fs::read_to_string(place.path("summary.json")).unwrap()).unwrap();
    assert_eq!((&summary["finite"], &summary["ticks"]), (&false.into(), &100.into()));
    assert_eq!((&summary["integrator"], &summary["substeps"]), (&"ExplicitEuler".into(), &1.into()));
    assert_eq!(rows(&fs::read_to_string(place.path("states.csv")).unwrap()).len(), 101 * 2);
    let message = errors(&output);
    let tick = message.trim_end().strip_prefix("particle 1 became non-finite in tick ").expect(&message);
    assert!((2..100).contains(&tick.parse::<u64>().unwrap()), "{message}");
    // `Auto` is stable.
    assert_eq!(place.summary(&["--integrator", "Auto", "--substeps", "auto"])["finite"], true);
}

#[test]
fn equal_runs_have_equal_hashes() {
    for scene in ["net", "pile"] {
        let place = Workplace::with_scene(&shipped(scene));
        let hash = |arguments: &[&str]| {
            let summary = place.summary(&[&["--duration", "2"], arguments].concat());
            summary["state_hash"].as_str().unwrap().to_owned()
        };
        let once = hash(&["--threads", "1"]);
        assert_eq!(once, hash(&["--threads", "1"]), "{scene}: the same run twice");
        assert_eq!(once, hash(&["--threads", "2"]), "{scene}: one thread and two");
        assert_ne!(once, hash(&["--time-step", "0.01"]), "{scene}: another run");
    }
}

#[test]
fn shipped_scenes_run_to_the_end() {
    for scene in ["bounce", "chain", "net", "pendulum", "pile"] {
        let place = Workplace::with_scene(&shipped(scene));
        let summary = place.summary(&[]);
        assert_eq!((&summary["ticks"], &summary["time"]), (&600.into(), &10.0.into()), "{scene}");
        assert_eq!(summary["finite"], true, "{scene}");
        let stretch = summary["max_stretch"].as_f64().unwrap();
        assert!(stretch < 0.2, "{scene}: stretched by {stretch}");
    }
}
