//! Broad phase: where the particles were in the last search, and how far they may move before the next.
//!
//! Each particle is given a *skin*: a pair is a candidate when their spheres, skins included, overlap.
//! Until a particle has moved by more than its skin no other pair can touch, so the candidates are searched
//! only then (a Verlet list: Verlet, *Phys. Rev.* 159, 98, 1967); a settled pile is never searched again.

use bevy::math::Vec3;

use super::chain_search::ChainSearch;
use super::chains::{Chain, ChainQuery, Proof};
use crate::solver::graph::Exclusions;
use crate::solver::particles::{Particles, Vectors};

/// The skin of slow particles as long as lists last, as a fraction of the radius: thin, which keeps lists short.
const THIN_SKIN: f32 = 0.2;

/// The same where lists do not last: wide, which makes new ones rarer.
const WIDE_SKIN: f32 = 0.4;

/// Skins become wide when a thin one is used up in fewer substeps: a new list of 10,000 balls in a pile takes
/// as long as about ten passes over the pairs that a wide skin adds.
const MIN_LIFE: f32 = 10.0;

/// A particle is fast that would use up the skin of slow ones within this number of ticks. Among crowded
/// particles thick skins are for a few: the first of these numbers is taken that makes at most one particle
/// in sixteen fast.
const FAST_TICKS: [f32; 4] = [4.0, 1.0, 0.25, 0.0];

/// Number of searches, at most, that do not look for free chains after one that has found none: among ropes that are close to
/// each other looking was a quarter of the cost of a search.
const MAX_PAUSE: u32 = 16;

/// The last search: from it, radii, masses and springs follow the candidates, their order and their groups.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct BroadPhase {
    /// The positions then, m.
    pub origins: Vectors,
    /// m. Of points, which never collide, and of particles of free chains the largest number.
    pub skins: Vec<f32>,
    /// The free chains.
    pub chains: Vec<Chain>,
    /// From the particle before to each of theirs when their play was found, m; empty without springs.
    pub chain_links: Vectors,
    /// Against gravity then; zero where there was none.
    pub up: Vec3,
    /// Whether any particle has a skin.
    pub any_skins: bool,
    /// Number of searches still to come that do not look for free chains, and how many there were to be after the last one
    /// that did.
    pause: [u32; 2],
    /// Number of ticks still to come that are not tried as a whole, and how many there were to be after the last one that
    /// failed.
    pub tick_pause: [u32; 2],
}

impl BroadPhase {
    /// Whether it is about this number of particles.
    pub fn fits(&self, count: usize) -> bool {
        let are_all = |vectors: &Vectors| vectors.axes().iter().all(|axis| axis.len() == count);
        let chains_fit = || {
            are_all(&self.chain_links)
                && self.chains.iter().all(|chain| !chain.slots().is_empty() && chain.slots().end <= count)
        };
        self.skins.len() == count && are_all(&self.origins) && (self.chains.is_empty() || chains_fit())
    }

    /// Starts a search at the present positions.
    pub fn start(&mut self, particles: &Particles, up: Vec3) {
        self.origins.copy_from(&particles.position);
        self.up = up;
    }

    /// Chooses the skins by the present velocities; `wide` and `crowded` as in [`super::ContactMemory`],
    /// `time_step` in s.
    pub fn choose_skins(
        &mut self,
        particles: &Particles,
        exclusions: &Exclusions,
        (wide, crowded): (bool, bool),
        time_step: f32,
    ) {
        // A sphere with a thick skin is twice as large as with the skin of a slow one, so that the two come
        // into different classes of the grid, and a few fast ones do not widen the cells of all.
        let slow_skin = slow_skin(wide);
        let thick_skin = 1.0 + 2.0 * slow_skin;
        let common = mean(particles.len(), |slot| particles.velocity.get(slot));
        let is_fast = |slot: usize, ticks: f32| {
            let travel = (particles.velocity.get(slot) - common).length() * ticks * time_step;
            travel > slow_skin * particles.radius()[slot]
        };
        let few = particles.len() / 16;
        let few_are_fast = |ticks: &f32| {
            (0..particles.len()).filter(|slot| is_fast(*slot, *ticks)).take(few + 1).count() <= few
        };
        let ticks = if crowded { FAST_TICKS.into_iter().find(few_are_fast) } else { None };
        let ticks = ticks.unwrap_or(FAST_TICKS[0]);
        self.skins.clear();
        self.skins.extend(particles.radius().iter().enumerate().map(|(slot, &radius)| match radius {
            0.0 => f32::MAX,
            _ if exclusions.is_covered(slot) => f32::MAX,
            _ if is_fast(slot, ticks) => thick_skin * radius,
            _ => slow_skin * radius,
        }));
        self.any_skins = true;
    }

    /// Finds the free chains; skips that in up to [`MAX_PAUSE`] searches after one that has found none.
    pub fn find_chains(
        &mut self,
        search: &mut ChainSearch,
        particles: &Particles,
        exclusions: &Exclusions,
        query: ChainQuery,
    ) {
        let Self { skins, chains, chain_links, pause: [left, whole], .. } = self;
        if *left > 0 {
            *left -= 1;
            chains.clear();
        } else {
            search.find(particles, exclusions, skins, query, (chains, chain_links));
            *whole = if chains.is_empty() { (2 * *whole).clamp(1, MAX_PAUSE) } else { 0 };
            *left = *whole;
        }
        self.remove_chain_skins();
        self.any_skins = (0..particles.len()).any(|slot| self.has_skin(slot));
    }

    /// Particles of free chains need no skins.
    pub fn remove_chain_skins(&mut self) {
        self.chains.iter().for_each(|chain| self.skins[chain.slots()].fill(f32::MAX));
    }

