//! Springs with a rest length whose ends start in the very same place.

use bevy::math::{DVec3, Vec3};
use bevy_mass_spring::solver::{Integrator, Solver, Spring, StepSettings, SubstepMode};

use crate::common::bodies::{positions, velocities};

const LINK: Spring = Spring::elastic(0.1, 200.0, 0.5);

fn settings(integrator: Integrator) -> StepSettings {
    StepSettings {
        integrator,
        substeps: SubstepMode::Fixed(16),
        gravity: Vec3::NEG_Y * 9.81,
        ..StepSettings::default()
    }
}

/// A rope of 4 links, all in one point; the particle `anchor` is pinned.
fn rope(anchor: usize) -> Solver {
    let mut solver = Solver::default();
    for node in 0..5 {
        let mass = if node == anchor { f32::INFINITY } else { 0.1 };
        solver.add_particle(Vec3::Y * 2.0, Vec3::ZERO, mass, 0.0).unwrap();
        if node > 0 {
            solver.add_spring([node - 1, node], LINK).unwrap();
        }
    }
    solver
}

/// The field case, in a thick medium, so that the swinging ends: 0.1 m and the stretch a link, straight down.
#[test]
fn a_rope_in_one_point_unfolds_and_hangs() {
    for integrator in Integrator::ALL {
        for anchor in [0, 4] {
            let mut solver = rope(anchor);
            let settings = StepSettings { viscosity: 0.3, ..settings(integrator) };
            for _ in 0..1200 {
                solver.step(&settings);
            }
            let mut depth = 0.0;
            for link in 0..4_usize {
                // What hangs below the link stretches it.
                depth += 0.1 + (4 - link) as f32 * 0.1 * 9.81 / LINK.stiffness;
                let node = if anchor == 0 { link + 1 } else { 3 - link };
                let expected = Vec3::Y * (2.0 - depth);
                let found = solver.position(node);
                assert!(
                    found.distance(expected) < 2e-3,
                    "{integrator}, {anchor}: {found}, expected {expected}"
                );
            }
        }
    }
}

/// Two particles and no gravity: they oscillate with the energy of the spring, and nothing else moves.
#[test]
fn two_coincident_particles_part_with_the_energy_of_their_spring() {
    for integrator in [Integrator::VelocityVerlet, Integrator::RungeKutta4, Integrator::SemiImplicitEuler] {
        let mut solver = Solver::default();
        for mass in [0.1, 0.3] {
            solver.add_particle(Vec3::new(1.0, 2.0, 3.0), Vec3::ZERO, mass, 0.0).unwrap();
        }
        solver.add_spring([0, 1], Spring { damping: 0.0, ..LINK }).unwrap();
        let settings =
            StepSettings { gravity: Vec3::ZERO, substeps: SubstepMode::Fixed(64), ..settings(integrator) };
        // ½ k l0²
        let energy = 0.5 * f64::from(LINK.stiffness) * 0.01;
        for _ in 0..120 {
            solver.step(&settings);
            let found = solver.measure(Vec3::ZERO);
            assert!(
                (found.total_energy() / energy - 1.0).abs() < 0.05,
                "{integrator}: {}",
                found.total_energy()
            );
            assert!(found.momentum.length() < 1e-5, "{integrator}");
        }
        let centre: DVec3 = (positions(&solver)[0].as_dvec3() + 3.0 * positions(&solver)[1].as_dvec3()) / 4.0;
        assert!(centre.distance(DVec3::new(1.0, 2.0, 3.0)) < 1e-5, "{integrator}: {centre}");
    }
}

/// Every spring goes another way, also without gravity; and an island as it would alone.
#[test]
fn directions_differ_and_islands_do_not_depend_on_each_other() {
    let settings = StepSettings { gravity: Vec3::ZERO, ..settings(Integrator::SemiImplicitEuler) };
    let star = |solver: &mut Solver| {
        let centre = solver.add_particle(Vec3::ONE, Vec3::ZERO, f32::INFINITY, 0.0).unwrap();
        let first = solver.particle_count();
        for _ in 0..6 {
            let tip = solver.add_particle(Vec3::ONE, Vec3::ZERO, 0.1, 0.0).unwrap();
            solver.add_spring([centre, tip], LINK).unwrap();
            if tip > first {
                solver.add_spring([tip - 1, tip], LINK).unwrap();
            }
        }
        first..solver.particle_count()
    };
    let mut alone = Solver::default();
    let own = star(&mut alone);
    let mut both = rope(0);
    let there = star(&mut both);
    for _ in 0..20 {
        alone.step(&settings);
        both.step(&settings);
        assert_eq!(positions(&alone)[own.clone()], positions(&both)[there.clone()]);
        assert_eq!(velocities(&alone)[own.clone()], velocities(&both)[there.clone()]);
    }
    let tips = &positions(&alone)[own];
    for (first, one) in tips.iter().enumerate() {
        for other in &tips[..first] {
            assert!(one.distance(*other) > 0.01, "{one} {other}");
        }
    }
}
