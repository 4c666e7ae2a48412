//! Moving anchors, and particles with parents.

use std::f32::consts::FRAC_PI_2;

use bevy::prelude::*;
use bevy_mass_spring::prelude::*;

use crate::common::*;

/// An app without gravity and collisions, with 4 substeps of semi-implicit Euler.
fn plain_app() -> App {
    let mut app = app();
    plain(&mut app);
    app.insert_resource(scheme(Integrator::SemiImplicitEuler, 4));
    app
}

/// A bob of 1 kg at `offset` from `anchor`'s `place`, on a damped spring.
fn hang(app: &mut App, anchor: Entity, place: Vec3, offset: Vec3) -> Entity {
    let bob = spawn(app, 1.0, 0.0, place + offset);
    join(app, Spring::new(anchor, bob, offset.length()).with_stiffness(100.0).with_damping(2.0));
    bob
}

#[test]
fn an_anchor_goes_where_its_transform_goes_and_drags_what_hangs_from_it() {
    let mut app = plain_app();
    let anchor = spawn_pinned(&mut app, Vec3::ZERO);
    let bob = hang(&mut app, anchor, Vec3::ZERO, Vec3::X);
    run(&mut app, 1);
    assert_eq!(bits(&app, bob), [1.0_f32, 0.0, 0.0, 0.0, 0.0, 0.0].map(f32::to_bits));
    place(&mut app, anchor, Vec3::X * -0.25);
    run(&mut app, 1);
    assert_eq!(position(&app, anchor), Vec3::X * -0.25);
    assert_eq!(velocity(&app, anchor), Vec3::X * -0.25 / TICK);
    assert!(velocity(&app, bob).x < 0.0, "it follows in the same tick");
    run(&mut app, 1);
    assert_eq!(velocity(&app, anchor), Vec3::ZERO, "the anchor stands still again");
}

/// The parent is moved between two ticks; its `GlobalTransform` is a frame old then.
#[test]
fn an_anchor_under_a_moving_parent_follows_in_the_same_tick() {
    let (mut free, mut child) = (plain_app(), plain_app());
    let anchor = spawn_pinned(&mut free, Vec3::Y);
    let bob = hang(&mut free, anchor, Vec3::Y, Vec3::X);

    let grandparent = child.world_mut().spawn(Transform::default()).id();
    let parent = child.world_mut().spawn((Transform::from_xyz(0.0, 1.0, 0.0), ChildOf(grandparent))).id();
    let held = (Particle::new(1.0, 0.0), Pinned, Transform::default(), ChildOf(parent));
    let held = child.world_mut().spawn(held).id();
    let other_bob = hang(&mut child, held, Vec3::Y, Vec3::X);

    for tick in 0..60_u8 {
        let shift = Vec3::new(0.03, -0.01, 0.02) * f32::from(tick);
        place(&mut free, anchor, Vec3::Y + shift);
        // A child at the origin of a parent that is only translated: the very same numbers.
        place(&mut child, parent, Vec3::Y + shift);
        run(&mut free, 1);
        run(&mut child, 1);
        assert_eq!(bits(&free, bob), bits(&child, other_bob), "tick {tick}");
        assert_eq!(velocity(&free, anchor), velocity(&child, held), "tick {tick}");
        assert_eq!(position(&child, held), Vec3::ZERO, "its own transform is unchanged");
    }
}

