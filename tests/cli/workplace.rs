//! A folder to run the command line in, and a reader of its CSV.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;

/// A folder with a scene in it, where the command line runs.
pub struct Workplace {
    folder: TempDir,
}

impl Workplace {
    pub fn with_scene(text: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("a.scene.ron"), text).unwrap();
        Self { folder }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_mass-spring"));
        command.current_dir(self.folder.path()).args(arguments);
        command
    }

    /// `mass-spring run a.scene.ron` with more arguments.
    pub fn run(&self, arguments: &[&str]) -> Output {
        self.command(&["run", "a.scene.ron"]).args(arguments).output().unwrap()
    }

    /// The summary that such a run prints on stdout.
    pub fn summary(&self, arguments: &[&str]) -> Value {
        let output = self.run(arguments);
        assert_eq!(status(&output), 0, "{}", errors(&output));
        serde_json::from_slice(&output.stdout).unwrap()
    }

    /// Runs, expects a refusal that leaves nothing behind, and returns what it says.
    pub fn refusal(&self, arguments: &[&str]) -> String {
        let before = self.files();
        let output = self.command(arguments).output().unwrap();
        let errors = errors(&output);
        assert_eq!(status(&output), 2, "{arguments:?}: {errors}");
        assert!(output.stdout.is_empty(), "{arguments:?} wrote to stdout");
        assert!(!errors.is_empty(), "{arguments:?} said nothing");
        assert_eq!(self.files(), before, "{arguments:?} wrote files");
        errors
    }

    pub fn files(&self) -> Vec<(PathBuf, Vec<u8>)> {
        let entries = fs::read_dir(self.folder.path()).unwrap().map(|entry| entry.unwrap().path());
        let mut files: Vec<_> =
            entries.map(|path| (path.clone(), fs::read(&path).unwrap_or_default())).collect();
        files.sort();
        files
    }
}

pub fn status(output: &Output) -> i32 {
    output.status.code().expect("not killed by a signal")
}

pub fn errors(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

pub fn shipped(name: &str) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes");
    fs::read_to_string(folder.join(format!("{name}.scene.ron"))).unwrap()
}

/// A row of the CSV.
#[derive(Debug, PartialEq)]
pub struct Row {
    pub tick: u64,
    pub time: f64,
    pub particle: usize,
    pub state: [f32; 6],
}

pub fn rows(csv: &str) -> Vec<Row> {
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
