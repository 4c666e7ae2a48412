//! Which pairs touch, and where.

use bevy::math::{Vec3, Vec3A};

use super::list::NearPair;
use super::pair::{CLOSE_PART, Kind, PairPaths, apart_along, least_apart, rounding_of};
use super::primitives::owns;
use super::search::{Candidate, Moving, Search};
use crate::solver::particles::{Particles, Vectors};
use crate::solver::settings::PairRules;

use super::super::material::{ContactProperties, Material, properties_of};
use super::super::response::{Approach, Rebound, SprungApproach};

/// Fraction of the contact distance below which two primitives count as coincident: pairs that cross or are joined at the start are
/// ignored.
pub(super) const COINCIDENT: f32 = 1e-4;

/// Pairs with a relative displacement below this fraction of their distance are examined at its end: they are on the same side there.
const SLOW_DISPLACEMENT: f32 = 0.5;

/// Two primitives that touch.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Contact {
    /// Slots, later the places of its particles among those that touch.
    pub places: [u32; 4],
    /// The number of its pair among the candidates.
    pub candidate: u32,
    /// Those of the first side add up to 1, those of the second to −1.
    pub weights: [f32; 4],
    /// From the second to the first.
    pub normal: Vec3A,
    /// The distance that they keep, m.
    pub reach: f32,
    pub target_velocity: f32,
    /// 1 / Σ wᵢ²/mᵢ, kg.
    pub mass: f32,
    /// N·s.
    pub impulse: f32,
    pub friction: Vec3A,
    /// Coefficient of Coulomb friction.
    pub coefficient: f32,
    pub resting: bool,
    /// Whether springs pull at any of them.
    pub sprung: bool,
    /// The overlap that it keeps in this substep, m.
    pub overlap: f32,
    /// What it has corrected of the positions in this substep: along the normal, m, >= 0, and by friction, m.
    pub lifted: f32,
    pub held: Vec3A,
    /// How far it has slipped from where it sticks, before this substep, m.
    pub slip: Vec3A,
}

/// What an explicit scheme has evaluated in a substep, if it has.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Evaluations<'a> {
    /// The accelerations at its start and where it has led to, m/s²: see [`Evaluated`](super::super::Evaluated).
    pub accelerations: Option<[&'a Vectors; 2]>,
    /// By slot: whether an implicit step has moved the particle.
    pub is_implicit: &'a [bool],
}

/// What the examination of pairs reads.
pub(super) struct Examination<'a> {
    pub moving: Moving<'a>,
    /// m/s².
    pub acceleration: &'a Vectors,
    pub evaluated: Evaluations<'a>,
    pub rebound: Rebound,
    pub rules: PairRules,
    /// See [`properties_of`].
    pub properties: &'a [ContactProperties],
    pub search: &'a Search,
    pub on_mesh: &'a [bool],
}

impl Candidate {
    /// The corners of the first side, and those of the second.
    pub fn sides(&self) -> [&[u32]; 2] {
        let sides = self.kind.first_side();
        [&self.slots[..sides], &self.slots[sides..]]
    }

    /// The distance that they keep, at most, m.
    pub fn largest_reach(&self) -> f32 {
        self.reach.min(self.most)
    }

    /// A distance in m below which they have not come that are `distance` m apart where they are expected, and have `moved` from there.
    #[inline]
    pub fn least_distance(&self, distance: f32, moved: &[Vec<f32>; 2]) -> f32 {
        distance - self.room(moved)
    }

    /// By how much their distance may change where vertices move so far, by frame and slot, m.
    #[inline]
    pub fn room(&self, moved: &[Vec<f32>; 2]) -> f32 {
        let moved = &moved[usize::from(!self.is_within)];
        let most = |slots: &[u32]| slots.iter().map(|slot| moved[*slot as usize]).fold(0.0, f32::max);
        let [first, second] = self.sides();
        most(first) + most(second)
    }

    /// Weights of which those of the second side are negative.
    pub fn signed(&self, mut weights: [f32; 4]) -> [f32; 4] {
        weights[self.kind.first_side()..].iter_mut().for_each(|weight| *weight = -*weight);
        weights
    }

    /// The displacements of the corners in the substep.
    pub fn paths(&self, moving: Moving) -> PairPaths {
        let ends = self.slots.map(|slot| moving.ends(slot as usize));
        PairPaths {
            kind: self.kind,
            start: ends.map(|[start, _]| start),
            displacement: ends.map(|[start, end]| end - start),
        }
    }

