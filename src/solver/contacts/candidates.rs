//! The pairs of particles that may touch, kept as long as nobody has moved far (a Verlet list).
//!
//! Each particle is given a *skin*: a pair is a candidate when their spheres, skins included, overlap.
//! Until a particle has moved by more than its skin no other pair can touch, so the grid is rebuilt
//! only then; a settled pile never rebuilds it. (Verlet, *Phys. Rev.* 159, 98, 1967.)

use bevy::math::Vec3;

use crate::solver::particles::{Particles, Vectors};
use crate::solver::springs::Springs;

use super::grid::Grid;
use super::joints::Joints;
use super::list::{Candidate, List, Past, slots};
use super::regions::{Groups, Regions};

/// The skins of slow particles, as a part of their radius: thin ones as long as lists last, which keeps them
/// short, wide ones when they do not, which makes new lists rarer.
const THIN_SKIN: f32 = 0.2;
const WIDE_SKIN: f32 = 0.4;

/// Wide skins are for lists of which a thin skin is outrun in fewer substeps: a new list of 10,000 balls in a
/// pile takes about as long as ten looks at the pairs that a wide skin adds.
const SHORT_LIFE: f32 = 10.0;

/// A particle is fast that would outrun the skin of slow ones within so many ticks. In a crowd, thick skins
/// are for a few: the first of these is taken that makes at most one particle in sixteen fast.
const PATIENCE: [f32; 4] = [4.0, 1.0, 0.25, 0.0];

/// From so many pairs a particle on it is a crowd, in which thick skins cost more than they spare,
const CROWD: usize = 8;

/// until there are fewer than so many.
const SCATTERED: usize = 1;

/// The candidate pairs.
#[derive(Debug, Clone, Default)]
pub(super) struct Candidates {
    /// In groups, each from the bottom of the world to the top.
    list: List,
    /// The list before a rebuild, from which the past is carried over.
    old: List,
    grid: Grid,
    /// The found pairs of slots.
    found: Vec<(u32, u32)>,
    /// The same in groups.
    grouped: Vec<(u32, u32)>,
    /// The heights of their middles, as sortable bits, and their places in the group.
    keys: Vec<u64>,
    /// The height of each particle, m.
    heights: Vec<f32>,
    /// Positions at the time of the last rebuild.
    origins: Vectors,
    skins: Vec<f32>,
    /// Whether any particle is more than a point.
    any_spheres: bool,
    /// Whether slow particles have wide skins.
    wide: bool,
    /// Substeps since the last rebuild.
    age: u32,
    joints: Joints,
    regions: Regions,
    groups: Groups,
    /// Whether particles have many neighbours.
    crowded: bool,
    stale: bool,
}

impl Candidates {
    /// There are `count` particles, and no pairs among them.
    pub fn disband(&mut self, count: usize) {
        self.clear();
        self.regions.unite(count);
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.list.clear();
        self.groups.clear();
        self.crowded = false;
        self.stale = true;
    }

    /// The particles were renumbered: `new_slots[old]` is the new slot of each, in the same order as
    /// before; `None` for those that are gone.
    pub fn renumber(&mut self, new_slots: &[Option<u32>], count: usize) {
        let List { pairs, slot_of, .. } = &mut self.list;
        let new_slot = |body: u32| new_slots.get(slot_of[body as usize] as usize).copied().flatten();
        pairs.retain_mut(|pair| {
            let (Some(lower), Some(upper)) = (new_slot(pair.lower), new_slot(pair.upper)) else {
                return false;
            };
            (pair.lower, pair.upper) = (lower, upper);
            true
        });
        // Until they are divided again.
        slot_of.clear();
        slot_of.extend(0..count as u32);
        self.list.index();
        self.stale = true;
    }

    /// Asks for a rebuild: a radius, a mass or a spring has changed.
    pub fn invalidate(&mut self) {
        self.stale = true;
    }

