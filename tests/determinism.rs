//! The same bits at every step: on repeated runs, with any number of threads, and in any archetypes.

mod common;

use std::hash::{DefaultHasher, Hash, Hasher};
use std::process::Command;

use bevy::app::{TaskPoolOptions, TaskPoolThreadAssignmentPolicy};
use bevy::prelude::*;
use bevy::tasks::ComputeTaskPool;
use bevy_mass_spring::nets::{Balloon, Cloth, Rope, Topology};
use bevy_mass_spring::prelude::*;
use bevy_mass_spring::solver::{Collider, PairRules, Solver, StepSettings};
use common::*;

#[derive(Component)]
struct Marker;

#[derive(Component)]
#[component(storage = "SparseSet")]
struct SparseMarker;

/// A hanging cloth of 8², swinging ropes and, if wanted, a pile of balls that collide on a rough ground.
/// `mark` may add components to an entity that do not belong to the simulation.
fn scene(app: &mut App, balls: u8, mut mark: impl FnMut(EntityWorldMut)) -> Vec<Entity> {
    let mut all = Vec::new();
    app.world_mut().spawn(ParticleCollider { restitution: 0.3, friction: 0.4, ..default() });
    for row in 0..8_u8 {
        for column in 0..8_u8 {
            let place = Vec3::new(f32::from(column) * 0.1, 2.0, f32::from(row) * 0.1);
            let particle = spawn(app, 0.01, 0.02, place);
            if row == 0 && column % 7 == 0 {
                app.world_mut().entity_mut(particle).insert(Pinned);
            }
            all.push(particle);
            for (condition, back) in [(column > 0, 1), (row > 0, 8), (row > 0 && column > 0, 9)] {
                if condition {
                    let other = all[all.len() - 1 - back];
                    let length = if back == 9 { 0.1 * 2.0_f32.sqrt() } else { 0.1 };
                    let spring = Spring::new(other, particle, length).with_stiffness(100.0).with_damping(0.1);
                    join(app, spring);
                }
            }
            mark(app.world_mut().entity_mut(particle));
        }
    }
    all.extend(spawn_rope(app, Vec3::new(-3.0, 1.0, 0.0), 12, 0.05, |spring| spring.with_stiffness(400.0)));
    for number in 0..balls {
        let number_f = f32::from(number);
        let place =
            Vec3::new(0.07 * (number_f * 2.4).sin(), 0.3 + 0.2 * number_f, 0.07 * (number_f * 1.7).cos());
        let ball = spawn(app, 0.5 + 0.1 * f32::from(number % 4), 0.1, place);
        mark(app.world_mut().entity_mut(ball));
        all.push(ball);
    }
    all
}

/// The hash of the state after each of `ticks` ticks.
fn history(app: &mut App, all: &[Entity], ticks: u32) -> Vec<u64> {
    history_of(app, all, 0..ticks)
}

/// The same from some tick on.
fn history_of(app: &mut App, all: &[Entity], ticks: std::ops::Range<u32>) -> Vec<u64> {
    ticks
        .map(|tick| {
            // The first anchor moves back and forth (no sine: it is not the same on every platform).
            let around = ((tick % 80) as f32 / 40.0 - 1.0).abs();
            place(app, all[0], Vec3::new(0.3 * around, 2.0, 0.2 * around));
            run(app, 1);
            hash(app, all)
        })
        .collect()
}

#[track_caller]
fn assert_same(one: &[u64], other: &[u64], what: &str) {
    assert_eq!(one.len(), other.len());
    let first = one.iter().zip(other).position(|(one, other)| one != other);
    assert_eq!(first, None, "{what} differs from this tick on");
}

const TICKS: u32 = 150;

#[test]
fn repeated_runs_are_the_same_at_every_step() {
    let run_once = || {
        let mut app = app();
        let all = scene(&mut app, 20, |_| {});
        history(&mut app, &all, TICKS)
    };
    let history = run_once();
    assert_same(&history, &run_once(), "the second run");
    // Something moves in every tick, so the comparison is not trivial.
    assert!(history.windows(2).all(|pair| pair[0] != pair[1]));
}

