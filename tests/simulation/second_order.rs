//! What TR-BDF2 is for: slow motions of stiff nets, which keep their energy; and what `Auto` makes of it.

use bevy::math::{DVec3, Vec3};
use bevy_mass_spring::solver::{self, Collider, Integrator, Solver, StepSettings, SubstepMode};

const GRAVITY: Vec3 = Vec3::new(0.0, -9.81, 0.0);

fn automatic() -> StepSettings {
    StepSettings { gravity: GRAVITY, ..StepSettings::default() }
}

fn named(integrator: Integrator, substeps: u32) -> StepSettings {
    StepSettings { integrator, substeps: SubstepMode::Fixed(substeps), ..automatic() }
}

/// A rope of springs of `length` from a pinned particle, taut, 60° from the vertical: particles of `mass`, at its end
/// one of `load` kg.
fn rope(links: usize, length: f32, [mass, load]: [f32; 2], stiffness: f32, damping: f32) -> Solver {
    let mut state = Solver::default();
    state.add_particle(Vec3::ZERO, Vec3::ZERO, f32::INFINITY, 0.0).unwrap();
    let direction = Vec3::new(0.75_f32.sqrt(), -0.5, 0.0);
    for link in 0..links {
        let mass = if link + 1 == links { load } else { mass };
        state.add_particle(direction * length * (link + 1) as f32, Vec3::ZERO, mass, 0.0).unwrap();
        let spring = solver::Spring { rest_length: length, stiffness, damping, ..solver::Spring::default() };
        state.add_spring([link, link + 1], spring).unwrap();
    }
    state
}

fn energy(state: &Solver) -> f64 {
    let totals = state.measure(GRAVITY);
    totals.kinetic_energy + totals.elastic_energy + totals.gravitational_energy
}

/// The lengths of ticks that scenes are to stand, s.
const TICKS: [f32; 3] = [1.0 / 120.0, 1.0 / 60.0, 1.0 / 30.0];

/// The part of the energy of the swing that is left after `seconds`: of what a straight rope has above hanging down.
fn energy_kept(mut state: Solver, settings: &StepSettings, seconds: f32) -> f64 {
    let start = energy(&state);
    // Hanging it is as long and half again as deep: cos 60° = 1/2. The weight stretches it by next to nothing.
    let lowest = start + state.measure(GRAVITY).gravitational_energy;
    for _ in 0..(seconds / settings.time_step).round() as u32 {
        state.step(settings);
    }
    (energy(&state) - lowest) / (start - lowest)
}

/// A rigid one keeps all of it; TR-BDF2 takes of a swing of 2 rad/s (hω)⁴/136 a step, 10⁻⁷, and of the waves that a rope
/// makes when it is let go more. Those of a rope of 10⁴ N/m are in part along it, and Auto takes an explicit scheme.
#[test]
fn stiff_swings_keep_their_energy_under_auto() {
    for stiffness in [1e4, 1e5, 1e6, 1e7, 1e8, 1e9] {
        for (name, state) in [
            ("pendulum", rope(1, 1.0, [1.0, 1.0], stiffness, 0.0)),
            ("rope", rope(20, 0.1, [0.1, 0.1], stiffness, 0.0)),
            ("load", rope(20, 0.1, [0.01, 10.0], stiffness, 0.0)),
        ] {
            for time_step in TICKS {
                let settings = StepSettings { time_step, ..automatic() };
                let kept = energy_kept(state.clone(), &settings, 20.0);
                assert!((0.97..1.02).contains(&kept), "{name}, {stiffness:e} N/m, {time_step} s: {kept}");
            }
        }
    }
}

/// Backward Euler takes hω² of a swing a second: it is what the scheme above is compared with.
#[test]
fn backward_euler_takes_the_energy_of_a_swing() {
    let kept = |settings| energy_kept(rope(1, 1.0, [1.0, 1.0], 1e8, 0.0), &settings, 20.0);
    let (first, second) = (kept(named(Integrator::ImplicitEuler, 4)), kept(named(Integrator::TrBdf2, 2)));
    assert!(first < 0.5 && second > 0.999, "{first}, {second}");
}

