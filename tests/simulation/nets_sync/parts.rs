//! Parts of nets: what is true of a loose particle is true of them.

use std::f32::consts::FRAC_PI_2;

use bevy::prelude::*;
use bevy_mass_spring::nets::{Part, PartOf, Parts, Side};
use bevy_mass_spring::prelude::*;
use bevy_mass_spring::solver::Integrator;

use super::shapes::{cloth, net, rope, spawn_net};
use crate::common::{app, plain, position, run, scheme, spawn, velocity};

fn part(app: &mut App, net: Entity, part: Part) -> Entity {
    app.world_mut().spawn((PartOf(net), part)).id()
}

#[test]
fn the_syntax_of_the_documents_compiles_and_pins() {
    let mut app = app();
    let net_component = ParticleNet::new(rope(5).into(), &Transform::from_xyz(1.0, 2.0, 3.0));
    let rope = app.world_mut().spawn((net_component, related!(Parts[(Part::Start, Pinned)]))).id();
    let hand = app.world_mut().spawn(Transform::from_xyz(0.0, 9.0, 0.0)).id();
    app.world_mut().entity_mut(hand).with_child((PartOf(rope), Part::End, Pinned));
    run(&mut app, 10);
    let before = net(&app, rope).positions().to_vec();
    assert_eq!((before[0], before[4]), (Vec3::new(1.0, 2.0, 3.0), Vec3::new(1.4, 2.0, 3.0)));
    assert!(before[2].y < 2.0, "the middle sags");
    let first = app.world().get::<Parts>(rope).unwrap().entities()[0];
    assert_eq!(position(&app, first), before[0], "it shows where it is");
    // The hand carries what is its child in the same tick.
    app.world_mut().get_mut::<Transform>(hand).unwrap().translation.y += 0.5;
    run(&mut app, 1);
    let after = net(&app, rope).positions().to_vec();
    assert_eq!(after[0], before[0]);
    assert!(after[4].distance(before[4] + Vec3::Y * 0.5) < 1e-6, "{}", after[4]);
    app.world_mut().entity_mut(first).despawn();
    run(&mut app, 10);
    assert!(net(&app, rope).positions()[0].distance(before[0]) > 0.01, "let go");
    app.world_mut().entity_mut(rope).despawn();
    run(&mut app, 1);
    assert!(app.world().get::<Children>(hand).is_none(), "parts go with their net");
}

#[test]
fn a_free_part_shows_pushes_and_moves_its_particle() {
    let mut app = app();
    plain(&mut app);
    let mut topology = rope(4);
    topology.springs.clear();
    let entity = spawn_net(&mut app, &topology, Vec3::ZERO, &[]);
    let second = part(&mut app, entity, Part::Particle(1));
    let all = part(&mut app, entity, Part::All);
    run(&mut app, 1);
    assert_eq!((position(&app, second), position(&app, all)), (Vec3::X * 0.1, Vec3::X * 0.15));
    app.world_mut().entity_mut(all).insert(AppliedForce(Vec3::Y * 0.2));
    app.world_mut().get_mut::<ParticleVelocity>(second).unwrap().0 = Vec3::Z * 64.0;
    run(&mut app, 1);
    // 0.2 N on 0.2 kg, for one substep of 1/64 s.
    let velocities = net(&app, entity).velocities();
    assert!(velocities.iter().all(|velocity| (velocity.y - 1.0 / 64.0).abs() < 1e-7));
    assert_eq!([0, 1, 2].map(|particle| velocities[particle].z), [0.0, 64.0, 0.0]);
    assert_eq!(velocity(&app, second), velocities[1]);
    assert!((velocity(&app, all).z - 16.0).abs() < 1e-5);
    app.world_mut().entity_mut(all).remove::<AppliedForce>();
    let before = net(&app, entity).positions().to_vec();
    app.world_mut().get_mut::<Transform>(all).unwrap().translation += Vec3::X * 10.0;
    app.world_mut().get_mut::<Transform>(second).unwrap().translation = Vec3::splat(7.0);
    run(&mut app, 1);
    let after = net(&app, entity);
    let moved = before[2] + Vec3::X * 10.0 + after.velocities()[2] / 64.0;
    assert!(after.positions()[2].distance(moved) < 1e-5, "{} instead of {moved}", after.positions()[2]);
}

