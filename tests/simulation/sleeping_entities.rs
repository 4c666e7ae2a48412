//! Sleep in an app: which particles sleep is told, what a game does wakes it, snapshots keep it.

use std::sync::Arc;

use bevy::prelude::*;
use bevy_mass_spring::nets::Rope;
use bevy_mass_spring::prelude::*;

use crate::common::*;

/// A ball on a box, one on the ground, a load on a spring and a hanging rope, asleep.
struct Scene {
    app: App,
    table: Entity,
    ground: Entity,
    on_table: Entity,
    on_ground: Entity,
    anchor: Entity,
    load: Entity,
    spring: Entity,
    rope: Entity,
}

fn scene() -> Scene {
    let mut app = app();
    app.insert_resource(SleepSettings { enabled: true, ..default() });
    app.init_resource::<SleepingParticles>();
    app.world_mut().resource_mut::<CollisionSettings>().particles = true;
    let ground = app.world_mut().spawn(ParticleCollider::half_space().with_friction(0.3)).id();
    let table = app
        .world_mut()
        .spawn((ParticleCollider::from(Cuboid::new(1.0, 1.0, 1.0)), Transform::from_xyz(3.0, 0.5, 0.0)))
        .id();
    let on_table = spawn(&mut app, 1.0, 0.1, Vec3::new(3.0, 1.1, 0.0));
    let on_ground = spawn(&mut app, 1.0, 0.1, Vec3::new(-3.0, 0.1, 0.0));
    let anchor = spawn_pinned(&mut app, Vec3::Y * 3.0);
    let load = spawn(&mut app, 1.0, 0.1, Vec3::Y * 2.0);
    let spring = Spring::new(anchor, load, 1.0).with_stiffness(400.0).with_damping(40.0);
    let spring = join(&mut app, spring);
    let topology = Rope::new(1.0).with_segments(8).topology().unwrap();
    let net = ParticleNet::new(Arc::new(topology), &Transform::from_xyz(6.0, 3.0, 0.0));
    let rope = app.world_mut().spawn(net.with_pinned([0])).id();
    let mut scene = Scene { app, table, ground, on_table, on_ground, anchor, load, spring, rope };
    scene.until_asleep();
    scene
}

const ALL: usize = 3 + 8;

impl Scene {
    fn until_asleep(&mut self) {
        for _ in 0..2000 {
            run(&mut self.app, 1);
            if report(&self.app).asleep == ALL {
                return;
            }
        }
        panic!("{} of {ALL} sleep", report(&self.app).asleep);
    }

    fn sleeping(&self) -> &SleepingParticles {
        self.app.world().resource::<SleepingParticles>()
    }

    fn set<C: Component<Mutability = bevy::ecs::component::Mutable>>(
        &mut self,
        entity: Entity,
        change: impl FnOnce(&mut C),
    ) {
        change(&mut self.app.world_mut().get_mut::<C>(entity).unwrap());
    }

    /// Everything by which what follows can be compared.
    fn bits(&self) -> (u64, Vec<[u32; 3]>, usize) {
        let net = self.app.world().get::<ParticleNet>(self.rope).unwrap();
        let places = net.positions().iter().map(|place| place.to_array().map(f32::to_bits)).collect();
        (hash(&self.app, &[self.on_table, self.on_ground, self.load]), places, report(&self.app).asleep)
    }
}

#[test]
fn nothing_sleeps_unless_it_is_enabled() {
    let mut app = app();
    assert!(!app.world().resource::<SleepSettings>().enabled);
    app.init_resource::<SleepingParticles>();
    app.world_mut().spawn(ParticleCollider::default());
    spawn(&mut app, 1.0, 0.1, Vec3::Y * 0.1);
    run(&mut app, 200);
    assert_eq!((report(&app).asleep, report(&app).contacts), (0, 1));
    assert!(app.world().resource::<SleepingParticles>().all.is_empty());
}

