//! Any number of threads: child processes run the same on pools of several sizes, as those are made once in a process.

use std::ffi::OsStr;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::process::Command;

use bevy::app::{TaskPoolOptions, TaskPoolThreadAssignmentPolicy};
use bevy::prelude::*;
use bevy::tasks::ComputeTaskPool;
use bevy_mass_spring::prelude::*;

use crate::common::{self, *};
use crate::scenes::{
    COLLIDER_TICKS, HEAP_TICKS, SLEEP_TICKS, dense_pile, histories_among_colliders, large_scene,
    nets_in_wind, ropes_that_touch_nothing, scene, sleeping_pile,
};
use crate::{assert_same, history, history_of};

const LARGE_TICKS: u32 = 60;

/// Ticks beside a stiff rope, where `Auto` runs two schemes, and as many of position-based dynamics.
const OTHER_TICKS: u32 = 10;

/// Ticks of nets by each scheme.
const NET_TICKS: u32 = 2;

/// The schemes that take all substeps of a block of particles one after the other.
const IN_PLACE: [Integrator; 2] = [Integrator::SemiImplicitEuler, Integrator::VelocityVerlet];

/// Ticks before the first snapshot.
#[cfg(feature = "scene")]
const SNAPSHOT_TICKS: u32 = 30;

/// Ticks after each snapshot.
#[cfg(feature = "scene")]
const FOLLOWED_TICKS: u32 = 2;

const THREADS: &str = "MASS_SPRING_TEST_THREADS";

/// The file of snapshots that one child process writes and another one reads.
const SNAPSHOTS: &str = "MASS_SPRING_TEST_SNAPSHOTS";

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
    // Each thread takes blocks of ropes through all substeps of a tick.
    let ropes = ropes_that_touch_nothing(&mut app);
    for integrator in IN_PLACE {
        app.insert_resource(common::scheme(integrator, 8));
        for hash in net_history(&mut app, &ropes, NET_TICKS) {
            println!("hash {hash}");
        }
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

/// Not a test but the child process of another one. It takes a snapshot under each scheme, prints what follows each, and compares
/// what follows when it is put back. It writes the snapshots to a file; if that exists it reads them instead, and prints what
/// follows them in its app.
#[cfg(feature = "scene")]
#[test]
#[ignore = "run by a_snapshot_is_read_on_another_number_of_threads"]
fn child_follows_snapshots() {
    let Some(mut app) = app_on_threads() else { return };
    let path = std::env::var_os(SNAPSHOTS).expect("the parent names a file");
    let mut all = scene(&mut app, 20, |_| {});
    all.extend(large_scene(&mut app));
    let written: Option<Vec<Snapshot>> = std::fs::read_to_string(&path)
        .ok()
        .map(|text| ron::from_str(&text).expect("it was written by a child"));
    // Balls touch by then.
    let ticks = if written.is_some() { 1 } else { SNAPSHOT_TICKS };
    run(&mut app, ticks);
    let mut taken = Vec::new();
    for (number, integrator) in Integrator::ALL.into_iter().enumerate() {
        let settings = match integrator {
            Integrator::Auto => SolverSettings::default(),
            Integrator::ImplicitEuler | Integrator::TrBdf2 => common::scheme(integrator, 1),
            _ => common::scheme(integrator, 8),
        };
        app.insert_resource(settings);
        let follow = |app: &mut App| history(app, &all, FOLLOWED_TICKS);
        let followed = if let Some(written) = &written {
            written[number].restore_in_order(app.world_mut()).expect("it is the same scene");
            follow(&mut app)
        } else {
            // What schemes remember is of a tick of their own.
            run(&mut app, 1);
            let snapshot = Snapshot::take(app.world());
            let followed = follow(&mut app);
            snapshot.restore(app.world_mut());
            assert_same(
                &followed,
                &follow(&mut app),
                &format!("{integrator}: what follows a snapshot that was put back"),
            );
            snapshot.restore(app.world_mut());
            taken.push(snapshot);
            followed
        };
        followed.into_iter().for_each(|hash| println!("hash {hash}"));
    }
    if written.is_none() {
        std::fs::write(path, ron::to_string(&taken).expect("a snapshot can be written"))
            .expect("the folder exists");
    }
}

/// Not a test but the child process of another one: colliders of every shape.
#[test]
#[ignore = "run by the_number_of_threads_does_not_matter_among_colliders"]
fn child_prints_the_history_among_colliders() {
    let Some(_app) = app_on_threads() else { return };
    histories_among_colliders().into_iter().for_each(|hash| println!("hash {hash}"));
}

fn history_on(threads: usize, name: &str) -> Vec<u64> {
    history_with(threads, name, "")
}

/// The history that a child process prints, with a file of snapshots.
fn history_with(threads: usize, name: &str, snapshots: impl AsRef<OsStr>) -> Vec<u64> {
    let child = Command::new(std::env::current_exe().expect("the path of the test binary is available"))
        .args(["--exact", name, "--ignored", "--nocapture"])
        .env(THREADS, threads.to_string())
        .env(SNAPSHOTS, snapshots)
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
    let name = "threads::child_prints_its_history";
    let one = history_on(1, name);
    assert_eq!(one.len(), (LARGE_TICKS + 3 * OTHER_TICKS + SLEEP_TICKS / 10) as usize + 1);
    for threads in [2, 3, 8] {
        assert_same(&one, &history_on(threads, name), &format!("the run on {threads} threads"));
    }
}

/// A snapshot of each scheme, written on one thread and read on others, in another process.
#[cfg(feature = "scene")]
#[test]
fn a_snapshot_is_read_on_another_number_of_threads() {
    let name = "threads::child_follows_snapshots";
    let folder = tempfile::tempdir().expect("there is a folder for temporary files");
    let path = folder.path().join("snapshots.ron");
    let one = history_with(1, name, &path);
    assert_eq!(one.len(), Integrator::ALL.len() * FOLLOWED_TICKS as usize);
    assert!(one.windows(2).all(|pair| pair[0] != pair[1]), "something moves in every tick");
    for threads in [1, 8] {
        let other = history_with(threads, name, &path);
        assert_same(&one, &other, &format!("what follows the snapshots on {threads} threads"));
    }
}

#[test]
fn the_number_of_threads_does_not_matter_to_nets() {
    let name = "threads::child_prints_the_history_of_nets";
    let one = history_on(1, name);
    assert_eq!(one.len(), (Integrator::named().count() + IN_PLACE.len()) * NET_TICKS as usize);
    assert!(one.windows(2).all(|pair| pair[0] != pair[1]), "something moves in every tick");
    for threads in [2, 3, 8] {
        assert_same(&one, &history_on(threads, name), &format!("the run on {threads} threads"));
    }
}

#[test]
fn the_number_of_threads_does_not_matter_among_colliders() {
    let name = "threads::child_prints_the_history_among_colliders";
    let one = history_on(1, name);
    assert_eq!(one.len(), (5 * COLLIDER_TICKS + 2 * HEAP_TICKS) as usize);
    assert!(one.windows(2).all(|pair| pair[0] != pair[1]), "something moves in every tick");
    for threads in [2, 3, 8] {
        assert_same(&one, &history_on(threads, name), &format!("the run on {threads} threads"));
    }
}
