//! Springs that only pull: in every scheme, against closed forms.

use bevy::math::Vec3;
use bevy_mass_spring::solver::{Integrator, Solver, Spring, StepSettings, SubstepMode};

const GRAVITY: f32 = 9.81;
const CABLE: Spring = Spring { tension_only: true, ..Spring::elastic(2.0, 400.0, 0.0) };

fn settings(integrator: Integrator, substeps: u32) -> StepSettings {
    StepSettings { integrator, substeps: SubstepMode::Fixed(substeps), ..StepSettings::default() }
}

/// A pinned particle at the origin, and one of 1 kg at `position` on a `cable`.
fn leashed(cable: Spring, position: Vec3, velocity: Vec3) -> Solver {
    let mut solver = Solver::default();
    solver.add_particle(Vec3::ZERO, Vec3::ZERO, f32::INFINITY, 0.0).unwrap();
    solver.add_particle(position, velocity, 1.0, 0.0).unwrap();
    solver.add_spring([0, 1], cable).unwrap();
    solver
}

/// The field case 'leash': of 2 m, on a dog 0.5 m away that walks at 0.5 m/s.
#[test]
fn a_slack_leash_exerts_no_force() {
    for integrator in Integrator::ALL {
        let cable = Spring { damping: 50.0, ..CABLE };
        let mut solver = leashed(cable, Vec3::X * 0.5, Vec3::X * 0.5);
        solver.outputs_mut().record_forces = true;
        for tick in 1..=120 {
            solver.step(&settings(integrator, 4));
            let expected = 0.5 + 0.5 * tick as f32 / 60.0;
            assert!((solver.position(1).x - expected).abs() < 1e-5, "{integrator}, tick {tick}");
            assert_eq!(solver.outputs().tensions, [0.0], "{integrator}");
        }
        assert_eq!(solver.measure(Vec3::ZERO).elastic_energy, 0.0);
    }
}

/// A ball flies out at u = 1 m/s from 1.5 m, is caught at 2 m, where it is a harmonic oscillator for half a period
/// π/ω = π/20 s, and flies back at −u.
#[test]
fn a_cable_that_becomes_taut_gives_the_velocity_back() {
    // First order: the energy of one substep at the catch is left out, error ~ ω h = 20 / 60 / n.
    let schemes = [
        (Integrator::SemiImplicitEuler, 200, 2e-3),
        (Integrator::VelocityVerlet, 50, 1e-3),
        (Integrator::RungeKutta4, 50, 1e-3),
        (Integrator::SecondOrderTaylor, 400, 5e-3),
        (Integrator::ExplicitEuler, 2000, 1e-2),
        (Integrator::TrBdf2, 200, 5e-3),
        (Integrator::ImplicitEuler, 1000, 2e-2),
        (Integrator::Xpbd, 1000, 2e-2),
    ];
    for (integrator, substeps, tolerance) in schemes {
        let mut solver = leashed(CABLE, Vec3::X * 1.5, Vec3::X);
        let settings = settings(integrator, substeps);
        let mut furthest = 0.0_f32;
        // 0.5 s to the catch, 0.157 s on the cable, and back for 0.343 s.
        for _ in 0..60 {
            solver.step(&settings);
            furthest = furthest.max(solver.position(1).x);
        }
        let expected = 2.0 - (0.5 - std::f32::consts::PI / 20.0);
        assert!((solver.velocity(1).x + 1.0).abs() < tolerance, "{integrator}: {}", solver.velocity(1));
        assert!((solver.position(1).x - expected).abs() < tolerance, "{integrator}: {}", solver.position(1));
        // u/ω beyond its length, seen at the ends of ticks.
        assert!((furthest - 2.05).abs() < 2e-3, "{integrator}: {furthest}");
    }
}

/// What drops 1 m and hangs on a damped cable comes to rest m g / k below it, and never gains energy.
#[test]
fn a_load_that_drops_into_its_cable_comes_to_rest() {
    for (integrator, substeps) in [
        (Integrator::Auto, 4),
        (Integrator::SemiImplicitEuler, 40),
        (Integrator::ImplicitEuler, 4),
        (Integrator::Xpbd, 20),
    ] {
        let mut solver = leashed(Spring { damping: 8.0, ..CABLE }, Vec3::NEG_Y, Vec3::ZERO);
        let settings = StepSettings { gravity: Vec3::NEG_Y * GRAVITY, ..settings(integrator, substeps) };
        let start = solver.measure(settings.gravity).total_energy();
        for _ in 0..600 {
            solver.step(&settings);
            let energy = solver.measure(settings.gravity).total_energy();
            assert!(energy < start + 0.02, "{integrator}: {start} J → {energy} J");
        }
        let expected = -2.0 - GRAVITY / 400.0;
        assert!((solver.position(1).y - expected).abs() < 1e-4, "{integrator}: {}", solver.position(1));
    }
}

/// A chain of cables computed eight at a time, pushed together, moves as its particles alone do; pulled apart, as a
/// chain of springs does.
#[test]
fn a_run_of_cables_pulls_and_does_not_push() {
    let chain = |spring: Spring, spacing: f32, with_springs: bool| {
        let mut solver = Solver::default();
        for link in 0..40_usize {
            let velocity = Vec3::new(0.0, 0.1 * (link % 3) as f32, 0.0);
            solver.add_particle(Vec3::X * spacing * link as f32, velocity, 0.1, 0.0).unwrap();
            if link > 0 && with_springs {
                solver.add_spring([link - 1, link], spring).unwrap();
            }
        }
        solver
    };
    let spring = Spring { rest_length: 0.1, stiffness: 100.0, damping: 0.1, ..Spring::default() };
    let cable = Spring { tension_only: true, ..spring };
    for integrator in Integrator::ALL {
        let run = |mut solver: Solver, ticks: u32| {
            for _ in 0..ticks {
                solver.step(&settings(integrator, 8));
            }
            (0..40).map(|slot| solver.position(slot)).collect::<Vec<_>>()
        };
        let pushed = run(chain(cable, 0.05, true), 5);
        for (found, alone) in pushed.iter().zip(run(chain(cable, 0.05, false), 5)) {
            assert!(found.distance(alone) < 1e-6, "{integrator}");
        }
        let pulled = run(chain(cable, 0.2, true), 2);
        assert_eq!(pulled, run(chain(spring, 0.2, true), 2), "{integrator}");
    }
}
