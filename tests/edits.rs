//! Edits while it runs: particles and springs that are spawned, despawned and changed, a few at a time in a
//! large net, give the same as a scene that is built so.

mod common;

use bevy::app::{TaskPoolOptions, TaskPoolThreadAssignmentPolicy};
use bevy::prelude::*;
use bevy::tasks::ComputeTaskPool;
use bevy_mass_spring::prelude::*;

use common::{TICK, position, report, run, scheme, velocity};

const SIDE: usize = 20;

/// A net in the air, every particle and spring of it.
struct Net {
    particles: Vec<Entity>,
    springs: Vec<Entity>,
}

/// On three threads. Four substeps, so that the number does not depend on a rounding of the stability bound.
fn app() -> App {
    let compute = TaskPoolThreadAssignmentPolicy {
        min_threads: 3,
        max_threads: 3,
        percent: 1.0,
        on_thread_spawn: None,
        on_thread_destroy: None,
    };
    let pools = TaskPoolOptions { compute, ..default() };
    let mut app = common::app_on(pools, MassSpringPlugin::default());
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
    // A spring is despawned, another changes its ends, a third its stiffness.
    let left = net.springs.swap_remove(round * 37 % links);
    world.despawn(left);
    let (one, other) = (net.particles[round * 11 % count], net.particles[round * 29 % count]);
    if one != other {
        let relinked = net.springs[round * 53 % (links - 1)];
        world.get_mut::<Spring>(relinked).expect("it is a spring").particles = [one, other];
    }
    let softer = net.springs[round * 71 % (links - 1)];
    world.get_mut::<Spring>(softer).expect("it is a spring").stiffness *= 0.5;
    // A particle is despawned with its springs, another is spawned and hangs from the last.
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
fn an_edited_net_continues_like_a_new_one() {
    let mut app = app();
    let mut net = net(&mut app);
    run(&mut app, 5);
    let tolerance = 8.0 * 5e-3 / 240.0 * 1.4_f32.powi(8);
    for round in 0..60 {
        edit(&mut app, &mut net, round);
        // What was edited is ramped in the first tick.
        run(&mut app, 1);
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

/// Tables of 20,000 particles, shared among threads where there are several: with holes in their slots, in
/// another order than these, one table with forces and one without. Each particle moves at its own velocity;
/// all numbers are dyadic, so that it arrives to the bit.
#[test]
fn every_particle_of_large_tables_is_copied() {
    let mut app = app();
    assert_eq!(ComputeTaskPool::get().thread_num(), 3);
    app.insert_resource(Environment { gravity: Vec3::ZERO, viscosity: 0.0, ..default() });
    let own = |number: usize| Vec3::new((number % 128) as f32, (number / 128) as f32, 1.0);
    let mut particles: Vec<_> = (0..40_000)
        .map(|number| {
            let place = Transform::from_translation(-own(number));
            app.world_mut().spawn((Particle::new(1.0, 0.0), ParticleVelocity(own(number)), place)).id()
        })
        .collect();
    run(&mut app, 1);
    // The second half goes into another table backwards; every seventh is despawned.
    for &particle in particles[20_000..].iter().rev() {
        app.world_mut().entity_mut(particle).insert(AppliedForce(Vec3::X * 64.0));
    }
    for number in (0..40_000).step_by(7).rev() {
        app.world_mut().despawn(particles[number]);
        particles[number] = Entity::PLACEHOLDER;
    }
    run(&mut app, 1);
    assert_eq!(report(&app).particles, 40_000 - 40_000_usize.div_ceil(7));
    for (number, &particle) in particles.iter().enumerate().filter(|(number, _)| number % 7 != 0) {
        let kick = if number < 20_000 { Vec3::ZERO } else { Vec3::X };
        assert_eq!(velocity(&app, particle), own(number) + kick, "particle {number}");
        let [least, most] = [0.0, TICK].map(|gain| own(number) * (2.0 * TICK - 1.0) + kick * gain);
        let place = position(&app, particle);
        assert!(place.cmpge(least).all() && place.cmple(most).all(), "particle {number}: {place}");
    }
}

/// In a viscous medium a new light particle needs other steps, though nothing else has changed:
/// with those of the net its drag, 10⁴ times its momentum a second, would make it oscillate.
#[test]
fn a_new_light_particle_is_counted_in_a_viscous_medium() {
    let mut app = app();
    app.insert_resource(SolverSettings::default());
    app.insert_resource(Environment { viscosity: 1.0, gravity: Vec3::ZERO, ..default() });
    net(&mut app);
    run(&mut app, 3);
    let light = (Particle::new(1e-4, 0.0), ParticleVelocity(Vec3::X), Transform::from_xyz(0.0, 50.0, 0.0));
    let light = app.world_mut().spawn(light).id();
    for _ in 0..10 {
        let before = velocity(&app, light).length();
        run(&mut app, 1);
        assert!(velocity(&app, light).length() <= 0.1 * before, "{}", velocity(&app, light));
    }
}

/// Changes made while the settings name scheme and substeps are taken into account once `Auto` chooses.
#[test]
fn edits_under_fixed_settings_count_for_auto() {
    let mut app = app();
    let net = net(&mut app);
    run(&mut app, 3);
    app.world_mut().get_mut::<Spring>(net.springs[SIDE]).unwrap().stiffness = 1e6;
    app.insert_resource(SolverSettings::default());
    let soft = report(&app).substeps;
    run(&mut app, 64);
    assert!(report(&app).substeps > 10 * soft, "{} substeps", report(&app).substeps);
    let highest = net.particles.iter().map(|particle| velocity(&app, *particle).length()).fold(0.0, f32::max);
    assert!(highest < 20.0, "{highest} m/s after a second of free fall");
}
