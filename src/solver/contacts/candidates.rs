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

/// The thinnest skin, as a part of the particle's radius.
const THIN_SKIN: f32 = 0.25;

/// The thickest, for particles that move fast.
const THICK_SKIN: f32 = 1.5;

/// What is remembered of a pair from substep to substep: the impulses that held it apart.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Memory {
    /// Normal impulse, N·s, >= 0.
    pub normal: f32,
    /// Friction impulse, N·s.
    pub friction: Vec3,
}

/// The candidate pairs (a, b), a < b, sorted.
#[derive(Debug, Clone, Default)]
pub(super) struct Candidates {
    /// `starts[a]..starts[a + 1]` are the candidates of a.
    starts: Vec<u32>,
    others: Vec<u32>,
    memories: Vec<Memory>,
    /// Whether each pair, both on springs, has overlapped ever since it was first seen.
    entangled: Vec<bool>,
    /// The pairs (first, second, index), the lower one first, from the bottom of the world to the top.
    bottom_up: Vec<(u32, u32, u32)>,
    heights: Heights,
    grid: Grid,
    found: Vec<(u32, u32)>,
    old: OldPairs,
    /// Positions at the time of the last rebuild.
    origins: Vectors,
    skins: Vec<f32>,
    joints: Joints,
    stale: bool,
}

/// Working space of the sorting by height.
#[derive(Debug, Clone, Default)]
struct Heights {
    /// The particles that are the lower one of a pair, from the bottom up.
    lowers: Vec<u32>,
    /// Where the pairs of each lower particle go; at first how many there are.
    next: Vec<u32>,
}

/// The pairs before a rebuild, from which the memories are carried over.
#[derive(Debug, Clone, Default)]
struct OldPairs {
    starts: Vec<u32>,
    others: Vec<u32>,
    memories: Vec<Memory>,
    entangled: Vec<bool>,
}

impl Candidates {
    /// Forgets everything.
    pub fn clear(&mut self) {
        self.starts.clear();
        self.others.clear();
        self.memories.clear();
        self.entangled.clear();
        self.stale = true;
    }

    /// The particles were renumbered or changed in radius: `new_slots[old]` is the new slot of each,
    /// in the same order as before; `None` for those that are gone.
    pub fn renumber(&mut self, new_slots: &[Option<u32>], count: usize) {
        let mut starts = vec![0; count + 1];
        let (mut others, mut memories, mut entangled) = (Vec::new(), Vec::new(), Vec::new());
        for (old, new) in new_slots.iter().enumerate() {
            let Some(new) = new else { continue };
            for pair in self.range(old) {
                if let Some(Some(other)) = new_slots.get(self.others[pair] as usize) {
                    others.push(*other);
                    memories.push(self.memories[pair]);
                    entangled.push(self.entangled[pair]);
                    starts[*new as usize + 1] += 1;
                }
            }
        }
        for slot in 0..count {
            starts[slot + 1] += starts[slot];
        }
        (self.starts, self.others, self.memories, self.entangled) = (starts, others, memories, entangled);
        self.stale = true;
    }

    /// Asks for a rebuild: a radius, a mass or a spring has changed.
    pub fn invalidate(&mut self) {
        self.stale = true;
    }

