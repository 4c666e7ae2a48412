//! From the moduli of a material to those of a lattice of springs.
//!
//! A lattice of springs with stiffnesses k, lengths l and directions n, of which each cell of volume V has its share,
//! stores ½ Σ k l² (n·ε n)² / V per volume under a uniform strain ε. Of cells a × b (× c) along the axes:
//! - an edge along an axis adds k a² / V to the stiffness C₁₁ along it, and to nothing else;
//! - the two diagonals of a face a × b add 2 k a⁴ / (d² V) to C₁₁, 2 k b⁴ / (d² V) to C₂₂ and 2 k a² b² / (d² V) to
//!   both the shear stiffness C₆₆ and the coupling C₁₂ (d² = a² + b²): springs have C₁₂ = C₆₆, Cauchy's relation.
//!
//! So the diagonals of a plane are set by its shear stiffness G; they add G a²/b² to C₁₁ and G b²/a² to C₂₂. The
//! edges add what is missing. The stiffness that a strip with free sides shows is 1 / S₁₁, S = C⁻¹: with two axes
//! C₁₁ − G² / C₂₂. If that is to be K along both, C = (K + √(K² + 4 G²)) / 2; Poisson's ratio is G / C. With three
//! axes, E = 5/2 G gives C = 3 G: isotropic with Poisson's ratio 1/4, in cubes of a k = 2/5 E a for edges and
//! diagonals alike (Kot, Nagahashi and Szymczak, *Elastic moduli of simple mass spring models*, 2015).
//!
//! Nothing is missing in a cell so oblong that G a²/b² > C₁₁. There, short diagonals carry what they can, and *long*
//! ones, across several cells that together are nearly square, the rest: they begin at every row, so that they hold
//! all particles alike. Where that is not enough either (one oblong cell, or G beyond 2/3 K in cells of 2 : 3), the
//! shear stiffness is the greatest that leaves no spring a negative one; the stiffness along the axes stays what it
//! is to be. Under a uniform stress long diagonals pull at particles of the rim alone that are their
//! ends, so that a net of few oblong cells is softer there, by up to 2 % in a sheet of 10 × 10 cells of 4 : 1, and
//! more in a jelly.

/// The size and number of the cells along each axis. An axis without cells is none: its size is 1.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Cells {
    pub counts: [u32; 3],
    pub sizes: [f64; 3],
}

/// Diagonals across groups of cells.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Layer {
    /// Where groups begin and end along the two axes of the plane, in cells.
    pub bounds: [Vec<u32>; 2],
    /// The part of the shear stiffness that they carry.
    pub share: f64,
}

/// The diagonals in the planes of two axes.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Diagonals {
    pub axes: [usize; 2],
    /// The shear stiffness of the plane.
    pub shear: f64,
    /// Those of single cells, then the long ones.
    pub layers: Vec<Layer>,
    /// The greatest of [`along`](Self::along) of all cells, along both axes: if the short diagonals carried everything,
    /// and if the long ones did.
    greatest: [[f64; 2]; 2],
}

/// The stiffnesses of a lattice.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Moduli {
    /// C₁₁, C₂₂, C₃₃.
    pub axial: [f64; 3],
    pub planes: Vec<Diagonals>,
}

/// How long diagonals cover the cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Tiling {
    /// From every row on, so that each particle has some; groups at the ends are half as long as others, or longer.
    Half,
    /// The same, with groups at the ends as long as others, or longer.
    Whole,
    /// From the first row on only.
    One,
}

/// Edges keep at least this part of the stiffness along their axis.
const MIN_EDGE_SHARE: f64 = 0.02;

impl Cells {
    fn has(&self, axis: usize) -> bool {
        self.counts[axis] > 0
    }

    /// The volume of a cell; with two axes its area.
    pub fn volume(&self) -> f64 {
        self.sizes.iter().product()
    }
}

impl Layer {
    /// What it would add to the stiffness along `axis` in a cell if it carried all of the shear stiffness.
    fn along(&self, axis: usize, cell: [u32; 2], axes: [usize; 2], cells: &Cells) -> f64 {
        let [a, b] = [0, 1].map(|side| {
            let bounds = &self.bounds[side];
            let end = bounds.partition_point(|bound| *bound <= cell[side]);
            f64::from(bounds[end] - bounds[end - 1]) * cells.sizes[axes[side]]
        });
        let ratio = if axis == axes[0] { a / b } else { b / a };
        ratio * ratio
    }
}

