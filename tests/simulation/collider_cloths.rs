//! Cloths that fall on colliders of every shape: no point of them is deep inside at any time, and they come to rest.

use std::f32::consts::FRAC_PI_2;

use bevy::math::{Quat, Vec3};
use bevy_mass_spring::solver::{Collider, Integrator, Pose, Shape, Solver, StepSettings, SubstepMode};

use crate::common::bodies::{falling, positions, velocities};
use crate::common::colliding::{Cloth, deepest_of_faces};
use crate::common::shapes::{sphere_mesh, with};

/// Of the particles, m: the cloth is twice as thick.
const RADIUS: f32 = 0.01;

fn colliders() -> Vec<(&'static str, Collider)> {
    let (vertices, triangles) = sphere_mesh(0.3, 36);
    assert!(triangles.len() > 5000);
    let shapes = [
        ("sphere", Shape::ball(0.3)),
        ("capsule", Shape::capsule(0.1, 0.3)),
        ("cuboid", Shape::cuboid(Vec3::new(0.25, 0.2, 0.15))),
        ("cone", Shape::frustum([0.3, 0.0], 0.25)),
        ("mesh", Shape::mesh(&vertices, &triangles, false).unwrap()),
    ];
    shapes
        .map(|(name, shape)| {
            let turn = if name == "capsule" { Quat::from_rotation_z(FRAC_PI_2) } else { Quat::IDENTITY };
            let pose = Pose { point: Vec3::ZERO, rotation: turn };
            (name, with(Collider::resting(shape, pose), 0.0, 0.6))
        })
        .to_vec()
}

fn explore(cells: usize, seconds: f32, scheme: Integrator, substeps: SubstepMode) {
    for (name, collider) in colliders() {
        let clock = std::time::Instant::now();
        let mut state = Solver::default();
        state.add_collider(collider.clone());
        let cloth = Cloth { cells, size: 0.9, radius: RADIUS, stiffness: 100.0, areal_density: 0.2 };
        let corner = Vec3::new(-0.45, 0.33, -0.45);
        let triangles = cloth.add(&mut state, corner, [Vec3::X, Vec3::Z]);
        let settings = StepSettings { substeps, viscosity: 5.0 * 0.2 * (0.9 / cells as f32).powi(2), ..falling(scheme, 4) };
        let mut worst = f64::NEG_INFINITY;
        let ticks = (60.0 * seconds) as u32;
        let mut before = positions(&state);
        for tick in 0..ticks {
            if tick + 30 == ticks {
                before = positions(&state);
            }
            state.step(&settings);
            if tick % 5 == 4 {
                let d = deepest_of_faces(&state, &triangles, &collider, RADIUS, 4);
                if d > worst { worst = d; println!("   tick {tick}: {:.4} mm", d * 1e3); }
            }
        }
        let moved = positions(&state).iter().zip(&before).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
        let fastest = velocities(&state).iter().map(|velocity| velocity.length()).fold(0.0, f32::max);
        let low = positions(&state).iter().map(|p| p.y).fold(f32::INFINITY, f32::min);
        println!(
            "{scheme:?} {substeps:?} {cells} {name}: worst {:.4} mm, moved {:.4} mm, fastest {:.4} mm/s, lowest {low}, {:?}, {:?}",
            worst * 1e3, moved * 1e3, fastest * 1e3, clock.elapsed(), state.plan(&settings)
        );
    }
}

#[test]
#[ignore]
fn explore_cloth() {
    let cells = std::env::var("CELLS").unwrap().parse().unwrap();
    let seconds = std::env::var("SECONDS").unwrap().parse().unwrap();
    match std::env::var("SCHEME").unwrap().as_str() {
        "auto" => explore(cells, seconds, Integrator::Auto, SubstepMode::Auto),
        "sie" => explore(cells, seconds, Integrator::SemiImplicitEuler, SubstepMode::Auto),
        "xpbd" => explore(cells, seconds, Integrator::Xpbd, SubstepMode::Fixed(16)),
        "ie" => explore(cells, seconds, Integrator::ImplicitEuler, SubstepMode::Fixed(1)),
        _ => explore(cells, seconds, Integrator::ImplicitEuler, SubstepMode::Fixed(4)),
    }
}
