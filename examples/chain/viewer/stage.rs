//! Camera, light, and where on the screen the scene is drawn.

use bevy::camera::Hdr;
use bevy::light::{CascadeShadowConfigBuilder, DirectionalLightShadowMap, GlobalAmbientLight};
use bevy::prelude::*;
use bevy_egui::EguiGlobalSettings;
use bevy_egui::input::EguiWantsInput;
use bevy_mass_spring::drag::ParticleDrag;
use bevy_mass_spring::panel::MassSpringPanel;
use bevy_panorbit_camera::{PanOrbitCamera, PanOrbitCameraPlugin, PanOrbitCameraSystemSet};

use super::overlay::BAR_HEIGHT;
use super::panel_view::{set_viewport, spawn_panel_camera};
use super::{Bounds, OpenScene};

/// The colour of the distance.
pub const BACKGROUND: Color = Color::srgb(0.70, 0.77, 0.84);

/// Adds the stage.
pub fn plugin(app: &mut App) {
    // The panel has a camera of its own, so that the scene's can be limited to what the panel leaves free.
    app.world_mut().resource_mut::<EguiGlobalSettings>().auto_create_primary_context = false;
    app.add_plugins(PanOrbitCameraPlugin)
        .insert_resource(ClearColor(BACKGROUND))
        .insert_resource(GlobalAmbientLight { brightness: 450.0, ..default() })
        .insert_resource(DirectionalLightShadowMap { size: 2048 })
        .add_systems(Startup, (spawn_camera, spawn_panel_camera, spawn_light))
        .add_systems(Update, (frame_scene.run_if(resource_changed::<OpenScene>), fit_viewport))
        .add_systems(PostUpdate, yield_pointer.before(PanOrbitCameraSystemSet));
}

fn spawn_camera(mut commands: Commands) {
    commands.spawn((
        Camera3d::default(),
        Msaa::Sample4,
        // Fog and clear colour meet at the horizon only if both are tone-mapped, after all is drawn.
        Hdr,
        Transform::from_xyz(0.0, 1.5, 6.0),
        PanOrbitCamera {
            focus: Vec3::new(0.0, 1.5, 0.0),
            yaw: Some(0.3),
            pitch: Some(0.12),
            radius: Some(6.0),
            pitch_lower_limit: Some(-0.05),
            zoom_lower_limit: 0.3,
            zoom_upper_limit: Some(80.0),
            use_real_time: true,
            ..default()
        },
        DistanceFog {
            color: BACKGROUND,
            falloff: FogFalloff::Linear { start: 14.0, end: 42.0 },
            ..default()
        },
    ));
}

fn spawn_light(mut commands: Commands) {
    // One cascade is sharp enough over these few metres, and software renderers draw it in half the time.
    let cascades = CascadeShadowConfigBuilder { num_cascades: 1, maximum_distance: 16.0, ..default() };
    commands.spawn((
        DirectionalLight { illuminance: 9_000.0, shadow_maps_enabled: true, ..default() },
        cascades.build(),
        Transform::from_xyz(3.0, 7.0, 4.5).looking_at(Vec3::ZERO, Vec3::Y),
    ));
}

/// Points the camera at a scene that was opened, from as far as it needs to see it and the ground.
fn frame_scene(scene: Res<OpenScene>, mut camera: Single<&mut PanOrbitCamera>) {
    let Bounds { middle, radius, top } = scene.bounds;
    let top = (1.13 * top).max(1.0); // with some air above
    let focus = Vec3::new(middle.x, 0.49 * top, middle.z);
    let distance = (1.33 * top).max(2.4 * radius).max(2.0);
    (camera.focus, camera.target_focus) = (focus, focus);
    (camera.radius, camera.target_radius) = (Some(distance), distance);
    camera.force_update = true;
}

/// Draws the scene where panel and bar leave the window free.
fn fit_viewport(
    panel: Res<MassSpringPanel>,
    window: Single<&Window>,
    mut camera: Single<&mut Camera, With<PanOrbitCamera>>,
) {
    let Some(free) = panel.free_area else { return };
    let free = Rect { max: free.max - Vec2::new(0.0, BAR_HEIGHT), ..free };
    set_viewport(&mut camera, &window, free);
}

/// Keeps the camera still while the pointer or Ctrl is used otherwise.
fn yield_pointer(
    wants: Res<EguiWantsInput>,
    drag: Res<ParticleDrag>,
    keys: Res<ButtonInput<KeyCode>>,
    mut camera: Single<&mut PanOrbitCamera>,
) {
    let ctrl = keys.any_pressed([KeyCode::ControlLeft, KeyCode::ControlRight]);
    let enabled = !wants.wants_any_pointer_input() && drag.dragged.is_none() && !ctrl;
    if camera.enabled != enabled {
        camera.enabled = enabled;
    }
}
