//! The command line.

use std::path::PathBuf;

use clap::Parser;

/// A chain of balls joined by damped springs, to be dragged with the mouse.
#[derive(Parser, Debug)]
#[command(name = "chain")]
pub struct Arguments {
    /// Opens a scene file (`*.scene.ron`) instead of the chain
    #[arg(long, value_name = "FILE")]
    pub scene: Option<PathBuf>,

    /// Simulates this many seconds without a window and prints a summary
    #[arg(long, value_name = "SECONDS", value_parser = seconds, conflicts_with = "screenshot")]
    pub headless: Option<f64>,

    /// Runs at once, saves a picture (PNG) of the window, and exits
    #[arg(long, value_name = "FILE")]
    pub screenshot: Option<PathBuf>,

    /// The simulated time at which the picture is taken
    #[arg(long, value_name = "SECONDS", value_parser = seconds, default_value = "2", requires = "screenshot")]
    pub at: f64,
}

fn seconds(text: &str) -> Result<f64, String> {
    let seconds: f64 = text.parse().map_err(|_| "expected a number of seconds".to_owned())?;
    if (0.0..=1e6).contains(&seconds) { Ok(seconds) } else { Err("expected 0 to 1e6 seconds".to_owned()) }
}
