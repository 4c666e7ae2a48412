//! Nets and the same as entities: the same bits.

use bevy::prelude::*;
use bevy_mass_spring::nets::Topology;
use bevy_mass_spring::prelude::*;
use bevy_mass_spring::solver::Integrator;

use super::shapes::{cloth, net, net_bits, rope, spawn_entities, spawn_net, with_bends};
use crate::common::{app, bits, run, scheme, spawn, spawn_pinned};

fn entity_bits(app: &App, particles: &[Entity]) -> Vec<[u32; 6]> {
    particles.iter().map(|particle| bits(app, *particle)).collect()
}

/// Two nets and a floor, as entities and as nets, in every scheme and with automatic substeps; far from the origin, too.
#[test]
fn a_net_moves_to_the_bit_as_the_same_entities_do() {
    compare_with_entities([cloth(9), rope(30)]);
}

/// The same with entities that are bends.
#[test]
fn a_net_with_bends_moves_to_the_bit_as_the_same_entities_do() {
    compare_with_entities([with_bends(cloth(9)), with_bends(rope(30))]);
}

fn compare_with_entities([sheet, line]: [Topology; 2]) {
    let topologies = [(sheet, [0, 8]), (line, [0, 0])];
    let settings = Integrator::named().map(|integrator| scheme(integrator, 16));
    for settings in settings.chain([SolverSettings::default()]) {
        for place in [Vec3::new(0.0, 0.3, 0.0), Vec3::new(5000.0, 0.3, -70.0)] {
            let [mut apart, mut together] = [app(), app()];
            for app in [&mut apart, &mut together] {
                app.insert_resource(settings);
                app.world_mut().spawn(ParticleCollider::default());
            }
            let mut particles = Vec::new();
            let mut nets = Vec::new();
            for (topology, pinned) in &topologies {
                particles.push(spawn_entities(&mut apart, topology, place, pinned));
            }
            for (topology, pinned) in &topologies {
                nets.push(spawn_net(&mut together, topology, place, pinned));
            }
            for tick in 0..40 {
                run(&mut apart, 1);
                run(&mut together, 1);
                for (particles, net) in particles.iter().zip(&nets) {
                    let (expected, found) = (entity_bits(&apart, particles), net_bits(&together, *net));
                    assert_eq!(expected, found, "{settings:?}, tick {tick} at {place}");
                }
            }
            let lowest = net(&together, nets[0]).positions().iter().map(|at| at.y).fold(1.0, f32::min);
            assert!(lowest < 0.2, "it has moved: {lowest}");
        }
    }
}

/// Particles that are spawned later, nets that go away and slots that are assigned anew change no bit of the others.
#[test]
fn late_particles_and_removed_nets_leave_the_others_alone() {
    let [mut app, mut reference] = [app(), app()];
    for app in [&mut app, &mut reference] {
        app.insert_resource(scheme(Integrator::SemiImplicitEuler, 8));
    }
    let lone = spawn_net(&mut reference, &rope(12), Vec3::Y * 3.0, &[0]);
    let first = spawn_net(&mut app, &cloth(6), Vec3::Y, &[0]);
    let second = spawn_net(&mut app, &rope(12), Vec3::Y * 3.0, &[0]);
    run(&mut app, 3);
    let anchor = spawn_pinned(&mut app, Vec3::Y * 9.0);
    let ball = spawn(&mut app, 1.0, 0.0, Vec3::new(0.0, 8.0, 0.0));
    app.world_mut().spawn(Spring::new(anchor, ball, 1.0));
    run(&mut app, 3);
    app.world_mut().entity_mut(first).despawn();
    run(&mut app, 4);
    assert_eq!(app.world().resource::<TickReport>().particles, 14);
    assert_eq!(app.world().resource::<TickReport>().springs, 12);
    app.world_mut().entity_mut(anchor).insert(SimulationOrder(3));
    run(&mut app, 10);
    run(&mut reference, 20);
    assert_eq!(net_bits(&app, second), net_bits(&reference, lone));
    assert!(net(&app, second).positions()[11].y < 2.9, "it has moved");
}

/// What is written to the arrays between two ticks counts.
#[test]
fn written_positions_velocities_pins_and_forces_count() {
    let mut app = app();
    crate::common::plain(&mut app);
    let mut topology = rope(4);
    topology.springs.clear();
    let entity = spawn_net(&mut app, &topology, Vec3::ZERO, &[]);
    run(&mut app, 2);
    let mut net_mut = app.world_mut().get_mut::<ParticleNet>(entity).unwrap();
    net_mut.positions_mut()[0] = Vec3::new(0.0, 7.0, 0.0);
    net_mut.velocities_mut()[1] = Vec3::Z * 64.0;
    net_mut.set_pinned(2, true);
    net_mut.applied_forces_mut()[3] = Vec3::Y * 0.05;
    run(&mut app, 1);
    let found = net(&app, entity).positions().to_vec();
    assert_eq!(found[0], Vec3::new(0.0, 7.0, 0.0));
    assert_eq!(found[1], Vec3::new(0.1, 0.0, 1.0));
    // a t² of semi-implicit Euler, for 1 m/s².
    assert!((found[3].y - 1.0 / 4096.0).abs() < 1e-9);
    let mut net_mut = app.world_mut().get_mut::<ParticleNet>(entity).unwrap();
    net_mut.positions_mut()[2] = Vec3::Y;
    run(&mut app, 1);
    assert_eq!(net(&app, entity).positions()[2], Vec3::Y);
    let speed = (Vec3::Y - Vec3::X * 0.2) * 64.0;
    assert!(net(&app, entity).velocities()[2].distance(speed) < 1e-4, "that of its motion");
    let mut net_mut = app.world_mut().get_mut::<ParticleNet>(entity).unwrap();
    net_mut.set_pinned(2, false);
    net_mut.clear_applied_forces();
    run(&mut app, 1);
    assert!(net(&app, entity).positions()[2].distance(Vec3::Y + speed / 64.0) < 1e-4, "free again");
}

/// Other parameters of the same elements act without a new layout, other elements with one.
#[test]
fn a_topology_can_be_exchanged() {
    let mut app = app();
    app.insert_resource(scheme(Integrator::ImplicitEuler, 8));
    let hanging = || {
        let mut topology = rope(5);
        topology.positions.iter_mut().for_each(|place| *place = Vec3::NEG_Y * place.x);
        topology
    };
    let entity = spawn_net(&mut app, &hanging(), Vec3::ZERO, &[0]);
    run(&mut app, 600);
    let length = |app: &App| net(app, entity).positions()[0].distance(net(app, entity).positions()[4]);
    let before = length(&app) - 0.4;
    let mut stiff = hanging();
    stiff.springs.iter_mut().for_each(|(_, spring)| spring.stiffness *= 2.0);
    app.world_mut().get_mut::<ParticleNet>(entity).unwrap().set_topology(stiff.clone().into());
    run(&mut app, 600);
    let after = length(&app) - 0.4;
    assert!((after / before - 0.5).abs() < 0.01, "{before} m, then {after} m");
    stiff.springs.push(([0, 4], super::shapes::spring(0.2)));
    app.world_mut().get_mut::<ParticleNet>(entity).unwrap().set_topology(stiff.into());
    run(&mut app, 2);
    assert_eq!(app.world().resource::<TickReport>().springs, 5);
}
