//! Final check of a substep: no edge or triangle of a net passes through another one, or through a ball.
//!
//! At the start of a substep each pair is apart along the direction of its closest points. The distance of its sides along
//! a fixed direction is a concave function of time where all move straight on: a pair that is apart along it at the end, too,
//! was so all the way. That certifies nearly all pairs by a few products. Of the others a conservative advancement says how
//! far they get; their particles stop there, and the pairs of those are looked at again, until all are certified. as displacements only
//! get shorter, and nothing is passed without a way, this ends. Least distances keep rounding away.
//!
//! Pinned particles do not stop. What is in their way is pushed along, each particle by its share, and pushes others in turn.
//! Where that does not end, all that stops goes with a smooth field (`follow.rs`), and what that leaves too near is pushed.

use bevy::math::Vec3A;

use super::closest::Closest;
use super::contact::{COINCIDENT, gap_along};
use super::follow::DisplacementField;
use super::force_velocities::ForceVelocities;
use super::pair::{CLOSE_PART, MIN_DISTANCE_PART, PairPaths};
use super::primitives::Primitives;
use super::search::{Candidate, Moving, Search};
use crate::solver::particles::{Particles, Vectors};

/// Number of rounds in which particles may go a part of their displacement; in later ones they stay where they were.
const MAX_PARTIAL_ROUNDS: u32 = 6;

/// Number of rounds, at most.
const MAX_ROUNDS: u32 = 64;

/// Number of iterations over the velocities of what was stopped, at most.
const VELOCITY_ITERATIONS: usize = 32;

/// By which part of their distance two approach in a substep, at most, that are as near as the least distance. Nearer ones approach by
/// a part of it that is as much smaller as their distance is: what is pressed together for n substeps comes as near as
/// 1 / (1 + 0.03 n) of the least distance, and not as 0.97ⁿ: [`COINCIDENT`], a thousandth of it, is 33,000 substeps away, not 227.
const APPROACH: f32 = 0.03;

/// Number of bands below the least distance. What was stopped in one of them is certified by the lower end of the next, so that it
/// is not shortened by a little again and again; the lowest ends at half of the least distance.
const MAX_BANDS: u32 = 8;

/// How much heavier a particle counts that is pushed already, so that what is in its way yields.
const PUSHED_HEAVINESS: f32 = 10.0;

/// A pair that may come too near.
#[derive(Debug, Clone, Copy)]
struct ClosePair {
    /// Its number among the candidates.
    number: u32,
    /// Along which they are apart at the start.
    direction: Vec3A,
    /// Along which, and with which weights, they are apart where they were stopped or pushed; see [`super::contact::Contact`].
    normal: Vec3A,
    weights: [f32; 4],
    /// At the start, m.
    distance: f32,
    /// m.
    least: f32,
    /// Whether it was stopped or pushed.
    is_met: bool,
}

/// The distances, m, between which a pair is stopped at an `attempt`, if it is `distance` m apart at the start and to keep `least` m.
fn band(distance: f32, least: f32, attempt: u32) -> [f32; 2] {
    let width = least.min(distance - least).max(0.0) / (2 * MAX_BANDS) as f32;
    let lower = least - attempt.min(MAX_BANDS) as f32 * width;
    [lower, lower + width]
}

/// Working memory.
#[derive(Debug, Clone, Default)]
pub(super) struct Advance {
    close_pairs: Vec<ClosePair>,
    /// The part of its way that each particle goes.
    parts: Vec<f32>,
    next: Vec<f32>,
    /// The particles that stop on the way.
    stopped: Vec<u32>,
    /// By slot: whether it is pushed by what is pinned, if through others.
    is_pushed: Vec<bool>,
    /// What goes along with pinned particles where nothing else ends.
    field: DisplacementField,
    pub force_velocities: ForceVelocities,
    /// What loses of what forces gave it: by slot, the part of its displacement that it goes.
    losing: Vec<(u32, f32)>,
}

impl Advance {
    /// Stops the particles that would pass through something on the way from `start`; whether there were any. The number of the
    /// `attempt` in the substep counts from 0. `loses` says whether they lose what they have gained.
    pub fn stop(
        &mut self,
        (search, primitives): (&Search, &Primitives),
        start: &Vectors,
        particles: &mut Particles,
        (attempt, loses): (u32, bool),
    ) -> bool {
        self.find_close_pairs(
            (search, primitives),
            Moving { start, end: &particles.position, particles },
            attempt,
        );
        if self.close_pairs.is_empty() {
            return false;
        }
        let count = particles.len();
        self.stopped.reserve(count);
        for parts in [&mut self.parts, &mut self.next] {
            parts.clear();
            parts.resize(count, 1.0);
        }
        self.is_pushed.resize(count, false);
        match self.settle(search, start, particles, attempt) {
            Some(0) => return false,
            Some(_) => {}
            None => {
                self.put_back(start, (particles, loses), &primitives.on_mesh);
                self.find_close_pairs(
                    (search, primitives),
                    Moving { start, end: &particles.position, particles },
                    attempt,
                );
                self.settle(search, start, particles, attempt);
            }
        }
        self.stop_velocities(search, particles);
        if loses {
            for pair in self.close_pairs.iter().filter(|pair| pair.is_met) {
                self.force_velocities.join(search.candidates[pair.number as usize].slots, particles);
            }
        }
        self.losing.clear();
        for slot in self.stopped.iter().map(|slot| *slot as usize) {
            // Some are listed more than once.
            let part = std::mem::replace(&mut self.parts[slot], 1.0);
            if part < 1.0 {
                let [from, to] = [start.get(slot), particles.position.get(slot)];
                particles.position.set(slot, if part == 0.0 { from } else { from + part * (to - from) });
                self.losing.push((slot as u32, part));
            }
        }
        if loses && !self.losing.is_empty() {
            self.force_velocities.lose(particles, &self.losing);
        }
        true
    }

