//! What follows after a snapshot was put back is to the last bit what followed when it was taken.

use bevy::prelude::*;
use bevy_mass_spring::prelude::*;

use crate::common::{app, position, report, run, spawn};
use crate::stage::{Scene, Stage};

const TAKEN: u32 = 40;
const FOLLOWED: u32 = 40;

fn for_each_case(check: impl Fn(Scene, Integrator, &str)) {
    for scene in Scene::ALL {
        for integrator in Integrator::ALL {
            check(scene, integrator, &format!("{scene:?}, {integrator}"));
        }
    }
}

/// The stage at the tick when the snapshot was taken.
fn back(stage: &mut Stage) -> &mut Stage {
    stage.tick = TAKEN;
    stage
}

#[test]
fn a_snapshot_restores_all_that_matters() {
    for_each_case(|scene, integrator, what| {
        let mut stage = Stage::new(scene, integrator);
        stage.run_to(TAKEN);
        let snapshot = Snapshot::take(stage.app.world());
        let expected = stage.follow(FOLLOWED);
        assert!(expected.windows(2).all(|pair| pair[0] != pair[1]), "{what}: nothing moves");
        for round in 0..2 {
            snapshot.restore(stage.app.world_mut());
            back(&mut stage).assert_follows(&expected, &format!("{what}, round {round}"));
        }
        // What is edited in the meantime returns to what it was.
        disturb(&mut stage);
        snapshot.restore(stage.app.world_mut());
        back(&mut stage).assert_follows(&expected, &format!("{what}, edited"));
    });
}

/// Changes everything that a snapshot holds, but for despawning.
fn disturb(stage: &mut Stage) {
    let world = stage.app.world_mut();
    for (number, &particle) in stage.names.particles.iter().enumerate() {
        let mut entity = world.entity_mut(particle);
        match number % 6 {
            0 => entity.get_mut::<Particle>().expect("it is one").mass *= 3.0,
            1 => entity.get_mut::<Particle>().expect("it is one").radius += 0.01,
            2 => entity.get_mut::<Transform>().expect("it has one").translation += Vec3::Y,
            3 => {
                entity.insert(AppliedForce(Vec3::ONE));
            }
            4 if entity.contains::<Pinned>() => {
                entity.remove::<Pinned>();
            }
            4 => {
                entity.insert(Pinned);
            }
            _ => {
                entity.insert(Quarantined);
            }
        }
    }
    for (number, &spring) in stage.names.springs.iter().enumerate() {
        let Some(mut spring) = world.get_mut::<Spring>(spring) else { continue };
        match number % 4 {
            0 => spring.stiffness *= 0.5,
            1 => spring.particles.swap(0, 1),
            2 => spring.rest_length = -1.0,
            _ => {}
        }
    }
    stage.follow(3);
}

#[test]
fn a_snapshot_fits_into_another_app() {
    for_each_case(|scene, integrator, what| {
        let mut stage = Stage::new(scene, integrator);
        stage.run_to(TAKEN);
        let snapshot = Snapshot::take(stage.app.world());
        let expected = stage.follow(FOLLOWED);
        let mut other = Stage::elsewhere(scene, integrator);
        assert_ne!(other.names.particles, stage.names.particles);
        other.run_to(scene.settled_at());
        assert_eq!(snapshot.restore_in_order(other.app.world_mut()), Ok(()), "{what}");
        back(&mut other).assert_follows(&expected, what);
    });
}

/// A snapshot that was taken in the frame in which entities were despawned, before any tick has seen it.
#[test]
fn what_was_just_despawned_means_nothing_elsewhere() {
    let start = |mut stage: Stage| {
        stage.run_to(10);
        let particle = stage.names.particles.remove(4);
        stage.app.world_mut().despawn(particle);
        let spring = stage.names.springs.remove(0);
        stage.app.world_mut().despawn(spring);
        stage
    };
    for scene in [Scene::Ropes, Scene::PileWithSprings] {
        let mut stage = start(Stage::new(scene, Integrator::Auto));
        let snapshot = Snapshot::take(stage.app.world());
        let expected = stage.follow(FOLLOWED);
        // With other numbers of entities: what is dead here may be alive there.
        let shifted = (0..4).map(|count| {
            let mut app = app();
            for _ in 0..count {
                app.world_mut().spawn_empty();
            }
            Stage::in_app(app, scene, Integrator::Auto)
        });
        for mut other in shifted.chain([Stage::elsewhere(scene, Integrator::Auto)]) {
            // The game there does the same, and the simulation has taken note of it.
            other = start(other);
            assert_eq!(snapshot.restore_in_order(other.app.world_mut()), Ok(()));
            other.tick = 10;
            other.assert_follows(&expected, &format!("{scene:?}"));
        }
    }
}

