//! Particles and ropes against colliders, on one thread: `cargo bench --bench colliders`, or in a hurry with
//! `-- --quick`. Each is a tick of 1/60 s with 4 substeps of semi-implicit Euler.

use std::cell::LazyCell;

use bevy::math::{Quat, Vec3, ops};
use bevy_mass_spring::solver::{
    Collider, Integrator, Material, PairRules, Pose, Shape, Sleep, Solver, Spring, StepSettings, SubstepMode,
};
use criterion::{BatchSize, Criterion, criterion_group, criterion_main};

fn settings() -> StepSettings {
    StepSettings {
        integrator: Integrator::SemiImplicitEuler,
        substeps: SubstepMode::Fixed(4),
        gravity: Vec3::NEG_Y * 9.81,
        ..StepSettings::default()
    }
}

/// Hills of `cells`² cells on a square of 20 m.
fn hills(cells: u32) -> Shape {
    let place = |number: u32| 20.0 * (number as f32 / cells as f32 - 0.5);
    let corner = |row, column| {
        let (x, z) = (place(column), place(row));
        Vec3::new(x, 0.5 * ops::sin(x) * ops::cos(0.7 * z), z)
    };
    let vertices: Vec<Vec3> =
        (0..=cells).flat_map(|row| (0..=cells).map(move |column| corner(row, column))).collect();
    let at = |row: u32, column: u32| row * (cells + 1) + column;
    let cell = |(row, column)| {
        let [a, b] = [at(row, column), at(row, column + 1)];
        let [c, d] = [at(row + 1, column), at(row + 1, column + 1)];
        [[a, c, b], [b, c, d]]
    };
    let cells = (0..cells).flat_map(|row| (0..cells).map(move |column| (row, column)));
    let triangles: Vec<[u32; 3]> = cells.flat_map(cell).collect();
    Shape::mesh(&vertices, &triangles, true).expect("it is sound")
}

fn resting(shape: Shape, point: Vec3) -> Collider {
    let material = Material { friction: 0.5, ..Material::default() };
    Collider { material, ..Collider::resting(shape, Pose { point, rotation: Quat::IDENTITY }) }
}

/// 10,000 particles and a mesh of 5,000 triangles: as they fall on it, and where they lie. A fall of 1.2 m takes 0.5 s: it is
/// measured as 30 ticks, again and again.
fn mesh(criterion: &mut Criterion) {
    let mut solver = Solver::default();
    for number in 0..10_000_u32 {
        let (row, column) = (number / 100, number % 100);
        let place = Vec3::new(0.18 * column as f32 - 9.0, 1.2, 0.18 * row as f32 - 9.0);
        solver.add_particle(place, Vec3::ZERO, 0.1, 0.05).expect("it is sound");
    }
    solver.add_collider(resting(hills(50), Vec3::ZERO));
    let mut group = criterion.benchmark_group("10,000 particles and 5,000 triangles");
    group.sample_size(20);
    let start = solver.clone();
    group.bench_function("30 ticks of falling", |bencher| {
        let fall = |solver: &mut Solver| (0..30).for_each(|_| _ = solver.step(&settings()));
        bencher.iter_batched_ref(|| start.clone(), fall, BatchSize::LargeInput);
    });
    for _ in 0..180 {
        solver.step(&settings());
    }
    group.bench_function("lying", |bencher| bencher.iter(|| solver.step(&settings()).contact_count));
    group.finish();
}

