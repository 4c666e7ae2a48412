//! How a scene would be simulated, known before any tick has run.

use bevy::math::Vec3;
use bevy_mass_spring::SubstepMode;
use bevy_mass_spring::scene::{MassSpringScene, SceneBend, SceneSolver, SceneSpring};
use bevy_mass_spring::solver::{Bend, MAX_SUBSTEPS, Plan, Solver, Spring, StepSettings};

/// The particles, springs and bends of a scene in the solver alone, each particle with the position and velocity of `state`.
pub fn solver(scene: &MassSpringScene, state: impl Fn(usize) -> [Vec3; 2]) -> Solver {
    let mut solver = Solver::default();
    for (index, particle) in scene.particles.iter().enumerate() {
        let [position, velocity] = state(index);
        let mass = if particle.pinned { f32::INFINITY } else { particle.mass };
        solver.add_particle(position, velocity, mass, particle.radius).expect("the scene is valid");
    }
    for spring in &scene.springs {
        let rest_length = scene.rest_length(spring).unwrap_or_default();
        let SceneSpring { stiffness, damping, tension_only, max_stretch, breaking_force, .. } = *spring;
        let elastic = Spring::elastic(rest_length, stiffness, damping);
        let parameters = Spring { tension_only, max_stretch, breaking_force, ..elastic };
        solver.add_spring(spring.particles.into(), parameters).expect("the scene is valid");
    }
    for &SceneBend { particles: (first, middle, last), stiffness, damping } in &scene.bends {
        let bend = Bend { rest_length: 0.0, stiffness, damping, weights: [1.0, -2.0, 1.0] };
        solver.add_rod([first, middle, last], bend).expect("the scene is valid");
    }
    solver
}

/// The same with the positions and velocities of the scene.
pub fn initial_solver(scene: &MassSpringScene) -> Solver {
    solver(scene, |index| [scene.particles[index].position, scene.particles[index].velocity])
}

/// What the settings of the scene amount to.
pub fn plan(scene: &MassSpringScene, solver: &mut Solver) -> Plan {
    let SceneSolver { integrator, substeps, time_step } = scene.solver;
    let viscosity = scene.environment.effective_viscosity();
    let settings = StepSettings {
        integrator,
        substeps,
        time_step: time_step as f32,
        viscosity,
        ..StepSettings::default()
    };
    solver.plan(&settings)
}

/// What a user should know before relying on the results.
pub fn warnings(scene: &MassSpringScene, solver: &mut Solver) -> Vec<String> {
    let mut warnings = Vec::new();
    let time_step = scene.solver.time_step;
    let tick = scene.solver.tick().map_or(time_step, |tick| tick.as_secs_f64());
    if (tick - time_step).abs() > 1e-5 * time_step {
        warnings.push(format!(
            "Bevy's clock counts whole nanoseconds: a tick is {tick:e} s instead of {time_step:e} s"
        ));
    }
    let Plan { integrator, substeps, .. } = plan(scene, solver);
    if scene.solver.substeps == SubstepMode::Auto && substeps == MAX_SUBSTEPS {
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
        warnings(&scene, &mut initial_solver(&scene))
    }

    #[test]
    fn warnings_are_given_where_there_is_reason_to() {
        assert!(warned(1.0 / 60.0, 1e3).is_empty());
        assert!(warned(1.2e-9, 1e3)[0].contains("1e-9 s instead of 1.2e-9 s"));
        assert!(warned(1.0 / 60.0, 1e20)[0].contains("too stiff"));
    }
}