    /// Removes the approaching velocity of pairs that were stopped, which else would be stopped in each substep.
    fn stop_velocities(&self, search: &Search, particles: &mut Particles) {
        for _ in 0..VELOCITY_ITERATIONS {
            let mut any = false;
            for pair in self.close_pairs.iter().filter(|pair| pair.is_met) {
                let candidate = &search.candidates[pair.number as usize];
                let (slots, weights) = (candidate.slots.map(|slot| slot as usize), pair.weights);
                let inverse_mass = slots.map(|slot| particles.inverse_mass()[slot]);
                let yields: f32 = (0..4).map(|place| weights[place].powi(2) * inverse_mass[place]).sum();
                let velocity = slots.map(|slot| Vec3A::from(particles.velocity.get(slot)));
                let relative: Vec3A = (0..4).map(|place| weights[place] * velocity[place]).sum();
                let approach = -relative.dot(pair.normal);
                if approach.is_nan() || approach <= 0.0 || yields == 0.0 {
                    continue;
                }
                any = true;
                for place in 0..candidate.kind.corners() {
                    let share = weights[place] * inverse_mass[place] / yields;
                    let new = velocity[place] + pair.normal * (approach * share);
                    particles.velocity.set(slots[place], new.into());
                }
            }
            if !any {
                return;
            }
        }
    }

    /// Shortens displacements until all are certified: in how many rounds, or `None` where they are not after [`MAX_ROUNDS`].
    fn settle(
        &mut self,
        search: &Search,
        start: &Vectors,
        particles: &mut Particles,
        attempt: u32,
    ) -> Option<u32> {
        (0..MAX_ROUNDS).find(|round| !self.shorten(search, start, particles, [*round, attempt]))
    }

    /// Puts all surfaces and balls back to where they were, but for what goes along with pinned ones.
    pub fn put_back(
        &mut self,
        start: &Vectors,
        (particles, loses): (&mut Particles, bool),
        on_mesh: &[bool],
    ) {
        let Self { field, parts, next, stopped, is_pushed, force_velocities, losing, .. } = self;
        losing.clear();
        field.measure(start, particles, on_mesh);
        for slot in 0..particles.len() {
            if !may_stop(particles, on_mesh, slot) {
                continue;
            }
            let place = Vec3A::from(start.get(slot));
            particles.position.set(slot, (place + field.at(place)).into());
            (parts[slot], next[slot], is_pushed[slot]) = (1.0, 1.0, true);
            stopped.push(slot as u32);
            losing.push((slot as u32, 0.0));
        }
        if loses {
            force_velocities
                .join((0..particles.len() as u32).filter(|slot| on_mesh[*slot as usize]), particles);
            force_velocities.join(losing.iter().map(|(slot, _)| *slot), particles);
            force_velocities.lose(particles, losing);
        }
    }

    /// Takes from the particles that were stopped in the last substep what they have gained since.
    pub fn lose_force_velocities(&mut self, particles: &mut Particles) {
        self.stopped.sort_unstable();
        self.stopped.dedup();
        self.losing.clear();
        let is_free = |slot: &&u32| !particles.is_pinned(**slot as usize);
        self.losing.extend(self.stopped.iter().filter(is_free).map(|slot| (*slot, 0.0)));
        if !self.losing.is_empty() {
            self.force_velocities.lose(particles, &self.losing);
        }
    }

    /// The particles that were stopped in the last substep.
    pub fn stopped(&self) -> &[u32] {
        &self.stopped
    }

    /// Nothing was stopped or pushed.
    pub fn clear(&mut self) {
        self.stopped.clear();
        self.is_pushed.clear();
        self.force_velocities.clear();
    }

