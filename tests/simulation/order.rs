//! [`SimulationOrder`]: apps that spawn in different orders, but give numbers, agree to the bit.

use bevy::prelude::*;
use bevy_mass_spring::prelude::*;

use crate::common::{self, app, report, run};

const BALLS: u64 = 24;
const SIDE: u64 = 6;

/// What a game would receive over the network, in whatever order.
#[derive(Debug, Clone, Copy)]
enum Thing {
    Particle {
        pinned: bool,
        particle: Particle,
        position: Vec3,
    },
    /// Between the particles of these numbers.
    Spring {
        ends: [u64; 2],
        length: f32,
    },
    Plane(Transform),
}

/// A net that falls onto a pile in a corner, numbered.
fn things() -> Vec<(u64, Thing)> {
    let mut things = Vec::new();
    for ball in 0..BALLS {
        let [column, row, layer] = [ball % 3, ball / 3 % 3, ball / 9].map(|number| number as f32);
        let jitter = Vec3::new((ball * 7 % 11) as f32, 0.0, (ball * 5 % 13) as f32) * 0.002;
        let position = Vec3::new(column, layer + 0.6, row) * 0.2 + jitter;
        let particle = Particle::new(0.5, [0.1, 0.08, 0.05][ball as usize % 3]);
        things.push(Thing::Particle { pinned: false, particle, position });
    }
    for knot in 0..SIDE * SIDE {
        let place = Vec3::new((knot % SIDE) as f32, 10.0, (knot / SIDE) as f32) * 0.1;
        let particle = Particle::new(0.05, 0.04);
        things.push(Thing::Particle { pinned: knot == 0, particle, position: place });
    }
    for knot in 0..SIDE * SIDE {
        for (exists, back) in [(knot % SIDE > 0, 1), (knot >= SIDE, SIDE)] {
            if exists {
                things.push(Thing::Spring { ends: [BALLS + knot - back, BALLS + knot], length: 0.1 });
            }
        }
    }
    for transform in [
        Transform::default(),
        Transform::from_xyz(-0.12, 0.0, 0.0).with_rotation(Quat::from_rotation_z(-1.4)),
        Transform::from_xyz(0.0, 0.0, -0.12).with_rotation(Quat::from_rotation_x(1.4)),
    ] {
        things.push(Thing::Plane(transform));
    }
    (0..).zip(things).collect()
}

/// Spawns things as they come; the entity of each number.
fn spawn(app: &mut App, things: &[(u64, Thing)], known: &mut Vec<(u64, Entity)>, numbered: bool) {
    let (springs, others): (Vec<_>, Vec<_>) =
        things.iter().partition(|(_, thing)| matches!(thing, Thing::Spring { .. }));
    for (number, thing) in others.into_iter().chain(springs) {
        let find = |wanted| known.iter().find(|(number, _)| *number == wanted).expect("it is there").1;
        let mut entity = match thing {
            Thing::Particle { pinned: true, particle, position } => {
                app.world_mut().spawn((particle, Pinned, Transform::from_translation(position)))
            }
            Thing::Particle { particle, position, .. } => {
                app.world_mut().spawn((particle, Transform::from_translation(position)))
            }
            Thing::Spring { ends, length } => {
                let spring = Spring::new(find(ends[0]), find(ends[1]), length);
                app.world_mut().spawn(spring.with_stiffness(200.0).with_damping(0.1))
            }
            Thing::Plane(transform) => app
                .world_mut()
                .spawn((ParticleCollider { restitution: 0.1, friction: 0.4, ..default() }, transform)),
        };
        if numbered {
            entity.insert(SimulationOrder(number));
        }
        known.push((number, entity.id()));
    }
}

/// The bits of all particles after each tick; half of the things come after 20 ticks. `shuffled`: in another order.
fn history(integrator: Integrator, shuffled: bool, numbered: bool) -> Vec<Vec<[u32; 6]>> {
    let mut app = app();
    app.insert_resource(common::scheme(integrator, 4));
    let mut things = things();
    if shuffled {
        things.sort_by_key(|(number, _)| number * 7919 % 1009);
    }
    let is_late = |(number, thing): &(u64, Thing)| match thing {
        Thing::Plane(_) => false,
        _ => *number < BALLS / 2,
    };
    let (late, early): (Vec<_>, Vec<_>) = things.into_iter().partition(is_late);
    let mut known = Vec::new();
    spawn(&mut app, &early, &mut known, numbered);
    let mut history = Vec::new();
    for tick in 0..120 {
        if tick == 20 {
            spawn(&mut app, &late, &mut known, numbered);
        }
        run(&mut app, 1);
        known.sort_unstable_by_key(|(number, _)| *number);
        let particles = known.iter().filter(|(number, _)| *number < BALLS + SIDE * SIDE);
        history.push(particles.map(|(_, particle)| common::bits(&app, *particle)).collect());
    }
    assert!(report(&app).contacts > 20, "{} contacts", report(&app).contacts);
    history
}

#[test]
fn apps_with_the_same_numbers_agree_to_the_bit() {
    for integrator in [Integrator::SemiImplicitEuler, Integrator::ImplicitEuler, Integrator::Xpbd] {
        let expected = history(integrator, false, true);
        let found = history(integrator, true, true);
        let first = expected.iter().zip(&found).position(|(expected, found)| expected != found);
        assert_eq!(first, None, "{integrator}: the first tick that differs");
        // Numbers do matter: without them roundings differ.
        assert!(history(integrator, true, false) != history(integrator, false, false), "{integrator}");
    }
}

/// Numbers in the order of spawning change nothing.
#[test]
fn the_order_of_spawning_is_the_default() {
    let integrator = Integrator::SemiImplicitEuler;
    let [with, without] = [true, false].map(|numbered| {
        let mut app = app();
        app.insert_resource(common::scheme(integrator, 4));
        let mut known = Vec::new();
        let mut things = things();
        // Springs come last.
        things.sort_by_key(|(_, thing)| matches!(thing, Thing::Spring { .. }));
        spawn(&mut app, &things, &mut known, numbered);
        run(&mut app, 60);
        known.iter().map(|(_, entity)| app.world().get::<Transform>(*entity).copied()).collect::<Vec<_>>()
    });
    assert_eq!(with, without);
}
