//! Islands that collide with each other, or with themselves, are solved together.
//!
//! Each island is advanced by itself first, so that it moves to the bit as it would alone while it touches none. Where
//! particles have met on the way, their islands go back to the start of the step and are advanced as one, with
//! these contacts; and again, if that has brought others together. A particle in no island that they meet, a ball on a
//! trampoline, is advanced with them for this step, whatever scheme advances it otherwise.

use bevy::math::Vec3;

use super::{Island, Step, Touched};
use crate::solver::collision::{StiffContact, StiffPair, StiffPairs, Surfaces, Surroundings};
use crate::solver::graph::Elimination;
use crate::solver::particles::{Particles, Vectors};
use crate::solver::pulls::Pulls;

/// Number of times, at most, that a step is done again.
const MAX_ROUNDS: usize = 3;

/// A step is done again if fewer contacts of surfaces were known before than this many for each that it has added.
const MIN_KNOWN_PER_ADDED: usize = 8;

const NO_ISLAND: u32 = u32::MAX;

/// The contacts between the particles of all islands, and the islands that they join: working memory.
#[derive(Debug, Clone, Default)]
pub(super) struct Clusters {
    search: StiffPairs,
    pairs: Vec<StiffPair>,
    /// The contacts of surfaces.
    surfaces: Vec<StiffContact>,
    clusters: Vec<Cluster>,
    /// The island of each slot.
    island_of: Vec<u32>,
    /// The slots of the free particles in no island.
    lone: Vec<u32>,
    /// Those of them that may meet an island in this step.
    nearby: Vec<u32>,
    /// Positions and velocities at the start of the step.
    start: [Vectors; 2],
}

#[derive(Debug, Clone, Default)]
struct Cluster {
    /// The islands.
    members: Vec<usize>,
    /// The slots of particles in no island.
    lone: Vec<u32>,
    /// The slots that are to be in the core.
    core: Vec<u32>,
    island: Island,
}

impl Clusters {
    /// To be called when the islands are others.
    pub fn reset(&mut self, islands: &[Island], lone: impl Iterator<Item = u32>, particles: usize) {
        self.lone.clear();
        self.lone.extend(lone);
        self.clusters.clear();
        self.island_of.clear();
        self.island_of.resize(particles, NO_ISLAND);
        for (number, island) in (0..).zip(islands) {
            for slot in &island.elimination.slots[..island.elimination.free] {
                self.island_of[*slot as usize] = number;
            }
        }
    }

    /// Keeps the state at the start of a step, if particles collide.
    pub fn begin(&mut self, particles: &Particles, collide: bool) {
        self.pairs.clear();
        self.surfaces.clear();
        self.nearby.clear();
        if !collide {
            return;
        }
        let [position, velocity] = &mut self.start;
        position.copy_from(&particles.position);
        velocity.copy_from(&particles.velocity);
    }

    /// Advances the islands that have touched each other again, until no others do. The lone particles that have been
    /// advanced already are `advanced`, in order; the others are where they were.
    pub fn advance(
        &mut self,
        (islands, advanced, meshes): (&[Island], &[u32], &mut Surfaces),
        step: Step,
        particles: &mut Particles,
        acceleration: &mut Vectors,
        touched: &mut Touched,
        mut pulls: Option<&mut Pulls>,
    ) {
        self.find_nearby(islands, advanced, step, particles);
        for _ in 0..MAX_ROUNDS {
            let known = [self.pairs.len(), self.surfaces.len()];
            let Self { search, pairs, surfaces, island_of, nearby, start, .. } = self;
            let slots =
                islands.iter().flat_map(Island::slots).chain(nearby.iter().map(|slot| *slot as usize));
            let is_in_island = |slot: u32| island_of[slot as usize] != NO_ISLAND;
            search.find(slots, &start[0], particles, (step.elements, step.surroundings), is_in_island, pairs);
            let is_advanced = |slot: u32| is_in_island(slot) || nearby.binary_search(&slot).is_ok();
            let Surroundings { settings, properties, .. } = step.surroundings;
            let motion = (&start[0], &*particles, step.h as f32);
            meshes.find_stiff(motion, (settings, properties), is_in_island, is_advanced, surfaces);
            // A few surfaces more are stopped at the end of the step, and are found at the start of the next one.
            let are_few = surfaces.len() - known[1] <= known[1] / MIN_KNOWN_PER_ADDED;
            if pairs.len() == known[0] && are_few {
                break;
            }
            self.join(islands, particles);
            let [position, velocity] = &self.start;
            for Cluster { island, .. } in &mut self.clusters {
                for slot in island.slots() {
                    particles.position.set(slot, position.get(slot));
                    particles.velocity.set(slot, velocity.get(slot));
                }
                touched.retain(|slot| island.node_of[slot] == u32::MAX);
                island.exclude_pairs(particles, step.elements);
                island.advance_backward_euler(step, particles, acceleration, touched);
                if let Some(pulls) = &mut pulls {
                    island.keep_pulls(particles, pulls);
                }
            }
        }
        self.put_back(advanced, particles);
    }