/// Field case `heavy-load-swing`: a grappling hook.
#[test]
fn a_heavy_load_on_a_stiff_rope_swings_on() {
    let mut state = rope(20, 0.1, [0.01, 10.0], 1e6, 10.0);
    let mut amplitude = 0.0_f32;
    for tick in 1..=33 * 60 {
        state.step(&automatic());
        let Vec3 { x, y, .. } = state.position(20);
        if tick > 30 * 60 {
            amplitude = amplitude.max(bevy::math::ops::atan2(x.abs(), -y).to_degrees());
        }
    }
    assert!((amplitude - 60.0).abs() < 1.0, "{amplitude}°");
}

/// A sheet held at two corners, let go from horizontal.
fn sheet(size: usize, stiffness: f32) -> Solver {
    let mut state = Solver::default();
    for slot in 0..size * size {
        let (x, z) = (slot % size, slot / size);
        let is_pinned = z == 0 && (x == 0 || x + 1 == size);
        let mass = if is_pinned { f32::INFINITY } else { 0.01 };
        state.add_particle(Vec3::new(0.1 * x as f32, 0.0, 0.1 * z as f32), Vec3::ZERO, mass, 0.0).unwrap();
    }
    for slot in 0..size * size {
        let (x, z) = (slot % size, slot / size);
        let mut join = |other: usize, rest_length: f32| {
            let spring = solver::Spring { rest_length, stiffness, damping: 0.0, ..solver::Spring::default() };
            state.add_spring([slot, other], spring).unwrap();
        };
        if x + 1 < size {
            join(slot + 1, 0.1);
        }
        if z + 1 < size {
            join(slot + size, 0.1);
        }
        if x + 1 < size && z + 1 < size {
            join(slot + size + 1, 0.02_f32.sqrt());
        }
        if x > 0 && z + 1 < size {
            join(slot + size - 1, 0.02_f32.sqrt());
        }
    }
    state
}

/// As many solutions of the equations: one step a tick for two. Reference: velocity Verlet, hω <= 0.35.
#[test]
fn a_stiff_sheet_is_nearer_to_the_truth_than_by_backward_euler() {
    let run = |settings: StepSettings| {
        let mut state = sheet(12, 1e5);
        for _ in 0..30 {
            state.step(&settings);
        }
        (0..144).map(|slot| state.position(slot).as_dvec3()).collect::<Vec<DVec3>>()
    };
    let truth = run(named(Integrator::VelocityVerlet, 600));
    let error = |settings| {
        let squares =
            run(settings).into_iter().zip(&truth).map(|(found, truth)| found.distance_squared(*truth));
        (squares.sum::<f64>() / 144.0).sqrt()
    };
    let (first, second) = (error(named(Integrator::ImplicitEuler, 2)), error(named(Integrator::TrBdf2, 1)));
    assert!(2.0 * second < first, "{second} m, by backward Euler {first} m");
}

/// However stiff: what rounds positions must not throw a net about.
#[test]
fn springs_of_any_stiffness_stay_quiet() {
    for stiffness in [1e10, 1e12, 1e15] {
        for mass in [0.01, 10.0] {
            let mut state = rope(20, 0.1, [mass, mass], stiffness, 0.0);
            let start = state.measure(GRAVITY).gravitational_energy;
            let weight = 20.0 * f64::from(mass) * 9.81;
            for tick in 1..=600 {
                state.step(&automatic());
                let totals = state.measure(GRAVITY);
                let gained = totals.kinetic_energy + totals.gravitational_energy - start;
                assert!(gained < 0.01 * weight, "{stiffness:e} N/m, {mass} kg, tick {tick}: {gained} J");
            }
        }
    }
}

/// Each rate with each length of a tick.
fn at_every_tick<const N: usize>(rates: [f32; N]) -> impl Iterator<Item = (f32, f32)> {
    rates.into_iter().flat_map(|rate| TICKS.map(|time_step| (rate, time_step)))
}

