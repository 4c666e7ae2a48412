//! Everything but the state is a cache: ticks are the same to the bit with all caches dropped before each of them,
//! with a state that was written and read, and after a return to an earlier one.

use std::f32::consts::TAU;

use bevy::math::{Quat, UVec2, Vec3};
use bevy_mass_spring::nets::{Balloon, Cloth, Rope, RopeMaterial};
use bevy_mass_spring::solver::{
    Collider, Gusts, Integrator, PairRules, Shape, Solver, Spring, State, StepSettings, SubstepMode,
};

use crate::common::bodies::{add_net, solver_bits};
use crate::common::colliding;
use crate::common::shapes::{resting, shapes, sphere_mesh, with};

const RULES: PairRules = PairRules { restitution: 0.3, friction: 0.4 };

/// A floor that tilts, a wall, and above them balls of three sizes.
fn pile() -> Solver {
    let mut solver = Solver::default();
    for ball in 0..60_u16 {
        let [column, row, layer] = [ball % 4, ball / 4 % 4, ball / 16].map(f32::from);
        let jitter = Vec3::new(f32::from(ball * 7 % 11), 0.0, f32::from(ball * 5 % 13)) * 0.003;
        let place = Vec3::new(column, layer + 0.5, row) * 0.22 + jitter;
        let radius = [0.1, 0.08, 0.05][usize::from(ball % 3)];
        solver.add_particle(place, Vec3::NEG_Y * (2.0 + layer), 1.0 / (0.3 + radius), radius).unwrap();
    }
    let mut floor = Collider::half_space(Vec3::ZERO, Vec3::Y, 0.1, 0.4);
    floor.target.rotation *= Quat::from_rotation_z(0.01);
    solver.add_collider(floor);
    solver.add_collider(Collider::half_space(Vec3::X * -0.1, Vec3::X, 0.1, 0.4));
    solver
}

/// Adds a ring, open in one place, of 30 particles around the pile, at a height.
fn add_ring(solver: &mut Solver, radius: f32, height: f32, spring: Spring) {
    let start = solver.particle_count();
    for link in 0..30_usize {
        let (sin, cos) = bevy::math::ops::sin_cos(link as f32 / 30.0 * TAU);
        let place = Vec3::new(0.4 + 0.45 * sin, height, 0.4 + 0.45 * cos);
        solver.add_particle(place, Vec3::NEG_Y * 3.0, 10.0, radius).unwrap();
        if link > 0 {
            solver.add_spring([start + link - 1, start + link], spring).unwrap();
        }
    }
}

/// The pile, and falling onto it a thin rope, and one so thick that it overlaps itself and is crowded.
fn pile_with_ropes() -> Solver {
    let mut solver = pile();
    let spring = Spring { rest_length: 0.1, stiffness: 200.0, damping: 0.2, ..Spring::default() };
    add_ring(&mut solver, 0.04, 1.4, spring);
    add_ring(&mut solver, 0.22, 2.2, spring);
    solver
}

/// A soft rope and one so stiff that `Auto` runs two schemes, on one anchor, with a few balls below.
fn soft_and_stiff() -> Solver {
    let mut solver = Solver::default();
    solver.add_collider(Collider::half_space(Vec3::NEG_Y * 0.4, Vec3::Y, 0.1, 0.4));
    let anchor = solver.add_particle(Vec3::Y, Vec3::ZERO, f32::INFINITY, 0.0).unwrap();
    for (stiffness, direction) in [(500.0, Vec3::X), (1e8, Vec3::NEG_X)] {
        let mut last = anchor;
        for link in 1..=20 {
            let place = Vec3::Y + direction * 0.1 * link as f32;
            let next = solver.add_particle(place, Vec3::ZERO, 0.1, 0.045).unwrap();
            solver
                .add_spring(
                    [last, next],
                    Spring { rest_length: 0.1, stiffness, damping: 0.3, ..Spring::default() },
                )
                .unwrap();
            last = next;
        }
    }
    for ball in 0..8 {
        let place = Vec3::new(0.3 * ball as f32 - 1.05, -0.3, 0.01 * ball as f32);
        solver.add_particle(place, Vec3::ZERO, 0.5, 0.1).unwrap();
    }
    solver
}

