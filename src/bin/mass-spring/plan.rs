//! How a scene would be simulated, known before any tick has run.

use bevy_mass_spring::scene::{MassSpringScene, SceneSolver};
use bevy_mass_spring::solver::stability::{Choice, Components, FrequencyBounds, MAX_SUBSTEPS};
use bevy_mass_spring::{Integrator, SolverSettings, Substeps};

/// Bounds on the frequencies of the scene.
pub fn bounds(scene: &MassSpringScene) -> FrequencyBounds {
    FrequencyBounds::of(&inverse_mass(scene), springs(scene), scene.environment.viscosity)
}

/// What the settings of the scene amount to.
pub fn plan(scene: &MassSpringScene, bounds: &FrequencyBounds) -> Choice {
    let SceneSolver { integrator, substeps, time_step } = scene.solver;
    let mut components = Components::default();
    SolverSettings { integrator, substeps }.choose_by_component(bounds, time_step as f32, || {
        components = Components::of(&inverse_mass(scene), springs(scene), scene.environment.viscosity);
        &mut components
    })
}

fn inverse_mass(scene: &MassSpringScene) -> Vec<f32> {
    let particles = scene.particles.iter();
    particles.map(|particle| if particle.pinned { 0.0 } else { 1.0 / particle.mass }).collect()
}

fn springs(scene: &MassSpringScene) -> impl Iterator<Item = (usize, usize, f32, f32)> + Clone {
    scene.springs.iter().map(|spring| {
        let (first, second) = spring.particles;
        (first, second, spring.stiffness, spring.damping)
    })
}

/// What a user should know before relying on the results.
pub fn warnings(scene: &MassSpringScene, bounds: &FrequencyBounds) -> Vec<String> {
    let mut warnings = Vec::new();
    let time_step = scene.solver.time_step;
    let tick = scene.solver.tick().map_or(time_step, |tick| tick.as_secs_f64());
    if (tick - time_step).abs() > 1e-5 * time_step {
        warnings.push(format!(
            "Bevy's clock counts whole nanoseconds: a tick is {tick:e} s instead of {time_step:e} s"
        ));
    }
    let Choice { scheme, substeps, .. } = plan(scene, bounds);
    if scene.solver.substeps == Substeps::Auto && substeps == MAX_SUBSTEPS {
        let integrator = Integrator::from(scheme);
        warnings.push(format!(
            "the springs are too stiff for their masses: {MAX_SUBSTEPS} substeps of {integrator} may not suffice"
        ));
    }
    warnings
}

#[cfg(test)]
mod tests {
    use super::*;

    fn warned(time_step: f64, stiffness: f32) -> Vec<String> {
        let text = format!(
            "(solver: (time_step: {time_step}, integrator: SemiImplicitEuler),
              particles: [(position: (0, 0, 0), mass: 1), (position: (1, 0, 0), mass: 1)],
              springs: [(particles: (0, 1), stiffness: {stiffness:e})])"
        );
        let scene = MassSpringScene::from_ron(&text).unwrap();
        warnings(&scene, &bounds(&scene))
    }

    #[test]
    fn warnings_are_given_where_there_is_reason_to() {
        assert!(warned(1.0 / 60.0, 1e3).is_empty());
        assert!(warned(1.2e-9, 1e3)[0].contains("1e-9 s instead of 1.2e-9 s"));
        assert!(warned(1.0 / 60.0, 1e20)[0].contains("too stiff"));
    }
}
