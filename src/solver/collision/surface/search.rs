//! Which pairs may come near each other: those with bounding boxes, enlarged by margins, that overlap.
//!
//! Each vertex has two bounding boxes of the path that it is expected to go for some substeps, with a margin: one that moves with
//! its body, for pairs within it, and one fixed in the world, for pairs of bodies. What is found holds while all vertices stay within their limits of
//! these paths (`displacements.rs`); what goes on as it did, moves together, or is far from all others, uses none up. Of those that leave them, as they
//! are hit, the pairs are looked for again, and of those only, until they are many. `spread.rs` checks a whole body at once.
//! What is looked at in each substep are not all of the pairs that were found, but those of the list (`list.rs`).
//!
//! *Fast motion in a crowd*: where there are too many pairs on paths of several substeps, a search is for those of one substep.

mod boxes;

use bevy::math::Vec3A;

use super::crossing::Crossings;
use super::displacements::{BALL, Displacements, Measured};
use super::list::{Found, List, NearPair};
use super::order::Order;
use super::pair::Kind;
use super::pair_collector::PairQuery;
use super::primitives::Primitives;
use super::spread::Spread;
use super::steps::Steps;
use super::tree::{Box3, Forest};
use super::walks::Walks;
use crate::solver::particles::{Particles, Vectors};

use super::super::material::ContactProperties;

/// A body with a vertex farther from its mean than this many of its sizes has diverged and no longer collides.
const MAX_EXTENT: f32 = 10.0;

/// Number of pairs from which on there are too many, for each primitive, and beside that: bodies that are put into each other have more.
const MAX_PAIRS: [usize; 2] = [200, 100_000];

/// Number of pairs per primitive, for each substep in which a search held, above which the next ones are for one substep.
const MAX_PAIRS_PER_USE: usize = 1;

/// Number of pairs per primitive at which a search for several substeps stops, and one for one substep takes its place.
const MAX_WIDE_PAIRS: usize = 8;

/// Number of searches for one substep after which one for several is tried anew.
const SWEEPS: u32 = 64;

/// Two primitives that may touch while vertices are within their limits.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Candidate {
    pub slots: [u32; 4],
    pub kind: Kind,
    /// Marks of the first and the second primitive.
    pub marks: [u8; 2],
    /// Whether both are of one body.
    pub is_within: bool,
    /// See [`Order`].
    pub place: u32,
    pub path: u64,
    /// The renewal of the search in which it was found.
    pub renewal: u32,
    /// Their distance while their corners are where they are expected, at least, m.
    pub distance: f32,
    /// The unit vector between their closest points at some time.
    pub direction: Vec3A,
    /// The distance at which they may touch, at most, m.
    pub reach: f32,
    /// The greatest distance that they keep, m: half of the way from one to the other along the mesh.
    pub most: f32,
}

/// What is known since the last search.
#[derive(Debug, Clone, Default)]
pub(super) struct Search {
    pub candidates: Vec<Candidate>,
    /// Their slots once more, close together.
    slots: Vec<[u32; 4]>,
    is_good: bool,
    /// Whether there were too many pairs, so that none is known.
    pub is_overfull: bool,
    /// Number of substeps in which it has held.
    age: u32,
    /// The number of pairs that it has found.
    found: usize,
    /// Whether it is for one substep.
    is_short: bool,
    /// For how many substeps its paths are.
    substeps: u32,
    /// Number of searches to come that are for one substep, as one for several has found too many pairs.
    sweeps: u32,
    /// Distance from touching up to which pairs are found, within a body and of bodies, m.
    margins: [f32; 2],
    /// Since the search. The boxes allow for the limits.
    displacements: Displacements,
    /// Where vertices were at the start of the substep before, and at that of this one, by slot, m.
    places: [Vectors; 2],
    /// By slot: the boxes in which a vertex stays with its radius, with its body and in the world.
    boxes: [Vec<Box3>; 2],
    list: List,
    /// Whether the list is of what has been found.
    is_listed: bool,
    /// How far from touching they are listed, m.
    listed_margin: f32,
    /// The pairs that cross at the start of the substep.
    pub crossings: Crossings,
    walks: Walks,
    /// By body: see [`Measured`].
    frames: Vec<usize>,
    /// By body: how far it goes as a whole in a substep, m.
    drifts: Vec<Vec3A>,
    /// By body: the greatest radius, and half of the margin, m.
    largest: Vec<f32>,
    /// Whether all vertices were somewhere at both ends of the substep of the search.
    all_finite: bool,
    /// By body: see [`boxes::STOP_SLACK`], m.
    slacks: Vec<f32>,
    /// Whether what is known is good enough within these.
    allows_slack: bool,
}

