//! Cloths: stretching along the grid and across it, bending, meshes.

use bevy::math::{DVec3, UVec2, Vec3};
use bevy_mass_spring::nets::{Cloth, ClothMaterial, MeshBinding, Topology, TriangleMesh};

use super::statics::{Statics, mean_strain, uniaxial};

const K: f64 = 1e3;
const G: f64 = 3e2;
const D: f64 = 2.0;

fn material() -> ClothMaterial {
    ClothMaterial {
        area_density: 0.2,
        stretch_stiffness: K as f32,
        shear_stiffness: G as f32,
        bending_stiffness: 0.0,
        retardation_time: 0.0,
    }
}

fn sheet(width: f32, height: f32, cells: UVec2, material: ClothMaterial) -> Topology {
    let cloth = Cloth::grid(Vec3::ZERO, Vec3::X * width, Vec3::Y * height, cells).with_material(material);
    cloth.topology().expect("sound")
}

/// The normal of the rim at each particle of a sheet, as long as the rim next to it, m.
fn rim(cells: UVec2, width: f64, height: f64) -> Vec<DVec3> {
    let [nx, ny] = cells.to_array();
    let side =
        |index: u32, count: u32| f64::from(u32::from(index == count)) - f64::from(u32::from(index == 0));
    let part = |index: u32, count: u32| if index == 0 || index == count { 0.5 } else { 1.0 };
    let of = |i: u32, j: u32| {
        let [dx, dy] = [width / f64::from(nx), height / f64::from(ny)];
        DVec3::new(side(i, nx) * part(j, ny) * dy, side(j, ny) * part(i, nx) * dx, 0.0)
    };
    (0..=ny).flat_map(|j| (0..=nx).map(move |i| of(i, j))).collect()
}

/// 1/E along a direction, and Poisson's ratio, of a sheet under a uniaxial stress there.
fn pulled(net: &Topology, rim: &[DVec3], area: f64, direction: DVec3) -> (f64, f64) {
    let mut statics = Statics::new(net);
    let stress = uniaxial(1.0, direction);
    for (force, normal) in statics.forces.iter_mut().zip(rim) {
        *force = stress * *normal;
    }
    statics.free.fill(DVec3::new(1.0, 1.0, 0.0));
    let strain = mean_strain(&statics.solve(), rim, area);
    let across = DVec3::new(-direction.y, direction.x, 0.0);
    let along = direction.dot(strain * direction);
    (along, -across.dot(strain * across) / along)
}

/// F l / (w K), exactly: every cell is in equilibrium by itself.
#[test]
fn a_strip_pulled_along_the_grid_lengthens_alike_at_every_resolution() {
    let poisson = 2.0 * G / (K + (K * K + 4.0 * G * G).sqrt());
    for count in [10, 20, 80] {
        let cells = UVec2::splat(count);
        let net = sheet(1.0, 1.0, cells, material());
        let rim = rim(cells, 1.0, 1.0);
        for direction in [DVec3::X, DVec3::Y] {
            let (compliance, ratio) = pulled(&net, &rim, 1.0, direction);
            assert!((compliance * K - 1.0).abs() < 1e-4, "{count}² cells: {compliance}");
            assert!((ratio - poisson).abs() < 1e-4, "{count}² cells: {ratio}");
        }
    }
}

/// Cells four times as long as wide have long diagonals, which are not at all particles of the rim: it is softer
/// there.
#[test]
fn oblong_cells_make_the_same_cloth() {
    let cells = UVec2::new(10, 10);
    let net = sheet(4.0, 1.0, cells, material());
    let rim = rim(cells, 4.0, 1.0);
    for direction in [DVec3::X, DVec3::Y] {
        let (compliance, _) = pulled(&net, &rim, 4.0, direction);
        assert!((compliance * K - 1.0).abs() < 0.02, "{direction}: {}", compliance * K);
    }
    let (compliance, _) = pulled(&net, &rim, 4.0, DVec3::new(1.0, 1.0, 0.0).normalize());
    let expected = at_45_degrees();
    assert!((compliance / expected - 1.0).abs() < 0.03, "{}", compliance / expected);
}

/// 1/E = (1 − ν) / (2 K) + 1 / (4 G): both threads are stretched by half of the stress, less the contraction by the
/// other, and the angle between them gives way.
fn at_45_degrees() -> f64 {
    let poisson = 2.0 * G / (K + (K * K + 4.0 * G * G).sqrt());
    (1.0 - poisson) / (2.0 * K) + 1.0 / (4.0 * G)
}

