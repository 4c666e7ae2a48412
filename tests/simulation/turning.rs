//! Bodies that springs press together while they turn about each other: no torque acts.

use bevy::math::{DVec3, Vec3};
use bevy_mass_spring::solver::{self, Integrator, Solver, StepSettings, SubstepMode};

use crate::common::bodies::floating;

const RADIUS: f32 = 0.1;

/// Balls of 1 kg about a pinned middle, each drawn to it, which turn about the z axis at `rate` rad/s.
fn cluster(places: &[Vec3], rate: f32) -> Solver {
    let mut state = Solver::default();
    let middle = state.add_particle(Vec3::ZERO, Vec3::ZERO, f32::INFINITY, 0.0).unwrap();
    for place in places {
        let ball = state.add_particle(*place, Vec3::Z.cross(*place) * rate, 1.0, RADIUS).unwrap();
        let spring =
            solver::Spring { rest_length: 0.0, stiffness: 50.0, damping: 2.0, ..solver::Spring::default() };
        state.add_spring([middle, ball], spring).unwrap();
    }
    state
}

/// Two balls that touch.
fn pair() -> Vec<Vec3> {
    vec![Vec3::X * RADIUS, Vec3::NEG_X * RADIUS]
}

/// The `count` places of a cubic lattice nearest to the middle, none in it, spread by a tenth.
fn lattice(count: usize) -> Vec<Vec3> {
    let axis = || (-3..3).map(|place| (place as f32 + 0.5) * 2.2 * RADIUS);
    let mut places: Vec<Vec3> =
        axis().flat_map(|x| axis().flat_map(move |y| axis().map(move |z| Vec3::new(x, y, z)))).collect();
    places.sort_by(|one, other| one.length().total_cmp(&other.length()));
    places.truncate(count);
    places
}

fn angular_momentum(state: &Solver) -> DVec3 {
    (1..state.particle_count())
        .map(|ball| state.position(ball).as_dvec3().cross(state.velocity(ball).as_dvec3()))
        .sum()
}

/// 120 s. All forces are central, so that the angular momentum is constant. A cluster contracts at first, which
/// takes energy from the springs, and then turns as one: what it has left by then it keeps.
fn turns_on(places: &[Vec3], settings: &StepSettings, label: &str) {
    let mut state = cluster(places, 0.2);
    let (before, energy) = (angular_momentum(&state), state.measure(Vec3::ZERO).total_energy());
    let mut settled = f64::INFINITY;
    for second in 0..120 {
        for _ in 0..60 {
            state.step(settings);
        }
        let (turning, now) = (angular_momentum(&state), state.measure(Vec3::ZERO));
        let drift = (turning - before).length() / before.length();
        assert!(drift < 1e-3, "{label}, {second} s: {turning} of {before}");
        assert!(now.total_energy() <= energy * (1.0 + 1e-5), "{label}, {second} s: {now:?} of {energy} J");
        if second == 20 {
            settled = now.kinetic_energy;
        }
        assert!(now.kinetic_energy <= 1.01 * settled, "{label}, {second} s: {now:?} after {settled} J");
    }
}

/// (Explicit Euler and the scheme of second order in position gain energy across a damped spring, contacts or not.)
#[test]
fn balls_pressed_together_keep_their_angular_momentum() {
    for integrator in
        [Integrator::Auto, Integrator::SemiImplicitEuler, Integrator::VelocityVerlet, Integrator::RungeKutta4]
    {
        let substeps = if integrator == Integrator::Auto { SubstepMode::Auto } else { SubstepMode::Fixed(8) };
        let settings = StepSettings { integrator, substeps, ..floating(integrator, 0.0) };
        turns_on(&pair(), &settings, &format!("{integrator}, a pair"));
        turns_on(&lattice(8), &settings, &format!("{integrator}, 8"));
        turns_on(&lattice(30), &settings, &format!("{integrator}, 30"));
    }
}
