//! Sleeping spheres in a grid, to find those that something comes near.

use bevy::math::{UVec3, Vec3};

use crate::solver::buckets::Buckets;
use crate::solver::particles::Particles;
use crate::solver::state::Version;

use super::memory::SleepMemory;

/// Number of cells a sphere, at most; so memory stays linear in their number.
const CELLS_PER_SPHERE: f32 = 4.0;

/// Where the sleepers are: a cache.
#[derive(Debug, Clone, Default)]
pub(super) struct SleepingSpheres {
    /// The slots of the spheres that reach into each cell.
    cells: Buckets<u32>,
    least: Vec3,
    most: Vec3,
    /// Side of a cell, m.
    side: f32,
    dimensions: UVec3,
    version: Option<Version>,
}

impl SleepingSpheres {
    /// Makes them those that sleep now.
    pub fn refresh(&mut self, memory: &SleepMemory, particles: &Particles) {
        if self.version == Some(memory.version) {
            return;
        }
        self.version = Some(memory.version);
        let sphere = |slot: usize| (particles.position.get(slot), particles.radius()[slot]);
        let spheres =
            || (0..particles.len()).filter(|slot| memory.is_asleep(*slot) && particles.radius()[*slot] > 0.0);
        let (mut count, mut radii) = (0.0, 0.0);
        (self.least, self.most) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for (centre, radius) in spheres().map(sphere) {
            (count, radii) = (count + 1.0, radii + radius);
            self.least = self.least.min(centre - radius);
            self.most = self.most.max(centre + radius);
        }
        if count == 0.0 {
            self.cells.fill(0, |_| {});
            return;
        }
        let extent = self.most - self.least;
        self.side = (2.0 * radii / count).max(extent.max_element() * 1e-3).max(f32::MIN_POSITIVE);
        let cells = |side: f32| (extent / side).floor() + 1.0;
        while cells(self.side).element_product() > CELLS_PER_SPHERE * count + 64.0 {
            self.side *= 1.25;
        }
        self.dimensions = cells(self.side).as_uvec3();
        let mut lists = std::mem::take(&mut self.cells);
        lists.fill(self.dimensions.element_product() as usize, |add| {
            for slot in spheres() {
                let (centre, radius) = sphere(slot);
                self.for_each_cell(centre, radius, |cell| add(cell, slot as u32));
            }
        });
        self.cells = lists;
    }

    /// Calls `visit` with the number of each cell that the box around a sphere reaches into.
    fn for_each_cell(&self, centre: Vec3, radius: f32, mut visit: impl FnMut(usize)) {
        let last = self.dimensions - UVec3::ONE;
        // Negative and huge coordinates saturate.
        let cell = |point: Vec3| ((point - self.least) / self.side).as_uvec3().min(last);
        let (from, to) = (cell(centre - radius), cell(centre + radius));
        for z in from.z..=to.z {
            for y in from.y..=to.y {
                for x in from.x..=to.x {
                    visit(((z * self.dimensions.y + y) * self.dimensions.x + x) as usize);
                }
            }
        }
    }

    /// Calls `found` with the slot of each sleeper between which and a sphere there is a gap of `reach` m at most; with
    /// some of them more than once.
    pub fn near(
        &self,
        particles: &Particles,
        (centre, radius): (Vec3, f32),
        reach: f32,
        mut found: impl FnMut(usize),
    ) {
        let grown = radius + reach;
        let is_apart = (centre + grown).cmplt(self.least).any() || (centre - grown).cmpgt(self.most).any();
        if self.cells.is_empty() || is_apart || !grown.is_finite() || !centre.is_finite() {
            return;
        }
        self.for_each_cell(centre, grown, |cell| {
            for &slot in self.cells.of(cell) {
                let reach = grown + particles.radius()[slot as usize];
                if particles.position.get(slot as usize).distance_squared(centre) <= reach * reach {
                    found(slot as usize);
                }
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_near_is_found_and_nothing_else() {
        let (mut particles, mut memory) = (Particles::default(), SleepMemory::default());
        for slot in 0..500_u32 {
            let place = Vec3::new((slot % 10) as f32, (slot / 10 % 5) as f32, (slot / 50) as f32);
            particles.push(place, Vec3::ZERO, 1.0, if slot == 77 { 3.0 } else { 0.3 });
        }
        memory.resize(500);
        (0..400).for_each(|slot| memory.group[slot] = 1);
        let mut spheres = SleepingSpheres::default();
        memory.version = Version::new();
        spheres.refresh(&memory, &particles);
        for (centre, radius, reach) in [
            (Vec3::new(4.2, 2.1, 3.3), 0.4, 0.2),
            (Vec3::splat(-3.0), 0.5, 1e3),
            (Vec3::splat(40.0), 0.5, 1.0),
        ] {
            let mut found = Vec::new();
            spheres.near(&particles, (centre, radius), reach, |slot| found.push(slot));
            found.sort_unstable();
            found.dedup();
            let gap = |slot: &usize| {
                particles.position.get(*slot).distance(centre) - particles.radius()[*slot] - radius
            };
            let expected: Vec<usize> = (0..400).filter(|slot| gap(slot) <= reach).collect();
            assert_eq!(found, expected);
        }
    }
}
