//! Springs whose particle is despawned.

use bevy::prelude::*;
use bevy_mass_spring::prelude::*;

use crate::common::logged::Logged;
use crate::common::*;

/// A rope and its springs.
fn rope(app: &mut App, count: usize) -> (Vec<Entity>, Vec<Entity>) {
    let rope = spawn_rope(app, Vec3::Y * 5.0, count, 0.1, |spring| spring);
    let mut springs = app.world_mut().query_filtered::<Entity, With<Spring>>();
    let mut springs: Vec<Entity> = springs.iter(app.world()).collect();
    springs.sort_unstable_by_key(|spring| spring.index_u32());
    (rope, springs)
}

fn existing(app: &App, springs: &[Entity]) -> Vec<usize> {
    (0..springs.len()).filter(|number| app.world().get_entity(springs[*number]).is_ok()).collect()
}

#[test]
fn a_despawned_particle_takes_its_springs_along() {
    let logged = Logged::start();
    let mut app = app();
    let (rope, springs) = rope(&mut app, 10);
    run(&mut app, 3);
    app.world_mut().despawn(rope[4]);
    run(&mut app, 1);
    assert_eq!(existing(&app, &springs), [0, 1, 2, 5, 6, 7, 8]);
    assert_eq!((report(&app).particles, report(&app).springs), (9, 7));
    run(&mut app, 5);
    assert_eq!((report(&app).particles, report(&app).springs), (9, 7));
    logged.assert_silent();
}

#[test]
fn many_at_once_take_theirs_along() {
    let logged = Logged::start();
    for (count, gone) in [(30, 10..20), (12, 1..11), (300, 100..110)] {
        let mut app = app();
        let (rope, springs) = rope(&mut app, count);
        run(&mut app, 3);
        for particle in &rope[gone.clone()] {
            app.world_mut().despawn(*particle);
        }
        run(&mut app, 2);
        let left: Vec<usize> =
            (0..count - 1).filter(|spring| *spring + 1 < gone.start || *spring >= gone.end).collect();
        assert_eq!(existing(&app, &springs), left);
        assert_eq!((report(&app).particles, report(&app).springs), (count - gone.len(), left.len()));
        logged.assert_silent();
    }
}

#[test]
fn one_that_was_just_spawned_takes_its_springs_along() {
    let logged = Logged::start();
    let mut app = app();
    for _ in 0..2 {
        let (rope, springs) = rope(&mut app, 5);
        app.world_mut().despawn(rope[2]);
        run(&mut app, 1);
        assert_eq!(existing(&app, &springs), [0, 3]);
        assert_eq!((report(&app).particles, report(&app).springs), (4, 2));
        for entity in rope {
            let _ = app.world_mut().try_despawn(entity);
        }
        run(&mut app, 1);
        assert_eq!((report(&app).particles, report(&app).springs), (0, 0));
        assert!(existing(&app, &springs).is_empty());
    }
    logged.assert_silent();
}

/// One that is quarantined, or only loses the component.
#[test]
fn particles_that_take_no_part_take_their_springs_along_when_they_are_despawned() {
    let logged = Logged::start();
    let mut app = app();
    let (rope, springs) = rope(&mut app, 6);
    run(&mut app, 3);
    app.world_mut().entity_mut(rope[2]).insert(Quarantined);
    run(&mut app, 2);
    assert_eq!(existing(&app, &springs), [0, 1, 2, 3, 4]);
    app.world_mut().despawn(rope[2]);
    run(&mut app, 1);
    assert_eq!(existing(&app, &springs), [0, 3, 4]);
    logged.assert_silent();
    // A particle that ceases to be one is not gone: its springs wait, and are named.
    app.world_mut().entity_mut(rope[5]).remove::<Particle>();
    run(&mut app, 1);
    let line = logged.take_one();
    assert!(line.contains(&springs[4].to_string()) && line.contains(&rope[5].to_string()), "{line}");
    assert_eq!(existing(&app, &springs), [0, 3, 4]);
    app.world_mut().despawn(rope[5]);
    run(&mut app, 3);
    logged.assert_silent();
}

#[test]
fn they_are_kept_on_request_with_one_warning_each() {
    let logged = Logged::start();
    let mut app = app();
    app.insert_resource(OrphanedSprings::Keep);
    let (rope, springs) = rope(&mut app, 10);
    run(&mut app, 3);
    app.world_mut().despawn(rope[9]);
    run(&mut app, 5);
    let line = logged.take_one();
    assert!(line.contains(&springs[8].to_string()) && line.contains(&rope[9].to_string()), "{line}");
    app.world_mut().despawn(rope[4]);
    run(&mut app, 5);
    assert_eq!(logged.take().len(), 2);
    assert_eq!(existing(&app, &springs).len(), 9);
    assert_eq!((report(&app).particles, report(&app).springs), (8, 6));
    // It works again with another end.
    let new = spawn(&mut app, 0.1, 0.0, Vec3::Y * 5.0 + Vec3::X * 0.4);
    app.world_mut().get_mut::<Spring>(springs[3]).expect("it is kept").particles[1] = new;
    app.world_mut().get_mut::<Spring>(springs[4]).expect("it is kept").particles[0] = new;
    run(&mut app, 1);
    assert_eq!((report(&app).particles, report(&app).springs), (9, 8));
    logged.assert_silent();
}
