//! The pairs that are near, among all that were found.
//!
//! A search finds all pairs that may touch before a vertex is beyond its limit, which is wide, as searches are dear. Most of them are far
//! from touching for all of that time. The list has those of them that may touch before a vertex goes a part of that distance from where it
//! is now, by their distances of now: it is what is looked at in each substep (Verlet's neighbour lists, *Phys. Rev.* 159, 98, 1967, nested).

use bevy::math::Vec3A;

use super::displacements::{BALL, Displacements, Measured};
use super::pair::{apart_along, distance_on_paths, rounding_of};
use super::search::Candidate;
use super::steps::Steps;

/// How far a vertex may get before its pairs are listed anew, as a part of its radius.
const SKIN: f32 = 0.1;

/// For how many substeps vertices are expected to go on, for a list.
const SUBSTEPS: u32 = 8;

/// A pair that is near.
#[derive(Debug, Clone, Copy)]
pub(super) struct NearPair {
    /// Its number among the candidates.
    pub number: u32,
    /// Its distance while its corners are where they are expected, at least, m.
    pub distance: f32,
    /// The unit vector between its closest points at some time: its sides stay apart along it for long.
    pub direction: Vec3A,
}

/// The pairs that may touch while vertices are within limits.
#[derive(Debug, Clone, Default)]
pub(super) struct List {
    pub displacements: Displacements,
    pub pairs: Vec<NearPair>,
    /// The last renewal of the search that it is of.
    known: u32,
}

/// What a list is made of.
#[derive(Clone, Copy)]
pub(super) struct Found<'a> {
    pub candidates: &'a [Candidate],
    /// Their slots once more, close together.
    pub slots: &'a [[u32; 4]],
    /// Whether they have been found in this substep.
    pub is_fresh: bool,
    /// Those of the search.
    pub displacements: &'a Displacements,
    /// Distance from touching up to which pairs are wanted, m.
    pub margin: f32,
    pub measured: Measured<'a>,
    /// How far vertices are expected to go in a substep, m.
    pub steps: Steps<'a>,
    /// By how much those of a body may be beyond their limits, m.
    pub slacks: Option<&'a [f32]>,
}

impl List {
    /// Lists all pairs that may come within the margin of touching while vertices are within new limits.
    pub fn make(&mut self, found: Found) {
        let Found { displacements: Displacements { renewal, .. }, measured, .. } = found;
        let Measured { primitives, moving, frames } = measured;
        let own = &mut self.displacements;
        // What has been found just now is known on the same paths.
        let bodies = primitives.forest.bodies.len();
        match found.is_fresh {
            true => own.begin_as(found.displacements, moving, bodies),
            false => own.begin(moving, bodies, (found.steps, SUBSTEPS)),
        }
        let radius = moving.particles.radius();
        for (number, body) in primitives.forest.bodies.iter().enumerate() {
            own.find_drift(number, primitives, moving);
            for slot in primitives.forest.vertices_of(body) {
                let far = own.distances((number as u32, *slot as usize), moving);
                for (frame, [_, end]) in far.into_iter().enumerate().take(frames[number]) {
                    let limit = end + SKIN * radius[*slot as usize] + f32::MIN_POSITIVE;
                    own.limit((number as u32, *slot as usize, frame), limit);
                }
            }
        }
        for slot in &primitives.balls {
            let [_, [_, end]] = own.distances((BALL, *slot as usize), moving);
            own.limits[1][*slot as usize] = end + SKIN * radius[*slot as usize] + f32::MIN_POSITIVE;
        }
        self.known = *renewal;
        self.pairs.clear();
        self.add(found);
    }

    /// Has it hold in the substep, with the pairs of what begins anew listed again; from which pair on these are. `None` where it does not hold.
    pub fn renew(&mut self, found: Found) -> Option<usize> {
        let Found { slots, displacements: outer, measured, steps, slacks, .. } = found;
        let own = &mut self.displacements;
        own.find_each_beyond(measured, |body| slacks.map_or(0.0, |slacks| slacks[body]));
        if outer.renewal != self.known {
            for (number, body) in (0..).zip(&measured.primitives.forest.bodies) {
                let vertices = measured.primitives.forest.vertices_of(body).iter();
                let has_begun = |slot: &&u32| outer.renewals[**slot as usize] > self.known;
                own.beyond.extend(vertices.filter(has_begun).map(|slot| (number, *slot)));
            }
            self.known = outer.renewal;
        }
        if own.beyond.is_empty() {
            return Some(self.pairs.len());
        }
        if !own.may_renew(measured.primitives) {
            return None;
        }
        let radius = measured.moving.particles.radius();
        own.renew(measured.moving, |slot| steps.of(slot), |slot| SKIN * radius[slot]);
        let Self { displacements: own, pairs, .. } = self;
        pairs.retain(|near| !own.any_renewed(&slots[near.number as usize]));
        let first = pairs.len();
        self.add(found);
        Some(first)
    }

    /// Appends the pairs of what has begun anew.
    fn add(&mut self, found: Found) {
        let Found { candidates, slots, is_fresh, displacements: outer, margin, .. } = found;
        let Self { displacements: own, pairs, .. } = self;
        let moves = own.any_paths();
        for (number, slots) in (0..).zip(slots).filter(|(_, slots)| own.any_renewed(&slots[..])) {
            let candidate = &candidates[number as usize];
            let Candidate { kind, distance, direction, .. } = *candidate;
            let most = candidate.largest_reach() + margin + candidate.room(&own.limits);
            if is_fresh {
                if distance <= most {
                    pairs.push(NearPair { number, distance, direction });
                }
                continue;
            }
            if !outer.holds_for(slots, candidate.renewal) {
                continue;
            }
            let paths = slots.map(|slot| own.path(slot as usize));
            let [start, end] = [paths.map(|[start, _]| start), paths.map(|[_, end]| end)];
            let end = moves.then_some(&end);
            let rounding = rounding_of(&start).max(end.map_or(0.0, rounding_of));
            let along = |corners: &[Vec3A; 4]| apart_along(kind, corners, direction);
            if end.map_or(f32::INFINITY, along).min(along(&start)) - rounding > most {
                continue;
            }
            let is_far = |distance: f32| distance > most;
            if let Some((distance, direction)) = distance_on_paths(kind, (&start, end), is_far) {
                pairs.push(NearPair { number, distance, direction });
            }
        }
    }

    /// Lists the first `count` candidates, whatever their distances.
    pub fn list_all(&mut self, count: usize) {
        self.displacements.moved.iter_mut().for_each(|moved| moved.fill(f32::INFINITY));
        self.pairs.clear();
        let (distance, direction) = (f32::NEG_INFINITY, Vec3A::ZERO);
        self.pairs.extend((0..count as u32).map(|number| NearPair { number, distance, direction }));
    }
}
