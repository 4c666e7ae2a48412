//! Entities with Bevy's `Disabled`: they leave the simulation and come back as quarantined ones do.

use bevy::ecs::entity_disabling::Disabled;
use bevy::prelude::*;
use bevy_mass_spring::prelude::*;

use crate::common::*;

/// An anchor at the origin and a particle of 1 kg at x = 2 m on a spring of 1 m and 100 N/m, and one apart.
struct Pair {
    app: App,
    anchor: Entity,
    bob: Entity,
    spring: Entity,
}

fn pair() -> Pair {
    let mut app = app();
    plain(&mut app);
    let anchor = spawn_pinned(&mut app, Vec3::ZERO);
    let bob = spawn(&mut app, 1.0, 0.0, Vec3::X * 2.0);
    spawn(&mut app, 1.0, 0.0, Vec3::Y * 50.0);
    let spring = join(&mut app, Spring::new(anchor, bob, 1.0).with_stiffness(100.0).with_damping(0.0));
    Pair { app, anchor, bob, spring }
}

impl Pair {
    fn disable(&mut self, entity: Entity) {
        self.app.world_mut().entity_mut(entity).insert(Disabled);
    }

    fn enable(&mut self, entity: Entity) {
        self.app.world_mut().entity_mut(entity).remove::<Disabled>();
    }

    /// The force that the bob feels where it is put to, N, and the counts of the report.
    #[track_caller]
    fn assert_force(&mut self, expected: f32, particles: usize, springs: usize) {
        place(&mut self.app, self.bob, Vec3::X * 2.0);
        self.app.world_mut().get_mut::<ParticleVelocity>(self.bob).expect("it has one").0 = Vec3::ZERO;
        run(&mut self.app, 1);
        assert_eq!(velocity(&self.app, self.bob) / TICK, Vec3::X * expected);
        assert_eq!((report(&self.app).particles, report(&self.app).springs), (particles, springs));
    }
}

#[test]
fn a_disabled_particle_leaves_and_comes_back() {
    let mut pair = pair();
    let anchor = pair.anchor;
    pair.assert_force(-100.0, 3, 1);
    for _ in 0..2 {
        pair.disable(anchor);
        pair.assert_force(0.0, 2, 0);
        pair.assert_force(0.0, 2, 0);
        pair.enable(anchor);
        pair.assert_force(-100.0, 3, 1);
    }
}

#[test]
fn a_disabled_particle_stays_where_it_is() {
    let Pair { mut app, bob, .. } = pair();
    run(&mut app, 5);
    let left = bits(&app, bob);
    app.world_mut().entity_mut(bob).insert(Disabled);
    run(&mut app, 5);
    assert_eq!(bits(&app, bob), left);
    app.world_mut().entity_mut(bob).remove::<Disabled>();
    run(&mut app, 1);
    assert_ne!(bits(&app, bob), left);
    assert_eq!(report(&app).faults, 0);
}

#[test]
fn a_particle_may_be_spawned_disabled() {
    let mut pair = pair();
    let late = pair.app.world_mut().spawn((Particle::new(1.0, 0.0), Pinned, Disabled)).id();
    let spring = Spring::new(late, pair.bob, 1.0).with_stiffness(50.0).with_damping(0.0);
    join(&mut pair.app, spring);
    pair.assert_force(-100.0, 3, 1);
    pair.enable(late);
    pair.assert_force(-150.0, 4, 2);
}

#[test]
fn a_disabled_particle_takes_its_springs_along_when_it_is_despawned() {
    let mut pair = pair();
    let anchor = pair.anchor;
    pair.assert_force(-100.0, 3, 1);
    pair.disable(anchor);
    pair.assert_force(0.0, 2, 0);
    pair.app.world_mut().despawn(anchor);
    pair.assert_force(0.0, 2, 0);
    assert!(pair.app.world().get_entity(pair.spring).is_err());
    // In the tick in which it was disabled, too.
    let anchor = spawn_pinned(&mut pair.app, Vec3::ZERO);
    let spring = Spring::new(anchor, pair.bob, 1.0).with_stiffness(10.0).with_damping(0.0);
    let spring = join(&mut pair.app, spring);
    pair.assert_force(-10.0, 3, 1);
    pair.disable(anchor);
    pair.app.world_mut().despawn(anchor);
    pair.assert_force(0.0, 2, 0);
    assert!(pair.app.world().get_entity(spring).is_err());
}

/// What was moved while it was disabled has not moved there from where it was.
#[test]
fn a_disabled_anchor_has_no_past_when_it_is_back() {
    let Pair { mut app, anchor, .. } = pair();
    run(&mut app, 2);
    app.world_mut().entity_mut(anchor).insert(Disabled);
    run(&mut app, 2);
    app.world_mut().get_mut::<Transform>(anchor).expect("it has one").translation = Vec3::Y * 3.0;
    app.world_mut().entity_mut(anchor).remove::<Disabled>();
    run(&mut app, 1);
    assert_eq!(velocity(&app, anchor), Vec3::ZERO);
    assert_eq!(position(&app, anchor), Vec3::Y * 3.0);
}

