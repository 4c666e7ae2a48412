//! The events of contacts on marked entities: particles, nets, colliders, and what becomes of a pair that loses one.

use bevy::ecs::entity_disabling::Disabled;
use bevy::prelude::*;
use bevy_mass_spring::prelude::*;

use crate::common::*;

/// What was triggered: whether a contact started, on which entity, with which one.
#[derive(Resource, Default)]
struct Told(Vec<(bool, Entity, Entity)>);

/// An app without gravity that records events; between particles contacts are elastic.
fn app() -> App {
    let mut app = crate::common::app();
    app.world_mut().resource_mut::<Environment>().gravity_enabled = false;
    app.world_mut().resource_mut::<CollisionSettings>().restitution = 1.0;
    app.init_resource::<Told>()
        .add_observer(|event: On<ContactStarted>, mut told: ResMut<Told>| {
            told.0.push((true, event.entity, event.other));
        })
        .add_observer(|event: On<ContactEnded>, mut told: ResMut<Told>| {
            told.0.push((false, event.entity, event.other));
        });
    app
}

/// Runs, and returns what was triggered meanwhile.
fn told(app: &mut App, ticks: u32) -> Vec<(bool, Entity, Entity)> {
    run(app, ticks);
    std::mem::take(&mut app.world_mut().resource_mut::<Told>().0)
}

fn floor(app: &mut App) -> Entity {
    let floor = ParticleCollider::from(Cuboid::new(8.0, 1.0, 8.0)).with_restitution(1.0);
    app.world_mut().spawn((floor, Transform::from_xyz(0.0, -0.5, 0.0))).id()
}

/// A particle that is at `position` and moves.
fn ball(app: &mut App, position: Vec3, velocity: Vec3) -> Entity {
    let ball = spawn(app, 1.0, 0.1, position);
    app.world_mut().entity_mut(ball).insert(ParticleVelocity(velocity));
    ball
}

/// A rope along x, 0.5 m above the ground, that moves as a whole.
fn rope(app: &mut App, velocity: Vec3) -> Entity {
    let rope = Rope::between(Vec3::new(-0.5, 0.5, 0.0), Vec3::new(0.5, 0.5, 0.0)).with_segments(4);
    let rope = app.world_mut().spawn(rope.with_radius(0.05)).id();
    run(app, 2);
    app.world_mut().get_mut::<ParticleNet>(rope).unwrap().velocities_mut().fill(velocity);
    rope
}

fn mark(app: &mut App, entity: Entity) {
    app.world_mut().entity_mut(entity).insert(ContactEvents);
}

#[test]
fn a_marked_particle_is_told_of_the_solid_that_it_hits() {
    let mut app = app();
    let floor = floor(&mut app);
    let marked = ball(&mut app, Vec3::Y * 0.5, Vec3::NEG_Y * 2.0);
    ball(&mut app, Vec3::new(1.0, 0.5, 0.0), Vec3::NEG_Y * 2.0);
    mark(&mut app, marked);
    assert_eq!(told(&mut app, 64), [(true, marked, floor), (false, marked, floor)]);
    assert!(velocity(&app, marked).y > 1.9, "it has rebounded");
}

#[test]
fn a_marked_net_is_told_once_of_the_solid_that_it_hits() {
    for both in [false, true] {
        let mut app = app();
        let floor = floor(&mut app);
        let rope = rope(&mut app, Vec3::NEG_Y * 2.0);
        mark(&mut app, rope);
        if both {
            mark(&mut app, floor);
        }
        let told = told(&mut app, 64);
        let of_rope: Vec<_> = told.iter().copied().filter(|event| event.1 == rope).collect();
        assert_eq!(of_rope, [(true, rope, floor), (false, rope, floor)]);
        let of_floor: Vec<_> = told.iter().copied().filter(|event| event.1 == floor).collect();
        let expected = [(true, floor, rope), (false, floor, rope)];
        assert_eq!(of_floor, expected[..if both { 2 } else { 0 }]);
    }
}

#[test]
fn of_two_balls_that_meet_each_is_told_if_marked() {
    for marked in [[true, true], [true, false], [false, true], [false, false]] {
        let mut app = app();
        let balls =
            [(-0.5, 1.0), (0.5, -1.0)].map(|(x, velocity)| ball(&mut app, Vec3::X * x, Vec3::X * velocity));
        for number in [0, 1].into_iter().filter(|number| marked[*number]) {
            mark(&mut app, balls[number]);
        }
        let told = told(&mut app, 64);
        for number in [0, 1] {
            let [own, other] = [balls[number], balls[1 - number]];
            let of_own: Vec<_> = told.iter().copied().filter(|event| event.1 == own).collect();
            let expected = [(true, own, other), (false, own, other)];
            assert_eq!(of_own, expected[..if marked[number] { 2 } else { 0 }], "{marked:?}");
        }
    }
}