/// A pinned side is held as a rigid body; unpinned, it is free from where it is.
#[test]
fn a_pinned_side_follows_its_transform_rigidly() {
    let mut app = app();
    app.insert_resource(scheme(Integrator::ImplicitEuler, 2));
    let entity = spawn_net(&mut app, &cloth(6), Vec3::Y, &[]);
    let edge = app.world_mut().spawn((PartOf(entity), Part::Edge(Side::Top), Pinned)).id();
    run(&mut app, 3);
    let before: Vec<Vec3> = net(&app, entity).positions()[30..].to_vec();
    assert!(before.iter().all(|place| (place.y - 1.0).abs() < 1e-6 && (place.z - 0.5).abs() < 1e-6));
    let centre = position(&app, edge);
    assert!(centre.distance(Vec3::new(0.25, 1.0, 0.5)) < 1e-6);
    let mut transform = app.world_mut().get_mut::<Transform>(edge).unwrap();
    transform.translation = Vec3::new(0.0, 3.0, 0.0);
    transform.rotate_y(FRAC_PI_2);
    run(&mut app, 1);
    for (before, after) in before.iter().zip(&net(&app, entity).positions()[30..]) {
        let expected = Vec3::Y * 3.0 + Quat::from_rotation_y(FRAC_PI_2) * (*before - centre);
        assert!(after.distance(expected) < 1e-6, "{after} instead of {expected}");
    }
    app.world_mut().entity_mut(edge).remove::<Pinned>();
    let held = net(&app, entity).positions()[30];
    run(&mut app, 20);
    assert!(net(&app, entity).positions()[30].distance(held) > 0.01, "free again");
    let mean = net(&app, entity).positions()[30..].iter().sum::<Vec3>() / 6.0;
    assert!(position(&app, edge).distance(mean) < 1e-5, "and it is where they are");
}

#[test]
fn springs_end_in_parts_of_one_particle() {
    let mut app = app();
    app.insert_resource(scheme(Integrator::ImplicitEuler, 4));
    let entity = spawn_net(&mut app, &rope(5), Vec3::ZERO, &[0]);
    let load = spawn(&mut app, 0.1, 0.0, Vec3::new(0.4, -0.2, 0.0));
    let end = part(&mut app, entity, Part::End);
    app.world_mut().spawn(Spring::new(end, load, 0.2).with_stiffness(500.0));
    let all = part(&mut app, entity, Part::All);
    app.world_mut().spawn(Spring::new(all, load, 0.2));
    run(&mut app, 60);
    assert_eq!(app.world().resource::<TickReport>().springs, 5, "a part of several particles is refused");
    let distance = net(&app, entity).positions()[4].distance(position(&app, load));
    assert!((distance - 0.2).abs() < 0.05, "{distance}");
    // Another particle: the spring goes along.
    *app.world_mut().get_mut::<Part>(end).unwrap() = Part::Particle(1);
    run(&mut app, 2);
    assert_eq!(app.world().resource::<TickReport>().springs, 5);
    app.world_mut().entity_mut(end).despawn();
    run(&mut app, 2);
    assert_eq!(app.world().resource::<TickReport>().springs, 4, "it went with the part");
}