/// The particles at the start and at the end of a substep.
#[derive(Clone, Copy)]
pub(super) struct Moving<'a> {
    pub start: &'a Vectors,
    pub end: &'a Vectors,
    /// Their radii and masses.
    pub particles: &'a Particles,
}

impl Moving<'_> {
    #[inline(always)]
    pub fn ends(&self, slot: usize) -> [Vec3A; 2] {
        [self.start.get(slot).into(), self.end.get(slot).into()]
    }
}

impl Search {
    /// The next substep searches.
    pub fn reset(&mut self) {
        (self.is_good, self.margins, self.listed_margin) = (false, [0.0; 2], 0.0);
    }

    /// A substep begins, with all where they are now.
    pub fn begin_substep(&mut self, now: &Vectors) {
        let [before, current] = &mut self.places;
        if current == now {
            return;
        }
        std::mem::swap(before, current);
        current.copy_from(now);
        if before.len() != current.len() {
            before.copy_from(current);
        }
        if self.is_good {
            self.displacements.begin_substep();
            if self.is_listed {
                self.list.displacements.begin_substep();
            }
        }
    }

    /// Lists all pairs that come within `margin` m of touching in a substep; without a `margin` at least those that come so near that they are stopped.
    pub fn ensure(
        &mut self,
        primitives: &Primitives,
        moving: Moving,
        (properties, margin): (&[ContactProperties], Option<f32>),
    ) {
        self.allows_slack = margin.is_none();
        let margin = margin.unwrap_or(0.0);
        if margin > self.listed_margin {
            (self.listed_margin, self.is_listed) = (margin, false);
        }
        let wanted = Wanted { properties, margins: [margin; 2], within: true };
        let holds = self.prepare(primitives, moving, (wanted, false));
        if self.is_overfull {
            self.list.pairs.clear();
        } else if holds {
            self.hold_list(primitives, moving);
        } else {
            // Beyond all scales.
            self.list.list_all(self.candidates.len());
            self.is_listed = false;
            self.crossings.clear();
            self.crossings.list(
                &self.candidates,
                (&self.list.pairs, &self.list.displacements.limits),
                &self.slacks,
            );
        }
        if self.near().is_empty() {
            self.crossings.clear();
        }
        self.crossings.find(&self.candidates, &self.list.displacements.moved, moving);
    }

    /// Makes the candidates good for a displacement: all pairs that come within `margin` m of touching are among them, those within a body only if
    /// they are wanted.
    pub fn ensure_candidates(
        &mut self,
        primitives: &Primitives,
        moving: Moving,
        (properties, margin, within): (&[ContactProperties], f32, bool),
    ) {
        self.allows_slack = false;
        let margins = [if within { margin } else { 0.0 }, margin];
        let wanted = Wanted { properties, margins, within };
        if !self.prepare(primitives, moving, (wanted, true)) {
            self.displacements.moved.iter_mut().for_each(|moved| moved.fill(f32::INFINITY));
        }
    }

    /// The pairs that may touch in the substep.
    pub fn near(&self) -> &[NearPair] {
        &self.list.pairs
    }

    /// Where the candidate of a number comes among all.
    #[inline]
    pub fn order(&self, number: u32, primitives: &Primitives) -> Order {
        Order::of(&self.candidates[number as usize], &primitives.body_of)
    }

