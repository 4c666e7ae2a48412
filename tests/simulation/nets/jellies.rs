//! Jellies: bars along an axis and across, beams, meshes.

use bevy::math::{DVec3, UVec3, Vec3};
use bevy_mass_spring::nets::{Balloon, Jelly, JellyMaterial, MeshBinding, Topology, TriangleMesh};

use super::statics::{Statics, mean_strain, uniaxial};

const E: f64 = 1e5;

fn material() -> JellyMaterial {
    JellyMaterial { density: 1e3, youngs_modulus: E as f32, retardation_time: 0.0 }
}

fn block(size: Vec3, cells: UVec3) -> Topology {
    Jelly::lattice(Vec3::ZERO, size, cells).with_material(material()).topology().expect("sound")
}

/// The area vector of the surface at each particle, m².
fn surface(size: DVec3, cells: UVec3) -> Vec<DVec3> {
    let counts = cells.to_array();
    let step = size / cells.as_dvec3();
    let side =
        |index: u32, count: u32| f64::from(u32::from(index == count)) - f64::from(u32::from(index == 0));
    let part = |index: u32, count: u32| if index == 0 || index == count { 0.5 } else { 1.0 };
    let mut areas = Vec::new();
    for k in 0..=counts[2] {
        for j in 0..=counts[1] {
            for i in 0..=counts[0] {
                let [x, y, z] = [part(i, counts[0]), part(j, counts[1]), part(k, counts[2])];
                areas.push(DVec3::new(
                    side(i, counts[0]) * y * z * step.y * step.z,
                    side(j, counts[1]) * x * z * step.x * step.z,
                    side(k, counts[2]) * x * y * step.x * step.y,
                ));
            }
        }
    }
    areas
}

/// Young's modulus along a direction, and Poisson's ratio there, of a block under a uniaxial stress.
fn pulled(net: &Topology, areas: &[DVec3], volume: f64, direction: DVec3) -> (f64, f64) {
    let mut statics = Statics::new(net);
    let stress = uniaxial(1.0, direction);
    for (force, area) in statics.forces.iter_mut().zip(areas) {
        *force = stress * *area;
    }
    let strain = mean_strain(&statics.solve(), areas, volume);
    let along = direction.dot(strain * direction);
    let trace = strain.x_axis.x + strain.y_axis.y + strain.z_axis.z;
    (1.0 / along, 0.5 * (along - trace) / along)
}

#[test]
fn a_bar_pulled_along_an_axis_lengthens_alike_at_every_resolution() {
    for count in [2, 4, 8, 16] {
        let cells = UVec3::new(count, 2 * count, count);
        let size = DVec3::new(1.0, 2.0, 1.0);
        let net = block(size.as_vec3(), cells);
        let (modulus, ratio) = pulled(&net, &surface(size, cells), 2.0, DVec3::Y);
        assert!((modulus / E - 1.0).abs() < 0.015, "{count}: {modulus}");
        assert!((ratio - 0.25).abs() < 0.005, "{count}: {ratio}");
    }
}

#[test]
fn a_block_pulled_along_a_diagonal_lengthens_as_along_an_axis() {
    for count in [2, 4, 16] {
        let cells = UVec3::splat(count);
        let net = block(Vec3::ONE, cells);
        let areas = surface(DVec3::ONE, cells);
        for direction in [DVec3::new(1.0, 1.0, 0.0), DVec3::ONE, DVec3::new(3.0, 1.0, 2.0)] {
            let (modulus, ratio) = pulled(&net, &areas, 1.0, direction.normalize());
            assert!((modulus / E - 1.0).abs() < 0.02, "{count}, {direction}: {modulus}");
            assert!((ratio - 0.25).abs() < 0.02, "{count}, {direction}: {ratio}");
        }
    }
}

#[test]
fn cells_that_are_no_cubes_make_the_same_jelly() {
    let (size, cells) = (DVec3::new(1.0, 1.0, 0.5), UVec3::splat(8));
    let net = block(size.as_vec3(), cells);
    let areas = surface(size, cells);
    for direction in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE.normalize()] {
        let (modulus, ratio) = pulled(&net, &areas, 0.5, direction);
        assert!((modulus / E - 1.0).abs() < 0.03, "{direction}: {modulus}");
        assert!((ratio - 0.25).abs() < 0.02, "{direction}: {ratio}");
    }
}

