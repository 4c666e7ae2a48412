//! Edits while it runs: particles and springs that come, leave and change, a few at a time in a large
//! net, are taken up as if the scene had been made so.

mod common;

use bevy::prelude::*;
use bevy_mass_spring::prelude::*;

use common::{position, report, run, scheme, velocity};

const SIDE: usize = 20;

/// A net in the air, every particle and spring of it.
struct Net {
    particles: Vec<Entity>,
    springs: Vec<Entity>,
}

/// Four substeps, so that the number does not hang on a rounding of the stability bound.
fn app() -> App {
    let mut app = common::app();
    app.insert_resource(scheme(Integrator::SemiImplicitEuler, 4));
    app
}

fn spring(app: &mut App, first: Entity, second: Entity) -> Entity {
    let spring = Spring::new(first, second, 0.1).with_stiffness(50.0).with_damping(0.05);
    app.world_mut().spawn(spring).id()
}

fn net(app: &mut App) -> Net {
    let mut net = Net { particles: Vec::new(), springs: Vec::new() };
    for slot in 0..SIDE * SIDE {
        let (column, row) = (slot % SIDE, slot / SIDE);
        let place = Transform::from_xyz(column as f32 * 0.1, 5.0, row as f32 * 0.1);
        let mut entity = app.world_mut().spawn((Particle::new(0.1, 0.0), place));
        if row == 0 {
            entity.insert(Pinned);
        }
        net.particles.push(entity.id());
        if column > 0 {
            net.springs.push(spring(app, net.particles[slot - 1], net.particles[slot]));
        }
        if row > 0 {
            net.springs.push(spring(app, net.particles[slot - SIDE], net.particles[slot]));
        }
    }
    net
}

/// One edit of each kind, at other places each time.
fn edit(app: &mut App, net: &mut Net, round: usize) {
    let (count, links) = (net.particles.len(), net.springs.len());
    let world = app.world_mut();
    // A spring leaves, another changes its ends, a third its stiffness.
    let left = net.springs.swap_remove(round * 37 % links);
    world.despawn(left);
    let (one, other) = (net.particles[round * 11 % count], net.particles[round * 29 % count]);
    if one != other {
        let relinked = net.springs[round * 53 % (links - 1)];
        world.get_mut::<Spring>(relinked).expect("it is a spring").particles = [one, other];
    }
    let softer = net.springs[round * 71 % (links - 1)];
    world.get_mut::<Spring>(softer).expect("it is a spring").stiffness *= 0.5;
    // A particle leaves with its springs, one comes and hangs from the last.
    let leaving = net.particles.remove(round * 97 % (count - 40) + 40);
    world.despawn(leaving);
    let dangling: Vec<Entity> = {
        let ends = |spring: &Entity| world.get::<Spring>(*spring).expect("it is a spring").particles;
        net.springs.iter().copied().filter(|spring| ends(spring).contains(&leaving)).collect()
    };
    for spring in dangling {
        world.despawn(spring);
        net.springs.retain(|other| *other != spring);
    }
    let last = *net.particles.last().expect("there are some");
    let place = *world.get::<Transform>(last).expect("it has a place") * Transform::from_xyz(0.0, -0.1, 0.0);
    let new = world.spawn((Particle::new(0.1, 0.0), place)).id();
    net.particles.push(new);
    net.springs.push(spring(app, last, new));
}

/// A new app with the particles and springs of `net` as they are now.
fn copied(app: &App, net: &Net) -> (App, Vec<Entity>) {
    let mut copy = self::app();
    let mut twins = Vec::new();
    for &particle in &net.particles {
        let world = app.world();
        let of = (
            *world.get::<Particle>(particle).expect("it is a particle"),
            *world.get::<Transform>(particle).expect("it has a place"),
            *world.get::<ParticleVelocity>(particle).expect("it has a velocity"),
        );
        let pinned = world.entity(particle).contains::<Pinned>();
        let mut twin = copy.world_mut().spawn(of);
        if pinned {
            twin.insert(Pinned);
        }
        twins.push(twin.id());
    }
    for &spring in &net.springs {
        let mut spring = *app.world().get::<Spring>(spring).expect("it is a spring");
        for end in &mut spring.particles {
            let slot = net.particles.iter().position(|particle| particle == end).expect("it is in the net");
            *end = twins[slot];
        }
        copy.world_mut().spawn(spring);
    }
    (copy, twins)
}

/// Forces are summed in another order in the copy. In each of n = 2 · 4 substeps a sum of up to 9 forces
/// below 100 N on 0.1 kg differs by 9 · u · 9 · 100 N / 0.1 kg = 5 mm/s² at most, over h = 1/240 s; a
/// difference grows by less than (1 + 2 hω) = 1.4 a substep, ω² <= 2 · 8 · 50 / 0.1.
#[test]
fn an_edited_net_goes_on_like_one_made_anew() {
    let mut app = app();
    let mut net = net(&mut app);
    run(&mut app, 5);
    let tolerance = 8.0 * 5e-3 / 240.0 * 1.4_f32.powi(8);
    for round in 0..60 {
        edit(&mut app, &mut net, round);
        let (mut copy, twins) = copied(&app, &net);
        run(&mut app, 2);
        run(&mut copy, 2);
        for (particle, twin) in net.particles.iter().zip(&twins) {
            let difference = velocity(&app, *particle) - velocity(&copy, *twin);
            assert!(difference.length() < tolerance, "round {round}, {particle}: {difference}");
            let difference = position(&app, *particle) - position(&copy, *twin);
            assert!(difference.length() < tolerance, "round {round}, {particle}: {difference}");
        }
        let counts = |app: &App| (report(app).particles, report(app).springs);
        assert_eq!(counts(&app), counts(&copy));
    }
}
