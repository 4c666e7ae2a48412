//! All that the window shows: scenes, stage, appearance, controls, overlay. The window test runs it too.

pub mod controls;
pub mod looks;
pub mod overlay;
pub mod panel_view;
pub mod presets;
pub mod stage;
pub mod switches;

use bevy::prelude::*;
use bevy_mass_spring::prelude::*;
use bevy_mass_spring::scene::SpawnedScene;

/// The viewer, on top of `DefaultPlugins` and a [`FirstScene`].
pub fn plugin(app: &mut App) {
    app.add_plugins(MassSpringPlugins::default())
        .add_plugins((stage::plugin, looks::plugin, controls::plugin, overlay::plugin))
        .add_systems(PreStartup, open_first_scene)
        .add_systems(First, lay_out);
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
    /// Its extent.
    pub bounds: Bounds,
    root: Entity,
}

/// A scene to be laid out in place of the one that is open.
///
/// This is done when the next frame begins: meshes are added during a frame.
#[derive(Resource)]
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

fn lay_out(world: &mut World) {
    let Some(LayOut { scene, title, preset, with_settings }) = world.remove_resource() else { return };
    if let Some(old) = world.remove_resource::<OpenScene>() {
        world.despawn(old.root);
    }
    if with_settings {
        scene.apply_settings(world);
    }
    let spawned: SpawnedScene = scene.spawn(&mut world.commands());
    world.flush();
    let root = world.spawn(spawned).id();
    let bounds = Bounds::of(&scene);
    world.insert_resource(OpenScene { title, preset, bounds, root });
    // The new entities have no initial state yet: this only resets the tick counter.
    RestoreInitialState.apply(world);
}

fn open_first_scene(first: Res<FirstScene>, mut time: ResMut<Time<Virtual>>, mut commands: Commands) {
    time.pause();
    let FirstScene { scene, title, preset } = &*first;
    let layout = LayOut { scene: scene.clone(), title: title.clone(), preset: *preset, with_settings: true };
    commands.insert_resource(layout);
}

/// The extent of a scene, in m.
#[derive(Debug, Clone, Copy)]
pub struct Bounds {
    /// The middle of its particles, or what they hang from sideways.
    pub middle: Vec3,
    /// The distance from there to the end of the farthest particle.
    pub radius: f32,
    /// The height of the highest particle above the origin.
    pub top: f32,
}

impl Bounds {
    fn of(scene: &MassSpringScene) -> Self {
        let layout = scene.layout().unwrap_or_default();
        let positions = &layout.positions;
        let least = positions.iter().copied().reduce(Vec3::min).unwrap_or_default();
        let most = positions.iter().copied().reduce(Vec3::max).unwrap_or_default();
        let mut middle = least.midpoint(most);
        let mut pinned: Vec<f32> = scene
            .particles
            .iter()
            .filter(|particle| particle.pinned)
            .map(|particle| particle.position.x)
            .collect();
        let mut radii: Vec<f32> = scene.particles.iter().map(|particle| particle.radius).collect();
        for (net, topology) in scene.nets.iter().zip(&layout.topologies) {
            pinned.extend(net.pinned().iter().map(|particle| topology.positions[*particle as usize].x));
            radii.extend(std::iter::repeat_n(topology.radius, topology.positions.len()));
        }
        if !pinned.is_empty() {
            middle.x = pinned.iter().sum::<f32>() / pinned.len() as f32;
        }
        let reach = positions.iter().zip(radii).map(|(place, radius)| middle.distance(*place) + radius);
        Self { middle, radius: reach.fold(0.0, f32::max), top: most.y }
    }
}
