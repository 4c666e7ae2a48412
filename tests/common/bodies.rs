//! Balls and planes in the pure solver.

use bevy::math::Vec3;
use bevy_mass_spring::nets::{Layout, Topology};
use bevy_mass_spring::solver::{
    Collider, Face, Filament, Gas, Integrator, PairRules, Solver, StepSettings, SubstepMode, enclosed_volume,
};

/// The acceleration of gravity in these tests, m/s².
pub const GRAVITY: f32 = 9.81;

/// A ball: mass in kg, radius in m.
#[derive(Debug, Clone, Copy)]
pub struct Ball {
    pub mass: f32,
    pub radius: f32,
    pub position: Vec3,
    pub velocity: Vec3,
}

impl Ball {
    /// A ball of 1 kg and 0.1 m at rest.
    pub fn at(position: Vec3) -> Self {
        Self { mass: 1.0, radius: 0.1, position, velocity: Vec3::ZERO }
    }
}

/// A world of balls, without planes.
pub fn world(balls: impl IntoIterator<Item = Ball>) -> Solver {
    let mut state = Solver::default();
    for Ball { mass, radius, position, velocity } in balls {
        state.add_particle(position, velocity, mass, radius).unwrap();
    }
    state
}

/// Adds the ground, y = 0.
pub fn with_ground(mut state: Solver, restitution: f32, friction: f32) -> Solver {
    state.add_collider(Collider::half_space(Vec3::ZERO, Vec3::Y, restitution, friction));
    state
}

/// Ticks of 1/60 s under gravity; no ball collides with another.
pub fn falling(scheme: Integrator, substeps: u32) -> StepSettings {
    StepSettings {
        integrator: scheme,
        substeps: SubstepMode::Fixed(substeps),
        gravity: Vec3::NEG_Y * GRAVITY,
        ..StepSettings::default()
    }
}

/// Ticks of 1/60 s without gravity; balls collide.
pub fn floating(scheme: Integrator, restitution: f32) -> StepSettings {
    let pair_rules = Some(PairRules { restitution, friction: 0.0 });
    StepSettings {
        substeps: SubstepMode::Fixed(1),
        integrator: scheme,
        pair_rules,
        ..StepSettings::default()
    }
}

/// Steps until something has touched, at most `ticks` ticks.
pub fn step_past_contact(state: &mut Solver, settings: &StepSettings, ticks: u32) {
    state.outputs_mut().record_contacts = true;
    for _ in 0..ticks {
        state.step(settings);
        if !state.outputs().contacts.is_empty() {
            return;
        }
    }
    panic!("nothing touched within {ticks} ticks");
}

/// The positions of all particles.
pub fn positions(state: &Solver) -> Vec<Vec3> {
    (0..state.particle_count()).map(|slot| state.position(slot)).collect()
}

/// The velocities of all particles.
pub fn velocities(state: &Solver) -> Vec<Vec3> {
    (0..state.particle_count()).map(|slot| state.velocity(slot)).collect()
}

/// The bits of all positions and velocities.
pub fn solver_bits(state: &Solver) -> Vec<u32> {
    let vectors = positions(state).into_iter().chain(velocities(state));
    vectors.flat_map(|vector| vector.to_array()).map(f32::to_bits).collect()
}

pub fn position(state: &Solver, slot: usize) -> Vec3 {
    state.position(slot)
}

pub fn velocity(state: &Solver, slot: usize) -> Vec3 {
    state.velocity(slot)
}

/// Adds a net about a place, with all that its recipe says; some of its particles are pinned.
pub fn add_net(solver: &mut Solver, topology: &Topology, place: Vec3, pinned: &[u32]) {
    let first = solver.particle_count();
    for ((number, position), mass) in (0..).zip(&topology.positions).zip(&topology.masses) {
        let mass = if pinned.contains(&number) { f32::INFINITY } else { *mass };
        solver.add_particle(place + *position, Vec3::ZERO, mass, topology.radius).unwrap();
    }
    for (ends, spring) in &topology.springs {
        let ends = ends.map(|end| first + end as usize);
        solver.add_spring(ends, *spring).unwrap();
        if matches!(topology.layout, Layout::Rope { .. }) {
            let filament = Filament { diameter: 2.0 * topology.radius, drag: topology.air.drag };
            solver.add_filament(ends, filament).unwrap();
        }
    }
    for (ends, rod) in &topology.rods {
        solver.add_rod(ends.map(|end| first + end as usize), *rod).unwrap();
    }
    for (ends, hinge) in &topology.hinges {
        solver.add_hinge(ends.map(|end| first + end as usize), *hinge).unwrap();
    }
    let face = Face { drag: topology.air.drag, lift: topology.air.lift };
    let triangles: Vec<[usize; 3]> =
        topology.triangles.iter().map(|corners| corners.map(|corner| first + corner as usize)).collect();
    for triangle in &triangles {
        solver.add_face(*triangle, face).unwrap();
    }
    if let Some(pressure) = topology.pressure {
        let at_rest = |corner| topology.positions[corner as usize];
        let rest_volume = enclosed_volume(&topology.triangles, at_rest) as f32;
        solver.add_gas(&triangles, Gas { pressure, rest_volume }).unwrap();
    }
}
