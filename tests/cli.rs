//! The command line, run as a process: what it writes, what it refuses, and with which exit status.

use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use serde_json::Value;
use tempfile::TempDir;

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

const KEYS: [&str; 18] = [
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
];

/// A folder with a scene in it, where the command line runs.
struct Workplace {
    folder: TempDir,
}

impl Workplace {
    fn with_scene(text: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("a.scene.ron"), text).unwrap();
        Self { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_mass-spring"));
        command.current_dir(self.folder.path()).args(arguments);
        command
    }

    /// `mass-spring run a.scene.ron` with more arguments.
    fn run(&self, arguments: &[&str]) -> Output {
        self.command(&["run", "a.scene.ron"]).args(arguments).output().unwrap()
    }

    /// The summary that such a run prints on stdout.
    fn summary(&self, arguments: &[&str]) -> Value {
        let output = self.run(arguments);
        assert_eq!(status(&output), 0, "{}", errors(&output));
        serde_json::from_slice(&output.stdout).unwrap()
    }

    /// Runs, expects a refusal that leaves nothing behind, and returns what it says.
    fn refusal(&self, arguments: &[&str]) -> String {
        let before = self.files();
        let output = self.command(arguments).output().unwrap();
        let errors = errors(&output);
        assert_eq!(status(&output), 2, "{arguments:?}: {errors}");
        assert!(output.stdout.is_empty(), "{arguments:?} wrote to stdout");
        assert!(!errors.is_empty(), "{arguments:?} said nothing");
        assert_eq!(self.files(), before, "{arguments:?} wrote files");
        errors
    }

    fn files(&self) -> Vec<(PathBuf, Vec<u8>)> {
        let entries = fs::read_dir(self.folder.path()).unwrap().map(|entry| entry.unwrap().path());
        let mut files: Vec<_> =
            entries.map(|path| (path.clone(), fs::read(&path).unwrap_or_default())).collect();
        files.sort();
        files
    }
}

fn status(output: &Output) -> i32 {
    output.status.code().expect("not killed by a signal")
}

fn errors(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

fn shipped(name: &str) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes");
    fs::read_to_string(folder.join(format!("{name}.scene.ron"))).unwrap()
}

/// A row of the CSV.
#[derive(Debug, PartialEq)]
struct Row {
    tick: u64,
    time: f64,
    particle: usize,
    state: [f32; 6],
}

fn rows(csv: &str) -> Vec<Row> {
    let mut lines = csv.lines();
    assert_eq!(lines.next(), Some("tick,time,particle,x,y,z,vx,vy,vz"));
    let row = |line: &str| {
        let fields: Vec<&str> = line.split(',').collect();
        let [tick, time, particle, state @ ..] = &fields[..] else { panic!("{line}") };
        let state: Vec<f32> = state.iter().map(|number| number.parse().unwrap()).collect();
        Row {
            tick: tick.parse().unwrap(),
            time: time.parse().unwrap(),
            particle: particle.parse().unwrap(),
            state: state.try_into().unwrap(),
        }
    };
    lines.map(row).collect()
}

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
    assert_eq!(summary["integrator"], "SemiImplicitEuler");
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
    // Both into files, one of which is longer than what comes.
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
fn a_reader_that_goes_away_is_no_panic() {
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
fn bad_arguments_are_refused() {
    let place = Workplace::with_scene(&shipped("pendulum"));
    for (arguments, expected) in [
        (&["--duration", "-1"][..], "expected a finite number of seconds > 0"),
        (&["--duration", "0"], "expected a finite number of seconds > 0"),
        (&["--duration", "NaN"], "expected a finite number of seconds > 0"),
        (&["--duration", "inf"], "expected a finite number of seconds > 0"),
        (&["--duration", "1e300"], "too long"),
        (&["--time-step", "0"], "expected a finite number of seconds > 0"),
        (&["--time-step", "-0.1"], "expected a finite number of seconds > 0"),
        (&["--time-step", "nan"], "expected a finite number of seconds > 0"),
        (&["--time-step", "1e-12"], "clock"),
        (&["--duration", "1", "--ticks", "1"], "cannot be used with"),
        (&["--ticks", "-1"], "-1"),
        (&["--ticks", "1.5"], "1.5"),
        (&["--every", "0"], "every"),
        (&["--threads", "0"], "threads"),
        (&["--substeps", "0"], "expected a whole number >= 1, or auto"),
        (&["--substeps", "few"], "expected a whole number >= 1, or auto"),
        (&["--integrator", "Leapfrog"], "VelocityVerlet"),
        (&["--integrator", "ImplicitEuler"], "not available in this version"),
        (&["--integrator", "Xpbd"], "not available in this version"),
        (&["--csv", "-", "--json", "-"], "both"),
        (&["--csv", "same", "--json", "same"], "both"),
        (&["--csv", "a.scene.ron"], "overwritten"),
        (&["--csv", "missing/states.csv"], "missing/states.csv"),
        (&["--csv", "states.csv", "--json", "missing/summary.json"], "missing/summary.json"),
        (&["--csv", "."], "cannot write"),
        (&["--frobnicate"], "--frobnicate"),
    ] {
        let arguments = [&["run", "a.scene.ron"], arguments].concat();
        let errors = place.refusal(&arguments);
        assert!(errors.contains(expected), "{arguments:?}: {errors}");
    }
    place.refusal(&[]);
    place.refusal(&["run"]);
    place.refusal(&["check"]);
    place.refusal(&["walk", "a.scene.ron"]);
}

#[test]
fn a_refused_scene_is_named_with_place_and_field() {
    let place = Workplace::with_scene("(particles: [\n  (position: (0, 0, 0), mass: -1),\n])");
    let message = "a.scene.ron:2:31: particles[0].mass is -1.0, expected a finite number > 0";
    for arguments in
        [&["run", "a.scene.ron", "--csv", "b.csv", "--json", "b.json"][..], &["check", "a.scene.ron"]]
    {
        let errors = place.refusal(arguments);
        assert_eq!(errors, format!("error: {message}\n"), "{arguments:?}");
        assert!(
            place.refusal(&[arguments[0], "missing.scene.ron"]).contains("missing.scene.ron: cannot be read")
        );
    }
}

#[test]
fn check_says_how_a_scene_would_run() {
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
Auto would choose       SemiImplicitEuler, 4 substeps a tick
this scene would run    RungeKutta4, 3 substeps a tick
";
    assert_eq!(String::from_utf8(output.stdout).unwrap(), expected);
}

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
    assert_eq!(scheme, "SemiImplicitEuler");
    assert!(automatic >= 4);
    assert_eq!(ran(&["--substeps", "auto"]), (scheme, automatic));
    // What is said before the first tick is what runs.
    let planned = place.summary(&["--ticks", "0"]);
    assert_eq!(
        (&planned["integrator"], &planned["substeps"]),
        (&"SemiImplicitEuler".into(), &automatic.into())
    );
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
    // The scheme that the crate promises to be stable is.
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
