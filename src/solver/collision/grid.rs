//! Broad phase: which spheres may touch, by a uniform grid for each class of size.
//!
//! Spheres are sorted into cells by counting (count, prefix sum, fill) in flat arrays. Two things keep
//! it linear in the number of spheres whatever their arrangement: cells are numbered by a hash of
//! their coordinates, so that a sphere far away costs no empty cells; and spheres with sizes that differ
//! by more than a factor of two are in grids of different cell sizes, so that a cell never holds very
//! many small spheres because of one large one. (Hashed grids: Teschner et al., *Optimized spatial
//! hashing for collision detection of deformable objects*, VMV 2003. Several grids: Eitz and Gu,
//! *Hierarchical spatial hashing for real-time collision detection*, SMI 2007.)

use std::ops::{ControlFlow, Range};

use bevy::math::{IVec3, Vec3, Vec4};

use super::all_pairs::AllPairs;
use super::cells::{Label, Row, bucket, cell_of};
use super::crowds::{CHECKED_PARTNERS, CROWDED_PARTNERS, push_pair};
use crate::solver::parallel;
use crate::solver::particles::Vectors;

/// Spheres tested together.
const LANES: usize = 4;

/// Number of smaller partners that a sphere finds, at most.
const MAX_SMALLER_PARTNERS: usize = 4096;

/// Number of spheres up to which all are tested against all.
const MAX_TESTED_AGAINST_ALL: usize = 256;

/// Number of size classes: one for each exponent of an f32.
const CLASSES: usize = 256;

/// Number of their cells away up to which a sphere searches smaller ones.
const MAX_RANGE: f32 = 8.0;

/// A sphere, as it is tested against others.
#[derive(Debug, Clone, Copy, Default)]
struct Sphere {
    center: Vec3,
    reach: f32,
}

/// The spheres of one class search those of another: in the cells up to `range` from their own.
#[derive(Debug, Clone, Copy)]
struct Search {
    from: u32,
    to: u32,
    range: i32,
}

/// Number of spheres that are one part of the search.
const SPHERES_PER_PART: usize = 1024;

/// Number of parts from which on they are shared among threads: fewer cost less than to wake them.
const MIN_SHARED_PARTS: usize = 4;

/// The grid. Its arrays are kept between uses.
#[derive(Debug, Clone, Default)]
pub(super) struct Grid {
    /// The cell size of each class, m; 0 for a class without spheres.
    cell_sizes: Vec<f32>,
    /// The number of spheres of each class.
    counts: Vec<u32>,
    searches: Vec<Search>,
    unsorted: Vec<(Sphere, Label)>,
    all_pairs: AllPairs,
    /// The spheres in the order of their buckets: centers and reaches, padded for whole vectors at the end.
    centers: Vectors,
    reach: Vec<f32>,
    labels: Vec<Label>,
    /// `bucket_starts[b]..bucket_starts[b + 1]` are the spheres of bucket b.
    bucket_starts: Vec<u32>,
    mask: u32,
    /// The pairs that each part of the search has found.
    found: Vec<Vec<(u32, u32)>>,
}

/// The rows of cells (y, z) beside a cell's own that come after it in some order, so that each pair of
/// cells is seen once.
const LATER_ROWS: [(i32, i32); 4] = [(1, -1), (1, 0), (1, 1), (0, 1)];

impl Grid {
    /// Lists in `pairs` each pair of overlapping spheres once, in no particular but always the same order:
    /// those of slots that `may_collide`. Spheres are (slot, center, reach > 0). Of one that `is_crowded` by the pairs that are listed so far
    /// only the first few are kept.
    pub fn find_pairs(
        &mut self,
        spheres: impl Iterator<Item = (u32, Vec3, f32)>,
        (may_collide, is_crowded): (
            impl Fn(u32, u32) -> bool + Sync,
            impl Fn(u32, &[(u32, u32)]) -> bool + Sync,
        ),
        pairs: &mut Vec<(u32, u32)>,
    ) {
        self.unsorted.clear();
        self.unsorted.extend(spheres.map(|(slot, center, reach)| {
            (Sphere { center, reach }, Label { slot, class: 0, cell: IVec3::ZERO })
        }));
        if self.unsorted.len() <= MAX_TESTED_AGAINST_ALL {
            self.find_few(may_collide, is_crowded, pairs);
            return;
        }
        self.sort();
        self.plan_searches();
        let count = self.labels.len();
        let mut found = std::mem::take(&mut self.found);
        found.resize_with(count.div_ceil(SPHERES_PER_PART), Vec::new);
        let parallel = found.len() >= MIN_SHARED_PARTS;
        parallel::for_each(found.iter_mut().enumerate(), parallel, |(part, found)| {
            found.clear();
            for index in part * SPHERES_PER_PART..count.min((part + 1) * SPHERES_PER_PART) {
                self.search(index, (&may_collide, &is_crowded), found);
            }
        });
        pairs.clear();
        pairs.extend(found.iter().flatten());
        self.found = found;
    }

