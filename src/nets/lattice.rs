//! The springs of a grid or box of cells: edges and the diagonals of faces.

use bevy::math::Vec3;

use super::moduli::{Cells, Diagonals, Moduli};
use crate::solver::Spring;

/// What all springs of a net share.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Weave {
    /// Retardation time τ, s.
    pub retardation_time: f32,
    /// The strain limit.
    pub max_stretch: Option<f32>,
}

impl Weave {
    /// A spring between two places, at rest there.
    pub fn spring(&self, ends: [u32; 2], positions: &[Vec3], stiffness: f64) -> ([u32; 2], Spring) {
        let [first, second] = ends.map(|end| positions[end as usize].as_dvec3());
        let spring = Spring {
            rest_length: first.distance(second) as f32,
            stiffness: stiffness as f32,
            damping: (stiffness * f64::from(self.retardation_time)) as f32,
            max_stretch: self.max_stretch,
            ..Spring::default()
        };
        (ends, spring)
    }
}

/// The springs of all cells. Each cell has its share of the springs around it, so that every cell by itself is in
/// equilibrium under a uniform stress: at the surface, springs have a half or a quarter of the stiffness.
///
/// Edges of boxes are weighted across the box by [`across`], for bending.
pub(super) fn springs(
    cells: &Cells,
    moduli: &Moduli,
    positions: &[Vec3],
    weave: &Weave,
) -> Vec<([u32; 2], Spring)> {
    let mut springs = Vec::new();
    for axis in 0..3 {
        edges(axis, cells, moduli, |ends, k| springs.push(weave.spring(ends, positions, k)));
    }
    for plane in &moduli.planes {
        diagonals(plane, cells, |ends, k| springs.push(weave.spring(ends, positions, k)));
    }
    springs.retain(|(_, spring)| spring.stiffness > 0.0);
    springs
}

/// The number of a particle by its indices.
pub(super) fn number(indices: [u32; 3], counts: [u32; 3]) -> u32 {
    (indices[2] * (counts[1] + 1) + indices[1]) * (counts[0] + 1) + indices[0]
}

/// All particles, in the order of their numbers.
pub(super) fn particles(counts: [u32; 3]) -> impl Iterator<Item = [u32; 3]> {
    let [x, y, z] = counts;
    (0..=z).flat_map(move |k| (0..=y).flat_map(move |j| (0..=x).map(move |i| [i, j, k])))
}

/// The part of the cells around a particle that is there: 1 inside, a half at the surface, a quarter at its edges.
pub(super) fn share(indices: [u32; 3], counts: [u32; 3]) -> f64 {
    let along = |axis: usize| match counts[axis] {
        0 => 1.0,
        count => {
            if indices[axis] == 0 || indices[axis] == count {
                0.5
            } else {
                1.0
            }
        }
    };
    (0..3).map(along).product()
}

/// The cells on both sides of a particle along an axis.
fn beside(index: u32, count: u32) -> impl Iterator<Item = u32> {
    let below = index.checked_sub(1).filter(|_| count > 0);
    let above = (index < count || count == 0).then_some(index);
    below.into_iter().chain(above)
}

fn edges(axis: usize, cells: &Cells, moduli: &Moduli, mut add: impl FnMut([u32; 2], f64)) {
    let counts = cells.counts;
    if counts[axis] == 0 {
        return;
    }
    let [second, third] = [(axis + 1) % 3, (axis + 2) % 3];
    let unit = cells.volume() / (cells.sizes[axis] * cells.sizes[axis]);
    for indices in particles(counts).filter(|indices| indices[axis] < counts[axis]) {
        let mut stiffness = 0.0;
        for j in beside(indices[second], counts[second]) {
            for k in beside(indices[third], counts[third]) {
                let mut cell = indices;
                (cell[second], cell[third]) = (j, k);
                stiffness += moduli.of_edges(axis, cell, cells);
            }
        }
        for across_axis in [second, third] {
            stiffness *= if counts[across_axis] > 0 { 0.5 } else { 1.0 };
            if counts.iter().all(|count| *count > 0) {
                stiffness *= across(indices[across_axis], counts[across_axis]);
            }
        }
        let mut end = indices;
        end[axis] += 1;
        add([number(indices, counts), number(end, counts)], stiffness * unit);
    }
}