/// A soft rope that falls across one so stiff that `Auto` runs two schemes until they touch; and above, a little later,
/// another pair of them.
fn soft_across_stiff() -> Solver {
    let mut solver = Solver::default();
    for (stiffness, place, direction) in [
        (1e8, Vec3::ZERO, Vec3::X),
        (500.0, Vec3::Y * 0.3, Vec3::Z),
        (1e8, Vec3::Y * 3.0, Vec3::X),
        (500.0, Vec3::Y * 4.0, Vec3::Z),
    ] {
        let first = solver.particle_count();
        for link in 0..21 {
            let mass = if link % 20 == 0 && direction == Vec3::X { f32::INFINITY } else { 0.1 };
            let place = place + direction * 0.1 * (link as f32 - 10.0);
            solver.add_particle(place, Vec3::ZERO, mass, 0.045).unwrap();
            if link > 0 {
                let ends = [first + link - 1, first + link];
                let spring = Spring { rest_length: 0.1, stiffness, damping: 0.3, ..Spring::default() };
                solver.add_spring(ends, spring).unwrap();
            }
        }
    }
    solver
}

/// A rope and a cloth that hang and resist bending, and a balloon that falls, above a floor.
fn nets() -> Solver {
    let mut solver = Solver::default();
    solver.add_collider(Collider::half_space(Vec3::NEG_Y * 0.6, Vec3::Y, 0.1, 0.4));
    let rope = Rope::new(1.0).with_segments(12).with_material(RopeMaterial::NYLON);
    add_net(&mut solver, &rope.topology().unwrap(), Vec3::new(-2.0, 1.0, 0.0), &[0, 1]);
    let cloth = Cloth::grid(Vec3::ZERO, Vec3::X, Vec3::Z, UVec2::new(5, 4));
    add_net(&mut solver, &cloth.topology().unwrap(), Vec3::Y * 0.5, &[0, 5]);
    // One falls onto the cloth, one onto the ground.
    for place in [Vec3::new(0.5, 0.6, 0.5), Vec3::new(5.0, -0.4, 0.5)] {
        solver.add_particle(place, Vec3::NEG_Y, 0.2, 0.05).unwrap();
    }
    let balloon = Balloon::default().with_subdivisions(1);
    add_net(&mut solver, &balloon.topology().unwrap(), Vec3::X * 2.0, &[]);
    solver
}

/// A cloth of 0.8 m that falls flat onto what is below `height`.
fn add_cloth(solver: &mut Solver, stiffness: f32, height: f32) {
    let cloth =
        colliding::Cloth { cells: 8, size: 0.8, radius: 0.01, stiffness, areal_density: 0.5, damping: 0.02 };
    cloth.add(solver, Vec3::new(-0.4, height + 0.02, -0.4), [Vec3::X, Vec3::Z]);
}

/// A mesh of a sphere, of radius 0.4 m.
fn round_mesh() -> Shape {
    let (vertices, triangles) = sphere_mesh(0.4, 8);
    Shape::mesh(&vertices, &triangles, false).unwrap()
}

/// A solid of each shape, with balls and a rope that fall onto them, some so fast that they are swept, and a cloth on a slab that
/// rises and turns.
fn among_solids() -> Solver {
    let mut solver = Solver::default();
    let mut slab = with(resting(Shape::cuboid(Vec3::new(0.6, 0.05, 0.6)), Vec3::NEG_Y * 0.05), 0.2, 0.4);
    slab.target.point.y += 0.02;
    slab.target.rotation = Quat::from_rotation_z(0.05);
    solver.add_collider(slab);
    // So soft that explicit Euler is stable, too.
    add_cloth(&mut solver, 5.0, 0.0);
    for (number, (_, shape, top)) in shapes().into_iter().enumerate() {
        let place = Vec3::new(1.5 * (number % 3) as f32 - 1.5, 0.0, 1.5 * (number / 3) as f32 + 1.5);
        solver.add_collider(with(resting(shape, place), 0.2, 0.4));
        for ball in 0..4_u8 {
            let aside =
                Vec3::new(f32::from(ball % 2) - 0.4, 0.5 * f32::from(ball), f32::from(ball / 2) - 0.4);
            let speed = if ball == 3 { 60.0 } else { 2.0 };
            let above = place + aside * 0.3 + Vec3::Y * (top + 0.1);
            solver.add_particle(above, Vec3::NEG_Y * speed, 0.1, 0.05).unwrap();
        }
        let ends = [Vec3::X, Vec3::NEG_X].map(|side| place + 0.5 * side + Vec3::Y * (top + 0.05));
        colliding::rope(&mut solver, ends, 6, (0.02, 0.02), 5.0);
    }
    solver
}

fn settings(integrator: Integrator) -> StepSettings {
    StepSettings {
        integrator,
        substeps: if integrator == Integrator::Auto { SubstepMode::Auto } else { SubstepMode::Fixed(6) },
        gravity: Vec3::NEG_Y * 9.81,
        pair_rules: Some(RULES),
        ..StepSettings::default()
    }
}

