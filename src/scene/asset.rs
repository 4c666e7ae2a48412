//! Scene files as Bevy assets, and the component that spawns them.

use bevy::asset::io::Reader;
use bevy::asset::{AssetLoader, AssetTrackingSystems, LoadContext};
use bevy::prelude::*;

use super::description::MassSpringScene;
use super::error::{SceneError, SceneErrorReason};
use super::spawn::SpawnedScene;

/// Spawns a scene once its file is loaded.
///
/// ```no_run
/// # use bevy::prelude::*;
/// # use bevy_mass_spring::prelude::*;
/// fn open(mut commands: Commands, assets: Res<AssetServer>) {
///     commands.spawn(MassSpringSceneRoot(assets.load("scenes/chain.scene.ron")));
/// }
/// ```
///
/// Particles live in world space, so they do not become children of this entity. It gets a
/// [`SpawnedScene`] that lists them, and when it is despawned, so are they. Removing only the
/// [`SpawnedScene`] spawns the scene again.
///
/// The settings of the scene (gravity, time step, scheme …) belong to the whole app and are not
/// touched: call [`MassSpringScene::apply_settings`] to apply them, for example in an observer of
/// `On<Insert, SpawnedScene>`.
#[derive(Component, Reflect, Debug, Clone, Default, PartialEq, Eq, Deref, DerefMut)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
pub struct MassSpringSceneRoot(pub Handle<MassSpringScene>);

/// Loads `*.scene.ron` files. [`MassSpringScenePlugin`] registers it.
#[derive(Debug, Clone, Copy, Default, TypePath)]
pub struct MassSpringSceneLoader;

impl AssetLoader for MassSpringSceneLoader {
    type Asset = MassSpringScene;
    type Settings = ();
    type Error = SceneError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        (): &(),
        load_context: &mut LoadContext<'_>,
    ) -> Result<MassSpringScene, SceneError> {
        let mut bytes = Vec::new();
        reader
            .read_to_end(&mut bytes)
            .await
            .map_err(|error| SceneErrorReason::Unreadable(error).into())
            .and_then(|_| MassSpringScene::from_bytes(&bytes))
            .map_err(|error: SceneError| error.in_file(load_context.path().to_string()))
    }

    fn extensions(&self) -> &[&str] {
        &["scene.ron"]
    }
}

/// Loads `*.scene.ron` files and spawns the scene of each [`MassSpringSceneRoot`], in apps with Bevy's
/// `AssetPlugin`, added before or after this plugin. [`MassSpringPlugin`](crate::MassSpringPlugin)
/// adds it.
#[derive(Debug, Clone, Copy, Default)]
pub struct MassSpringScenePlugin;

impl Plugin for MassSpringScenePlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<(MassSpringSceneRoot, SpawnedScene)>();
        register_loader(app);
    }

    fn finish(&self, app: &mut App) {
        register_loader(app);
    }
}

/// Adds the loader, unless it is there or there are no assets (yet).
fn register_loader(app: &mut App) {
    let registered = app.world().contains_resource::<Assets<MassSpringScene>>();
    if registered || !app.world().contains_resource::<AssetServer>() {
        return;
    }
    app.init_asset::<MassSpringScene>()
        .register_asset_loader(MassSpringSceneLoader)
        .add_systems(PreUpdate, spawn_loaded_scenes.after(AssetTrackingSystems));
}

fn spawn_loaded_scenes(
    mut commands: Commands,
    scenes: Res<Assets<MassSpringScene>>,
    roots: Query<(Entity, &MassSpringSceneRoot), Without<SpawnedScene>>,
) {
    for (root, MassSpringSceneRoot(handle)) in &roots {
        if let Some(scene) = scenes.get(handle) {
            let spawned = scene.spawn(&mut commands);
            commands.entity(root).insert(spawned);
        }
    }
}