/// The exact motion of a particle in a medium: v = u + (v₀ − u) e^−rt with r = ν/m and u = g/r.
#[test]
fn a_particle_in_any_medium_moves_exactly() {
    for (rate, time_step) in at_every_tick([1e-3, 1.0, 60.0, 1e3, 1e5, 1e7, 1e9]) {
        let mut state = Solver::default();
        state.add_particle(Vec3::ZERO, Vec3::X, 1.0, 0.0).unwrap();
        let settings = StepSettings { viscosity: rate, time_step, ..automatic() };
        for tick in 1..=60 {
            let plan = state.step(&settings).plan;
            assert!(plan.substeps <= 8, "{plan:?}");
            let (rate, time) = (f64::from(rate), f64::from(tick) * f64::from(settings.time_step));
            let decayed = -(-rate * time).exp_m1();
            let terminal = GRAVITY.as_dvec3() / rate;
            let velocity = terminal + (DVec3::X - terminal) * (1.0 - decayed);
            let position = terminal * time + (DVec3::X - terminal) * decayed / rate;
            // Each of 240 substeps rounds twice, by 2⁻²⁴ of what is there.
            let (found, there) = (state.velocity(0).as_dvec3(), state.position(0).as_dvec3());
            assert!((found - velocity).length() < 3e-5 * velocity.length() + 1e-9, "{rate} 1/s: {found}");
            assert!((there - position).length() < 3e-5 * position.length() + 1e-9, "{rate} 1/s: {there}");
        }
    }
}

/// Field case `pure-damper`, and its kind: a damper to a pinned particle, v = v₀ e^−rt with r = c/m.
#[test]
fn dampers_without_springs_meet_the_closed_form() {
    let rates = [0.1, 1.0, 10.0, 60.0, 200.0, 500.0, 1e3, 1e4, 1e6, 1e8, 1e9];
    for (rate, time_step) in at_every_tick(rates) {
        let mut state = Solver::default();
        state.add_particle(Vec3::ZERO, Vec3::ZERO, f32::INFINITY, 0.0).unwrap();
        state.add_particle(Vec3::X * 2.0, Vec3::X, 0.001, 0.0).unwrap();
        let damper = solver::Spring {
            rest_length: 1.0,
            stiffness: 0.0,
            damping: 0.001 * rate,
            ..solver::Spring::default()
        };
        state.add_spring([0, 1], damper).unwrap();
        let settings = StepSettings { gravity: Vec3::ZERO, time_step, ..automatic() };
        for tick in 1..=60 {
            let plan = state.step(&settings).plan;
            assert!(plan.substeps <= 8, "{plan:?}");
            let (rate, time) = (f64::from(rate), f64::from(tick) * f64::from(settings.time_step));
            let decayed = -(-rate * time).exp_m1();
            let (position, velocity) = (f64::from(state.position(1).x), f64::from(state.velocity(1).x));
            assert!((velocity - (1.0 - decayed)).abs() < 1e-3, "{rate} 1/s, tick {tick}: {velocity} m/s");
            let tolerance = 1e-3 * decayed / rate + 480.0 * 1.2e-7;
            assert!((position - 2.0 - decayed / rate).abs() < tolerance, "{rate} 1/s: {position} m");
        }
    }
}

/// While something touches an island its steps are those of backward Euler, so what follows a contact is what it is by
/// that scheme; and when it lifts off it swings on by TR-BDF2.
#[test]
fn an_island_that_touches_something_takes_steps_of_backward_euler() {
    let scene = || {
        let mut state = rope(4, 0.1, [0.1, 0.1], 1e6, 0.0);
        state.add_collider(Collider::half_space(Vec3::Y * -0.2, Vec3::Y, 0.0, 0.0));
        state
    };
    // The end touches the ground already: radius 0, height −0.2 m.
    let step_of = |integrator: Integrator| {
        let mut state = scene();
        state.step(&named(Integrator::TrBdf2, 1));
        assert!(state.outputs().contact_count > 0);
        state.step(&named(integrator, 1));
        (0..4).map(|slot| state.position(slot).as_dvec3()).collect::<Vec<DVec3>>()
    };
    let (found, expected) = (step_of(Integrator::TrBdf2), step_of(Integrator::ImplicitEuler));
    assert_eq!(found, expected);
}
