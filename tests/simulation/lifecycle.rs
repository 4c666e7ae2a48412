//! Particles and springs that are spawned, despawned and changed while the app runs.

use bevy::prelude::*;
use bevy_mass_spring::prelude::*;

use crate::common::*;

/// A pinned particle at the origin and a free one of 1 kg at x = 2 m, on a spring of length 1 m.
fn stretched_pair(app: &mut App, stiffness: f32) -> (Entity, Entity, Entity) {
    let anchor = spawn_pinned(app, Vec3::ZERO);
    let bob = spawn(app, 1.0, 0.0, Vec3::X * 2.0);
    let spring = join(app, Spring::new(anchor, bob, 1.0).with_stiffness(stiffness).with_damping(0.0));
    (anchor, bob, spring)
}

/// Puts `bob` back to x = 2 m, at rest, runs a tick and returns the force that it felt, in N: one
/// substep of semi-implicit Euler gives v = h f / m.
fn measure_force(app: &mut App, bob: Entity) -> f32 {
    place(app, bob, Vec3::X * 2.0);
    app.world_mut().get_mut::<ParticleVelocity>(bob).unwrap().0 = Vec3::ZERO;
    run(app, 1);
    let mass = app.world().get::<Particle>(bob).unwrap().mass;
    let force = velocity(app, bob) * mass / TICK;
    assert_eq!([force.y, force.z], [0.0; 2]);
    force.x
}

fn plain_app() -> App {
    let mut app = app();
    plain(&mut app);
    app
}

#[test]
fn a_particle_falls_from_the_tick_after_it_was_spawned() {
    let mut app = app();
    run(&mut app, 10);
    assert_eq!(report(&app).particles, 0);
    let late = spawn(&mut app, 1.0, 0.1, Vec3::Y * 5.0);
    run(&mut app, 1);
    assert_eq!(report(&app).particles, 1);
    assert!((velocity(&app, late).y + 9.81 * TICK).abs() < 1e-6);
}

#[test]
fn particles_spawned_before_the_plugin_are_simulated() {
    let mut app = App::new();
    app.add_plugins(MinimalPlugins).insert_resource(bevy::time::TimeUpdateStrategy::FixedTimesteps(1));
    let early = spawn(&mut app, 1.0, 0.1, Vec3::Y * 5.0);
    app.add_plugins(MassSpringPlugin::default());
    app.finish();
    app.cleanup();
    run(&mut app, 2);
    assert_eq!(report(&app).particles, 1);
    assert!(velocity(&app, early).y < 0.0);
}

#[test]
fn despawning_a_particle_removes_its_springs() {
    let mut app = plain_app();
    let (anchor, bob, _) = stretched_pair(&mut app, 100.0);
    let other = spawn(&mut app, 1.0, 0.0, Vec3::Y);
    run(&mut app, 1);
    assert_eq!((report(&app).particles, report(&app).springs), (3, 1));
    let before = velocity(&app, bob);
    assert!(before.x < 0.0);
    app.world_mut().despawn(anchor);
    run(&mut app, 1);
    assert_eq!((report(&app).particles, report(&app).springs), (2, 0));
    assert_eq!(velocity(&app, bob), before, "no spring pulls any more");
    assert_eq!(position(&app, other), Vec3::Y);
}

#[test]
fn despawning_a_spring_frees_its_ends() {
    let mut app = plain_app();
    let (_, bob, spring) = stretched_pair(&mut app, 100.0);
    run(&mut app, 1);
    let before = velocity(&app, bob);
    app.world_mut().despawn(spring);
    run(&mut app, 1);
    assert_eq!(report(&app).springs, 0);
    assert_eq!(velocity(&app, bob), before);
}

