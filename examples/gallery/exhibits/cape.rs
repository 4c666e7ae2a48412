//! A cape on a moving figure, as its artist painted it.

use bevy::camera::primitives::Aabb;
use bevy::camera::visibility::VisibilityClass;
use bevy::gltf::{GltfExtras, GltfMaterialName, GltfMeshName, GltfSceneName};
use bevy::prelude::*;
use bevy::transform::components::TransformTreeChanged;
use bevy::world_serialization::WorldAssetRoot;
use bevy_egui::egui::Ui;
use bevy_mass_spring::prelude::*;

use crate::frame::slider;
use crate::gallery::{AppExhibit, Exhibit};
use crate::stage::{OfExhibit, Stage, View};

const EXHIBIT: Exhibit = Exhibit {
    name: "Cape",
    caption: "A cape from a glTF file: its node says that it is a cloth of wool, a vertex attribute says where it is \
              held. The figure walks in a circle and turns on its heel.",
    view: View { focus: Vec3::new(0.0, 1.0, 0.0), distance: 4.8, yaw: 0.4, pitch: 0.2 },
};

pub fn plugin(app: &mut App) {
    register_types(app);
    app.insert_resource(Speed(1.6))
        .add_exhibit(EXHIBIT, spawn, draw)
        .add_systems(FixedUpdate, walk)
        .add_systems(PreUpdate, soften);
}

/// Scenes of glTF files are spawned by reflection. Bevy's default features register all types by themselves; this
/// crate builds Bevy without them.
fn register_types(app: &mut App) {
    app.register_type::<Transform>()
        .register_type::<GlobalTransform>()
        .register_type::<TransformTreeChanged>()
        .register_type::<Visibility>()
        .register_type::<InheritedVisibility>()
        .register_type::<ViewVisibility>()
        .register_type::<VisibilityClass>()
        .register_type::<Name>()
        .register_type::<ChildOf>()
        .register_type::<Children>()
        .register_type::<Mesh3d>()
        .register_type::<MeshMaterial3d<StandardMaterial>>()
        .register_type::<Aabb>()
        .register_type::<GltfExtras>()
        .register_type::<GltfSceneName>()
        .register_type::<GltfMeshName>()
        .register_type::<GltfMaterialName>();
}

/// The speed of the figure, m/s.
#[derive(Resource)]
struct Speed(f32);

/// The figure that walks, and how far it has come, m.
#[derive(Component)]
struct Figure(f32);

fn spawn(mut stage: Stage, assets: Res<AssetServer>, mut environment: ResMut<Environment>) {
    *environment = Environment { air_density: 1.225, ..default() };
    stage.floor();
    let stone = stage.paint(Color::srgb(0.34, 0.36, 0.40));
    let skin = stage.paint(Color::srgb(0.75, 0.56, 0.43));
    let figure = stage.spawn((Figure(0.0), Transform::default(), Visibility::default()));
    let trunk = ConicalFrustum { radius_top: 0.1, radius_bottom: 0.24, height: 1.5 };
    let body = (ParticleCollider::from(trunk).with_friction(0.3), Mesh3d(stage.meshes.add(trunk)));
    let head = Mesh3d(stage.meshes.add(Sphere::new(0.13)));
    let cape = assets.load("models/cape.glb#Scene0");
    stage.commands.entity(figure).with_children(|figure| {
        figure.spawn((body, stone, Transform::from_xyz(0.0, 0.75, 0.0)));
        figure.spawn((head, skin, Transform::from_xyz(0.0, 1.58, 0.0)));
        figure.spawn((WorldAssetRoot(cape), Transform::from_xyz(0.0, 1.45, 0.0)));
    });
}

/// Wool as soft, and with as little damping of its own, as the explicit schemes take in some tens of substeps.
fn soften(mut capes: Query<&mut Cloth, (Added<Cloth>, Without<OfExhibit>)>) {
    for mut cape in &mut capes {
        (cape.material.stretch_stiffness, cape.material.retardation_time) = (400.0, 2e-4);
    }
}

/// Along a circle, and back again after each round.
fn walk(speed: Res<Speed>, time: Res<Time>, mut figures: Query<(&mut Figure, &mut Transform)>) {
    const RADIUS: f32 = 1.1;
    const TURN: f32 = 0.8; // m: on this way it turns round
    for (mut figure, mut transform) in &mut figures {
        figure.0 += speed.0 * time.delta_secs();
        let round = std::f32::consts::TAU * RADIUS;
        let (laps, way) = ((figure.0 / (round + TURN)).floor(), figure.0 % (round + TURN));
        let sense = if laps % 2.0 == 0.0 { 1.0 } else { -1.0 };
        let angle = sense * (way.min(round) / RADIUS);
        let turn = std::f32::consts::PI * ((way - round) / TURN).max(0.0);
        transform.translation = RADIUS * Vec3::new(angle.sin(), 0.0, angle.cos());
        // It looks where it goes; its back is towards −Z of its own frame.
        let heading = angle + sense * std::f32::consts::FRAC_PI_2 + turn;
        transform.rotation = Quat::from_rotation_y(heading);
    }
}

fn draw(mut ui: InMut<Ui>, mut speed: ResMut<Speed>) {
    slider(&mut ui, "speed", "m/s", &mut speed.0, 0.0..=6.0);
}
