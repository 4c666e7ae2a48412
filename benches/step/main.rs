//! The cost of a step, beside a naive array-of-structures loop of the same physics in the same run.
//!
//! `cargo bench --bench step`, or in a hurry `cargo bench --bench step -- --quick`. Throughput counts
//! springs × substeps: compare `solver` and `tick` with `naive` of the same net.
//!
//! Ropes: particles of 1 kg, 0.1 m apart, the first pinned, let go from horizontal, k = 10⁴ N/m, c = 1
//! N·s/m. Cloths: 0.01 kg, 0.1 m, two corners pinned, structural, shear and skip-one springs, k = 10³
//! N/m, c = 1 N·s/m. Semi-implicit Euler, 8 substeps of 1/960 s (at 1/480 s the cloth would explode).

mod bends;
mod naive;

use std::hint::black_box;
use std::time::Duration;

use bevy::ecs::schedule::SingleThreadedExecutor;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_mass_spring::prelude::*;
use bevy_mass_spring::solver::{self, Collider, Integrator, PairRules, Solver, StepSettings};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};

const SUBSTEPS: u32 = 8;
const TICK: f32 = 1.0 / 120.0;
const GRAVITY: Vec3 = Vec3::new(0.0, -9.81, 0.0);
const SPACING: f32 = 0.1;

/// A net, from which the solver's, the naive loop's and the app's are built.
struct Net {
    name: String,
    positions: Vec<Vec3>,
    pinned: Vec<usize>,
    links: Vec<(usize, usize)>,
    mass: f32,
    stiffness: f32,
    damping: f32,
}

fn rope(count: usize) -> Net {
    Net {
        name: format!("rope of {count}"),
        positions: (0..count).map(|number| Vec3::X * SPACING * number as f32).collect(),
        pinned: vec![0],
        links: (1..count).map(|number| (number - 1, number)).collect(),
        mass: 1.0,
        stiffness: 1e4,
        damping: 1.0,
    }
}

fn cloth(side: usize) -> Net {
    let mut links = Vec::new();
    // To the right and below, both diagonals, and over one's neighbour.
    for (columns, rows) in [(1, 0), (0, 1), (1, 1), (-1, 1), (2, 0), (0, 2)] {
        for slot in 0..side * side {
            let (column, row) = ((slot % side) as isize + columns, slot / side + rows);
            if (0..side as isize).contains(&column) && row < side {
                links.push((slot, row * side + column as usize));
            }
        }
    }
    let place = |slot: usize| Vec3::new((slot % side) as f32, 0.0, (slot / side) as f32) * SPACING;
    Net {
        name: format!("cloth of {side}²"),
        positions: (0..side * side).map(place).collect(),
        pinned: vec![0, side - 1],
        links,
        mass: 0.01,
        stiffness: 1e3,
        damping: 1.0,
    }
}

impl Net {
    fn rest_length(&self, (first, second): (usize, usize)) -> f32 {
        self.positions[first].distance(self.positions[second])
    }

    fn solver_state(&self) -> Solver {
        let mut state = Solver::default();
        for (slot, position) in self.positions.iter().enumerate() {
            let mass = if self.pinned.contains(&slot) { f32::INFINITY } else { self.mass };
            state.add_particle(*position, Vec3::ZERO, mass, 0.0).unwrap();
        }
        for &link in &self.links {
            state
                .add_spring(
                    [link.0, link.1],
                    solver::Spring {
                        rest_length: self.rest_length(link),
                        stiffness: self.stiffness,
                        damping: self.damping,
                        ..solver::Spring::default()
                    },
                )
                .unwrap();
        }
        state
    }

    fn app(&self) -> App {
        let mut app = headless_app();
        app.add_plugins(MassSpringPlugin::default())
            .insert_resource(SolverSettings {
                integrator: Integrator::SemiImplicitEuler,
                substeps: SubstepMode::Fixed(SUBSTEPS),
            })
            .insert_resource(CollisionSettings { particles: false, ..CollisionSettings::default() });
        let world = app.world_mut();
        let mut entities = Vec::new();
        for (slot, position) in self.positions.iter().enumerate() {
            let particle = (Particle::new(self.mass, 0.0), Transform::from_translation(*position));
            let mut entity = world.spawn(particle);
            if self.pinned.contains(&slot) {
                entity.insert(Pinned);
            }
            entities.push(entity.id());
        }
        for &link in &self.links {
            let spring = Spring::new(entities[link.0], entities[link.1], self.rest_length(link));
            world.spawn(spring.with_stiffness(self.stiffness).with_damping(self.damping));
        }
        start(&mut app);
        app
    }
}