#[cfg(feature = "scene")]
#[test]
fn a_snapshot_survives_writing_and_reading() {
    for scene in Scene::ALL {
        let mut stage = Stage::new(scene, Integrator::Auto);
        stage.run_to(TAKEN);
        let written = ron::to_string(&Snapshot::take(stage.app.world())).expect("it can be written");
        let snapshot: Snapshot = ron::from_str(&written).expect("what was written can be read");
        let expected = stage.follow(FOLLOWED);
        snapshot.restore(stage.app.world_mut());
        back(&mut stage).assert_follows(&expected, &format!("{scene:?}"));
        let mut other = Stage::elsewhere(scene, Integrator::Auto);
        other.run_to(scene.settled_at());
        assert_eq!(snapshot.restore_in_order(other.app.world_mut()), Ok(()));
        back(&mut other).assert_follows(&expected, &format!("{scene:?} elsewhere"));
    }
}

#[test]
fn a_snapshot_of_another_scene_is_refused() {
    let mut stage = Stage::new(Scene::PileWithSprings, Integrator::Auto);
    stage.run_to(5);
    let snapshot = Snapshot::take(stage.app.world());
    let counts = [stage.names.particles.len(), stage.names.springs.len(), 2];
    for (index, what) in ["particles", "springs", "colliders"].into_iter().enumerate() {
        let [mut other, mut undisturbed] = [(); 2].map(|()| {
            let mut other = Stage::new(Scene::PileWithSprings, Integrator::Auto);
            let (first, second) = (other.names.particles[0], other.names.particles[20]);
            let world = other.app.world_mut();
            match index {
                0 => world.spawn((Particle::default(), Transform::from_xyz(9.0, 9.0, 9.0))),
                1 => world.spawn(Spring::new(first, second, 0.5)),
                _ => world.spawn(ParticleCollider::default()),
            };
            other.run_to(3);
            other
        });
        let error = snapshot.restore_in_order(other.app.world_mut()).expect_err("it does not fit");
        assert_eq!((error.what, error.expected, error.found), (what, counts[index], counts[index] + 1));
        let message = format!("the snapshot has {} {what}, the world {}", error.expected, error.found);
        assert_eq!(error.to_string(), message);
        other.assert_follows(&undisturbed.follow(20), what);
    }
}

/// What was spawned since keeps its components and goes on as if it had just been spawned; what was despawned since
/// stays away.
#[test]
fn restoring_leaves_later_entities_alone() {
    let mut stage = Stage::new(Scene::Ropes, Integrator::Auto);
    stage.run_to(TAKEN);
    let snapshot = Snapshot::take(stage.app.world());
    let expected = stage.follow(FOLLOWED);
    let late = spawn(&mut stage.app, 1.0, 0.0, Vec3::new(20.0, 9.0, 0.0));
    stage.follow(20);
    let fallen = crate::common::bits(&stage.app, late);
    snapshot.restore(stage.app.world_mut());
    assert_eq!(crate::common::bits(&stage.app, late), fallen);
    back(&mut stage).assert_follows(&expected, "with one more particle");
    assert_eq!(report(&stage.app).particles, stage.names.particles.len() + 1);
    let left = stage.names.particles.pop().expect("there are some");
    stage.app.world_mut().despawn(left);
    run(&mut stage.app, 1);
    snapshot.restore(stage.app.world_mut());
    run(&mut stage.app, 1);
    assert_eq!(report(&stage.app).particles, stage.names.particles.len() + 1);
    assert_eq!(report(&stage.app).springs, stage.names.springs.len() - 1);
}

/// A plane that was spawned since stays, one that was despawned stays away.
#[test]
fn restoring_leaves_later_planes_alone() {
    let mut app = app();
    let ground = app.world_mut().spawn(ParticleCollider::default()).id();
    let ball = spawn(&mut app, 1.0, 0.1, Vec3::Y * 0.1);
    run(&mut app, 10);
    let snapshot = Snapshot::take(app.world());
    let step = app.world_mut().spawn((ParticleCollider::default(), Transform::from_xyz(0.0, 0.05, 0.0))).id();
    for _ in 0..2 {
        snapshot.restore(app.world_mut());
        run(&mut app, 5);
        assert!((position(&app, ball).y - 0.15).abs() < 1e-4, "{}", position(&app, ball));
    }
    app.world_mut().despawn(step);
    snapshot.restore(app.world_mut());
    run(&mut app, 5);
    assert_eq!(position(&app, ball), Vec3::Y * 0.1);
    app.world_mut().despawn(ground);
    snapshot.restore(app.world_mut());
    run(&mut app, 5);
    assert_eq!(report(&app).contacts, 0);
    assert!(position(&app, ball).y < 0.1);
}

