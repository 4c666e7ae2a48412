//! What is written, and where to.

use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::process::Stdio;

use serde_json::Value;

use crate::workplace::{Row, Workplace, errors, rows, shipped, status};

const KEYS: [&str; 21] = [
    "particles",
    "springs",
    "ticks",
    "time",
    "integrator",
    "substeps",
    "threads",
    "finite",
    "max_stretch",
    "mean_stretch",
    "kinetic_energy",
    "elastic_energy",
    "gravitational_energy",
    "momentum",
    "contacts",
    "milliseconds_per_tick",
    "milliseconds_per_step",
    "state_hash",
    "nets",
    "broken",
    "max_depth",
];

#[test]
fn the_summary_has_the_keys_of_the_contract_in_their_order() {
    let place = Workplace::with_scene(&shipped("pendulum"));
    let output = place.run(&["--ticks", "30", "--threads", "1"]);
    assert_eq!(status(&output), 0, "{}", errors(&output));
    let text = String::from_utf8(output.stdout).unwrap();
    let places: Vec<usize> = KEYS.iter().map(|key| text.find(&format!("\"{key}\":")).expect(key)).collect();
    assert!(places.is_sorted(), "{text}");

    let summary: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(summary.as_object().unwrap().len(), KEYS.len());
    assert_eq!((&summary["particles"], &summary["springs"]), (&2.into(), &1.into()));
    assert_eq!((&summary["ticks"], &summary["threads"]), (&30.into(), &1.into()));
    assert_eq!(summary["time"], 30.0 / 60.0);
    assert_eq!(summary["finite"], true);
    assert_eq!(summary["integrator"], "VelocityVerlet");
    assert!(summary["substeps"].as_u64().unwrap() >= 4);
    assert_eq!(summary["momentum"].as_array().unwrap().len(), 3);
    assert!(summary["milliseconds_per_tick"].as_f64().unwrap() > 0.0);
    assert!(summary["milliseconds_per_step"].as_f64() < summary["milliseconds_per_tick"].as_f64());
    let hash = summary["state_hash"].as_str().unwrap();
    assert!(hash.len() == 16 && hash.chars().all(|digit| digit.is_ascii_hexdigit()), "{hash}");
}

#[test]
fn no_tick_at_all_leaves_the_initial_state() {
    let place = Workplace::with_scene(
        "(
            solver: (integrator: VelocityVerlet, substeps: Fixed(7)),
            particles: [
                (position: (0, 3, 0), velocity: (3, 4, 0), mass: 2),
                (position: (0, 1, 0), mass: 1, pinned: true),
            ],
            springs: [(particles: (0, 1), rest_length: 1.6, stiffness: 50)],
        )",
    );
    let summary = place.summary(&["--ticks", "0", "--csv", "states.csv"]);
    assert_eq!((&summary["ticks"], &summary["time"]), (&0.into(), &0.0.into()));
    assert_eq!((&summary["integrator"], &summary["substeps"]), (&"VelocityVerlet".into(), &7.into()));
    let near = |key: &str, expected: f64| {
        let found = summary[key].as_f64().unwrap();
        assert!((found - expected).abs() < 1e-5 * expected, "{key}: {found} instead of {expected}");
    };
    near("kinetic_energy", 25.0);
    near("elastic_energy", 4.0);
    near("gravitational_energy", 2.0 * 9.81 * 3.0);
    near("max_stretch", 0.25);
    near("mean_stretch", 0.25);
    assert_eq!(summary["momentum"], serde_json::json!([6.0, 8.0, 0.0]));
    let states = rows(&fs::read_to_string(place.path("states.csv")).unwrap());
    let row = |particle, state| Row { tick: 0, time: 0.0, particle, state };
    assert_eq!(states, [row(0, [0., 3., 0., 3., 4., 0.]), row(1, [0., 1., 0., 0., 0., 0.])]);
}

#[test]
fn the_csv_has_the_initial_state_every_nth_tick_and_the_last() {
    let place = Workplace::with_scene(&shipped("pendulum"));
    for (arguments, expected) in [
        (vec!["--ticks", "3"], vec![0, 1, 2, 3]),
        (vec!["--ticks", "7", "--every", "3"], vec![0, 3, 6, 7]),
        (vec!["--ticks", "6", "--every", "3"], vec![0, 3, 6]),
        (vec!["--ticks", "2", "--every", "100"], vec![0, 2]),
        (vec!["--duration", "0.05"], vec![0, 1, 2, 3]),
        (vec!["--duration", "0.3", "--time-step", "0.1"], vec![0, 1, 2, 3]),
    ] {
        let output = place.run(&[&arguments[..], &["--csv", "-"]].concat());
        assert_eq!(status(&output), 0, "{}", errors(&output));
        let states = rows(std::str::from_utf8(&output.stdout).unwrap());
        let found: Vec<(u64, usize)> = states.iter().map(|row| (row.tick, row.particle)).collect();
        let expected: Vec<(u64, usize)> =
            expected.into_iter().flat_map(|tick| [(tick, 0), (tick, 1)]).collect();
        assert_eq!(found, expected, "{arguments:?}");
        let time_step = if arguments.contains(&"--time-step") { 0.1 } else { 1.0 / 60.0 };
        assert!(states.iter().all(|row| row.time == row.tick as f64 * time_step), "{states:?}");
        assert_eq!(states[1].state, [0.6, 1.2, 0.0, 0.0, 0.0, 0.0]);
    }
}

