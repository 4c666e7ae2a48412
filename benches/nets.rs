//! A net beside the same cloth of particle and spring entities: spawning, a tick, despawning.
//!
//! `cargo bench --bench nets`, or in a hurry `cargo bench --bench nets -- --quick`. The cloth has 100 × 100 particles, 0.01 kg,
//! 0.1 m apart, two corners pinned, with structural, shear and skip-one springs; semi-implicit Euler, 8 substeps of
//! 1/960 s. `solver` is the step alone, as the tick reports it.

use std::sync::Arc;
use std::time::{Duration, Instant};

use bevy::ecs::schedule::SingleThreadedExecutor;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_mass_spring::nets::Topology;
use bevy_mass_spring::prelude::*;
use bevy_mass_spring::solver::{self, Integrator};
use criterion::{Criterion, criterion_group, criterion_main};

const WIDTH: usize = 100;
const SUBSTEPS: u32 = 8;
const TICK: f64 = 1.0 / 120.0;
const SPACING: f32 = 0.1;
const PINNED: [usize; 2] = [0, WIDTH - 1];

fn cloth() -> Topology {
    let mut cloth = Topology { masses: vec![0.01; WIDTH * WIDTH], ..Topology::default() };
    for row in 0..WIDTH {
        for column in 0..WIDTH {
            cloth.positions.push(Vec3::new(column as f32, 0.0, row as f32) * SPACING);
            for (right, down) in [(1_isize, 0), (0, 1), (1, 1), (-1, 1), (2, 0), (0, 2)] {
                let (Some(other), below) = (column.checked_add_signed(right), row + down) else { continue };
                if other < WIDTH && below < WIDTH {
                    let rest_length = SPACING * ((right * right) as f32 + (down * down) as f32).sqrt();
                    let ends = [row * WIDTH + column, below * WIDTH + other].map(|end| end as u32);
                    let spring = solver::Spring {
                        rest_length,
                        stiffness: 1e3,
                        damping: 1.0,
                        ..solver::Spring::default()
                    };
                    cloth.springs.push((ends, spring));
                }
            }
        }
    }
    cloth
}

fn app() -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, MassSpringPlugin::default().physics_only()))
        .insert_resource(TimeUpdateStrategy::FixedTimesteps(1))
        .insert_resource(Time::<Fixed>::from_seconds(TICK))
        .insert_resource(SolverSettings {
            integrator: Integrator::SemiImplicitEuler,
            substeps: SubstepMode::Fixed(SUBSTEPS),
        });
    app.finish();
    app.cleanup();
    for (_, schedule) in app.world_mut().resource_mut::<Schedules>().iter_mut() {
        schedule.set_executor(SingleThreadedExecutor::new());
    }
    app.update();
    app
}

fn spawn_net(app: &mut App, topology: &Arc<Topology>) -> Vec<Entity> {
    let net = ParticleNet::new(Arc::clone(topology), &Transform::IDENTITY);
    vec![app.world_mut().spawn(net.with_pinned(PINNED.map(|pinned| pinned as u32))).id()]
}

fn spawn_entities(app: &mut App, topology: &Arc<Topology>) -> Vec<Entity> {
    let world = app.world_mut();
    let particles = topology.positions.iter().zip(&topology.masses);
    let particles: Vec<(Particle, Transform)> = particles
        .map(|(position, mass)| (Particle::new(*mass, 0.0), Transform::from_translation(*position)))
        .collect();
    let mut all: Vec<Entity> = world.spawn_batch(particles).collect();
    for pinned in PINNED {
        world.entity_mut(all[pinned]).insert(Pinned);
    }
    let springs: Vec<Spring> = topology
        .springs
        .iter()
        .map(|(ends, spring)| {
            let [first, second] = ends.map(|end| all[end as usize]);
            Spring::new(first, second, spring.rest_length)
                .with_stiffness(spring.stiffness)
                .with_damping(spring.damping)
        })
        .collect();
    let springs: Vec<Entity> = world.spawn_batch(springs).collect();
    all.extend(springs);
    all
}

fn compare(criterion: &mut Criterion) {
    type Spawn = fn(&mut App, &Arc<Topology>) -> Vec<Entity>;
    let topology = Arc::new(cloth());
    let kinds: [(&str, Spawn); 2] = [("net", spawn_net), ("entities", spawn_entities)];
    for (name, spawn) in kinds {
        let mut group = criterion.benchmark_group(format!("cloth of {WIDTH}² as {name}"));
        group.sample_size(20);
        group.bench_function("spawn and first tick", |bencher| {
            bencher.iter_custom(|rounds| {
                rounds_of(rounds, || {
                    let mut app = app();
                    let start = Instant::now();
                    spawn(&mut app, &topology);
                    app.update();
                    start.elapsed()
                })
            });
        });
        group.bench_function("despawn", |bencher| {
            bencher.iter_custom(|rounds| {
                rounds_of(rounds, || {
                    let mut app = app();
                    let all = spawn(&mut app, &topology);
                    app.update();
                    let start = Instant::now();
                    for entity in all {
                        app.world_mut().despawn(entity);
                    }
                    app.update();
                    start.elapsed()
                })
            });
        });
        let mut app = app();
        spawn(&mut app, &topology);
        (0..20).for_each(|_| app.update());
        group.bench_function("tick", |bencher| bencher.iter(|| app.update()));
        group.bench_function("solver", |bencher| {
            bencher.iter_custom(|rounds| {
                rounds_of(rounds, || {
                    app.update();
                    app.world().resource::<TickReport>().step_time
                })
            });
        });
        group.finish();
    }
}

fn rounds_of(rounds: u64, mut round: impl FnMut() -> Duration) -> Duration {
    (0..rounds).map(|_| round()).sum()
}

/// 500 ropes of 20 segments that swing, collisions off.
fn ropes(criterion: &mut Criterion) {
    let mut rope = Topology { masses: vec![0.01; 21], ..Topology::default() };
    for number in 0..21 {
        rope.positions.push(Vec3::X * SPACING * number as f32);
        if number > 0 {
            let spring = solver::Spring {
                rest_length: SPACING,
                stiffness: 1e3,
                damping: 1.0,
                ..solver::Spring::default()
            };
            rope.springs.push(([number - 1, number], spring));
        }
    }
    let topology = Arc::new(rope);
    let mut app = app();
    app.world_mut().resource_mut::<CollisionSettings>().particles = false;
    for place in 0..500 {
        let frame = Transform::from_xyz(0.0, 0.0, place as f32);
        app.world_mut().spawn(ParticleNet::new(Arc::clone(&topology), &frame).with_pinned([0]));
    }
    (0..20).for_each(|_| app.update());
    criterion
        .bench_function("500 ropes of 20 segments as nets, tick", |bencher| bencher.iter(|| app.update()));
}

criterion_group!(benches, compare, ropes);
criterion_main!(benches);