#[test]
fn archetypes_do_not_matter() {
    let run_once = |mark: fn(usize, EntityWorldMut)| {
        let mut app = app();
        let mut count = 0;
        let all = scene(&mut app, 20, |entity| {
            mark(count, entity);
            count += 1;
        });
        history(&mut app, &all, TICKS)
    };
    let plain = run_once(|_, _| {});
    let marked = run_once(|count, mut entity| {
        if count % 2 == 0 {
            entity.insert(Marker);
        }
        if count % 3 == 0 {
            entity.insert((SparseMarker, Name::new("third")));
        }
        if count % 5 == 0 {
            entity.insert(AppliedForce(Vec3::ZERO));
        }
    });
    assert_same(&plain, &marked, "the run with markers");
}

/// Entities that change archetype while it runs, and others that are spawned and despawned beside them.
#[test]
fn archetype_moves_do_not_matter() {
    let run_once = |moves: bool| {
        let mut app = app();
        let all = scene(&mut app, 12, |_| {});
        let mut hashes = Vec::new();
        for tick in 0..60_usize {
            if moves {
                app.world_mut().entity_mut(all[tick % all.len()]).insert(Marker);
                app.world_mut().entity_mut(all[tick * 7 % all.len()]).remove::<Marker>();
                let unrelated = app.world_mut().spawn((Marker, Transform::default())).id();
                app.world_mut().despawn(unrelated);
            }
            run(&mut app, 1);
            hashes.push(hash(&app, &all));
        }
        hashes
    };
    assert_same(&run_once(false), &run_once(true), "the run with moves");
}

/// Large enough for every stage to use all threads: a rope, a cloth, and a pile of balls.
fn large_scene(app: &mut App) -> Vec<Entity> {
    let rope = |spring: Spring| spring.with_stiffness(400.0).with_damping(0.2);
    let mut all = spawn_rope(app, Vec3::new(-30.0, 9.0, 0.0), 5000, 0.05, rope);
    let width = 130;
    let first = all.len();
    for slot in 0..width * width {
        let place = Vec3::new((slot % width) as f32 * 0.1, 8.0, 20.0 + (slot / width) as f32 * 0.1);
        let particle = spawn(app, 0.01, 0.0, place);
        all.push(particle);
        for (exists, back) in [(slot % width > 0, 1), (slot >= width, width)] {
            if exists {
                let other = all[first + slot - back];
                join(app, Spring::new(other, particle, 0.1).with_stiffness(100.0).with_damping(0.1));
            }
        }
    }
    for ball in 0..4000_u16 {
        let (column, row, layer) = (ball % 16, ball / 16 % 16, ball / 256);
        // Not quite a lattice, which would not collapse.
        let jitter = Vec3::new(f32::from(ball % 11 * 7 % 11), 0.0, f32::from(ball % 13)) * 0.002;
        let corner = Vec3::new(f32::from(column), f32::from(layer), f32::from(row)) * 0.23;
        all.push(spawn(app, 1.0, 0.1, corner + jitter + Vec3::new(10.0, 0.11, 0.0)));
    }
    all
}

const LARGE_TICKS: u32 = 60;

/// Ticks beside a stiff rope, where `Auto` runs two schemes, and as many of position-based dynamics.
const OTHER_TICKS: u32 = 10;

/// Ticks of nets by each scheme.
const NET_TICKS: u32 = 2;

const THREADS: &str = "MASS_SPRING_TEST_THREADS";

/// An app on as many threads as the environment says, which it prints; `None` if that says nothing.
fn app_on_threads() -> Option<App> {
    let threads = std::env::var(THREADS).ok().and_then(|threads| threads.parse().ok())?;
    let compute = TaskPoolThreadAssignmentPolicy {
        min_threads: threads,
        max_threads: threads,
        percent: 1.0,
        on_thread_spawn: None,
        on_thread_destroy: None,
    };
    let options = TaskPoolOptions { max_total_threads: threads + 2, compute, ..TaskPoolOptions::default() };
    let app = app_on(options, MassSpringPlugin::default());
    println!("threads {}", ComputeTaskPool::get().thread_num());
    Some(app)
}