    /// Makes the list good for the present positions, for a while. `previous` are those at the start of
    /// the substep; `up` points against gravity, zero where there is none; `time_step` in s.
    pub fn refresh(
        &mut self,
        particles: &Particles,
        springs: &Springs,
        previous: &Vectors,
        up: Vec3,
        time_step: f32,
    ) {
        let stale = self.stale || self.skins.len() != particles.len();
        if stale {
            self.joints.rebuild(particles, springs);
        }
        self.age += 1;
        if stale || self.outrun(particles) {
            if !stale {
                self.wide = self.age as f32 * (THIN_SKIN / self.slow_skin()) < SHORT_LIFE;
            }
            self.age = 0;
            self.stale = false;
            self.choose_skins(particles, time_step);
            self.search(particles);
            if !self.crowded && self.found.len() > CROWD * particles.len() {
                self.crowded = true;
                self.choose_skins(particles, time_step);
                self.search(particles);
            }
            self.crowded &= self.found.len() >= SCATTERED * particles.len();
            std::mem::swap(&mut self.list, &mut self.old);
            self.regions.divide(particles, up);
            self.sort_bottom_up(particles, up);
            self.recall(particles, previous);
        }
    }

    /// Whether nobody may touch anybody.
    pub fn is_empty(&self) -> bool {
        self.list.pairs.is_empty()
    }

    /// The pairs, in groups and there from the bottom up; the groups; and how the bodies are ordered.
    pub fn pairs(&mut self) -> (&mut [Candidate], &mut Groups, &Regions) {
        (&mut self.list.pairs, &mut self.groups, &self.regions)
    }

    /// What is known of the springs.
    pub fn joints(&self) -> &Joints {
        &self.joints
    }

    /// The groups of the pairs.
    pub fn groups(&self) -> &Groups {
        &self.groups
    }

    /// The groups of the pairs.
    pub fn groups_mut(&mut self) -> &mut Groups {
        &mut self.groups
    }

    /// How the bodies are ordered.
    pub fn regions(&self) -> &Regions {
        &self.regions
    }

    /// Whether somebody has moved by more than its skin. What all have moved by together does not count:
    /// nobody comes closer to anybody by it.
    fn outrun(&self, particles: &Particles) -> bool {
        if !self.any_spheres {
            return false;
        }
        let [x, y, z] = particles.position.axes();
        let [origin_x, origin_y, origin_z] = self.origins.axes();
        let common =
            mean(particles.len(), |slot| particles.position.get(slot) - self.origins.get(slot)).to_array();
        let moved = x.iter().zip(origin_x).zip(y.iter().zip(origin_y)).zip(z.iter().zip(origin_z));
        moved.zip(&self.skins).any(|((((x, from_x), (y, from_y)), (z, from_z)), skin)| {
            let moved = [x - from_x - common[0], y - from_y - common[1], z - from_z - common[2]];
            Vec3::from_array(moved).length_squared() > skin * skin
        })
    }

    /// The skin of slow particles, as a part of their radius.
    fn slow_skin(&self) -> f32 {
        if self.wide { WIDE_SKIN } else { THIN_SKIN }
    }

    fn choose_skins(&mut self, particles: &Particles, time_step: f32) {
        self.origins.copy_from(&particles.position);
        self.any_spheres = particles.radius.iter().any(|radius| *radius > 0.0);
        // A sphere with a thick skin is twice as large as with the skin of a slow one, so that the two come into
        // different classes of the grid, and a few fast ones do not widen the cells of all.
        let slow_skin = self.slow_skin();
        let thick_skin = 1.0 + 2.0 * slow_skin;
        let common = mean(particles.len(), |slot| particles.velocity.get(slot));
        let is_fast = |slot: usize, patience: f32| {
            let travel = (particles.velocity.get(slot) - common).length() * patience * time_step;
            travel > slow_skin * particles.radius[slot]
        };
        let few = particles.len() / 16;
        let few_are_fast = |patience: &f32| {
            (0..particles.len()).filter(|slot| is_fast(*slot, *patience)).take(few + 1).count() <= few
        };
        let patience = if self.crowded { PATIENCE.into_iter().find(few_are_fast) } else { None };
        let patience = patience.unwrap_or(PATIENCE[0]);
        self.skins.clear();
        self.skins.extend(particles.radius.iter().enumerate().map(|(slot, &radius)| match radius {
            0.0 => f32::INFINITY,
            _ if is_fast(slot, patience) => thick_skin * radius,
            _ => slow_skin * radius,
        }));
    }

