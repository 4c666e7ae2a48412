//! What is written, and what it costs.

use allocation_counter::measure;
use bevy::ecs::message::Messages;
use bevy::prelude::*;
use bevy_mass_spring::prelude::*;

use crate::scene::{app, assert_enclosed, crumple, mesh, move_particles, net, positions, rope, sheet};

/// How often meshes were said to have changed in the last update.
fn changes(app: &mut App) -> usize {
    let mut messages = app.world_mut().resource_mut::<Messages<AssetEvent<Mesh>>>();
    messages.drain().filter(|event| matches!(event, AssetEvent::Modified { .. })).count()
}

#[test]
fn what_does_not_move_is_not_written() {
    let mut app = app();
    let cloth = app.world_mut().spawn((net(sheet([4, 3])), NetMesh)).id();
    let rope = app.world_mut().spawn((net(rope(4)), RopeMesh::default())).id();
    app.update();
    app.update();
    changes(&mut app);
    for _ in 0..3 {
        app.update();
        assert_eq!(changes(&mut app), 0);
    }
    move_particles(&mut app, cloth, crumple(1));
    app.update();
    assert_eq!(changes(&mut app), 1);
    // The entity is moved, the particles are not: their places in its space are others.
    app.world_mut().get_mut::<Transform>(rope).unwrap().translation.x = 0.5;
    app.update();
    assert_eq!(changes(&mut app), 1);
    app.update();
    assert_eq!(changes(&mut app), 0);
}

#[test]
fn what_no_view_sees_is_not_written_until_it_is_seen() {
    let mut app = app();
    let cloth = app.world_mut().spawn((net(sheet([4, 3])), NetMesh)).id();
    app.update();
    app.update();
    changes(&mut app);
    // Behind the camera.
    for step in 0..5 {
        move_particles(&mut app, cloth, |number, place| {
            crumple(step)(number, if step == 0 { place + Vec3::Z * 50.0 } else { place })
        });
        app.update();
        assert_eq!(changes(&mut app), 0, "{step}");
    }
    // In the very frame in which it comes back it is drawn where it is.
    move_particles(&mut app, cloth, |_, place| place - Vec3::Z * 50.0);
    app.update();
    assert_eq!(changes(&mut app), 1);
    let particles = app.world().get::<ParticleNet>(cloth).unwrap().positions().to_vec();
    assert_eq!(positions(mesh(&app, cloth)), particles);
    assert_enclosed(&app, cloth);
    // Hidden.
    app.world_mut().entity_mut(cloth).insert(Visibility::Hidden);
    app.update();
    changes(&mut app);
    move_particles(&mut app, cloth, crumple(7));
    app.update();
    assert_eq!(changes(&mut app), 0);
}

/// As many allocations as in an app without nets: those of Bevy. Its executor runs some of its own work on this thread
/// in one frame and on others in the next, so that the counts of two apps differ by a few: fewer than one a net.
#[test]
fn frames_allocate_nothing() {
    const NETS_OF_A_KIND: usize = 10;
    let allocations = |count: usize| {
        let mut app = app();
        let mut nets = Vec::new();
        for _ in 0..count {
            nets.push(app.world_mut().spawn((net(sheet([20, 20])), NetMesh)).id());
            nets.push(app.world_mut().spawn((net(rope(30)), RopeMesh::default())).id());
            nets.push(app.world_mut().spawn((net(rope(30)), RopeRibbon::default())).id());
        }
        let frame = |app: &mut App, seed: u32| {
            for net in &nets {
                move_particles(app, *net, crumple(seed));
            }
            app.update();
            changes(app)
        };
        for seed in 0..20 {
            frame(&mut app, seed);
        }
        // Each system may run on a thread that has not been used yet, where Bevy allocates.
        (0..50)
            .map(|seed| {
                let mut changes = 0;
                let allocated = measure(|| changes = frame(&mut app, seed));
                assert_eq!(changes, nets.len());
                allocated.count_total
            })
            .min()
            .unwrap()
    };
    let (with, without) = (allocations(NETS_OF_A_KIND), allocations(0));
    assert!(with < without + NETS_OF_A_KIND as u64, "{with} {without}");
}

/// No mesh is added after the first, and none keeps an old one alive.
#[test]
fn meshes_do_not_pile_up() {
    let mut app = app();
    let nets: Vec<Entity> =
        (0..10).map(|_| app.world_mut().spawn((net(sheet([4, 3])), NetMesh)).id()).collect();
    app.update();
    let count = app.world().resource::<Assets<Mesh>>().len();
    for seed in 0..300 {
        for net in &nets {
            move_particles(&mut app, *net, crumple(seed));
        }
        app.update();
        assert_eq!(app.world().resource::<Assets<Mesh>>().len(), count);
    }
    for net in nets {
        app.world_mut().entity_mut(net).despawn();
    }
    app.update();
    app.update();
    assert_eq!(app.world().resource::<Assets<Mesh>>().len(), count - 10);
}

#[test]
fn a_clone_has_a_mesh_of_its_own() {
    let mut app = app();
    let cloth = app.world_mut().spawn((net(sheet([4, 3])), NetMesh)).id();
    app.update();
    let twin = app.world_mut().entity_mut(cloth).clone_and_spawn();
    app.update();
    move_particles(&mut app, twin, crumple(1));
    app.update();
    let particles = |net: Entity| app.world().get::<ParticleNet>(net).unwrap().positions().to_vec();
    assert_eq!(positions(mesh(&app, cloth)), particles(cloth));
    assert_eq!(positions(mesh(&app, twin)), particles(twin));
    assert_ne!(app.world().get::<Mesh3d>(cloth), app.world().get::<Mesh3d>(twin));
}