/// A rope that resists bending, a cloth and a balloon in gusty wind, above a floor; and, if wanted, a soft cloth, so large
/// that its springs and the air on it are shared among all threads.
fn nets_in_wind(app: &mut App, with_large: bool) -> Vec<Entity> {
    app.world_mut().spawn(ParticleCollider::default());
    let mut environment = app.world_mut().resource_mut::<Environment>();
    (environment.wind, environment.air_density) = (Vec3::new(4.0, 0.0, 2.0), 1.2);
    environment.gusts = Some(Gusts::default());
    let rope = Rope::new(10.0).with_segments(200).topology();
    let cloth = Cloth::grid(Vec3::Y * 2.0, Vec3::X, Vec3::Z, UVec2::splat(10)).topology();
    let balloon = Balloon::default().with_subdivisions(1).topology();
    let mut nets =
        vec![(rope, Vec3::Y * 12.0), (cloth, Vec3::X * 20.0), (balloon, Vec3::new(40.0, 0.6, 0.0))];
    if with_large {
        let cloth = Cloth::grid(Vec3::Y * 2.0, Vec3::X * 4.0, Vec3::Z * 4.0, UVec2::splat(80));
        let mut soft = cloth.topology().expect("it is sound");
        soft.springs.iter_mut().for_each(|(_, spring)| (spring.stiffness, spring.damping) = (5.0, 1e-3));
        nets.push((Ok(soft), Vec3::X * 60.0));
    }
    let mut spawn = |(topology, place): (Result<Topology, _>, Vec3)| {
        let topology = topology.expect("it is sound");
        let net = ParticleNet::new(topology.into(), &Transform::from_translation(place));
        app.world_mut().spawn(net.with_pinned([0])).id()
    };
    nets.into_iter().map(&mut spawn).collect()
}

/// The hash of the nets after each tick.
fn net_history(app: &mut App, nets: &[Entity], ticks: u32) -> Vec<u64> {
    let step = |_| {
        run(app, 1);
        let mut hasher = DefaultHasher::new();
        for net in nets {
            let net = app.world().get::<ParticleNet>(*net).expect("it exists");
            for value in net.positions().iter().chain(net.velocities()).flat_map(|value| value.to_array()) {
                value.to_bits().hash(&mut hasher);
            }
        }
        hasher.finish()
    };
    (0..ticks).map(step).collect()
}

/// Not a test but the child process of the last one: nets, by every scheme.
#[test]
#[ignore = "run by the_number_of_threads_does_not_matter_to_nets"]
fn child_prints_the_history_of_nets() {
    let Some(mut app) = app_on_threads() else { return };
    for integrator in Integrator::named() {
        // The implicit schemes share nothing but the air.
        let is_implicit = matches!(integrator, Integrator::ImplicitEuler | Integrator::TrBdf2);
        let nets = nets_in_wind(&mut app, !is_implicit);
        app.insert_resource(common::scheme(integrator, if is_implicit { 1 } else { 8 }));
        for hash in net_history(&mut app, &nets, NET_TICKS) {
            println!("hash {hash}");
        }
        nets.into_iter().for_each(|net| _ = app.world_mut().despawn(net));
    }
}

/// Not a test but the child process of the next one: task pools are made once in a process.
#[test]
#[ignore = "run by the_number_of_threads_does_not_matter"]
fn child_prints_its_history() {
    let Some(mut app) = app_on_threads() else { return };
    let mut all = scene(&mut app, 20, |_| {});
    all.extend(large_scene(&mut app));
    let mut hashes = history(&mut app, &all, LARGE_TICKS);
    let snapshot = Snapshot::take(app.world());
    let more = LARGE_TICKS..LARGE_TICKS + OTHER_TICKS;
    let followed = history_of(&mut app, &all, more.clone());
    snapshot.restore(app.world_mut());
    assert_same(&followed, &history_of(&mut app, &all, more), "what follows a snapshot that was put back");
    hashes.extend(followed);
    all.extend(spawn_rope(&mut app, Vec3::Y * 20.0, 12, 0.05, |spring| spring.with_stiffness(1e9)));
    hashes.extend(history(&mut app, &all, OTHER_TICKS));
    assert!(report(&app).stiff_substeps > 0, "{}", report(&app).schemes());
    app.insert_resource(common::scheme(Integrator::Xpbd, 4));
    hashes.extend(history(&mut app, &all, OTHER_TICKS));
    for hash in hashes {
        println!("hash {hash}");
    }
    println!("hash {}", dense_pile());
    sleeping_pile().into_iter().for_each(|hash| println!("hash {hash}"));
}