    /// Makes the list good for the present positions, for a while that lasts `time_step` seconds.
    /// `previous` are those at the start of the substep; `up` points against gravity, zero where there is none.
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
        if stale || self.outrun(particles) {
            self.rebuild(particles, previous, time_step);
            self.sort_bottom_up(particles, up);
        }
    }

    /// The number of pairs.
    pub fn len(&self) -> usize {
        self.bottom_up.len()
    }

    /// A pair, counted from the bottom up: (lower, upper, index of the pair).
    pub fn bottom_up(&self, rank: usize) -> (usize, usize, usize) {
        let (lower, upper, pair) = self.bottom_up[rank];
        (lower as usize, upper as usize, pair as usize)
    }

    /// Whether springs pull at either of two particles.
    pub fn is_sprung(&self, a: usize, b: usize) -> bool {
        self.joints.is_sprung(a) || self.joints.is_sprung(b)
    }

    /// What is remembered of a pair.
    pub fn memory(&self, pair: usize) -> Memory {
        self.memories[pair]
    }

    /// Whether a pair, both on springs, has overlapped ever since it was first seen; not if it is `apart` now.
    /// Such a pair does not collide: to separate it would stretch the springs, with energy from nowhere.
    pub fn is_entangled(&mut self, pair: usize, apart: bool) -> bool {
        self.entangled[pair] &= !apart;
        self.entangled[pair]
    }

    /// Forgets the impulses of every pair.
    pub fn forget_all(&mut self) {
        self.memories.fill(Memory::default());
    }

    /// Remembers `memory` for a pair.
    pub fn remember(&mut self, pair: usize, memory: Memory) {
        self.memories[pair] = memory;
    }

    fn range(&self, a: usize) -> std::ops::Range<usize> {
        match self.starts.get(a..a + 2) {
            Some(bounds) => bounds[0] as usize..bounds[1] as usize,
            None => 0..0,
        }
    }

    /// Whether somebody has moved by more than its skin.
    fn outrun(&self, particles: &Particles) -> bool {
        (0..particles.len()).any(|slot| {
            let moved = particles.position.get(slot).distance_squared(self.origins.get(slot));
            moved > self.skins[slot] * self.skins[slot]
        })
    }

    fn rebuild(&mut self, particles: &Particles, previous: &Vectors, time_step: f32) {
        self.stale = false;
        self.origins.copy_from(&particles.position);
        self.skins.clear();
        self.skins.extend(particles.radius.iter().enumerate().map(|(slot, &radius)| {
            if radius == 0.0 {
                return f32::INFINITY;
            }
            let travel = particles.velocity.get(slot).length() * time_step;
            // Not clamp, which would let NaN through.
            travel.max(THIN_SKIN * radius).min(THICK_SKIN * radius)
        }));

        let Self { grid, found, skins, joints, .. } = self;
        found.clear();
        let spheres = (0..particles.len())
            .filter(|slot| particles.radius[*slot] > 0.0)
            .map(|slot| (slot as u32, particles.position.get(slot), particles.radius[slot] + skins[slot]));
        grid.for_each_pair(spheres, |a, b| {
            let (a, b) = (a.min(b), a.max(b));
            let free = particles.inverse_mass[a as usize] + particles.inverse_mass[b as usize] > 0.0;
            if free && !joints.overlap_at_rest(a, b) {
                found.push((a, b));
            }
        });
        self.sort_found(particles.len());
        self.recall(particles, previous);
    }

    /// Sorts the pairs that the grid found by their first, then their second particle.
    fn sort_found(&mut self, count: usize) {
        std::mem::swap(&mut self.starts, &mut self.old.starts);
        std::mem::swap(&mut self.others, &mut self.old.others);
        std::mem::swap(&mut self.memories, &mut self.old.memories);
        std::mem::swap(&mut self.entangled, &mut self.old.entangled);
        self.starts.clear();
        self.starts.resize(count + 1, 0);
        for (a, _) in &self.found {
            self.starts[*a as usize] += 1;
        }
        let mut total = 0;
        for start in &mut self.starts {
            total += *start;
            *start = total;
        }
        self.others.clear();
        self.others.resize(self.found.len(), 0);
        for (a, b) in &self.found {
            let start = &mut self.starts[*a as usize];
            *start -= 1;
            self.others[*start as usize] = *b;
        }
        for bounds in self.starts.windows(2) {
            self.others[bounds[0] as usize..bounds[1] as usize].sort_unstable();
        }
    }

    /// Lists the pairs by the height of their lower particle.
    fn sort_bottom_up(&mut self, particles: &Particles, up: Vec3) {
        let Self { starts, others, bottom_up, heights: Heights { lowers, next }, .. } = self;
        bottom_up.clear();
        bottom_up.resize(others.len(), (0, 0, 0));
        let (starts, others) = (&*starts, &*others);
        let height = |slot: u32| particles.position.get(slot as usize).dot(up);
        let pairs = || {
            starts.windows(2).enumerate().flat_map(|(a, bounds)| {
                (bounds[0]..bounds[1]).map(move |pair| (a as u32, others[pair as usize], pair))
            })
        };
        let sorted = |a: u32, b: u32| if height(b) < height(a) { (b, a) } else { (a, b) };

        next.clear();
        next.resize(particles.len(), 0);
        for (a, b, _) in pairs() {
            next[sorted(a, b).0 as usize] += 1;
        }
        lowers.clear();
        lowers.extend((0..particles.len() as u32).filter(|slot| next[*slot as usize] > 0));
        lowers.sort_by(|one, other| height(*one).total_cmp(&height(*other)));
        let mut total = 0;
        for &lower in &*lowers {
            let count = std::mem::replace(&mut next[lower as usize], total);
            total += count;
        }
        for (a, b, pair) in pairs() {
            let (lower, upper) = sorted(a, b);
            let place = &mut next[lower as usize];
            bottom_up[*place as usize] = (lower, upper, pair);
            *place += 1;
        }
    }

    /// Carries the memories of the old pairs over to the new ones; both are sorted.
    fn recall(&mut self, particles: &Particles, previous: &Vectors) {
        self.memories.clear();
        self.entangled.clear();
        for (a, bounds) in self.starts.windows(2).enumerate() {
            let old_bounds = self.old.starts.get(a..a + 2).map_or([0, 0], |bounds| [bounds[0], bounds[1]]);
            let mut old = old_bounds[0] as usize;
            for &b in &self.others[bounds[0] as usize..bounds[1] as usize] {
                while old < old_bounds[1] as usize && self.old.others[old] < b {
                    old += 1;
                }
                if old < old_bounds[1] as usize && self.old.others[old] == b {
                    self.memories.push(self.old.memories[old]);
                    self.entangled.push(self.old.entangled[old]);
                } else {
                    self.memories.push(Memory::default());
                    let b = b as usize;
                    let reach = particles.radius[a] + particles.radius[b];
                    let overlaps = previous.get(a).distance_squared(previous.get(b)) < reach * reach;
                    self.entangled.push(overlaps && self.joints.is_sprung(a) && self.joints.is_sprung(b));
                }
            }
        }
    }
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

    fn ranked(candidates: &Candidates) -> impl Iterator<Item = (usize, usize, usize)> + '_ {
        (0..candidates.len()).map(|rank| candidates.bottom_up(rank))
    }

    fn listed(candidates: &Candidates) -> Vec<(usize, usize)> {
        let mut pairs: Vec<_> = ranked(candidates).map(|(a, b, pair)| (pair, a.min(b), a.max(b))).collect();
        pairs.sort_unstable();
        pairs.into_iter().map(|(_, a, b)| (a, b)).collect()
    }

    #[test]
    fn memories_survive_rebuilding_and_renumbering() {
        let mut particles = row(1.0, 4);
        let mut candidates = Candidates::default();
        candidates.refresh(&particles, &Springs::default(), &particles.position, Vec3::Y, 0.01);
        assert_eq!(listed(&candidates), [(0, 1), (1, 2), (2, 3)]);
        let memory = Memory { normal: 7.0, friction: Vec3::X };
        candidates.remember(2, memory);

        particles.position.set(0, Vec3::X * -5.0);
        candidates.refresh(&particles, &Springs::default(), &particles.position, Vec3::Y, 0.01);
        assert_eq!(listed(&candidates), [(1, 2), (2, 3)]);
        assert_eq!(candidates.memory(1), memory);

        candidates.renumber(&[None, Some(0), Some(1), Some(2)], 3);
        particles = row(1.0, 3);
        candidates.refresh(&particles, &Springs::default(), &particles.position, Vec3::Y, 0.01);
        assert_eq!(listed(&candidates), [(0, 1), (1, 2)]);
        assert_eq!(candidates.memory(1), memory);
    }

    #[test]
    fn the_list_is_good_until_a_skin_is_outrun() {
        let mut particles = row(1.5, 2);
        let mut candidates = Candidates::default();
        candidates.refresh(&particles, &Springs::default(), &particles.position, Vec3::Y, 0.01);
        assert_eq!(listed(&candidates), []);
        particles.position.set(1, Vec3::X * 1.38);
        candidates.refresh(&particles, &Springs::default(), &particles.position, Vec3::Y, 0.01);
        assert_eq!(listed(&candidates), [], "still within the skin of 0.125 m");
        particles.position.set(1, Vec3::X * 1.2);
        candidates.refresh(&particles, &Springs::default(), &particles.position, Vec3::Y, 0.01);
        assert_eq!(listed(&candidates), [(0, 1)]);
    }

    #[test]
    fn pairs_come_from_the_bottom_up() {
        let mut particles = Particles::default();
        for height in [2.0, 0.0, 1.0] {
            particles.push(Vec3::Y * height, Vec3::ZERO, 1.0, 0.6);
        }
        let mut candidates = Candidates::default();
        candidates.refresh(&particles, &Springs::default(), &particles.position, Vec3::Y, 0.01);
        let pairs: Vec<_> = ranked(&candidates).map(|(lower, upper, _)| (lower, upper)).collect();
        assert_eq!(pairs, [(1, 2), (2, 0)]);
    }

    #[test]
    fn points_and_two_pinned_particles_never_collide() {
        let mut particles = row(0.5, 3);
        particles.radius[0] = 0.0;
        particles.inverse_mass[1] = 0.0;
        particles.inverse_mass[2] = 0.0;
        let mut candidates = Candidates::default();
        candidates.refresh(&particles, &Springs::default(), &particles.position, Vec3::Y, 0.01);
        assert_eq!(listed(&candidates), []);
    }
}
