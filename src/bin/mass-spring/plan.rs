//! How a scene would be simulated, known before any tick has run.

use std::sync::Arc;

use bevy::math::Vec3;
use bevy_mass_spring::SubstepMode;
use bevy_mass_spring::nets::{ParticleNet, Topology};
use bevy_mass_spring::scene::{MassSpringScene, SceneBend, SceneLayout, SceneNet, SceneSolver, SceneSpring};
use bevy_mass_spring::solver::{
    Bend, Gas, MAX_SUBSTEPS, Plan, Solver, Spring, StepSettings, enclosed_volume,
};

use crate::numbering::Numbering;

/// A scene and its nets, laid out.
pub struct Content<'a> {
    pub scene: &'a MassSpringScene,
    layout: SceneLayout,
    /// At the start.
    nets: Vec<ParticleNet>,
}

impl<'a> Content<'a> {
    /// Of a scene that is valid.
    pub fn new(scene: &'a MassSpringScene) -> Self {
        let layout = scene.layout().expect("the scene is valid");
        let net = |(topology, net): (&Topology, &SceneNet)| {
            ParticleNet::laid_out(Arc::new(topology.clone()), |place| place)
                .with_pinned(net.pinned().iter().copied())
        };
        let nets = layout.topologies.iter().zip(&scene.nets).map(net).collect();
        Self { scene, layout, nets }
    }

    /// The nets at the start.
    pub fn nets(&self) -> &[ParticleNet] {
        &self.nets
    }

    /// The particles, springs and bends in the solver alone: each particle of the list with the position and velocity of
    /// `state`, and the nets as they are.
    pub fn solver(&self, state: impl Fn(usize) -> [Vec3; 2], nets: &[&ParticleNet]) -> Solver {
        let mut solver = Solver::default();
        for (index, particle) in self.scene.particles.iter().enumerate() {
            let [position, velocity] = state(index);
            let mass = if particle.pinned { f32::INFINITY } else { particle.mass };
            solver.add_particle(position, velocity, mass, particle.radius).expect("the scene is valid");
        }
        let numbering = Numbering::new(self.scene, nets.iter().map(|net| net.len()));
        numbering.for_each(|net, particle| {
            let net = nets[net];
            let (position, velocity) = (net.positions()[particle], net.velocities()[particle]);
            let is_pinned = net.is_pinned(particle as u32);
            let mass = if is_pinned { f32::INFINITY } else { net.masses()[particle] };
            solver.add_particle(position, velocity, mass, net.radius()).expect("the net is valid");
        });
        self.add_elements(&mut solver);
        for (index, net) in nets.iter().enumerate() {
            add_net(&mut solver, net, |particle| numbering.number(index, particle as usize));
        }
        solver
    }

    fn add_elements(&self, solver: &mut Solver) {
        for spring in &self.scene.springs {
            let rest_length = self.layout.rest_length(spring).unwrap_or_default();
            let SceneSpring { stiffness, damping, tension_only, max_stretch, breaking_force, .. } = *spring;
            let elastic = Spring::elastic(rest_length, stiffness, damping);
            let parameters = Spring { tension_only, max_stretch, breaking_force, ..elastic };
            solver.add_spring(spring.particles.into(), parameters).expect("the scene is valid");
        }
        for &SceneBend { particles: (first, middle, last), stiffness, damping } in &self.scene.bends {
            let bend = Bend { rest_length: 0.0, stiffness, damping, weights: [1.0, -2.0, 1.0] };
            solver.add_rod([first, middle, last], bend).expect("the scene is valid");
        }
    }

    /// The same at the start.
    pub fn initial_solver(&self) -> Solver {
        let particles = &self.scene.particles;
        let nets: Vec<&ParticleNet> = self.nets.iter().collect();
        self.solver(|index| [particles[index].position, particles[index].velocity], &nets)
    }
}

/// Adds the elements of a net.
fn add_net(solver: &mut Solver, net: &ParticleNet, number: impl Fn(u32) -> usize) {
    let topology = net.topology();
    let first = solver.spring_count();
    for (ends, spring) in &topology.springs {
        solver.add_spring(ends.map(&number), *spring).expect("the net is valid");
    }
    net.broken().iter().for_each(|spring| solver.remove_spring(first + *spring as usize));
    for (ends, rod) in &topology.rods {
        solver.add_rod(ends.map(&number), *rod).expect("the net is valid");
    }
    for (ends, hinge) in &topology.hinges {
        solver.add_hinge(ends.map(&number), *hinge).expect("the net is valid");
    }
    if let Some(pressure) = topology.pressure {
        let place = |particle: u32| topology.positions[particle as usize];
        let rest_volume = enclosed_volume(&topology.triangles, place) as f32;
        let triangles: Vec<[usize; 3]> =
            topology.triangles.iter().map(|corners| corners.map(&number)).collect();
        // What has torn open encloses nothing.
        let _ = solver.add_gas(&triangles, Gas { pressure, rest_volume });
    }
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
        warnings(&scene, &mut Content::new(&scene).initial_solver())
    }

    #[test]
    fn warnings_are_given_where_there_is_reason_to() {
        assert!(warned(1.0 / 60.0, 1e3).is_empty());
        assert!(warned(1.2e-9, 1e3)[0].contains("1e-9 s instead of 1.2e-9 s"));
        assert!(warned(1.0 / 60.0, 1e20)[0].contains("too stiff"));
    }
}
