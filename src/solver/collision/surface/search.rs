//! Which pairs may come near each other: those with bounding boxes, enlarged by margins, that overlap.
//!
//! Each vertex has two bounding boxes with a margin greater than its displacement in the substep of the search: one that moves with
//! its body, for pairs within it, and one fixed in the world, for pairs of bodies. No new search is needed while all vertices stay
//! inside; what moves together, or is far from all others, uses no margin up. `spread.rs` checks a whole body at once.
//! What is looked at in each substep are not all of the pairs that were found, but those of the last one of the lists (`lists.rs`).
//!
//! *Fast motion in a crowd*: such margins allow for motion in all directions, so that most pairs of the crowd are within them. There a search
//! is for the paths of one substep: its boxes enclose these, and it leaves out what is apart along one direction at both ends of the
//! paths (`pair_collector.rs`). It costs more, and is good for one substep only; so it is done where a search for all directions finds too
//! many pairs for the number of times that it is good enough.

mod boxes;

use bevy::math::Vec3A;

use super::crossing::Crossings;
use super::displacements::{Displacements, Measured};
use super::lanes::Lanes;
use super::lists::{List, NearPair};
use super::pair::Kind;
use super::pair_collector::PairQuery;
use super::primitives::Primitives;
use super::spread::Spread;
use super::tree::{Box3, Forest};
use super::walks::Walks;
use crate::solver::particles::{Particles, Vectors};

use super::super::material::ContactProperties;

/// A body with a vertex farther from its mean than this many of its sizes has diverged and no longer collides.
const MAX_EXTENT: f32 = 10.0;

/// Number of pairs from which on there are too many, for each primitive, and beside that: bodies that are put into each other have more.
const MAX_PAIRS: [usize; 2] = [200, 100_000];

/// Number of pairs per primitive from which on old lists are rebuilt.
const MAX_PAIRS_PER_PRIMITIVE: usize = 8;

/// Age at which they are, in substeps.
const MAX_AGE: u32 = 48;

/// Motion is fast where limits are, on average, wider than those of vertices at rest by this factor. Only then are searches for the paths of one
/// substep tried first: they cost more, and each is good once.
const MIN_SWEPT_WIDENING: f32 = 2.0;

/// Number of pairs per primitive, for each time that a search for all directions was good enough, above which the next ones are for paths.
const MAX_PAIRS_PER_USE: usize = 2;

/// Number of pairs per primitive at which a search for all directions stops where motion is fast, and one for paths takes its place.
const MAX_WIDE_PAIRS: usize = 24;

