//! All that the window shows: scenes, stage, looks, controls, overlay. The window test runs it too.

pub mod controls;
pub mod looks;
pub mod overlay;
pub mod presets;
pub mod stage;

use bevy::prelude::*;
use bevy_mass_spring::prelude::*;
use bevy_mass_spring::scene::SpawnedScene;

/// The viewer, on top of `DefaultPlugins` and a [`FirstScene`].
pub fn plugin(app: &mut App) {
    app.add_plugins((
        MassSpringPlugin::default(),
        MassSpringGizmosPlugin,
        ParticleDragPlugin::default(),
        MassSpringPanelPlugin,
    ))
    .add_plugins((stage::plugin, looks::plugin, controls::plugin, overlay::plugin))
    .add_systems(PreStartup, open_first_scene);
}

/// The scene that is open at the start.
#[derive(Resource)]
pub struct FirstScene {
    /// Its content.
    pub scene: MassSpringScene,
    /// What it is called.
    pub title: String,
    /// Its place in [`presets::ALL`], if it is one of them.
    pub preset: Option<usize>,
}

/// The scene that is open.
#[derive(Resource)]
pub struct OpenScene {
    /// What it is called.
    pub title: String,
    /// Its place in [`presets::ALL`], if it is one of them.
    pub preset: Option<usize>,
    /// The middle of its particles and the radius around it that holds them, m.
    pub bounds: (Vec3, f32),
    root: Entity,
}

/// Lays `scene` out in place of the one that is open.
pub struct LayOut {
    /// The content.
    pub scene: MassSpringScene,
    /// What it is called.
    pub title: String,
    /// Its place in [`presets::ALL`], if it is one of them.
    pub preset: Option<usize>,
    /// Whether its settings replace those of the world; else those that the user made are kept.
    pub with_settings: bool,
}

impl Command for LayOut {
    type Out = ();

    fn apply(self, world: &mut World) {
        if let Some(old) = world.remove_resource::<OpenScene>() {
            world.despawn(old.root);
        }
        if self.with_settings {
            self.scene.apply_settings(world);
        }
        let spawned: SpawnedScene = self.scene.spawn(&mut world.commands());
        world.flush();
        let root = world.spawn(spawned).id();
        let bounds = bounds(&self.scene);
        let Self { title, preset, .. } = self;
        world.insert_resource(OpenScene { title, preset, bounds, root });
        // None of the new entities has a past to return to: this only sets the clock of ticks to zero.
        RestoreInitialState.apply(world);
    }
}

fn open_first_scene(first: Res<FirstScene>, mut time: ResMut<Time<Virtual>>, mut commands: Commands) {
    time.pause();
    let FirstScene { scene, title, preset } = &*first;
    let layout = LayOut { scene: scene.clone(), title: title.clone(), preset: *preset, with_settings: true };
    commands.queue(layout);
}

/// The middle of a scene, which is where it hangs if it does, and the radius around it.
fn bounds(scene: &MassSpringScene) -> (Vec3, f32) {
    let positions = || scene.particles.iter().map(|particle| particle.position);
    let least = positions().reduce(Vec3::min).unwrap_or_default();
    let most = positions().reduce(Vec3::max).unwrap_or_default();
    let mut middle = least.midpoint(most);
    let pinned: Vec<f32> = scene
        .particles
        .iter()
        .filter(|particle| particle.pinned)
        .map(|particle| particle.position.x)
        .collect();
    if !pinned.is_empty() {
        middle.x = pinned.iter().sum::<f32>() / pinned.len() as f32;
    }
    let radius = scene.particles.iter().map(|particle| particle.radius).fold(0.0, f32::max);
    (middle, 0.5 * least.distance(most) + radius)
}