/// The slots of the remaining particles change: each must keep its own state.
#[test]
fn remaining_particles_keep_their_state_when_slots_are_renumbered() {
    let mut app = plain_app();
    let all: Vec<Entity> = (0..10_u8)
        .map(|number| {
            let particle = spawn(&mut app, 1.0, 0.0, Vec3::X * f32::from(number));
            app.world_mut().get_mut::<ParticleVelocity>(particle).unwrap().0 = Vec3::Y * f32::from(number);
            particle
        })
        .collect();
    run(&mut app, 4);
    for gone in [0, 3, 4, 9] {
        app.world_mut().despawn(all[gone]);
    }
    run(&mut app, 4);
    for remaining in [1_u8, 2, 5, 6, 7, 8] {
        let particle = all[usize::from(remaining)];
        let number = f32::from(remaining);
        assert_eq!(position(&app, particle), Vec3::new(number, number * 8.0 * TICK, 0.0));
        assert_eq!(velocity(&app, particle), Vec3::Y * number);
    }
}

#[test]
fn removing_and_reinserting_the_component_works() {
    let mut app = plain_app();
    let (_, bob, _) = stretched_pair(&mut app, 100.0);
    run(&mut app, 1);
    let particle = *app.world().get::<Particle>(bob).unwrap();
    app.world_mut().entity_mut(bob).remove::<Particle>();
    let left_at = position(&app, bob);
    run(&mut app, 5);
    assert_eq!(position(&app, bob), left_at, "it is not a particle now");
    assert_eq!((report(&app).particles, report(&app).springs), (1, 0));
    app.world_mut().entity_mut(bob).insert(particle);
    assert_eq!(measure_force(&mut app, bob), -100.0);
    assert_eq!((report(&app).particles, report(&app).springs), (2, 1));
}

#[test]
fn every_parameter_may_change_while_it_runs() {
    let mut app = plain_app();
    let (anchor, bob, spring) = stretched_pair(&mut app, 100.0);
    assert_eq!(measure_force(&mut app, bob), -100.0);
    app.world_mut().get_mut::<Spring>(spring).unwrap().stiffness = 50.0;
    assert_eq!(measure_force(&mut app, bob), -50.0);
    app.world_mut().get_mut::<Spring>(spring).unwrap().rest_length = 4.0;
    assert_eq!(measure_force(&mut app, bob), 100.0);
    app.world_mut().get_mut::<Particle>(bob).unwrap().mass = 4.0;
    assert_eq!(measure_force(&mut app, bob), 100.0);
    app.world_mut().entity_mut(bob).insert(AppliedForce(Vec3::X * 28.0));
    assert_eq!(measure_force(&mut app, bob), 128.0);
    app.world_mut().entity_mut(bob).remove::<AppliedForce>();
    assert_eq!(measure_force(&mut app, bob), 100.0);

    // Damping acts on what moves: −c v with c = 8 N·s/m and v = 2 m/s.
    let mut ends = app.world_mut().get_mut::<Spring>(spring).unwrap();
    (ends.stiffness, ends.damping) = (0.0, 8.0);
    place(&mut app, bob, Vec3::X * 2.0);
    app.world_mut().get_mut::<ParticleVelocity>(bob).unwrap().0 = Vec3::X * 2.0;
    run(&mut app, 1);
    assert_eq!(velocity(&app, bob).x, 2.0 - TICK * 16.0 / 4.0);
    assert_eq!(position(&app, anchor), Vec3::ZERO);
}

#[test]
fn the_radius_may_change_while_it_runs() {
    let mut app = app();
    app.insert_resource(scheme(Integrator::SemiImplicitEuler, 4));
    let ball = spawn(&mut app, 1.0, 0.1, Vec3::Y * 0.1);
    app.world_mut().spawn(ParticleCollider::default());
    run(&mut app, 10);
    assert_eq!(position(&app, ball).y, 0.1);
    app.world_mut().get_mut::<Particle>(ball).unwrap().radius = 0.25;
    run(&mut app, 1);
    assert_eq!((position(&app, ball).y, velocity(&app, ball)), (0.25, Vec3::ZERO), "pushed out, not thrown");
}

#[test]
fn a_spring_may_change_its_ends() {
    let mut app = plain_app();
    let (anchor, bob, spring) = stretched_pair(&mut app, 100.0);
    let other = spawn(&mut app, 1.0, 0.0, Vec3::Y * 3.0);
    run(&mut app, 1);
    app.world_mut().get_mut::<Spring>(spring).unwrap().particles = [other, anchor];
    let before = velocity(&app, bob);
    run(&mut app, 1);
    assert_eq!(velocity(&app, bob), before, "the old end is free");
    assert_eq!(velocity(&app, other), Vec3::NEG_Y * 200.0 * TICK, "the new one is pulled");
}

