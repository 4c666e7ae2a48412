//! Scenes with nets, run by the command line.

use std::fs;

use crate::workplace::{Row, Workplace, errors, rows, shipped, status};

/// A loose particle, a rope of one segment and a bend from one into the other, off the ground.
const BENT: &str = "(
    environment: (gravity: (0, -10, 0)),
    collisions: (ground: false),
    particles: [(position: (1, 1, 0), mass: 2, radius: 0.5)],
    springs: [(particles: (2, 0), stiffness: 100)],
    bends: [(particles: (1, 2, 0), stiffness: 10)],
    nets: [
        Rope(from: (0, 0, 0), to: (1, 0, 0), segments: 1, radius: 0.25, linear_density: 4, stretch_stiffness: 1e3,
             pinned: [0]),
        Balloon(centre: (9, 9, 9), radius: 1, subdivisions: 0, area_density: 1, stretch_stiffness: 1, pressure: 5),
    ],
    planes: [(point: (0, 0.2, 0), normal: (0, 2, 0))],
)";

#[test]
fn particles_of_nets_follow_those_of_the_list() {
    let place = Workplace::with_scene(BENT);
    let summary = place.summary(&["--ticks", "0", "--csv", "states.csv"]);
    // An icosahedron has 12 corners and 30 edges.
    assert_eq!((&summary["particles"], &summary["springs"]), (&15.into(), &32.into()));
    assert_eq!((&summary["nets"], &summary["broken"]), (&2.into(), &0.into()));
    let states = rows(&fs::read_to_string(place.path("states.csv")).unwrap());
    let row = |particle, x, y| Row { tick: 0, time: 0.0, particle, state: [x, y, 0., 0., 0., 0.] };
    assert_eq!(states[..3], [row(0, 1., 1.), row(1, 0., 0.), row(2, 1., 0.)]);
    assert!(states[3..].iter().enumerate().all(|(number, row)| row.particle == number + 3));
    // ½ k ‖(0, 0) − 2 (1, 0) + (1, 1)‖²; all springs are at rest, and so is the gas.
    let near = |key: &str, expected: f64| {
        let found = summary[key].as_f64().unwrap();
        assert!((found - expected).abs() < 1e-4 * expected, "{key}: {found} instead of {expected}");
    };
    near("elastic_energy", 10.0);
    // The rope at y = 0 adds nothing. The sides of an icosahedron of radius 1 have an area of 5 √3 a², a = 1.0514622.
    let area = 5.0 * 3.0_f64.sqrt() * 1.051_462_224_f64.powi(2);
    near("gravitational_energy", 10.0 * (2.0 * 1.0 + area * 9.0));
    // The rope's radius and what it is below the plane.
    near("max_depth", 0.25 + 0.2);
}

#[test]
fn check_counts_nets() {
    let place = Workplace::with_scene(BENT);
    let output = place.command(&["check", "a.scene.ron"]).output().unwrap();
    assert_eq!(status(&output), 0, "{}", errors(&output));
    let text = String::from_utf8(output.stdout).unwrap();
    let expected = "\
particles               15 (1 pinned)
springs                 32
bends                   1
nets                    2 (1 rope, 1 balloon)
planes                  1
";
    assert!(text.starts_with(expected), "{text}");
}

/// A load at the end of a rope, tied by a spring, comes to rest where statics say.
#[test]
fn a_load_hangs_on_the_end_of_a_rope() {
    let place = Workplace::with_scene(
        "(
            environment: (viscosity: 20),
            particles: [(position: (0, -2, 0), mass: 10)],
            springs: [(particles: (0, 11), stiffness: 1e3)],
            nets: [Rope(from: (0, 0, 0), to: (0, -1, 0), segments: 10, linear_density: 0.2,
                        stretch_stiffness: 2e3, retardation_time: 0.01, pinned: [0])],
        )",
    );
    let output = place.run(&["--ticks", "600", "--every", "600", "--csv", "-"]);
    assert_eq!(status(&output), 0, "{}", errors(&output));
    let states = rows(std::str::from_utf8(&output.stdout).unwrap());
    let last: Vec<f32> = states.iter().filter(|row| row.tick == 600).map(|row| row.state[1]).collect();
    assert_eq!(last.len(), 12);
    // A link carries the load, half a link and all links below it.
    let load = |links_below: f32| 9.81 * (10.0 + 0.02 * (links_below + 0.5));
    let stretch: f32 = (0..10).map(|below| load(below as f32) * 0.1 / 2e3).sum();
    let tie = 9.81 * 10.0 / 1e3;
    assert!((last[11] + 1.0 + stretch).abs() < 1e-3, "{} instead of {}", last[11], -1.0 - stretch);
    assert!((last[0] + 2.0 + stretch + tie).abs() < 1e-3, "{}", last[0]);
}

#[test]
fn what_becomes_non_finite_in_a_net_is_named_with_its_net() {
    let place = Workplace::with_scene(
        "(
            solver: (integrator: ExplicitEuler, substeps: Fixed(1)),
            particles: [(position: (5, 5, 5), mass: 1, pinned: true)],
            nets: [Rope(from: (0, 0, 0), to: (0, -1, 0), segments: 1, linear_density: 1e-3,
                        stretch_stiffness: 1e7, pinned: [0])],
        )",
    );
    let output = place.run(&["--ticks", "100", "--csv", "states.csv"]);
    assert_eq!(status(&output), 1, "{}", errors(&output));
    let message = errors(&output);
    let tick =
        message.trim_end().rsplit_once("particle 2 (nets[0], its particle 1) became non-finite in tick ");
    assert!(tick.is_some_and(|(_, tick)| (2..100).contains(&tick.parse::<u64>().unwrap())), "{message}");
}

#[test]
fn shipped_scenes_of_nets_run_and_stay_finite() {
    // The numbers of particles and springs at the start, and the largest stretch that is plausible.
    for (scene, particles, springs, most) in [
        ("rope", 32, 31, 0.1),
        ("flag", 176, 11 * 15 + 16 * 10 + 2 * 150, 0.2),
        ("jelly", 216, 1440, 0.4),
        ("balloon", 163, 481, 0.2),
    ] {
        let place = Workplace::with_scene(&shipped(scene));
        let summary = place.summary(&["--ticks", "40"]);
        assert_eq!(summary["finite"], true, "{scene}");
        assert_eq!(
            (&summary["particles"], &summary["springs"]),
            (&particles.into(), &springs.into()),
            "{scene}"
        );
        assert_eq!((&summary["nets"], &summary["broken"]), (&1.into(), &0.into()), "{scene}");
        let stretch = summary["max_stretch"].as_f64().unwrap();
        assert!(stretch < most, "{scene}: stretched by {stretch}");
        assert!(summary["max_depth"].as_f64().unwrap() < 1e-3, "{scene}: {summary}");
    }
}

#[test]
fn the_shipped_tear_tears_in_the_same_way_on_any_number_of_threads() {
    let place = Workplace::with_scene(&shipped("tear"));
    let run = |threads: &str| place.summary(&["--ticks", "36", "--threads", threads, "--csv", "states.csv"]);
    let summary = run("1");
    assert!(summary["broken"].as_u64() > Some(0), "{summary}");
    assert_eq!(summary["finite"], true);
    assert_eq!(summary["state_hash"], run("2")["state_hash"]);
    // Split particles come after all others, which keep their numbers.
    let states = rows(&fs::read_to_string(place.path("states.csv")).unwrap());
    let last = states.iter().filter(|row| row.tick == 36).count();
    assert_eq!(summary["particles"], last);
    assert!(last > 1 + 13 * 13, "{last}");
}