impl Diagonals {
    fn new(axes: [usize; 2], cells: &Cells, tiling: Tiling) -> Self {
        let [first, second] = axes.map(|axis| cells.sizes[axis]);
        let counts = axes.map(|axis| cells.counts[axis]);
        let lengths =
            [second / first, first / second].map(|ratio| if ratio > 1.0 { ratio.round() as u32 } else { 1 });
        let single = counts.map(|count| (0..=count).collect());
        let mut layers = vec![Layer { bounds: single, share: 1.0 }];
        let most = lengths[0].min(counts[0]).max(lengths[1].min(counts[1]));
        for start in 0..if tiling == Tiling::One { 1 } else { most } {
            let bounds = [0, 1].map(|side| {
                let least = if tiling == Tiling::Whole { lengths[side] } else { lengths[side].div_ceil(2) };
                groups(counts[side], lengths[side], start, least)
            });
            layers.push(Layer { bounds, share: 0.0 });
        }
        let mut diagonals = Self { axes, shear: 0.0, layers, greatest: [[0.0; 2]; 2] };
        diagonals.greatest = axes.map(|axis| diagonals.find_greatest(axis, cells));
        diagonals
    }

    /// What they add to the stiffness along `axis`, in parts of the shear stiffness, in the cell with these
    /// indices along their axes.
    pub fn along(&self, axis: usize, cell: [u32; 2], cells: &Cells) -> f64 {
        let carried = self.layers.iter().filter(|layer| layer.share > 0.0);
        carried.map(|layer| layer.share * layer.along(axis, cell, self.axes, cells)).sum()
    }

    fn find_greatest(&self, axis: usize, cells: &Cells) -> [f64; 2] {
        let mut greatest = [0.0_f64; 2];
        let counts = self.axes.map(|axis| cells.counts[axis]);
        // Groups are long along one axis only: a row or column has all combinations.
        let row = (0..counts[0]).map(|i| [i, 0]).chain((0..counts[1]).map(|j| [0, j]));
        for cell in row {
            let short = self.layers[0].along(axis, cell, self.axes, cells);
            let long: f64 =
                self.layers[1..].iter().map(|layer| layer.along(axis, cell, self.axes, cells)).sum();
            let parts = [short, long / (self.layers.len() - 1) as f64];
            greatest = [0, 1].map(|part| greatest[part].max(parts[part]));
        }
        greatest
    }

    fn share(&mut self, short: f64) {
        let long = (1.0 - short) / (self.layers.len() - 1) as f64;
        for (index, layer) in self.layers.iter_mut().enumerate() {
            layer.share = if index == 0 { short } else { long };
        }
    }
}

/// Where groups of `length` of `count` cells begin and end, the first complete one at `start`. What is left at an
/// end is a group if it is at least `least` long, and joins its neighbour otherwise.
fn groups(count: u32, length: u32, start: u32, least: u32) -> Vec<u32> {
    let whole = (start % length..=count).step_by(length as usize);
    let inner = whole.filter(|bound| *bound >= least && count - *bound >= least);
    let mut bounds: Vec<u32> = std::iter::once(0).chain(inner).collect();
    bounds.push(count);
    bounds
}

impl Moduli {
    /// Those of a lattice that shows `free` along each axis while its sides are free, and `shear` in each plane
    /// of two axes, N/m² (with two axes N/m).
    pub fn new(cells: &Cells, free: f64, shear: f64) -> Self {
        let mut moduli = Self { axial: [free; 3], planes: Vec::new() };
        for tiling in [Tiling::Half, Tiling::Whole, Tiling::One] {
            let pairs = [[0, 1], [0, 2], [1, 2]].into_iter();
            let planes = pairs.filter(|axes| axes.iter().all(|axis| cells.has(*axis)));
            moduli.planes = planes.map(|axes| Diagonals::new(axes, cells, tiling)).collect();
            if moduli.divide(free, shear) {
                return moduli;
            }
        }
        let (mut possible, mut impossible) = (0.0, shear);
        for _ in 0..40 {
            let middle = 0.5 * (possible + impossible);
            match moduli.divide(free, middle) {
                true => possible = middle,
                false => impossible = middle,
            }
        }
        moduli.divide(free, possible);
        moduli
    }

    /// Divides the shear stiffness among the layers, as much as possible to the short diagonals; whether edges keep
    /// their part of the stiffness along each axis.
    fn divide(&mut self, free: f64, shear: f64) -> bool {
        for plane in &mut self.planes {
            plane.shear = shear;
        }
        self.axial = self.axial_stiffness(free);
        const STEPS: u32 = 64;
        for step in (1..=STEPS).rev() {
            let share = f64::from(step) / f64::from(STEPS);
            self.planes.iter_mut().for_each(|plane| plane.share(share));
            if (0..3).all(|axis| self.keeps(axis)) {
                return true;
            }
        }
        false
    }

    fn keeps(&self, axis: usize) -> bool {
        let of_plane = |plane: &Diagonals| {
            let side = usize::from(plane.axes[1] == axis);
            let ([short, long], share) = (plane.greatest[side], plane.layers[0].share);
            plane.shear * (share * short + (1.0 - share) * long)
        };
        let planes = self.planes.iter().filter(|plane| plane.axes.contains(&axis));
        planes.map(of_plane).sum::<f64>() <= (1.0 - MIN_EDGE_SHARE) * self.axial[axis]
    }

