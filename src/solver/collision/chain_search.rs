//! Which chains are free: they do not touch themselves, and nothing reaches into their boxes.
//!
//! Boxes are sorted along an axis and swept (Baraff, *Dynamic simulation of non-penetrating rigid bodies*, 1992): a few
//! hundred ropes take some tens of microseconds.

use std::ops::Range;

use bevy::math::Vec3;

use super::broad_phase::mean;
use super::chains::{Chain, ChainPurpose, ChainQuery, MAX_LENGTH, MIN_LENGTH};
use crate::solver::graph::Exclusions;
use crate::solver::particles::{Particles, Vectors};

/// Number of ticks for which boxes are to be large enough: the first ones, and those of chains that are not free with
/// them.
const BOX_TICKS: [f32; 2] = [4.0, 1.0];

/// Number of pairs of boxes that are tested for each box, at most. Where more overlap along an axis, none are free.
const MAX_TESTS: usize = 64;

/// What is not to overlap, and the chain that it is the box of.
#[derive(Debug, Clone, Copy)]
struct Bounds {
    least: Vec3,
    most: Vec3,
    chain: Option<usize>,
}

impl Bounds {
    const NOTHING: Self = Self { least: Vec3::INFINITY, most: Vec3::NEG_INFINITY, chain: None };

    /// Grows by a sphere.
    fn add(&mut self, centre: Vec3, reach: f32) {
        self.least = self.least.min(centre - reach);
        self.most = self.most.max(centre + reach);
    }

    fn overlaps(&self, other: &Self) -> bool {
        self.least.cmple(other.most).all() && other.least.cmple(self.most).all()
    }
}

/// Number of lone spheres in one box.
const SPHERES_PER_BOX: usize = 16;

/// Working memory of the search for free chains.
#[derive(Debug, Clone, Default)]
pub(super) struct ChainSearch {
    /// All that do not touch themselves, and whether they touch nothing else either.
    chains: Vec<(Chain, bool)>,
    bounds: Vec<Bounds>,
    /// The least coordinates of the bounds along an axis, as sortable bits, and their places.
    keys: Vec<u64>,
}

impl ChainSearch {
    /// Lists the free chains, and notes their links; others are as large as their `skins`, m. What was
    /// free in the last search keeps its links, m, while it has enough of its play left.
    pub fn find(
        &mut self,
        particles: &Particles,
        exclusions: &Exclusions,
        skins: &[f32],
        query: ChainQuery,
        (free, links): (&mut Vec<Chain>, &mut Vectors),
    ) {
        if !exclusions.any_sprung() {
            free.clear();
            links.resize(0);
            return;
        }
        if links.len() != particles.len() {
            free.clear();
            links.resize(particles.len());
        }
        // All at once, so that nothing is allocated when more chains become free.
        let most = particles.len() / MIN_LENGTH;
        free.reserve(most);
        self.chains.clear();
        self.chains.reserve(most);
        self.bounds.clear();
        self.bounds.reserve(particles.len() + 1);
        self.keys.clear();
        self.keys.reserve(particles.len() + 1);
        self.list_chains(particles, exclusions, query, (free, links));
        free.clear();
        if self.chains.is_empty() {
            return;
        }
        let common = mean(particles.len(), |slot| particles.velocity.get(slot));
        for ticks in BOX_TICKS {
            for (chain, is_free) in self.chains.iter_mut().filter(|(_, is_free)| !is_free) {
                chain.make_box(particles, common, ticks, query);
                *is_free = true;
            }
            self.bound(particles, exclusions, skins);
            if !self.find_overlaps() {
                return;
            }
            if self.chains.iter().all(|(_, is_free)| *is_free) {
                break;
            }
        }
        free.extend(self.chains.iter().filter(|(_, is_free)| *is_free).map(|(chain, _)| *chain));
    }

