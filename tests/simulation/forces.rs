//! Tensions and reactions as they are published, against the statics.

use bevy::math::Vec3;
use bevy_mass_spring::solver::{Integrator, Solver, Spring, StepSettings, SubstepMode};

const GRAVITY: f32 = 9.81;
const LOAD: f32 = 10.0;

/// A load on `links` springs of 0.5 m with light knots between them, hung from a pinned particle.
fn hung(links: usize, stiffness: f32, damping: f32) -> Solver {
    let mut state = Solver::default();
    let mut last = state.add_particle(Vec3::new(0.3, 2.7, -0.4), Vec3::ZERO, f32::INFINITY, 0.0).unwrap();
    for link in 1..=links {
        let mass = if link == links { LOAD } else { 0.01 };
        let next = state.add_particle(state.position(last) - Vec3::Y * 0.5, Vec3::ZERO, mass, 0.0).unwrap();
        let spring = Spring { rest_length: 0.5, stiffness, damping, ..Spring::default() };
        state.add_spring([last, next], spring).unwrap();
        last = next;
    }
    state
}

/// What hangs below each spring, and all of it on the anchor, within 1e-4 by every scheme, though at 1e9 N/m one ulp of a
/// coordinate is a hundred newtons: what rests is in balance.
#[test]
fn forces_are_those_of_the_statics() {
    for integrator in Integrator::ALL {
        // Position-based dynamics does not solve for a heavy load on light links: see the conformance lab.
        let most_links = if integrator == Integrator::Xpbd { 1 } else { 5 };
        let is_stable = !matches!(integrator, Integrator::ExplicitEuler | Integrator::SecondOrderTaylor);
        let cases = [1, 5].into_iter().flat_map(|links| [1e3, 1e5, 1e6, 1e7, 1e9].map(|k| (links, k)));
        for (links, stiffness) in cases.filter(|(links, _)| is_stable && *links <= most_links) {
            // Tens of thousands of substeps a tick.
            let is_implicit = matches!(integrator, Integrator::ImplicitEuler | Integrator::TrBdf2);
            if !is_implicit && integrator != Integrator::Auto && stiffness > 1e7 && links > 1 {
                continue;
            }
            let damping = 0.2 * (stiffness * LOAD).sqrt();
            let mut state = hung(links, stiffness, damping);
            let substeps = if is_implicit { SubstepMode::Fixed(2) } else { SubstepMode::Auto };
            let gravity = Vec3::NEG_Y * GRAVITY;
            let settings = StepSettings { integrator, substeps, gravity, ..StepSettings::default() };
            // The slowest motion of five links fades at 0.0063 √(k m/N) /s.
            for _ in 0..if stiffness < 1e4 { 3000 } else { 600 } {
                state.step(&settings);
            }
            state.outputs_mut().record_forces = true;
            let outputs = state.step(&settings);
            let label = format!("{integrator}, {links} links of {stiffness:e} N/m");
            for (link, tension) in outputs.tensions.iter().enumerate() {
                let expected = (LOAD + 0.01 * (links - 1 - link) as f32) * GRAVITY;
                assert!(
                    (tension / expected - 1.0).abs() < 1e-4,
                    "{label}, {link}: {tension} of {expected} N"
                );
            }
            let (slot, reaction) = outputs.reactions[0];
            let expected = Vec3::NEG_Y * (LOAD + 0.01 * (links - 1) as f32) * GRAVITY;
            assert!(
                slot == 0 && (reaction - expected).length() < 1e-4 * expected.length(),
                "{label}: {reaction}"
            );
        }
    }
}