/// An app whose every update runs one tick, its systems in a row: what is compared is the work, not the
/// waking of threads.
fn headless_app() -> App {
    let mut app = App::new();
    app.add_plugins(MinimalPlugins)
        .insert_resource(TimeUpdateStrategy::FixedTimesteps(1))
        .insert_resource(Time::<Fixed>::from_seconds(f64::from(TICK)));
    app
}

fn start(app: &mut App) {
    app.finish();
    app.cleanup();
    for (_, schedule) in app.world_mut().resource_mut::<Schedules>().iter_mut() {
        schedule.set_executor(SingleThreadedExecutor::new());
    }
    // The first update has no delta, the second numbers the slots.
    app.update();
    app.update();
}

fn settings() -> StepSettings {
    StepSettings {
        integrator: Integrator::SemiImplicitEuler,
        substeps: SubstepMode::Fixed(SUBSTEPS),
        time_step: TICK,
        gravity: GRAVITY,
        ..StepSettings::default()
    }
}

/// The comparison is fair only if all three do the same: after 30 ticks (240 substeps, u = 6e-8 of 10 m
/// each, twice over for what a difference grows) they agree within 3e-4 m.
fn assert_same_physics(net: &Net) {
    let (mut state, mut naive, mut app) = (net.solver_state(), naive::World::of(net), net.app());
    for _ in 0..30 {
        state.step(&settings());
        naive.tick();
    }
    // The app has run one tick already.
    for _ in 0..29 {
        app.update();
    }
    let mut found = app.world_mut().query_filtered::<(Entity, &Transform), With<Particle>>();
    let mut in_app: Vec<(Entity, Vec3)> =
        found.iter(app.world()).map(|(entity, transform)| (entity, transform.translation)).collect();
    in_app.sort_unstable_by_key(|(entity, _)| entity.index_u32());
    let mut moved = 0.0_f32;
    for (slot, start) in net.positions.iter().enumerate() {
        let position = naive.position(slot);
        let differences = [state.position(slot), in_app[slot].1].map(|other| other.distance(position));
        assert!(differences.iter().all(|difference| *difference < 3e-4), "{}: {differences:?}", net.name);
        moved = moved.max(position.distance(*start));
    }
    assert!(moved > 0.1 && moved < 10.0, "{}: moved by {moved} m", net.name);
}

fn nets(criterion: &mut Criterion) {
    for net in [rope(100), rope(1_000), rope(10_000), cloth(32), cloth(100), cloth(316)] {
        assert_same_physics(&net);
        let mut group = criterion.benchmark_group(&net.name);
        group.throughput(Throughput::Elements(net.links.len() as u64 * u64::from(SUBSTEPS)));
        group.measurement_time(Duration::from_secs(3));

        let mut world = naive::World::of(&net);
        group.bench_function("naive", |bencher| bencher.iter(|| black_box(&mut world).tick()));
        let (mut state, settings) = (net.solver_state(), settings());
        group.bench_function("solver", |bencher| {
            bencher.iter(|| {
                black_box(&mut state).step(&settings);
            })
        });
        let mut app = net.app();
        group.bench_function("tick", |bencher| bencher.iter(|| app.update()));
        group.finish();
    }
}

/// Balls of 0.1 m in a box of 4 m × 4 m, stacked loosely above its floor.
fn box_of_balls(count: usize) -> Solver {
    let mut state = Solver::default();
    for slot in 0..count {
        let (column, row, layer) = (slot % 16, slot / 16 % 16, slot / 256);
        // Not quite a lattice, which would stand.
        let jitter = Vec3::new((slot * 7 % 11) as f32, 0.0, (slot * 5 % 13) as f32) * 0.002;
        let corner = Vec3::new(column as f32, layer as f32, row as f32) * 0.23;
        state.add_particle(corner + jitter + Vec3::splat(0.15), Vec3::ZERO, 1.0, 0.1).unwrap();
    }
    for (point, normal) in [
        (Vec3::ZERO, Vec3::Y),
        (Vec3::ZERO, Vec3::X),
        (Vec3::X * 4.0, Vec3::NEG_X),
        (Vec3::ZERO, Vec3::Z),
        (Vec3::Z * 4.0, Vec3::NEG_Z),
    ] {
        state.add_collider(Collider::half_space(point, normal, 0.0, 0.0));
    }
    state
}

