//! Smooth motion between ticks, by `bevy_transform_interpolation`.

use bevy::input::InputPlugin;
use bevy::prelude::*;
use bevy_transform_interpolation::TransformEasingPlugin;
use bevy_transform_interpolation::prelude::*;

use crate::particle::Particle;

/// Eases the `Transform` of each particle, and the mesh of each net (feature `render`), between the last two ticks while
/// a frame is drawn.
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
            interpolate_particles(app);
            #[cfg(feature = "render")]
            crate::render::easing::ease_nets(app);
        }
    }
}

fn interpolate_particles(app: &mut App) {
    if !app.is_plugin_added::<TransformInterpolationPlugin>() {
        app.add_plugins(TransformInterpolationPlugin::default());
    }
    // The plugin above adds it when it finishes, which Bevy does not call for plugins added by now.
    if !app.is_plugin_added::<TransformEasingPlugin>() {
        app.add_plugins(TransformEasingPlugin);
    }
    if app.try_register_required_components::<Particle, TranslationInterpolation>().is_ok() {
        return;
    }
    // There are particles already: what is required of them cannot be changed any more.
    let world = app.world_mut();
    let existing: Vec<Entity> = world.query_filtered::<Entity, With<Particle>>().iter(world).collect();
    for particle in existing {
        world.entity_mut(particle).insert(TranslationInterpolation);
    }
    app.add_observer(|added: On<Add, Particle>, mut commands: Commands| {
        commands.entity(added.entity).try_insert(TranslationInterpolation);
    });
}
