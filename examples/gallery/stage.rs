//! Camera, light, floor, and what exhibits are built with.

use bevy::camera::Hdr;
use bevy::ecs::system::SystemParam;
use bevy::light::{CascadeShadowConfigBuilder, DirectionalLightShadowMap, GlobalAmbientLight};
use bevy::prelude::*;
use bevy_egui::EguiGlobalSettings;
use bevy_egui::input::EguiWantsInput;
use bevy_mass_spring::drag::ParticleDrag;
use bevy_mass_spring::panel::MassSpringPanel;
use bevy_mass_spring::prelude::*;
use bevy_panorbit_camera::{PanOrbitCamera, PanOrbitCameraPlugin, PanOrbitCameraSystemSet};

use crate::panel_view::{set_viewport, spawn_panel_camera};

const BACKGROUND: Color = Color::srgb(0.74, 0.80, 0.87);

/// Where the camera is: what it looks at, m; its distance, m; angles about the vertical and above the horizon, rad.
#[derive(Resource, Debug, Clone, Copy)]
pub struct View {
    /// The point that it looks at, m.
    pub focus: Vec3,
    /// Its distance from there, m.
    pub distance: f32,
    /// About the vertical, rad.
    pub yaw: f32,
    /// Above the horizon, rad.
    pub pitch: f32,
}

/// How far the camera is turned about every exhibit, rad.
#[derive(Resource)]
pub struct Turn(pub f32);

/// What belongs to the exhibit that is shown, and goes with it.
#[derive(Component, Default)]
pub struct OfExhibit;

/// What exhibits are built with.
#[derive(SystemParam)]
pub struct Stage<'w, 's> {
    pub commands: Commands<'w, 's>,
    pub meshes: ResMut<'w, Assets<Mesh>>,
    pub materials: ResMut<'w, Assets<StandardMaterial>>,
}

impl Stage<'_, '_> {
    /// Spawns what belongs to the exhibit.
    pub fn spawn(&mut self, bundle: impl Bundle) -> Entity {
        self.commands.spawn((OfExhibit, bundle)).id()
    }

    /// Paint of a colour, rough as cloth and rope are.
    pub fn paint(&mut self, color: Color) -> MeshMaterial3d<StandardMaterial> {
        let material = StandardMaterial { base_color: color, perceptual_roughness: 0.85, ..default() };
        MeshMaterial3d(self.materials.add(material))
    }

    /// Paint that is lit from both sides.
    pub fn cloth(&mut self, color: Color) -> MeshMaterial3d<StandardMaterial> {
        let material = StandardMaterial {
            base_color: color,
            perceptual_roughness: 0.9,
            double_sided: true,
            cull_mode: None,
            ..default()
        };
        MeshMaterial3d(self.materials.add(material))
    }

    /// Polished metal.
    pub fn metal(&mut self, color: Color) -> MeshMaterial3d<StandardMaterial> {
        let material =
            StandardMaterial { base_color: color, perceptual_roughness: 0.35, metallic: 0.7, ..default() };
        MeshMaterial3d(self.materials.add(material))
    }

    /// Something solid to look at.
    pub fn solid(
        &mut self,
        shape: impl Into<Mesh>,
        material: MeshMaterial3d<StandardMaterial>,
        transform: Transform,
    ) -> Entity {
        let mesh = Mesh3d(self.meshes.add(shape));
        self.spawn((mesh, material, transform))
    }

    /// A floor that particles rest on, y = 0.
    pub fn floor(&mut self) {
        self.spawn(ParticleCollider { restitution: 0.1, friction: 0.6, ..default() });
    }
}

/// Adds the stage.
pub fn plugin(app: &mut App) {
    // The panel has a camera of its own, so that the exhibit's can be limited to what the panel leaves free.
    app.world_mut().resource_mut::<EguiGlobalSettings>().auto_create_primary_context = false;
    app.add_plugins(PanOrbitCameraPlugin)
        .insert_resource(ClearColor(BACKGROUND))
        .insert_resource(GlobalAmbientLight { brightness: 500.0, ..default() })
        .insert_resource(DirectionalLightShadowMap { size: 2048 })
        .add_systems(Startup, (spawn_camera, spawn_panel_camera, spawn_light_and_floor, hide_gizmos))
        .add_systems(Update, (point_camera.run_if(resource_exists_and_changed::<View>), fit_viewport))
        .add_systems(PostUpdate, yield_pointer.before(PanOrbitCameraSystemSet));
}

fn spawn_camera(mut commands: Commands) {
    commands.spawn((
        Camera3d::default(),
        Msaa::Sample4,
        Hdr,
        PanOrbitCamera { pitch_lower_limit: Some(-0.05), use_real_time: true, ..default() },
        DistanceFog {
            color: BACKGROUND,
            falloff: FogFalloff::Linear { start: 16.0, end: 44.0 },
            ..default()
        },
    ));
}

fn spawn_light_and_floor(mut commands: Commands, mut stage: Stage) {
    let cascades = CascadeShadowConfigBuilder { num_cascades: 1, maximum_distance: 22.0, ..default() };
    commands.spawn((
        DirectionalLight { illuminance: 9_500.0, shadow_maps_enabled: true, ..default() },
        cascades.build(),
        Transform::from_xyz(3.5, 7.0, 4.5).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    let floor = Mesh3d(stage.meshes.add(Plane3d::new(Vec3::Y, Vec2::splat(60.0))));
    let paint = stage.paint(Color::srgb(0.63, 0.64, 0.62));
    commands.spawn((floor, paint));
}

/// Exhibits have meshes: of the gizmos only the ring around what is dragged is drawn, until key o is pressed.
fn hide_gizmos(mut store: ResMut<GizmoConfigStore>) {
    let (config, gizmos) = store.config_mut::<MassSpringGizmos>();
    (gizmos.particles, gizmos.springs, gizmos.colliders) = (false, false, false);
    // Outlines are seen through what lies on them.
    config.depth_bias = -1.0;
    gizmos.collider_color = Color::srgb(0.05, 0.30, 0.50);
}

fn point_camera(view: Res<View>, turn: Res<Turn>, mut camera: Single<&mut PanOrbitCamera>) {
    let View { focus, distance, yaw, pitch } = *view;
    let yaw = yaw + turn.0;
    (camera.focus, camera.target_focus) = (focus, focus);
    (camera.radius, camera.target_radius) = (Some(distance), distance);
    (camera.yaw, camera.target_yaw) = (Some(yaw), yaw);
    (camera.pitch, camera.target_pitch) = (Some(pitch), pitch);
    camera.force_update = true;
}

/// Draws the exhibit where the panel leaves the window free.
fn fit_viewport(
    panel: Res<MassSpringPanel>,
    window: Single<&Window>,
    mut camera: Single<&mut Camera, With<PanOrbitCamera>>,
) {
    let Some(free) = panel.free_area else { return };
    set_viewport(&mut camera, &window, free);
}

/// Keeps the camera still while the pointer is used otherwise.
fn yield_pointer(
    wants: Res<EguiWantsInput>,
    drag: Res<ParticleDrag>,
    mut camera: Single<&mut PanOrbitCamera>,
) {
    let enabled = !wants.wants_any_pointer_input() && drag.dragged.is_none();
    if camera.enabled != enabled {
        camera.enabled = enabled;
    }
}
