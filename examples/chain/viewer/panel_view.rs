//! A scene beside the panel: the panel has a camera of its own, and the scene's draws where it leaves the window free.

use bevy::camera::visibility::RenderLayers;
use bevy::camera::{CameraOutputMode, Viewport};
use bevy::prelude::*;
use bevy::render::render_resource::BlendState;
use bevy_egui::PrimaryEguiContext;

/// Spawns the camera of the panel. bevy_egui must not create its primary context by itself.
pub fn spawn_panel_camera(mut commands: Commands) {
    commands.spawn((
        PrimaryEguiContext,
        Camera2d,
        Msaa::Off,
        RenderLayers::none(),
        Camera {
            order: 1,
            output_mode: CameraOutputMode::Write {
                blend_state: Some(BlendState::ALPHA_BLENDING),
                clear_color: ClearColorConfig::None,
            },
            clear_color: ClearColorConfig::Custom(Color::NONE),
            ..default()
        },
    ));
}

/// Has a camera draw in the part `free` of the window, in logical pixels.
pub fn set_viewport(camera: &mut Mut<Camera>, window: &Window, free: Rect) {
    let scale = window.scale_factor();
    let (position, size) = ((free.min * scale).as_uvec2(), (free.size() * scale).as_uvec2());
    let fits = (position + size).cmple(window.physical_size()).all();
    // A window too small for the panel has no scene left to draw: it is drawn under the panel then.
    let viewport = (fits && size.min_element() > 0).then_some((position, size));
    let present = camera.viewport.as_ref().map(|old| (old.physical_position, old.physical_size));
    if present != viewport {
        camera.viewport = viewport.map(|(physical_position, physical_size)| Viewport {
            physical_position,
            physical_size,
            ..default()
        });
    }
}