/// F l³ / (3 E I) + F l / (κ G A), κ = 10 (1 + ν) / (12 + 11 ν) (Cowper 1966), G = 2/5 E.
#[test]
fn a_slender_beam_bends_as_timoshenko_says() {
    for count in [3, 4, 6] {
        let cells = UVec3::new(10 * count, count, count);
        let net = block(Vec3::new(10.0, 1.0, 1.0), cells);
        let mut beam = Statics::new(&net);
        let areas = surface(DVec3::new(10.0, 1.0, 1.0), cells);
        for (number, area) in areas.iter().enumerate() {
            let x = net.positions[number].x;
            if x == 0.0 {
                beam.free[number] = DVec3::ZERO;
            } else if x == 10.0 {
                beam.forces[number] = DVec3::Y * area.x;
            }
        }
        let displacements = beam.solve();
        let tip = areas.iter().enumerate().filter(|(number, _)| net.positions[*number].x == 10.0);
        let found: f64 = tip.map(|(number, area)| displacements[number].y * area.x).sum();
        let expected = 1000.0 * 12.0 / (3.0 * E) + 10.0 * (12.0 + 2.75) / (12.5 * 0.4 * E);
        assert!((found / expected - 1.0).abs() < 0.01, "{count} cells: {}", found / expected);
    }
}

fn ball() -> (TriangleMesh, f64) {
    let net = Balloon::default().with_subdivisions(3).topology().expect("sound");
    let of_triangle = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|corner| net.positions[corner as usize].as_dvec3());
        a.dot(b.cross(c)) / 6.0
    };
    let volume = net.triangles.iter().map(of_triangle).sum();
    (TriangleMesh::new(net.positions, net.triangles), volume)
}

/// A filled mesh has its mass and its centre, and carries its vertices where they were.
#[test]
fn a_mesh_is_filled_and_hangs_in_its_cells() {
    let (mesh, volume) = ball();
    let net = Jelly::fill_mesh(0.15).with_material(material()).topology_with(&mesh).expect("sound");
    let mass: f64 = net.masses.iter().map(|mass| f64::from(*mass)).sum();
    assert!((mass / (1e3 * volume) - 1.0).abs() < 1e-5);
    let moment: DVec3 =
        net.positions.iter().zip(&net.masses).map(|(place, mass)| place.as_dvec3() * f64::from(*mass)).sum();
    assert!((moment / mass).length() < 0.002, "{}", moment / mass);
    let Some(MeshBinding::Skinned(skin)) = &net.binding else { panic!("a skin") };
    for (vertex, (particles, [a, b, c])) in mesh.positions.iter().zip(skin) {
        let weights = [*a, *b, *c, 1.0 - a - b - c];
        assert!(weights.iter().all(|weight| weight.abs() < 1.5), "{weights:?}");
        let parts = particles.iter().zip(weights);
        let place: Vec3 = parts.map(|(particle, weight)| net.positions[*particle as usize] * weight).sum();
        assert!(place.distance(*vertex) < 1e-6);
    }
}

#[test]
fn recipes_that_cannot_be_are_refused_by_name() {
    let message = |jelly: Jelly| jelly.topology().expect_err("refused").to_string();
    assert_eq!(message(Jelly::lattice(Vec3::ONE, Vec3::ONE, UVec3::ONE)), "max − min has no volume");
    let none = Jelly::lattice(Vec3::ZERO, Vec3::ONE, UVec3::new(1, 1, 0));
    assert_eq!(message(none), "cells.z is 0, expected 1 to 2097152");
    assert_eq!(
        message(Jelly::default().with_spacing(1e-4)),
        "cells in all is 1000000000000, expected 1 to 2097152"
    );
    let (mut mesh, _) = ball();
    mesh.triangles.pop();
    let refused = Jelly::fill_mesh(0.2).topology_with(&mesh).expect_err("refused").to_string();
    assert!(refused.starts_with("the mesh is open: one triangle only is between vertices "), "{refused}");
}