    /// Lists the chains of which no spheres touch each other. The `last` ones were free.
    fn list_chains(
        &mut self,
        particles: &Particles,
        exclusions: &Exclusions,
        query: ChainQuery,
        (last, links): (&[Chain], &mut Vectors),
    ) {
        let (mut start, mut last) = (0, last.iter().peekable());
        let ends = exclusions.continues().iter().skip(1).map(|continues| !continues).chain([true]);
        for (end, _) in (1..).zip(ends).filter(|(_, is_end)| *is_end) {
            let slots = std::mem::replace(&mut start, end)..end;
            let is_sphere = |slot: usize| particles.radius()[slot] > 0.0;
            if !(MIN_LENGTH..=MAX_LENGTH).contains(&slots.len()) || !slots.clone().any(is_sphere) {
                continue;
            }
            let collides_along = slots.clone().any(|slot| exclusions.is_covered(slot));
            if collides_along && query.purpose != ChainPurpose::ForTick {
                continue;
            }
            while last.next_if(|last| last.slots().start < slots.start).is_some() {}
            let known = last.next_if(|last| last.slots() == slots);
            if query.purpose == ChainPurpose::ForTick {
                // Most need none of their play.
                self.chains.push((known.copied().unwrap_or(Chain::new(slots)), false));
                continue;
            }
            if let Some(chain) = known.filter(|chain| chain.has_play_left(&particles.position, links)) {
                self.chains.push((*chain, false));
                continue;
            }
            let mut chain = Chain::new(slots);
            if chain.renew_play(particles, exclusions, query.substep) {
                chain.note_links(&particles.position, links);
                self.chains.push((chain, false));
            }
        }
    }

    /// Bounds all spheres: each chain by its box and a few others together, with their skins.
    fn bound(&mut self, particles: &Particles, exclusions: &Exclusions, skins: &[f32]) {
        let Self { chains, bounds, .. } = self;
        bounds.clear();
        let reach = |slot: usize| match particles.radius()[slot] {
            0.0 => 0.0,
            _ if exclusions.is_covered(slot) => 0.0,
            radius => radius + skins[slot],
        };
        let mut next = 0;
        for (number, (chain, _)) in chains.iter().enumerate() {
            bound_lone(bounds, particles, reach, next..chain.slots().start);
            next = chain.slots().end;
            let reach = chain.slots().map(reach).fold(chain.radius, f32::max);
            let [least, most] = chain.reserved();
            bounds.push(Bounds { least: least - reach, most: most + reach, chain: Some(number) });
        }
        bound_lone(bounds, particles, reach, next..particles.len());
    }

    /// Marks chains as not free where their boxes overlap something; `false` if that is too much work.
    fn find_overlaps(&mut self) -> bool {
        let Self { chains, bounds, keys } = self;
        let extent = bounds.iter().fold(Bounds::NOTHING, |mut all, bounds| {
            all.add(bounds.least, 0.0);
            all
        });
        let axis = (extent.most - extent.least).max_position();
        keys.clear();
        keys.extend((0..).zip(&*bounds).map(|(place, bounds): (u64, _)| {
            // Floats sort like integers once the bits of negative ones are inverted.
            let bits = bounds.least[axis].to_bits();
            u64::from(if bits >> 31 == 1 { !bits } else { bits | 1 << 31 }) << 32 | place
        }));
        keys.sort_unstable();
        let mut tests = MAX_TESTS * keys.len();
        for (place, key) in keys.iter().enumerate() {
            let one = bounds[*key as u32 as usize];
            for key in &keys[place + 1..] {
                let other = bounds[*key as u32 as usize];
                if other.least[axis] > one.most[axis] {
                    break;
                }
                tests -= 1;
                if tests == 0 {
                    return false;
                }
                if one.overlaps(&other) {
                    for chain in [one.chain, other.chain].into_iter().flatten() {
                        chains[chain].1 = false;
                    }
                }
            }
        }
        true
    }
}

/// Bounds the spheres in these slots.
fn bound_lone(
    bounds: &mut Vec<Bounds>,
    particles: &Particles,
    reach: impl Fn(usize) -> f32,
    slots: Range<usize>,
) {
    let mut spheres = slots.filter(|slot| particles.radius()[*slot] > 0.0);
    loop {
        let mut lone = Bounds::NOTHING;
        let count = spheres
            .by_ref()
            .take(SPHERES_PER_BOX)
            .map(|slot| lone.add(particles.position.get(slot), reach(slot)))
            .count();
        if count == 0 {
            return;
        }
        bounds.push(lone);
    }
}

#[cfg(test)]
mod tests {
    use super::super::chains::Proof;
    use super::super::chains::tests::rope;
    use super::*;
    use crate::solver::elements::{Elements, Spring};

