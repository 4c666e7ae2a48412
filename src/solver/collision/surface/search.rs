//! Which pairs may come near each other: found from boxes in which each vertex stays.
//!
//! A vertex has two boxes, each around where it is at the start and at the end of the substep of the search, with a skin:
//! one that goes with the mean of its body, for pairs within the body, and one that stays in the world, for pairs of two
//! bodies. As long as each vertex is in its boxes no pair can touch that was not found, so that no other search is needed;
//! what moves together, or is far from all others, uses none of them up.

use bevy::math::Vec3A;

use super::finder::Finder;
use super::pair::Kind;
use super::primitives::Primitives;
use super::tree::{Box3, MeshBody};
use crate::solver::graph::Exclusions;
use crate::solver::particles::{Particles, Vectors};

use super::super::material::Skin;

/// The skin of a slow vertex, as a part of its radius.
const SKIN: f32 = 0.6;

/// The skin of a fast one, as a multiple of its way in the substep of the search, and as one of its radius at most.
const FAST_SKIN: [f32; 2] = [2.0, 6.0];

/// For how many substeps, as the one of the search, a body is to stay in its box; and the room on all sides, as a part of it.
const BODY_SUBSTEPS: f32 = 16.0;
const BODY_ROOM: f32 = 0.1;

/// By how much more than it has moved at most a vertex may move before the close candidates are listed anew.
const LIMIT_GROWTH: f32 = 1.5;

/// Rounding, as a part of a coordinate.
const ROUNDING: f32 = 4e-7;

/// Number of pairs for each primitive, and beside them, from which on there are too many: of what is put into each other.
const MAX_PAIRS: [usize; 2] = [200, 100_000];

/// How many times its size a vertex must be from the mean of its body for that to have exploded: it collides no more.
const EXPLODED: f32 = 10.0;

/// Number of pairs for each primitive that are searched anew after some substeps.
const MANY_PAIRS: usize = 8;
const MAX_AGE: u32 = 48;