/// The state of a dense pile of balls after two ticks, large enough for its contacts to be solved in slabs.
fn dense_pile() -> u64 {
    let mut state = Solver::default();
    for ball in 0..40_u16.pow(2) * 21 {
        let (column, row, layer) = (ball % 40, ball / 40 % 40, ball / 1600);
        let jitter =
            Vec3::new(f32::from(ball % 11 * 7 % 11), f32::from(ball % 17), f32::from(ball % 13)) * 1e-3;
        let corner = Vec3::new(f32::from(column), f32::from(layer), f32::from(row)) * 0.19;
        state.add_particle(corner + jitter, Vec3::ZERO, 1.0, 0.1).unwrap();
    }
    state.add_collider(Collider::half_space(Vec3::ZERO, Vec3::Y, 0.2, 0.3));
    let settings = StepSettings {
        integrator: Integrator::SemiImplicitEuler,
        substeps: SubstepMode::Fixed(4),
        gravity: Vec3::new(0.0, -9.81, 0.0),
        pair_rules: Some(PairRules { restitution: 0.2, friction: 0.3 }),
        ..StepSettings::default()
    };
    for _ in 0..2 {
        state.step(&settings);
    }
    assert!(state.outputs().contact_count > 50_000, "{} contacts", state.outputs().contact_count);
    let mut hasher = DefaultHasher::new();
    common::bodies::solver_bits(&state).hash(&mut hasher);
    hasher.finish()
}

/// Balls, so many that all threads search and solve for them, fall asleep in a box and are woken by one that is thrown: which of them
/// sleep, and the state, every tenth tick and at the end.
fn sleeping_pile() -> Vec<u64> {
    let mut solver = common::sleep::pile(17);
    let settings = common::sleep::settings(Integrator::Auto);
    let (mut hashes, mut most) = (Vec::new(), 0);
    for tick in 0..SLEEP_TICKS {
        if tick == SLEEP_TICKS - 20 {
            assert!(solver.asleep_count() > 0, "nothing sleeps");
            solver.add_particle(Vec3::new(1.0, 4.5, 1.0), Vec3::NEG_Y * 20.0, 5.0, 0.2).unwrap();
        }
        solver.step(&settings);
        most = most.max(solver.asleep_count());
        if tick % 10 == 9 {
            let mut hasher = DefaultHasher::new();
            common::bodies::solver_bits(&solver).hash(&mut hasher);
            (0..solver.particle_count()).for_each(|slot| solver.is_asleep(slot).hash(&mut hasher));
            hashes.push(hasher.finish());
        }
    }
    assert!(solver.asleep_count() < most, "nothing was woken");
    hashes
}

/// Ticks of the pile that falls asleep.
const SLEEP_TICKS: u32 = 120;

fn history_on(threads: usize, name: &str) -> Vec<u64> {
    let child = Command::new(std::env::current_exe().expect("the path of the test binary is available"))
        .args(["--exact", name, "--ignored", "--nocapture"])
        .env(THREADS, threads.to_string())
        .output()
        .expect("the test binary starts");
    let output = String::from_utf8_lossy(&child.stdout);
    assert!(child.status.success(), "{output}{}", String::from_utf8_lossy(&child.stderr));
    // The harness prints on the same lines.
    let numbers = |word: &str| {
        let mut words = output.split_whitespace();
        let mut numbers: Vec<u64> = Vec::new();
        while words.any(|other| other == word) {
            numbers.extend(words.next().and_then(|number| number.parse::<u64>().ok()));
        }
        numbers
    };
    assert!(numbers("threads").contains(&(threads as u64)), "the pool has another size: {output}");
    numbers("hash")
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let name = "child_prints_its_history";
    let one = history_on(1, name);
    assert_eq!(one.len(), (LARGE_TICKS + 3 * OTHER_TICKS + SLEEP_TICKS / 10) as usize + 1);
    for threads in [2, 3, 8] {
        assert_same(&one, &history_on(threads, name), &format!("the run on {threads} threads"));
    }
}

