//! What is run.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;

use bevy::prelude::*;
use bevy_mass_spring::nets::{Balloon, Cloth, Rope, Topology};
use bevy_mass_spring::prelude::*;
use bevy_mass_spring::solver::{self, Collider, Material, PairRules, Pose, Shape, Solver, StepSettings};

use crate::common::{self, *};

/// A hanging cloth of 8², swinging ropes and, if wanted, a pile of balls that collide on a rough ground.
/// `mark` may add components to an entity that do not belong to the simulation.
pub fn scene(app: &mut App, balls: u8, mut mark: impl FnMut(EntityWorldMut)) -> Vec<Entity> {
    let mut all = Vec::new();
    app.world_mut().spawn(ParticleCollider { restitution: 0.3, friction: 0.4, ..default() });
    for row in 0..8_u8 {
        for column in 0..8_u8 {
            let place = Vec3::new(f32::from(column) * 0.1, 2.0, f32::from(row) * 0.1);
            let particle = spawn(app, 0.01, 0.02, place);
            if row == 0 && column % 7 == 0 {
                app.world_mut().entity_mut(particle).insert(Pinned);
            }
            all.push(particle);
            for (condition, back) in [(column > 0, 1), (row > 0, 8), (row > 0 && column > 0, 9)] {
                if condition {
                    let other = all[all.len() - 1 - back];
                    let length = if back == 9 { 0.1 * 2.0_f32.sqrt() } else { 0.1 };
                    let spring = Spring::new(other, particle, length).with_stiffness(100.0).with_damping(0.1);
                    join(app, spring);
                }
            }
            mark(app.world_mut().entity_mut(particle));
        }
    }
    all.extend(spawn_rope(app, Vec3::new(-3.0, 1.0, 0.0), 12, 0.05, |spring| spring.with_stiffness(400.0)));
    for number in 0..balls {
        let number_f = f32::from(number);
        let place =
            Vec3::new(0.07 * (number_f * 2.4).sin(), 0.3 + 0.2 * number_f, 0.07 * (number_f * 1.7).cos());
        let ball = spawn(app, 0.5 + 0.1 * f32::from(number % 4), 0.1, place);
        mark(app.world_mut().entity_mut(ball));
        all.push(ball);
    }
    all
}

/// Large enough for every stage to use all threads: a rope, a cloth, and a pile of balls.
pub fn large_scene(app: &mut App) -> Vec<Entity> {
    let rope = |spring: Spring| spring.with_stiffness(400.0).with_damping(0.2);
    let mut all = spawn_rope(app, Vec3::new(-30.0, 9.0, 0.0), 5000, 0.05, rope);
    let width = 130;
    let first = all.len();
    for slot in 0..width * width {
        let place = Vec3::new((slot % width) as f32 * 0.1, 8.0, 20.0 + (slot / width) as f32 * 0.1);
        let particle = spawn(app, 0.01, 0.0, place);
        all.push(particle);
        for (exists, back) in [(slot % width > 0, 1), (slot >= width, width)] {
            if exists {
                let other = all[first + slot - back];
                join(app, Spring::new(other, particle, 0.1).with_stiffness(100.0).with_damping(0.1));
            }
        }
    }
    for ball in 0..4000_u16 {
        let (column, row, layer) = (ball % 16, ball / 16 % 16, ball / 256);
        // Not quite a lattice, which would not collapse.
        let jitter = Vec3::new(f32::from(ball % 11 * 7 % 11), 0.0, f32::from(ball % 13)) * 0.002;
        let corner = Vec3::new(f32::from(column), f32::from(layer), f32::from(row)) * 0.23;
        all.push(spawn(app, 1.0, 0.1, corner + jitter + Vec3::new(10.0, 0.11, 0.0)));
    }
    all
}