#[test]
fn sleeping_particles_are_published() {
    let mut scene = scene();
    let Scene { on_table, on_ground, anchor, load, rope, .. } = scene;
    let sleeping = scene.sleeping();
    assert_eq!(sleeping.all.len(), ALL);
    assert!([on_table, on_ground, load].iter().all(|ball| sleeping.contains(*ball, None)));
    assert!(!sleeping.contains(anchor, None) && sleeping.count_of(anchor) == 0);
    assert_eq!((sleeping.count_of(rope), sleeping.count_of(load)), (8, 1));
    assert!(sleeping.contains(rope, Some(8)) && !sleeping.contains(rope, Some(0)));
    scene.app.world_mut().entity_mut(load).insert(AppliedForce(Vec3::X));
    run(&mut scene.app, 1);
    assert!(!scene.sleeping().contains(load, None) && scene.sleeping().contains(on_ground, None));
    // What is asked for later is told at once.
    scene.app.world_mut().remove_resource::<SleepingParticles>();
    run(&mut scene.app, 1);
    scene.app.init_resource::<SleepingParticles>();
    run(&mut scene.app, 1);
    assert_eq!(scene.sleeping().all.len(), ALL - 1);
}

/// Does something, runs a tick, and compares which particles are awake.
#[track_caller]
fn assert_wakes(awake: fn(&Scene) -> Vec<Entity>, act: impl FnOnce(&mut Scene)) {
    let mut scene = scene();
    act(&mut scene);
    run(&mut scene.app, 1);
    let all = [scene.on_table, scene.on_ground, scene.load, scene.rope];
    let found: Vec<Entity> =
        all.into_iter().filter(|entity| scene.sleeping().count_of(*entity) == 0).collect();
    assert_eq!(found, awake(&scene));
}

#[test]
fn what_a_game_does_to_particles_wakes_them() {
    assert_wakes(|_| vec![], |_| {});
    assert_wakes(
        |scene| vec![scene.on_table],
        |scene| {
            scene.set::<Transform>(scene.on_table, |place| place.translation.x += 0.1);
        },
    );
    assert_wakes(
        |scene| vec![scene.on_ground],
        |scene| {
            scene.set::<ParticleVelocity>(scene.on_ground, |velocity| velocity.0.x = 0.1);
        },
    );
    assert_wakes(
        |scene| vec![scene.load],
        |scene| {
            scene.set::<Particle>(scene.load, |particle| particle.mass = 2.0);
        },
    );
    assert_wakes(
        |scene| vec![scene.load],
        |scene| {
            scene.set::<Spring>(scene.spring, |spring| spring.stiffness = 300.0);
        },
    );
    assert_wakes(
        |scene| vec![scene.load],
        |scene| {
            scene.set::<Transform>(scene.anchor, |place| place.translation.y += 0.01);
        },
    );
    assert_wakes(|scene| vec![scene.load], |scene| _ = scene.app.world_mut().despawn(scene.spring));
    assert_wakes(
        |scene| vec![scene.rope],
        |scene| {
            scene.set::<ParticleNet>(scene.rope, |net| net.velocities_mut()[5].x = 0.1);
        },
    );
    assert_wakes(
        |scene| vec![scene.on_table],
        |scene| {
            let slippery = ContactMaterial { friction: 0.0, ..default() };
            scene.app.world_mut().entity_mut(scene.on_table).insert(slippery);
        },
    );
}

#[test]
fn what_a_game_does_around_them_wakes_them() {
    let all = |scene: &Scene| vec![scene.on_table, scene.on_ground, scene.load, scene.rope];
    assert_wakes(all, |scene| scene.app.world_mut().resource_mut::<Environment>().gravity.y = -5.0);
    assert_wakes(all, |scene| scene.app.world_mut().resource_mut::<Environment>().wind.x = 5.0);
    assert_wakes(all, |scene| scene.app.world_mut().resource_mut::<SleepSettings>().enabled = false);
    assert_wakes(
        |scene| vec![scene.on_table],
        |scene| {
            scene.set::<Transform>(scene.table, |place| place.translation.y -= 0.001);
        },
    );
    assert_wakes(|scene| vec![scene.on_table], |scene| _ = scene.app.world_mut().despawn(scene.table));
    assert_wakes(|scene| vec![scene.on_ground], |scene| _ = scene.app.world_mut().despawn(scene.ground));
    assert_wakes(
        |scene| vec![scene.on_ground],
        |scene| {
            let sphere = (ParticleCollider::from(Sphere::new(0.2)), Transform::from_xyz(-3.0, 0.3, 0.1));
            scene.app.world_mut().spawn(sphere);
        },
    );
    assert_wakes(
        |scene| vec![scene.on_ground],
        |scene| {
            _ = spawn(&mut scene.app, 1.0, 0.1, Vec3::new(-3.0, 0.3005, 0.0));
        },
    );
}

