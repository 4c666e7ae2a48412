//! Broad phase: which spheres may touch, by a uniform grid for each class of size.
//!
//! Spheres are sorted into cells by counting (count, prefix sum, fill) in flat arrays. Two things keep
//! it linear in the number of spheres whatever their arrangement: cells are numbered by a hash of
//! their coordinates, so that a sphere far away costs no empty cells; and spheres whose sizes differ
//! by more than a factor of two live in grids of different cell sizes, so that a cell never holds a
//! crowd of small spheres because of one large one. (Hashed grids: Teschner et al., *Optimized spatial
//! hashing for collision detection of deformable objects*, VMV 2003. Several grids: Eitz and Gu,
//! *Hierarchical spatial hashing for real-time collision detection*, SMI 2007.)

use bevy::math::{IVec3, Vec3};

/// Number of size classes: one for each exponent of an f32.
const CLASSES: usize = 256;

/// A sphere in its cell.
#[derive(Debug, Clone, Copy, Default)]
struct Entry {
    cell: IVec3,
    class: u32,
    slot: u32,
    center: Vec3,
    reach: f32,
}

/// The grid. Its arrays are kept between uses.
#[derive(Debug, Clone, Default)]
pub(super) struct Grid {
    /// The cell size of each class, m; 0 for a class without spheres.
    cell_sizes: Vec<f32>,
    unsorted: Vec<Entry>,
    entries: Vec<Entry>,
    /// `bucket_starts[b]..bucket_starts[b + 1]` are the entries of bucket b.
    bucket_starts: Vec<u32>,
    mask: u32,
}

/// The rows of cells (y, z) beside a cell's own that come after it in some order, so that each pair of
/// cells is seen once.
const LATER_ROWS: [(i32, i32); 4] = [(1, -1), (1, 0), (1, 1), (0, 1)];

impl Grid {
    /// Calls `found(a, b)` once for each pair of overlapping spheres, in no particular but always the
    /// same order. Spheres are (slot, center, reach > 0).
    pub fn for_each_pair(
        &mut self,
        spheres: impl Iterator<Item = (u32, Vec3, f32)>,
        mut found: impl FnMut(u32, u32),
    ) {
        self.fill(spheres);
        let present: Vec<u32> =
            (0..CLASSES as u32).filter(|class| self.cell_sizes[*class as usize] > 0.0).collect();
        for (index, entry) in self.entries.iter().enumerate() {
            let cell = entry.cell;
            for other in &self.entries[index + 1..self.bucket_end(entry)] {
                test(entry, entry.class, cell, 1, other, &mut found);
            }
            self.visit(entry, entry.class, cell.wrapping_add(IVec3::X), 1, &mut found);
            for (y, z) in LATER_ROWS {
                self.visit(entry, entry.class, cell.wrapping_add(IVec3::new(-1, y, z)), 3, &mut found);
            }
            for &class in present.iter().filter(|class| **class > entry.class) {
                let center = cell_of(entry.center, self.cell_sizes[class as usize]);
                for row in 0..9 {
                    let offset = IVec3::new(-1, row % 3 - 1, row / 3 - 1);
                    self.visit(entry, class, center.wrapping_add(offset), 3, &mut found);
                }
            }
        }
    }

    /// Sorts the spheres into their cells.
    fn fill(&mut self, spheres: impl Iterator<Item = (u32, Vec3, f32)>) {
        self.cell_sizes.clear();
        self.cell_sizes.resize(CLASSES, 0.0);
        self.unsorted.clear();
        for (slot, center, reach) in spheres {
            // The exponent of the diameter: spheres of one class differ by less than a factor of two.
            let class = (2.0 * reach).to_bits() >> 23;
            let size = &mut self.cell_sizes[class as usize];
            *size = size.max(2.0 * reach);
            self.unsorted.push(Entry { cell: IVec3::ZERO, class, slot, center, reach });
        }
        // At least four, so that three in a row are three different ones.
        let buckets = (2 * self.unsorted.len()).next_power_of_two().max(4);
        self.mask = buckets as u32 - 1;
        self.bucket_starts.clear();
        self.bucket_starts.resize(buckets + 1, 0);
        for entry in &mut self.unsorted {
            entry.cell = cell_of(entry.center, self.cell_sizes[entry.class as usize]);
            self.bucket_starts[bucket(entry.class, entry.cell, self.mask)] += 1;
        }
        let mut total = 0;
        for start in &mut self.bucket_starts {
            total += *start;
            *start = total;
        }
        // Filled from behind, so that each count becomes the start of its bucket.
        self.entries.clear();
        self.entries.resize(self.unsorted.len(), Entry::default());
        for entry in self.unsorted.iter().rev() {
            let start = &mut self.bucket_starts[bucket(entry.class, entry.cell, self.mask)];
            *start -= 1;
            self.entries[*start as usize] = *entry;
        }
    }

