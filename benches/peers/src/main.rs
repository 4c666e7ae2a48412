//! This plugin and its peers, side by side: the same ropes and cloths, speed at equal error.
//!
//! `cargo run --release`, or with words that must occur in the name of the scene or the peer:
//! `cargo run --release -- "rope of 100" avian`. README.md says how to read the tables.

mod measure;
mod peers;
mod reference;
mod scene;

use std::io::Write;
use std::process::{Command, ExitCode, Stdio};
use std::time::{Duration, Instant};

use peers::Entry;
use scene::Scene;

/// The first argument of the process that measures a single row.
const ROW: &str = "--row";
/// Maximum time of a row.
const TIME_LIMIT: Duration = Duration::from_secs(300);

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let done = match arguments.as_slice() {
        [flag, scene, peer] if flag == ROW => print_row(scene, peer),
        words => print_tables(words),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

/// The tables of all scenes and peers that have each of `words` in one of their names.
fn print_tables(words: &[String]) -> std::io::Result<()> {
    let entries = peers::all();
    for scene in Scene::all() {
        let is_wanted =
            |entry: &&Entry| words.iter().all(|word| scene.name.contains(word) || entry.name.contains(word));
        let wanted: Vec<&Entry> = entries.iter().filter(is_wanted).collect();
        if wanted.is_empty() {
            continue;
        }
        // Here, so that its time is no row's.
        reference::positions(&scene)?;
        println!("\n### {} ({} springs)\n", scene.name, scene.springs.len());
        println!(
            "| peer | substeps | ms a tick, least | median | ns a spring and substep | RMS error at 1 s, m |"
        );
        println!("| --- | --: | --: | --: | --: | --: |");
        for entry in wanted {
            println!("{}", row_of_own_process(&scene, entry)?);
        }
    }
    Ok(())
}

fn print_row(scene: &str, peer: &str) -> std::io::Result<()> {
    let (scenes, entries) = (Scene::all(), peers::all());
    let scene = scenes.iter().find(|known| known.name == scene);
    let entry = entries.iter().find(|known| known.name == peer);
    let (Some(scene), Some(entry)) = (scene, entry) else {
        return Err(std::io::Error::other("no such scene or peer"));
    };
    write!(std::io::stdout(), "{}", measure::row(scene, entry)?)
}

/// Each row is measured in a process of its own: no peer shares another's heap and threads, and one
/// that panics or hangs does not stop the rest.
fn row_of_own_process(scene: &Scene, entry: &Entry) -> std::io::Result<String> {
    let mut process = Command::new(std::env::current_exe()?)
        .args([ROW, scene.name, &entry.name])
        .stdout(Stdio::piped())
        .spawn()?;
    let start = Instant::now();
    while process.try_wait()?.is_none() {
        if start.elapsed() > TIME_LIMIT {
            process.kill()?;
            process.wait()?;
            return Ok(format!(
                "| {} | – | – | – | – | given up after {} s |",
                entry.name,
                TIME_LIMIT.as_secs()
            ));
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    let output = process.wait_with_output()?;
    if output.status.success() {
        Ok(String::from_utf8_lossy(&output.stdout).into_owned())
    } else {
        Ok(format!("| {} | – | – | – | – | failed: {} |", entry.name, output.status))
    }
}