#[test]
fn outputs_go_where_they_are_sent() {
    let place = Workplace::with_scene(&shipped("pendulum"));
    // Both into files, one of which is longer than its new content.
    fs::write(place.path("states.csv"), "x".repeat(100_000)).unwrap();
    let output = place.run(&["--ticks", "2", "--csv", "states.csv", "--json", "summary.json"]);
    assert_eq!((status(&output), output.stdout.len()), (0, 0));
    let csv = fs::read_to_string(place.path("states.csv")).unwrap();
    assert_eq!(rows(&csv).len(), 3 * 2);
    let json = fs::read_to_string(place.path("summary.json")).unwrap();
    assert_eq!(serde_json::from_str::<Value>(&json).unwrap()["ticks"], 2);
    // The CSV on stdout, where no JSON is mixed into it.
    let output = place.run(&["--ticks", "2", "--csv", "-"]);
    assert_eq!(String::from_utf8(output.stdout).unwrap(), csv);
    let output = place.run(&["--ticks", "2", "--csv", "-", "--json", "other.json"]);
    assert_eq!(String::from_utf8(output.stdout).unwrap(), csv);
    assert!(place.path("other.json").exists());
    // The CSV into a file, the JSON on stdout by default or by name.
    for arguments in
        [&["--ticks", "2", "--csv", "b.csv"][..], &["--ticks", "2", "--csv", "b.csv", "--json", "-"]]
    {
        assert_eq!(place.summary(arguments)["ticks"], 2);
        assert_eq!(fs::read_to_string(place.path("b.csv")).unwrap(), csv);
    }
}

#[test]
fn a_closed_pipe_is_no_panic() {
    let place = Workplace::with_scene(&shipped("net"));
    let mut child = place
        .command(&["run", "a.scene.ron", "--duration", "3600", "--csv", "-"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = String::new();
    // Reading one line and dropping the pipe ends an hour of simulation at once.
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
    assert_eq!(line, "tick,time,particle,x,y,z,vx,vy,vz\n");
    let mut errors = String::new();
    child.stderr.take().unwrap().read_to_string(&mut errors).unwrap();
    assert_eq!((child.wait().unwrap().code(), errors.as_str()), (Some(0), ""));
}

#[test]
fn check_describes_how_a_scene_would_run() {
    let place = Workplace::with_scene(
        "(
            solver: (time_step: 0.02, integrator: RungeKutta4, substeps: Fixed(3)),
            particles: [
                (position: (0, 3, 0), mass: 1, pinned: true),
                (position: (0, 2, 0), mass: 0.25),
            ],
            springs: [(particles: (0, 1), stiffness: 2500)],
            planes: [(normal: (0, 1, 0))],
        )",
    );
    let output = place.command(&["check", "a.scene.ron"]).output().unwrap();
    assert_eq!(status(&output), 0, "{}", errors(&output));
    // ω = √(k / m) = 100 rad/s; semi-implicit Euler and velocity Verlet are stable up to 2 / ω.
    let expected = "\
particles               2 (1 pinned)
springs                 1
planes                  1
time step               0.02000 s
highest frequency       at most 100.0 rad/s (15.92 Hz)
highest damping rate    at most 0 1/s
largest stable substep
  ExplicitEuler         none
  SemiImplicitEuler     0.02000 s
  SecondOrderTaylor     none
  VelocityVerlet        0.02000 s
  RungeKutta4           0.02615 s
  ImplicitEuler         any
  TrBdf2                any
  Xpbd                  any
Auto would choose       VelocityVerlet, 4 substeps a tick
this scene would run    RungeKutta4, 3 substeps a tick
";
    assert_eq!(String::from_utf8(output.stdout).unwrap(), expected);
}

/// A soft pendulum and a stiff one: each by its own scheme. The summary names that of the soft part, and its
/// substeps.
#[test]
fn the_schemes_of_a_mixture_are_reported() {
    let place = Workplace::with_scene(
        "(
            particles: [
                (position: (0, 3, 0), mass: 1, pinned: true),
                (position: (0, 2, 0), mass: 1),
                (position: (0, 4, 0), mass: 1),
            ],
            springs: [(particles: (0, 1), stiffness: 100), (particles: (0, 2), stiffness: 1e12)],
        )",
    );
    let output = place.command(&["check", "a.scene.ron"]).output().unwrap();
    assert_eq!(status(&output), 0, "{}", errors(&output));
    let text = String::from_utf8(output.stdout).unwrap();
    let expected = "VelocityVerlet, 4 substeps a tick; TrBdf2, 2 substeps a tick on 1 spring\n";
    for line in ["Auto would choose       ", "this scene would run    "] {
        assert!(text.contains(&format!("{line}{expected}")), "{text}");
    }
    let summary = place.summary(&["--ticks", "2"]);
    assert_eq!((&summary["integrator"], &summary["substeps"]), (&"VelocityVerlet".into(), &4.into()));
}
