//! What bending costs.

use bevy::math::Vec3;
use bevy_mass_spring::solver::{self, Integrator, Solver, StepSettings};
use criterion::Criterion;

use crate::GRAVITY;

/// A cloth of `side`² particles of 1 g, 2 cm apart, in triangles, its first row pinned; with hinges between them, or
/// without. The hinges: Bergou et al. 2006, k = 3 D / A with the weights of the squares' triangles.
fn bent_cloth(side: usize, stiffness: f32, damping: f32, is_bent: bool) -> Solver {
    let mut solver = Solver::default();
    for slot in 0..side * side {
        let (column, row) = (slot % side, slot / side);
        let position = Vec3::new(column as f32, 0.01 * (column * row % 7) as f32, row as f32) * 0.02;
        let mass = if row == 0 { f32::INFINITY } else { 1e-3 };
        solver.add_particle(position, Vec3::ZERO, mass, 0.0).expect("the values are good");
    }
    let all = || (0..side).flat_map(move |row| (0..side).map(move |column| (column, row)));
    for (column, row) in all() {
        let slot = row * side + column;
        for (columns, rows) in [(1, 0), (0, 1), (1, 1)] {
            if column + columns < side && row + rows < side {
                let other = slot + columns + rows * side;
                let rest_length = 0.02 * ((columns + rows) as f32).sqrt();
                let spring =
                    solver::Spring { rest_length, stiffness: 100.0, damping: 0.01, ..Default::default() };
                solver.add_spring([slot, other], spring).expect("the values are good");
            }
        }
    }
    for (column, row) in all().filter(|_| is_bent) {
        let slot = row * side + column;
        let mut hinge = |ends: [usize; 4], weights: [f32; 4]| {
            let bend = solver::Bend { rest_length: 0.0, stiffness, damping, weights };
            solver.add_hinge(ends, bend).expect("the values are good");
        };
        if column + 1 < side && row + 1 < side {
            // Across the diagonal; the two opposite corners, then those on it.
            hinge([slot + 1, slot + side, slot, slot + side + 1], [1.0, 1.0, -1.0, -1.0]);
            if row > 0 {
                hinge([slot + side + 1, slot - side, slot, slot + 1], [1.0, 1.0, -1.0, -1.0]);
            }
            if column > 0 {
                hinge([slot + side + 1, slot - 1, slot, slot + side], [1.0, 1.0, -1.0, -1.0]);
            }
        }
    }
    solver
}

/// A rope of `count` links of 1 cm and 10 g that hangs from one end in an arc, k = 10⁵ N/m and EI = 10⁻³ N·m².
fn bent_rope(count: usize, is_bent: bool) -> Solver {
    let mut solver = Solver::default();
    let curve = 3.0 / count as f32;
    for number in 0..=count {
        let angle = curve * number as f32;
        let position = Vec3::new(angle.sin(), angle.cos(), 0.0) * (0.01 / curve);
        let mass = if number == 0 { f32::INFINITY } else { 0.01 };
        solver.add_particle(position, Vec3::ZERO, mass, 0.0).expect("the values are good");
    }
    for number in 0..count {
        let spring = solver::Spring { rest_length: 0.01, stiffness: 1e5, damping: 1.0, ..Default::default() };
        solver.add_spring([number, number + 1], spring).expect("the values are good");
    }
    for number in (1..count).filter(|_| is_bent) {
        let bend = solver::Bend { rest_length: 0.0, stiffness: 1e3, damping: 0.0, weights: [1.0, -2.0, 1.0] };
        solver.add_rod([number - 1, number, number + 1], bend).expect("the values are good");
    }
    solver
}

/// What bending costs, in cloths under `Auto` and in ropes under implicit Euler.
pub fn bends(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("bending");
    group.sample_size(20);
    let run = |solver: &mut Solver, settings: &StepSettings| {
        solver.step(settings);
    };
    let automatic = StepSettings { gravity: GRAVITY, pair_rules: None, ..Default::default() };
    for (name, damping, is_bent) in
        [("cloth without", 0.0, false), ("cloth with", 0.0, true), ("cloth with, damped", 1e-4, true)]
    {
        let mut solver = bent_cloth(100, 1.0, damping, is_bent);
        println!("{name}: {:?}", solver.plan(&automatic));
        group.bench_function(name, |bencher| bencher.iter(|| run(&mut solver, &automatic)));
    }
    let implicit = StepSettings {
        integrator: Integrator::ImplicitEuler,
        substeps: solver::SubstepMode::Fixed(1),
        ..automatic
    };
    for (count, is_bent) in [(10_000, false), (10_000, true), (5_000, true)] {
        let start = bent_rope(count, is_bent);
        let name = format!("rope of {count} {}, implicit", if is_bent { "with" } else { "without" });
        group.bench_function(name, |bencher| {
            let mut solver = start.clone();
            bencher.iter(|| run(&mut solver, &implicit));
        });
    }
    group.finish();
}
