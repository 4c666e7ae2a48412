//! Rectangular cloths: grids of cells.

use bevy::math::{DVec3, Vec3};

use super::lattice::{Weave, number, particles, share, springs};
use super::moduli::{Cells, Moduli};
use super::{ClothMaterial, Layout, NetError, Topology};
use crate::parameter;
use crate::solver::Bend;

/// The frame of a sheet: particle (0, 0) is at the corner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Frame {
    pub corner: Vec3,
    pub width: Vec3,
    pub height: Vec3,
}

impl Frame {
    /// # Errors
    /// If a vector is not finite, or both span no area.
    pub fn validate(&self) -> Result<(), NetError> {
        parameter::finite("corner", self.corner)?;
        parameter::finite("width", self.width)?;
        parameter::finite("height", self.height)?;
        // Nearly parallel vectors, up to the rounding of their product, span none.
        let [width, height] = [self.width, self.height].map(|side| side.as_dvec3());
        let area = width.cross(height).length();
        match area > 1e-6 * width.length() * height.length() {
            true => Ok(()),
            false => Err(NetError::Degenerate { field: "width × height", lacks: "area" }),
        }
    }

    fn place(&self, [i, j]: [u32; 2], counts: [u32; 2]) -> Vec3 {
        let [u, v] = [f64::from(i) / f64::from(counts[0]), f64::from(j) / f64::from(counts[1])];
        let place: DVec3 = self.corner.as_dvec3() + u * self.width.as_dvec3() + v * self.height.as_dvec3();
        place.as_vec3()
    }
}

/// The net of a sheet. Its stiffnesses are those of [`Moduli`]; sides that are not at right angles are counted by
/// their lengths.
pub(super) fn topology(frame: &Frame, counts: [u32; 2], material: &ClothMaterial, weave: &Weave) -> Topology {
    let counts3 = [counts[0], counts[1], 0];
    let positions: Vec<Vec3> = particles(counts3).map(|[i, j, _]| frame.place([i, j], counts)).collect();
    let [width, height] = [frame.width, frame.height].map(|side| side.as_dvec3());
    let cell = [width.length() / f64::from(counts[0]), height.length() / f64::from(counts[1])];
    let cells = Cells { counts: counts3, sizes: [cell[0], cell[1], 1.0] };
    let moduli =
        Moduli::new(&cells, f64::from(material.stretch_stiffness), f64::from(material.shear_stiffness));
    let area = width.cross(height).length() / (f64::from(counts[0]) * f64::from(counts[1]));
    let mass = f64::from(material.area_density) * area;
    let (rods, hinges) = bends(counts, cell, material);
    Topology {
        masses: particles(counts3).map(|indices| (mass * share(indices, counts3)) as f32).collect(),
        springs: springs(&cells, &moduli, &positions, weave),
        rods,
        hinges,
        triangles: triangles(counts),
        layout: Layout::Grid { cells: counts },
        positions,
        ..Topology::default()
    }
}

type Rods = Vec<([u32; 3], Bend<3>)>;
type Hinges = Vec<([u32; 4], Bend<4>)>;

/// The bends of a sheet of height z(x, y) with energy ½ D ∫ (z_xx² + z_yy² + 2 z_xy²): a plate with Poisson's ratio 0,
/// of which a strip bends to M / (w D) whether its sides are free or not, along the grid and across.
///
/// With cells a × b, a rod x₀ − 2 x₁ + x₂ along the grid is a² z_xx and stands for an area of a b (half of that along
/// the sides): k = D b / a³. The twist of a cell is one bend of its corners, x₀₀ − x₁₀ − x₀₁ + x₁₁ = a b z_xy, for its
/// area a b: k = 2 D / (a b). Both vanish where the cloth is stretched or sheared evenly.
fn bends(counts: [u32; 2], [a, b]: [f64; 2], material: &ClothMaterial) -> (Rods, Hinges) {
    let (mut rods, mut hinges) = (Vec::new(), Vec::new());
    let bending = f64::from(material.bending_stiffness);
    if bending == 0.0 {
        return (rods, hinges);
    }
    let [nx, ny] = counts;
    let of = |i, j| number([i, j, 0], [nx, ny, 0]);
    let damping = |stiffness: f64| (stiffness * f64::from(material.retardation_time)) as f32;
    let mut rod = |ends: [u32; 3], stiffness: f64| {
        let (stiffness, damping) = (stiffness as f32, damping(stiffness));
        rods.push((ends, Bend { rest_length: 0.0, stiffness, damping, weights: [1.0, -2.0, 1.0] }));
    };
    let part = |index: u32, count: u32| if index == 0 || index == count { 0.5 } else { 1.0 };
    for j in 0..=ny {
        for i in 0..nx.saturating_sub(1) {
            rod([of(i, j), of(i + 1, j), of(i + 2, j)], part(j, ny) * bending * b / (a * a * a));
        }
    }
    for j in 0..ny.saturating_sub(1) {
        for i in 0..=nx {
            rod([of(i, j), of(i, j + 1), of(i, j + 2)], part(i, nx) * bending * a / (b * b * b));
        }
    }
    let twist = 2.0 * bending / (a * b);
    let bend = Bend {
        rest_length: 0.0,
        stiffness: twist as f32,
        damping: damping(twist),
        weights: [1.0, -1.0, -1.0, 1.0],
    };
    for j in 0..ny {
        for i in 0..nx {
            hinges.push(([of(i, j), of(i + 1, j), of(i, j + 1), of(i + 1, j + 1)], bend));
        }
    }
    (rods, hinges)
}

/// Two triangles a cell, counter-clockwise seen against width × height. Their diagonals alternate as on a
/// chequerboard, so that the air and the light prefer no diagonal of the cloth.
fn triangles([nx, ny]: [u32; 2]) -> Vec<[u32; 3]> {
    let of = |i, j| number([i, j, 0], [nx, ny, 0]);
    let cell = |i: u32, j: u32| {
        let [a, b, c, d] = [of(i, j), of(i + 1, j), of(i + 1, j + 1), of(i, j + 1)];
        if (i + j).is_multiple_of(2) { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] }
    };
    (0..ny).flat_map(|j| (0..nx).flat_map(move |i| cell(i, j))).collect()
}
