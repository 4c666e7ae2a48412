//! Nets that sleep: what a game does to one, and to what holds it, wakes it and no other.

use std::sync::Arc;

use bevy::ecs::component::Mutable;
use bevy::prelude::*;
use bevy_mass_spring::nets::{Attachment, Breaking, Cloth, Part, PartOf, Rope, Winch};
use bevy_mass_spring::prelude::*;

use crate::common::*;

/// Nets 3 m apart, asleep.
struct Scene {
    app: App,
    /// The nets, and the number of particles of each that may move.
    nets: Vec<(Entity, usize)>,
    /// Holds the start of the first rope, on an arm.
    hand: Entity,
    arm: Entity,
    /// The free end of that.
    end: Entity,
    /// To which the second rope is tied; it is no particle.
    hook: Entity,
    /// Pays out the third rope.
    drum: Entity,
    /// On which the first cloth lies.
    table: Entity,
}

const HELD: usize = 0;
const TIED: usize = 1;
const WOUND: usize = 2;
const LYING: usize = 3;
/// One lies on the ground; the last one hangs from its corners.
const CURTAIN: usize = 5;

const LINKS: usize = 8;

fn scene() -> Scene {
    let mut app = app();
    app.insert_resource(SleepSettings { enabled: true, ..default() });
    app.init_resource::<SleepingParticles>();
    let mut environment = app.world_mut().resource_mut::<Environment>();
    environment.viscosity = 0.02;
    let world = app.world_mut();
    world.spawn(ParticleCollider::half_space().with_friction(0.3));
    let mut hang = |x: f32| {
        world.spawn((Rope::new(1.0).with_segments(LINKS as u32), Transform::from_xyz(x, 3.0, 0.0))).id()
    };
    let [held, tied, wound] = [0.0, 3.0, 6.0].map(&mut hang);
    let at = |x: f32| Transform::from_xyz(x, 3.0, 0.0);
    let arm = world.spawn(Transform::default()).id();
    let hand = world.spawn((PartOf(held), Part::Start, Pinned, at(0.0), ChildOf(arm))).id();
    let end = world.spawn((PartOf(held), Part::End)).id();
    let hook = world.spawn(at(3.0)).id();
    world.spawn((PartOf(tied), Part::Start, Attachment::to(hook)));
    let winch = Winch { max_length: Some(1.0), ..default() };
    let drum = world.spawn((PartOf(wound), Part::Start, Pinned, winch, at(6.0))).id();
    let mut lay = |x: f32, y: f32| {
        let cloth = Cloth::grid(Vec3::new(-0.2, 0.0, -0.2), Vec3::X * 0.4, Vec3::Z * 0.4, UVec2::splat(4));
        world.spawn((cloth, Transform::from_xyz(x, y, 0.0))).id()
    };
    let (lying, on_ground) = (lay(9.0, 0.51), lay(12.0, 0.01));
    let cube = ParticleCollider::from(Cuboid::from_length(1.0)).with_friction(0.3);
    let table = world.spawn((cube, Transform::from_xyz(9.0, 0.0, 0.0))).id();
    let curtain = Cloth::grid(Vec3::X * -0.2, Vec3::X * 0.4, Vec3::NEG_Y * 0.4, UVec2::splat(4));
    let curtain = world.spawn((
        curtain,
        Breaking { strain: Some(1.0), ..default() },
        Transform::from_xyz(15.0, 3.0, 0.0),
    ));
    let curtain = curtain.id();
    world.spawn((PartOf(curtain), Part::Particles(vec![0, 4]), Pinned));
    let nets =
        vec![(held, LINKS), (tied, LINKS + 1), (wound, LINKS), (lying, 25), (on_ground, 25), (curtain, 23)];
    let mut scene = Scene { app, nets, hand, arm, end, hook, drum, table };
    scene.until_asleep("the start");
    scene
}

impl Scene {
    fn awake(&self) -> Vec<usize> {
        let sleeping = self.app.world().resource::<SleepingParticles>();
        let is_awake = |(_, (net, free)): &(usize, &(Entity, usize))| sleeping.count_of(*net) < *free;
        self.nets.iter().enumerate().filter(is_awake).map(|(number, _)| number).collect()
    }