#[test]
fn a_strip_pulled_across_the_grid_lengthens_as_stretch_and_shear_say() {
    for count in [10, 20, 80] {
        let cells = UVec2::splat(count);
        let net = sheet(1.0, 1.0, cells, material());
        let direction = DVec3::new(1.0, 1.0, 0.0).normalize();
        let (compliance, _) = pulled(&net, &rim(cells, 1.0, 1.0), 1.0, direction);
        let expected = at_45_degrees();
        assert!((compliance / expected - 1.0).abs() < 1e-4, "{count}² cells: {compliance} {expected}");
    }
}

/// q l⁴ / (8 D), l from the middle of the clamped row, whichever side is clamped. With n cells of h the discrete
/// sheet has n² (n − 1)² h⁴ instead of (n − ½)⁴ h⁴.
#[test]
fn a_clamped_cloth_sinks_by_its_closed_form() {
    let material = ClothMaterial { bending_stiffness: D as f32, ..material() };
    for (nx, ny) in [(20, 6), (6, 20), (40, 10)] {
        let [width, height] = [f64::from(nx) / 20.0, f64::from(ny) / 20.0];
        let cells = UVec2::new(nx, ny);
        let mut cloth = Statics::new(&sheet(width as f32, height as f32, cells, material));
        let load = 1e-3;
        let part = |index: u32, count: u32| if index == 0 || index == count { 0.5 } else { 1.0 };
        let is_along_x = nx > ny;
        for j in 0..=ny {
            for i in 0..=nx {
                let number = (j * (nx + 1) + i) as usize;
                cloth.forces[number] = DVec3::Z * (load / 400.0 * part(i, nx) * part(j, ny));
                if (if is_along_x { i } else { j }) < 2 {
                    cloth.free[number] = DVec3::ZERO;
                }
            }
        }
        let displacements = cloth.solve();
        let length = if is_along_x { width } else { height } - 0.025;
        let expected = load * length.powi(4) / (8.0 * D);
        for corner in if is_along_x { [nx, nx * ny + ny + nx] } else { [(nx + 1) * ny, nx * ny + ny + nx] } {
            let found = displacements[corner as usize].z;
            assert!((found / expected - 1.0).abs() < 0.01, "{cells}, {corner}: {found} {expected}");
        }
    }
}

/// The energy of z = ½ (p x² + q y²) + r x y is ½ D (p² + q² + 2 r²) per area, and twist alone has its part: rods
/// stand for all but the first and last half cell along them.
#[test]
fn curvature_and_twist_cost_what_the_plate_says() {
    let material = ClothMaterial { bending_stiffness: D as f32, ..material() };
    let net = sheet(1.0, 1.0, UVec2::splat(10), material);
    let statics = Statics::new(&net);
    for [p, q, r] in [[0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1], [0.1, -0.2, 0.3]] {
        let height = |place: &DVec3| {
            let [x, y] = [place.x, place.y];
            DVec3::Z * (0.5 * (p * x * x + q * y * y) + r * x * y)
        };
        let displacements: Vec<DVec3> = statics.positions.iter().map(height).collect();
        let expected = 0.5 * D * (0.9 * (p * p + q * q) + 2.0 * r * r);
        let found = statics.energy(&displacements);
        assert!((found / expected - 1.0).abs() < 1e-5, "{p} {q} {r}: {found} {expected}");
    }
}

#[test]
fn the_mass_of_a_sheet_is_that_of_its_area() {
    let net = sheet(1.0, 0.5, UVec2::new(7, 3), material());
    let mass: f64 = net.masses.iter().map(|mass| f64::from(*mass)).sum();
    assert!((mass / 0.1 - 1.0).abs() < 1e-6);
    assert!((f64::from(net.masses[0]) * 4.0 / f64::from(net.masses[9]) - 1.0).abs() < 1e-6, "corners");
    let area: f32 = net
        .triangles
        .iter()
        .map(|triangle| {
            let [a, b, c] = triangle.map(|corner| net.positions[corner as usize]);
            0.5 * (b - a).cross(c - a).z
        })
        .sum();
    assert!((area - 0.5).abs() < 1e-6, "all face the front");
}

/// A strip of equilateral triangles; its long sides are along X.
fn triangular(columns: u32, rows: u32, side: f32) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    let rise = side * 0.75_f32.sqrt();
    for j in 0..=rows {
        for i in 0..=columns {
            let shift = if j % 2 == 1 { 0.5 } else { 0.0 };
            mesh.positions.push(Vec3::new((i as f32 + shift) * side, j as f32 * rise, 0.0));
        }
    }
    for j in 0..rows {
        for i in 0..columns {
            let [a, d] = [j * (columns + 1) + i, (j + 1) * (columns + 1) + i];
            match j % 2 {
                0 => mesh.triangles.extend([[a, a + 1, d], [a + 1, d + 1, d]]),
                _ => mesh.triangles.extend([[a, a + 1, d + 1], [a, d + 1, d]]),
            }
        }
    }
    mesh
}

