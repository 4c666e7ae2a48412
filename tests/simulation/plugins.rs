//! The plugins: each can be disabled, their order does not matter, and all use one schedule.

use bevy::app::PluginGroupBuilder;
use bevy::diagnostic::DiagnosticsStore;
use bevy::ecs::schedule::ScheduleLabel;
use bevy::prelude::*;
use bevy_mass_spring::prelude::*;

use crate::common::*;

fn all() -> PluginGroupBuilder {
    MassSpringPlugins::default().build()
}

/// Whether an app with these plugins has `T`; the physics runs in any case.
fn has<T: Plugin>(plugins: PluginGroupBuilder) -> bool {
    let mut app = app_with(plugins);
    let ball = spawn(&mut app, 1.0, 0.1, Vec3::ZERO);
    run(&mut app, 1);
    assert!(velocity(&app, ball).y < 0.0, "it falls");
    app.is_plugin_added::<T>()
}

#[track_caller]
fn assert_can_be_disabled<T: Plugin>() {
    assert!(has::<T>(all()));
    assert!(!has::<T>(all().disable::<T>()));
}

#[test]
fn each_plugin_can_be_disabled() {
    assert_can_be_disabled::<SingleStepPlugin>();
    assert_can_be_disabled::<MassSpringDiagnosticsPlugin>();
    #[cfg(feature = "scene")]
    assert_can_be_disabled::<MassSpringScenePlugin>();
    #[cfg(feature = "interpolation")]
    assert_can_be_disabled::<MassSpringInterpolationPlugin>();
    #[cfg(feature = "gizmos")]
    assert_can_be_disabled::<MassSpringGizmosPlugin>();
    #[cfg(feature = "drag")]
    assert_can_be_disabled::<ParticleDragPlugin>();
    #[cfg(feature = "panel")]
    assert_can_be_disabled::<MassSpringPanelPlugin>();
}

#[test]
fn the_physics_can_be_disabled() {
    let mut app = app_with(all().disable::<MassSpringPlugin>());
    run(&mut app, 1);
    assert!(!app.world().contains_resource::<TickReport>());
}

#[test]
fn the_plugin_alone_adds_its_companions() {
    let app = app();
    assert!(app.is_plugin_added::<SingleStepPlugin>());
    #[cfg(feature = "scene")]
    assert!(app.is_plugin_added::<MassSpringScenePlugin>());
    assert!(!app.is_plugin_added::<MassSpringDiagnosticsPlugin>());

    let app = app_with(MassSpringPlugin::default().physics_only());
    assert!(!app.is_plugin_added::<SingleStepPlugin>());
}

#[test]
fn companions_may_have_been_added_before() {
    let app = app_with((SingleStepPlugin, MassSpringPlugin::default()));
    assert!(app.world().contains_resource::<SingleStep>());
    // Replaced by one that adds companions: those of the group are added before it.
    let app = app_with(all().set(MassSpringPlugin::new(FixedUpdate)));
    assert!(app.world().contains_resource::<SingleStep>());
}

/// One sample for each tick, in any schedule and order of plugins; none while time is paused.
#[test]
fn diagnostics_are_recorded_in_the_schedule_of_the_physics() {
    fn samples(app: &App) -> Option<usize> {
        let store = app.world().get_resource::<DiagnosticsStore>()?;
        store.get(&MassSpringDiagnosticsPlugin::SUBSTEPS).map(|diagnostic| diagnostic.history_len())
    }
    fn check(schedule: impl ScheduleLabel + Clone) {
        let (first, second) =
            (MassSpringPlugin::new(schedule.clone()), MassSpringPlugin::new(schedule.clone()));
        for mut app in [
            app_with(MassSpringPlugins::new(schedule.clone())),
            app_with((first, MassSpringDiagnosticsPlugin)),
            app_with((MassSpringDiagnosticsPlugin, second)),
        ] {
            let before = samples(&app);
            run(&mut app, 5);
            assert_eq!(samples(&app), before.map(|count| count + 5), "{schedule:?}");
            app.world_mut().resource_mut::<Time<Virtual>>().pause();
            run(&mut app, 5);
            assert_eq!(samples(&app), before.map(|count| count + 5), "{schedule:?}, paused");
        }
    }
    check(FixedPostUpdate);
    check(FixedUpdate);
    check(FixedLast);
    check(Update);
}

#[test]
fn diagnostics_without_physics_do_nothing() {
    let mut app = app_with(MassSpringDiagnosticsPlugin);
    run(&mut app, 2);
    assert_eq!(*app.world().resource::<Measurements>(), Measurements::default());
}

#[cfg(feature = "interpolation")]
mod interpolation {
    use bevy::input::InputPlugin;
    use bevy_transform_interpolation::TransformEasingPlugin;
    use bevy_transform_interpolation::prelude::{TransformInterpolationPlugin, TranslationInterpolation};

    use super::*;

    #[track_caller]
    fn assert_interpolates(mut app: App, expected: bool) {
        let particle = spawn(&mut app, 1.0, 0.1, Vec3::ZERO);
        run(&mut app, 2);
        assert_eq!(app.is_plugin_added::<TransformInterpolationPlugin>(), expected);
        assert_eq!(app.is_plugin_added::<TransformEasingPlugin>(), expected);
        assert_eq!(app.world().entity(particle).contains::<TranslationInterpolation>(), expected);
    }

    #[test]
    fn it_follows_the_input_plugin_in_either_order() {
        assert_interpolates(app_with((InputPlugin, MassSpringPlugin::default())), true);
        assert_interpolates(app_with((MassSpringPlugin::default(), InputPlugin)), true);
        assert_interpolates(app_with((MassSpringPlugins::default(), InputPlugin)), true);
        assert_interpolates(app_with(MassSpringPlugins::default()), false);
    }

    #[test]
    fn it_can_be_forced_and_switched_off() {
        let forced = MassSpringInterpolationPlugin { headless: true };
        assert_interpolates(app_with(all().set(forced)), true);
        assert_interpolates(app_with((forced, MassSpringPlugin::default())), true);
        let off = MassSpringPlugin::default().with_interpolation(false);
        assert_interpolates(app_with((InputPlugin, off)), false);
        let off = all().disable::<MassSpringInterpolationPlugin>();
        assert_interpolates(app_with((InputPlugin, off)), false);
    }

    /// A plugin that the user adds is kept, before or after that of the crate.
    #[test]
    fn the_plugin_of_the_user_is_kept() {
        let own = TransformInterpolationPlugin::default;
        assert_interpolates(app_with((own(), InputPlugin, MassSpringPlugin::default())), true);
        assert_interpolates(app_with((InputPlugin, MassSpringPlugin::default(), own())), true);
    }
}
