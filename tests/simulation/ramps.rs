//! Parameters of springs that change between ticks go to their new values substep by substep.

use bevy::prelude::*;
use bevy_mass_spring::prelude::*;
use bevy_mass_spring::solver::{self, Solver, StepSettings};

use crate::common::{TICK, app, run, velocity};

/// Stiffness of the rope that carries a load of 10 kg on a winch, N/m.
const STIFFNESS: f32 = 1e6;
/// Its damping, N·s/m.
const DAMPING: f32 = 5000.0;

fn settings(integrator: Integrator, substeps: SubstepMode) -> StepSettings {
    StepSettings {
        integrator,
        substeps,
        time_step: TICK,
        gravity: Vec3::NEG_Y * 9.81,
        ..StepSettings::default()
    }
}

/// The field case: at 1 m/s the spring pulls with the weight and what it takes to move the damper.
#[test]
fn a_winch_pulls_smoothly() {
    for integrator in Integrator::ALL {
        let substeps = match integrator {
            Integrator::ExplicitEuler | Integrator::SecondOrderTaylor => SubstepMode::Fixed(64),
            _ => SubstepMode::Auto,
        };
        let mut solver = Solver::default();
        solver.add_particle(Vec3::ZERO, Vec3::ZERO, f32::INFINITY, 0.0).unwrap();
        solver.add_particle(Vec3::NEG_Y * 4.0, Vec3::ZERO, 10.0, 0.0).unwrap();
        let mut rope = solver::Spring {
            rest_length: 4.0,
            stiffness: STIFFNESS,
            damping: DAMPING,
            ..solver::Spring::default()
        };
        solver.add_spring([0, 1], rope).unwrap();
        for tick in 0..120 {
            rope.rest_length -= TICK;
            solver.set_spring(0, rope).unwrap();
            solver.step(&settings(integrator, substeps));
            if tick < 30 {
                continue;
            }
            let (speed, length) = (solver.velocity(1).y, -solver.position(1).y);
            let force = STIFFNESS * (length - rope.rest_length);
            let tolerance = 0.01;
            assert!((speed - 1.0).abs() < tolerance, "{integrator}, tick {tick}: {speed} m/s");
            let expected = 98.1 + DAMPING;
            assert!((force / expected - 1.0).abs() < tolerance, "{integrator}, tick {tick}: {force} N");
        }
    }
}

/// The same by the component, while particles come and go, so that slots are assigned anew.
#[test]
fn a_winch_of_the_app_pulls_smoothly_while_slots_change() {
    let mut app = app();
    let anchor = crate::common::spawn_pinned(&mut app, Vec3::ZERO);
    let load = crate::common::spawn(&mut app, 10.0, 0.0, Vec3::NEG_Y * 4.0);
    let rope = Spring::new(anchor, load, 4.0).with_stiffness(STIFFNESS).with_damping(DAMPING);
    let rope = app.world_mut().spawn(rope).id();
    let mut others = Vec::new();
    for tick in 0..100 {
        app.world_mut().get_mut::<Spring>(rope).unwrap().rest_length -= TICK;
        if tick % 20 < 10 {
            others.push(crate::common::spawn(&mut app, 1.0, 0.0, Vec3::X * (10.0 + tick as f32)));
        } else if let Some(other) = others.pop() {
            app.world_mut().despawn(other);
        }
        run(&mut app, 1);
        let speed = velocity(&app, load).y;
        assert!(tick < 30 || (speed - 1.0).abs() < 0.01, "tick {tick}: {speed} m/s");
    }
}

/// A spring that becomes 1e6 times softer keeps the substeps that it needs on the way; one that is added is there at
/// once.
#[test]
fn a_spring_that_becomes_soft_is_stable_on_the_way() {
    let mut solver = Solver::default();
    solver.add_particle(Vec3::ZERO, Vec3::ZERO, f32::INFINITY, 0.0).unwrap();
    solver.add_particle(Vec3::X * 1.0001, Vec3::ZERO, 1.0, 0.0).unwrap();
    let stiff = solver::Spring { rest_length: 1.0, stiffness: 1e6, ..solver::Spring::default() };
    solver.add_spring([0, 1], stiff).unwrap();
    let settings = StepSettings { gravity: Vec3::ZERO, ..settings(Integrator::Auto, SubstepMode::Auto) };
    let energy = solver.measure(Vec3::ZERO).total_energy();
    let needed = solver.plan(&settings).substeps;
    solver.step(&settings);
    solver.set_spring(0, solver::Spring { stiffness: 1.0, ..stiff }).unwrap();
    assert_eq!(solver.plan(&settings).substeps, needed);
    solver.step(&settings);
    assert!(solver.plan(&settings).substeps < needed);
    let left = solver.measure(Vec3::ZERO).total_energy();
    assert!(left <= 1.1 * energy, "{energy} J → {left} J");
}