    fn until_asleep(&mut self, what: &str) {
        for _ in 0..3000 {
            run(&mut self.app, 1);
            if self.awake().is_empty() {
                return;
            }
        }
        panic!("after {what}: {:?} are awake", self.awake());
    }

    fn set<C: Component<Mutability = Mutable>>(&mut self, entity: Entity, change: impl FnOnce(&mut C)) {
        change(&mut self.app.world_mut().get_mut::<C>(entity).unwrap());
    }

    fn net(&self, number: usize) -> Entity {
        self.nets[number].0
    }

    /// Does something, runs a tick, compares which nets are awake, and waits until all are asleep again.
    #[track_caller]
    fn assert_wakes(&mut self, what: &str, expected: &[usize], act: impl FnOnce(&mut Self)) {
        act(self);
        run(&mut self.app, 1);
        assert_eq!(self.awake(), expected, "{what}");
        self.until_asleep(what);
    }
}

#[test]
fn what_a_game_does_to_what_holds_a_net_wakes_it() {
    let mut scene = scene();
    let Scene { hand, arm, end, hook, drum, .. } = scene;
    scene.assert_wakes("nothing", &[], |_| {});
    scene.assert_wakes("a pinned part that moves", &[HELD], |scene| {
        scene.set::<Transform>(hand, |place| place.translation.y += 0.001);
    });
    scene.assert_wakes("its parent that moves", &[HELD], |scene| {
        scene.set::<Transform>(arm, |place| place.translation.y += 0.001);
    });
    scene.assert_wakes("a force on a part", &[HELD], |scene| {
        scene.app.world_mut().entity_mut(end).insert(AppliedForce(Vec3::X * 1e-3));
    });
    scene.assert_wakes("a force that goes", &[HELD], |scene| {
        scene.app.world_mut().entity_mut(end).remove::<AppliedForce>();
    });
    scene.assert_wakes("the place of a part", &[HELD], |scene| {
        scene.set::<Transform>(end, |place| place.translation.x += 0.001);
    });
    scene.assert_wakes("the velocity of a part", &[HELD], |scene| {
        scene.set::<ParticleVelocity>(end, |velocity| velocity.0.x = 0.01);
    });
    scene.assert_wakes("what a rope is tied to", &[TIED], |scene| {
        scene.set::<Transform>(hook, |place| place.translation.y += 0.001);
    });
    // A winch that turns keeps its rope awake.
    scene.set::<Winch>(drum, |winch| (winch.speed, winch.min_length) = (-0.5, 0.8));
    run(&mut scene.app, 1);
    assert_eq!(scene.awake(), [WOUND], "a winch that takes in");
}

#[test]
fn what_a_game_changes_of_a_net_wakes_it() {
    let mut scene = scene();
    let [held, lying] = [HELD, LYING].map(|number| scene.net(number));
    scene.assert_wakes("another material", &[HELD], |scene| {
        scene.set::<Rope>(held, |rope| rope.material.stretch_stiffness *= 0.5);
    });
    scene.assert_wakes("another radius", &[LYING], |scene| {
        scene.set::<ParticleNet>(lying, |net| {
            let mut topology = (**net.topology()).clone();
            topology.radius = 0.011;
            net.set_topology(Arc::new(topology));
        });
    });
    scene.assert_wakes("layers", &[LYING], |scene| {
        scene.app.world_mut().entity_mut(lying).insert(ContactLayers::new(1, u32::MAX));
    });
    scene.assert_wakes("a slippery surface", &[LYING], |scene| {
        scene.app.world_mut().entity_mut(lying).insert(ContactMaterial::default());
    });
    // Its weight stretches it, so that it tears under its corners.
    let curtain = scene.net(CURTAIN);
    scene.app.add_message::<Broke>();
    scene.set::<Breaking>(curtain, |breaking| breaking.strain = Some(1e-5));
    run(&mut scene.app, 1);
    assert_eq!(scene.awake(), [CURTAIN]);
    run(&mut scene.app, 2);
    assert!(!messages::<Broke>(&mut scene.app).is_empty());
    assert!(scene.awake().contains(&CURTAIN), "it has torn");
}

#[test]
fn a_collider_that_moves_wakes_the_net_on_it() {
    let mut scene = scene();
    let table = scene.table;
    scene.assert_wakes("a table that sinks", &[LYING], |scene| {
        scene.set::<Transform>(table, |place| place.translation.y -= 0.001);
    });
}
