//! Islands under `Auto`: each moves to the bit as it would alone, and what is removed joins nothing.

use bevy::math::Vec3;
use bevy_mass_spring::solver::{Integrator, PinnedMotion, Solver, Spring, StepSettings, SubstepMode};

const SOFT: Spring = Spring::elastic(0.1, 1e3, 0.4);
const STIFF: Spring = Spring::elastic(0.1, 1e8, 0.4);

/// What hangs from an anchor.
#[derive(Debug, Clone, Copy)]
enum Shape {
    /// A number of links.
    Rope(usize),
    /// A number of particles on each side; the one in a corner hangs from the anchor.
    Cloth(usize),
}

/// A part of a scene.
#[derive(Debug, Clone, Copy)]
struct Part {
    shape: Shape,
    spring: Spring,
    direction: Vec3,
}

fn soft(shape: Shape) -> Part {
    Part { shape, spring: SOFT, direction: Vec3::X }
}

fn stiff(shape: Shape) -> Part {
    Part { shape, spring: STIFF, direction: Vec3::new(-0.8, 0.0, 0.6) }
}

impl Part {
    /// Adds its free particles, hanging from `anchor`; their numbers.
    fn add(self, solver: &mut Solver, anchor: usize) -> Vec<usize> {
        match self.shape {
            Shape::Rope(links) => self.add_rope(solver, anchor, links),
            Shape::Cloth(side) => self.add_cloth(solver, anchor, side),
        }
    }

    fn add_rope(self, solver: &mut Solver, anchor: usize, links: usize) -> Vec<usize> {
        let (start, mut last, mut added) = (solver.position(anchor), anchor, Vec::new());
        for link in 1..=links {
            let place = start + self.direction * 0.1 * link as f32;
            let next = solver.add_particle(place, Vec3::ZERO, 0.1, 0.0).unwrap();
            solver.add_spring([last, next], self.spring).unwrap();
            added.push(next);
            last = next;
        }
        added
    }

    fn add_cloth(self, solver: &mut Solver, anchor: usize, side: usize) -> Vec<usize> {
        let start = solver.position(anchor);
        let mut added: Vec<usize> = Vec::new();
        for number in 0..side * side {
            let (column, row) = (number % side, number / side);
            let place = self.direction * (0.1 * (column + 1) as f32) + Vec3::Y * (0.1 * row as f32);
            let next = solver.add_particle(start + place, Vec3::ZERO, 0.1, 0.0).unwrap();
            for (exists, back, length) in [
                (column > 0, 1, 0.1),
                (row > 0, side, 0.1),
                (column > 0 && row > 0, side + 1, 0.02_f32.sqrt()),
            ] {
                if exists {
                    let spring = Spring { rest_length: length, ..self.spring };
                    solver.add_spring([added[number - back], next], spring).unwrap();
                }
            }
            added.push(next);
        }
        solver.add_spring([anchor, added[0]], self.spring).unwrap();
        added
    }
}

/// The parts in their order, each on an anchor of its own or all on the first; the numbers of the anchors and of the
/// particles of each part.
fn scene(parts: &[Part], is_shared: bool) -> (Solver, Vec<usize>, Vec<Vec<usize>>) {
    let mut solver = Solver::default();
    let (mut anchors, mut numbers) = (Vec::new(), Vec::new());
    for part in parts {
        if anchors.is_empty() || !is_shared {
            anchors.push(solver.add_particle(Vec3::Y, Vec3::ZERO, f32::INFINITY, 0.0).unwrap());
        }
        let anchor = *anchors.last().expect("there is one");
        numbers.push(part.add(&mut solver, anchor));
    }
    (solver, anchors, numbers)
}

fn settings() -> StepSettings {
    StepSettings { gravity: Vec3::NEG_Y * 9.81, viscosity: 0.02, ..StepSettings::default() }
}

/// The bits of the position and the velocity of a particle.
fn bits(solver: &Solver, number: usize) -> [[u32; 3]; 2] {
    [solver.position(number), solver.velocity(number)].map(|vector| vector.to_array().map(f32::to_bits))
}

/// Sends the anchors on their way: to and fro.
fn move_anchors(solver: &mut Solver, anchors: &[usize], tick: u32) {
    let target =
        Vec3::new(0.02 * (tick % 13) as f32, 1.0 - 0.01 * (tick % 7) as f32, 0.03 * (tick % 5) as f32);
    solver.inputs_mut().pinned.clear();
    for &slot in anchors {
        let start = solver.position(slot);
        solver.inputs_mut().pinned.push(PinnedMotion { slot, start, target });
    }
}