#[test]
fn an_anchor_on_a_turning_and_growing_parent_is_where_geometry_says() {
    let mut app = plain_app();
    let transform = Transform::from_xyz(1.0, 2.0, 3.0);
    let parent = app.world_mut().spawn(transform).id();
    let anchor = (Particle::new(1.0, 0.0), Pinned, Transform::from_xyz(0.0, 0.0, -2.0), ChildOf(parent));
    let anchor = app.world_mut().spawn(anchor).id();
    run(&mut app, 1);
    *app.world_mut().get_mut::<Transform>(parent).unwrap() =
        transform.with_rotation(Quat::from_rotation_y(FRAC_PI_2)).with_scale(Vec3::splat(1.5));
    run(&mut app, 1);
    // From (1, 2, 1) to (1, 2, 3) + 1.5 · (−2, 0, 0) = (−2, 2, 3), in a tick of 1/64 s. The rotation by
    // π/2 rounds to 1e-7, at a distance of 3 m: 3e-7 m, and 64 times that in m/s.
    let expected = (Vec3::new(-2.0, 2.0, 3.0) - Vec3::new(1.0, 2.0, 1.0)) / TICK;
    assert!((velocity(&app, anchor) - expected).length() < 1e-4, "{}", velocity(&app, anchor));
}

/// A swinging rope of free particles, with or without parents; the world positions after each tick.
fn rope_under(parent: Option<Transform>, ticks: u32) -> Vec<Vec<Vec3>> {
    let mut app = app();
    app.insert_resource(scheme(Integrator::SemiImplicitEuler, 8));
    let rope = spawn_rope(&mut app, Vec3::new(0.0, 3.0, 0.0), 8, 0.2, |spring| spring.with_stiffness(500.0));
    let frame = parent.map_or(Mat4::IDENTITY, |transform| transform.to_matrix());
    if let Some(transform) = parent {
        let parent = app.world_mut().spawn(transform).id();
        for particle in &rope {
            let local = frame.inverse().transform_point3(position(&app, *particle));
            app.world_mut()
                .entity_mut(*particle)
                .insert((Transform::from_translation(local), ChildOf(parent)));
        }
    }
    let mut history = Vec::new();
    for _ in 0..ticks {
        run(&mut app, 1);
        history.push(rope.iter().map(|particle| frame.transform_point3(position(&app, *particle))).collect());
    }
    history
}

#[test]
fn an_identity_parent_changes_no_bit() {
    assert_eq!(rope_under(Some(Transform::IDENTITY), 60), rope_under(None, 60));
}

/// Particles live in world space whatever their parents do. Each tick rounds positions of size 5 m, there
/// and back, by 2 · 4 u · 5 m = 2.4e-6 m; within the 20 ticks of the first swing, which is not chaotic,
/// it adds up at most twice over (a position error is also a velocity error a little later): 1e-4 m.
#[test]
fn free_particles_under_a_parent_move_as_without() {
    let parent = Transform::from_xyz(1.0, -2.0, 0.5)
        .with_rotation(Quat::from_euler(EulerRot::XYZ, 0.4, 1.1, -0.7))
        .with_scale(Vec3::new(2.0, 2.0, 2.0));
    let (with, without) = (rope_under(Some(parent), 20), rope_under(None, 20));
    for (tick, (with, without)) in with.iter().zip(&without).enumerate() {
        for (one, other) in with.iter().zip(without) {
            assert!(one.distance(*other) < 1e-4, "tick {tick}: {one} and {other}");
        }
    }
    assert!(without[19][7].distance(without[0][7]) > 0.2, "it did swing");
}

/// A free particle rides along with a moving parent, without inertia: in the frame of the parent it moves as beside a
/// parent at rest, and its velocity is its own.
#[test]
fn a_free_particle_rides_along_with_a_moving_parent() {
    let mut app = plain_app();
    let parent = app.world_mut().spawn(Transform::default()).id();
    let particle = (Particle::new(1.0, 0.0), Transform::from_xyz(1.0, 0.0, 0.0), ChildOf(parent));
    let particle = app.world_mut().spawn((particle, ParticleVelocity(Vec3::Y))).id();
    for tick in 1..=4 {
        app.world_mut().get_mut::<Transform>(parent).unwrap().translation += Vec3::new(0.5, 0.0, -0.25);
        run(&mut app, 1);
        assert_eq!(position(&app, particle), Vec3::new(1.0, tick as f32 * TICK, 0.0));
        assert_eq!(velocity(&app, particle), Vec3::Y);
    }
}

