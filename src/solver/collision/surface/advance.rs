//! The last word on where particles go in a substep: as far as nothing passes through anything.
//!
//! At the start of a substep each pair is apart along the direction of its closest points. The distance of its sides along
//! a fixed direction is a concave function of time where all move straight on: a pair that is apart along it at the end, too,
//! was so all the way. That certifies nearly all pairs by a few products. Of the others a conservative advancement says how
//! far they get; their particles stop there, and the pairs of those are looked at again, until all are certified. As ways only
//! get shorter, and nothing is passed without a way, this ends. Least distances keep rounding away.

use bevy::math::Vec3A;

use super::closest::Closest;
use super::contact::COINCIDENT;
use super::pair::{CLOSE_PART, LEAST_PART, Ways};
use super::search::{Moving, Search};
use crate::solver::particles::{Particles, Vectors};

/// Number of rounds after which what would pass through something stays where it was.
const PATIENT_ROUNDS: u32 = 6;

/// Number of rounds, at most.
const MAX_ROUNDS: u32 = 64;

/// Number of iterations over the velocities of what was stopped, at most.
const VELOCITY_ITERATIONS: usize = 32;

/// The part of the present distance below which two do not come that are nearer than the least distance already.
const KEPT_PART: f32 = 0.97;

/// A pair that may come too near.
#[derive(Debug, Clone, Copy)]
struct Tight {
    /// Its number among the candidates.
    number: u32,
    direction: Vec3A,
    /// Those of the closest points at the start; see [`super::contact::Contact`].
    weights: [f32; 4],
    /// At the start, m.
    distance: f32,
    /// m.
    least: f32,
    /// Whether it was stopped.
    is_met: bool,
}

/// Working memory.
#[derive(Debug, Clone, Default)]
pub(super) struct Advance {
    tight: Vec<Tight>,
    /// The part of its way that each particle goes.
    parts: Vec<f32>,
    next: Vec<f32>,
    /// The particles that stop on the way.
    stopped: Vec<u32>,
    is_carried: Vec<bool>,
}

impl Advance {
    /// Stops the particles that would pass through something on the way from `start`; whether there were any.
    pub fn stop(
        &mut self,
        (search, on_mesh): (&Search, &[bool]),
        start: &Vectors,
        particles: &mut Particles,
    ) -> bool {
        self.find_tight(search, Moving { start, end: &particles.position, particles });
        if self.tight.is_empty() {
            return false;
        }
        let count = particles.len();
        self.stopped.reserve(count);
        for parts in [&mut self.parts, &mut self.next] {
            parts.clear();
            parts.resize(count, 1.0);
        }
        self.is_carried.clear();
        self.is_carried.resize(count, false);
        let mut is_settled = false;
        for round in 0..MAX_ROUNDS {
            is_settled = !self.shorten(search, start, particles, round);
            if is_settled {
                break;
            }
        }
        if !is_settled {
            self.stop_all(particles, on_mesh);
        }
        self.stop_velocities(search, particles);
        let mut any = false;
        for slot in self.stopped.iter().map(|slot| *slot as usize) {
            // Some are listed more than once.
            let part = std::mem::replace(&mut self.parts[slot], 1.0);
            if part < 1.0 {
                let [from, to] = [start.get(slot), particles.position.get(slot)];
                particles.position.set(slot, if part == 0.0 { from } else { from + part * (to - from) });
                any = true;
            }
        }
        any
    }

    /// Has the sides of what was stopped approach each other no longer: without that springs would drive them on, and on.
    fn stop_velocities(&self, search: &Search, particles: &mut Particles) {
        for _ in 0..VELOCITY_ITERATIONS {
            let mut any = false;
            for pair in self.tight.iter().filter(|pair| pair.is_met) {
                let candidate = &search.candidates[pair.number as usize];
                let (slots, weights) = (candidate.slots.map(|slot| slot as usize), pair.weights);
                let inverse_mass = slots.map(|slot| particles.inverse_mass()[slot]);
                let yields: f32 = (0..4).map(|place| weights[place].powi(2) * inverse_mass[place]).sum();
                let velocity = slots.map(|slot| Vec3A::from(particles.velocity.get(slot)));
                let relative: Vec3A = (0..4).map(|place| weights[place] * velocity[place]).sum();
                let approach = -relative.dot(pair.direction);
                if approach.is_nan() || approach <= 0.0 || yields == 0.0 {
                    continue;
                }
                any = true;
                for place in 0..candidate.kind.corners() {
                    let share = weights[place] * inverse_mass[place] / yields;
                    let new = velocity[place] + pair.direction * (approach * share);
                    particles.velocity.set(slots[place], new.into());
                }
            }
            if !any {
                return;
            }
        }
    }

    /// Puts all surfaces and balls back to where they were.
    pub fn put_back(&mut self, start: &Vectors, particles: &mut Particles, on_mesh: &[bool]) {
        for slot in 0..particles.len() {
            if may_stop(particles, on_mesh, slot) {
                particles.position.set(slot, start.get(slot));
                self.stopped.push(slot as u32);
            }
        }
    }

