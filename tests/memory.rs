//! What a cloth takes in memory, as a net and as entities.

mod common;

use std::sync::Arc;

use allocation_counter::measure;
use bevy::app::TaskPoolOptions;
use bevy::ecs::schedule::SingleThreadedExecutor;
use bevy::prelude::*;
use bevy_mass_spring::nets::Topology;
use bevy_mass_spring::prelude::*;
use bevy_mass_spring::solver;

use common::{app_on, run, scheme};

const WIDTH: u32 = 100;
const SPACING: f32 = 0.1;

/// A cloth of 100² particles with structural, shear and skip-one springs, as in `benches/nets.rs`.
fn cloth() -> Topology {
    let mut cloth = Topology { masses: vec![0.01; (WIDTH * WIDTH) as usize], ..Topology::default() };
    for (row, column) in (0..WIDTH).flat_map(|row| (0..WIDTH).map(move |column| (row, column))) {
        cloth.positions.push(Vec3::new(column as f32, 0.0, row as f32) * SPACING);
        for (right, down) in [(1_i32, 0), (0, 1), (1, 1), (-1, 1), (2, 0), (0, 2)] {
            let Some(other) = column.checked_add_signed(right).filter(|other| *other < WIDTH) else {
                continue;
            };
            if row + down < WIDTH {
                let rest_length = SPACING * ((right * right) as f32 + (down * down) as f32).sqrt();
                let ends = [row * WIDTH + column, (row + down) * WIDTH + other];
                let spring =
                    solver::Spring { rest_length, stiffness: 1e3, damping: 1.0, ..solver::Spring::default() };
                cloth.springs.push((ends, spring));
            }
        }
    }
    cloth
}

fn spawn_net(world: &mut World) {
    let net = ParticleNet::new(Arc::new(cloth()), &Transform::IDENTITY);
    world.spawn(net.with_pinned([0, WIDTH - 1]));
}

fn spawn_entities(world: &mut World) {
    let cloth = cloth();
    let particles = cloth.positions.iter().zip(&cloth.masses);
    let particles: Vec<(Particle, Transform)> = particles
        .map(|(position, mass)| (Particle::new(*mass, 0.0), Transform::from_translation(*position)))
        .collect();
    let particles: Vec<Entity> = world.spawn_batch(particles).collect();
    for pinned in [0, WIDTH - 1] {
        world.entity_mut(particles[pinned as usize]).insert(Pinned);
    }
    let springs: Vec<Spring> = cloth
        .springs
        .iter()
        .map(|(ends, spring)| {
            let [first, second] = ends.map(|end| particles[end as usize]);
            Spring::new(first, second, spring.rest_length)
                .with_stiffness(spring.stiffness)
                .with_damping(spring.damping)
        })
        .collect();
    world.spawn_batch(springs).for_each(drop);
}

/// The bytes on the heap that are there after a cloth was spawned and moved for two ticks, and were not before.
fn bytes(spawn: fn(&mut World), settings: SolverSettings) -> i64 {
    let mut app = app_on(TaskPoolOptions::with_num_threads(1), MassSpringPlugin::default());
    app.insert_resource(settings);
    for (_, schedule) in app.world_mut().resource_mut::<Schedules>().iter_mut() {
        schedule.set_executor(SingleThreadedExecutor::new());
    }
    run(&mut app, 2);
    measure(|| {
        spawn(app.world_mut());
        run(&mut app, 2);
    })
    .bytes_current
}

/// The topology that nets share counts as a part of it. (In implicit steps both take as much beside, for the equations.)
#[test]
fn a_cloth_as_a_net_takes_at_most_half_of_what_it_takes_as_entities() {
    for settings in [scheme(Integrator::SemiImplicitEuler, 8), SolverSettings::default()] {
        let [net, entities] =
            [spawn_net as fn(&mut World), spawn_entities].map(|spawn| bytes(spawn, settings));
        println!("{settings:?}: {net} bytes as a net, {entities} as entities");
        assert!(2 * net <= entities, "{net} bytes as a net, {entities} as entities, {settings:?}");
    }
}
