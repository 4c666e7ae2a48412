//! In steady state a tick allocates nothing: neither the solver nor the copying in and out.

mod common;

use allocation_counter::measure;
use bevy::ecs::schedule::SingleThreadedExecutor;
use bevy::prelude::*;
use bevy_mass_spring::nets::{Part, PartOf, Side, Topology};
use bevy_mass_spring::prelude::*;
use bevy_mass_spring::solver::{self, Collider, Integrator, PairRules, Solver, StepSettings};

use common::{app, join, run, scheme, spawn, spawn_pinned};

const GRAVITY: Vec3 = Vec3::new(0.0, -9.81, 0.0);

/// A cloth of 20 × 20 that swings, and 60 balls that fall into a pile.
fn state() -> Solver {
    let mut state = Solver::default();
    for slot in 0..400_usize {
        let mass = if slot == 0 { f32::INFINITY } else { 0.1 };
        let place = Vec3::new((slot % 20) as f32 * 0.1, 20.0, (slot / 20) as f32 * 0.1);
        state.add_particle(place, Vec3::ZERO, mass, 0.0).unwrap();
        for (neighbour, exists) in
            [(slot.wrapping_sub(1), slot % 20 > 0), (slot.wrapping_sub(20), slot >= 20)]
        {
            if exists {
                state
                    .add_spring(
                        [neighbour, slot],
                        solver::Spring {
                            rest_length: 0.1,
                            stiffness: 50.0,
                            damping: 0.05,
                            ..solver::Spring::default()
                        },
                    )
                    .unwrap();
            }
        }
    }
    for ball in 0..60 {
        let place =
            Vec3::new((ball % 3) as f32 * 0.21, 0.2 + (ball / 9) as f32 * 0.25, (ball / 3 % 3) as f32 * 0.21);
        state.add_particle(place, Vec3::ZERO, 1.0, 0.1).unwrap();
    }
    state.add_collider(Collider::half_space(Vec3::ZERO, Vec3::Y, 0.0, 0.4));
    state
}

/// Three seconds let every array grow to its size; the seven after them need no more.
#[test]
fn the_solver_allocates_nothing_in_steady_state() {
    for scheme in Integrator::named() {
        let mut state = state();
        let settings = StepSettings {
            integrator: scheme,
            substeps: SubstepMode::Fixed(8),
            gravity: GRAVITY,
            pair_rules: Some(PairRules { restitution: 0.0, friction: 0.3 }),
            ..StepSettings::default()
        };
        for _ in 0..180 {
            state.step(&settings);
        }
        assert!(state.outputs().contact_count > 30, "the balls lie in a pile");
        let allocated = measure(|| {
            for _ in 0..420 {
                state.step(&settings);
            }
        });
        assert_eq!(allocated.count_total, 0, "{scheme:?}");
    }
}

/// A rope that swings above the ground, and balls that lie on it.
#[test]
fn a_tick_allocates_no_more_than_an_empty_app() {
    let allocations = |populated: bool| {
        let mut app = app();
        if populated {
            let mut last = spawn_pinned(&mut app, Vec3::Y * 9.0);
            for link in 1..60 {
                let next = spawn(&mut app, 1.0, 0.0, Vec3::new(link as f32 * 0.1, 9.0, 0.0));
                join(&mut app, Spring::new(last, next, 0.1).with_stiffness(500.0).with_damping(1.0));
                last = next;
            }
            app.world_mut().spawn(ParticleCollider::default());
            for ball in 0..10 {
                spawn(&mut app, 1.0, 0.1, Vec3::new(20.0 + ball as f32, 0.1, 0.0));
            }
        }
        for (_, schedule) in app.world_mut().resource_mut::<Schedules>().iter_mut() {
            schedule.set_executor(SingleThreadedExecutor::new());
        }
        run(&mut app, 200);
        measure(|| run(&mut app, 100)).count_total
    };
    assert_eq!(allocations(true), allocations(false));
}

