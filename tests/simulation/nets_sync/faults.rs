//! Bad values: refused by name, or taken out particle by particle.

use bevy::prelude::*;
use bevy_mass_spring::prelude::*;
use bevy_mass_spring::solver::Integrator;

use super::shapes::{cloth, net, rope, spawn_net};
use crate::common::{app, messages, run, scheme};

#[test]
fn a_value_that_is_not_finite_is_refused() {
    let mut app = app();
    let entity = spawn_net(&mut app, &rope(6), Vec3::ZERO, &[0]);
    run(&mut app, 4);
    let mut net_mut = app.world_mut().get_mut::<ParticleNet>(entity).unwrap();
    let before = net_mut.positions().to_vec();
    net_mut.positions_mut()[0] = Vec3::NAN;
    net_mut.positions_mut()[3] = Vec3::NAN;
    net_mut.velocities_mut()[4] = Vec3::X * f32::INFINITY;
    run(&mut app, 1);
    let after = net(&app, entity);
    assert!(after.positions().iter().zip(&before).all(|(after, before)| after.distance(*before) < 0.1));
    assert!(after.velocities().iter().all(|velocity| velocity.is_finite()));
    assert!(after.quarantined().is_empty());
}

/// A particle that a force drives out of f32 is taken out; the rest goes on without it.
#[test]
fn a_particle_is_quarantined_and_the_rest_goes_on() {
    let mut app = app();
    app.insert_resource(scheme(Integrator::SemiImplicitEuler, 16));
    let entity = spawn_net(&mut app, &cloth(5), Vec3::ZERO, &[0, 4]);
    run(&mut app, 2);
    // In one substep, so that its springs do not tell its neighbours of it.
    app.insert_resource(scheme(Integrator::SemiImplicitEuler, 1));
    app.world_mut().get_mut::<ParticleNet>(entity).unwrap().applied_forces_mut()[24] = Vec3::X * f32::MAX;
    run(&mut app, 1);
    app.insert_resource(scheme(Integrator::SemiImplicitEuler, 16));
    let faults: Vec<ParticleFault> = messages(&mut app);
    assert_eq!(faults.len(), 1);
    assert_eq!((faults[0].particle, faults[0].index), (entity, Some(24)));
    assert_eq!(net(&app, entity).quarantined(), [24]);
    let place = net(&app, entity).positions()[24];
    run(&mut app, 20);
    let found = net(&app, entity);
    assert!(found.positions().iter().all(|position| position.is_finite()));
    assert_eq!((found.positions()[24], found.velocities()[24]), (place, Vec3::ZERO));
    assert_eq!(found.quarantined(), [24], "its neighbours go on");
    assert!(found.positions()[23].y < -0.1, "the others fall");
    assert_eq!(app.world().resource::<TickReport>().particles, 24);
    let mut net_mut = app.world_mut().get_mut::<ParticleNet>(entity).unwrap();
    net_mut.clear_applied_forces();
    net_mut.release_quarantined();
    net_mut.positions_mut()[24] = Vec3::ZERO;
    run(&mut app, 3);
    assert_eq!(app.world().resource::<TickReport>().particles, 25);
    assert_ne!(net(&app, entity).velocities()[24], Vec3::ZERO, "it takes part again");
}

#[test]
fn an_invalid_net_is_left_out_until_it_is_corrected() {
    let mut app = app();
    let mut bad = rope(4);
    bad.masses[2] = -1.0;
    let entity = spawn_net(&mut app, &bad, Vec3::ZERO, &[0]);
    run(&mut app, 2);
    assert_eq!(app.world().resource::<TickReport>().particles, 0);
    app.world_mut().get_mut::<ParticleNet>(entity).unwrap().set_topology(rope(4).into());
    run(&mut app, 2);
    assert_eq!(app.world().resource::<TickReport>().particles, 4);
}

#[test]
fn a_disabled_net_takes_no_part() {
    use bevy::ecs::entity_disabling::Disabled;
    let mut app = app();
    let entity = spawn_net(&mut app, &rope(4), Vec3::ZERO, &[0]);
    run(&mut app, 2);
    app.world_mut().entity_mut(entity).insert(Disabled);
    run(&mut app, 2);
    assert_eq!(app.world().resource::<TickReport>().particles, 0);
    app.world_mut().entity_mut(entity).remove::<Disabled>();
    run(&mut app, 2);
    assert_eq!(app.world().resource::<TickReport>().particles, 4);
}