#[test]
fn pinning_stops_and_unpinning_frees() {
    let mut app = app();
    let particle = spawn(&mut app, 1.0, 0.1, Vec3::Y * 5.0);
    run(&mut app, 10);
    assert!(velocity(&app, particle).y < -1.0);
    app.world_mut().entity_mut(particle).insert(Pinned);
    let held = position(&app, particle);
    for _ in 0..5 {
        run(&mut app, 1);
        assert_eq!([position(&app, particle), velocity(&app, particle)], [held, Vec3::ZERO]);
    }
    app.world_mut().entity_mut(particle).remove::<Pinned>();
    run(&mut app, 1);
    assert!((velocity(&app, particle).y + 9.81 * TICK).abs() < 1e-6, "it falls, from rest");
    assert!(position(&app, particle).y < held.y);
}

/// A particle that is unpinned keeps the velocity of its prescribed motion.
#[test]
fn an_unpinned_particle_keeps_its_prescribed_velocity() {
    let mut app = plain_app();
    let particle = spawn_pinned(&mut app, Vec3::ZERO);
    run(&mut app, 1);
    for tick in 1..=4_u8 {
        place(&mut app, particle, Vec3::X * f32::from(tick) * TICK * 3.0);
        run(&mut app, 1);
    }
    app.world_mut().entity_mut(particle).remove::<Pinned>();
    run(&mut app, 1);
    assert_eq!(velocity(&app, particle), Vec3::X * 3.0);
}

#[test]
fn a_spring_spawned_before_its_ends_are_particles_waits_for_them() {
    let mut app = plain_app();
    let anchor = spawn_pinned(&mut app, Vec3::ZERO);
    let bob = app.world_mut().spawn(Transform::from_xyz(2.0, 0.0, 0.0)).id();
    join(&mut app, Spring::new(anchor, bob, 1.0).with_stiffness(64.0));
    run(&mut app, 3);
    assert_eq!((report(&app).particles, report(&app).springs), (1, 0));
    app.world_mut().entity_mut(bob).insert(Particle::new(1.0, 0.0));
    run(&mut app, 1);
    assert_eq!(velocity(&app, bob).x, -64.0 * TICK);
}

#[test]
fn planes_may_be_spawned_and_despawned() {
    let mut app = app();
    let ball = spawn(&mut app, 1.0, 0.1, Vec3::Y * 0.1);
    let ground = app.world_mut().spawn(ParticleCollider::default()).id();
    run(&mut app, 20);
    assert_eq!(position(&app, ball).y, 0.1);
    app.world_mut().despawn(ground);
    run(&mut app, 20);
    assert!(position(&app, ball).y < 0.0, "no plane holds it");
    let height = position(&app, ball).y.floor();
    app.world_mut().spawn((ParticleCollider::default(), Transform::from_xyz(0.0, height - 1.0, 0.0)));
    run(&mut app, 200);
    assert!((position(&app, ball).y - (height - 0.9)).abs() < 1e-6);
}

#[test]
fn everything_may_be_despawned() {
    let mut app = app();
    let rope = spawn_rope(&mut app, Vec3::Y, 10, 0.1, |spring| spring);
    run(&mut app, 5);
    for particle in rope {
        app.world_mut().despawn(particle);
    }
    run(&mut app, 5);
    assert_eq!((report(&app).particles, report(&app).springs), (0, 0));
    assert_eq!(report(&app).faults, 0);
}

/// A spring that is copied into another world follows its particles there.
#[test]
fn the_ends_of_a_spring_are_mapped() {
    use bevy::ecs::entity::{EntityHashMap, MapEntities};

    let mut world = World::new();
    let [old_first, old_second, new_first, new_second] = std::array::from_fn(|_| world.spawn_empty().id());
    let mut spring = Spring::new(old_first, old_second, 1.0);
    let mut new_of: EntityHashMap<Entity> =
        [(old_first, new_first), (old_second, new_second)].into_iter().collect();
    spring.map_entities(&mut new_of);
    assert_eq!(spring, Spring::new(new_first, new_second, 1.0));
}
