//! How a scene would be simulated, known before any tick has run.

use bevy_mass_spring::scene::MassSpringScene;
use bevy_mass_spring::solver::Scheme;
use bevy_mass_spring::solver::stability::FrequencyBounds;
use bevy_mass_spring::{Integrator, Substeps};

/// The scheme and the number of substeps of a tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Plan {
    pub integrator: Integrator,
    pub substeps: u32,
}

/// Bounds on the frequencies of the scene.
pub fn bounds(scene: &MassSpringScene) -> FrequencyBounds {
    let inverse_mass: Vec<f32> = scene
        .particles
        .iter()
        .map(|particle| if particle.pinned { 0.0 } else { 1.0 / particle.mass })
        .collect();
    let springs = scene.springs.iter().map(|spring| {
        let (first, second) = spring.particles;
        (first, second, spring.stiffness, spring.damping)
    });
    FrequencyBounds::of(&inverse_mass, springs, scene.environment.viscosity)
}

/// What the settings of the scene amount to.
pub fn plan(scene: &MassSpringScene, bounds: &FrequencyBounds) -> Plan {
    let solver = &scene.solver;
    // A scheme that is not available was refused with the scene.
    let named = solver.integrator.scheme().ok().flatten();
    let scheme = named.unwrap_or(Scheme::SemiImplicitEuler);
    let automatic = bounds.auto_substeps(scheme, solver.time_step as f32);
    let substeps = match (solver.substeps, named) {
        (Substeps::Auto, _) => automatic,
        (Substeps::Fixed(count), Some(_)) => count,
        (Substeps::Fixed(count), None) => count.max(automatic),
    };
    Plan { integrator: scheme.into(), substeps }
}
