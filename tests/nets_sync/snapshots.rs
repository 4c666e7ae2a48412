//! Restarts and snapshots of nets: to the bit, in another app, too.

use bevy::prelude::*;
use bevy_mass_spring::prelude::*;

use super::common::{app, run, spawn};
use super::shapes::{cloth, net, net_bits, rope, spawn_net};

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