    /// Whether the pair is the one that counts at the closest points with these weights: a corner belongs to several edges
    /// and triangles, an edge to several triangles.
    fn owns(&self, weights: &[f32; 4]) -> bool {
        match self.kind {
            Kind::VertexFace => {
                let is_zero = [1, 2, 3].map(|corner| weights[corner] == 0.0);
                let needed = match is_zero {
                    [false, true, true] => owns::CORNER,
                    [true, false, true] => owns::CORNER << 1,
                    [true, true, false] => owns::CORNER << 2,
                    [false, false, true] => owns::EDGE,
                    [true, false, false] => owns::EDGE << 1,
                    [false, true, false] => owns::EDGE << 2,
                    _ => 0,
                };
                self.marks[1] & needed == needed
            }
            Kind::EdgeEdge => {
                let sides = [[weights[0], weights[1]], [weights[2], weights[3]]];
                let [first, second] = self.marks;
                // A corner against an edge of triangles is a corner against a triangle.
                owns_end(sides[0], first, second & owns::FACE != 0)
                    && owns_end(sides[1], second, first & owns::FACE != 0)
            }
            Kind::VertexEdge => owns_end([weights[1], weights[2]], self.marks[1], false),
        }
    }
}

fn owns_end([one, other]: [f32; 2], marks: u8, is_known: bool) -> bool {
    match (one == 0.0, other == 0.0) {
        (false, false) => true,
        (false, true) => !is_known && marks & owns::CORNER != 0,
        _ => !is_known && marks & (owns::CORNER << 1) != 0,
    }
}

/// How far apart the points with these weights are along a normal, m, with the corners in these places.
pub(super) fn gap_along(normal: Vec3A, weights: [f32; 4], corners: [Vec3A; 4]) -> f32 {
    // Relative to a corner: the weights add up to zero.
    (0..4).map(|place| weights[place] * normal.dot(corners[place] - corners[0])).sum()
}

/// How a pair meets: at the closest points when its sides first come as near as they may, or at the end.
#[derive(Debug, Clone, Copy)]
pub(super) struct Meeting {
    /// See [`Contact`].
    pub weights: [f32; 4],
    pub normal: Vec3A,
    /// m.
    pub reach: f32,
    /// How far apart they are along the normal at the end, m.
    pub gap: f32,
}

