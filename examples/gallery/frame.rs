//! The window of a gallery: its arguments, and what all of its exhibits have in common.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use bevy::gltf::GltfPlugin;
use bevy::log::LogPlugin;
use bevy::prelude::*;
use bevy::render::RenderPlugin;
use bevy_egui::egui::{Slider, Ui};
use bevy_mass_spring::gltf::ATTRIBUTE_PIN;
use bevy_mass_spring::prelude::*;
use clap::{CommandFactory, FromArgMatches, Parser};

use crate::{capture, display, gallery, stage, switches};

/// The longest time that a frame simulates.
const MAX_FRAME: Duration = Duration::from_millis(34);

#[derive(Parser, Debug)]
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

/// Shows the exhibits that a plugin adds.
pub fn run(name: &'static str, about: &'static str, exhibits: fn(&mut App)) -> ExitCode {
    let matches = Arguments::command().name(name).about(about).get_matches();
    let arguments = match Arguments::from_arg_matches(&matches) {
        Ok(arguments) => arguments,
        Err(error) => error.exit(),
    };
    let explain = move |reason: &str| format!("{}: {reason}", name.to_lowercase());
    if let Err(reason) = display::check() {
        eprintln!("{}", explain(&reason));
        return ExitCode::FAILURE;
    }
    display::explain_missing_hardware(explain);
    match open(name, arguments, exhibits) {
        AppExit::Success => ExitCode::SUCCESS,
        AppExit::Error(code) => ExitCode::from(code.get()),
    }
}

fn open(name: &str, arguments: Arguments, exhibits: fn(&mut App)) -> AppExit {
    let window =
        Window { title: format!("{name} – bevy_mass_spring"), resolution: (1280, 800).into(), ..default() };
    let default_plugins = DefaultPlugins
        .set(WindowPlugin { primary_window: Some(window), ..default() })
        .set(GltfPlugin::default().add_custom_vertex_attribute("PIN", ATTRIBUTE_PIN))
        .set(LogPlugin { filter: "warn,wgpu=error,naga=error".to_owned(), ..default() })
        .set(RenderPlugin { synchronous_pipeline_compilation: arguments.screenshot.is_some(), ..default() });
    let mut app = App::new();
    app.add_plugins(default_plugins)
        .add_plugins(MassSpringPlugins::default())
        .add_plugins((stage::plugin, switches::plugin, gallery::plugin, exhibits))
        // A machine that is too slow for an exhibit shows it in slow motion.
        .insert_resource(Time::<Virtual>::from_max_delta(MAX_FRAME))
        .insert_resource(gallery::Shown::first(arguments.exhibit.saturating_sub(1)))
        .insert_resource(stage::Turn(arguments.turn.to_radians()));
    if let Some(file) = arguments.screenshot {
        app.insert_resource(capture::Capture::new(file, arguments.at)).add_plugins(capture::plugin);
    }
    app.run()
}

/// A slider for a parameter; whether it was moved.
pub fn slider(
    ui: &mut Ui,
    name: &str,
    unit: &str,
    value: &mut f32,
    range: std::ops::RangeInclusive<f32>,
) -> bool {
    let slider = Slider::new(value, range).suffix(format!(" {unit}")).text(name);
    ui.add(slider).changed()
}

/// A slider over several powers of ten.
pub fn log_slider(
    ui: &mut Ui,
    name: &str,
    unit: &str,
    value: &mut f32,
    range: std::ops::RangeInclusive<f32>,
) -> bool {
    let slider = Slider::new(value, range).logarithmic(true).suffix(format!(" {unit}")).text(name);
    ui.add(slider).changed()
}
