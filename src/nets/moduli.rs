//! From the moduli of a material to those of a lattice of springs.
//!
//! A lattice of springs with stiffnesses k, lengths l and directions n, of which each cell of volume V has its share,
//! stores ½ Σ k l² (n·ε n)² / V per volume under a uniform strain ε. Of cells a × b (× c) along the axes:
//! - an edge along an axis adds k a² / V to the stiffness C₁₁ along it, and to nothing else;
//! - the two diagonals of a face a × b add 2 k a⁴ / (d² V) to C₁₁, 2 k b⁴ / (d² V) to C₂₂ and 2 k a² b² / (d² V) to both
//!   the shear stiffness C₆₆ and the coupling C₁₂ (d² = a² + b²): springs have C₁₂ = C₆₆, Cauchy's relation.
//!
//! So the diagonals of a plane are set by its shear stiffness G; they add G a²/b² to C₁₁ and G b²/a² to C₂₂. The edges
//! add what is missing. The stiffness that a strip with free sides shows is 1 / S₁₁, S = C⁻¹: with two axes
//! C₁₁ − G² / C₂₂. If that is to be K along both, C = (K + √(K² + 4 G²)) / 2; Poisson's ratio is G / C. With three
//! axes, E = 5/2 G gives C = 3 G: isotropic with Poisson's ratio 1/4, in cubes of a k = 2/5 E a for edges and diagonals
//! alike (Kot, Nagahashi and Szymczak, *Elastic moduli of simple mass spring models*, 2015).
//!
//! Nothing is missing in a cell so oblong that G a²/b² > C₁₁. There, short diagonals carry what they can, and *long*
//! ones, across several cells that together are nearly square, the rest. Where that is not enough either (one
//! oblong cell, or G beyond 2/3 K in cells of 2 : 3), the shear stiffness is the greatest that keeps all springs
//! from pushing; the stiffness along the axes stays what it is to be.

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
    pub layers: [Layer; 2],
}

/// The stiffnesses of a lattice.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Moduli {
    /// C₁₁, C₂₂, C₃₃.
    pub axial: [f64; 3],
    pub planes: Vec<Diagonals>,
}

/// Edges keep at least this part of the stiffness along their axis.
const LEAST_OF_EDGES: f64 = 0.02;

impl Cells {
    fn has(&self, axis: usize) -> bool {
        self.counts[axis] > 0
    }

    /// The volume of a cell; with two axes its area.
    pub fn volume(&self) -> f64 {
        self.sizes.iter().product()
    }
}

impl Diagonals {
    fn new(axes: [usize; 2], cells: &Cells) -> Self {
        let [first, second] = axes.map(|axis| cells.sizes[axis]);
        let counts = axes.map(|axis| cells.counts[axis]);
        let all = counts.map(|count| (0..=count).collect());
        let long = [
            groups(counts[0], if second > first { second / first } else { 1.0 }),
            groups(counts[1], if first > second { first / second } else { 1.0 }),
        ];
        let layers = [Layer { bounds: all, share: 1.0 }, Layer { bounds: long, share: 0.0 }];
        Self { axes, shear: 0.0, layers }
    }

    /// What they add to the stiffness along `axis`, in parts of the shear stiffness, in the cell with these
    /// indices along their axes.
    pub fn along(&self, axis: usize, cell: [u32; 2], cells: &Cells) -> f64 {
        let of_layer = |layer: &Layer| {
            let [a, b] = [0, 1].map(|side| {
                let bounds = &layer.bounds[side];
                let end = bounds.partition_point(|bound| *bound <= cell[side]);
                f64::from(bounds[end] - bounds[end - 1]) * cells.sizes[self.axes[side]]
            });
            let ratio = if axis == self.axes[0] { a / b } else { b / a };
            layer.share * ratio * ratio
        };
        self.layers.iter().map(of_layer).sum()
    }

    /// The greatest of [`along`](Self::along) of all cells, layer by layer, as if each carried everything.
    fn greatest(&self, axis: usize, cells: &Cells) -> [f64; 2] {
        self.layers.each_ref().map(|layer| {
            let lengths = [0, 1].map(|side| {
                let all = layer.bounds[side].windows(2).map(|pair| pair[1] - pair[0]);
                let extremes = (all.clone().min().unwrap_or(1), all.max().unwrap_or(1));
                [extremes.0, extremes.1].map(|count| f64::from(count) * cells.sizes[self.axes[side]])
            });
            let ratio = match axis == self.axes[0] {
                true => lengths[0][1] / lengths[1][0],
                false => lengths[1][1] / lengths[0][0],
            };
            ratio * ratio
        })
    }
}

/// Groups of about `size` of `count` cells, as even as can be.
fn groups(count: u32, size: f64) -> Vec<u32> {
    let number = (f64::from(count) / size).round().clamp(1.0, f64::from(count.max(1))) as u64;
    (0..=number).map(|group| ((group * u64::from(count) * 2 + number) / (2 * number)) as u32).collect()
}

impl Moduli {
    /// Those of a lattice that shows `free` along each axis while its sides are free, and `shear` in each plane
    /// of two axes, N/m² (with two axes N/m).
    pub fn new(cells: &Cells, free: f64, shear: f64) -> Self {
        let pairs = [[0, 1], [0, 2], [1, 2]];
        let planes = pairs.into_iter().filter(|axes| axes.iter().all(|axis| cells.has(*axis)));
        let mut moduli =
            Self { axial: [free; 3], planes: planes.map(|axes| Diagonals::new(axes, cells)).collect() };
        if moduli.divide(cells, free, shear) {
            return moduli;
        }
        let (mut possible, mut impossible) = (0.0, shear);
        for _ in 0..40 {
            let middle = 0.5 * (possible + impossible);
            match moduli.divide(cells, free, middle) {
                true => possible = middle,
                false => impossible = middle,
            }
        }
        moduli.divide(cells, free, possible);
        moduli
    }

    /// Divides the shear stiffness among the layers, as much as possible to the short diagonals; whether no edge need
    /// push.
    fn divide(&mut self, cells: &Cells, free: f64, shear: f64) -> bool {
        for plane in &mut self.planes {
            plane.shear = shear;
        }
        self.axial = self.axial_stiffness(free);
        const STEPS: u32 = 64;
        for step in (1..=STEPS).rev() {
            let share = f64::from(step) / f64::from(STEPS);
            for plane in &mut self.planes {
                plane.layers[0].share = share;
                plane.layers[1].share = 1.0 - share;
            }
            if (0..3).all(|axis| self.edges_pull(axis, cells)) {
                return true;
            }
        }
        false
    }

    fn edges_pull(&self, axis: usize, cells: &Cells) -> bool {
        let of_plane = |plane: &Diagonals| {
            let [short, long] = plane.greatest(axis, cells);
            plane.shear * (plane.layers[0].share * short + plane.layers[1].share * long)
        };
        let planes = self.planes.iter().filter(|plane| plane.axes.contains(&axis));
        planes.map(of_plane).sum::<f64>() <= (1.0 - LEAST_OF_EDGES) * self.axial[axis]
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
        assert!(plane.layers[1].share > 0.5 && plane.layers[0].share > 0.0);
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
        assert_eq!(groups(10, 1.0), (0..=10).collect::<Vec<_>>());
        assert_eq!(groups(10, 4.0), [0, 3, 7, 10]);
        assert_eq!(groups(2, 9.0), [0, 2]);
    }
}
