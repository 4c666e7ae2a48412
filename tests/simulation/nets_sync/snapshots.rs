//! Restarts and snapshots of nets: to the bit, in another app, too.

use bevy::prelude::*;
use bevy_mass_spring::nets::{Breaking, Part, PartOf, Winch};
use bevy_mass_spring::prelude::*;
use bevy_mass_spring::solver::Integrator;

use super::shapes::{cloth, net, net_bits, rope, spawn_net, with_bends};
use crate::common::{app, run, scheme, spawn};

/// A cloth and a rope above the ground, and a ball that falls on them.
fn scene() -> (App, [Entity; 2]) {
    let mut app = app();
    let mut sheet = cloth(8);
    sheet.radius = 0.02;
    app.world_mut().spawn(ParticleCollider::default());
    let nets = [
        spawn_net(&mut app, &sheet, Vec3::new(0.0, 0.5, 0.0), &[0, 7]),
        spawn_net(&mut app, &rope(20), Vec3::new(0.0, 2.0, 5.0), &[0]),
    ];
    spawn(&mut app, 0.2, 0.1, Vec3::new(0.3, 1.0, 0.3));
    (app, nets)
}

fn all_bits(app: &App, nets: [Entity; 2]) -> Vec<[u32; 6]> {
    nets.iter().flat_map(|net| net_bits(app, *net)).collect()
}

#[test]
fn a_restart_repeats_every_bit() {
    let (mut app, nets) = scene();
    run(&mut app, 50);
    let first = all_bits(&app, nets);
    run(&mut app, 20);
    app.world_mut().commands().queue(RestoreInitialState);
    app.world_mut().flush();
    run(&mut app, 50);
    assert_eq!(all_bits(&app, nets), first);
}

#[test]
fn what_follows_a_snapshot_is_to_the_bit_what_followed_before() {
    let (mut app, nets) = scene();
    run(&mut app, 30);
    let snapshot = Snapshot::take(app.world());
    run(&mut app, 30);
    let expected = all_bits(&app, nets);
    let mut net_mut = app.world_mut().get_mut::<ParticleNet>(nets[0]).unwrap();
    net_mut.set_pinned(20, true);
    net_mut.positions_mut()[3] = Vec3::splat(9.0);
    run(&mut app, 5);
    snapshot.restore(app.world_mut());
    run(&mut app, 30);
    assert_eq!(all_bits(&app, nets), expected);
    // In another app in which the same scene was spawned.
    let (mut other, nets) = scene();
    snapshot.restore_in_order(other.world_mut()).unwrap();
    run(&mut other, 30);
    assert_eq!(all_bits(&other, nets), expected);
}

#[test]
fn a_state_without_a_net_registers_it_anew() {
    let (mut app, nets) = scene();
    run(&mut app, 5);
    let snapshot = Snapshot::take(app.world());
    let late = spawn_net(&mut app, &rope(7), Vec3::Y * 4.0, &[0]);
    run(&mut app, 5);
    snapshot.restore(app.world_mut());
    app.world_mut().entity_mut(nets[1]).despawn();
    run(&mut app, 5);
    assert_eq!(app.world().resource::<TickReport>().particles, 64 + 7 + 1);
    assert!(net(&app, late).positions()[6].y < 4.0);
}

/// A sheet that hangs by two corners and is torn by a weight at a third one; and a rope whose winch pays out, beyond what was
/// laid out, too.
fn torn_and_wound() -> (App, [Entity; 2]) {
    let mut app = app();
    let mut sheet = cloth(8);
    sheet.triangles = (0..49_u32)
        .map(|cell| 8 * (cell / 7) + cell % 7)
        .flat_map(|a| [[a, a + 8, a + 1], [a + 1, a + 8, a + 9]])
        .collect();
    sheet.masses[63] = 6.0;
    let torn = spawn_net(&mut app, &sheet, Vec3::Y * 4.0, &[0, 7]);
    app.world_mut().entity_mut(torn).insert(Breaking { strain: Some(0.6), ..default() });
    let wound = spawn_net(&mut app, &with_bends(rope(12)), Vec3::new(0.0, 4.0, 5.0), &[]);
    app.world_mut().spawn((PartOf(wound), Part::Start, Pinned, Winch { speed: 0.2, ..default() }));
    (app, [torn, wound])
}

/// Taken before the first spring breaks and after; put back in the midst of the tear; and from the start.
#[test]
fn snapshots_and_restarts_go_across_a_tear_and_a_winch() {
    let (mut app, nets) = torn_and_wound();
    let counts = |app: &App| nets.map(|net| super::shapes::net(app, net).len());
    run(&mut app, 10);
    let whole = Snapshot::take(app.world());
    assert_eq!(counts(&app)[0], 64);
    run(&mut app, 50);
    assert!(counts(&app)[0] > 64 && counts(&app)[1] > 12, "{:?}", counts(&app));
    let (torn, at_60) = (Snapshot::take(app.world()), all_bits(&app, nets));
    run(&mut app, 40);
    let at_100 = all_bits(&app, nets);
    for (snapshot, ticks) in [(&torn, 40), (&whole, 90), (&torn, 40)] {
        snapshot.restore(app.world_mut());
        run(&mut app, ticks);
        assert!(all_bits(&app, nets) == at_100, "after {ticks} ticks");
    }
    RestoreInitialState.apply(app.world_mut());
    run(&mut app, 60);
    assert!(all_bits(&app, nets) == at_60, "after a restart");
    run(&mut app, 40);
    assert!(all_bits(&app, nets) == at_100);
}

/// What tears beside a net, and what is paid out there, changes no bit of it; but by the substeps that `Auto` takes with all.
#[test]
fn a_net_does_not_feel_that_another_one_tears() {
    for settings in [
        scheme(Integrator::SemiImplicitEuler, 16),
        scheme(Integrator::ImplicitEuler, 2),
        scheme(Integrator::TrBdf2, 2),
    ] {
        let (mut app, [torn, _]) = torn_and_wound();
        let mut reference = crate::common::app();
        let nets = [&mut app, &mut reference].map(|app| {
            app.insert_resource(settings);
            app.insert_resource(CollisionSettings { particles: false, ..default() });
            spawn_net(app, &with_bends(cloth(6)), Vec3::X * 20.0, &[0, 5])
        });
        for tick in 0..80 {
            run(&mut app, 1);
            run(&mut reference, 1);
            assert!(net_bits(&app, nets[0]) == net_bits(&reference, nets[1]), "{settings:?}, tick {tick}");
        }
        assert!(net(&app, torn).len() > 64, "it has torn");
    }
}