/// Ticks of 1/60 s with 4 substeps: in full fall, and lying.
fn balls(criterion: &mut Criterion) {
    let count = 10_000;
    let settings = StepSettings {
        integrator: Integrator::SemiImplicitEuler,
        substeps: SubstepMode::Fixed(4),
        gravity: GRAVITY,
        pair_rules: Some(PairRules::default()),
        ..StepSettings::default()
    };
    let mut group = criterion.benchmark_group(format!("box of {count} balls"));
    // Ten ticks of four substeps an iteration.
    group.throughput(Throughput::Elements(count as u64 * 40));
    group.sample_size(20);
    let mut state = box_of_balls(count);
    let mut ticks = 0;
    for until in [60, 600] {
        while ticks < until {
            state.step(&settings);
            ticks += 1;
        }
        group.bench_function(BenchmarkId::new("solver, from tick", until), |bencher| {
            bencher.iter_batched_ref(
                || state.clone(),
                |state| {
                    for _ in 0..10 {
                        black_box(&mut *state).step(&settings);
                    }
                },
                criterion::BatchSize::LargeInput,
            );
        });
    }
    group.finish();
}

/// Ropes of 20 balls of 0.02 m, 0.1 m apart, that swing side by side from 46° below the horizontal; they collide as balls, or along their
/// links, too.
fn ropes(count: usize, along_links: bool) -> Solver {
    let mut state = Solver::default();
    for rope in 0..count {
        let anchor = Vec3::new((rope % 10) as f32 * 5.0, 0.0, (rope / 10) as f32 * 0.2);
        for slot in 0..20_usize {
            let mass = if slot == 0 { f32::INFINITY } else { 0.1 };
            let place = anchor + Vec3::new(0.7, -0.714, 0.0) * SPACING * slot as f32;
            let last = state.add_particle(place, Vec3::ZERO, mass, 0.02).unwrap();
            if slot > 0 {
                let spring = solver::Spring {
                    rest_length: SPACING,
                    stiffness: 1e3,
                    damping: 0.1,
                    ..Default::default()
                };
                state.add_spring([last - 1, last], spring).unwrap();
                if along_links {
                    state.add_collision_edge([last - 1, last]).unwrap();
                }
            }
        }
    }
    state
}

/// What it costs that ropes might touch: the others are to be at most 1.5 times `off`. Forty ticks of 1/60 s an iteration,
/// the second half of a swing to the other side and back, under `Auto`.
fn apart(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("500 ropes that touch nothing, collisions");
    group.sample_size(20);
    let rules = Some(PairRules::default());
    for (name, pair_rules, along_links) in
        [("off", None, false), ("on", rules, false), ("on, along links", rules, true)]
    {
        let settings =
            StepSettings { gravity: GRAVITY, viscosity: 0.02, pair_rules, ..StepSettings::default() };
        let mut start = ropes(500, along_links);
        for _ in 0..40 {
            start.step(&settings);
        }
        group.bench_function(name, |bencher| {
            bencher.iter_batched_ref(
                || start.clone(),
                |state| {
                    for _ in 0..40 {
                        black_box(&mut *state).step(&settings);
                    }
                },
                criterion::BatchSize::LargeInput,
            );
        });
    }
    group.finish();
}

/// What a tick costs where nothing is, beside that of an app without the plugin.
fn idle(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("no particles");
    let mut empty = headless_app();
    start(&mut empty);
    group.bench_function("without the plugin", |bencher| bencher.iter(|| empty.update()));
    let mut app = headless_app();
    app.add_plugins(MassSpringPlugin::default());
    start(&mut app);
    group.bench_function("with the plugin", |bencher| bencher.iter(|| app.update()));
    group.finish();
}

/// A particle that comes, and one that leaves, in every tick of a net of 100,000. It lies at rest: over the
/// thousand ticks of a measurement a falling one would not stay whole with so few substeps.
fn edits(criterion: &mut Criterion) {
    let net = cloth(316);
    let mut group = criterion.benchmark_group(format!("edits of a {}", net.name));
    group.sample_size(20);
    let mut app = net.app();
    app.insert_resource(Environment { gravity: Vec3::ZERO, ..Environment::default() });
    group.bench_function("none", |bencher| bencher.iter(|| app.update()));
    let mut last = None;
    group.bench_function("one spawned, one despawned a tick", |bencher| {
        bencher.iter(|| {
            let world = app.world_mut();
            if let Some(last) = last {
                world.despawn(last);
            }
            last = Some(world.spawn((Particle::new(1.0, 0.0), Transform::from_xyz(0.0, 5.0, 0.0))).id());
            app.update();
        });
    });
    let mut particles = app.world_mut().query_filtered::<Entity, With<Particle>>();
    let mut all: Vec<Entity> = particles.iter(app.world()).collect();
    group.bench_function("one of the net despawned a tick", |bencher| {
        bencher.iter(|| {
            // From the middle, so that its springs lose an end.
            let particle = all.swap_remove(all.len() / 2);
            app.world_mut().despawn(particle);
            app.update();
        });
    });
    group.finish();
}

criterion_group!(benches, nets, balls, apart, idle, edits, bends::bends);
criterion_main!(benches);