/// What a program does between two ticks.
fn interfere(solver: &mut Solver, settings: &mut StepSettings, tick: u32) {
    settings.pair_rules = (!(40..43).contains(&tick)).then_some(RULES);
    let last = solver.particle_count() - 1;
    match tick {
        5 => solver.set_mass(last, f32::INFINITY).unwrap(),
        20 => solver.set_position(5, Vec3::new(0.4, 1.0, 0.4)),
        6..30 => solver.move_pinned(last, solver.position(last) + Vec3::new(0.01, 0.02, -0.01)),
        30 => solver.set_radius(3, 1.5 * solver.radius(3)).unwrap(),
        32 => solver.inputs_mut().pinned.clear(),
        33 => solver.set_mass(last, 1.0).unwrap(),
        60 => solver.inputs_mut().colliders[0].start = solver.inputs_mut().colliders[0].target,
        _ => {}
    }
    interfere_with_springs(solver, tick);
}

fn interfere_with_springs(solver: &mut Solver, tick: u32) {
    let last = solver.particle_count() - 1;
    let spring = Spring { rest_length: 0.2, stiffness: 300.0, damping: 0.5, ..Spring::default() };
    match tick {
        15 | 22 | 50 => {
            solver.add_spring([2, last], spring).unwrap();
        }
        25 if solver.spring_count() > 10 => solver.remove_spring(7),
        // A cable, a limit, and parameters on the way to others, in the middle of a run.
        17 | 44 if solver.spring_count() > 20 => {
            let tension_only = tick == 17;
            solver.set_spring(12, Spring { tension_only, max_stretch: Some(0.05), ..spring }).unwrap();
            solver.set_spring(13, Spring { max_stretch: Some(0.1), ..spring }).unwrap();
        }
        35 => solver.set_spring(0, Spring { stiffness: 1e3, ..spring }).unwrap(),
        36 => {
            let place = solver.position(last) + Vec3::Y * 0.3;
            let added = solver.add_particle(place, Vec3::X, 0.2, 0.03).unwrap();
            solver.add_spring([last, added], spring).unwrap();
        }
        55 => solver.remove_spring(solver.spring_count() - 1),
        _ => {}
    }
}

/// A state as it was written and read.
#[cfg(feature = "scene")]
fn rewritten(state: &State) -> State {
    let written = ron::to_string(state).expect("a state can be written");
    ron::from_str(&written).expect("what was written can be read")
}

#[cfg(not(feature = "scene"))]
fn rewritten(state: &State) -> State {
    state.clone()
}

/// Runs `ticks` with the caches of the tick before, with new ones, and with a state that was written and read.
/// Returns the number of contacts of all ticks.
fn assert_caches_change_nothing(solver: Solver, integrator: Integrator, ticks: u32) -> usize {
    assert_caches_change_nothing_with(interfere, solver, settings(integrator), ticks)
}

/// The same in other surroundings, with other changes between the ticks.
fn assert_caches_change_nothing_with(
    change: fn(&mut Solver, &mut StepSettings, u32),
    solver: Solver,
    mut settings: StepSettings,
    ticks: u32,
) -> usize {
    let [mut plain, mut without, mut resumed] = [solver.clone(), solver.clone(), solver];
    let integrator = settings.integrator;
    let mut contacts = 0;
    for tick in 0..ticks {
        without.drop_caches();
        let state = rewritten(resumed.state());
        resumed.restore(state);
        for solver in [&mut plain, &mut without, &mut resumed] {
            change(solver, &mut settings, tick);
            solver.step(&settings);
        }
        let expected = solver_bits(&plain);
        assert!(solver_bits(&without) == expected, "{integrator}, tick {tick}: without caches");
        assert!(solver_bits(&resumed) == expected, "{integrator}, tick {tick}: with a state that was read");
        let outputs = [&plain, &without, &resumed].map(|solver| {
            let outputs = solver.outputs();
            (outputs.plan, outputs.contact_count)
        });
        assert_eq!(outputs, [outputs[0]; 3], "{integrator}, tick {tick}");
        contacts += outputs[0].1;
    }
    contacts
}

#[test]
fn ticks_of_a_pile_depend_on_no_cache() {
    let contacts = assert_caches_change_nothing(pile(), Integrator::SemiImplicitEuler, 160);
    assert!(contacts > 1000, "{contacts}");
}

