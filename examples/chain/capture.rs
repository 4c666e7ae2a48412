//! `--screenshot`: runs to a given moment, saves a picture, exits.

use std::path::PathBuf;

use bevy::prelude::*;
use bevy::render::view::screenshot::{Screenshot, ScreenshotCaptured};
use bevy::time::TimeUpdateStrategy;
use bevy_mass_spring::prelude::*;

/// Frames drawn before the picture is taken, for all assets to reach the graphics card.
const FRAMES_AT_REST: u32 = 8;
/// Ticks in a frame on the way, so that a slow renderer does not take minutes to get there.
const TICKS_IN_A_FRAME: u32 = 16;

/// The picture to be taken, and the progress towards it.
#[derive(Resource)]
pub struct Capture {
    file: PathBuf,
    seconds: f64,
    frames_at_rest: u32,
}

impl Capture {
    /// A picture into `file` when `seconds` have been simulated.
    pub fn new(file: PathBuf, seconds: f64) -> Self {
        Self { file, seconds, frames_at_rest: 0 }
    }
}

/// Runs the simulation tick by tick, whatever the speed of the renderer, and takes the picture.
pub fn plugin(app: &mut App) {
    app.add_systems(PostStartup, start).add_systems(First, advance.before(bevy::time::TimeSystems));
}

fn start(mut time: ResMut<Time<Virtual>>, fixed_time: Res<Time<Fixed>>) {
    time.unpause();
    let frame = fixed_time.timestep() * (TICKS_IN_A_FRAME + 1);
    time.set_max_delta(frame);
}

fn advance(
    mut capture: ResMut<Capture>,
    report: Res<TickReport>,
    fixed_time: Res<Time<Fixed>>,
    mut time: ResMut<Time<Virtual>>,
    mut strategy: ResMut<TimeUpdateStrategy>,
    mut cameras: Query<&mut Camera>,
    mut commands: Commands,
) {
    let wanted = (capture.seconds / fixed_time.timestep().as_secs_f64()).round() as u64;
    let remaining = wanted.saturating_sub(report.tick);
    *strategy = TimeUpdateStrategy::FixedTimesteps(remaining.min(TICKS_IN_A_FRAME.into()) as u32);
    // What is not looked at is not drawn.
    for mut camera in &mut cameras {
        camera.is_active = remaining == 0;
    }
    if remaining > 0 {
        return;
    }
    time.pause();
    capture.frames_at_rest += 1;
    if capture.frames_at_rest == FRAMES_AT_REST {
        commands.spawn(Screenshot::primary_window()).observe(save);
    }
}

fn save(captured: On<ScreenshotCaptured>, capture: Res<Capture>, mut exit: MessageWriter<AppExit>) {
    let saved = captured
        .image
        .clone()
        .try_into_dynamic()
        .map_err(|error| error.to_string())
        .and_then(|picture| picture.to_rgb8().save(&capture.file).map_err(|error| error.to_string()));
    exit.write(match saved {
        Ok(()) => AppExit::Success,
        Err(error) => {
            eprintln!("cannot save {}: {error}", capture.file.display());
            AppExit::error()
        }
    });
}