/// Number of searches for paths after which one for all directions is tried anew.
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
    /// Their distance at the start of the substep of the search, at least, m; if that is for the paths of the substep, all the way on these.
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
    is_good: bool,
    /// Whether there were too many pairs, so that none is known.
    pub is_overfull: bool,
    /// Number of times that it has been good enough since.
    age: u32,
    /// Whether it allowed for fast motion.
    is_wide: bool,
    /// Number of searches to come that are for the paths of one substep, as one for all directions has found too many pairs.
    sweeps: u32,
    /// Distance from touching up to which pairs are found, within a body and of bodies, m.
    margins: [f32; 2],
    /// Since the search. The boxes allow for the limits.
    displacements: Displacements,
    /// By slot: the boxes in which a vertex stays with its radius, with its body and in the world.
    boxes: [Vec<Box3>; 2],
    /// Those of the candidates that are near, and those of these that are nearer.
    lists: [List; 2],
    /// How many of the lists are good.
    built: usize,
    /// How far from touching they are listed, m.
    listed_margin: f32,
    /// The pairs that cross at the start of the substep.
    pub crossings: Crossings,
    walks: Walks,
    lanes: Lanes,
    /// By body: see [`Measured`].
    frames: Vec<usize>,
    /// By body: how far it moves as a whole in the substep of the search, m.
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

    /// Lists all pairs that come within `margin` m of touching in a substep, in an order that does not depend on when they were found; without
    /// a `margin` at least those that come so near that they are stopped.
    pub fn ensure(
        &mut self,
        primitives: &Primitives,
        moving: Moving,
        (properties, margin): (&[ContactProperties], Option<f32>),
    ) {
        self.allows_slack = margin.is_none();
        let margin = margin.unwrap_or(0.0);
        if margin > self.listed_margin {
            (self.listed_margin, self.built) = (margin, 0);
        }
        let margins = [margin; 2];
        if !(self.is_still_good(primitives, moving, margins) && self.hold_lists(primitives, moving, false)) {
            self.renew(primitives, moving, (properties, margins, true));
            // Beyond all scales it may not hold even now: then all candidates are looked at.
            if !self.hold_lists(primitives, moving, true) {
                self.list_all(moving);
            }
        }
        if self.near().is_empty() {
            self.crossings.clear();
        }
        let moved = &Self::last(&self.displacements, &self.lists).moved;
        self.crossings.find(&self.candidates, moved, moving);
    }

    /// Makes the candidates good for a displacement: all pairs that come within `margin` m of touching are among them, those within a body only if
    /// they are wanted, in an order that does not depend on when they were found.
    pub fn ensure_candidates(
        &mut self,
        primitives: &Primitives,
        moving: Moving,
        (properties, margin, within): (&[ContactProperties], f32, bool),
    ) {
        self.allows_slack = false;
        let margins = [if within { margin } else { 0.0 }, margin];
        let first_frame = usize::from(!within);
        let is_good = self.is_still_good(primitives, moving, margins);
        if !(is_good && self.hold((0, first_frame), primitives, moving, true)) {
            self.renew(primitives, moving, (properties, margins, within));
            if !self.hold((0, first_frame), primitives, moving, true) {
                self.displacements.moved.iter_mut().for_each(|moved| moved.fill(f32::INFINITY));
            }
        }
    }

    /// The pairs that may touch in the substep.
    pub fn near(&self) -> &[NearPair] {
        if self.built == 2 { &self.lists[1].pairs } else { &[] }
    }

    /// What a pair is.
    #[inline]
    pub fn candidate(&self, near: NearPair) -> &Candidate {
        &self.candidates[near.number as usize]
    }

    /// A distance below which a pair has not come at the start and at the end of the substep, m.
    #[inline]
    pub fn least_distance(&self, near: NearPair) -> f32 {
        self.candidate(near)
            .least_distance(near.distance, &Self::last(&self.displacements, &self.lists).moved)
    }

    /// The same for one of the candidates, by what has moved since the search.
    pub fn least_distance_of(&self, candidate: &Candidate) -> f32 {
        candidate.least_distance(candidate.distance, &self.displacements.moved)
    }

    /// Whether the last search found all pairs within the `margins`. Those that were found for fast motions are too many for slow ones.
    fn is_still_good(&mut self, primitives: &Primitives, moving: Moving, margins: [f32; 2]) -> bool {
        self.age = self.age.saturating_add(1);
        let is_within = (0..2).all(|frame| margins[frame] <= self.margins[frame]);
        self.is_good &= is_within && !self.is_old(primitives) && self.displacements.fit(moving);
        self.is_good
    }

    fn is_old(&self, primitives: &Primitives) -> bool {
        let many = MAX_PAIRS_PER_PRIMITIVE * primitives.forest.primitives();
        self.is_wide && self.age > MAX_AGE && self.candidates.len() > many
    }

    /// Searches anew, with room for ways within bodies if these are wanted.
    fn renew(
        &mut self,
        primitives: &Primitives,
        moving: Moving,
        (properties, margins, within): (&[ContactProperties], [f32; 2], bool),
    ) {
        (0..2).for_each(|frame| self.margins[frame] = self.margins[frame].max(margins[frame]));
        let count = primitives.forest.primitives();
        let many = MAX_PAIRS_PER_USE.saturating_mul(count).saturating_mul(self.age as usize);
        if self.is_wide && self.candidates.len() > many {
            self.sweeps = SWEEPS;
        }
        let is_fast = self.make_boxes(primitives, moving, (within, false)) > MIN_SWEPT_WIDENING;
        let most = max_pairs(&primitives.forest);
        let limit = if is_fast { most.min(MAX_WIDE_PAIRS * count) } else { most };
        let is_found = !(is_fast && self.sweeps > 0) && self.find(primitives, moving, properties, limit);
        if !is_found {
            self.make_boxes(primitives, moving, (true, true));
            self.sweeps = if self.sweeps == 0 { SWEEPS } else { self.sweeps - 1 };
        }
        // Whether there are too many follows from the paths alone, whatever has been tried before.
        self.is_overfull = !(is_found || self.find(primitives, moving, properties, most));
        // What was nowhere on its path may be somewhere in another look at the same substep.
        self.is_good = !self.is_overfull && (is_found || self.all_finite);
        (self.age, self.built) = (0, 0);
    }

    /// Finds the candidates, by the limits and boxes; false, and none, where there are `limit` or more.
    fn find(
        &mut self,
        primitives: &Primitives,
        moving: Moving,
        properties: &[ContactProperties],
        limit: usize,
    ) -> bool {
        let Self { displacements, boxes, frames, candidates, margins, lanes, walks, drifts, .. } = self;
        let (limits, is_swept) = (&displacements.limits, displacements.is_swept);
        lanes.fill(primitives, moving, (limits, is_swept));
        let query = PairQuery { primitives, moving, properties, limits, margins: *margins, lanes, is_swept };
        walks.find((query, limit), boxes, (frames, drifts), candidates)
    }

    /// Has all candidates looked at in this substep.
    fn list_all(&mut self, moving: Moving) {
        let [_, last] = &mut self.lists;
        last.list_all(self.candidates.len(), moving);
        self.displacements.is_swept = false;
        self.crossings.list(&self.candidates, (&last.pairs, &last.displacements.limits), &self.slacks);
        (self.is_good, self.built) = (false, 2);
    }

    /// Whether the last good list holds, or one before it, of which those after it are made.
    fn hold_lists(&mut self, primitives: &Primitives, moving: Moving, is_fresh: bool) -> bool {
        if self.displacements.is_swept {
            self.list_swept();
            return self.hold((0, 0), primitives, moving, true);
        }
        for level in (0..=self.built).rev() {
            self.built = level;
            let with_each = self.has_more() && !is_fresh || level == 2 && !self.lists[1].pairs.is_empty();
            if self.hold((level, 0), primitives, moving, with_each)
                && self.build_lists(primitives, moving, is_fresh)
            {
                return true;
            }
        }
        false
    }

    /// Makes the last list that of all candidates: they are for one substep only.
    fn list_swept(&mut self) {
        if self.built == 2 {
            return;
        }
        let Self { candidates, displacements, lists: [_, last], crossings, slacks, .. } = self;
        last.pairs.clear();
        last.pairs.extend(near_pairs(candidates));
        crossings.list(candidates, (&last.pairs, &displacements.limits), slacks);
        self.built = 2;
    }

    /// The displacements by which pairs of the last list are told.
    fn last<'a>(displacements: &'a Displacements, [_, last]: &'a [List; 2]) -> &'a Displacements {
        if displacements.is_swept { displacements } else { &last.displacements }
    }

    /// Whether a list has to be made of the last good one.
    fn has_more(&self) -> bool {
        match self.built {
            0 => !self.candidates.is_empty(),
            1 => !self.lists[0].pairs.is_empty(),
            _ => false,
        }
    }

    /// Makes lists of the last good one, or of candidates that are `fresh`: found in this substep. Whether it leaves room for them.
    fn build_lists(&mut self, primitives: &Primitives, moving: Moving, mut is_fresh: bool) -> bool {
        if !self.has_more() {
            return true;
        }
        while self.has_more() {
            let Self { candidates, displacements, lists: [first, second], frames, listed_margin, .. } = self;
            let measured = Measured { primitives, moving, frames };
            let wanted = (&candidates[..], *listed_margin, measured);
            let is_made = if self.built == 0 {
                first.make((near_pairs(candidates), displacements, is_fresh), wanted)
            } else {
                second.make((first.pairs.iter().copied(), &first.displacements, is_fresh), wanted)
            };
            if !is_made {
                return false;
            }
            self.built += 1;
            is_fresh = true;
        }
        let [_, last] = &self.lists;
        if self.built < 2 || last.pairs.is_empty() {
            return true;
        }
        self.crossings.list(&self.candidates, (&last.pairs, &last.displacements.limits), &self.slacks);
        self.hold((2, 0), primitives, moving, true)
    }

    /// Whether each vertex is within its limits of the search, for 0, or of a list, in the frames from one on, or beyond them by the slack.
    fn hold(
        &mut self,
        (level, first_frame): (usize, usize),
        primitives: &Primitives,
        moving: Moving,
        with_each: bool,
    ) -> bool {
        let Self { displacements, lists, frames, walks, largest, slacks, allows_slack, .. } = self;
        let displacements = match level.checked_sub(1) {
            None => displacements,
            Some(list) => &mut lists[list].displacements,
        };
        let measured = Measured { primitives, moving, frames };
        let slack = |number: usize| if *allows_slack { slacks[number] } else { 0.0 };
        displacements.hold(measured, (first_frame, with_each), slack, |number, spread| {
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

/// The number of pairs from which on there are too many.
fn max_pairs(forest: &Forest) -> usize {
    MAX_PAIRS[0] * forest.primitives() + MAX_PAIRS[1]
}

/// All candidates, by what a search knows of them.
fn near_pairs(candidates: &[Candidate]) -> impl Iterator<Item = NearPair> {
    let near = |(number, &Candidate { distance, direction, .. }): (u32, &Candidate)| NearPair {
        number,
        distance,
        direction,
    };
    (0..).zip(candidates).map(near)
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
