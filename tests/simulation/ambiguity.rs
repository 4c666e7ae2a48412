//! No two systems of the plugin access the same data without an order between them.

use bevy::app::Plugins;
use bevy::ecs::schedule::{LogLevel, ScheduleBuildSettings, ScheduleLabel};
use bevy::prelude::*;
use bevy_mass_spring::prelude::*;

/// Builds the schedule of an app with ambiguities as errors, without running it.
fn check(app: &mut App, label: impl ScheduleLabel) -> Result<(), String> {
    let mut schedule =
        app.world_mut().resource_mut::<Schedules>().remove(label).expect("the schedule has systems");
    schedule.set_build_settings(ScheduleBuildSettings {
        ambiguity_detection: LogLevel::Error,
        ..ScheduleBuildSettings::default()
    });
    let built = schedule.initialize(app.world_mut());
    built.map(|_| ()).map_err(|error| error.to_string(schedule.graph(), app.world()))
}

fn finished<Marker>(plugins: impl Plugins<Marker>) -> App {
    let mut app = App::new();
    app.add_plugins(plugins);
    app.finish();
    app
}

fn app() -> App {
    let mut app = finished((MinimalPlugins, TransformPlugin, MassSpringPlugins::default()));
    app.add_message::<Contact>();
    app
}

#[track_caller]
fn assert_unambiguous(app: &mut App, label: impl ScheduleLabel + Clone) {
    let name = format!("{label:?}");
    if let Err(error) = check(app, label) {
        panic!("{name}: {error}");
    }
}

#[test]
fn the_schedules_of_the_plugin_are_unambiguous() {
    let mut app = app();
    assert_unambiguous(&mut app, FixedPostUpdate);
    assert_unambiguous(&mut app, RunFixedMainLoop);
}

#[test]
fn another_schedule_is_unambiguous_too() {
    let mut app = finished((MinimalPlugins, MassSpringPlugins::new(FixedUpdate)));
    assert_unambiguous(&mut app, FixedUpdate);
}

/// `bevy_transform_interpolation` leaves some of its own systems unordered; the crate adds none to them.
#[cfg(feature = "interpolation")]
#[test]
fn interpolation_adds_no_ambiguity() {
    use bevy_transform_interpolation::prelude::TransformInterpolationPlugin;

    let ours = MassSpringPlugin::default().with_interpolation(true);
    let mut app = finished((MinimalPlugins, ours));
    assert_unambiguous(&mut app, FixedPostUpdate);
    let found = check(&mut app, RunFixedMainLoop).map_err(|error| number_of_pairs(&error));
    let mut theirs = finished((MinimalPlugins, TransformInterpolationPlugin::default()));
    let expected = check(&mut theirs, RunFixedMainLoop).map_err(|error| number_of_pairs(&error));
    assert_eq!(found, expected);
}

/// The number in `RunFixedMainLoop: 4 pairs of systems with conflicting …`.
#[cfg(feature = "interpolation")]
fn number_of_pairs(error: &str) -> usize {
    error.split_whitespace().find_map(|word| word.parse().ok()).expect("the message counts the pairs")
}

/// The check finds what it should: a system of the game that writes forces beside the plugin's, unordered.
#[test]
fn an_unordered_system_is_found() {
    let mut app = app();
    app.add_systems(FixedPostUpdate, |mut forces: Query<&mut AppliedForce>| {
        forces.iter_mut().for_each(|mut force| force.0 = Vec3::Y);
    });
    assert!(check(&mut app, FixedPostUpdate).is_err());
}

/// Ordered by the plugin's sets it is no ambiguity.
#[test]
fn an_ordered_system_is_fine() {
    let mut app = app();
    app.add_systems(
        FixedPostUpdate,
        (|mut forces: Query<&mut AppliedForce>| forces.iter_mut().for_each(|mut force| force.0 = Vec3::Y))
            .before(MassSpringSystems::Gather),
    );
    assert_unambiguous(&mut app, FixedPostUpdate);
}
