//! Ticks in which nothing touches as long as all chains are free: then substeps need no contacts, only a look at the chains
//! (`step/in_place.rs`).
//!
//! A free chain touches nothing else while it is in what is reserved for it, and nothing of its own while it is monotone along some direction, or,
//! of spheres, keeps within its play (`chains.rs`). All of these are convex: what holds at the start and at the end of a substep holds in
//! between, too. So nothing passes through another unseen. Where it does not hold after a substep, the tick is taken again with contacts;
//! a search before the tick, where velocities lead out, makes that rare.

use bevy::math::Vec3;

use super::broad_phase::{BroadPhase, mean};
use super::chains::{Chain, ChainPurpose, Proof};
use super::extents::{Coordinates, MonotoneDirection, is_monotone};
use super::shapes::Bounds;
use super::{Collider, ContactCaches, ContactMemory, Substep};
use crate::solver::graph::Exclusions;
use crate::solver::particles::{Particles, Vectors};

/// Number of ticks, at most, that are not tried after one that could not be taken as a whole.
const MAX_PAUSE: u32 = 16;

/// What a particle is ahead of the one before it, at least, as a multiple of the thickness of the chain: the rest is for rounding.
const MIN_ADVANCE: f32 = 1.01;

/// What it is to be where velocities lead to.
const EXPECTED_ADVANCE: f32 = 1.2;

/// Number of times that a direction along which a chain is monotone is searched for anew.
const MAX_TURNS: usize = 6;

/// What is to be looked at after each substep.
pub(in crate::solver) struct Watch<'a> {
    chains: &'a [Chain],
    directions: &'a [MonotoneDirection],
    links: &'a Vectors,
    drift: Drift,
    /// s.
    substep: f32,
}

/// What all have moved by since the search when the tick begins, m, and go on with, m/s.
#[derive(Clone, Copy)]
struct Drift {
    displacement: Vec3,
    velocity: Vec3,
}

impl Drift {
    fn after(self, duration: f32) -> Vec3 {
        self.displacement + self.velocity * duration
    }
}

impl Watch<'_> {
    /// Whether those of the free chains that are among these particles touch nothing when a number of `substeps` of the tick is done.
    pub fn holds(&self, particles: Coordinates, substeps: u32) -> bool {
        let (first, [x, _, _]) = particles;
        let from = self.chains.partition_point(|chain| chain.slots().start < first);
        let (chains, directions) = (&self.chains[from..], &self.directions[from..]);
        let to = chains.partition_point(|chain| chain.slots().start < first + x.len());
        let common = self.drift.after(substeps as f32 * self.substep);
        let free = AreFree { chains: &chains[..to], directions, links: self.links, particles, common };
        pulp::Arch::new().dispatch(free)
    }
}

/// Whether chains are free.
struct AreFree<'a> {
    chains: &'a [Chain],
    directions: &'a [MonotoneDirection],
    links: &'a Vectors,
    particles: Coordinates<'a>,
    common: Vec3,
}

impl pulp::WithSimd for AreFree<'_> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) -> bool {
        let Self { chains, directions, links, particles, common } = self;
        for (chain, monotone) in chains.iter().zip(directions) {
            let is_free = if monotone.direction == Vec3::ZERO {
                chain.is_free(particles, links, common)
            } else {
                is_monotone(simd, chain, particles, (common, chain.margin), *monotone)
            };
            if !is_free {
                return false;
            }
        }
        true
    }
}

/// Whether chains will be free at the end of a tick, and by what; the play of those that will have used it up is found anew.
struct WillBeFree<'a> {
    chains: &'a mut [Chain],
    directions: &'a mut Vec<MonotoneDirection>,
    links: &'a mut Vectors,
    particles: &'a Particles,
    /// Where velocities lead to, m.
    ahead: &'a Vectors,
    exclusions: &'a Exclusions,
    drift: Drift,
    /// s.
    time_step: f32,
    /// Whether chains collide along their links.
    with_edges: bool,
}