    /// What a pair is.
    #[inline]
    pub fn candidate(&self, near: NearPair) -> &Candidate {
        &self.candidates[near.number as usize]
    }

    /// A distance below which a pair has not come at the start and at the end of the substep, m.
    #[inline]
    pub fn least_distance(&self, near: NearPair) -> f32 {
        self.candidate(near).least_distance(near.distance, &self.list.displacements.moved)
    }

    /// The candidates that hold, with a distance below which they have not come at the start and at the end of the substep, m.
    pub fn holding(&self) -> impl Iterator<Item = (&Candidate, f32)> {
        let displacements = &self.displacements;
        let holds = |pair: &&Candidate| displacements.holds_for(&pair.slots, pair.renewal);
        let least = |pair: &Candidate| pair.least_distance(pair.distance, &displacements.moved);
        self.candidates.iter().filter(holds).map(move |pair| (pair, least(pair)))
    }

    /// Has the candidates be good for the substep, by searching for none, some or all; whether they are. `with_each` measures how far each vertex has moved.
    fn prepare(
        &mut self,
        primitives: &Primitives,
        moving: Moving,
        (wanted, with_each): (Wanted, bool),
    ) -> bool {
        self.age = self.age.saturating_add(1);
        let is_within = (0..2).all(|frame| wanted.margins[frame] <= self.margins[frame]);
        if self.is_good && is_within && self.hold(primitives, moving, (wanted, with_each)) {
            return true;
        }
        self.renew(primitives, moving, wanted);
        self.is_overfull
            || self.find_beyond(primitives, moving, (wanted.within, with_each))
                && self.displacements.beyond.is_empty()
    }

    /// Whether what is known holds in the substep, with the pairs of what is beyond its limits found again.
    fn hold(&mut self, primitives: &Primitives, moving: Moving, (wanted, with_each): (Wanted, bool)) -> bool {
        if !self.find_beyond(primitives, moving, (wanted.within, with_each)) {
            return false;
        }
        if self.displacements.beyond.is_empty() {
            return true;
        }
        let most = (2 * self.found).max(primitives.forest.primitives());
        if self.is_short || !self.displacements.may_renew(primitives) || self.candidates.len() > most {
            return false;
        }
        self.renew_boxes(moving);
        let Self { displacements, boxes, frames, candidates, margins, walks, .. } = self;
        let (particles, properties) = (moving.particles, wanted.properties);
        let query = PairQuery { primitives, particles, properties, displacements, margins: *margins };
        walks.find_renewed((query, max_pairs(&primitives.forest)), boxes, frames, candidates)
    }

    /// Searches anew, with room for ways within bodies if these are wanted.
    fn renew(&mut self, primitives: &Primitives, moving: Moving, wanted: Wanted) {
        let Wanted { properties, margins, within } = wanted;
        (0..2).for_each(|frame| self.margins[frame] = self.margins[frame].max(margins[frame]));
        let count = primitives.forest.primitives();
        let many = MAX_PAIRS_PER_USE.saturating_mul(count).saturating_mul(self.age as usize);
        if !self.is_short && self.found > many {
            self.sweeps = SWEEPS;
        }
        let most = max_pairs(&primitives.forest);
        let limit = most.min(MAX_WIDE_PAIRS * count);
        self.is_short = self.sweeps > 0;
        let is_found = !self.is_short && {
            self.make_boxes(primitives, moving, (within, false));
            self.find(primitives, moving, properties, limit)
        };
        if !is_found {
            self.make_boxes(primitives, moving, (true, true));
            self.sweeps = if self.sweeps == 0 { SWEEPS } else { self.sweeps - 1 };
            self.is_short = true;
        }
        // Whether there are too many follows from the paths alone, whatever has been tried before.
        self.is_overfull = !(is_found || self.find(primitives, moving, properties, most));
        // What was nowhere on its path may be somewhere in another look at the same substep.
        self.is_good = !self.is_overfull && (is_found || self.all_finite);
        (self.age, self.found, self.is_listed) = (0, self.candidates.len(), false);
        self.slots.clear();
    }

