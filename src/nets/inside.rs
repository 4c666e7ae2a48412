//! How much of each cell of a box is inside a closed mesh.

use bevy::math::{DVec3, Vec3};

use super::weld::Welded;

/// A box of cubes around a mesh.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Voxels {
    /// Its least corner, m.
    pub origin: DVec3,
    /// The side of a cube, m.
    pub size: f64,
    /// The number of cubes along each axis.
    pub counts: [u32; 3],
    /// The part of each cube that is inside, 0 to 1; along X first, then Y, then Z.
    pub filled: Vec<f32>,
}

/// Lines through a cube, along each of its two sides.
const LINES: u32 = 4;

/// Lines are not in the middles of their parts of the cube, but beside them by this part of the distance between
/// lines: vertices and edges of meshes that people make are in the middles and at the sides.
const ASIDE: [f64; 2] = [0.017_320_5, 0.022_360_7];

impl Voxels {
    /// The box of cubes of `size` with as little beside the mesh as can be, the same on both sides.
    pub fn around(positions: &[Vec3], size: f64) -> Self {
        let least = positions.iter().copied().reduce(Vec3::min).unwrap_or_default().as_dvec3();
        let most = positions.iter().copied().reduce(Vec3::max).unwrap_or_default().as_dvec3();
        // An extent that is a multiple of the size but for its rounding is one.
        let counts =
            ((most - least) / size * (1.0 - 1e-6)).to_array().map(|count| (count.ceil() as u32).max(1));
        let whole = DVec3::from_array(counts.map(f64::from)) * size;
        let origin = 0.5 * (least + most) - 0.5 * whole;
        Self { origin, size, counts, filled: Vec::new() }
    }

    /// The index of a cube.
    pub fn index(&self, [i, j, k]: [u32; 3]) -> usize {
        let [x, y, _] = self.counts.map(|count| count as usize);
        (k as usize * y + j as usize) * x + i as usize
    }

    /// Fills the box: lines along X are cut by the triangles, and are inside where they have run into the mesh more
    /// often than out of it.
    pub fn fill(&mut self, mesh: &Welded) {
        let rows = self.counts[1] as usize * LINES as usize;
        let lines = rows * self.counts[2] as usize * LINES as usize;
        let mut cuts: Vec<Vec<(f64, i32)>> = vec![Vec::new(); lines];
        for corners in &mesh.triangles {
            let corners = corners.map(|corner| mesh.positions[corner as usize].as_dvec3() - self.origin);
            self.cut(corners, rows, &mut cuts);
        }
        let cells = self.counts.iter().map(|count| *count as usize).product();
        let mut filled = vec![0.0_f64; cells];
        for (line, cuts) in cuts.iter_mut().enumerate() {
            cuts.sort_by(|one, other| one.0.total_cmp(&other.0).then(one.1.cmp(&other.1)));
            // A line that does not come out again has grazed an edge.
            if cuts.iter().map(|cut| cut.1).sum::<i32>() != 0 {
                continue;
            }
            let (j, k) = ((line % rows) as u32 / LINES, (line / rows) as u32 / LINES);
            let first = self.index([0, j, k]);
            let row = &mut filled[first..first + self.counts[0] as usize];
            let mut depth = 0;
            for pair in cuts.windows(2) {
                depth += pair[0].1;
                if depth > 0 {
                    self.add(row, pair[0].0, pair[1].0);
                }
            }
        }
        let part = 1.0 / f64::from(LINES * LINES);
        self.filled = filled.iter().map(|sum| (sum * part) as f32).collect();
    }

    /// The places where lines run into (1) or out of (−1) a triangle.
    fn cut(&self, [a, b, c]: [DVec3; 3], rows: usize, cuts: &mut [Vec<(f64, i32)>]) {
        let spacing = self.size / f64::from(LINES);
        let normal = (b - a).cross(c - a);
        if normal.x == 0.0 {
            return;
        }
        let range = |values: [f64; 3], aside: f64, count: u32| {
            let least = values.iter().copied().fold(f64::INFINITY, f64::min) / spacing;
            let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max) / spacing;
            let first = (least - 0.5 - aside).ceil().max(0.0) as u32;
            let end = (most + 0.5 - aside).ceil().max(0.0) as u32;
            first..end.min(count * LINES)
        };
        for z in range([a.z, b.z, c.z], ASIDE[1], self.counts[2]) {
            for y in range([a.y, b.y, c.y], ASIDE[0], self.counts[1]) {
                let at = |index: u32, aside: f64| (f64::from(index) + 0.5 + aside) * spacing;
                let (py, pz) = (at(y, ASIDE[0]), at(z, ASIDE[1]));
                let side = |from: DVec3, to: DVec3| {
                    // The same bits for both triangles of an edge, with opposite signs: none of the two has it twice.
                    let is_forward = (from.y, from.z) < (to.y, to.z);
                    let (low, high) = if is_forward { (from, to) } else { (to, from) };
                    let area = (high.y - low.y) * (pz - low.z) - (high.z - low.z) * (py - low.y);
                    (area > 0.0) == is_forward
                };
                let is_left = [side(a, b), side(b, c), side(c, a)];
                if is_left.iter().all(|left| *left) || is_left.iter().all(|left| !*left) {
                    let x = a.x - ((py - a.y) * normal.y + (pz - a.z) * normal.z) / normal.x;
                    cuts[z as usize * rows + y as usize].push((x, if normal.x < 0.0 { 1 } else { -1 }));
                }
            }
        }
    }

    /// Adds the part of each cell of a row that is between two places.
    fn add(&self, row: &mut [f64], from: f64, to: f64) {
        let last = row.len() as f64;
        let (from, to) = ((from / self.size).clamp(0.0, last), (to / self.size).clamp(0.0, last));
        for cell in from as usize..(to.ceil() as usize).min(row.len()) {
            let start = cell as f64;
            row[cell] += (to.min(start + 1.0) - from.max(start)).max(0.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::icosphere::icosphere;
    use super::*;

    /// The volume of a polyhedron by lines: each cut is exact, and lines are spaced evenly; the error of the midpoint
    /// rule on 16² lines or more across a ball is below 1 %.
    #[test]
    fn the_filled_volume_is_that_of_the_mesh() {
        let (positions, triangles) = icosphere(Vec3::new(3.0, -1.0, 0.5), 1.0, 3);
        let mesh = Welded::unwelded(positions, triangles);
        let mut voxels = Voxels::around(&mesh.positions, 0.25);
        voxels.fill(&mesh);
        assert_eq!(voxels.counts, [8; 3]);
        let volume: f64 = voxels.filled.iter().map(|part| f64::from(*part)).sum::<f64>() * 0.25_f64.powi(3);
        assert!((volume / mesh.volume() - 1.0).abs() < 0.01, "{volume} {}", mesh.volume());
        assert_eq!(voxels.filled[voxels.index([0, 0, 0])], 0.0);
        assert!((voxels.filled[voxels.index([4, 3, 4])] - 1.0).abs() < 1e-6);
    }
}