/// A rope that resists bending, a cloth and a balloon in gusty wind, above a floor; and, if wanted, a soft cloth, so large
/// that its springs and the air on it are shared among all threads.
pub fn nets_in_wind(app: &mut App, with_large: bool) -> Vec<Entity> {
    app.world_mut().spawn(ParticleCollider::default());
    let mut environment = app.world_mut().resource_mut::<Environment>();
    (environment.wind, environment.air_density) = (Vec3::new(4.0, 0.0, 2.0), 1.2);
    environment.gusts = Some(Gusts::default());
    let rope = Rope::new(10.0).with_segments(200).topology();
    let cloth = Cloth::grid(Vec3::Y * 2.0, Vec3::X, Vec3::Z, UVec2::splat(10)).topology();
    let balloon = Balloon::default().with_subdivisions(1).topology();
    let mut nets =
        vec![(rope, Vec3::Y * 12.0), (cloth, Vec3::X * 20.0), (balloon, Vec3::new(40.0, 0.6, 0.0))];
    if with_large {
        let cloth = Cloth::grid(Vec3::Y * 2.0, Vec3::X * 4.0, Vec3::Z * 4.0, UVec2::splat(80));
        let mut soft = cloth.topology().expect("it is sound");
        soft.springs.iter_mut().for_each(|(_, spring)| (spring.stiffness, spring.damping) = (5.0, 1e-3));
        nets.push((Ok(soft), Vec3::X * 60.0));
    }
    let mut spawn = |(topology, place): (Result<Topology, _>, Vec3)| {
        let topology = topology.expect("it is sound");
        let net = ParticleNet::new(topology.into(), &Transform::from_translation(place));
        app.world_mut().spawn(net.with_pinned([0])).id()
    };
    nets.into_iter().map(&mut spawn).collect()
}

/// Ropes in vacuum that hang from their first particles, collisions off: enough for the ticks of all to be shared among threads.
pub fn ropes_that_touch_nothing(app: &mut App) -> Vec<Entity> {
    let world = app.world_mut();
    world.resource_mut::<Environment>().air_density = 0.0;
    let mut collisions = world.resource_mut::<CollisionSettings>();
    (collisions.particles, collisions.ground) = (false, false);
    let mut rope = Topology { masses: vec![0.01; 21], ..Topology::default() };
    for number in 0..21 {
        rope.positions.push(Vec3::X * 0.1 * number as f32);
        if number > 0 {
            let spring = solver::Spring {
                rest_length: 0.1,
                stiffness: 100.0,
                damping: 0.1,
                ..solver::Spring::default()
            };
            rope.springs.push(([number - 1, number], spring));
        }
    }
    let topology = Arc::new(rope);
    let mut spawn = |number: u16| {
        let place = Transform::from_xyz(0.0, 10.0, f32::from(number));
        world.spawn(ParticleNet::new(Arc::clone(&topology), &place).with_pinned([0])).id()
    };
    (0..300).map(&mut spawn).collect()
}

/// Ticks of the pile that falls asleep.
pub const SLEEP_TICKS: u32 = 120;

/// The state of a dense pile of balls after two ticks, large enough for its contacts to be solved in slabs.
pub fn dense_pile() -> u64 {
    let mut state = Solver::default();
    for ball in 0..40_u16.pow(2) * 21 {
        let (column, row, layer) = (ball % 40, ball / 40 % 40, ball / 1600);
        let jitter =
            Vec3::new(f32::from(ball % 11 * 7 % 11), f32::from(ball % 17), f32::from(ball % 13)) * 1e-3;
        let corner = Vec3::new(f32::from(column), f32::from(layer), f32::from(row)) * 0.19;
        state.add_particle(corner + jitter, Vec3::ZERO, 1.0, 0.1).unwrap();
    }
    state.add_collider(Collider::half_space(Vec3::ZERO, Vec3::Y, 0.2, 0.3));
    let settings = StepSettings {
        integrator: Integrator::SemiImplicitEuler,
        substeps: SubstepMode::Fixed(4),
        gravity: Vec3::new(0.0, -9.81, 0.0),
        pair_rules: Some(PairRules { restitution: 0.2, friction: 0.3 }),
        ..StepSettings::default()
    };
    for _ in 0..2 {
        state.step(&settings);
    }
    assert!(state.outputs().contact_count > 50_000, "{} contacts", state.outputs().contact_count);
    let mut hasher = DefaultHasher::new();
    common::bodies::solver_bits(&state).hash(&mut hasher);
    hasher.finish()
}