/// By what edges along a beam are stiffer than their share of the cells, so that it bends as it should.
///
/// The second moment of n layers of edges, each with the area that is next to it, is larger by 2/n² than that of the
/// beam: the trapezoidal rule. So is that of diagonals in layers; those between layers have the moment of the
/// midpoint rule, which is smaller by 1/n². Of the energy of a bar in tension with Poisson's ratio 1/4, in units of
/// its shear modulus 5/2 in all, there are (1 + 9/16 + 1/16) in layers and (9/16 + 1/16 + 1/4) between: together
/// 2.375/n² too much. To take δ of a layer's weight from the outermost layer and give it to the next changes the
/// moment by −24 δ (n − 1) / n³ and nothing else: all of it is gone with δ = 2.375 n / (24 (n − 1)). Of two layers it
/// takes half of that, as outer edges so weak would give way where the ends of the bar are pulled.
fn across(index: u32, count: u32) -> f64 {
    if count < 2 {
        return 1.0;
    }
    let shift = 2.375 / 24.0 * f64::from(count) / f64::from(count - 1);
    let shift = if count == 2 { 0.5 * shift } else { shift };
    let from_surface = index.min(count - index);
    match from_surface {
        0 => 1.0 - 2.0 * shift,
        1 if count == 2 => 1.0 + 2.0 * shift,
        1 => 1.0 + shift,
        _ => 1.0,
    }
}

fn diagonals(plane: &Diagonals, cells: &Cells, mut add: impl FnMut([u32; 2], f64)) {
    let [first, second] = plane.axes;
    let third = 3 - first - second;
    for layer in plane.layers.iter().filter(|layer| layer.share > 0.0) {
        for k in 0..=cells.counts[third] {
            let mut surface = [0; 3];
            surface[third] = k;
            let mut around = [0; 3];
            around[third] = cells.counts[third];
            let thickness = cells.sizes[third] * share(surface, around);
            for rows in layer.bounds[1].windows(2) {
                for columns in layer.bounds[0].windows(2) {
                    let corner = |i: u32, j: u32| {
                        let mut indices = [0; 3];
                        (indices[first], indices[second], indices[third]) = (i, j, k);
                        number(indices, cells.counts)
                    };
                    let a = f64::from(columns[1] - columns[0]) * cells.sizes[first];
                    let b = f64::from(rows[1] - rows[0]) * cells.sizes[second];
                    let stiffness = plane.shear * layer.share * (a * a + b * b) * thickness / (2.0 * a * b);
                    add([corner(columns[0], rows[0]), corner(columns[1], rows[1])], stiffness);
                    add([corner(columns[1], rows[0]), corner(columns[0], rows[1])], stiffness);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_beside() {
        assert_eq!(beside(0, 4).collect::<Vec<_>>(), [0]);
        assert_eq!(beside(2, 4).collect::<Vec<_>>(), [1, 2]);
        assert_eq!(beside(4, 4).collect::<Vec<_>>(), [3]);
        assert_eq!(beside(0, 0).collect::<Vec<_>>(), [0]);
    }

    /// Weights across a beam add up to its area, and their second moment is that of the beam less the rest of the
    /// correction: n³/12 (1 − 0.375/n²).
    #[test]
    fn edges_across_a_beam_have_its_area_and_the_corrected_moment() {
        for count in 3..12 {
            let weight =
                |index: u32| across(index, count) * if index == 0 || index == count { 0.5 } else { 1.0 };
            let n = f64::from(count);
            let area: f64 = (0..=count).map(weight).sum();
            let moment: f64 =
                (0..=count).map(|index| weight(index) * (f64::from(index) - 0.5 * n).powi(2)).sum();
            assert!((area - n).abs() < 1e-12);
            let expected = n.powi(3) / 12.0 * (1.0 - 0.375 / (n * n));
            assert!((moment / expected - 1.0).abs() < 1e-12, "{count}: {moment} {expected}");
        }
    }
}
