//! Smooth motion between ticks, by `bevy_transform_interpolation`.

use bevy::app::RunFixedMainLoopSystems;
use bevy::input::InputPlugin;
use bevy::prelude::*;
use bevy_transform_interpolation::prelude::*;
use bevy_transform_interpolation::{TransformEasingPlugin, reset_easing_states_on_transform_change};

use crate::collider::ColliderMotion;
use crate::particle::Particle;
use crate::sync::keep_untouched;
use crate::time_control::grant_single_steps;

/// Eases the `Transform` of each particle and of each collider with a [`ColliderMotion`], and the mesh of each net (feature
/// `render`), between the last two ticks while a frame is drawn.
///
/// Colliders that the game moves in `FixedUpdate` are eased with `TransformInterpolation` of
/// `bevy_transform_interpolation` on their entities; those that it moves in `Update` need nothing. What the game writes of an
/// eased `Transform` between ticks (the translation, the rotation) holds, and the rest of it goes on being eased.
/// The simulation sees where things are at the end of the last tick, never where they are drawn.
///
/// It acts in apps that have Bevy's [`InputPlugin`], which is part of `DefaultPlugins` (added before or
/// after this plugin), and does nothing in others, which are taken to be headless.
/// [`MassSpringPlugin`](crate::MassSpringPlugin) adds it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct MassSpringInterpolationPlugin {
    /// Whether it also acts in apps without [`InputPlugin`]. Default false.
    pub headless: bool,
}

impl Plugin for MassSpringInterpolationPlugin {
    fn build(&self, _app: &mut App) {}

    fn finish(&self, app: &mut App) {
        if self.headless || app.is_plugin_added::<InputPlugin>() {
            interpolate(app);
            #[cfg(feature = "render")]
            crate::render::easing::ease_nets(app);
        }
    }
}

fn interpolate(app: &mut App) {
    if !app.is_plugin_added::<TransformInterpolationPlugin>() {
        app.add_plugins(TransformInterpolationPlugin::default());
    }
    // The plugin above adds it when it finishes, which Bevy does not call for plugins added by now.
    if !app.is_plugin_added::<TransformEasingPlugin>() {
        app.add_plugins(TransformEasingPlugin);
    }
    app.add_systems(
        RunFixedMainLoop,
        keep_untouched
            .in_set(RunFixedMainLoopSystems::BeforeFixedMainLoop)
            // It computes what was drawn from the overstep, to which a single step adds.
            .before(grant_single_steps)
            .before(reset_easing_states_on_transform_change),
    );
    require::<Particle, TranslationInterpolation>(app);
    require::<ColliderMotion, TranslationInterpolation>(app);
    require::<ColliderMotion, RotationInterpolation>(app);
}

/// Gives each entity with a `T` a component, which stays where it has one.
fn require<T: Component, Required: Component + Default>(app: &mut App) {
    if app.try_register_required_components::<T, Required>().is_ok() {
        return;
    }
    // There are such entities already: what is required of them cannot be changed any more.
    let world = app.world_mut();
    let existing: Vec<Entity> = world.query_filtered::<Entity, With<T>>().iter(world).collect();
    for entity in existing {
        world.entity_mut(entity).insert(Required::default());
    }
    app.add_observer(|added: On<Add, T>, mut commands: Commands| {
        commands.entity(added.entity).try_insert(Required::default());
    });
}