/// Two primitives that may touch before a vertex leaves its box.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Candidate {
    pub slots: [u32; 4],
    pub kind: Kind,
    /// Marks of the first and the second primitive.
    pub marks: [u8; 2],
    /// Whether both are of one body.
    pub is_within: bool,
    /// Their distance at the start of the substep of the search, m.
    pub distance: f32,
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
    /// Number of times that it has been good enough since.
    age: u32,
    /// How far beyond where they touch pairs are wanted, m.
    margin: f32,
    /// By slot.
    origins: Vectors,
    within: Vec<Box3>,
    world: Vec<Box3>,
    /// How far each vertex is, or was at the start of the substep, from where it was in the search: with its body, and in
    /// the world; m.
    pub moved: [Vec<f32>; 2],
    /// The farthest of each.
    farthest: [f32; 2],
    /// The numbers of the candidates that may touch before any vertex is farther than `limits`, m, in their order.
    pub close: Vec<u32>,
    limits: [f32; 2],
    /// How far each vertex may come from there without leaving its boxes, m.
    rooms: [Vec<f32>; 2],
    /// By node of the forest.
    node_within: Vec<Box3>,
    node_world: Vec<Box3>,
    /// By body: its box, where it has been; which bodies have a partner.
    body_boxes: Vec<Box3>,
    has_partner: Vec<bool>,
    /// By body: whether it has exploded.
    has_exploded: Vec<bool>,
    origin_means: Vec<Vec3A>,
    order: Vec<(f32, u32)>,
    /// The bodies, balls behind them, whose boxes overlap.
    partners: Vec<[u32; 2]>,
    stack: Vec<[u32; 2]>,
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
        (self.is_good, self.margin) = (false, 0.0);
    }

    /// Makes the candidates good for a substep: all pairs that come within `margin` m of touching are among them, in an order
    /// that does not depend on when they were found. Whether it has searched.
    pub fn ensure(
        &mut self,
        primitives: &Primitives,
        moving: Moving,
        (skins, margin): (&[Skin], f32),
    ) -> bool {
        // Those that were found for fast motions are too many for slow ones.
        self.age = self.age.saturating_add(1);
        let many = MANY_PAIRS * (primitives.forest.edges.len() + primitives.forest.triangles.len());
        self.is_good &= margin <= self.margin && !(self.age > MAX_AGE && self.candidates.len() > many);
        let is_new = !(self.is_good && self.still_holds(primitives, moving));
        if is_new {
            self.margin = self.margin.max(margin);
            self.search(primitives, moving, skins);
            (self.is_good, self.age) = (true, 0);
            self.limits = [-1.0; 2];
            // Beyond all scales it may not hold even now: then all candidates are looked at.
            if !self.still_holds(primitives, moving) {
                self.moved.iter_mut().for_each(|moved| moved.fill(f32::INFINITY));
                self.farthest = [f32::INFINITY; 2];
            }
        }
        if self.farthest.iter().zip(self.limits).any(|(farthest, limit)| *farthest > limit) {
            self.limits = self.farthest.map(|farthest| LIMIT_GROWTH * farthest);
            self.list_close();
        }
        is_new
    }

    /// Lists the candidates that may touch before any vertex is farther than the limits.
    fn list_close(&mut self) {
        let Self { candidates, close, limits, margin, .. } = self;
        close.clear();
        let is_close = |candidate: &Candidate| {
            let most_moved = 2.0 * limits[usize::from(!candidate.is_within)];
            candidate.distance <= candidate.largest_reach() + *margin + most_moved
        };
        close.extend((0..).zip(&*candidates).filter(|(_, one)| is_close(one)).map(|(number, _)| number));
    }

    /// The candidates that may touch.
    pub fn close(&self) -> impl Iterator<Item = &Candidate> {
        self.close.iter().map(|number| &self.candidates[*number as usize])
    }

    /// The means of where a body's vertices are at the start and at the end, relative to those in the search.
    fn drift(&self, primitives: &Primitives, number: usize, moving: Moving) -> [Vec3A; 2] {
        let forest = &primitives.forest;
        let vertices = forest.vertices_of(&forest.bodies[number]);
        let origin = self.origin_means[number];
        let start = Primitives::mean(vertices, |slot| moving.start.get(slot));
        let end = Primitives::mean(vertices, |slot| moving.end.get(slot));
        [Vec3A::from(start) - origin, Vec3A::from(end) - origin]
    }

    /// Whether each vertex is in its boxes.
    fn still_holds(&mut self, primitives: &Primitives, moving: Moving) -> bool {
        let (forest, radius) = (&primitives.forest, moving.particles.radius());
        let mut farthest = [0.0_f32; 2];
        for (number, body) in forest.bodies.iter().enumerate() {
            let has_exploded = has_exploded(primitives, number, moving);
            if has_exploded != self.has_exploded[number] {
                return false;
            } else if has_exploded {
                continue;
            }
            let drift = self.drift(primitives, number, moving);
            let mut all = Box3::NOTHING;
            for slot in forest.vertices_of(body).iter().map(|slot| *slot as usize) {
                let ends = moving.ends(slot);
                if !(ends[0] + ends[1]).is_finite() {
                    // It is in no box, and leaves the simulation.
                    continue;
                }
                let (within, reach) = (&self.within[slot], radius[slot]);
                if !(within.contains(ends[0] - drift[0], reach) && within.contains(ends[1] - drift[1], reach))
                {
                    return false;
                }
                let origin = Vec3A::from(self.origins.get(slot));
                let moved = |[one, other]: [Vec3A; 2]| {
                    (one - origin).length_squared().max((other - origin).length_squared()).sqrt()
                };
                self.moved[0][slot] = moved([ends[0] - drift[0], ends[1] - drift[1]]);
                farthest[0] = farthest[0].max(self.moved[0][slot]);
                if self.has_partner[number] {
                    let world = &self.world[slot];
                    if !(world.contains(ends[0], reach) && world.contains(ends[1], reach)) {
                        return false;
                    }
                    self.moved[1][slot] = moved(ends);
                    farthest[1] = farthest[1].max(self.moved[1][slot]);
                } else {
                    all.least = all.least.min(ends[0].min(ends[1]) - reach);
                    all.most = all.most.max(ends[0].max(ends[1]) + reach);
                }
            }
            let own = &self.body_boxes[number];
            let is_found = self.has_partner[number];
            if !is_found && [all.least, all.most].iter().any(|end| !own.contains(*end, 0.0)) {
                return false;
            }
        }
        for slot in primitives.balls.iter().map(|slot| *slot as usize) {
            let (ends, world) = (moving.ends(slot), &self.world[slot]);
            if !(ends[0] + ends[1]).is_finite() {
                continue;
            }
            if !(world.contains(ends[0], radius[slot]) && world.contains(ends[1], radius[slot])) {
                return false;
            }
            let origin = Vec3A::from(self.origins.get(slot));
            self.moved[1][slot] = ends[0].distance(origin).max(ends[1].distance(origin));
            farthest[1] = farthest[1].max(self.moved[1][slot]);
        }
        self.farthest = farthest;
        true
    }

    fn search(&mut self, primitives: &Primitives, moving: Moving, skins: &[Skin]) {
        let forest = &primitives.forest;
        self.has_exploded.clear();
        self.has_exploded.extend((0..forest.bodies.len()).map(|body| has_exploded(primitives, body, moving)));
        self.make_boxes(primitives, moving);
        let count = moving.particles.len();
        self.moved.iter_mut().for_each(|moved| moved.resize(count, 0.0));
        self.node_within.resize(forest.nodes.len(), Box3::NOTHING);
        self.node_world.resize(forest.nodes.len(), Box3::NOTHING);
        self.body_boxes.clear();
        for body in &forest.bodies {
            forest.fit(body, &self.within, &mut self.node_within);
            forest.fit(body, &self.world, &mut self.node_world);
            let tight = self.node_world[body.nodes.start as usize];
            self.body_boxes.push(self.roomy(tight, primitives, body, moving));
        }
        self.has_partner.clear();
        self.has_partner.resize(forest.bodies.len(), false);
        let Self { candidates, node_within, node_world, within, world, stack, rooms, margin, .. } = self;
        candidates.clear();
        let most = MAX_PAIRS[0] * (forest.edges.len() + forest.triangles.len()) + MAX_PAIRS[1];
        let mut finder = Finder { primitives, moving, skins, candidates, rooms, margin: *margin, most };
        let families = moving.particles.families();
        for (body, _) in forest.bodies.iter().zip(&self.has_exploded).filter(|(_, exploded)| !**exploded) {
            if is_one_family(forest.vertices_of(body), families) {
                continue;
            }
            let root = body.nodes.start;
            finder.walk([root, root], (node_within, within, true), stack);
        }
        // The boxes of bodies, swept along x; balls are bodies, too.
        self.order.clear();
        let present = (0..).zip(&self.body_boxes).filter(|(number, _)| !self.has_exploded[*number as usize]);
        self.order.extend(present.map(|(number, body)| (body.least.x, number)));
        let bodies = forest.bodies.len() as u32;
        let balls = (bodies..).zip(&primitives.balls);
        self.order.extend(balls.map(|(number, slot)| (world[*slot as usize].least.x, number)));
        self.order.sort_unstable_by(|(one, a), (other, b)| one.total_cmp(other).then(a.cmp(b)));
        let box_of = |number: u32| match number.checked_sub(bodies) {
            None => self.body_boxes[number as usize],
            Some(ball) => world[primitives.balls[ball as usize] as usize],
        };
        self.partners.clear();
        for (place, (_, one)) in self.order.iter().enumerate() {
            let own = box_of(*one);
            let others = self.order[place + 1..].iter().take_while(|(least, _)| *least <= own.most.x);
            for (_, other) in others {
                let is_mesh = *one < bodies || *other < bodies;
                if is_mesh && own.overlaps(&box_of(*other)) {
                    self.partners.push([*one.min(other), *one.max(other)]);
                }
            }
        }
        self.partners.sort_unstable();
        for [one, other] in self.partners.iter().copied() {
            self.has_partner[one as usize] = true;
            let root = forest.bodies[one as usize].nodes.start;
            match other.checked_sub(bodies) {
                None => {
                    self.has_partner[other as usize] = true;
                    let other = forest.bodies[other as usize].nodes.start;
                    finder.walk([root, other], (node_world, world, false), stack);
                }
                Some(ball) => {
                    let slot = primitives.balls[ball as usize];
                    finder.walk_ball(root, slot, (node_world, world), stack);
                }
            }
        }
        if self.candidates.len() >= most {
            self.candidates.clear();
        }
    }

    /// The box of a body, with room for some substeps: while it overlaps no other one, that is all that is to be checked of
    /// where the body is in the world.
    fn roomy(&self, tight: Box3, primitives: &Primitives, body: &MeshBody, moving: Moving) -> Box3 {
        let vertices = primitives.forest.vertices_of(body);
        let start = Primitives::mean(vertices, |slot| moving.start.get(slot));
        let end = Primitives::mean(vertices, |slot| moving.end.get(slot));
        let way = BODY_SUBSTEPS * Vec3A::from(end - start);
        let room = BODY_ROOM * (tight.most - tight.least);
        let (least, most) = (tight.least - room, tight.most + room);
        Box3 { least: least.min(least + way), most: most.max(most + way) }
    }

    /// Gives the vertices their boxes.
    fn make_boxes(&mut self, primitives: &Primitives, moving: Moving) {
        let (count, forest, margin) = (moving.particles.len(), &primitives.forest, self.margin);
        self.origins.copy_from(moving.start);
        self.within.resize(count, Box3::NOTHING);
        self.world.resize(count, Box3::NOTHING);
        self.origin_means.clear();
        let radius = moving.particles.radius();
        self.rooms.iter_mut().for_each(|rooms| rooms.resize(count, 0.0));
        let room = |own: &Box3, slot: usize, origin: Vec3A| {
            let farthest = (own.most - origin).max(origin - own.least);
            if farthest.is_finite() { (farthest.length() - radius[slot]).max(0.0) } else { 0.0 }
        };
        for body in &forest.bodies {
            let vertices = forest.vertices_of(body);
            let start = Primitives::mean(vertices, |slot| moving.start.get(slot));
            let end = Primitives::mean(vertices, |slot| moving.end.get(slot));
            let drift = Vec3A::from(end) - Vec3A::from(start);
            self.origin_means.push(start.into());
            for slot in vertices.iter().map(|slot| *slot as usize) {
                let ends = moving.ends(slot);
                self.within[slot] = box_around([ends[0], ends[1] - drift], radius[slot], margin);
                self.world[slot] = box_around(ends, radius[slot], margin);
                self.rooms[0][slot] = room(&self.within[slot], slot, ends[0]);
                self.rooms[1][slot] = room(&self.world[slot], slot, ends[0]);
            }
        }
        for slot in primitives.balls.iter().map(|slot| *slot as usize) {
            let ends = moving.ends(slot);
            self.world[slot] = box_around(ends, radius[slot], margin);
            self.rooms[1][slot] = room(&self.world[slot], slot, ends[0]);
        }
    }
}

