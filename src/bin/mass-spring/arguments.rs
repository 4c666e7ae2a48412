//! The arguments of the command line.

use std::path::{Path, PathBuf};

use bevy_mass_spring::scene::{MassSpringScene, SceneSolver};
use bevy_mass_spring::settings::UnknownIntegrator;
use bevy_mass_spring::{Integrator, SubstepMode};
use clap::{Args, Parser};

use crate::Failure;

/// The simulated time when neither --duration nor --ticks is given, s.
const DEFAULT_DURATION: f64 = 10.0;

/// Maximum simulated time in s: beyond it the operating system's clock, on which Bevy's is built, overflows.
const MAX_TIME: f64 = 1e18;

const EXIT_STATUS: &str = "\
Exit status: 0 done, and the simulation stayed finite; 1 it did not; 2 bad arguments or a scene that is refused, \
and nothing was written; 3 an output could not be written to the end.";

/// Runs mass-spring scenes without a window, and checks them.
#[derive(Debug, Parser)]
#[command(name = "mass-spring", version, after_help = EXIT_STATUS)]
pub enum Command {
    /// Simulate a scene as fast as possible, and write the results.
    Run(RunArguments),
    /// Validate a scene, and say how it would be simulated.
    Check(CheckArguments),
}

/// The arguments of `check`.
#[derive(Debug, Args)]
pub struct CheckArguments {
    /// The scene file, *.scene.ron
    pub scene: PathBuf,
}

/// The arguments of `run`.
#[derive(Debug, Args)]
#[command(after_help = EXIT_STATUS)]
pub struct RunArguments {
    /// The scene file, *.scene.ron
    pub scene: PathBuf,
    /// Simulated time in s, rounded up to whole ticks [default: 10]
    #[arg(long, value_name = "SECONDS", conflicts_with = "ticks", allow_negative_numbers = true)]
    #[arg(value_parser = parse_duration)]
    duration: Option<f64>,
    /// Number of fixed ticks
    #[arg(long, value_name = "N")]
    ticks: Option<u64>,
    /// Write every N-th tick into the CSV
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..))]
    pub every: u64,
    /// Write the state of every particle into FILE as CSV; - is stdout
    #[arg(long, value_name = "FILE")]
    pub csv: Option<PathBuf>,
    /// Write the summary into FILE as JSON; - is stdout, the default unless --csv is -
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Integration scheme instead of the scene's: Auto, SemiImplicitEuler, VelocityVerlet, …
    #[arg(long, value_name = "NAME", value_parser = parse_integrator)]
    integrator: Option<Integrator>,
    /// Substeps of a tick instead of the scene's
    #[arg(long, value_name = "N|auto", value_parser = parse_substeps)]
    substeps: Option<SubstepMode>,
    /// Time step of a tick in s instead of the scene's
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, value_parser = parse_time_step)]
    time_step: Option<f64>,
    /// Threads that compute [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
}

impl RunArguments {
    /// The scene, with the settings that the arguments replace.
    pub fn read_scene(&self) -> Result<MassSpringScene, Failure> {
        let mut scene = read_scene(&self.scene)?;
        let solver = &mut scene.solver;
        solver.integrator = self.integrator.unwrap_or(solver.integrator);
        solver.substeps = self.substeps.unwrap_or(solver.substeps);
        solver.time_step = self.time_step.unwrap_or(solver.time_step);
        Ok(scene)
    }

    /// How many ticks of `time_step` seconds to run.
    pub fn tick_count(&self, time_step: f64) -> Result<u64, Failure> {
        // As a number without an upper limit, so that what is too long is refused, not cut.
        let wanted = self.ticks.map_or_else(
            || {
                let duration = self.duration.unwrap_or(DEFAULT_DURATION);
                // The small term absorbs the rounding of a duration that is a whole number of ticks.
                (duration / time_step - 1e-9).ceil()
            },
            |ticks| ticks as f64,
        );
        if wanted >= u64::MAX as f64 || (wanted + 1.0) * time_step > MAX_TIME {
            return Err(Failure::Refused(format!(
                "{wanted:.0} ticks of {time_step} s are too long, expected at most {MAX_TIME:e} s in all"
            )));
        }
        Ok(self.ticks.unwrap_or(wanted as u64))
    }
}

/// Reads and validates a scene file.
pub fn read_scene(path: &Path) -> Result<MassSpringScene, Failure> {
    MassSpringScene::read(path).map_err(|error| Failure::Refused(error.to_string()))
}

fn parse_duration(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if seconds.is_finite() && seconds > 0.0 => Ok(seconds),
        _ => Err("expected a finite number of seconds > 0".to_owned()),
    }
}

fn parse_time_step(text: &str) -> Result<f64, String> {
    let time_step = text.parse::<f64>().map_err(|_| "expected a number of seconds".to_owned())?;
    let solver = SceneSolver { time_step, ..Default::default() };
    solver.tick().map_err(|invalid| format!("expected {}", invalid.expected))?;
    Ok(time_step)
}

fn parse_integrator(text: &str) -> Result<Integrator, String> {
    text.parse().map_err(|unknown: UnknownIntegrator| unknown.to_string())
}

fn parse_substeps(text: &str) -> Result<SubstepMode, String> {
    if text.eq_ignore_ascii_case("auto") {
        return Ok(SubstepMode::Auto);
    }
    match text.parse() {
        Ok(count) if count >= 1 => Ok(SubstepMode::Fixed(count)),
        _ => Err("expected a whole number >= 1, or auto".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ticks(arguments: &[&str], time_step: f64) -> Result<u64, Failure> {
        let command = ["mass-spring", "run", "scene.ron"].iter().chain(arguments);
        match Command::try_parse_from(command).unwrap() {
            Command::Run(arguments) => arguments.tick_count(time_step),
            Command::Check(_) => unreachable!(),
        }
    }

    #[test]
    fn a_duration_is_rounded_up_to_whole_ticks() {
        let sixtieth = 1.0 / 60.0;
        assert_eq!(ticks(&[], sixtieth).unwrap(), 600);
        assert_eq!(ticks(&["--duration", "0.1"], 0.1).unwrap(), 1);
        assert_eq!(ticks(&["--duration", "0.3"], 0.1).unwrap(), 3, "0.3 / 0.1 is a little less than 3");
        assert_eq!(ticks(&["--duration", "0.7"], 0.1).unwrap(), 7, "0.7 / 0.1 is a little less than 7");
        assert_eq!(ticks(&["--duration", "1.0001"], 0.1).unwrap(), 11);
        assert_eq!(ticks(&["--ticks", "7"], sixtieth).unwrap(), 7);
        assert_eq!(ticks(&["--ticks", "0"], sixtieth).unwrap(), 0);
    }

    #[test]
    fn more_time_than_a_clock_counts_is_refused() {
        assert!(ticks(&["--duration", "1e300"], 0.1).is_err());
        assert!(ticks(&["--duration", "1e17"], 1e-9).is_err());
        assert!(ticks(&["--ticks", "3"], 1e18).is_err());
    }
}
