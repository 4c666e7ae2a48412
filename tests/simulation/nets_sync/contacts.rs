//! Contacts of nets with planes and with loose particles.

use bevy::prelude::*;
use bevy_mass_spring::nets::Cloth;
use bevy_mass_spring::prelude::*;

use crate::common::{TICK, app, messages, report, run, spawn_pinned};

const RADIUS: f32 = 0.02;

/// A cloth of 0.8 m and 8² cells, level, about a place.
fn spawn_cloth(app: &mut App, place: Vec3) -> Entity {
    let cloth = Cloth::grid(Vec3::new(-0.4, 0.0, -0.4), Vec3::X * 0.8, Vec3::Z * 0.8, UVec2::splat(8));
    let topology = cloth.with_radius(RADIUS).topology().expect("it is sound");
    app.world_mut().spawn(ParticleNet::new(topology.into(), &Transform::from_translation(place))).id()
}

fn lowest(app: &App, net: Entity) -> f32 {
    let net = app.world().get::<ParticleNet>(net).expect("it exists");
    net.positions().iter().map(|place| place.y).fold(f32::INFINITY, f32::min)
}

#[test]
fn a_cloth_that_falls_on_a_plane_stays_above_it() {
    let mut app = app();
    app.add_message::<Contact>();
    let plane = app.world_mut().spawn(ParticleCollider { restitution: 0.0, friction: 0.5, ..default() }).id();
    let net = spawn_cloth(&mut app, Vec3::Y * 0.3);
    let mut touching = [false; 81];
    for tick in 0..(1.5 / TICK) as u32 {
        run(&mut app, 1);
        let above = lowest(&app, net) - RADIUS;
        assert!(above > -0.02 * RADIUS, "tick {tick}: {above} m");
        for contact in messages::<Contact>(&mut app) {
            if contact.other == plane {
                assert_eq!((contact.particle, contact.other_index), (net, None), "tick {tick}");
                assert!(
                    contact.point.y.abs() < 1e-3 && contact.normal.distance(Vec3::Y) < 1e-6,
                    "{contact:?}"
                );
                touching[contact.index.expect("it is a net") as usize] = true;
            }
        }
    }
    assert!(touching.iter().all(|touches| *touches), "every particle has touched the plane");
    assert_eq!((report(&app).particles, report(&app).faults), (81, 0));
}

#[test]
fn a_cloth_that_falls_on_a_pinned_ball_hangs_over_it() {
    let mut app = app();
    app.add_message::<Contact>();
    let ball = spawn_pinned(&mut app, Vec3::ZERO);
    app.world_mut().entity_mut(ball).insert(Particle::new(1.0, 0.2));
    app.world_mut().resource_mut::<CollisionSettings>().friction = 1.0;
    let net = spawn_cloth(&mut app, Vec3::Y * 0.3);
    let mut touched = false;
    for tick in 0..(1.0 / TICK) as u32 {
        run(&mut app, 1);
        let state = app.world().get::<ParticleNet>(net).expect("it exists");
        for (index, place) in state.positions().iter().enumerate() {
            let above = place.length() - 0.2 - RADIUS;
            // The cloth pulls its particles in; the contacts are corrected once a substep.
            assert!(above > -0.25 * RADIUS, "tick {tick}, particle {index}: {above} m");
        }
        for contact in messages::<Contact>(&mut app) {
            let sides = [(contact.particle, contact.index), (contact.other, contact.other_index)];
            for (entity, index) in sides {
                assert_eq!(entity == net, index.is_some(), "{contact:?}");
                assert!(entity == net || entity == ball, "{contact:?}");
            }
            touched |= sides.contains(&(ball, None));
        }
    }
    assert!(touched && lowest(&app, net) < 0.1, "it hangs down around the ball");
    assert!(lowest(&app, net) > -1.0, "and has not slid off");
}

#[test]
fn the_report_counts_particles_and_springs_of_nets() {
    let mut app = app();
    let net = spawn_cloth(&mut app, Vec3::Y);
    run(&mut app, 1);
    let springs = app.world().get::<ParticleNet>(net).expect("it exists").topology().springs.len();
    assert_eq!((report(&app).particles, report(&app).springs), (81, springs));
    app.world_mut().despawn(net);
    run(&mut app, 1);
    assert_eq!((report(&app).particles, report(&app).springs), (0, 0));
}