/// Balls, so many that all threads search and solve for them, fall asleep in a box and are woken by one that is thrown: which of them
/// sleep, and the state, every tenth tick and at the end.
pub fn sleeping_pile() -> Vec<u64> {
    let mut solver = common::sleep::pile(17);
    let settings = common::sleep::settings(Integrator::Auto);
    let (mut hashes, mut most) = (Vec::new(), 0);
    for tick in 0..SLEEP_TICKS {
        if tick == SLEEP_TICKS - 20 {
            assert!(solver.asleep_count() > 0, "nothing sleeps");
            solver.add_particle(Vec3::new(1.0, 4.5, 1.0), Vec3::NEG_Y * 20.0, 5.0, 0.2).unwrap();
        }
        solver.step(&settings);
        most = most.max(solver.asleep_count());
        if tick % 10 == 9 {
            let mut hasher = DefaultHasher::new();
            common::bodies::solver_bits(&solver).hash(&mut hasher);
            (0..solver.particle_count()).for_each(|slot| solver.is_asleep(slot).hash(&mut hasher));
            hashes.push(hasher.finish());
        }
    }
    assert!(solver.asleep_count() < most, "nothing was woken");
    hashes
}

/// Ticks by each scheme among colliders.
pub const COLLIDER_TICKS: u32 = 8;

/// Ticks of the heap: it touches from the first one on.
pub const HEAP_TICKS: u32 = 2;

/// Loose balls, so many that their search is shared, which fall onto hills of triangles and solids of every kind, one of
/// which moves and one turns; some are fast enough to be swept; and a cloth with so many faces that theirs is shared, too.
fn among_colliders() -> Solver {
    let mut solver = Solver::default();
    for ball in 0..4900_u16 {
        let place =
            Vec3::new(f32::from(ball % 70), 0.0, f32::from(ball / 70)) * 0.21 - Vec3::new(7.3, -1.1, 7.3);
        let speed = if ball % 50 == 0 { 300.0 } else { 1.0 + f32::from(ball % 7) };
        solver.add_particle(place, Vec3::NEG_Y * speed, 0.1, 0.05).unwrap();
    }
    let cloth = common::colliding::Cloth {
        cells: 50,
        size: 2.0,
        radius: 0.01,
        stiffness: 50.0,
        areal_density: 1.0,
        damping: 0.02,
    };
    cloth.add(&mut solver, Vec3::new(-1.0, 2.52, -1.0), [Vec3::X, Vec3::Z]);
    let corner = |row: u16, column: u16| {
        let height = 0.04 * f32::from((row * 7 + column * 5) % 11);
        Vec3::new(f32::from(column) - 8.0, height, f32::from(row) - 8.0)
    };
    let corners: Vec<Vec3> = (0..17).flat_map(|row| (0..17).map(move |column| corner(row, column))).collect();
    let cells = (0..16_u32).flat_map(|row| (0..16_u32).map(move |column| row * 17 + column));
    let triangles: Vec<[u32; 3]> = cells
        .flat_map(|first| [[first, first + 17, first + 1], [first + 1, first + 17, first + 18]])
        .collect();
    let hills = Shape::mesh(&corners, &triangles, true).unwrap();
    let material = Material { restitution: 0.2, friction: 0.4, ..Material::default() };
    let mut add = |shape: Shape, point: Vec3| {
        let pose = Pose { point, rotation: Quat::IDENTITY };
        solver.add_collider(Collider { material, ..Collider::resting(shape, pose) })
    };
    add(hills, Vec3::ZERO);
    add(Shape::ball(0.5), Vec3::Y * 2.0);
    for (number, (_, shape, _)) in common::shapes::shapes().into_iter().enumerate() {
        add(shape, Vec3::new(1.5 * number as f32 - 6.0, 0.5, 4.0));
    }
    let paddle = add(Shape::cuboid(Vec3::new(3.0, 0.02, 1.0)), Vec3::new(0.0, 0.8, -4.0));
    let drum = add(Shape::frustum([0.5, 0.5], 2.0), Vec3::new(4.0, 0.6, 0.0));
    let colliders = &mut solver.inputs_mut().colliders;
    colliders[paddle].target.point.y += 0.1;
    colliders[drum].target.rotation = Quat::from_rotation_z(0.2);
    solver
}