    /// Finds the spheres that overlap the one at `index` and come after it in some order.
    fn search(
        &self,
        index: usize,
        (may_collide, is_crowded): (impl Fn(u32, u32) -> bool, impl Fn(u32, &[(u32, u32)]) -> bool),
        found: &mut Vec<(u32, u32)>,
    ) {
        let Label { class, cell, .. } = self.labels[index];
        let list = |found: &mut Vec<(u32, u32)>, from: (usize, usize), a: u32, b: u32| {
            if may_collide(a, b) && push_pair(found, from, (a, b), &is_crowded) {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        };
        let first = found.len();
        let in_crowd = {
            let mut add = |a, b| list(found, (first, CHECKED_PARTNERS), a, b);
            let rows = || LATER_ROWS.map(|(y, z)| cell.wrapping_add(IVec3::new(-1, y, z)));
            self.visit(index, Row { class, cell, count: 2 }, Some(index + 1), &mut add).is_break()
                || rows()
                    .into_iter()
                    .any(|cell| self.visit(index, Row { class, cell, count: 3 }, None, &mut add).is_break())
        };
        if in_crowd {
            found.truncate(first + CROWDED_PARTNERS);
        }
        for search in self.searches.iter().filter(|search| search.from == class) {
            let is_smaller = self.cell_sizes[search.to as usize] < self.cell_sizes[class as usize];
            let first = found.len();
            let checked = if is_smaller { MAX_SMALLER_PARTNERS } else { CHECKED_PARTNERS };
            let mut add = |a, b| list(found, (first, checked), a, b);
            if self.search_class(index, *search, &mut add).is_break() && !is_smaller {
                found.truncate(first + CROWDED_PARTNERS);
            }
        }
    }

    /// Finds the spheres of another class that overlap the one at `index`.
    fn search_class(
        &self,
        index: usize,
        Search { to, range, .. }: Search,
        found: &mut impl FnMut(u32, u32) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let corner = cell_of(self.centers.get(index), self.cell_sizes[to as usize]);
        for (y, z) in (-range..=range).flat_map(|y| (-range..=range).map(move |z| (y, z))) {
            let cell = corner.wrapping_add(IVec3::new(-range, y, z));
            self.visit(index, Row { class: to, cell, count: 2 * range + 1 }, None, found)?;
        }
        ControlFlow::Continue(())
    }

    /// Lists the overlapping ones of a few spheres, which are in no cells.
    fn find_few(
        &mut self,
        may_collide: impl Fn(u32, u32) -> bool,
        is_crowded: impl Fn(u32, &[(u32, u32)]) -> bool,
        pairs: &mut Vec<(u32, u32)>,
    ) {
        pairs.clear();
        self.all_pairs
            .set(self.unsorted.iter().map(|(Sphere { center, reach }, label)| (label.slot, *center, *reach)));
        // The first sphere of the last pair, and the number of pairs before its own.
        let (mut last, mut before) = (0, 0);
        self.all_pairs.for_each_pair(|one, [a, b]| {
            if one != last {
                (last, before) = (one, pairs.len());
            }
            let in_crowd =
                may_collide(a, b) && push_pair(pairs, (before, CHECKED_PARTNERS), (a, b), &is_crowded);
            if in_crowd {
                pairs.truncate(before + CROWDED_PARTNERS);
            }
            !in_crowd
        });
    }

    /// Sorts the spheres into their cells.
    fn sort(&mut self) {
        self.cell_sizes.clear();
        self.cell_sizes.resize(CLASSES, 0.0);
        self.counts.clear();
        self.counts.resize(CLASSES, 0);
        for (sphere, label) in &mut self.unsorted {
            // The exponent of the diameter: spheres of one class differ by less than a factor of two.
            label.class = (2.0 * sphere.reach).to_bits() >> 23;
            let size = &mut self.cell_sizes[label.class as usize];
            *size = size.max(2.0 * sphere.reach);
            self.counts[label.class as usize] += 1;
        }
        // More buckets than the longest row of cells, so that its cells come into different ones.
        let buckets = (2 * self.unsorted.len()).next_power_of_two().max(MAX_RANGE as usize * 4);
        self.mask = buckets as u32 - 1;
        self.bucket_starts.clear();
        self.bucket_starts.resize(buckets + 1, 0);
        for (sphere, label) in &mut self.unsorted {
            label.cell = cell_of(sphere.center, self.cell_sizes[label.class as usize]);
            self.bucket_starts[bucket(label.class, label.cell, self.mask)] += 1;
        }
        let mut total = 0;
        for start in &mut self.bucket_starts {
            total += *start;
            *start = total;
        }
        // Filled from behind, so that each count becomes the start of its bucket.
        let count = self.unsorted.len();
        self.centers.resize(count + LANES);
        self.reach.resize(count + LANES, 0.0);
        self.labels.resize(count, Label::default());
        for (sphere, label) in self.unsorted.iter().rev() {
            let start = &mut self.bucket_starts[bucket(label.class, label.cell, self.mask)];
            *start -= 1;
            self.centers.set(*start as usize, sphere.center);
            self.reach[*start as usize] = sphere.reach;
            self.labels[*start as usize] = *label;
        }
    }

    /// Which classes search which: of two, the one that has fewer cells to visit searches.
    fn plan_searches(&mut self) {
        let Self { cell_sizes, counts, searches, .. } = self;
        searches.clear();
        let present = |class: &u32| counts[*class as usize] > 0;
        for small in (0..CLASSES as u32).filter(present) {
            for large in (small + 1..CLASSES as u32).filter(present) {
                let ratio = cell_sizes[large as usize] / cell_sizes[small as usize];
                // Number of small cells that half a cell of either class reaches.
                let range = (0.5 * (ratio + 1.0)).ceil();
                let rows = (2.0 * range + 1.0) * (2.0 * range + 1.0);
                let from_large = counts[large as usize] as f32 * rows;
                searches.push(if range <= MAX_RANGE && from_large < counts[small as usize] as f32 * 9.0 {
                    Search { from: large, to: small, range: range as i32 }
                } else {
                    Search { from: small, to: large, range: 1 }
                });
            }
        }
    }

    /// Tests the sphere at `index` against all spheres of a row of cells, or those from `start` on; the row lies in buckets in
    /// a row too.
    #[inline]
    fn visit(
        &self,
        index: usize,
        row: Row,
        start: Option<usize>,
        found: &mut impl FnMut(u32, u32) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let first = bucket(row.class, row.cell, self.mask);
        let end = first + row.count as usize;
        let buckets = self.bucket_starts.len() - 1;
        let start = start.unwrap_or(self.bucket_starts[first] as usize);
        if end <= buckets {
            self.test(index, start..self.bucket_starts[end] as usize, row, found)
        } else {
            self.test(index, start..self.labels.len(), row, found)?;
            let wrapped = self.bucket_starts[end - buckets] as usize;
            self.test(index, 0..wrapped, row, found)
        }
    }

    /// Reports which of `others` overlap the sphere at `index` and lie in one of the cells of
    /// `row`, as a bucket may hold several; until it is to break off.
    #[inline]
    fn test(
        &self,
        index: usize,
        others: Range<usize>,
        row: Row,
        found: &mut impl FnMut(u32, u32) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let Sphere { center, reach } = self.sphere(index);
        let centers = [center.x, center.y, center.z].map(Vec4::splat);
        for first in others.clone().step_by(LANES) {
            // Four at a time and without a branch: one in ten is near, no processor could guess which.
            let four = |array: &[f32]| Vec4::from_slice(&array[first..]);
            let [x, y, z] = self.centers.axes();
            let away = [four(x) - centers[0], four(y) - centers[1], four(z) - centers[2]];
            let reach = four(&self.reach) + reach;
            let distance_squared = away[0] * away[0] + away[1] * away[1] + away[2] * away[2];
            let mut near = distance_squared.cmple(reach * reach).bitmask();
            near &= (1 << (others.end - first).min(LANES)) - 1;
            while near != 0 {
                let label = &self.labels[first + near.trailing_zeros() as usize];
                near &= near - 1;
                if row.contains(label) {
                    found(self.labels[index].slot, label.slot)?;
                }
            }
        }
        ControlFlow::Continue(())
    }

    fn sphere(&self, index: usize) -> Sphere {
        Sphere { center: self.centers.get(index), reach: self.reach[index] }
    }
}

#[cfg(test)]
mod tests {
    use super::super::crowds::MAX_PARTNERS;
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
        Grid::default().find_pairs(
            numbered,
            (|_, _| true, |_, listed| listed.len() >= MAX_PARTNERS),
            &mut pairs,
        );
        for (a, b) in &mut pairs {
            (*a, *b) = (*a.min(b), *a.max(b));
        }
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
        for spread in [1.5, 3.0, 40.0] {
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
    fn crowded_spheres_have_few_partners() {
        let crowd = pairs_of(&vec![(Vec3::ONE, 0.1); 3000]).len();
        assert_eq!(crowd, (3000 - MAX_PARTNERS) * CROWDED_PARTNERS + MAX_PARTNERS * (MAX_PARTNERS - 1) / 2);
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