/// Runs `parts` under `Auto`, and beside it each of them alone under the scheme that it is to have.
#[track_caller]
fn assert_each_moves_as_alone(parts: [Part; 2], is_shared: bool, ticks: u32) {
    let (mut both, anchors, numbers) = scene(&parts, is_shared);
    let settings = settings();
    let plan = both.plan(&settings);
    let what = format!("{parts:?}, shared: {is_shared}, {plan:?}");
    assert!(plan.integrator == Integrator::VelocityVerlet && plan.stiff_substeps > 0, "{what}");
    let mut alone = parts.map(|part| {
        let is_stiff = part.spring.stiffness == STIFF.stiffness;
        let (integrator, substeps) = match is_stiff {
            true => (Integrator::TrBdf2, plan.stiff_substeps),
            false => (Integrator::VelocityVerlet, plan.substeps),
        };
        let own_settings = StepSettings { integrator, substeps: SubstepMode::Fixed(substeps), ..settings };
        (scene(&[part], false), own_settings)
    });
    for tick in 0..ticks {
        move_anchors(&mut both, &anchors, tick);
        both.step(&settings);
        assert_eq!(both.outputs().plan, plan);
        for (((lone, anchors, own), own_settings), numbers) in alone.iter_mut().zip(&numbers) {
            move_anchors(lone, anchors, tick);
            lone.step(own_settings);
            for (&number, &twin) in numbers.iter().zip(&own[0]) {
                let found = bits(&both, number);
                let expected = bits(lone, twin);
                assert_eq!(found, expected, "{what}, tick {tick}, particle {number}");
            }
        }
    }
}

#[test]
fn small_islands_move_as_they_would_alone() {
    for is_shared in [false, true] {
        for own in [Shape::Rope(1), Shape::Rope(40), Shape::Cloth(9)] {
            for other in [Shape::Rope(20), Shape::Cloth(5)] {
                assert_each_moves_as_alone([soft(own), stiff(other)], is_shared, 60);
                assert_each_moves_as_alone([stiff(other), soft(own)], is_shared, 60);
            }
        }
    }
}

/// Tiles and blocks of the kernel end elsewhere where something else comes first.
#[test]
fn large_islands_move_as_they_would_alone() {
    for is_shared in [false, true] {
        for own in [Shape::Rope(40), Shape::Rope(3000), Shape::Cloth(50)] {
            let other = Shape::Rope(1500);
            assert_each_moves_as_alone([soft(own), stiff(other)], is_shared, 8);
            assert_each_moves_as_alone([stiff(other), soft(own)], is_shared, 8);
        }
    }
}

/// Two soft islands, which one scheme advances.
#[test]
fn soft_islands_move_as_they_would_alone() {
    for integrator in Integrator::named() {
        let settings = StepSettings { integrator, substeps: SubstepMode::Fixed(6), ..settings() };
        for shapes in [[Shape::Rope(40), Shape::Cloth(9)], [Shape::Rope(1500), Shape::Rope(3000)]] {
            let (mut both, anchors, numbers) = scene(&shapes.map(soft), true);
            for (shape, numbers) in shapes.into_iter().zip(numbers) {
                let (mut lone, lone_anchors, own) = scene(&[soft(shape)], false);
                let start = both.state().clone();
                for tick in 0..8 {
                    move_anchors(&mut both, &anchors, tick);
                    move_anchors(&mut lone, &lone_anchors, tick);
                    both.step(&settings);
                    lone.step(&settings);
                    for (&number, &twin) in numbers.iter().zip(&own[0]) {
                        let found = bits(&both, number);
                        let expected = bits(&lone, twin);
                        assert_eq!(
                            found, expected,
                            "{integrator}, {shape:?}, tick {tick}, particle {number}"
                        );
                    }
                }
                both.restore(start);
            }
        }
    }
}

/// A stiff ring takes two automatic steps of backward Euler, a rope four; and so at once when one spring is removed.
/// Beside something soft it is one island, before and after.
#[test]
fn a_ring_that_is_cut_is_a_rope_at_once() {
    for beside in [false, true] {
        let mut solver = Solver::default();
        let count = 12;
        for number in 0..count {
            let (sin, cos) = bevy::math::ops::sin_cos(number as f32 / count as f32 * std::f32::consts::TAU);
            solver.add_particle(Vec3::new(cos, sin, 0.0), Vec3::ZERO, 0.1, 0.0).unwrap();
        }
        for number in 0..count {
            let rest_length = solver.position(0).distance(solver.position(1));
            solver.add_spring([number, (number + 1) % count], Spring { rest_length, ..STIFF }).unwrap();
        }
        if beside {
            let anchor = solver.add_particle(Vec3::Y * 3.0, Vec3::ZERO, f32::INFINITY, 0.0).unwrap();
            soft(Shape::Rope(10)).add(&mut solver, anchor);
        }
        let integrator = if beside { Integrator::Auto } else { Integrator::ImplicitEuler };
        let settings = StepSettings { integrator, ..settings() };
        let substeps_and_springs = |solver: &mut Solver| {
            let planned = solver.plan(&settings);
            let plan = solver.step(&settings).plan;
            assert_eq!(plan, planned);
            if beside { (plan.stiff_substeps, plan.stiff_springs) } else { (plan.substeps, 0) }
        };
        let ring = if beside { (2, 12) } else { (2, 0) };
        assert_eq!(substeps_and_springs(&mut solver), ring);
        assert_eq!(substeps_and_springs(&mut solver), ring);
        assert!(solver.frequency_bounds(0.0).has_loops);
        solver.remove_spring(5);
        assert!(!solver.frequency_bounds(0.0).has_loops);
        assert_eq!(substeps_and_springs(&mut solver), if beside { (2, 11) } else { (4, 0) });
        let rest_length = 2.0 * bevy::math::ops::sin(std::f32::consts::PI / 12.0);
        solver.add_spring([5, 6], Spring { rest_length, ..STIFF }).unwrap();
        assert_eq!(substeps_and_springs(&mut solver), ring);
    }
}