impl Examination<'_> {
    /// How a pair meets, if its sides come within `slop` m of touching on the way.
    pub fn meeting(&self, near: NearPair, slop: f32) -> Option<Meeting> {
        let candidate = self.search.candidate(near);
        let largest = candidate.largest_reach();
        let least = self.search.least_distance(near);
        if least.is_nan() || least > largest + slop || self.search.crossings.exempt(candidate) {
            return None;
        }
        let paths = candidate.paths(self.moving);
        let displacement = paths.relative_displacement();
        let rounding = rounding_of(&paths.start);
        // Less than the true distance at the start: what is told from it must not depend on when the pair was listed.
        let at_least = apart_along(candidate.kind, &paths.start, near.direction)
            .max(least_apart(candidate.kind, &paths.start))
            - rounding;
        if at_least - displacement > largest + slop {
            return None;
        }
        let is_slow = |distance: f32| {
            distance > COINCIDENT * candidate.reach && displacement < SLOW_DISPLACEMENT * distance
        };
        let time = if is_slow(at_least) {
            if apart_along(candidate.kind, &paths.at(1.0), near.direction) - rounding > largest + slop {
                return None;
            }
            1.0
        } else {
            let distance = paths.closest(0.0).apart.length();
            if is_slow(distance) {
                1.0
            } else if (distance - displacement).is_nan()
                || distance - displacement > largest + slop
                || distance <= COINCIDENT * candidate.reach
            {
                return None;
            } else if distance <= largest {
                0.0
            } else {
                paths.first_near(distance, largest / (1.0 + CLOSE_PART))
            }
        };
        let found = paths.closest(time);
        if !candidate.owns(&found.weights) {
            return None;
        }
        let weights = candidate.signed(found.weights);
        let particles = self.moving.particles;
        let radius = |place: usize| particles.radius()[candidate.slots[place] as usize];
        let reach: f32 = (0..4).map(|place| weights[place].abs() * radius(place)).sum();
        let reach = reach.min(candidate.most);
        let normal = found.apart.normalize_or_zero();
        if normal == Vec3A::ZERO || reach == 0.0 {
            return None;
        }
        let gap = gap_along(normal, weights, paths.at(1.0));
        Some(Meeting { weights, normal, reach, gap })
    }

    /// Restitution and friction of a pair.
    pub fn coefficients(&self, candidate: &Candidate) -> [f32; 2] {
        let material = |slot: u32| properties_of(self.properties, slot as usize).material;
        Material::of_pair([material(candidate.slots[0]), material(candidate.slots[3])], self.rules)
    }

    /// The contact of a pair, if it touches.
    pub fn contact(&self, near: NearPair) -> Option<Contact> {
        let Self { moving: Moving { particles, .. }, acceleration, .. } = self;
        let Meeting { weights, normal, reach, gap } = self.meeting(near, self.rebound.slop)?;
        let candidate = self.search.candidate(near);
        let [restitution, coefficient] = self.coefficients(candidate);
        let rebound = Rebound { restitution, ..self.rebound };
        if gap > reach + rebound.slop {
            return None;
        }
        let sprung = candidate.slots.iter().any(|slot| self.on_mesh[*slot as usize]);
        let along = |vectors: &Vectors| -> f32 {
            let vector = |place: usize| Vec3A::from(vectors.get(candidate.slots[place] as usize));
            (0..4).map(|place| weights[place] * normal.dot(vector(place))).sum()
        };
        let velocity = along(&particles.velocity);
        let mut target_velocity = 0.0;
        if velocity < 0.0 {
            let depth = (reach - gap).max(0.0);
            target_velocity = match self.evaluated.accelerations.filter(|_| sprung && restitution > 0.0) {
                Some(ends) => {
                    let accelerations = self.accelerations(candidate, (&weights, normal), ends);
                    let starts = candidate.paths(self.moving).start;
                    let displacement = gap - gap_along(normal, weights, starts);
                    let approach = SprungApproach { velocity, accelerations, displacement, depth };
                    rebound.velocity_after_on_springs(approach).max(0.0)
                }
                None => {
                    let acceleration = along(acceleration);
                    rebound.velocity_after(Approach { velocity, acceleration, depth })
                }
            };
        }
        let resting = target_velocity == 0.0 && velocity.abs() < 2.0 * rebound.resting_speed;
        if gap > reach && !resting {
            return None;
        }
        let inverse_mass = |place: usize| particles.inverse_mass()[candidate.slots[place] as usize];
        let yields: f32 = (0..4).map(|place| weights[place] * weights[place] * inverse_mass(place)).sum();
        (yields > 0.0).then(|| Contact {
            places: candidate.slots,
            candidate: near.number,
            weights,
            normal,
            reach,
            target_velocity,
            mass: 1.0 / yields,
            coefficient,
            resting,
            sprung,
            ..Contact::default()
        })
    }

    /// The relative accelerations of a pair along a normal at the `ends` of the substep, m/s². That of what no spring pulls at is the same at both.
    fn accelerations(
        &self,
        candidate: &Candidate,
        (weights, normal): (&[f32; 4], Vec3A),
        [start, end]: [&Vectors; 2],
    ) -> [f32; 2] {
        let is_implicit = |slot: usize| self.evaluated.is_implicit.get(slot) == Some(&true);
        let mut sums = [0.0; 2];
        for (slot, weight) in candidate.slots.iter().map(|slot| *slot as usize).zip(weights) {
            let changes = self.on_mesh[slot] && !is_implicit(slot);
            let of = |vectors: &Vectors| weight * normal.dot(Vec3A::from(vectors.get(slot)));
            sums[0] += of(start);
            sums[1] += of(if changes { end } else { start });
        }
        sums
    }
}

impl Contact {
    /// What of the two sides is nearest to the place of contact: the slots of two particles, and the point on the surface
    /// of the first.
    pub fn nearest(&self, slots: [u32; 4], particles: &Particles) -> ([usize; 2], Vec3) {
        let heaviest = |sign: f32| {
            let weight = |place: usize| sign * self.weights[place];
            (0..4).fold(0, |best, place| if weight(place) > weight(best) { place } else { best })
        };
        let [first, second] = [heaviest(1.0), heaviest(-1.0)];
        let mut point = Vec3A::ZERO;
        for place in (0..4).filter(|place| self.weights[*place] > 0.0) {
            let slot = slots[place] as usize;
            let centre = Vec3A::from(particles.position.get(slot));
            point += self.weights[place] * (centre - particles.radius()[slot] * self.normal);
        }
        ([slots[first] as usize, slots[second] as usize], point.into())
    }
}