/// A ball that strikes a rope may touch it several times; both are told the same, and every contact that started ends.
#[test]
fn a_marked_net_and_a_marked_particle_are_told_alike() {
    let mut app = app();
    let rope = rope(&mut app, Vec3::ZERO);
    let ball = ball(&mut app, Vec3::new(0.1, 1.0, 0.0), Vec3::NEG_Y * 3.0);
    mark(&mut app, rope);
    mark(&mut app, ball);
    let mut told = told(&mut app, 20);
    assert!(!told.is_empty(), "they have met");
    app.world_mut().despawn(rope);
    told.extend(self::told(&mut app, 3));
    let of = |entity: Entity| told.iter().filter(move |event| event.1 == entity);
    for entity in [rope, ball] {
        for (number, event) in of(entity).enumerate() {
            assert_eq!(event.0, number % 2 == 0, "contacts start and end in turn");
            assert_ne!(event.2, entity);
        }
    }
    assert_eq!(of(ball).next_back().unwrap(), &(false, ball, rope), "whatever happened, it has ended");
    // Both are told the same, but for the end by despawning.
    let [of_rope, of_ball] =
        [rope, ball].map(|entity| of(entity).map(|event| event.0).collect::<Vec<bool>>());
    assert!(of_ball.starts_with(&of_rope) && of_ball.len() - of_rope.len() <= 1, "{of_rope:?}, {of_ball:?}");
}

/// However a ball that lies on the floor loses it, or the floor the ball, what remains is told in the next tick.
#[test]
fn what_remains_is_told_that_the_contact_has_ended() {
    type Loss = (&'static str, fn(&mut App, Entity));
    let losses: [Loss; 3] = [
        ("despawned", |app, entity| {
            app.world_mut().despawn(entity);
        }),
        ("disabled", |app, entity| {
            app.world_mut().entity_mut(entity).insert(Disabled);
        }),
        ("removed", |app, entity| {
            app.world_mut().entity_mut(entity).remove::<(Particle, ParticleCollider)>();
        }),
    ];
    for is_asleep in [false, true] {
        for (name, lose) in losses {
            for loses_floor in [false, true] {
                let mut app = app();
                app.world_mut().resource_mut::<Environment>().gravity_enabled = true;
                app.insert_resource(SleepSettings { enabled: is_asleep, ..default() });
                app.init_resource::<SleepingParticles>();
                let floor = ParticleCollider::half_space();
                let floor = app.world_mut().spawn((floor, ContactEvents)).id();
                let ball = ball(&mut app, Vec3::Y * 0.1, Vec3::ZERO);
                mark(&mut app, ball);
                let mut begun = told(&mut app, 128);
                begun.sort_unstable();
                let mut expected = [(true, ball, floor), (true, floor, ball)];
                expected.sort_unstable();
                assert_eq!(begun, expected, "{name}: it lies there all the time");
                let asleep = app.world().resource::<SleepingParticles>().contains(ball, None);
                assert_eq!(asleep, is_asleep);
                let (lost, left) = if loses_floor { (floor, ball) } else { (ball, floor) };
                lose(&mut app, lost);
                let told = told(&mut app, 1);
                // What exists still is told, too, where it is still marked and found.
                let of_left: Vec<_> = told.into_iter().filter(|event| event.1 == left).collect();
                assert_eq!(of_left, [(false, left, lost)], "{name}, floor lost: {loses_floor}, {is_asleep}");
                assert!(self::told(&mut app, 10).iter().all(|event| event.1 == lost || event.2 == lost));
            }
        }
    }
}

/// A net that lies on itself is one entity: it is told once.
#[test]
fn a_net_that_touches_itself_is_told_once() {
    let mut app = app();
    // Two legs 0.3 m apart, which come together.
    let path = CubicCardinalSpline::new_catmull_rom(
        [[-0.5, 0.15], [0.0, 0.15], [0.5, 0.15], [0.7, 0.0], [0.5, -0.15], [0.0, -0.15], [-0.5, -0.15]]
            .map(|[x, y]| Vec3::new(x, y, 0.0)),
    );
    let rope = Rope::along(path.to_curve().unwrap()).with_segments(24).with_radius(0.05);
    let rope = app.world_mut().spawn((rope, ContactEvents)).id();
    run(&mut app, 2);
    let mut net = app.world_mut().get_mut::<ParticleNet>(rope).unwrap();
    let heights: Vec<f32> = net.positions().iter().map(|place| place.y).collect();
    for (velocity, height) in net.velocities_mut().iter_mut().zip(heights) {
        *velocity = Vec3::NEG_Y * height.signum() * 0.5;
    }
    let told = told(&mut app, 40);
    assert!(!told.is_empty(), "the legs have met");
    for (number, event) in told.iter().enumerate() {
        assert_eq!(*event, (number % 2 == 0, rope, rope));
    }
}