#[test]
fn the_number_of_threads_does_not_matter_to_nets() {
    let name = "child_prints_the_history_of_nets";
    let one = history_on(1, name);
    assert_eq!(one.len(), Integrator::named().count() * NET_TICKS as usize);
    assert!(one.windows(2).all(|pair| pair[0] != pair[1]), "something moves in every tick");
    for threads in [2, 3, 8] {
        assert_same(&one, &history_on(threads, name), &format!("the run on {threads} threads"));
    }
}

/// The hashes of scenes after 150 ticks: see `golden_hash`. Taken on x86_64, where the vectorised and the
/// plain kernel give the same bits, and Linux, whose C library computes the sines that place the balls.
#[cfg(all(target_arch = "x86_64", target_os = "linux"))]
const GOLDEN: [(&str, u64); 6] = [
    ("springs", 0xff8b_6eec_9875_ee6b),
    ("contacts", 0xed1c_0414_f652_d4e1),
    ("implicit Euler", 0x3d9e_138d_a2e5_8669),
    ("TR-BDF2", 0xbfdf_4da3_cd05_02e2),
    ("XPBD", 0xaef5_6717_aac2_f43c),
    ("two schemes", 0x56a9_e9c7_0e57_2422),
];

/// Guards against unintended changes of results: springs, anchors, the ground, gather and scatter in all
/// scenes, and what each is named after.
#[cfg(all(target_arch = "x86_64", target_os = "linux"))]
#[test]
fn the_golden_hashes_are_unchanged() {
    let found = GOLDEN.map(|(name, _)| (name, golden_hash(name)));
    let table: String = found
        .iter()
        .map(|(name, hash)| {
            let digits = format!("{hash:016x}");
            let groups: Vec<&str> = (0..4).map(|group| &digits[4 * group..][..4]).collect();
            format!("    ({name:?}, 0x{}),\n", groups.join("_"))
        })
        .collect();
    assert!(
        found == GOLDEN,
        "the results have changed in some bit. If that is intended (say why in CHANGELOG.md), the entries of \
         GOLDEN in tests/determinism.rs become\n\n{table}"
    );
}

/// The hash of a cloth and a rope, and what `name` says, after 150 ticks.
#[cfg(all(target_arch = "x86_64", target_os = "linux"))]
fn golden_hash(name: &str) -> u64 {
    let mut app = app();
    let balls = if name == "contacts" { 20 } else { 0 };
    app.world_mut().resource_mut::<CollisionSettings>().particles = balls > 0;
    let mut all = scene(&mut app, balls, |_| {});
    match name {
        "implicit Euler" => {
            app.insert_resource(common::scheme(Integrator::ImplicitEuler, 2));
        }
        "TR-BDF2" => {
            app.insert_resource(common::scheme(Integrator::TrBdf2, 2));
        }
        "XPBD" => {
            app.insert_resource(common::scheme(Integrator::Xpbd, 8));
        }
        "two schemes" => {
            all.extend(spawn_rope(&mut app, Vec3::Y * 20.0, 12, 0.05, |spring| spring.with_stiffness(1e9)));
        }
        _ => {}
    }
    let hash = *history(&mut app, &all, TICKS).last().expect("some ticks were run");
    assert_eq!(report(&app).stiff_substeps > 0, name == "two schemes", "{}", report(&app).schemes());
    // More than the planes alone could have, soon at least: balls touch balls.
    let touch = |_| {
        app.update();
        report(&app).contacts > usize::from(balls)
    };
    assert!(balls == 0 || (0..100).any(touch), "{} contacts", report(&app).contacts);
    hash
}
