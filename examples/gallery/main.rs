//! The gallery: ropes, cloths, jellies and balloons, each with its parameters live and a sentence that says what to
//! look at.
//!
//! ```text
//! cargo run --release --features viewer --example gallery
//! cargo run --release --features viewer --example gallery -- --help
//! ```
//!
//! Page up and Page down (or the list in the panel) change the exhibit, Enter pauses, Home restarts it.

#[path = "../chain/capture.rs"]
mod capture;
#[path = "../chain/display.rs"]
mod display;
mod exhibits;
mod gallery;
#[path = "../chain/viewer/panel_view.rs"]
mod panel_view;
mod stage;

use std::path::PathBuf;
use std::process::ExitCode;

use bevy::gltf::GltfPlugin;
use bevy::log::LogPlugin;
use bevy::prelude::*;
use bevy::render::RenderPlugin;
use bevy_mass_spring::gltf::ATTRIBUTE_PIN;
use bevy_mass_spring::prelude::*;
use clap::Parser;

/// Ropes, cloths, jellies and balloons to look at and to play with.
#[derive(Parser, Debug)]
#[command(name = "gallery")]
struct Arguments {
    /// The exhibit that is shown first: its number, from 1
    #[arg(long, value_name = "NUMBER", default_value = "1")]
    exhibit: usize,

    /// Turns the camera about the exhibit by this many degrees
    #[arg(long, value_name = "DEGREES", default_value = "0", allow_negative_numbers = true)]
    turn: f32,

    /// Saves a picture (PNG) of the window, and exits
    #[arg(long, value_name = "FILE")]
    screenshot: Option<PathBuf>,

    /// The simulated time at which the picture is taken, s
    #[arg(long, value_name = "SECONDS", default_value = "2", requires = "screenshot")]
    at: f64,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    if let Err(reason) = display::check() {
        eprintln!("{reason}");
        return ExitCode::FAILURE;
    }
    display::explain_missing_hardware();
    match run(arguments) {
        AppExit::Success => ExitCode::SUCCESS,
        AppExit::Error(code) => ExitCode::from(code.get()),
    }
}

fn run(arguments: Arguments) -> AppExit {
    let window = Window {
        title: "Gallery – bevy_mass_spring".to_owned(),
        resolution: (1280, 800).into(),
        ..default()
    };
    let default_plugins = DefaultPlugins
        .set(WindowPlugin { primary_window: Some(window), ..default() })
        .set(GltfPlugin::default().add_custom_vertex_attribute("PIN", ATTRIBUTE_PIN))
        .set(LogPlugin { filter: "warn,wgpu=error,naga=error".to_owned(), ..default() })
        .set(RenderPlugin { synchronous_pipeline_compilation: arguments.screenshot.is_some(), ..default() });
    let mut app = App::new();
    app.add_plugins(default_plugins)
        .add_plugins(MassSpringPlugins::default())
        .add_plugins((stage::plugin, gallery::plugin, exhibits::plugin))
        .insert_resource(gallery::Shown::first(arguments.exhibit.saturating_sub(1)))
        .insert_resource(stage::Turn(arguments.turn.to_radians()));
    if let Some(file) = arguments.screenshot {
        app.insert_resource(capture::Capture::new(file, arguments.at)).add_plugins(capture::plugin);
    }
    app.run()
}
