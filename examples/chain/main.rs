//! The lab: a chain of balls that the mouse drags about, with every parameter live.
//!
//! ```text
//! cargo run --release --features viewer --example chain
//! cargo run --release --features viewer --example chain -- --help
//! ```

mod arguments;
mod capture;
mod display;
mod headless;
mod viewer;

use std::process::ExitCode;

use bevy::log::LogPlugin;
use bevy::prelude::*;
use bevy::render::RenderPlugin;
use bevy_mass_spring::prelude::*;
use clap::Parser;

use crate::arguments::Arguments;
use crate::viewer::{FirstScene, presets};

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let scene = match &arguments.scene {
        Some(file) => match MassSpringScene::read(file) {
            Ok(scene) => scene,
            Err(error) => return fail(&error.to_string()),
        },
        None => presets::chain_file(),
    };
    if let Some(seconds) = arguments.headless {
        return headless::run(&scene, seconds);
    }
    if let Err(reason) = display::check() {
        return fail(&without_window(&reason));
    }
    display::explain_missing_hardware(without_window);
    match run_window(arguments, scene) {
        AppExit::Success => ExitCode::SUCCESS,
        AppExit::Error(code) => ExitCode::from(code.get()),
    }
}

fn without_window(reason: &str) -> String {
    format!("chain: {reason}; `--headless SECONDS` runs without a window")
}

fn fail(reason: &str) -> ExitCode {
    eprintln!("{reason}");
    ExitCode::FAILURE
}

fn run_window(arguments: Arguments, scene: MassSpringScene) -> AppExit {
    let title = match &arguments.scene {
        Some(file) => file.display().to_string(),
        None => "Chain".to_owned(),
    };
    let window =
        Window {
            title: format!("{title} – bevy_mass_spring"), resolution: (1280, 800).into(), ..default()
        };
    let default_plugins = DefaultPlugins
        .set(WindowPlugin { primary_window: Some(window), ..default() })
        .set(LogPlugin { filter: "warn,wgpu=error,naga=error".to_owned(), ..default() })
        // The picture of `--screenshot` must not lack what is still being compiled.
        .set(RenderPlugin { synchronous_pipeline_compilation: arguments.screenshot.is_some(), ..default() });
    let preset = arguments.scene.is_none().then_some(presets::CHAIN);
    let mut app = App::new();
    app.add_plugins(default_plugins)
        .insert_resource(FirstScene { scene, title, preset })
        .add_plugins(viewer::plugin);
    if let Some(file) = arguments.screenshot {
        app.insert_resource(capture::Capture::new(file, arguments.at)).add_plugins(capture::plugin);
    }
    app.run()
}