    /// Finds the pairs.
    fn search(&mut self, particles: &Particles) {
        let Self { grid, found, skins, joints, .. } = self;
        let spheres = (0..particles.len())
            .filter(|slot| particles.radius[*slot] > 0.0)
            .map(|slot| (slot as u32, particles.position.get(slot), particles.radius[slot] + skins[slot]));
        let meet = |a: u32, b: u32| {
            let free = particles.inverse_mass[a as usize] + particles.inverse_mass[b as usize] > 0.0;
            free && !joints.overlap_at_rest(a.min(b), a.max(b))
        };
        grid.find_pairs(spheres, meet, found);
    }

    /// Lists the pairs of each group by the height of their middle: whatever carries a pair comes before it.
    /// (Not by that of the lower particle: pairs in a row that share one would have to wait for each other.)
    fn sort_bottom_up(&mut self, particles: &Particles, up: Vec3) {
        let Self { list, heights, keys, found, grouped, regions, groups, .. } = self;
        groups.arrange(regions, found, grouped);
        heights.clear();
        heights.extend((0..particles.len()).map(|slot| particles.position.get(slot).dot(up)));
        keys.resize(found.len(), 0);
        list.pairs.resize(found.len(), Candidate { lower: 0, upper: 0, past: Past::Apart });
        list.slot_of.clone_from(&regions.slot_of);
        let height = |slot: u32| heights[slot as usize];
        let body = |slot: u32| regions.body_of[slot as usize];
        groups.for_each_list((&mut keys[..], &mut list.pairs[..]), |group, (keys, pairs)| {
            let found = &grouped[group.pairs.clone()];
            for (place, (key, (a, b))) in keys.iter_mut().zip(found).enumerate() {
                // Floats sort like integers once the negative ones are turned round.
                let bits = (height(*a) + height(*b)).to_bits();
                let sortable = if bits >> 31 == 1 { !bits } else { bits | 1 << 31 };
                *key = u64::from(sortable) << 32 | place as u64;
            }
            keys.sort_unstable();
            for (pair, key) in pairs.iter_mut().zip(keys) {
                let (a, b) = found[*key as u32 as usize];
                let (lower, upper) = if height(b) < height(a) { (b, a) } else { (a, b) };
                *pair = Candidate { lower: body(lower), upper: body(upper), past: Past::Apart };
            }
        });
        list.index();
    }

    /// Carries what is known of the old pairs over to the new ones.
    fn recall(&mut self, particles: &Particles, previous: &Vectors) {
        let Self { list, old, joints, .. } = self;
        for pair in old.pairs.iter().filter(|pair| pair.past != Past::Apart) {
            if let Some(new) = list.find(slots(&old.slot_of, pair)) {
                new.past = pair.past;
            }
        }
        if !joints.any() {
            return;
        }
        for pair in &mut list.pairs {
            let ends = slots(&list.slot_of, pair);
            let [a, b] = ends.map(|slot| slot as usize);
            if !joints.is_sprung(a) || !joints.is_sprung(b) || pair.past != Past::Apart {
                continue;
            }
            let reach = particles.radius[a] + particles.radius[b];
            let overlaps = previous.get(a).distance_squared(previous.get(b)) < reach * reach;
            if overlaps && old.find(ends).is_none() {
                pair.past = Past::Entangled;
            }
        }
    }
}