    /// Leaves all surfaces and balls where they were.
    fn stop_all(&mut self, particles: &Particles, on_mesh: &[bool]) {
        let Self { parts, next, stopped, .. } = self;
        for slot in (0..parts.len()).filter(|slot| may_stop(particles, on_mesh, *slot)) {
            if parts[slot] == 1.0 {
                stopped.push(slot as u32);
            }
            (parts[slot], next[slot]) = (0.0, 0.0);
        }
    }

    /// The particles that were stopped in the last substep.
    pub fn stopped(&self) -> &[u32] {
        &self.stopped
    }

    /// Nothing was stopped.
    pub fn clear(&mut self) {
        self.stopped.clear();
    }

    /// Lists the pairs that are not certified by how little their particles have moved since the search.
    fn find_tight(&mut self, search: &Search, moving: Moving) {
        self.tight.clear();
        self.tight.reserve(search.close.len());
        for number in search.close.iter().copied() {
            let candidate = &search.candidates[number as usize];
            let least = LEAST_PART * candidate.largest_reach();
            if candidate.least_distance(&search.moved) > (1.0 + CLOSE_PART) * least {
                continue;
            }
            let ways = candidate.ways(moving);
            let Closest { apart, weights } = ways.closest(0.0);
            let distance = apart.length();
            // Also what moves together now may not, once one of its particles is stopped.
            if distance.is_nan() || distance <= COINCIDENT * candidate.reach {
                continue;
            }
            let (direction, least) = (apart / distance, least.min(KEPT_PART * distance));
            let weights = candidate.signed(weights);
            self.tight.push(Tight { number, direction, weights, distance, least, is_met: false });
        }
    }

    /// One round over all pairs; whether any particle goes less far than before.
    fn shorten(&mut self, search: &Search, start: &Vectors, particles: &mut Particles, round: u32) -> bool {
        let Self { tight, parts, next, stopped, is_carried } = self;
        let mut any = false;
        for pair in &mut *tight {
            let candidate = &search.candidates[pair.number as usize];
            let slots = candidate.slots.map(|slot| slot as usize);
            // In a later round only what has been stopped in the one before makes a difference.
            if round > 0 && !slots.iter().any(|slot| parts[*slot] < 1.0 || is_carried[*slot]) {
                continue;
            }
            let mut ways = candidate.ways(Moving { start, end: &particles.position, particles });
            for (way, slot) in ways.way.iter_mut().zip(slots) {
                *way *= parts[slot];
            }
            if ways.end_gap(pair.direction) >= pair.least {
                continue;
            }
            let is_patient = round < PATIENT_ROUNDS;
            let time = ways.first_near(pair.distance, pair.least);
            if time >= 1.0 {
                continue;
            }
            let time = if is_patient { time } else { 0.0 };
            pair.is_met = true;
            any |= stop_pair((slots, time), particles, (parts, next, stopped));
            if slots.iter().all(|slot| particles.is_pinned(*slot) || parts[*slot] == 0.0) {
                any |= carry(slots, &ways, start, particles, (parts, next, is_carried));
            }
        }
        for slot in stopped.iter().map(|slot| *slot as usize) {
            parts[slot] = next[slot];
        }
        any
    }
}

/// Whether the particle in a slot is free, and a ball or a corner of a surface.
fn may_stop(particles: &Particles, on_mesh: &[bool], slot: usize) -> bool {
    !particles.is_pinned(slot) && (on_mesh[slot] || particles.radius()[slot] > 0.0)
}

/// Has the free particles of a pair go no further than it may; whether that is less far than before.
fn stop_pair(
    (slots, time): ([usize; 4], f32),
    particles: &Particles,
    (parts, next, stopped): (&[f32], &mut [f32], &mut Vec<u32>),
) -> bool {
    let mut any = false;
    for slot in slots.into_iter().filter(|slot| !particles.is_pinned(*slot)) {
        let part = parts[slot] * time;
        if part < next[slot] {
            if next[slot] == 1.0 {
                stopped.push(slot as u32);
            }
            next[slot] = part;
            any = true;
        }
    }
    any
}

/// Moves the free particles of a pair along with the pinned ones, which go where they are sent, once; whether any are.
fn carry(
    slots: [usize; 4],
    ways: &Ways,
    start: &Vectors,
    particles: &mut Particles,
    (parts, next, is_carried): (&mut [f32], &mut [f32], &mut [bool]),
) -> bool {
    let count = ways.kind.corners();
    let pinned = || (0..count).filter(|place| particles.is_pinned(slots[*place]));
    let way = pinned().map(|place| ways.way[place]).sum::<Vec3A>() / pinned().count().max(1) as f32;
    if way == Vec3A::ZERO {
        return false;
    }
    let mut any = false;
    for slot in slots.into_iter().take(count) {
        if !particles.is_pinned(slot) && !std::mem::replace(&mut is_carried[slot], true) {
            let target = Vec3A::from(start.get(slot)) + way;
            particles.position.set(slot, target.into());
            (parts[slot], next[slot]) = (1.0, 1.0);
            any = true;
        }
    }
    any
}
