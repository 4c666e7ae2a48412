//! A scene in a headless app that runs tick by tick.

use std::time::{Duration, Instant};

use bevy::app::{ScheduleRunnerPlugin, TaskPoolOptions, TaskPoolPlugin, TaskPoolThreadAssignmentPolicy};
use bevy::ecs::schedule::SingleThreadedExecutor;
use bevy::prelude::*;
use bevy::tasks::{ComputeTaskPool, available_parallelism};
use bevy::time::TimeUpdateStrategy;
use bevy_mass_spring::prelude::*;
use bevy_mass_spring::scene::SpawnedScene;

use crate::numbering::Numbering;

/// Where a particle is, and how it moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ParticleState {
    pub position: Vec3,
    pub velocity: Vec3,
}

/// The first particle that became non-finite.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fault {
    /// Its number in what is written.
    pub particle: usize,
    /// The net that it belongs to, and its number there.
    pub net: Option<(usize, u32)>,
    pub tick: u64,
}

/// What one tick cost.
#[derive(Debug, Clone, Copy)]
pub struct TickCost {
    /// Wall time of the whole `App::update`.
    pub update: Duration,
    /// Wall time of the solver's step in it.
    pub step: Duration,
}

/// The app, and what is known of it.
pub struct Simulation {
    app: App,
    scene: MassSpringScene,
    spawned: SpawnedScene,
    ticks: u64,
    fault: Option<Fault>,
}

impl Simulation {
    /// Spawns `scene` in an app with a compute pool of `threads` threads; of all cores if `None`.
    pub fn new(scene: &MassSpringScene, threads: Option<usize>) -> Self {
        let threads = threads.unwrap_or_else(available_parallelism);
        let compute =
            TaskPoolThreadAssignmentPolicy { min_threads: threads, max_threads: threads, ..whole_pool() };
        let task_pool_options = TaskPoolOptions { compute, ..default() };
        let mut app = App::new();
        app.add_plugins((
            MinimalPlugins
                .build()
                .disable::<ScheduleRunnerPlugin>()
                .set(TaskPoolPlugin { task_pool_options }),
            MassSpringPlugin::default().physics_only(),
        ))
        .insert_resource(TimeUpdateStrategy::FixedTimesteps(1));
        scene.apply_settings(app.world_mut());
        let spawned = scene.spawn(&mut app.world_mut().commands());
        app.world_mut().flush();
        app.finish();
        app.cleanup();
        // All systems run in a row: threads are for the solver alone, and not woken for anything else.
        for (_, schedule) in app.world_mut().resource_mut::<Schedules>().iter_mut() {
            schedule.set_executor(SingleThreadedExecutor::new());
        }
        // The first update only starts the clocks: it runs no tick.
        app.update();
        Self { app, scene: scene.clone(), spawned, ticks: 0, fault: None }
    }

    /// Runs one fixed tick.
    pub fn tick(&mut self) -> TickCost {
        let start = Instant::now();
        self.app.update();
        let update = start.elapsed();
        self.ticks += 1;
        assert_eq!(self.report().tick, self.ticks, "each update runs one tick");
        let world = self.app.world_mut();
        let first_fault = world.resource_mut::<Messages<ParticleFault>>().drain().next();
        if let (None, Some(fault)) = (self.fault, first_fault) {
            self.fault = self.locate(fault);
        }
        TickCost { update, step: self.report().step_time }
    }

    /// The numbers of what became non-finite.
    fn locate(&self, fault: ParticleFault) -> Option<Fault> {
        let ParticleFault { particle: entity, index, tick, .. } = fault;
        let place = |entities: &[Entity]| entities.iter().position(|other| *other == entity);
        match index {
            None => Some(Fault { particle: place(&self.spawned.particles)?, net: None, tick }),
            Some(number) => {
                let net = place(&self.spawned.nets)?;
                let particle = self.numbering().number(net, number as usize);
                Some(Fault { particle, net: Some((net, number)), tick })
            }
        }
    }