impl pulp::WithSimd for WillBeFree<'_> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) -> bool {
        let Self { chains, directions, links, particles, ahead, exclusions, drift, time_step, with_edges } =
            self;
        let (here, now, then) = ((0, particles.position.axes()), drift.displacement, drift.after(time_step));
        directions.clear();
        for chain in chains {
            let mut monotone = MonotoneDirection {
                direction: chord(chain, ahead),
                min_advance: 2.0 * EXPECTED_ADVANCE * chain.radius,
            };
            let is_monotone_ahead =
                |monotone| is_monotone(simd, chain, (0, ahead.axes()), (then, Vec3::ZERO), monotone);
            let mut is_found = is_monotone_ahead(monotone);
            // Spheres may have play.
            let turns = if with_edges { MAX_TURNS } else { 0 };
            for _ in 0..turns {
                if is_found {
                    break;
                }
                monotone.direction = turned(monotone.direction, chain, ahead);
                is_found = is_monotone_ahead(monotone);
            }
            monotone.min_advance = 2.0 * MIN_ADVANCE * chain.radius;
            if is_found && is_monotone(simd, chain, here, (now, chain.margin), monotone) {
                directions.push(monotone);
                continue;
            }
            if with_edges {
                return false;
            }
            directions.push(MonotoneDirection::default());
            let [outside, bent] = chain.proofs(ahead, links, then);
            if outside != Proof::Holds {
                return false;
            }
            if bent != Proof::Holds {
                chain.note_links(&particles.position, links);
                if !chain.renew_play(particles, exclusions, time_step) {
                    return false;
                }
            }
            if !chain.is_free(here, links, now) {
                return false;
            }
        }
        true
    }
}

/// The direction from the first particle of a chain to the last.
#[inline(always)]
fn chord(chain: &Chain, positions: &Vectors) -> Vec3 {
    let [first, last] = [chain.slots().start, chain.slots().end - 1].map(|slot| positions.get(slot));
    (last - first).normalize_or_zero()
}

/// A direction nearer to that of the link that advances the least (the perceptron: Rosenblatt, *Psychological Review* 65, 386, 1958; it finds
/// one along which all links advance, if there is any).
#[inline(always)]
fn turned(direction: Vec3, chain: &Chain, positions: &Vectors) -> Vec3 {
    let (mut least, mut worst) = (f32::INFINITY, Vec3::ZERO);
    let slots = chain.slots();
    let mut before = positions.get(slots.start);
    for slot in slots.start + 1..slots.end {
        let place = positions.get(slot);
        let link = place - before;
        let advance = direction.dot(link);
        if advance < least {
            (least, worst) = (advance, link);
        }
        before = place;
    }
    (direction + worst.normalize_or_zero()).normalize_or_zero()
}

impl BroadPhase {
    fn drift(&self, particles: &Particles) -> Drift {
        let velocity = mean(particles.len(), |slot| particles.velocity.get(slot));
        Drift { displacement: self.common_displacement(particles), velocity }
    }

    fn number_in_chains(&self) -> usize {
        self.chains.iter().map(|chain| chain.slots().len()).sum()
    }

    /// Does not try the next ticks as a whole: twice as many as after the last one that failed.
    fn pause_ticks(&mut self) {
        let [left, whole] = &mut self.tick_pause;
        *whole = (2 * *whole).clamp(1, MAX_PAUSE);
        *left = *whole;
    }
}

