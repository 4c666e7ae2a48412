//! What collisions of surfaces keep: momentum, and the bits.

use bevy::math::{DVec3, Quat, UVec2, Vec3};
use bevy_mass_spring::nets::{Cloth, ClothMaterial, Rope, RopeMaterial};
use bevy_mass_spring::solver::{Collider, Integrator, PairRules, Solver, StepSettings, SubstepMode};

use super::{ELASTIC, SCHEMES, SOFT};
use crate::common::bodies::{add_net, solver_bits};

/// Two small cloths, a rope and a ball that meet in the void.
fn meeting(integrator: Integrator) -> Solver {
    let is_explicit = integrator == Integrator::SemiImplicitEuler;
    let cloth_material = if is_explicit { SOFT } else { ClothMaterial::COTTON };
    let rope_material = if is_explicit { ELASTIC } else { RopeMaterial::HEMP };
    let mut solver = Solver::default();
    for (height, turn, speed) in [(0.0, 0.0, 1.0), (0.08, 0.7, -1.0)] {
        let first = solver.particle_count();
        let corner = Vec3::new(-0.2, 0.0, -0.2);
        let cloth = Cloth::grid(corner, Vec3::X * 0.4, Vec3::Z * 0.4, UVec2::splat(8)).with_radius(0.005);
        let mut topology = cloth.with_material(cloth_material).topology().unwrap();
        topology.positions.iter_mut().for_each(|place| *place = Quat::from_rotation_y(turn) * *place);
        add_net(&mut solver, &topology, Vec3::Y * height, &[]);
        for slot in first..solver.particle_count() {
            let place = solver.position(slot);
            solver.set_velocity(slot, Vec3::new(0.2 * speed, speed, 0.3 * place.x));
        }
    }
    let first = solver.particle_count();
    let rope = Rope::between(Vec3::new(-0.3, 0.16, 0.02), Vec3::new(0.3, 0.16, 0.02)).with_segments(10);
    let rope = rope.with_radius(0.005).with_material(rope_material).topology().unwrap();
    add_net(&mut solver, &rope, Vec3::ZERO, &[]);
    (first..solver.particle_count()).for_each(|slot| solver.set_velocity(slot, Vec3::NEG_Y * 3.0));
    solver.add_particle(Vec3::new(0.05, -0.15, 0.03), Vec3::Y * 4.0, 0.02, 0.03).unwrap();
    solver
}

fn settings(integrator: Integrator, friction: f32) -> StepSettings {
    StepSettings {
        integrator,
        substeps: SubstepMode::Fixed(if integrator == Integrator::SemiImplicitEuler { 8 } else { 2 }),
        time_step: 1.0 / 120.0,
        pair_rules: Some(PairRules { restitution: 0.3, friction }),
        ..StepSettings::default()
    }
}

fn momenta(solver: &Solver) -> [DVec3; 2] {
    let mut sums = [DVec3::ZERO; 2];
    for slot in 0..solver.particle_count() {
        let momentum = solver.velocity(slot).as_dvec3() / f64::from(solver.inverse_mass(slot));
        sums[0] += momentum;
        sums[1] += solver.position(slot).as_dvec3().cross(momentum);
    }
    sums
}

#[test]
fn momentum_is_what_it_was() {
    for integrator in SCHEMES {
        let mut solver = meeting(integrator);
        let before = momenta(&solver);
        let scale: f32 = (0..solver.particle_count())
            .map(|slot| solver.velocity(slot).length() / solver.inverse_mass(slot))
            .sum();
        let mut touched = 0;
        for _ in 0..40 {
            solver.step(&settings(integrator, 0.4));
            touched += solver.outputs().contact_count;
        }
        let after = momenta(&solver);
        assert!(touched > 50, "{integrator}: {touched} contacts");
        let drift = (after[0] - before[0]).length() / f64::from(scale);
        // f32: a rounding a contact and substep at most.
        assert!(drift < 1e-5, "{integrator}: {drift}");
    }
}

#[test]
fn all_but_the_state_is_a_cache() {
    for integrator in SCHEMES {
        let settings = StepSettings { gravity: Vec3::NEG_Y * 9.81, ..settings(integrator, 0.4) };
        let with_ground = || {
            let mut solver = meeting(integrator);
            solver.add_collider(Collider::half_space(Vec3::NEG_Y * 0.3, Vec3::Y, 0.0, 0.4));
            solver
        };
        let (mut kept, mut dropped) = (with_ground(), with_ground());
        let mut middle = None;
        for tick in 0..60 {
            if tick == 30 {
                middle = Some(kept.state().clone());
            }
            kept.step(&settings);
            dropped.drop_caches();
            dropped.step(&settings);
            assert_eq!(solver_bits(&kept), solver_bits(&dropped), "{integrator}, tick {tick}");
        }
        let end = solver_bits(&kept);
        kept.restore(middle.unwrap());
        (30..60).for_each(|_| {
            kept.step(&settings);
        });
        assert_eq!(solver_bits(&kept), end, "{integrator}: put back");
    }
}