/// The energy of equilateral triangles under a uniform strain is that of the isotropic sheet with ν = 1/3:
/// ½ · 3/8 K (tr² + 2 ε:ε) per area.
#[test]
fn a_mesh_of_equilateral_triangles_is_isotropic() {
    let mesh = triangular(5, 4, 0.1);
    let net = Cloth::from_mesh().with_material(material()).topology_with(&mesh).expect("sound");
    let statics = Statics::new(&net);
    let area = 40.0 * 0.01 * 0.75_f64.sqrt() / 2.0;
    for [xx, yy, xy] in [[1e-3, 0.0, 0.0], [0.0, 1e-3, 0.0], [0.0, 0.0, 1e-3], [1e-3, -2e-3, 5e-4]] {
        let strain =
            |place: &DVec3| DVec3::new(xx * place.x + xy * place.y, xy * place.x + yy * place.y, 0.0);
        let displacements: Vec<DVec3> = statics.positions.iter().map(strain).collect();
        let squares: f64 = xx * xx + yy * yy + 2.0 * xy * xy;
        let expected = 0.5 * 0.375 * K * ((xx + yy).powi(2) + 2.0 * squares) * area;
        let found = statics.energy(&displacements);
        assert!((found / expected - 1.0).abs() < 1e-4, "{xx} {yy} {xy}: {found} {expected}");
    }
}

/// q l⁴ / (8 D) on a mesh: a strip of equilateral triangles, 4.6 times as long as wide. At its clamped end it cannot
/// bend across, as its free sides let it (Poisson's ratio 1/3), and is stiffer by up to 1 − ν² over a width's length.
#[test]
fn a_clamped_mesh_sinks_by_its_closed_form() {
    let (columns, rows, side) = (64, 16, 0.05);
    let mesh = triangular(columns, rows, side);
    let material = ClothMaterial { bending_stiffness: D as f32, ..material() };
    let net = Cloth::from_mesh().with_material(material).topology_with(&mesh).expect("sound");
    let mut cloth = Statics::new(&net);
    let load = 1e-3;
    for (number, mass) in net.masses.iter().enumerate() {
        cloth.forces[number] = DVec3::Z * (load * f64::from(*mass) / 0.2);
        let is_clamped = net.positions[number].x < 1.6 * side;
        cloth.free[number] = if is_clamped { DVec3::ZERO } else { DVec3::Z };
    }
    let displacements = cloth.solve();
    let length = f64::from(side) * (f64::from(columns) - 1.0);
    let expected = load * length.powi(4) / (8.0 * D);
    let tip = ((rows / 2) * (columns + 1) + columns) as usize;
    let found = displacements[tip].z;
    assert!((found / expected - 1.0).abs() < 0.04, "{found} {expected}");
}

/// Vertices of a mesh with seams hang on one particle each place, in the order of the mesh.
#[test]
fn seams_are_welded() {
    let mut mesh = triangular(4, 2, 0.1);
    let seam = mesh.positions.len() as u32;
    // The second half of the triangles gets vertices of its own.
    mesh.positions.extend_from_within(..);
    let half = mesh.triangles.len() / 2;
    mesh.triangles[half..].iter_mut().flatten().for_each(|vertex| *vertex += seam);
    let used: Vec<u32> = {
        let mut used: Vec<u32> = mesh.triangles.iter().flatten().copied().collect();
        used.sort_unstable();
        used.dedup();
        used
    };
    let net = Cloth::topology_of(&mesh).expect("sound");
    let Some(MeshBinding::Welded(particles)) = &net.binding else { panic!("a weld map") };
    assert_eq!(net.positions.len() as u32, seam);
    for vertex in used {
        let particle = particles[vertex as usize];
        assert_eq!(net.positions[particle as usize], mesh.positions[vertex as usize]);
        assert_eq!(particle, vertex % seam, "in the order of the mesh");
    }
}

#[test]
fn recipes_that_cannot_be_are_refused_by_name() {
    let message = |cloth: Cloth| cloth.topology().expect_err("refused").to_string();
    let parallel = Cloth::grid(Vec3::ZERO, Vec3::X, Vec3::X * 2.0, UVec2::ONE);
    assert_eq!(message(parallel), "width × height has no area");
    let none = Cloth::grid(Vec3::ZERO, Vec3::X, Vec3::Y, UVec2::new(3, 0));
    assert_eq!(message(none), "cells.y is 0, expected 1 to 16777216");
    assert_eq!(message(Cloth::from_mesh()), "a cloth from a mesh needs a mesh");
    assert_eq!(
        Cloth::topology_of(&TriangleMesh::default()).expect_err("refused").to_string(),
        "the mesh is empty: it has no triangles"
    );
}
