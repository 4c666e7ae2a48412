//! The app that all Bevy peers run in: no window, one thread, one fixed tick an update.

use bevy::app::{TaskPoolOptions, TaskPoolPlugin};
use bevy::prelude::*;
use bevy::tasks::ComputeTaskPool;
use bevy::time::TimeUpdateStrategy;

use crate::scene::{Scene, TICK};

/// An app to which plugins and entities are added before it [starts](start).
pub fn app() -> App {
    let task_pool_options = TaskPoolOptions::with_num_threads(1);
    let mut app = App::new();
    app.add_plugins(MinimalPlugins.set(TaskPoolPlugin { task_pool_options }))
        .insert_resource(TimeUpdateStrategy::FixedTimesteps(1))
        .insert_resource(Time::<Fixed>::from_seconds(f64::from(TICK)));
    app
}

/// Ends the building of the app. The next update runs the first tick.
pub fn start(app: &mut App) {
    app.finish();
    app.cleanup();
    assert_eq!(ComputeTaskPool::get().thread_num(), 1, "every peer has one thread");
    // The first update only starts the clocks.
    app.update();
}

/// Spawns an entity with what `components` gives for each particle of `scene`.
pub fn spawn_particles<B: Bundle>(
    app: &mut App,
    scene: &Scene,
    components: impl Fn(usize, Transform) -> B,
) -> Vec<Entity> {
    let places = scene.positions.iter().map(|position| Transform::from_translation(*position));
    places
        .enumerate()
        .map(|(particle, place)| app.world_mut().spawn(components(particle, place)).id())
        .collect()
}

/// Where the entities are by their transforms, m.
pub fn positions(app: &App, particles: &[Entity]) -> Vec<Vec3> {
    let position = |&particle: &Entity| {
        app.world().get::<Transform>(particle).map_or(Vec3::NAN, |transform| transform.translation)
    };
    particles.iter().map(position).collect()
}