    /// Finds the lone particles that may meet an island, and puts them where they fly.
    fn find_nearby(&mut self, islands: &[Island], advanced: &[u32], step: Step, particles: &mut Particles) {
        let Self { lone, nearby, start: [start, _], .. } = self;
        nearby.clear();
        if lone.is_empty() {
            return;
        }
        let (mut least, mut most) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for slot in islands.iter().flat_map(Island::slots).filter(|slot| particles.radius()[*slot] > 0.0) {
            let (from, to) = (start.get(slot), particles.position.get(slot));
            least = least.min(from.min(to) - particles.radius()[slot]);
            most = most.max(from.max(to) + particles.radius()[slot]);
        }
        for slot in lone.iter().map(|slot| *slot as usize) {
            let radius = particles.radius()[slot];
            let from = start.get(slot);
            let to = match advanced.binary_search(&(slot as u32)) {
                Ok(_) => particles.position.get(slot),
                Err(_) => {
                    let velocity = step.field.free_velocity(particles, slot, step.h);
                    (from.as_dvec3() + step.h * velocity).as_vec3()
                }
            };
            let (upper, lower) = (from.max(to) + radius, from.min(to) - radius);
            if radius > 0.0 && upper.cmpge(least).all() && lower.cmple(most).all() {
                nearby.push(slot as u32);
                particles.position.set(slot, to);
            }
        }
    }

    /// Puts the lone particles that have touched nothing, and that another scheme advances, back to where they were.
    fn put_back(&mut self, advanced: &[u32], particles: &mut Particles) {
        let any = self.any();
        let Self { nearby, clusters, start: [start, _], .. } = self;
        nearby.retain(|slot| {
            let mut joined = clusters.iter().filter(|_| any);
            let stays = joined.any(|cluster| cluster.lone.contains(slot));
            if !stays && advanced.binary_search(slot).is_err() {
                particles.position.set(*slot as usize, start.get(*slot as usize));
            }
            stays
        });
    }

    /// The lone particles that were advanced with islands in the last step: their slots, and the positions and
    /// velocities that they had before.
    pub fn lone_advanced(&self) -> impl Iterator<Item = (usize, [Vec3; 2])> {
        let slots = self.nearby.iter().map(|slot| *slot as usize);
        slots.map(|slot| (slot, self.start.each_ref().map(|vectors| vectors.get(slot))))
    }

    /// Whether anything has met.
    fn any(&self) -> bool {
        !self.pairs.is_empty() || !self.surfaces.is_empty()
    }

    /// The islands that were solved together in the last step.
    pub fn islands(&self) -> impl Iterator<Item = &Island> {
        let any = self.any();
        self.clusters.iter().filter(move |_| any).map(|cluster| &cluster.island)
    }

    /// The same.
    pub fn islands_mut(&mut self) -> impl Iterator<Item = &mut Island> {
        let any = self.any();
        self.clusters.iter_mut().filter(move |_| any).map(|cluster| &mut cluster.island)
    }