/// In the frame in which a snapshot was put back entities are despawned and spawned as in any other.
#[test]
fn changes_right_after_restoring_count() {
    let mut stage = Stage::new(Scene::Ropes, Integrator::Auto);
    stage.run_to(20);
    let snapshot = Snapshot::take(stage.app.world());
    let edit = |stage: &mut Stage| {
        let particle = stage.names.particles.remove(3);
        stage.app.world_mut().despawn(particle);
        let last = *stage.names.particles.last().expect("there are some");
        let new = spawn(&mut stage.app, 0.1, 0.0, Vec3::new(1.0, 1.2, 1.0));
        stage.app.world_mut().spawn(Spring::new(last, new, 0.2));
        stage.names.particles.push(new);
    };
    let mut other = Stage::elsewhere(Scene::Ropes, Integrator::Auto);
    edit(&mut stage);
    let expected = stage.follow(30);
    // All slots there are others by then.
    let extra = spawn(&mut other.app, 1.0, 0.0, Vec3::Y * 30.0);
    run(&mut other.app, 1);
    other.app.world_mut().despawn(extra);
    snapshot.restore_in_order(other.app.world_mut()).expect("it fits");
    edit(&mut other);
    other.tick = 20;
    other.assert_follows(&expected, "edited at once");
    assert_eq!(report(&stage.app).springs, report(&other.app).springs);
}

/// The initial state of an app is what each entity was in the first tick there, wherever a snapshot came from.
#[test]
fn the_initial_state_is_that_of_the_app() {
    let mut stage = Stage::new(Scene::Ropes, Integrator::Auto);
    stage.run_to(20);
    let snapshot = Snapshot::take(stage.app.world());
    let start = stage.bits();
    let expected = stage.follow(30);
    let mut other = Stage::elsewhere(Scene::Ropes, Integrator::Auto);
    snapshot.restore_in_order(other.app.world_mut()).expect("it fits");
    other.tick = 20;
    other.assert_follows(&expected, "restored");
    RestoreInitialState.apply(other.app.world_mut());
    // The anchor has been moved before its first tick.
    assert_eq!(other.bits()[1..], start[1..]);
}

#[cfg(feature = "interpolation")]
mod between_ticks {
    use std::time::Duration;

    use bevy::time::TimeUpdateStrategy;

    use super::*;
    use crate::common::{TICK, app_with};
    use crate::stage::Bits;

    /// Positions and velocities at the end of each tick, before interpolation shows others.
    #[derive(Resource, Default)]
    struct Recorded(Vec<Bits>);

    fn record(particles: Query<(&Transform, &ParticleVelocity)>, mut recorded: ResMut<Recorded>) {
        let bits = |(transform, velocity): (&Transform, &ParticleVelocity)| {
            let [a, b, c] = transform.translation.to_array();
            let [d, e, f] = velocity.0.to_array();
            [a, b, c, d, e, f].map(f32::to_bits)
        };
        recorded.0.push(particles.iter().map(bits).collect());
    }

    #[test]
    fn a_snapshot_between_ticks_is_that_of_the_last_one() {
        for scene in [Scene::Pile, Scene::PileWithSprings, Scene::TwoSchemes] {
            let interpolation = MassSpringPlugin::default().with_interpolation(true);
            let mut stage = Stage::in_app(app_with(interpolation), scene, Integrator::Auto);
            stage.app.init_resource::<Recorded>().add_systems(FixedLast, record);
            let frame = Duration::from_secs_f32(0.3 * TICK);
            stage.app.insert_resource(TimeUpdateStrategy::ManualDuration(frame));
            // Nothing is driven here: only time passes.
            run(&mut stage.app, 100);
            let take =
                |stage: &mut Stage| std::mem::take(&mut stage.app.world_mut().resource_mut::<Recorded>().0);
            assert!((29..=31).contains(&take(&mut stage).len()));
            let snapshot = Snapshot::take(stage.app.world());
            run(&mut stage.app, 50);
            let expected = take(&mut stage);
            for frames in [1, 2, 3, 4] {
                run(&mut stage.app, frames);
                take(&mut stage);
                snapshot.restore(stage.app.world_mut());
                run(&mut stage.app, 52);
                let found = take(&mut stage);
                let common = expected.len().min(found.len());
                assert!(common >= 14 && found[..common] == expected[..common], "{scene:?}, {frames} frames");
            }
        }
    }
}