    fn bucket_end(&self, entry: &Entry) -> usize {
        self.bucket_starts[bucket(entry.class, entry.cell, self.mask) + 1] as usize
    }

    /// Tests `entry` against all spheres of `count` cells in a row along x, which lie in buckets in a
    /// row too.
    fn visit(&self, entry: &Entry, class: u32, cell: IVec3, count: u32, found: &mut impl FnMut(u32, u32)) {
        let first = bucket(class, cell, self.mask);
        let end = first + count as usize;
        let buckets = self.bucket_starts.len() - 1;
        let (end, wrapped) = if end <= buckets { (end, 0) } else { (buckets, end - buckets) };
        for range in [first..end, 0..wrapped] {
            let entries = self.bucket_starts[range.start] as usize..self.bucket_starts[range.end] as usize;
            for other in &self.entries[entries] {
                test(entry, class, cell, count, other, found);
            }
        }
    }
}

/// Reports the pair if `other` overlaps and lies in one of the cells that were meant: a bucket may
/// serve several.
#[inline]
fn test(entry: &Entry, class: u32, cell: IVec3, count: u32, other: &Entry, found: &mut impl FnMut(u32, u32)) {
    let reach = entry.reach + other.reach;
    if entry.center.distance_squared(other.center) <= reach * reach
        && other.class == class
        && other.cell.y == cell.y
        && other.cell.z == cell.z
        && (other.cell.x.wrapping_sub(cell.x) as u32) < count
    {
        found(entry.slot, other.slot);
    }
}

/// The cell of a point. Points too far away for an i32 share the outermost cells.
fn cell_of(point: Vec3, size: f32) -> IVec3 {
    (point / size).floor().as_ivec3()
}

/// The bucket of a cell: a multiplicative hash of its row (Teschner et al. 2003), and from there along
/// x, so that the cells of a row lie side by side.
#[inline]
fn bucket(class: u32, cell: IVec3, mask: u32) -> usize {
    let row = (cell.y as u32).wrapping_mul(19_349_663)
        ^ (cell.z as u32).wrapping_mul(83_492_791)
        ^ class.wrapping_mul(2_654_435_761);
    ((row ^ (row >> 15)).wrapping_add(cell.x as u32) & mask) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pseudo-random numbers in 0..1, always the same (a linear congruential generator).
    fn random(seed: &mut u32) -> f32 {
        *seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (*seed >> 8) as f32 / (1 << 24) as f32
    }

    fn pairs_of(spheres: &[(Vec3, f32)]) -> Vec<(u32, u32)> {
        let mut pairs = Vec::new();
        let numbered =
            spheres.iter().enumerate().map(|(slot, (center, reach))| (slot as u32, *center, *reach));
        Grid::default().for_each_pair(numbered, |a, b| pairs.push((a.min(b), a.max(b))));
        pairs.sort_unstable();
        pairs
    }

    fn all_pairs(spheres: &[(Vec3, f32)]) -> Vec<(u32, u32)> {
        let mut pairs = Vec::new();
        for (a, (center, reach)) in spheres.iter().enumerate() {
            for (b, (other, other_reach)) in spheres.iter().enumerate().skip(a + 1) {
                if center.distance_squared(*other) <= (reach + other_reach) * (reach + other_reach) {
                    pairs.push((a as u32, b as u32));
                }
            }
        }
        pairs
    }

    #[test]
    fn finds_the_same_pairs_as_testing_all() {
        let mut seed = 7;
        for spread in [0.5, 3.0, 40.0] {
            for smallest in [1.0_f32, 0.3, 0.01] {
                let spheres: Vec<_> = (0..400)
                    .map(|_| {
                        let center =
                            Vec3::from_array(std::array::from_fn(|_| random(&mut seed) - 0.5)) * spread;
                        (center, 0.2 * smallest.max(random(&mut seed).powi(4)))
                    })
                    .collect();
                assert_eq!(pairs_of(&spheres), all_pairs(&spheres), "spread {spread}, smallest {smallest}");
            }
        }
    }

    #[test]
    fn coincident_and_faraway_spheres() {
        let far = Vec3::splat(1e20);
        let spheres = [(Vec3::ZERO, 0.1), (Vec3::ZERO, 0.1), (far, 0.1), (far, 0.1), (-far, 0.1)];
        assert_eq!(pairs_of(&spheres), [(0, 1), (2, 3)]);
        assert_eq!(pairs_of(&[]), []);
        assert_eq!(pairs_of(&[(Vec3::NAN, 0.1), (Vec3::ZERO, 0.1)]), []);
    }
}