impl ContactCaches {
    /// What is to be watched in a tick in which nothing else can touch; `None` where contacts are to be looked for in each substep.
    /// `with_edges`: chains collide along their links.
    pub fn watch<'a>(
        &'a mut self,
        memory: &'a mut ContactMemory,
        particles: &Particles,
        substep: Substep,
        with_edges: bool,
    ) -> Option<Watch<'a>> {
        let Substep { settings, colliders, duration, .. } = substep;
        let count = particles.len();
        if settings.pair_rules.is_none() || !self.is_implicit.is_empty() || !memory.nothing_has_a_skin(count)
        {
            return None;
        }
        let last = memory.broad_phase.as_mut()?;
        if last.tick_pause[0] > 0 {
            last.tick_pause[0] -= 1;
            return None;
        }
        self.look_ahead(particles, settings.time_step);
        if !self.will_be_free(memory, particles, substep, with_edges) {
            let Self { candidates, pair_contacts, .. } = &mut *self;
            let start = (particles, &particles.position);
            candidates.renew(memory, pair_contacts, start, substep, ChainPurpose::ForTick);
            if !memory.nothing_has_a_skin(count) || !self.will_be_free(memory, particles, substep, with_edges)
            {
                memory.broad_phase.as_mut()?.pause_ticks();
                return None;
            }
        }
        let last = memory.broad_phase.as_mut()?;
        let drift = last.drift(particles);
        let displacement = [drift.displacement, drift.after(settings.time_step)];
        if self.is_near_colliders(last, particles, colliders, displacement) {
            last.pause_ticks();
            return None;
        }
        let last = memory.broad_phase.as_ref()?;
        self.rest();
        self.candidates.proof = Proof::Holds;
        let directions = &self.directions;
        Some(Watch { chains: &last.chains, directions, links: &last.chain_links, drift, substep: duration })
    }

    /// To be called after a tick that was watched: whether what was watched held in all its `substeps`.
    pub fn end_watch(&mut self, memory: &mut ContactMemory, has_held: bool, substeps: u32) {
        let Some(last) = &mut memory.broad_phase else { return };
        if has_held {
            last.tick_pause = [0; 2];
            memory.age = memory.age.saturating_add(substeps);
        } else {
            last.pause_ticks();
        }
    }

    /// Finds where velocities lead to in a tick.
    fn look_ahead(&mut self, particles: &Particles, time_step: f32) {
        // No substep has begun: this is not in use.
        self.has_previous = false;
        self.previous.resize(particles.len());
        let axes = particles.position.axes().into_iter().zip(particles.velocity.axes());
        for (ahead, (position, velocity)) in self.previous.axes_mut().into_iter().zip(axes) {
            let from = position.iter().zip(velocity);
            ahead.iter_mut().zip(from).for_each(|(ahead, (position, velocity))| {
                *ahead = position + time_step * velocity;
            });
        }
    }

    /// Whether all chains are likely to be free until the tick has passed, and what collides along its links is in them.
    fn will_be_free(
        &mut self,
        memory: &mut ContactMemory,
        particles: &Particles,
        substep: Substep,
        with_edges: bool,
    ) -> bool {
        let Self { candidates, previous: ahead, directions, .. } = self;
        candidates.refresh_exclusions(memory, particles, substep.elements);
        let Some(last) = memory.broad_phase.as_mut() else { return false };
        if with_edges && last.number_in_chains() < particles.len() {
            return false;
        }
        let time_step = substep.settings.time_step;
        let drift = last.drift(particles);
        let (exclusions, BroadPhase { chains, chain_links: links, .. }) = (&candidates.exclusions, last);
        pulp::Arch::new().dispatch(WillBeFree {
            chains,
            directions,
            links,
            particles,
            ahead,
            exclusions,
            drift,
            time_step,
            with_edges,
        })
    }

    /// Whether anything of the chains may touch a collider in a tick in which all move `displacement`, or anything else may.
    fn is_near_colliders(
        &self,
        last: &BroadPhase,
        particles: &Particles,
        colliders: &[Collider],
        displacement: [Vec3; 2],
    ) -> bool {
        if self.placed.is_empty() && self.placed.planes.is_empty() {
            return false;
        }
        let planes = || self.placed.planes.iter().map(|number| &colliders[*number as usize]);
        // What is in no chain has no radius; it may touch a collider all the same.
        if last.number_in_chains() < particles.len() || planes().any(Collider::moves) {
            return true;
        }
        last.chains.iter().any(|chain| {
            let (radius, [least, most]) = (chain.radius, chain.reserved());
            let [low, high] = [
                displacement[0].min(displacement[1]) + least - radius,
                displacement[0].max(displacement[1]) + most + radius,
            ];
            let is_below = |plane: &Collider| {
                let normal = plane.start.rotation * Vec3::Y;
                let lowest = Vec3::select(normal.cmpgt(Vec3::ZERO), low, high);
                let height = (lowest - plane.start.point).dot(normal);
                height.is_nan() || height <= 0.0
            };
            let mut is_near = planes().any(is_below);
            self.placed.for_each_near(&Bounds { low, high }, |_| is_near = true);
            is_near
        })
    }
}

#[cfg(test)]
impl ContactMemory {
    /// Number of ticks that are not tried as a whole from now on; `None` if none may be.
    pub(in crate::solver) fn ticks_to_pause(&self) -> Option<u32> {
        self.broad_phase.as_ref().filter(|last| !last.any_skins).map(|last| last.tick_pause[0])
    }
}
