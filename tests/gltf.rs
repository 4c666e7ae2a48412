//! A node of a glTF file becomes a net when its scene spawns, without a window.

use bevy::asset::AssetPlugin;
use bevy::camera::CameraPlugin;
use bevy::camera::primitives::Aabb;
use bevy::camera::visibility::VisibilityClass;
use bevy::gltf::{GltfAssetLabel, GltfExtras, GltfMaterialName, GltfMeshName, GltfPlugin};
use bevy::image::ImagePlugin;
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy::world_serialization::{WorldAssetRoot, WorldSerializationPlugin};
use bevy_mass_spring::gltf::{ATTRIBUTE_PIN, MassSpringGltfPlugin};
use bevy_mass_spring::nets::{Part, PartOf};
use bevy_mass_spring::prelude::*;

/// Columns and rows of cells of `assets/models/cape.py`, and how far it hangs from its collar, m.
const COLUMNS: usize = 18;
const ROWS: usize = 20;
const LENGTH: f32 = 1.15;

/// What scenes of glTF files consist of: `reflect_auto_register` does this for apps.
fn register_all(app: &mut App) {
    app.register_type::<Transform>()
        .register_type::<GlobalTransform>()
        .register_type::<TransformTreeChanged>()
        .register_type::<ChildOf>()
        .register_type::<Children>()
        .register_type::<Name>()
        .register_type::<Visibility>()
        .register_type::<InheritedVisibility>()
        .register_type::<ViewVisibility>()
        .register_type::<VisibilityClass>()
        .register_type::<Aabb>()
        .register_type::<Mesh3d>()
        .register_type::<GltfExtras>()
        .register_type::<GltfMeshName>()
        .register_type::<GltfMaterialName>();
}

fn app() -> App {
    let mut app = App::new();
    let assets =
        AssetPlugin { file_path: concat!(env!("CARGO_MANIFEST_DIR"), "/assets").into(), ..default() };
    app.add_plugins((
        MinimalPlugins,
        TransformPlugin,
        assets,
        ImagePlugin::default(),
        MeshPlugin,
        CameraPlugin,
        WorldSerializationPlugin,
        GltfPlugin::default().add_custom_vertex_attribute("PIN", ATTRIBUTE_PIN),
        MassSpringPlugin::default(),
        MassSpringGltfPlugin,
    ))
    .insert_resource(TimeUpdateStrategy::FixedTimesteps(1));
    register_all(&mut app);
    app.finish();
    app.cleanup();
    app
}

/// Lets the app run until `found` finds something: a file is read in the background.
fn wait_for<T>(app: &mut App, mut found: impl FnMut(&mut World) -> Option<T>) -> T {
    for _ in 0..2000 {
        app.update();
        if let Some(found) = found(app.world_mut()) {
            return found;
        }
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    panic!("nothing came of it in 2000 frames");
}

#[test]
fn the_cape_is_a_cloth_that_hangs_by_its_collar_and_follows_its_node() {
    let mut app = app();
    let scene =
        app.world().resource::<AssetServer>().load(GltfAssetLabel::Scene(0).from_asset("models/cape.glb"));
    let wearer = app.world_mut().spawn((WorldAssetRoot(scene), Transform::from_xyz(0.0, 2.0, 0.0))).id();
    let cape = wait_for(&mut app, |world| {
        let mut nets = world.query::<(Entity, &ParticleNet)>();
        nets.iter(world).next().map(|(entity, _)| entity)
    });
    let net = |app: &App| app.world().get::<ParticleNet>(cape).expect("the cape is a net").clone();
    let laid_out = net(&app);
    assert_eq!(laid_out.len(), (COLUMNS + 1) * (ROWS + 1));
    assert_eq!(laid_out.topology().triangles.len(), 2 * COLUMNS * ROWS);
    let cloth = app.world().get::<Cloth>(cape).expect("it is a cloth");
    assert_eq!(cloth.material, ClothMaterial::WOOL);
    assert!(app.world().get::<bevy_mass_spring::render::NetMesh>(cape).is_some(), "it is drawn");
    let parts: Vec<Part> = app
        .world_mut()
        .query_filtered::<&Part, (With<PartOf>, With<Pinned>)>()
        .iter(app.world())
        .cloned()
        .collect();
    assert_eq!(parts, [Part::Painted("PIN".to_owned())]);

    // The collar is where the node is; it holds what hangs from it, and follows the node.
    let collar = 0..=COLUMNS;
    for _ in 0..2 {
        for _ in 0..60 {
            app.update();
        }
        let now = net(&app);
        assert!(collar.clone().all(|particle| now.is_pinned(particle as u32)));
        assert!(!now.is_pinned(COLUMNS as u32 + 1));
        let height = app.world().get::<Transform>(wearer).expect("the wearer stands").translation.y;
        for particle in collar.clone() {
            // A few roundings of 3 m.
            assert!((now.positions()[particle].y - height).abs() < 1e-5, "{}", now.positions()[particle]);
        }
        for place in &now.positions()[COLUMNS + 1..] {
            // Wool gives a little; nothing hangs further down than a tenth more than it is long.
            assert!(
                place.is_finite() && place.y < height + 0.5 && place.y > height - 1.1 * LENGTH,
                "{place}"
            );
        }
        app.world_mut().get_mut::<Transform>(wearer).expect("the wearer stands").translation.y += 1.0;
    }
}