    /// The nets as they are.
    pub fn nets(&self) -> Vec<&ParticleNet> {
        let world = self.app.world();
        let net =
            |entity: &Entity| world.get::<ParticleNet>(*entity).expect("nets are complete when spawned");
        self.spawned.nets.iter().map(net).collect()
    }

    fn numbering(&self) -> Numbering {
        Numbering::new(&self.scene, self.nets().iter().map(|net| net.len()))
    }

    /// What the last tick did.
    pub fn report(&self) -> &TickReport {
        self.app.world().resource()
    }

    /// The first particle that became non-finite, if one did.
    pub fn fault(&self) -> Option<Fault> {
        self.fault
    }

    /// The number of threads that compute.
    pub fn threads(&self) -> usize {
        ComputeTaskPool::get().thread_num()
    }

    /// The springs that broke, by their index in the scene.
    pub fn broken_springs(&self) -> impl Iterator<Item = usize> {
        let is_broken = |spring: &Entity| self.app.world().get::<Broken>(*spring).is_some();
        let springs = self.spawned.springs.iter().enumerate();
        springs.filter(move |(_, spring)| is_broken(spring)).map(|(index, _)| index)
    }

    /// Where the colliders are, in the order of the scene.
    pub fn collider_places(&self) -> impl Iterator<Item = Transform> {
        let place = |entity: &Entity| self.app.world().get::<Transform>(*entity).copied();
        self.spawned.colliders.iter().map(move |entity| place(entity).unwrap_or_default())
    }

    /// The state of all particles, by their number.
    pub fn states(&self) -> Vec<ParticleState> {
        let world = self.app.world();
        let state = |&entity: &Entity| ParticleState {
            position: world.get::<Transform>(entity).map_or(Vec3::NAN, |transform| transform.translation),
            velocity: world.get::<ParticleVelocity>(entity).map_or(Vec3::NAN, |velocity| velocity.0),
        };
        let mut states: Vec<ParticleState> = self.spawned.particles.iter().map(state).collect();
        let nets = self.nets();
        self.numbering().for_each(|net, particle| {
            let (position, velocity) = (nets[net].positions()[particle], nets[net].velocities()[particle]);
            states.push(ParticleState { position, velocity });
        });
        states
    }
}

/// No share of the cores, but only the two limits, decides on the number of threads.
fn whole_pool() -> TaskPoolThreadAssignmentPolicy {
    TaskPoolOptions::default().compute
}

/// The 64-bit FNV-1a hash of the bits of all positions and velocities, as 16 hexadecimal digits.
pub fn state_hash(states: &[ParticleState]) -> String {
    const OFFSET_BASIS: u64 = 0xcbf2_9ce4_8422_2325;
    const PRIME: u64 = 0x0000_0100_0000_01b3;
    let numbers = states.iter().flat_map(|ParticleState { position, velocity }| {
        position.to_array().into_iter().chain(velocity.to_array())
    });
    let bytes = numbers.flat_map(|number| number.to_bits().to_le_bytes());
    let hash = bytes.fold(OFFSET_BASIS, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(PRIME));
    format!("{hash:016x}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hash_is_fnv_1a() {
        assert_eq!(state_hash(&[]), "cbf29ce484222325");
        // Of 24 zero bytes: the offset basis times the 24th power of the prime.
        let zero = ParticleState { position: Vec3::ZERO, velocity: Vec3::ZERO };
        let expected = (0..24).fold(0xcbf2_9ce4_8422_2325_u64, |hash, _| hash.wrapping_mul(0x0100_0000_01b3));
        assert_eq!(state_hash(&[zero]), format!("{expected:016x}"));
        let other = ParticleState { velocity: Vec3::new(0.0, 0.0, -0.0), ..zero };
        assert_ne!(state_hash(&[zero]), state_hash(&[other]), "each bit counts");
    }
}