/// Whether a body has exploded, as by too long explicit steps: all of its primitives would be near each other.
fn has_exploded(primitives: &Primitives, body: usize, moving: Moving) -> bool {
    let vertices = primitives.forest.vertices_of(&primitives.forest.bodies[body]);
    let mean = Primitives::mean(vertices, |slot| moving.end.get(slot));
    let most = (EXPLODED * primitives.sizes[body]).powi(2);
    vertices.iter().any(|slot| moving.end.get(*slot as usize).distance_squared(mean) > most)
}

/// Whether no pair of a body collides: all its particles are of one family.
fn is_one_family(vertices: &[u32], families: &[u32]) -> bool {
    !families.is_empty()
        && vertices.iter().all(|slot| Exclusions::are_of_one_family(families, vertices[0], *slot))
}

/// The box of a vertex of a `radius` that is at both places, with radius and skin.
#[inline(always)]
fn box_around([start, end]: [Vec3A; 2], radius: f32, margin: f32) -> Box3 {
    if !(start + end).is_finite() {
        return Box3::NOTHING;
    }
    let way = start.distance(end);
    let skin = (SKIN * radius).max((FAST_SKIN[0] * way).min(FAST_SKIN[1] * radius));
    let rounding = ROUNDING * start.abs().max(end.abs()).max_element();
    let reach = Vec3A::splat(radius + skin + 0.5 * margin + rounding + f32::MIN_POSITIVE);
    Box3 { least: start.min(end) - reach, most: start.max(end) + reach }
}
