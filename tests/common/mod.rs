//! The one harness of the app tests: a headless app whose every update runs exactly one tick.
#![allow(dead_code, reason = "each test binary uses a part of it")]

pub mod bodies;
pub mod logged;
pub mod reference;

use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_mass_spring::prelude::*;

/// The tick of the test apps, s. A power of two, so that times add up without rounding.
pub const TICK: f32 = 1.0 / 64.0;

/// A headless app with the plugin, that has run no tick yet.
pub fn app() -> App {
    app_with(MassSpringPlugin::default())
}

/// The same with another configuration of the plugin.
pub fn app_with(plugin: MassSpringPlugin) -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, plugin))
        .insert_resource(TimeUpdateStrategy::FixedTimesteps(1))
        .insert_resource(Time::<Fixed>::from_seconds(f64::from(TICK)));
    app.finish();
    app.cleanup();
    // The very first update has no delta and runs no tick.
    app.update();
    app
}

/// Runs exactly `ticks` ticks.
pub fn run(app: &mut App, ticks: u32) {
    for _ in 0..ticks {
        app.update();
    }
}

/// A scheme with a fixed number of substeps.
pub fn scheme(integrator: Integrator, substeps: u32) -> SolverSettings {
    SolverSettings { integrator, substeps: Substeps::Fixed(substeps) }
}

/// The position of a particle without a parent.
pub fn position(app: &App, particle: Entity) -> Vec3 {
    app.world().get::<Transform>(particle).expect("the particle exists").translation
}

/// The velocity of a particle.
pub fn velocity(app: &App, particle: Entity) -> Vec3 {
    app.world().get::<ParticleVelocity>(particle).expect("the particle exists").0
}

/// Spawns a free particle.
pub fn spawn(app: &mut App, mass: f32, radius: f32, position: Vec3) -> Entity {
    app.world_mut().spawn((Particle::new(mass, radius), Transform::from_translation(position))).id()
}

/// Spawns a pinned particle.
pub fn spawn_pinned(app: &mut App, position: Vec3) -> Entity {
    app.world_mut().spawn((Particle::new(1.0, 0.0), Pinned, Transform::from_translation(position))).id()
}