    /// Whether this island was solved together with others.
    pub fn has_joined(&self, number: usize) -> bool {
        self.any() && self.clusters.iter().any(|cluster| cluster.members.contains(&number))
    }

    /// Joins the islands of the pairs.
    fn join(&mut self, islands: &[Island], particles: &Particles) {
        let Self { pairs, surfaces, clusters, island_of, nearby, .. } = self;
        // Behind the islands, each lone particle is a part of its own.
        let part_of = |slot: u32| match island_of[slot as usize] {
            NO_ISLAND => islands.len() + nearby.partition_point(|particle| *particle < slot),
            island => island as usize,
        };
        let mut first: Vec<usize> = (0..islands.len() + nearby.len()).collect();
        let mut unite = |slots: &[u32]| {
            for slot in &slots[1..] {
                let [one, other] = [slots[0], *slot].map(|slot| first[part_of(slot)]);
                let (kept, lost) = (one.min(other), one.max(other));
                if kept != lost {
                    first.iter_mut().filter(|first| **first == lost).for_each(|first| *first = kept);
                }
            }
        };
        pairs.iter().for_each(|StiffPair { slots, .. }| unite(slots));
        let free = |contact: &StiffContact| -> Vec<u32> {
            let corners = contact.corners().map(|(slot, _)| slot).filter(|slot| !particles.is_pinned(*slot));
            corners.map(|slot| slot as u32).collect()
        };
        let free: Vec<Vec<u32>> = surfaces.iter().map(free).collect();
        free.iter().for_each(|slots| unite(slots));
        let head = |slot: u32| first[part_of(slot)];
        let of_pairs = pairs.iter().map(|pair| head(pair.slots[0]));
        let mut heads: Vec<usize> = of_pairs.chain(free.iter().map(|slots| head(slots[0]))).collect();
        heads.sort_unstable();
        heads.dedup();
        let mut known = std::mem::take(clusters);
        for number in heads {
            let members: Vec<usize> = (0..islands.len()).filter(|island| first[*island] == number).collect();
            // What is in no tree is in the core in any case.
            let is_in_tree = |slot: &u32| match island_of[*slot as usize] {
                NO_ISLAND => true,
                island => islands[island as usize].elimination.trees > 0,
            };
            let own = pairs.iter().map(|pair| pair.slots).filter(|slots| head(slots[0]) == number);
            let mut core: Vec<u32> = own.flatten().collect();
            let own = free.iter().filter(|slots| head(slots[0]) == number).flatten().copied();
            core.extend(own.filter(is_in_tree));
            let mut lone = core.clone();
            lone.retain(|slot| island_of[*slot as usize] == NO_ISLAND);
            let is_same = |cluster: &Cluster| cluster.members == members && cluster.core == core;
            clusters.push(match known.iter().position(is_same) {
                Some(place) => known.swap_remove(place),
                None => {
                    let parts = members.iter().map(|member| &islands[*member].elimination);
                    let island = Island::new(Elimination::joined(parts, &core, particles));
                    Cluster { members, lone, core, island }
                }
            });
        }
        for Cluster { members, lone, island, .. } in clusters {
            let is_own =
                |slot: u32| lone.contains(&slot) || members.contains(&(island_of[slot as usize] as usize));
            let own = surfaces.iter().zip(&free).filter(|(_, slots)| is_own(slots[0]));
            island.surfaces.clear();
            island.surfaces.extend(own.map(|(contact, _)| *contact));
            island.set_pairs(pairs.iter().filter(|pair| is_own(pair.slots[0])).copied(), particles.len());
        }
    }
}

impl Island {
    /// Sets the contacts between its own particles.
    fn set_pairs(&mut self, pairs: impl Iterator<Item = StiffPair>, particles: usize) {
        let Self { elimination, pairs: own, node_of, .. } = self;
        own.clear();
        own.extend(pairs);
        node_of.clear();
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