#[test]
fn a_disabled_spring_exerts_no_force() {
    let mut pair = pair();
    let spring = pair.spring;
    pair.assert_force(-100.0, 3, 1);
    for _ in 0..2 {
        pair.disable(spring);
        pair.assert_force(0.0, 3, 0);
        // Edits count once it is back.
        pair.app.world_mut().get_mut::<Spring>(spring).expect("it is one").stiffness = 50.0;
        pair.assert_force(0.0, 3, 0);
        pair.enable(spring);
        pair.assert_force(-50.0, 3, 1);
    }
    pair.disable(spring);
    pair.app.world_mut().despawn(spring);
    pair.assert_force(0.0, 3, 0);
    let late = Spring::new(pair.anchor, pair.bob, 1.0).with_stiffness(20.0).with_damping(0.0);
    let late = pair.app.world_mut().spawn((late, Disabled)).id();
    pair.assert_force(0.0, 3, 0);
    pair.enable(late);
    pair.assert_force(-20.0, 3, 1);
}

#[test]
fn a_disabled_spring_goes_with_its_particle() {
    let mut pair = pair();
    let (spring, anchor) = (pair.spring, pair.anchor);
    pair.assert_force(-100.0, 3, 1);
    pair.disable(spring);
    pair.assert_force(0.0, 3, 0);
    pair.app.world_mut().despawn(anchor);
    pair.assert_force(0.0, 2, 0);
    assert!(pair.app.world().get_entity(spring).is_err());
}

/// A ball on a plane that is disabled falls; one on a plane that is enabled again does not feel how it got there.
#[test]
fn a_disabled_plane_touches_nothing() {
    let mut app = app();
    let plane = app.world_mut().spawn((ParticleCollider::default(), Transform::default())).id();
    let ball = spawn(&mut app, 1.0, 0.1, Vec3::Y * 0.1);
    run(&mut app, 10);
    assert_eq!((position(&app, ball), report(&app).contacts), (Vec3::Y * 0.1, 1));
    app.world_mut().entity_mut(plane).insert(Disabled);
    run(&mut app, 10);
    assert!(position(&app, ball).y < 0.05 && report(&app).contacts == 0);
    app.world_mut().get_mut::<Transform>(plane).expect("it has one").translation.y = -2.0;
    app.world_mut().entity_mut(plane).remove::<Disabled>();
    place(&mut app, ball, Vec3::Y * -1.9);
    app.world_mut().get_mut::<ParticleVelocity>(ball).expect("it has one").0 = Vec3::ZERO;
    run(&mut app, 1);
    assert_eq!((position(&app, ball), velocity(&app, ball)), (Vec3::Y * -1.9, Vec3::ZERO));
    app.world_mut().entity_mut(plane).insert(Disabled);
    app.world_mut().despawn(plane);
    let plane =
        app.world_mut().spawn((ParticleCollider::default(), Transform::from_xyz(0.0, -2.0, 0.0), Disabled));
    let plane = plane.id();
    run(&mut app, 1);
    assert_eq!(report(&app).contacts, 0);
    app.world_mut().entity_mut(plane).remove::<Disabled>();
    run(&mut app, 5);
    assert_eq!(report(&app).contacts, 1);
}

/// `Disabled` is no part of a snapshot: what was disabled or enabled since stays so.
#[test]
fn what_was_disabled_since_a_snapshot_stays_so() {
    let mut pair = pair();
    let anchor = pair.anchor;
    pair.assert_force(-100.0, 3, 1);
    let enabled = Snapshot::take(pair.app.world());
    pair.disable(anchor);
    pair.assert_force(0.0, 2, 0);
    let disabled = Snapshot::take(pair.app.world());
    enabled.restore(pair.app.world_mut());
    pair.assert_force(0.0, 2, 0);
    pair.enable(anchor);
    pair.assert_force(-100.0, 3, 1);
    disabled.restore(pair.app.world_mut());
    pair.assert_force(-100.0, 3, 1);
    let spring = pair.spring;
    let enabled = Snapshot::take(pair.app.world());
    pair.disable(spring);
    pair.assert_force(0.0, 3, 0);
    let disabled = Snapshot::take(pair.app.world());
    enabled.restore(pair.app.world_mut());
    pair.assert_force(0.0, 3, 0);
    pair.enable(spring);
    pair.assert_force(-100.0, 3, 1);
    disabled.restore(pair.app.world_mut());
    pair.assert_force(-100.0, 3, 1);
}
