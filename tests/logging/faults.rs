//! Non-finite states: the particle at fault is quarantined, with a message; all others continue.
//!
//! The log belongs to the process, so each test here holds [`Logged`] from its first line on.

use bevy::prelude::*;
use bevy_mass_spring::prelude::*;
use bevy_mass_spring::solver::Integrator;

use crate::common::logged::Logged;
use crate::common::*;

struct Scene {
    app: App,
    chain: Vec<Entity>,
    particle: Entity,
    neighbour: Entity,
}

/// A hanging chain, and apart from it a particle at (5, 5, 0) with a neighbour on a spring; after 5 ticks.
fn scene() -> Scene {
    let mut app = app();
    let chain = spawn_rope(&mut app, Vec3::Y * 20.0, 5, 0.2, |spring| spring.with_stiffness(400.0));
    let particle = spawn(&mut app, 1.0, 0.1, Vec3::new(5.0, 5.0, 0.0));
    let neighbour = spawn(&mut app, 1.0, 0.1, Vec3::new(6.0, 5.0, 0.0));
    join(&mut app, Spring::new(particle, neighbour, 1.0));
    run(&mut app, 5);
    Scene { app, chain, particle, neighbour }
}

/// Applies `fault` to the particle and checks that it alone is quarantined, named and reported once.
fn assert_quarantined(logged: &Logged, fault: impl Fn(&mut App, Entity)) {
    let mut undisturbed = scene();
    run(&mut undisturbed.app, 20);
    let Scene { mut app, chain, particle, neighbour } = scene();
    let last = position(&app, particle);
    let tick = report(&app).tick;
    logged.assert_silent();
    fault(&mut app, particle);
    run(&mut app, 1);
    assert!(app.world().entity(particle).contains::<Quarantined>());
    let faults = messages::<ParticleFault>(&mut app);
    let faults: Vec<(Entity, u64)> = faults.iter().map(|fault| (fault.particle, fault.tick)).collect();
    assert_eq!(faults, [(particle, tick + 1)]);
    let line = logged.take_one();
    assert!(line.contains(&particle.to_string()), "{line:?}");
    assert_eq!(report(&app).faults, 1);
    let kept = position(&app, particle);
    assert!(kept.is_finite() && kept.distance(last) < 0.1, "kept at {kept}");

    run(&mut app, 19);
    assert_eq!(messages::<ParticleFault>(&mut app), []);
    logged.assert_silent();
    assert_eq!((report(&app).particles, report(&app).springs), (6, 4));
    assert_eq!(position(&app, particle), kept);
    assert!(position(&app, neighbour).is_finite() && velocity(&app, neighbour).y < -2.0);
    assert_eq!(
        hash(&app, &chain),
        hash(&undisturbed.app, &undisturbed.chain),
        "the others are not disturbed"
    );

    let world = app.world_mut();
    world.entity_mut(particle).remove::<(Quarantined, AppliedForce)>();
    world.entity_mut(particle).insert(ParticleVelocity::default());
    run(&mut app, 5);
    assert_eq!((report(&app).particles, report(&app).springs), (7, 5));
    assert!(position(&app, particle).is_finite() && position(&app, particle) != kept, "it moves again");
    logged.assert_silent();
}

fn set_velocity(app: &mut App, particle: Entity, velocity: Vec3) {
    app.world_mut().get_mut::<ParticleVelocity>(particle).unwrap().0 = velocity;
}

#[test]
fn a_position_that_is_not_a_number() {
    let logged = Logged::start();
    for bad in [f32::NAN, f32::INFINITY] {
        assert_quarantined(&logged, |app, particle| place(app, particle, Vec3::new(0.0, bad, 0.0)));
    }
}

#[test]
fn a_velocity_that_is_not_a_number() {
    let logged = Logged::start();
    for bad in [f32::NAN, f32::NEG_INFINITY] {
        assert_quarantined(&logged, |app, particle| set_velocity(app, particle, Vec3::X * bad));
    }
}

/// 3.4e38 N on a gram overflow within a substep.
#[test]
fn a_force_that_overflows() {
    let logged = Logged::start();
    let Scene { mut app, chain, .. } = scene();
    let victim = spawn(&mut app, 1e-3, 0.1, Vec3::X * -5.0);
    app.world_mut().entity_mut(victim).insert(AppliedForce(Vec3::X * f32::MAX));
    run(&mut app, 1);
    assert_eq!(messages::<ParticleFault>(&mut app).len(), 1);
    run(&mut app, 19);
    assert!(app.world().entity(victim).contains::<Quarantined>());
    assert!(position(&app, victim).is_finite());
    assert!(logged.take_one().contains(&victim.to_string()));
    let mut undisturbed = scene();
    run(&mut undisturbed.app, 20);
    assert_eq!(
        hash(&app, &chain),
        hash(&undisturbed.app, &undisturbed.chain),
        "the others are not disturbed"
    );
}

/// A force that is not a number is ignored: it is named once, and the particle falls on without it.
#[test]
fn a_force_that_is_not_a_number_is_ignored() {
    let logged = Logged::start();
    let (mut undisturbed, mut pushed) = (scene(), scene());
    pushed.app.world_mut().entity_mut(pushed.particle).insert(AppliedForce(Vec3::splat(f32::NAN)));
    run(&mut pushed.app, 10);
    let line = logged.take_one();
    assert!(line.contains(&pushed.particle.to_string()) && line.contains("force"), "{line:?}");
    run(&mut undisturbed.app, 10);
    assert_eq!(bits(&pushed.app, pushed.particle), bits(&undisturbed.app, undisturbed.particle));
    assert!(!pushed.app.world().entity(pushed.particle).contains::<Quarantined>());
}