/// A cape: its pinned parts move with the entity of the net, which a figure carries; the rest hangs from them.
#[test]
fn pinned_parts_move_with_their_net() {
    let mut app = app();
    app.insert_resource(scheme(Integrator::ImplicitEuler, 2));
    let figure = app.world_mut().spawn(Transform::IDENTITY).id();
    let entity = spawn_net(&mut app, &cloth(4), Vec3::ZERO, &[]);
    app.world_mut().entity_mut(figure).add_child(entity);
    app.world_mut().spawn((PartOf(entity), Part::Edge(Side::Bottom), Pinned));
    run(&mut app, 3);
    for _ in 0..100 {
        app.world_mut().get_mut::<Transform>(figure).unwrap().translation.x += 0.01;
        app.world_mut().get_mut::<Transform>(figure).unwrap().rotate_y(0.01);
        run(&mut app, 1);
    }
    let figure = *app.world().get::<Transform>(figure).unwrap();
    for column in 0..4 {
        let expected = figure.transform_point(Vec3::X * 0.1 * column as f32);
        let found = net(&app, entity).positions()[column];
        assert!(found.distance(expected) < 1e-5, "{found} instead of {expected}");
    }
    let hanging = net(&app, entity).positions()[15].distance(net(&app, entity).positions()[3]);
    assert!(hanging < 0.5, "it comes along: {hanging} m");
}

/// A net of which nothing is pinned takes its entity along: one that flies as a rigid body is where it would be drawn.
#[test]
fn a_free_net_writes_its_transform() {
    let mut app = app();
    plain(&mut app);
    let start = Transform::from_xyz(1.0, 2.0, 3.0).with_rotation(Quat::from_rotation_z(0.3));
    let mut topology = cloth(5);
    topology.springs.iter_mut().for_each(|(_, spring)| spring.stiffness = 20.0);
    let mut component = ParticleNet::new(topology.clone().into(), &start);
    component.velocities_mut().fill(Vec3::new(0.0, 64.0, 0.0));
    let entity = app.world_mut().spawn((component, start)).id();
    run(&mut app, 2);
    let found = *app.world().get::<Transform>(entity).unwrap();
    assert!(found.translation.distance(start.translation + Vec3::Y * 2.0) < 1e-4, "{}", found.translation);
    assert!(found.rotation.angle_between(start.rotation) < 1e-3);
    for (rest, place) in topology.positions.iter().zip(net(&app, entity).positions()) {
        assert!(found.transform_point(*rest).distance(*place) < 1e-3);
    }
}

#[test]
fn parts_come_back_with_a_snapshot() {
    let mut app = app();
    app.insert_resource(scheme(Integrator::SemiImplicitEuler, 8));
    let entity = spawn_net(&mut app, &cloth(5), Vec3::ZERO, &[]);
    let edge = app.world_mut().spawn((PartOf(entity), Part::Edge(Side::Top), Pinned)).id();
    let corner = part(&mut app, entity, Part::Particle(0));
    app.world_mut().entity_mut(corner).insert(AppliedForce(Vec3::X * 0.2));
    let move_edge = |app: &mut App| app.world_mut().get_mut::<Transform>(edge).unwrap().translation.x += 0.01;
    for _ in 0..10 {
        move_edge(&mut app);
        run(&mut app, 1);
    }
    let snapshot = Snapshot::take(app.world());
    let mut bits = [Vec::new(), Vec::new()];
    for bits in &mut bits {
        for _ in 0..10 {
            move_edge(&mut app);
            run(&mut app, 1);
            bits.push(super::shapes::net_bits(&app, entity));
        }
        app.world_mut().entity_mut(edge).remove::<Pinned>();
        app.world_mut().entity_mut(corner).remove::<AppliedForce>();
        run(&mut app, 5);
        snapshot.restore(app.world_mut());
    }
    assert_eq!(bits[0], bits[1]);
    // From the start.
    let mut bits = [Vec::new(), Vec::new()];
    for bits in &mut bits {
        app.world_mut().commands().queue(RestoreInitialState);
        app.world_mut().flush();
        run(&mut app, 10);
        bits.push(super::shapes::net_bits(&app, entity));
    }
    assert_eq!(bits[0], bits[1]);
}