/// About the mean of a vector over `count` particles: that of every sixteenth. Zero if it is not finite.
fn mean(count: usize, vector: impl Fn(usize) -> Vec3) -> Vec3 {
    let sample = (0..count).step_by(16);
    let size = sample.len() as f32;
    let mean = sample.map(vector).sum::<Vec3>() / size;
    if mean.is_finite() { mean } else { Vec3::ZERO }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(spacing: f32, count: usize) -> Particles {
        let mut particles = Particles::default();
        for slot in 0..count {
            particles.push(Vec3::X * spacing * slot as f32, Vec3::ZERO, 1.0, 0.5);
        }
        particles
    }

    /// Refreshes the candidates and lists them, each pair in the order of its slots.
    fn refreshed(candidates: &mut Candidates, particles: &Particles) -> Vec<(u32, u32)> {
        candidates.refresh(particles, &Springs::default(), &particles.position, Vec3::Y, 0.01);
        let ordered = |pair: &Candidate| (pair.lower.min(pair.upper), pair.lower.max(pair.upper));
        let mut pairs: Vec<_> = candidates.pairs().0.iter().map(ordered).collect();
        pairs.sort_unstable();
        pairs
    }

    fn past(candidates: &mut Candidates, a: u32, b: u32) -> Past {
        candidates.list.find([a, b]).expect("the pair is listed").past
    }

    #[test]
    fn the_past_survives_rebuilding_and_renumbering() {
        let mut particles = row(1.0, 4);
        let mut candidates = Candidates::default();
        assert_eq!(refreshed(&mut candidates, &particles), [(0, 1), (1, 2), (2, 3)]);
        candidates.list.find([2, 3]).expect("the pair is listed").past = Past::Contact(7);

        particles.position.set(0, Vec3::X * -5.0);
        assert_eq!(refreshed(&mut candidates, &particles), [(1, 2), (2, 3)]);
        assert_eq!(past(&mut candidates, 2, 3), Past::Contact(7));
        assert_eq!(past(&mut candidates, 1, 2), Past::Apart);

        candidates.renumber(&[None, Some(0), Some(1), Some(2)], 3);
        particles = row(1.0, 3);
        assert_eq!(refreshed(&mut candidates, &particles), [(0, 1), (1, 2)]);
        assert_eq!(past(&mut candidates, 1, 2), Past::Contact(7));
    }

    #[test]
    fn the_list_is_good_until_a_skin_is_outrun() {
        let mut particles = row(1.5, 2);
        let mut candidates = Candidates::default();
        assert_eq!(refreshed(&mut candidates, &particles), []);
        particles.position.set(1, Vec3::X * 1.42);
        assert_eq!(refreshed(&mut candidates, &particles), [], "still within the skin of 0.1 m");
        particles.position.set(1, Vec3::X * 1.2);
        assert_eq!(refreshed(&mut candidates, &particles), [(0, 1)]);
    }

    #[test]
    fn what_moves_together_is_not_searched_again() {
        let mut particles = row(1.5, 40);
        let mut candidates = Candidates::default();
        refreshed(&mut candidates, &particles);
        candidates.list.pairs.push(Candidate { lower: 7, upper: 8, past: Past::Apart });
        for height in &mut particles.position.y {
            *height += 100.0;
        }
        assert_eq!(refreshed(&mut candidates, &particles), [(7, 8)], "the same list");
        particles.position.y[20] -= 1.0;
        assert_eq!(refreshed(&mut candidates, &particles), [], "a new one");
    }

    #[test]
    fn pairs_come_from_the_bottom_up() {
        let mut particles = Particles::default();
        for height in [2.0, -1.0, 0.0, 1.0] {
            particles.push(Vec3::Y * height, Vec3::ZERO, 1.0, 0.6);
        }
        let mut candidates = Candidates::default();
        refreshed(&mut candidates, &particles);
        let pairs: Vec<_> = candidates.pairs().0.iter().map(|pair| (pair.lower, pair.upper)).collect();
        assert_eq!(pairs, [(1, 2), (2, 3), (3, 0)]);
    }

    #[test]
    fn points_and_two_pinned_particles_never_collide() {
        let mut particles = row(0.5, 3);
        particles.radius[0] = 0.0;
        particles.inverse_mass[1] = 0.0;
        particles.inverse_mass[2] = 0.0;
        assert_eq!(refreshed(&mut Candidates::default(), &particles), []);
    }
}