/// A particle may be the parent of another: both are in world space, and neither moves the other.
#[test]
fn nested_particles_are_independent() {
    let mut app = plain_app();
    let outer = (Particle::new(1.0, 0.0), ParticleVelocity(Vec3::X), Transform::from_xyz(1.0, 0.0, 0.0));
    let outer = app.world_mut().spawn(outer).id();
    let nest = |app: &mut App, parent, velocity, local| {
        let particle =
            (Particle::new(1.0, 0.0), ParticleVelocity(velocity), Transform::from_translation(local));
        app.world_mut().spawn((particle, ChildOf(parent))).id()
    };
    let middle = nest(&mut app, outer, Vec3::Y, Vec3::Y);
    let inner = nest(&mut app, middle, Vec3::NEG_Z, Vec3::Z);
    run(&mut app, 64);
    // In the world each has flown 1 m; all numbers are dyadic, so nothing is rounded.
    let world = [Vec3::new(2.0, 0.0, 0.0), Vec3::new(1.0, 2.0, 0.0), Vec3::new(1.0, 1.0, 0.0)];
    assert_eq!(position(&app, outer), world[0]);
    assert_eq!(position(&app, middle), world[1] - world[0]);
    assert_eq!(position(&app, inner), world[2] - world[1]);
    let velocities = [outer, middle, inner].map(|particle| velocity(&app, particle));
    assert_eq!(velocities, [Vec3::X, Vec3::Y, Vec3::NEG_Z]);
}

/// A pinned particle under a free one moves with it, in the tick after.
#[test]
fn a_pinned_particle_under_a_free_one_moves_with_it() {
    let mut app = plain_app();
    let carrier = (Particle::new(1.0, 0.0), ParticleVelocity(Vec3::X), Transform::default());
    let carrier = app.world_mut().spawn(carrier).id();
    let rider = (Particle::new(1.0, 0.0), Pinned, Transform::from_xyz(0.0, 1.0, 0.0), ChildOf(carrier));
    let rider = app.world_mut().spawn(rider).id();
    run(&mut app, 10);
    assert_eq!(position(&app, rider), Vec3::Y);
    assert_eq!(velocity(&app, rider), Vec3::X);
    assert_eq!(velocity(&app, carrier), Vec3::X);
}

#[test]
fn a_plane_under_a_moving_parent_pushes() {
    let mut app = plain_app();
    app.world_mut().resource_mut::<CollisionSettings>().ground = true;
    let parent = app.world_mut().spawn(Transform::default()).id();
    app.world_mut().spawn((ParticleCollider::default(), ChildOf(parent)));
    let ball = spawn(&mut app, 1.0, 0.25, Vec3::Y * 0.25);
    run(&mut app, 2);
    for tick in 1..=8_u8 {
        place(&mut app, parent, Vec3::Y * f32::from(tick) * TICK);
        run(&mut app, 1);
        assert_eq!(velocity(&app, ball), Vec3::Y, "tick {tick}");
        assert_eq!(position(&app, ball), Vec3::Y * (0.25 + f32::from(tick) * TICK), "tick {tick}");
    }
}

/// `solver::Solver` drops them, so that the others are followed.
#[test]
fn motions_of_particles_that_do_not_exist_are_dropped() {
    use bevy_mass_spring::solver::{PinnedMotion, Solver, StepSettings};
    let mut solver = Solver::default();
    let anchor = solver.add_particle(Vec3::ZERO, Vec3::ZERO, f32::INFINITY, 0.1).unwrap();
    solver.inputs_mut().pinned.push(PinnedMotion { slot: 7, start: Vec3::ZERO, target: Vec3::X });
    solver.move_pinned(anchor, Vec3::Y);
    solver.step(&StepSettings::default());
    assert_eq!(solver.position(anchor), Vec3::Y);
    assert_eq!(solver.inputs_mut().pinned.len(), 1);
}
