//! Plastic nets.

mod kept;
mod upkeep;

use bevy::prelude::*;
use bevy_mass_spring::nets::{Part, PartOf, Topology};
use bevy_mass_spring::prelude::*;
use bevy_mass_spring::solver::Integrator;

use crate::common::{app, run, scheme};

/// Every scheme that is stable, and `Auto`, with as many substeps as the nets of these tests need; those of 0 find out.
const SCHEMES: [(Integrator, u32); 7] = [
    (Integrator::Auto, 0),
    (Integrator::SemiImplicitEuler, 0),
    (Integrator::SecondOrderTaylor, 0),
    (Integrator::VelocityVerlet, 0),
    (Integrator::RungeKutta4, 0),
    (Integrator::ImplicitEuler, 4),
    (Integrator::TrBdf2, 4),
];

/// An app without gravity and contacts.
fn lab(scheme_of: (Integrator, u32)) -> App {
    let mut app = app();
    app.insert_resource(match scheme_of {
        (integrator, 0) => SolverSettings { integrator, substeps: SubstepMode::Auto },
        (integrator, substeps) => scheme(integrator, substeps),
    });
    app.world_mut().resource_mut::<Environment>().gravity_enabled = false;
    let mut collisions = app.world_mut().resource_mut::<CollisionSettings>();
    (collisions.ground, collisions.particles) = (false, false);
    app
}

fn net(app: &App, entity: Entity) -> &ParticleNet {
    app.world().get::<ParticleNet>(entity).expect("it is a net")
}

fn strains(topology: &Topology) -> Vec<f32> {
    let strain = |spring: &bevy_mass_spring::solver::Spring| spring.plasticity.map_or(0.0, |of| of.strain);
    topology.springs.iter().map(|(_, spring)| strain(spring)).collect()
}

/// From 0 to 1 in the course of `ticks`, with a speed of 0 at both ends.
fn smooth(tick: u32, ticks: u32) -> f32 {
    let share = (tick as f32 / ticks as f32).min(1.0);
    share * share * (3.0 - 2.0 * share)
}

const EA: f32 = 1e3;

/// A rope of 1 m along x; waves run along it at 100 m/s.
fn wire(segments: u32) -> Rope {
    Rope::between(Vec3::ZERO, Vec3::X).with_segments(segments).with_material(RopeMaterial {
        linear_density: 0.1,
        stretch_stiffness: EA,
        bending_stiffness: 0.0,
        retardation_time: 2e-4,
    })
}

fn spawn_wire(app: &mut App, rope: impl Bundle) -> [Entity; 2] {
    let rope = app.world_mut().spawn(rope).id();
    app.world_mut().spawn((PartOf(rope), Part::Start, Pinned));
    [rope, app.world_mut().spawn((PartOf(rope), Part::End, Pinned, Transform::from_xyz(1.0, 0.0, 0.0))).id()]
}

/// Pulls the end on to `length`.
fn move_end(app: &mut App, end: Entity, length: f32) {
    let start = app.world().get::<Transform>(end).unwrap().translation.x;
    for tick in 1..=64 {
        let x = start + (length - start) * smooth(tick, 64);
        app.world_mut().get_mut::<Transform>(end).unwrap().translation = Vec3::X * x;
        run(app, 1);
    }
    run(app, 16);
}