#[test]
fn a_snapshot_keeps_the_sleeping_particles() {
    let mut scene = scene();
    let push = |scene: &mut Scene| {
        let mut history = Vec::new();
        for tick in 0..150 {
            if tick == 20 {
                scene.set::<ParticleVelocity>(scene.on_ground, |velocity| velocity.0 = Vec3::X);
            }
            if tick == 30 {
                scene.set::<Transform>(scene.anchor, |place| place.translation.x += 0.05);
            }
            run(&mut scene.app, 1);
            history.push(scene.bits());
        }
        history
    };
    let snapshot = Snapshot::take(scene.app.world());
    let history = push(&mut scene);
    assert!(history[19].2 == ALL && history[40].2 < ALL - 1);
    snapshot.restore(scene.app.world_mut());
    assert!(push(&mut scene) == history, "in the same app");
    // In another one, in which nothing has fallen asleep yet.
    let mut other = self::scene();
    other.set::<ParticleVelocity>(other.on_table, |velocity| velocity.0 = Vec3::Y);
    run(&mut other.app, 10);
    snapshot.restore_in_order(other.app.world_mut()).unwrap();
    assert!(push(&mut other) == history, "in another app");
}

#[cfg(feature = "scene")]
#[test]
fn a_written_snapshot_keeps_the_sleeping_particles() {
    let mut scene = scene();
    let snapshot = ron::to_string(&Snapshot::take(scene.app.world())).unwrap();
    run(&mut scene.app, 50);
    let expected = scene.bits();
    scene.set::<ParticleVelocity>(scene.on_table, |velocity| velocity.0 = Vec3::Y);
    run(&mut scene.app, 10);
    let snapshot: Snapshot = ron::from_str(&snapshot).unwrap();
    snapshot.restore(scene.app.world_mut());
    for tick in 0..50 {
        run(&mut scene.app, 1);
        assert_eq!(report(&scene.app).asleep, ALL, "tick {tick}");
    }
    assert!(scene.bits() == expected);
}

/// What sleeps goes on touching what it touched.
#[test]
fn falling_asleep_ends_no_contact() {
    let mut app = app();
    app.insert_resource(SleepSettings { enabled: true, ..default() });
    app.add_message::<ContactStarted>().add_message::<ContactEnded>();
    let sensor = ParticleCollider { is_sensor: true, ..ParticleCollider::from(Sphere::new(1.0)) };
    let sensor = app.world_mut().spawn(sensor).id();
    let ground = app.world_mut().spawn(ParticleCollider::half_space()).id();
    let ball = spawn(&mut app, 1.0, 0.1, Vec3::Y * 0.1);
    let mut started = Vec::new();
    for _ in 0..200 {
        run(&mut app, 1);
        started.extend(messages::<ContactStarted>(&mut app).iter().map(|pair| pair.other));
        assert!(messages::<ContactEnded>(&mut app).is_empty());
    }
    assert_eq!(report(&app).asleep, 1);
    started.sort_unstable();
    let mut expected = vec![sensor, ground];
    expected.sort_unstable();
    assert_eq!(started, expected);
    app.world_mut().despawn(sensor);
    run(&mut app, 1);
    let ended = messages::<ContactEnded>(&mut app);
    assert_eq!(ended.iter().map(|pair| (pair.entity, pair.other)).collect::<Vec<_>>(), [(ball, sensor)]);
    assert!(messages::<ContactStarted>(&mut app).is_empty());
}
