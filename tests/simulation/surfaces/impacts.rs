//! Single impacts of edges and faces: closed forms.

use bevy::math::Vec3;
use bevy_mass_spring::solver::{Integrator, PairRules, Solver, StepSettings, SubstepMode};

const RADIUS: f32 = 0.05;

fn settings(integrator: Integrator, restitution: f32, friction: f32) -> StepSettings {
    StepSettings {
        integrator,
        substeps: SubstepMode::Fixed(1),
        pair_rules: Some(PairRules { restitution, friction }),
        ..StepSettings::default()
    }
}

fn momentum(solver: &Solver) -> Vec3 {
    (0..solver.particle_count()).map(|slot| solver.velocity(slot) / solver.inverse_mass(slot)).sum()
}

/// A triangle of free particles of 1, 2 and 3 kg in the plane y = 0, and a ball of 0.5 kg above the point of it that has
/// the weights 0.2, 0.3 and 0.5.
fn ball_above_triangle(velocity: Vec3) -> Solver {
    let mut solver = Solver::default();
    let corners = [Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.5, 0.0, -1.0), Vec3::new(0.0, 0.0, 1.0)];
    for (corner, mass) in corners.into_iter().zip([1.0, 2.0, 3.0]) {
        solver.add_particle(corner, Vec3::ZERO, mass, RADIUS).unwrap();
    }
    solver.add_collision_triangles(&[[0, 1, 2]], &[]).unwrap();
    let below = 0.2 * corners[0] + 0.3 * corners[1] + 0.5 * corners[2];
    let height = 0.1 + RADIUS + 0.01;
    solver.add_particle(below + height * Vec3::Y, velocity, 0.5, 0.1).unwrap();
    solver
}

#[test]
fn a_ball_rebounds_from_a_free_triangle_as_two_bodies_do() {
    for integrator in Integrator::ALL {
        for restitution in [0.0, 0.5, 1.0] {
            let mut solver = ball_above_triangle(Vec3::NEG_Y * 2.0);
            for _ in 0..3 {
                solver.step(&settings(integrator, restitution, 0.0));
            }
            // 1/μ = 1/m + Σ w²/mᵢ; the impulse is (1 + ε) μ v.
            let weights = [0.2, 0.3, 0.5_f32];
            let masses = [1.0, 2.0, 3.0_f32];
            let inverse = 1.0 / 0.5
                + weights.iter().zip(masses).map(|(weight, mass)| weight * weight / mass).sum::<f32>();
            let impulse = (1.0 + restitution) * 2.0 / inverse;
            let case = format!("{integrator}, restitution {restitution}");
            let speed = solver.velocity(3).y;
            assert!((speed - (impulse / 0.5 - 2.0)).abs() < 1e-5, "{case}: {speed}");
            for corner in 0..3 {
                let expected = -impulse * weights[corner] / masses[corner];
                assert!((solver.velocity(corner).y - expected).abs() < 1e-5, "{case}, corner {corner}");
            }
            assert!((momentum(&solver) - Vec3::NEG_Y).length() < 1e-5, "{case}");
        }
    }
}

/// The tangential impulse of an impact is at most μ times the normal one, and at most what stops the slip.
#[test]
fn an_oblique_impact_rubs_as_coulomb_says() {
    for (friction, sticks) in [(0.1_f32, false), (5.0, true)] {
        let mut solver = ball_above_triangle(Vec3::new(0.4, -2.0, 0.0));
        for _ in 0..2 {
            solver.step(&settings(Integrator::SemiImplicitEuler, 0.0, friction));
        }
        let ball = solver.velocity(3);
        let normal = 0.5 * (ball.y + 2.0);
        let lost = 0.5 * (0.4 - ball.x);
        if sticks {
            let point = 0.2 * solver.velocity(0) + 0.3 * solver.velocity(1) + 0.5 * solver.velocity(2);
            assert!((ball - point).length() < 2e-2, "{ball} {point}");
        } else {
            assert!((lost - friction * normal).abs() < 1e-5, "{lost} {normal}");
        }
        assert!((momentum(&solver) - Vec3::new(0.2, -1.0, 0.0)).length() < 1e-5);
    }
}

/// Two free rods that cross at right angles, one falling onto the other.
#[test]
fn crossing_edges_share_an_impact_by_their_weights() {
    for integrator in Integrator::ALL {
        let mut solver = Solver::default();
        let height = 2.0 * RADIUS + 0.004;
        let places = [
            (Vec3::new(-1.0, 0.0, 0.0), Vec3::ZERO),
            (Vec3::new(1.0, 0.0, 0.0), Vec3::ZERO),
            (Vec3::new(0.5, height, -0.5), Vec3::NEG_Y),
            (Vec3::new(0.5, height, 1.5), Vec3::NEG_Y),
        ];
        for (place, velocity) in places {
            solver.add_particle(place, velocity, 1.0, RADIUS).unwrap();
        }
        solver.add_collision_edge([0, 1]).unwrap();
        solver.add_collision_edge([2, 3]).unwrap();
        for _ in 0..3 {
            solver.step(&settings(integrator, 1.0, 0.0));
        }
        // Weights 1/4 and 3/4 on both: 1/μ = 2 (1/16 + 9/16).
        let impulse = 2.0 / 1.25;
        let expected = [-0.25, -0.75, 0.75, 0.25].map(|weight| weight * impulse);
        for (slot, change) in expected.into_iter().enumerate() {
            let change = change + places[slot].1.y;
            assert!((solver.velocity(slot).y - change).abs() < 1e-5, "{integrator}, {slot}: {change}");
        }
    }
}
