//! Stiff nets that touch something: contacts are a part of the implicit step.

use bevy::math::Vec3;
use bevy_mass_spring::solver::{
    self, Integrator, Measurements, PairRules, Plane, Solver, StepSettings, SubstepMode,
};

const GRAVITY: f32 = 9.81;
const SPACING: f32 = 0.1;
const MASS: f32 = 0.02;
const RADIUS: f32 = 0.02;

fn settings(time_step: f32) -> StepSettings {
    StepSettings { time_step, gravity: Vec3::NEG_Y * GRAVITY, ..StepSettings::default() }
}

/// A lattice of points whose lowest ones are `height` above the ground, neighbours and diagonals joined.
fn lattice(size: [usize; 3], inside: impl Fn(Vec3) -> bool, stiffness: f32, height: f32) -> Solver {
    let mut state = Solver::default();
    let [nx, ny, nz] = size;
    let middle = Vec3::new(nx as f32 - 1.0, ny as f32 - 1.0, nz as f32 - 1.0) * 0.5;
    let mut points = Vec::new();
    for (i, j, k) in (0..nx).flat_map(|i| (0..ny).flat_map(move |j| (0..nz).map(move |k| (i, j, k)))) {
        let place = Vec3::new(i as f32, j as f32, k as f32);
        if inside(place - middle) {
            points.push(place);
        }
    }
    let lowest = points.iter().map(|place| place.y).fold(f32::INFINITY, f32::min);
    for place in &points {
        let position = (*place - Vec3::Y * lowest) * SPACING + Vec3::Y * (height + RADIUS);
        state.add_particle(position, Vec3::ZERO, MASS, RADIUS).unwrap();
    }
    for (one, place) in points.iter().enumerate() {
        for (other, next) in points.iter().enumerate().skip(one + 1) {
            if (*next - *place).abs().max_element() < 1.5 {
                let rest_length = state.position(one).distance(state.position(other));
                let spring = solver::Spring { rest_length, stiffness, damping: 0.5 };
                state.add_spring([one, other], spring).unwrap();
            }
        }
    }
    state.add_plane(Plane::resting(Vec3::ZERO, Vec3::Y, 0.0, 0.0));
    state
}

#[test]
#[ignore]
fn explore() {
    for (name, size, sphere) in [
        ("cube8", [2, 2, 2], false),
        ("bar32", [8, 2, 2], false),
        ("tower32", [2, 8, 2], false),
        ("cube125", [5, 5, 5], false),
        ("sphere", [9, 9, 9], true),
        ("cube1000", [10, 10, 10], false),
    ] {
        for stiffness in [1e4, 1e5, 1e6, 1e7, 1e8, 1e9] {
            for height in [0.1, 1.0, 10.0] {
                for time_step in [1.0 / 120.0, 1.0 / 60.0, 1.0 / 30.0] {
                    if name == "cube1000" && (time_step != 1.0 / 60.0 || height == 1.0) {
                        continue;
                    }
                    let inside = |p: Vec3| !sphere || p.length() < 4.6;
                    let mut state = lattice(size, inside, stiffness, height);
                    let settings = settings(time_step);
                    let mass = MASS * state.particle_count() as f32;
                    let brought = f64::from(mass * GRAVITY * height);
                    let (mut elastic, mut stretch) = (0.0_f64, 0.0_f64);
                    let start = std::time::Instant::now();
                    let ticks = (4.0 / time_step) as u32;
                    let mut plan = None;
                    for _ in 0..ticks {
                        plan = Some(state.step(&settings).plan);
                        let m = state.measure(settings.gravity);
                        elastic = elastic.max(m.elastic_energy);
                        stretch = stretch.max(m.max_stretch);
                    }
                    let ms = start.elapsed().as_secs_f64() * 1e3 / f64::from(ticks);
                    let m: Measurements = state.measure(settings.gravity);
                    let plan = plan.unwrap();
                    println!(
                        "{name} k {stiffness:.0e} h {height} dt 1/{:.0} {:?}x{}: peak {:.4} of {:.3} J ({:.3}), stretch {:.5}; rest E {:.3e} stretch {:.2e} kin {:.1e} {:.3} ms{}",
                        1.0 / time_step,
                        plan.integrator,
                        plan.substeps,
                        elastic,
                        brought,
                        elastic / brought,
                        stretch,
                        m.elastic_energy,
                        m.max_stretch,
                        m.kinetic_energy,
                        ms,
                        if elastic > brought { "  <<<<<" } else { "" }
                    );
                }
            }
        }
    }
}

/// A cloth of 31² points above a pinned ball at the origin.
fn cloth_above_ball(stiffness: f32) -> Solver {
    let mut state = Solver::default();
    let (side, spacing) = (31, 0.05_f32);
    let at = |i: usize, j: usize| Vec3::new(i as f32 - 15.0, 0.0, j as f32 - 15.0) * spacing + Vec3::Y * 0.52;
    for (i, j) in (0..side).flat_map(|i| (0..side).map(move |j| (i, j))) {
        state.add_particle(at(i, j), Vec3::ZERO, 0.001, 0.005).unwrap();
    }
    for (i, j) in (0..side).flat_map(|i| (0..side).map(move |j| (i, j))) {
        for (di, dj) in [(0, 1), (1, 0), (1, 1), (1, -1)] {
            let (k, l) = (i + di, j as isize + dj);
            if k < side && (0..side as isize).contains(&l) {
                let l = l as usize;
                let spring =
                    solver::Spring { rest_length: at(i, j).distance(at(k, l)), stiffness, damping: 0.0 };
                state.add_spring([i * side + j, k * side + l], spring).unwrap();
            }
        }
    }
    state.add_particle(Vec3::ZERO, Vec3::ZERO, f32::INFINITY, 0.4).unwrap();
    state
}

#[test]
#[ignore]
fn one() {
    for friction in [0.5] {
        for stiffness in [1e6] {
            let mut state = cloth_above_ball(stiffness);
            let settings = StepSettings {
                pair_rules: Some(PairRules { restitution: 0.0, friction }),
                ..settings(1.0 / 60.0)
            };
            let start = std::time::Instant::now();
            for tick in 0..60 {
                state.step(&settings);
                if true {
                    let m = state.measure(settings.gravity);
                    eprintln!(
                        "f {friction} k {stiffness:e} {tick} {:?}: kin {:.3e} E {:.3e} total {:.4} stretch max {:.2e} mean {:.2e} contacts {}, {:.1} ms",
                        state.outputs().plan,
                        m.kinetic_energy,
                        m.elastic_energy,
                        m.total_energy(),
                        m.max_stretch,
                        m.mean_stretch,
                        state.outputs().contact_count,
                        start.elapsed().as_secs_f64() * 1e3 / (tick + 1) as f64
                    );
                }
            }
        }
    }
}