/// 100 ropes of 20 links, held at one end, among the boxes that are near; and 990 more that are not.
fn many(criterion: &mut Criterion) {
    for colliders in [0_u16, 10, 1000] {
        let mut solver = Solver::default();
        for rope in 0..100_u16 {
            let top = Vec3::new(f32::from(rope % 10), 3.0, f32::from(rope / 10));
            let mut last = None;
            for link in 0..=20_u8 {
                let place = top + Vec3::new(0.02, -0.1, 0.0) * f32::from(link);
                let mass = if link == 0 { f32::INFINITY } else { 0.01 };
                let slot = solver.add_particle(place, Vec3::ZERO, mass, 0.01).expect("it is sound");
                if let Some(last) = last {
                    let rest_length = 0.102;
                    let spring = Spring { rest_length, stiffness: 200.0, damping: 0.05, ..Spring::default() };
                    solver.add_spring([last, slot], spring).expect("it is sound");
                    solver.add_collision_edge([last, slot]).expect("it is sound");
                }
                last = Some(slot);
            }
        }
        for number in 0..colliders {
            let near = number < 10;
            let number = f32::from(number);
            let place =
                if near { Vec3::new(number + 0.3, 1.5, number) } else { Vec3::new(40.0 + number, 0.0, 0.0) };
            solver.add_collider(resting(Shape::cuboid(Vec3::splat(0.2)), place));
        }
        for _ in 0..60 {
            solver.step(&settings());
        }
        let name = format!("100 ropes, {colliders} colliders");
        criterion.bench_function(&name, |bencher| bencher.iter(|| solver.step(&settings()).contact_count));
    }
}

/// 10,648 balls that have fallen asleep in a box of cuboids.
fn settled_pile(asleep: &StepSettings) -> Solver {
    let mut solver = Solver::default();
    for ball in 0..22_u32.pow(3) {
        let [x, y, z] = [ball % 22, ball / 22 % 22, ball / 484].map(|number| number as f32 + 0.5);
        let off =
            [0x9E37_79B9, 0x85EB_CA6B, 0xC2B2_AE35_u32].map(|factor| (ball + 1).wrapping_mul(factor) >> 16);
        let off = Vec3::from(off.map(|number| 0.008 * (number % 13) as f32));
        let place = Vec3::new(x, z, y) * 0.304 + off;
        solver.add_particle(place, Vec3::ZERO, 1.0, 0.1).expect("it is sound");
    }
    let (middle, side) = (11.0 * 0.304, 22.0 * 0.304);
    for (place, half_size) in [
        (Vec3::new(middle, -0.5, middle), Vec3::new(side, 0.5, side)),
        (Vec3::new(-0.5, 0.0, middle), Vec3::new(0.5, 40.0, side)),
        (Vec3::new(side + 0.5, 0.0, middle), Vec3::new(0.5, 40.0, side)),
        (Vec3::new(middle, 0.0, -0.5), Vec3::new(side, 40.0, 0.5)),
        (Vec3::new(middle, 0.0, side + 0.5), Vec3::new(side, 40.0, 0.5)),
    ] {
        solver.add_collider(resting(Shape::cuboid(half_size), place));
    }
    let mut ticks = 0;
    while solver.asleep_count() < solver.particle_count() && ticks < 1800 {
        solver.step(asleep);
        ticks += 1;
    }
    assert_eq!(solver.asleep_count(), solver.particle_count(), "not all have fallen asleep");
    solver
}

/// As they lie there, and asleep.
fn sleeping_pile(criterion: &mut Criterion) {
    let pair_rules = Some(PairRules { restitution: 0.0, friction: 0.3 });
    let awake = StepSettings { pair_rules, ..settings() };
    let asleep = StepSettings { sleep: Some(Sleep::default()), ..awake };
    let settled = LazyCell::new(|| settled_pile(&asleep));
    let mut group = criterion.benchmark_group("sleeping pile");
    for (name, settings) in [("asleep", &asleep), ("awake", &awake)] {
        // The first tick of a clone takes longer.
        let mut clone = None;
        group.bench_function(name, |bencher| {
            let solver = clone.get_or_insert_with(|| Solver::clone(&settled));
            bencher.iter(|| solver.step(settings).contact_count);
        });
    }
    group.finish();
}

criterion_group!(benches, mesh, many, sleeping_pile);
criterion_main!(benches);
