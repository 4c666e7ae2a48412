//! Bends as entities: registered, pending, disabled, restored as springs are.

use bevy::ecs::entity_disabling::Disabled;
use bevy::prelude::*;
use bevy_mass_spring::prelude::*;

use crate::common::*;

/// A bent rope of nine particles, the first two pinned, with bends of 50 N/m.
fn bent_rope(app: &mut App) -> (Vec<Entity>, Vec<Entity>) {
    plain(app);
    let particles: Vec<Entity> = (0..9)
        .map(|number| {
            let place = Vec3::new(0.1 * number as f32, 0.02 * (number * number % 5) as f32, 0.0);
            if number < 2 { spawn_pinned(app, place) } else { spawn(app, 0.1, 0.0, place) }
        })
        .collect();
    for pair in particles.windows(2) {
        join(app, Spring::new(pair[0], pair[1], 0.1).with_stiffness(100.0));
    }
    let bends = particles.windows(3).map(|three| {
        app.world_mut().spawn(Bend::new(three[0], three[1], three[2]).with_stiffness(50.0)).id()
    });
    let bends = bends.collect();
    (particles, bends)
}

/// Semi-implicit Euler on the force −k s, which on an end of weight 1 is k times what the positions say: v = h k s / m.
#[test]
fn a_bend_entity_pulls_as_its_formula_says() {
    let mut app = app();
    plain(&mut app);
    let ends = [Vec3::ZERO, Vec3::new(0.5, 0.25, 0.0), Vec3::X].map(|place| spawn(&mut app, 0.5, 0.0, place));
    app.world_mut().spawn(Bend::new(ends[0], ends[1], ends[2]).with_stiffness(8.0));
    run(&mut app, 1);
    // s = −0.5 y
    let kick = Vec3::Y * (TICK * 8.0 * 0.5 / 0.5);
    assert_eq!(ends.map(|end| velocity(&app, end)), [kick, -2.0 * kick, kick]);
}

#[test]
fn an_edited_bend_acts_with_its_new_stiffness_and_a_bad_one_not_at_all() {
    let mut app = app();
    plain(&mut app);
    let ends = [Vec3::ZERO, Vec3::new(0.5, 0.25, 0.0), Vec3::X].map(|place| spawn(&mut app, 0.5, 0.0, place));
    let bend = app.world_mut().spawn(Bend::new(ends[0], ends[1], ends[2]).with_stiffness(8.0)).id();
    run(&mut app, 1);
    let set = |app: &mut App, stiffness: f32| {
        app.world_mut().get_mut::<Bend>(bend).expect("it exists").stiffness = stiffness;
        let before = velocity(app, ends[0]);
        run(app, 1);
        velocity(app, ends[0]) - before
    };
    let soft = set(&mut app, 8.0);
    let stiff = set(&mut app, 80.0);
    assert!(stiff.y > 5.0 * soft.y && soft.y > 0.0, "{soft} {stiff}");
    assert_eq!(set(&mut app, -1.0), Vec3::ZERO);
    assert!(set(&mut app, 8.0).length() > 0.0, "corrected, it is back");
}

#[test]
fn a_bend_waits_for_its_end_and_goes_with_it() {
    let mut app = app();
    plain(&mut app);
    let [first, middle] =
        [Vec3::ZERO, Vec3::new(0.5, 0.25, 0.0)].map(|place| spawn(&mut app, 0.5, 0.0, place));
    let last = app.world_mut().spawn_empty().id();
    let bend = app.world_mut().spawn(Bend::new(first, middle, last)).id();
    run(&mut app, 2);
    assert_eq!(velocity(&app, middle), Vec3::ZERO);
    app.world_mut().entity_mut(last).insert((Particle::new(0.5, 0.0), Transform::from_translation(Vec3::X)));
    run(&mut app, 1);
    assert_ne!(velocity(&app, middle), Vec3::ZERO);
    // Disabled it does not act, enabled again it does.
    app.world_mut().entity_mut(bend).insert(Disabled);
    run(&mut app, 1);
    let moving = velocity(&app, middle);
    run(&mut app, 1);
    assert_eq!(velocity(&app, middle), moving);
    app.world_mut().entity_mut(bend).remove::<Disabled>();
    run(&mut app, 1);
    assert_ne!(velocity(&app, middle), moving);
    // A particle that leaves takes its force with it; despawned, the bend too.
    app.world_mut().entity_mut(last).insert(Quarantined);
    run(&mut app, 1);
    let moving = velocity(&app, middle);
    run(&mut app, 1);
    assert_eq!(velocity(&app, middle), moving);
    app.insert_resource(OrphanedSprings::Despawn);
    app.world_mut().entity_mut(last).despawn();
    run(&mut app, 1);
    assert!(app.world().get_entity(bend).is_err());
}

#[test]
fn a_restored_snapshot_goes_on_with_the_same_bits() {
    let mut app = app();
    let (particles, bends) = bent_rope(&mut app);
    run(&mut app, 10);
    let snapshot = Snapshot::take(app.world());
    run(&mut app, 10);
    let expected = hash(&app, &particles);
    app.world_mut().get_mut::<Bend>(bends[3]).expect("it exists").stiffness = 1.0;
    run(&mut app, 5);
    snapshot.restore(app.world_mut());
    run(&mut app, 10);
    assert_eq!(hash(&app, &particles), expected);
    app.world_mut().commands().queue(RestoreInitialState);
    app.world_mut().flush();
    run(&mut app, 20);
    assert_eq!(hash(&app, &particles), expected, "from the initial state");
}