/// A net that hangs in the wind from a part which moves, and is pushed at its last particle. It touches nothing: contacts
/// are remembered in arrays of their own, whose sizes vary.
fn moving_net(app: &mut App, settings: SolverSettings, mut topology: Topology, held: Part) -> Entity {
    topology.radius = 0.0;
    app.insert_resource(settings);
    let mut environment = app.world_mut().resource_mut::<Environment>();
    (environment.air_density, environment.wind) = (1.2, Vec3::new(2.0, 0.0, 1.0));
    let last = Part::Particle(topology.positions.len() as u32 - 1);
    let net = app.world_mut().spawn(ParticleNet::new(topology.into(), &Transform::IDENTITY)).id();
    app.world_mut().spawn((PartOf(net), last, AppliedForce(Vec3::X * 0.01)));
    app.world_mut().spawn((PartOf(net), held, Pinned)).id()
}

/// What 30 ticks allocate, after 60 others, beyond those of an empty app.
fn surplus(populate: impl Fn(&mut App) -> Entity) -> u64 {
    let allocations = |populated: bool| {
        let mut app = app();
        let held = populated.then(|| populate(&mut app));
        for (_, schedule) in app.world_mut().resource_mut::<Schedules>().iter_mut() {
            schedule.set_executor(SingleThreadedExecutor::new());
        }
        let move_on = |app: &mut App| {
            if let Some(mut held) = held.and_then(|held| app.world_mut().get_mut::<Transform>(held)) {
                held.translation.x += 0.001;
            }
            run(app, 1);
        };
        (0..60).for_each(|_| move_on(&mut app));
        measure(|| (0..30).for_each(|_| move_on(&mut app))).count_total
    };
    allocations(true).saturating_sub(allocations(false))
}

#[test]
fn a_tick_of_nets_allocates_no_more_than_an_empty_app() {
    let cloth = || Cloth::grid(Vec3::Y * 2.0, Vec3::X, Vec3::Z, UVec2::splat(6)).topology().expect("sound");
    let soft_cloth = || {
        let mut topology = cloth();
        topology.hinges.clear();
        topology.rods.clear();
        topology.springs.iter_mut().for_each(|(_, spring)| (spring.stiffness, spring.damping) = (50.0, 0.05));
        topology
    };
    let rope = || Rope::new(1.0).with_segments(20).topology().expect("sound");
    let balloon = || Balloon::default().with_subdivisions(1).topology().expect("sound");
    let edge = Part::Edge(Side::Top);
    let settings = scheme(Integrator::SemiImplicitEuler, 8);
    assert_eq!(surplus(|app| moving_net(app, settings, soft_cloth(), edge.clone())), 0);
    for settings in [
        SolverSettings::default(),
        scheme(Integrator::ImplicitEuler, 1),
        scheme(Integrator::TrBdf2, 1),
        scheme(Integrator::Xpbd, 4),
    ] {
        assert_eq!(surplus(|app| moving_net(app, settings, cloth(), edge.clone())), 0, "cloth, {settings:?}");
        assert_eq!(surplus(|app| moving_net(app, settings, rope(), Part::Start)), 0, "rope, {settings:?}");
        let held = Part::Particle(0);
        assert_eq!(surplus(|app| moving_net(app, settings, balloon(), held.clone())), 0, "{settings:?}");
    }
}

/// Parameters and pins change in each tick, in place, also where links go in. (The implicit schemes find out anew what hangs
/// together when parameters change.)
#[test]
fn a_tick_of_a_winch_allocates_no_more_than_an_empty_app() {
    let rope = || Rope::new(1.0).with_segments(20).topology().expect("sound");
    for integrator in [Integrator::SemiImplicitEuler, Integrator::VelocityVerlet] {
        let settings = scheme(integrator, 8);
        let surplus = surplus(|app| {
            let held = moving_net(app, settings, rope(), Part::Start);
            app.world_mut().entity_mut(held).insert(Winch { speed: -0.2, ..default() });
            held
        });
        assert_eq!(surplus, 0, "{settings:?}");
    }
}
