//! Nets that rebound from each other under explicit schemes gain no energy.

use bevy::math::{Quat, UVec2, Vec3};
use bevy_mass_spring::nets::{Cloth, ClothMaterial, Rope, RopeMaterial, Topology};
use bevy_mass_spring::solver::{Integrator, PairRules, Solver, StepSettings, SubstepMode};

use super::{ELASTIC, SOFT};
use crate::common::bodies::add_net;

const EXPLICIT: [Integrator; 3] =
    [Integrator::SemiImplicitEuler, Integrator::VelocityVerlet, Integrator::RungeKutta4];

/// A cloth of 4² cells of 5 cm that is not damped.
fn cloth() -> Topology {
    let material = ClothMaterial { bending_stiffness: 0.0, retardation_time: 0.0, ..SOFT };
    let corner = Vec3::new(-0.1, 0.0, -0.1);
    let cloth = Cloth::grid(corner, Vec3::X * 0.2, Vec3::Z * 0.2, UVec2::splat(4));
    cloth.with_radius(0.005).with_material(material).topology().unwrap()
}

/// A rope of 8 links of 5 cm that is not damped.
fn rope() -> Topology {
    let material = RopeMaterial { retardation_time: 0.0, ..ELASTIC };
    let rope = Rope::between(Vec3::X * -0.2, Vec3::X * 0.2).with_segments(8);
    rope.with_radius(0.005).with_material(material).topology().unwrap()
}

/// Two of them, turned and askew, that meet at a speed in m/s.
fn meeting(net: &Topology, speed: f32, seed: u32) -> Solver {
    let part = |scale: u32| ((seed + 1) * scale % 101) as f32 / 101.0 - 0.5;
    let mut solver = Solver::default();
    for side in [-1.0, 1.0_f32] {
        let first = solver.particle_count();
        let mut turned = net.clone();
        let turn = Quat::from_rotation_y(1.0 + side) * Quat::from_rotation_z(0.3 * side * part(13));
        turned.positions.iter_mut().for_each(|place| *place = turn * *place);
        let aside = Vec3::new(0.1 * part(29), 0.05, 0.1 * part(37));
        add_net(&mut solver, &turned, aside * side, &[]);
        for slot in first..solver.particle_count() {
            solver.set_velocity(slot, Vec3::NEG_Y * (0.5 * speed * side));
        }
    }
    solver
}

/// The most energy in the ticks of half a second, as a part of that at the start, and whether they touched.
fn most_energy(mut solver: Solver, integrator: Integrator, restitution: f32, step: f32) -> (f64, bool) {
    let settings = StepSettings {
        integrator,
        substeps: SubstepMode::Fixed(1),
        time_step: step,
        pair_rules: Some(PairRules { restitution, friction: 0.0 }),
        ..StepSettings::default()
    };
    let energy = |solver: &Solver| {
        let measured = solver.measure(Vec3::ZERO);
        measured.kinetic_energy + measured.elastic_energy
    };
    let start = energy(&solver);
    let (mut most, mut touched) = (start, false);
    for _ in 0..(0.5 / step) as u32 {
        solver.step(&settings);
        touched |= solver.outputs().contact_count > 0;
        most = most.max(energy(&solver));
    }
    (most / start, touched)
}

/// By how much more than is conserved may show, of what moves at ω with the substep h = `product` / ω: see `response.rs` for semi-implicit
/// Euler; velocity Verlet conserves E (1 − (hω/2)²) of the elastic energy at least (Hairer, Lubich and Wanner, *Geometric Numerical
/// Integration*, 2006, section I.1.4). A tenth more for where the impacts are put.
fn limit(integrator: Integrator, product: f32) -> f64 {
    let half = f64::from(0.5 * product);
    1.1 * match integrator {
        Integrator::SemiImplicitEuler => (1.0 + half) / (1.0 - half),
        Integrator::VelocityVerlet => 1.0 / (1.0 - half * half),
        _ => 1.0,
    }
}

#[test]
fn nets_that_bounce_gain_no_energy() {
    for (net, name) in [(cloth(), "cloths"), (rope(), "ropes")] {
        let frequency = meeting(&net, 1.0, 0).frequency_bounds(0.0).angular_frequency as f32;
        for integrator in EXPLICIT {
            for (restitution, speeds) in [(0.9, [1.0, 10.0, 100.0, 317.0]), (1.0, [1.0, 3.0, 10.0, 30.0])] {
                for product in [0.3, 0.9] {
                    for (speed, seed) in speeds.into_iter().zip(1..) {
                        let solver = meeting(&net, speed, seed);
                        let step = product / frequency;
                        let (most, touched) = most_energy(solver, integrator, restitution, step);
                        let case =
                            format!("{name}, {integrator}, ε {restitution}, hω {product}, {speed} m/s");
                        assert!(touched && most < limit(integrator, product), "{case}: {most}");
                    }
                }
            }
        }
    }
}
