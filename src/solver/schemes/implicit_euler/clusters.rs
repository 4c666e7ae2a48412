//! Islands that run into each other, or into themselves, are solved together.
//!
//! Each island is advanced by itself first, so that it moves to the bit as it would alone while it touches none. Where
//! particles have met on the way, their islands go back to the start of the step and are advanced as one, with
//! these contacts; and again, if that has brought others together.

use super::{Island, Step};
use crate::solver::collision::{ContactRecord, StiffPair, StiffPairs};
use crate::solver::graph::Elimination;
use crate::solver::particles::{Particles, Vectors};
use crate::solver::pulls::Pulls;

/// Number of times, at most, that a step is done again.
const MAX_ROUNDS: usize = 3;

const NO_ISLAND: u32 = u32::MAX;

/// The contacts between the particles of all islands, and the islands that they join: working memory.
#[derive(Debug, Clone, Default)]
pub(super) struct Clusters {
    search: StiffPairs,
    pairs: Vec<StiffPair>,
    clusters: Vec<Cluster>,
    /// The slots of the pairs that the clusters were made for.
    key: Vec<[u32; 2]>,
    /// The island of each slot.
    island_of: Vec<u32>,
    /// Positions and velocities at the start of the step.
    start: [Vectors; 2],
}

#[derive(Debug, Clone, Default)]
struct Cluster {
    /// The islands.
    members: Vec<usize>,
    island: Island,
}

impl Clusters {
    /// To be called when the islands are others.
    pub fn reset(&mut self, islands: &[Island], particles: usize) {
        self.clusters.clear();
        self.key.clear();
        self.island_of.clear();
        self.island_of.resize(particles, NO_ISLAND);
        for (number, island) in (0..).zip(islands) {
            for slot in &island.elimination.slots[..island.elimination.free] {
                self.island_of[*slot as usize] = number;
            }
        }
    }

    /// Keeps the state at the start of a step.
    pub fn begin(&mut self, particles: &Particles) {
        let [position, velocity] = &mut self.start;
        position.copy_from(&particles.position);
        velocity.copy_from(&particles.velocity);
        self.pairs.clear();
    }

    /// Advances the islands that have touched each other again, until no others do.
    pub fn advance(
        &mut self,
        islands: &[Island],
        step: Step,
        particles: &mut Particles,
        acceleration: &mut Vectors,
        touching: &mut Vec<ContactRecord>,
        mut pulls: Option<&mut Pulls>,
    ) {
        for _ in 0..MAX_ROUNDS {
            let known = self.pairs.len();
            let slots = islands.iter().flat_map(Island::slots);
            let read = (step.elements, step.surroundings);
            self.search.find(slots, &self.start[0], particles, read, &mut self.pairs);
            if self.pairs.len() == known {
                return;
            }
            self.join(islands, particles);
            for cluster in &mut self.clusters {
                let Cluster { members, island } = cluster;
                for slot in members.iter().flat_map(|member| islands[*member].slots()) {
                    particles.position.set(slot, self.start[0].get(slot));
                    particles.velocity.set(slot, self.start[1].get(slot));
                }
                let is_member = |slot: usize| members.contains(&(self.island_of[slot] as usize));
                touching.retain(|record| !is_member(record.slot));
                island.exclude_pairs(particles, step.elements);
                island.advance_backward_euler(step, particles, acceleration, touching);
                if let Some(pulls) = &mut pulls {
                    island.keep_pulls(particles, pulls);
                }
            }
        }
    }

    /// The islands that were solved together in the last step.
    pub fn islands(&self) -> impl Iterator<Item = &Island> {
        let any = !self.pairs.is_empty();
        self.clusters.iter().filter(move |_| any).map(|cluster| &cluster.island)
    }

    /// Joins the islands of the pairs.
    fn join(&mut self, islands: &[Island], particles: &Particles) {
        let Self { pairs, clusters, key, island_of, .. } = self;
        let is_same = key.iter().eq(pairs.iter().map(|pair| &pair.slots));
        if !is_same {
            key.clear();
            key.extend(pairs.iter().map(|pair| pair.slots));
            clusters.clear();
            let mut first: Vec<usize> = (0..islands.len()).collect();
            for StiffPair { slots, .. } in &*pairs {
                let [one, other] = slots.map(|slot| first[island_of[slot as usize] as usize]);
                let (kept, lost) = (one.min(other), one.max(other));
                first.iter_mut().filter(|first| **first == lost).for_each(|first| *first = kept);
            }
            let ends = |pair: &StiffPair| first[island_of[pair.slots[0] as usize] as usize];
            let mut heads: Vec<usize> = pairs.iter().map(ends).collect();
            heads.sort_unstable();
            heads.dedup();
            for head in heads {
                let members: Vec<usize> =
                    (0..islands.len()).filter(|island| first[*island] == head).collect();
                let own = pairs.iter().filter(|pair| ends(pair) == head);
                let in_core: Vec<u32> = own.flat_map(|pair| pair.slots).collect();
                let parts = members.iter().map(|member| &islands[*member].elimination);
                let island = Island::new(Elimination::joined(parts, &in_core, particles));
                clusters.push(Cluster { members, island });
            }
        }
        for Cluster { members, island } in clusters {
            let is_own = |pair: &&StiffPair| members.contains(&(island_of[pair.slots[0] as usize] as usize));
            island.set_pairs(pairs.iter().filter(is_own).copied(), particles.len());
        }
    }
}

impl Island {
    /// Sets the contacts between its own particles.
    fn set_pairs(&mut self, pairs: impl Iterator<Item = StiffPair>, particles: usize) {
        let Self { elimination, pairs: own, node_of, .. } = self;
        own.clear();
        own.extend(pairs);
        node_of.resize(particles, u32::MAX);
        for (node, slot) in (0..).zip(&elimination.slots[..elimination.free]) {
            node_of[*slot as usize] = node;
        }
    }

    /// The slots of its free particles.
    pub fn slots(&self) -> impl Iterator<Item = usize> {
        self.elimination.slots[..self.elimination.free].iter().map(|slot| *slot as usize)
    }
}