    /// Finds the candidates, by the limits and boxes; false, and none, where there are `limit` or more.
    fn find(
        &mut self,
        primitives: &Primitives,
        moving: Moving,
        properties: &[ContactProperties],
        limit: usize,
    ) -> bool {
        let Self { displacements, boxes, frames, candidates, margins, walks, drifts, .. } = self;
        let particles = moving.particles;
        let query = PairQuery { primitives, particles, properties, displacements, margins: *margins };
        walks.find((query, limit), boxes, (frames, drifts), candidates)
    }

    /// Has the list hold in the substep, or makes it anew.
    fn hold_list(&mut self, primitives: &Primitives, moving: Moving) {
        let Self { list, displacements, candidates, slots, places, frames, crossings, slacks, .. } = self;
        if candidates.is_empty() {
            list.pairs.clear();
            self.is_listed = false;
            return;
        }
        let (known, measured) = (slots.len().min(candidates.len()), Measured { primitives, moving, frames });
        slots.extend(candidates[known..].iter().map(|pair| pair.slots));
        let is_fresh = !self.is_listed && self.age == 0;
        let (margin, steps) = (self.listed_margin, Steps::of_places(places));
        let allowed = self.allows_slack.then_some(&slacks[..]);
        let found =
            Found { candidates, slots, is_fresh, displacements, margin, measured, steps, slacks: allowed };
        let added = if self.is_listed { list.renew(found) } else { None };
        let first = added.unwrap_or_else(|| {
            list.make(found);
            list.displacements.find_each_beyond(measured, |_| 0.0);
            crossings.clear();
            0
        });
        self.is_listed = true;
        crossings.list(candidates, (&list.pairs[first..], &list.displacements.limits), slacks);
    }

    /// Finds the vertices that are beyond their limits of the search, or beyond them by the slack; false where a body is elsewhere than it was expected.
    fn find_beyond(
        &mut self,
        primitives: &Primitives,
        moving: Moving,
        (within, with_each): (bool, bool),
    ) -> bool {
        let Self { displacements, frames, walks, largest, slacks, allows_slack, .. } = self;
        let measured = Measured { primitives, moving, frames };
        let slack = |number: usize| if *allows_slack { slacks[number] } else { 0.0 };
        displacements.find_beyond(measured, (usize::from(!within), with_each), slack, |number, spread| {
            let has_diverged = has_diverged(primitives, number, spread, moving);
            let (all, reach) = (spread.position, largest[number]);
            let is_in = |end: Vec3A| walks.body_boxes[number].contains(end, reach);
            match frames[number] {
                0 => has_diverged,
                1 => !has_diverged && is_in(all.least) && is_in(all.most),
                _ => !has_diverged,
            }
        })
    }
}

/// What a search is for.
#[derive(Clone, Copy)]
struct Wanted<'a> {
    properties: &'a [ContactProperties],
    /// See [`Search::margins`].
    margins: [f32; 2],
    /// Whether pairs within bodies are wanted.
    within: bool,
}

/// The number of pairs from which on there are too many.
fn max_pairs(forest: &Forest) -> usize {
    MAX_PAIRS[0] * forest.primitives() + MAX_PAIRS[1]
}

/// Whether a body has diverged, as by too long explicit steps: all of its primitives would be near each other.
fn has_diverged(primitives: &Primitives, body: usize, spread: &Spread, moving: Moving) -> bool {
    let most = MAX_EXTENT * primitives.sizes[body];
    if (spread.position.most - spread.position.least).length_squared() <= most * most {
        return false;
    }
    let vertices = primitives.forest.vertices_of(&primitives.forest.bodies[body]);
    let mean = Primitives::mean(vertices, |slot| moving.end.get(slot));
    vertices.iter().any(|slot| moving.end.get(*slot as usize).distance_squared(mean) > most * most)
}
