//! The one harness of the app tests: a headless app whose every update runs exactly one tick.
#![allow(dead_code, reason = "each test binary uses a part of it")]

pub mod backward_euler;
pub mod bodies;
pub mod colliding;
pub mod crossings;
pub mod curves;
pub mod logged;
pub mod reference;
pub mod shapes;
pub mod sleep;

use bevy::app::{Plugins, TaskPoolOptions, TaskPoolPlugin};
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_mass_spring::prelude::*;

/// The tick of the test apps, s. A power of two, so that times add up without rounding.
pub const TICK: f32 = 1.0 / 64.0;

/// A headless app with the plugin, that has run no tick yet.
pub fn app() -> App {
    app_with(MassSpringPlugin::default())
}

/// The same with other plugins: the plugin configured otherwise, or more than it.
pub fn app_with<Marker>(plugins: impl Plugins<Marker>) -> App {
    app_on(TaskPoolOptions::default(), plugins)
}

/// The same with task pools of a given size. They belong to the process: the first app makes them.
pub fn app_on<Marker>(task_pool_options: TaskPoolOptions, plugins: impl Plugins<Marker>) -> App {
    let mut app = App::new();
    app.add_plugins(MinimalPlugins.set(TaskPoolPlugin { task_pool_options }))
        .add_plugins(plugins)
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
    SolverSettings { integrator, substeps: SubstepMode::Fixed(substeps) }
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

/// Spawns a spring.
pub fn join(app: &mut App, spring: Spring) -> Entity {
    app.world_mut().spawn(spring).id()
}

/// Replaces the settings by those of a plain experiment: one substep of semi-implicit Euler a tick, no
/// gravity, no collisions.
pub fn plain(app: &mut App) {
    app.insert_resource(scheme(Integrator::SemiImplicitEuler, 1));
    app.world_mut().resource_mut::<Environment>().gravity_enabled = false;
    let mut collisions = app.world_mut().resource_mut::<CollisionSettings>();
    (collisions.ground, collisions.particles) = (false, false);
}

/// Places a particle without a parent.
pub fn place(app: &mut App, particle: Entity, position: Vec3) {
    app.world_mut().get_mut::<Transform>(particle).expect("the particle exists").translation = position;
}

/// What the last tick did.
pub fn report(app: &App) -> &TickReport {
    app.world().resource::<TickReport>()
}

/// The messages since the last call.
pub fn messages<M: Message>(app: &mut App) -> Vec<M> {
    app.world_mut().resource_mut::<Messages<M>>().drain().collect()
}

/// The bits of position and velocity.
pub fn bits(app: &App, particle: Entity) -> [u32; 6] {
    let (position, velocity) = (position(app, particle), velocity(app, particle));
    [position.x, position.y, position.z, velocity.x, velocity.y, velocity.z].map(f32::to_bits)
}

/// A hash of the bits of positions and velocities, in the order given (FNV-1a).
pub fn hash(app: &App, particles: &[Entity]) -> u64 {
    let bytes = particles.iter().flat_map(|particle| bits(app, *particle)).flat_map(u32::to_le_bytes);
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

/// Spawns a rope of `count` particles 0.1 m apart along x from `start`; the first is pinned.
pub fn spawn_rope(
    app: &mut App,
    start: Vec3,
    count: usize,
    mass: f32,
    template: impl Fn(Spring) -> Spring,
) -> Vec<Entity> {
    let mut rope = vec![spawn_pinned(app, start)];
    for number in 1..count {
        let last = rope[number - 1];
        let next = spawn(app, mass, 0.04, start + Vec3::X * 0.1 * number as f32);
        join(app, template(Spring::new(last, next, 0.1)));
        rope.push(next);
    }
    rope
}