#[test]
fn ticks_of_a_pile_with_ropes_depend_on_no_cache() {
    for integrator in Integrator::ALL {
        let contacts = assert_caches_change_nothing(pile_with_ropes(), integrator, 100);
        assert!(contacts > 3000, "{integrator}: {contacts}");
    }
}

#[test]
fn ticks_of_nets_in_gusty_wind_depend_on_no_cache() {
    for integrator in Integrator::ALL {
        let air = |settings: StepSettings| StepSettings {
            wind: Vec3::new(3.0, 0.0, 1.0),
            air_density: 1.2,
            gusts: Some(Gusts { strength: Vec3::splat(2.0), length: 1.0, time: 0.5, seed: 7 }),
            ..settings
        };
        let contacts = assert_caches_change_nothing_with(interfere, nets(), air(settings(integrator)), 40);
        // Explicit schemes lose these nets, and what they meet: same bits, but no contacts at the end.
        let is_stable = matches!(
            integrator,
            Integrator::Auto | Integrator::Xpbd | Integrator::ImplicitEuler | Integrator::TrBdf2
        );
        assert!(contacts > 0 || !is_stable, "{integrator}: nothing touches");
    }
}

#[test]
fn ticks_among_solids_depend_on_no_cache() {
    for integrator in Integrator::ALL {
        let contacts = assert_caches_change_nothing(among_solids(), integrator, 24);
        assert!(contacts > 200, "{integrator}: {contacts}");
    }
}

/// A cloth of 0.8 m that lies on a ball, or on a mesh of one.
fn cloth_on(shape: Shape, stiffness: f32) -> Solver {
    let mut solver = Solver::default();
    solver.add_collider(with(resting(shape, Vec3::ZERO), 0.0, 0.4));
    add_cloth(&mut solver, stiffness, 0.4);
    solver
}

#[test]
fn ticks_of_a_cloth_on_a_solid_depend_on_no_cache() {
    for shape in [Shape::ball(0.4), round_mesh()] {
        for integrator in Integrator::ALL {
            let solver = cloth_on(shape.clone(), 5.0);
            assert_caches_change_nothing_with(|_, _, _| {}, solver, settings(integrator), 20);
        }
    }
}

/// The same while a particle is put elsewhere and springs are changed.
#[test]
fn ticks_of_a_changed_cloth_on_a_solid_depend_on_no_cache() {
    for integrator in Integrator::ALL {
        assert_caches_change_nothing(cloth_on(Shape::ball(0.4), 500.0), integrator, 20);
    }
}

#[test]
fn ticks_of_two_schemes_depend_on_no_cache() {
    let (mut solver, settings) = (soft_and_stiff(), settings(Integrator::Auto));
    assert!(solver.plan(&settings).stiff_springs == 20, "{:?}", solver.plan(&settings));
    for integrator in Integrator::ALL {
        // The explicit schemes explode, in the same way.
        assert_caches_change_nothing(solver.clone(), integrator, 100);
    }
}

#[test]
fn which_nets_take_one_scheme_depends_on_no_cache() {
    let (mut solver, settings) = (soft_across_stiff(), settings(Integrator::Auto));
    assert_caches_change_nothing(solver.clone(), Integrator::Auto, 60);
    let stiff_springs: Vec<usize> = (0..40)
        .map(|_| {
            solver.step(&settings);
            solver.outputs().plan.stiff_springs
        })
        .collect();
    assert!(stiff_springs[0] == 40 && stiff_springs.contains(&60), "{stiff_springs:?}");
}

/// A copy of the state goes on as the solver did, also long after this has gone on itself, and in another solver.
#[test]
fn a_restored_state_goes_on_alike() {
    for scene in [pile_with_ropes(), soft_and_stiff()] {
        for integrator in [Integrator::Auto, Integrator::Xpbd, Integrator::VelocityVerlet] {
            let (mut solver, mut other) = (scene.clone(), scene.clone());
            let settings = settings(integrator);
            for _ in 0..40 {
                solver.step(&settings);
            }
            let state = solver.state().clone();
            let history: Vec<Vec<u32>> = (0..20)
                .map(|_| {
                    solver.step(&settings);
                    solver_bits(&solver)
                })
                .collect();
            let spring = Spring { rest_length: 0.2, stiffness: 300.0, damping: 0.5, ..Spring::default() };
            solver.add_spring([0, 9], spring).unwrap();
            solver.remove_spring(3);
            solver.step(&settings);
            for solver in [&mut solver, &mut other] {
                solver.restore(state.clone());
                for (tick, expected) in history.iter().enumerate() {
                    solver.step(&settings);
                    assert!(solver_bits(solver) == *expected, "{integrator}, tick {tick}");
                }
            }
        }
    }
}