    /// Whether the particle in a slot may touch others.
    pub fn has_skin(&self, slot: usize) -> bool {
        self.skins[slot] < f32::MAX
    }

    /// What all have moved by, about, m. (Any vector will do: skins and boxes are compared without it.)
    pub fn common_displacement(&self, particles: &Particles) -> Vec3 {
        self.common_displacement_to(&particles.position)
    }

    fn common_displacement_to(&self, positions: &Vectors) -> Vec3 {
        mean(self.skins.len(), |slot| positions.get(slot) - self.origins.get(slot))
    }

    /// Whether the free chains still are; the play of those that have used it up is found anew.
    pub fn check_chains(&mut self, particles: &Particles, exclusions: &Exclusions, substep: f32) -> Proof {
        let mut worst = Proof::Holds;
        if self.chains.is_empty() {
            return worst;
        }
        let common = self.common_displacement(particles);
        let Self { chains, chain_links: links, .. } = self;
        pulp::Arch::new().dispatch(CheckChains {
            chains,
            links,
            particles,
            exclusions,
            common,
            substep,
            worst: &mut worst,
        });
        worst
    }

    /// Whether a particle has moved by more than its skin. What all have moved by together does not count:
    /// it brings no two of them closer.
    pub fn skin_exceeded(&self, particles: &Particles) -> bool {
        self.any_skins && self.any_outside(&particles.position)
    }

    /// Whether in the substep in which it was searched no particle has moved by more than its skin, from `previous`: then it has found
    /// what touched on the way, too.
    pub fn covers_way_from(&self, previous: &Vectors) -> bool {
        !self.any_outside(previous)
    }

    fn any_outside(&self, positions: &Vectors) -> bool {
        let [x, y, z] = positions.axes();
        let [origin_x, origin_y, origin_z] = self.origins.axes();
        let common = self.common_displacement_to(positions).to_array();
        let moved = x.iter().zip(origin_x).zip(y.iter().zip(origin_y)).zip(z.iter().zip(origin_z));
        moved.zip(&self.skins).any(|((((x, from_x), (y, from_y)), (z, from_z)), skin)| {
            let moved = [x - from_x - common[0], y - from_y - common[1], z - from_z - common[2]];
            Vec3::from_array(moved).length_squared() > skin * skin
        })
    }
}

/// Checks the proofs of all free chains.
struct CheckChains<'a> {
    chains: &'a mut [Chain],
    links: &'a mut Vectors,
    particles: &'a Particles,
    exclusions: &'a Exclusions,
    /// What all have moved by, m.
    common: Vec3,
    /// s.
    substep: f32,
    worst: &'a mut Proof,
}

impl pulp::WithSimd for CheckChains<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { chains, links, particles, exclusions, common, substep, worst } = self;
        for chain in chains {
            let [outside, mut bent] = chain.proofs(&particles.position, links, common);
            if bent == Proof::Expires && chain.renew_play(particles, exclusions, substep) {
                chain.note_links(&particles.position, links);
                bent = Proof::Holds;
            }
            *worst = (*worst).max(outside).max(bent);
        }
    }
}

/// Whether skins are better wide: a list with the present ones has lasted `age` substeps.
pub(super) fn should_be_wide(wide: bool, age: u32) -> bool {
    age as f32 * (THIN_SKIN / slow_skin(wide)) < MIN_LIFE
}

/// The skin of slow particles, as a part of their radius.
fn slow_skin(wide: bool) -> f32 {
    if wide { WIDE_SKIN } else { THIN_SKIN }
}

/// About the mean of a vector over `count` particles: that of every sixteenth. Zero if it is not finite.
pub(super) fn mean(count: usize, vector: impl Fn(usize) -> Vec3) -> Vec3 {
    let sample = (0..count).step_by(16);
    let size = sample.len() as f32;
    let mean = sample.map(vector).sum::<Vec3>() / size;
    if mean.is_finite() { mean } else { Vec3::ZERO }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A row of spheres of radius 0.5 m, and their search.
    fn row(count: usize) -> (Particles, BroadPhase) {
        let mut particles = Particles::default();
        for slot in 0..count {
            particles.push(Vec3::X * 1.5 * slot as f32, Vec3::ZERO, 1.0, 0.5);
        }
        let mut broad_phase = BroadPhase::default();
        broad_phase.start(&particles, Vec3::Y);
        broad_phase.choose_skins(&particles, &Exclusions::default(), (false, false), 0.01);
        (particles, broad_phase)
    }

    #[test]
    fn skins_are_exceeded_by_moving_further() {
        let (mut particles, broad_phase) = row(2);
        assert_eq!(broad_phase.skins, [0.1, 0.1]);
        for (x, exceeded) in [(1.5, false), (1.42, false), (1.38, true), (1.62, true)] {
            particles.position.set(1, Vec3::X * x);
            assert_eq!(broad_phase.skin_exceeded(&particles), exceeded, "{x} m");
        }
    }

    #[test]
    fn moving_together_exceeds_no_skin() {
        let (mut particles, broad_phase) = row(40);
        for height in &mut particles.position.y {
            *height += 100.0;
        }
        assert!(!broad_phase.skin_exceeded(&particles));
        particles.position.y[20] -= 1.0;
        assert!(broad_phase.skin_exceeded(&particles));
    }

    #[test]
    fn fast_particles_have_thick_skins_and_points_any() {
        let (mut particles, mut broad_phase) = row(3);
        particles.velocity.set(1, Vec3::Y * 3.0);
        particles.set_radius(2, 0.0);
        broad_phase.choose_skins(&particles, &Exclusions::default(), (false, false), 0.01);
        assert_eq!(broad_phase.skins, [0.1, 0.7, f32::MAX]);
    }
}