    /// Lists the pairs that come too near on their paths, and those that are so near at the start that they would if one of them stopped.
    /// Both are in any list of candidates that holds for these paths: which pairs are close does not depend on when they were found.
    fn find_close_pairs(
        &mut self,
        (search, primitives): (&Search, &Primitives),
        moving: Moving,
        attempt: u32,
    ) {
        self.close_pairs.clear();
        self.close_pairs.reserve(search.near().len());
        for near in search.near() {
            let candidate = search.candidate(*near);
            let most_near = (1.0 + CLOSE_PART) * MIN_DISTANCE_PART * candidate.largest_reach();
            if search.least_distance(*near) > most_near || search.crossings.exempt(candidate) {
                continue;
            }
            let paths = candidate.paths(moving);
            let Closest { apart, weights } = paths.closest(0.0);
            let distance = apart.length();
            if distance.is_nan() || distance <= COINCIDENT * candidate.reach {
                continue;
            }
            let direction = apart / distance;
            let least = MIN_DISTANCE_PART * candidate.largest_reach();
            let approach = APPROACH * (distance / least).min(1.0);
            let least = least.min((1.0 - approach) * distance);
            let band = band(distance, least, attempt);
            let is_apart =
                || paths.gap(direction, 1.0) >= band[0] || paths.first_within(distance, band) >= 1.0;
            if distance > most_near && is_apart() {
                continue;
            }
            let weights = candidate.signed(weights);
            self.close_pairs.push(ClosePair {
                number: near.number,
                direction,
                normal: direction,
                weights,
                distance,
                least,
                is_met: false,
            });
        }
        // In an order that does not depend on when they were found.
        self.close_pairs.sort_unstable_by_key(|pair| search.order(pair.number, primitives));
    }

    /// One round over all pairs; whether any particle goes less far than before.
    fn shorten(
        &mut self,
        search: &Search,
        start: &Vectors,
        particles: &mut Particles,
        [round, attempt]: [u32; 2],
    ) -> bool {
        let Self { close_pairs, parts, next, stopped, is_pushed, .. } = self;
        let mut any = false;
        for pair in &mut *close_pairs {
            let candidate = &search.candidates[pair.number as usize];
            let slots = candidate.slots.map(|slot| slot as usize);
            // In a later round only what has been stopped in the one before makes a difference.
            if round > 0 && !slots.iter().any(|slot| parts[*slot] < 1.0 || is_pushed[*slot]) {
                continue;
            }
            let mut paths = candidate.paths(Moving { start, end: &particles.position, particles });
            for (displacement, slot) in paths.displacement.iter_mut().zip(slots) {
                *displacement *= parts[slot];
            }
            let band = band(pair.distance, pair.least, attempt + round);
            if paths.gap(pair.direction, 1.0) >= band[0] {
                continue;
            }
            let may_move_partly = round < MAX_PARTIAL_ROUNDS;
            let time = paths.first_within(pair.distance, band);
            if time >= 1.0 {
                continue;
            }
            pair.is_met = true;
            let is_pushed_already = slots.iter().any(|slot| is_pushed[*slot]);
            let has_stopped = slots.iter().all(|slot| particles.is_pinned(*slot) || parts[*slot] == 0.0);
            if is_pushed_already || has_stopped {
                any |= push((candidate, time), &paths, pair, particles, (parts, next, is_pushed, stopped));
            } else {
                any |= stop_pair(
                    (slots, if may_move_partly { time } else { 0.0 }),
                    particles,
                    (parts, next, stopped),
                );
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

/// Limits the displacements of the free particles of a pair; whether that makes any shorter.
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

/// Pushes the free particles of a pair along, in front of pinned ones that go where they are sent, or of what these push; whether
/// any are. They part at the closest points at a `time`.
fn push(
    (candidate, time): (&Candidate, f32),
    paths: &PairPaths,
    pair: &mut ClosePair,
    particles: &mut Particles,
    (parts, next, is_pushed, stopped): (&mut [f32], &mut [f32], &mut [bool], &mut Vec<u32>),
) -> bool {
    let slots = candidate.slots.map(|slot| slot as usize);
    let Closest { apart, weights } = paths.closest(time);
    let (normal, weights) = (apart.normalize_or_zero(), candidate.signed(weights));
    let ends = paths.at(1.0);
    let gap = gap_along(normal, weights, ends);
    // Beyond what counts as near.
    let kept = pair.least + 2.0 * CLOSE_PART * pair.least.min(pair.distance - pair.least);
    let yielding = |place: usize| {
        let heaviness = if is_pushed[slots[place]] { PUSHED_HEAVINESS } else { 1.0 };
        weights[place] * particles.inverse_mass()[slots[place]] / heaviness
    };
    let yields: f32 = (0..4).map(|place| weights[place] * yielding(place)).sum();
    let length = (kept - gap) / yields;
    if !(length.is_finite() && length > 0.0) {
        return false;
    }
    (pair.normal, pair.weights) = (normal, weights);
    let pushed: [Vec3A; 4] = std::array::from_fn(|place| ends[place] + normal * (length * yielding(place)));
    for (slot, end) in slots.into_iter().zip(pushed).take(candidate.kind.corners()) {
        if particles.is_pinned(slot) {
            continue;
        }
        if next[slot] == 1.0 && !is_pushed[slot] {
            stopped.push(slot as u32);
        }
        particles.position.set(slot, end.into());
        (parts[slot], next[slot], is_pushed[slot]) = (1.0, 1.0, true);
    }
    true
}