/// Two cloths, so large that the search for what touches is shared, and ropes: the upper ones fall onto a cloth that is pressed into folds.
fn heap() -> Solver {
    let mut solver = Solver::default();
    let cloth = common::colliding::Cloth {
        cells: 24,
        size: 1.0,
        radius: 0.008,
        stiffness: 50.0,
        areal_density: 0.5,
        damping: 0.02,
    };
    for height in [0.0, 0.02] {
        cloth.add(&mut solver, Vec3::new(-0.5, height, -0.5), [Vec3::X, Vec3::Z]);
    }
    for rope in 0..4_u8 {
        let across = 0.2 * f32::from(rope) - 0.3;
        let ends = [Vec3::new(-0.6, 0.06, across), Vec3::new(0.6, 0.06, -across)];
        common::colliding::rope(&mut solver, ends, 40, (0.01, 0.01), 50.0);
    }
    for number in 0..solver.particle_count() {
        let place = solver.position(number);
        let jitter = (number * 7919 % 101) as f32 / 50.0 - 1.0;
        let sideways = if place.y < 0.01 { -8.0 * place.x } else { 0.0 };
        solver.set_velocity(number, Vec3::new(sideways, 0.5 * jitter - 50.0 * place.y, 0.0));
    }
    solver
}

/// The states of these after each tick, by schemes that share their work; and of a small cloth on a ball by the others.
pub fn histories_among_colliders() -> Vec<u64> {
    let mut hashes = Vec::new();
    let settings = StepSettings {
        substeps: SubstepMode::Fixed(4),
        gravity: Vec3::NEG_Y * 9.81,
        pair_rules: Some(PairRules { restitution: 0.2, friction: 0.3 }),
        ..StepSettings::default()
    };
    let mut run = |mut solver: Solver, integrator: Integrator, ticks: u32| {
        for _ in 0..ticks {
            solver.step(&StepSettings { integrator, ..settings });
            let mut hasher = DefaultHasher::new();
            common::bodies::solver_bits(&solver).hash(&mut hasher);
            hashes.push(hasher.finish());
        }
        assert!(solver.outputs().contact_count > 0, "{integrator}: nothing touches");
    };
    for integrator in [Integrator::SemiImplicitEuler, Integrator::VelocityVerlet, Integrator::Xpbd] {
        run(among_colliders(), integrator, COLLIDER_TICKS);
    }
    for integrator in [Integrator::SemiImplicitEuler, Integrator::Xpbd] {
        run(heap(), integrator, HEAP_TICKS);
    }
    for integrator in [Integrator::ImplicitEuler, Integrator::TrBdf2] {
        let mut solver = Solver::default();
        let cloth = common::colliding::Cloth {
            cells: 8,
            size: 0.8,
            radius: 0.01,
            stiffness: 1e4,
            areal_density: 0.2,
            damping: 0.02,
        };
        cloth.add(&mut solver, Vec3::new(-0.4, 0.42, -0.4), [Vec3::X, Vec3::Z]);
        solver.add_collider(common::shapes::with(
            common::shapes::resting(Shape::ball(0.4), Vec3::ZERO),
            0.0,
            0.4,
        ));
        run(solver, integrator, COLLIDER_TICKS);
    }
    hashes
}