    /// C₁₁, C₂₂, C₃₃ of which 1 / S₁₁ = 1 / S₂₂ = 1 / S₃₃ = `free`: a fixed point of
    /// C₁₁ = `free` + (C₁₂, C₁₃) · (the other four)⁻¹ (C₁₂, C₁₃).
    fn axial_stiffness(&self, free: f64) -> [f64; 3] {
        let coupling = |one: usize, other: usize| {
            let found =
                self.planes.iter().find(|plane| plane.axes.contains(&one) && plane.axes.contains(&other));
            found.map_or(0.0, |plane| plane.shear)
        };
        let mut axial = [free + 2.0 * self.planes.iter().map(|plane| plane.shear).sum::<f64>(); 3];
        // It contracts by 1/8 in an isotropic cube, and in a sheet by G² / C², which is near 1 where G is many
        // times K: there this is off by the part of the steps that are left, and `free` by less than it.
        for _ in 0..4000 {
            let old = axial;
            for axis in 0..3 {
                let [second, third] = [(axis + 1) % 3, (axis + 2) % 3];
                let (b, c, d) = (coupling(axis, second), coupling(axis, third), coupling(second, third));
                let determinant = axial[second] * axial[third] - d * d;
                axial[axis] =
                    free + (b * b * axial[third] - 2.0 * b * c * d + c * c * axial[second]) / determinant;
            }
            if (0..3).all(|axis| (axial[axis] - old[axis]).abs() <= 1e-14 * axial[axis]) {
                break;
            }
        }
        axial
    }

    /// What the edges along `axis` are to add in a cell.
    pub fn of_edges(&self, axis: usize, cell: [u32; 3], cells: &Cells) -> f64 {
        let planes = self.planes.iter().filter(|plane| plane.axes.contains(&axis));
        let diagonals =
            planes.map(|plane| plane.shear * plane.along(axis, plane.axes.map(|axis| cell[axis]), cells));
        self.axial[axis] - diagonals.sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sheet_has_the_closed_form() {
        let cells = Cells { counts: [10, 10, 0], sizes: [0.1, 0.1, 1.0] };
        for (free, shear) in [(1e3, 3e2), (1e3, 0.0), (1e3, 1e3)] {
            let moduli = Moduli::new(&cells, free, shear);
            let expected = (free + (free * free + 4.0 * shear * shear).sqrt()) / 2.0;
            assert!((moduli.axial[0] / expected - 1.0).abs() < 1e-12);
            assert_eq!(moduli.planes[0].shear, shear);
            assert_eq!(moduli.planes[0].layers[0].share, 1.0);
        }
    }

    /// C = 3 G, and edges have a third of it.
    #[test]
    fn a_cube_is_isotropic() {
        let cells = Cells { counts: [2, 2, 2], sizes: [0.1; 3] };
        let moduli = Moduli::new(&cells, 2.5, 1.0);
        for axis in 0..3 {
            assert!((moduli.axial[axis] - 3.0).abs() < 1e-12);
            assert!((moduli.of_edges(axis, [0, 1, 0], &cells) - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn oblong_cells_have_long_diagonals_and_no_spring_pushes() {
        let cells = Cells { counts: [10, 41, 0], sizes: [0.4, 0.1, 1.0] };
        let moduli = Moduli::new(&cells, 1e3, 3e2);
        let plane = &moduli.planes[0];
        assert_eq!(plane.shear, 3e2);
        assert!(plane.layers[1].share > 0.1 && plane.layers[0].share > 0.0);
        for j in 0..41 {
            assert!(
                moduli.of_edges(0, [3, j, 0], &cells) > 0.0 && moduli.of_edges(1, [3, j, 0], &cells) > 0.0
            );
        }
        // Of one oblong cell the greatest shear stiffness is K R / (R² − 1), R = a²/b², less what edges keep.
        let cells = Cells { counts: [1, 1, 0], sizes: [0.2, 0.1, 1.0] };
        let shear = Moduli::new(&cells, 1e3, 1e3).planes[0].shear;
        assert!(shear < 1e3 * 4.0 / 15.0 && shear > 0.95 * 1e3 * 4.0 / 15.0, "{shear}");
    }

    #[test]
    fn groups_cover_all_cells() {
        assert_eq!(groups(10, 1, 5, 1), (0..=10).collect::<Vec<_>>());
        assert_eq!(groups(10, 4, 0, 2), [0, 4, 8, 10]);
        assert_eq!(groups(10, 4, 1, 2), [0, 5, 10]);
        assert_eq!(groups(10, 4, 2, 2), [0, 2, 6, 10]);
        assert_eq!(groups(10, 4, 2, 4), [0, 6, 10]);
        assert_eq!(groups(2, 9, 1, 5), [0, 2]);
    }
}