    /// A rope that turns as a whole keeps its proof, one that bends so that it may touch itself does not.
    #[test]
    fn proofs_hold_while_nothing_can_touch() {
        let straight: Vec<_> = (0..20).map(|slot| Vec3::X * 0.1 * slot as f32).collect();
        let (mut particles, exclusions) = rope(&straight);
        let mut links = Vectors::default();
        let (mut search, mut free, skins) = (ChainSearch::default(), Vec::new(), vec![0.004; 20]);
        let query = ChainQuery {
            time_step: 0.01,
            substep: 0.0025,
            gravity: 10.0,
            purpose: ChainPurpose::ForSubsteps,
        };
        search.find(&particles, &exclusions, &skins, query, (&mut free, &mut links));
        assert_eq!((free.len(), free[0].slots()), (1, 0..20));
        let proofs = |particles: &Particles| free[0].proofs(&particles.position, &links, Vec3::ZERO);
        assert_eq!(proofs(&particles), [Proof::Holds; 2]);
        for (angle, expected) in [(0.4_f32, Proof::Holds), (0.5, Proof::Expires), (0.7, Proof::Fails)] {
            for slot in 0..20 {
                let (sin, cos) = bevy::math::ops::sin_cos(angle);
                particles.position.set(slot, Vec3::new(cos, sin, 0.0) * 0.1 * slot as f32);
            }
            // 0.1 m · 2 sin(angle / 2), of 0.045 m and 0.06 m.
            assert_eq!(proofs(&particles)[1], expected, "{angle}");
            assert_eq!(proofs(&particles)[0], Proof::Fails, "it is far out of its box");
        }
    }

    /// A search keeps the links of what has bent little since they were noted, and notes those of what has bent more.
    #[test]
    fn play_that_is_left_is_kept() {
        let straight: Vec<_> = (0..20).map(|slot| Vec3::X * 0.1 * slot as f32).collect();
        let (mut particles, exclusions) = rope(&straight);
        let (mut search, skins) = (ChainSearch::default(), vec![0.004; 20]);
        let (mut free, mut links) = (Vec::new(), Vectors::default());
        let query = ChainQuery {
            time_step: 0.01,
            substep: 0.0025,
            gravity: 10.0,
            purpose: ChainPurpose::ForSubsteps,
        };
        search.find(&particles, &exclusions, &skins, query, (&mut free, &mut links));
        let first = links.clone();
        // Each link turns by 0.1 m · 2 sin(angle / 2), of a play of 0.06 m.
        for (angle, is_kept) in [(0.2_f32, true), (0.3, false)] {
            let (sin, cos) = bevy::math::ops::sin_cos(angle);
            for slot in 0..20 {
                particles.position.set(slot, Vec3::new(cos, sin, 0.0) * 0.1 * slot as f32);
            }
            search.find(&particles, &exclusions, &skins, query, (&mut free, &mut links));
            assert_eq!(free.len(), 1);
            let mut present = first.clone();
            free[0].note_links(&particles.position, &mut present);
            assert_eq!(links, if is_kept { first.clone() } else { present }, "{angle}");
        }
    }

    #[test]
    fn chains_are_free_where_nothing_reaches_into_their_boxes() {
        for (height, is_free) in [(0.5, true), (0.03, false)] {
            let mut points: Vec<_> = (0..8).map(|slot| Vec3::X * 0.1 * slot as f32).collect();
            points.push(Vec3::new(0.35, height, 0.0));
            let (particles, _) = rope(&points);
            let (_, mut exclusions) = rope(&points[..8]);
            let mut elements = Elements::default();
            for slot in 1..8 {
                elements
                    .push([slot - 1, slot], Spring { rest_length: 0.1, stiffness: 1.0, ..Spring::default() });
            }
            exclusions.rebuild(&particles, &elements, &[]);
            let (mut free, skins) = (Vec::new(), vec![0.004; 9]);
            let query = ChainQuery {
                time_step: 0.01,
                substep: 0.0025,
                gravity: 10.0,
                purpose: ChainPurpose::ForSubsteps,
            };
            let found = (&mut free, &mut Vectors::default());
            ChainSearch::default().find(&particles, &exclusions, &skins, query, found);
            assert_eq!(free.len() == 1, is_free, "{height}");
        }
    }
}
