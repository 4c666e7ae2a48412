//! The same bits at every step: on repeated runs, with any number of threads, and in any archetypes.

#[path = "../common/mod.rs"]
mod common;
#[cfg(all(target_arch = "x86_64", target_os = "linux"))]
mod golden;
mod scenes;
mod threads;

use bevy::prelude::*;
use bevy_mass_spring::prelude::*;
use common::*;
use scenes::scene;

#[derive(Component)]
struct Marker;

#[derive(Component)]
#[component(storage = "SparseSet")]
struct SparseMarker;

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
