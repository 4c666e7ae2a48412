//! Scenes as assets, and the component that spawns them.

use std::path::Path;
use std::time::{Duration, Instant};

use bevy::asset::LoadState;
use bevy::prelude::*;
use bevy_mass_spring::prelude::*;
use bevy_mass_spring::scene::SpawnedScene;

/// An app with assets from `folder`; the physics comes before the assets if `physics_first`.
fn app_with_assets(folder: &Path, physics_first: bool) -> App {
    let assets = AssetPlugin { file_path: folder.display().to_string(), ..default() };
    let mut app = App::new();
    app.add_plugins(MinimalPlugins);
    if physics_first {
        app.add_plugins((MassSpringPlugin::default(), assets));
    } else {
        app.add_plugins((assets, MassSpringPlugin::default()));
    }
    app.finish();
    app.cleanup();
    app
}

fn update_until(app: &mut App, mut done: impl FnMut(&World) -> bool) {
    let start = Instant::now();
    while !done(app.world()) {
        assert!(start.elapsed() < Duration::from_secs(30), "nothing happened for 30 s");
        app.update();
    }
}

#[test]
fn a_root_spawns_and_despawns_its_scene() {
    for physics_first in [false, true] {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets");
        let mut app = app_with_assets(&folder, physics_first);
        let handle = app.world().resource::<AssetServer>().load("scenes/pendulum.scene.ron");
        let root = app.world_mut().spawn(MassSpringSceneRoot(handle)).id();
        update_until(&mut app, |world| world.get::<SpawnedScene>(root).is_some());

        let spawned = app.world().get::<SpawnedScene>(root).unwrap().clone();
        assert_eq!((spawned.particles.len(), spawned.springs.len(), spawned.planes.len()), (2, 1, 1));
        assert!(app.world().get::<Pinned>(spawned.particles[0]).is_some());
        app.update();
        assert_eq!(app.world().get::<SpawnedScene>(root), Some(&spawned), "spawned once");

        // One that the game despawned before is ignored.
        app.world_mut().despawn(spawned.springs[0]);
        app.world_mut().despawn(root);
        app.world_mut().flush();
        assert!(spawned.iter().all(|entity| app.world().get_entity(entity).is_err()));
    }
}

#[test]
fn removing_the_spawned_scene_spawns_it_again() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets");
    let mut app = app_with_assets(&folder, false);
    let handle = app.world().resource::<AssetServer>().load("scenes/pendulum.scene.ron");
    let root = app.world_mut().spawn(MassSpringSceneRoot(handle)).id();
    update_until(&mut app, |world| world.get::<SpawnedScene>(root).is_some());
    let before = app.world_mut().entity_mut(root).take::<SpawnedScene>().unwrap();
    app.world_mut().flush();
    update_until(&mut app, |world| world.get::<SpawnedScene>(root).is_some());
    let after = app.world().get::<SpawnedScene>(root).unwrap();
    assert!(after.particles.iter().all(|entity| app.world().get_entity(*entity).is_ok()));
    assert!(before.iter().all(|entity| app.world().get_entity(entity).is_err()), "{before:?} {after:?}");
}

#[test]
fn a_scene_that_fails_to_load_reports_why() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("bad.scene.ron"), "(particles: [(position: (0, 0, 0), mass: 0)])")
        .unwrap();
    let mut app = app_with_assets(folder.path(), false);
    let handle: Handle<MassSpringScene> = app.world().resource::<AssetServer>().load("bad.scene.ron");
    app.world_mut().spawn(MassSpringSceneRoot(handle.clone()));
    let state = |world: &World| world.resource::<AssetServer>().load_state(&handle);
    update_until(&mut app, |world| state(world).is_failed());
    let LoadState::Failed(error) = state(app.world()) else { panic!("not failed") };
    let message = "bad.scene.ron:1:42: particles[0].mass is 0.0, expected a finite number > 0";
    assert!(error.to_string().contains(message), "{error}");
}
