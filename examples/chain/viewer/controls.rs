//! The keys of the lab.

use bevy::prelude::*;
use bevy_mass_spring::panel::RestartWithParameters;
use bevy_mass_spring::prelude::*;

use super::switches;

/// Adds the keys.
pub fn plugin(app: &mut App) {
    app.add_plugins(switches::plugin).add_systems(Update, (control_time, quit));
}

/// Enter starts and pauses, Space makes one step while paused, Home restarts from the
/// initial scene, with the parameters as they are now.
fn control_time(
    keys: Res<ButtonInput<KeyCode>>,
    mut time: ResMut<Time<Virtual>>,
    mut single_step: ResMut<SingleStep>,
    mut commands: Commands,
) {
    if keys.any_just_pressed([KeyCode::Enter, KeyCode::NumpadEnter]) {
        if time.is_paused() { time.unpause() } else { time.pause() }
    }
    if keys.just_pressed(KeyCode::Space) && time.is_paused() {
        single_step.request();
    }
    if keys.just_pressed(KeyCode::Home) {
        commands.queue(RestartWithParameters);
    }
}

fn quit(keys: Res<ButtonInput<KeyCode>>, mut exit: MessageWriter<AppExit>) {
    if keys.just_pressed(KeyCode::Escape) {
        exit.write(AppExit::Success);
    }
}
