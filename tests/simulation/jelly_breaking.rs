//! Jellies that break: springs go, the surface keeps its triangles.

use std::sync::Arc;

use bevy::prelude::*;
use bevy_mass_spring::nets::{Rupture, Topology, TriangleMesh, pieces, tear};
use bevy_mass_spring::prelude::*;

use super::net_breaking::{net, seen, watching};
use crate::common::run;

const SIZE: Vec3 = Vec3::new(0.4, 0.1, 0.1);

/// A bar of ballistic gelatine along x from the origin, of cells of 5 cm: a box, and a mesh that is filled.
fn bars() -> [Topology; 2] {
    let material = JellyMaterial::BALLISTIC_GELATINE;
    let cuboid = Jelly::lattice(Vec3::ZERO, SIZE, UVec3::new(8, 2, 2)).with_material(material);
    let corner = |number: u32| SIZE * UVec3::new(number & 1, number >> 1 & 1, number >> 2).as_vec3();
    let triangles = [
        [[0, 2, 3], [0, 3, 1]],
        [[4, 5, 7], [4, 7, 6]],
        [[0, 1, 5], [0, 5, 4]],
        [[2, 6, 7], [2, 7, 3]],
        [[0, 4, 6], [0, 6, 2]],
        [[1, 3, 7], [1, 7, 5]],
    ];
    let mesh = TriangleMesh::new((0..8).map(corner).collect(), triangles.concat());
    let filled = Jelly::fill_mesh(0.05).with_material(material);
    [cuboid.topology().unwrap(), filled.topology_with(&mesh).unwrap()]
}

/// Kinetic and elastic energy, J.
fn energy(net: &ParticleNet) -> f64 {
    let of_particle =
        |(velocity, mass): (&Vec3, &f32)| 0.5 * f64::from(*mass) * velocity.as_dvec3().length_squared();
    let particles = net.velocities().iter().zip(&net.topology().masses);
    let of_spring = |([one, other], spring): &([u32; 2], bevy_mass_spring::solver::Spring)| {
        let [one, other] = [one, other].map(|end| net.positions()[*end as usize].as_dvec3());
        0.5 * f64::from(spring.stiffness) * (one.distance(other) - f64::from(spring.rest_length)).powi(2)
    };
    particles.map(of_particle).sum::<f64>() + net.topology().springs.iter().map(of_spring).sum::<f64>()
}

/// Held at one end and pulled at the other by twice what its cross-section bears: it comes apart. No particle is split, no
/// mass is lost, all triangles of the surface stay, and once nothing pulls no energy comes in.
#[test]
fn a_jelly_comes_apart_without_tearing_its_surface() {
    for (kind, topology) in ["box", "filled mesh"].into_iter().zip(bars()) {
        assert!(topology.is_solid());
        let first = topology.clone();
        let along = || first.positions.iter().map(|place| place.x);
        let ends = [along().fold(f32::MAX, f32::min), along().fold(f32::MIN, f32::max)];
        let ends: [Vec<u32>; 2] = ends.map(|x| {
            let numbered = (0..).zip(&first.positions);
            numbered.filter(|(_, place)| (place.x - x).abs() < 0.01).map(|(number, _)| number).collect()
        });
        let mut app = watching();
        app.world_mut().resource_mut::<Environment>().gravity_enabled = false;
        let held = ParticleNet::new(Arc::new(topology), &Transform::IDENTITY).with_pinned(ends[0].clone());
        let jelly = app.world_mut().spawn((held, Breaking { strain: Some(0.5), ..default() })).id();
        run(&mut app, 1);
        // E ε A
        let pull = 2.0 * 1e5 * 0.5 * SIZE.y * SIZE.z;
        for end in &ends[1] {
            let share = Vec3::X * (pull / ends[1].len() as f32);
            app.world_mut().get_mut::<ParticleNet>(jelly).unwrap().applied_forces_mut()[*end as usize] =
                share;
        }
        let is_apart = |app: &App| {
            let piece = pieces(net(app, jelly).topology());
            piece[ends[0][0] as usize] != piece[ends[1][0] as usize]
        };
        let ticks = (0..60).take_while(|_| {
            run(&mut app, 1);
            !is_apart(&app)
        });
        assert!(ticks.count() < 60, "{kind}: it comes apart");
        app.world_mut().get_mut::<ParticleNet>(jelly).unwrap().clear_applied_forces();
        let before = energy(net(&app, jelly));
        for _ in 0..60 {
            run(&mut app, 1);
            let net = net(&app, jelly);
            assert!(net.positions().iter().chain(net.velocities()).all(|vector| vector.is_finite()));
        }
        let net = net(&app, jelly);
        // Semi-implicit Euler keeps the energy within a percent or two at 19 substeps.
        assert!(energy(net) <= 1.02 * before, "{kind}: {} J of {before} J", energy(net));
        assert_eq!(net.topology().masses, first.masses, "{kind}");
        assert_eq!(net.topology().triangles, first.triangles, "{kind}");
        assert_eq!(net.len(), first.positions.len(), "{kind}");
        assert_eq!(
            seen(&app).last().unwrap().pieces.map(|count| count as usize),
            Some(net.pieces()),
            "{kind}"
        );
        assert!(net.positions()[ends[1][0] as usize].x > 1.0, "{kind}: it flies off");
    }
}

/// A spring along the surface of a solid goes as one inside does.
#[test]
fn tears_of_solids_split_nothing() {
    for topology in bars() {
        let mut net = topology.clone();
        let (mut positions, mut velocities) = (net.positions.clone(), vec![Vec3::ZERO; net.positions.len()]);
        for spring in 0..topology.springs.len() as u32 {
            let rupture = Rupture { spring, elongation: 0.01 };
            let tear = tear(&mut net, &mut positions, &mut velocities, &[rupture]);
            assert!(tear.splits.is_empty() && tear.held.is_empty());
            assert_eq!(net.springs[spring as usize].1.stiffness, 0.0);
        }
        assert_eq!(positions, topology.positions);
        assert_eq!((&net.masses, &net.triangles), (&topology.masses, &topology.triangles));
        let piece = pieces(&net);
        assert_eq!(piece.iter().max(), Some(&(positions.len() as u32 - 1)), "every particle by itself");
    }
}