/// One that is spawned non-finite is left out, named once, until it is corrected.
#[test]
fn a_particle_spawned_non_finite_is_left_out() {
    let logged = Logged::start();
    let mut app = app();
    let lost = spawn(&mut app, 1.0, 0.1, Vec3::new(f32::NAN, 0.0, 0.0));
    run(&mut app, 5);
    let line = logged.take_one();
    assert!(line.contains(&lost.to_string()) && line.contains("translation"), "{line:?}");
    assert_eq!(report(&app).particles, 0);
    place(&mut app, lost, Vec3::ZERO);
    run(&mut app, 5);
    assert!(position(&app, lost).y < 0.0);
    logged.assert_silent();
}

#[test]
fn a_pinned_particle_that_is_sent_to_infinity_keeps_its_place() {
    let logged = Logged::start();
    let mut app = app();
    let anchor = spawn_pinned(&mut app, Vec3::Y);
    let bob = spawn(&mut app, 1.0, 0.1, Vec3::ZERO);
    join(&mut app, Spring::new(anchor, bob, 1.0));
    run(&mut app, 5);
    place(&mut app, anchor, Vec3::Y * f32::INFINITY);
    run(&mut app, 1);
    assert_eq!(messages::<ParticleFault>(&mut app).len(), 1);
    run(&mut app, 20);
    assert!(position(&app, bob).is_finite() && velocity(&app, bob).y < -1.0, "it falls freely");
    assert_eq!(logged.take().len(), 1);
}

/// Explicit Euler explodes; the whole net is quarantined, each particle reported once, and the app
/// continues.
#[test]
fn an_explosion_is_reported_and_survived() {
    let logged = Logged::start();
    let mut app = app();
    app.insert_resource(scheme(Integrator::ExplicitEuler, 1));
    let rope = spawn_rope(&mut app, Vec3::ZERO, 8, 0.01, |spring| spring.with_stiffness(1e5));
    let other = spawn(&mut app, 1.0, 0.0, Vec3::Y * 100.0);
    run(&mut app, 200);
    let free = rope.len() - 1;
    assert!(report(&app).faults >= 1 && report(&app).faults <= free, "{}", report(&app).faults);
    assert_eq!(logged.take().len(), report(&app).faults);
    for particle in rope {
        assert!(position(&app, particle).is_finite());
    }
    let fallen = 100.0 - position(&app, other).y;
    // Explicit Euler: x = g h² n (n − 1) / 2.
    let expected = 9.81 * TICK * TICK * 200.0 * 199.0 / 2.0;
    assert!((fallen / expected - 1.0).abs() < 1e-3, "the other falls as before: {fallen} m");
}

/// A sheet of 4² with diagonals that hangs by two corners: its springs close loops.
fn spawn_sheet(app: &mut App, corner: Vec3) -> Vec<Entity> {
    let mut sheet = Vec::new();
    for place in 0..16_usize {
        let offset = Vec3::new((place % 4) as f32, 0.0, (place / 4) as f32) * 0.2;
        sheet.push(match place {
            0 | 3 => spawn_pinned(app, corner + offset),
            _ => spawn(app, 0.1, 0.0, corner + offset),
        });
        for (exists, back) in [(place % 4 > 0, 1), (place >= 4, 4), (place % 4 > 0 && place >= 4, 5)] {
            if exists {
                let length = if back == 5 { 0.2 * 2.0_f32.sqrt() } else { 0.2 };
                let spring = Spring::new(sheet[place - back], sheet[place], length);
                join(app, spring.with_stiffness(500.0).with_damping(0.5));
            }
        }
    }
    sheet
}

/// Extreme but finite numbers, as a bug of a game may set, stay in one net, whatever the scheme: another
/// one hangs as if it were alone.
#[test]
fn extreme_numbers_in_one_net_do_not_reach_another() {
    let _logged = Logged::start();
    let absurdities: [fn(&mut App, Entity); 3] = [
        |app, particle| set_velocity(app, particle, Vec3::new(1e30, 0.0, 0.0)),
        |app, particle| {
            app.world_mut().entity_mut(particle).insert(AppliedForce(Vec3::Z * -1e37));
        },
        |app, particle| place(app, particle, Vec3::splat(1e25)),
    ];
    for integrator in Integrator::named().chain([Integrator::Auto]) {
        for (number, absurdity) in absurdities.iter().enumerate() {
            let [alone, beside] = [false, true].map(|is_absurd| {
                let mut app = app();
                app.world_mut().resource_mut::<SolverSettings>().integrator = integrator;
                let calm = spawn_sheet(&mut app, Vec3::ZERO);
                let other = spawn_sheet(&mut app, Vec3::X * 30.0);
                run(&mut app, 5);
                if is_absurd {
                    absurdity(&mut app, other[15]);
                }
                run(&mut app, 25);
                for particle in &other {
                    assert!(position(&app, *particle).is_finite(), "{integrator}, {number}");
                }
                calm.iter().map(|particle| position(&app, *particle)).collect::<Vec<_>>()
            });
            // Newton's method leaves 5e-4 of each displacement at most; none is above 2 m.
            for (alone, beside) in alone.iter().zip(&beside) {
                let apart = alone.distance(*beside);
                assert!(apart <= 2.0 * 5e-4 * 2.0, "{integrator}, {number}: {apart} m");
            }
        }
    }
}
