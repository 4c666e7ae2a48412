//! Which pairs may come near each other: those with bounding boxes, enlarged by margins, that overlap.
//!
//! Each vertex has two bounding boxes with a margin greater than its displacement in the substep of the search: one that moves with
//! its body, for pairs within it, and one fixed in the world, for pairs of bodies. No new search is needed while all vertices stay
//! inside; what moves together, or is far from all others, uses no margin up. `spread.rs` checks a whole body at once.

use bevy::math::Vec3A;

use super::crossing::Crossings;
use super::finder::{Boxes, Finder, is_one_family};
use super::pair::Kind;
use super::primitives::Primitives;
use super::spread::{EachMoved, Spread, enlarged, margin_of};
use super::tree::{Box3, fit_primitives};
use crate::solver::particles::{Particles, Vectors};

use super::super::material::Skin;

/// Displacement since the search at which the close candidates are listed anew, as a multiple of the largest at the last listing.
const LIMIT_GROWTH: f32 = 1.5;

/// Greatest number of pairs: for each primitive, and beside that. Bodies that are put into each other have more.
const MAX_PAIRS: [usize; 2] = [200, 100_000];

/// A body with a vertex farther from its mean than this many of its sizes has diverged and no longer collides.
const MAX_EXTENT: f32 = 10.0;

/// Number of pairs per primitive from which on old lists are rebuilt.
const MANY_PAIRS: usize = 8;

/// Age at which they are, in substeps; doubled each time that the new list is as long.
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
    /// Whether there were too many pairs, so that none is known.
    pub is_overfull: bool,
    /// Number of times that it has been good enough since.
    age: u32,
    max_age: u32,
    /// Distance from touching up to which pairs are listed, m.
    margin: f32,
    /// By slot.
    origins: Vectors,
    /// By slot: the boxes in which a vertex stays with its radius, with its body and in the world.
    boxes: [Vec<Box3>; 2],
    /// By slot: the displacement since the search that the boxes of a vertex allow, with its body and in the world, m.
    vertex_margins: [Vec<f32>; 2],
    /// By body: the least of them.
    least_margins: Vec<[f32; 2]>,
    /// How far each vertex is, or was at the start of the substep, from where it was in the search: with its body, and in
    /// the world; m. Known while there are close candidates.
    pub moved: [Vec<f32>; 2],
    /// At least the farthest of each.
    farthest: [f32; 2],
    /// The numbers of the candidates that may touch before any vertex is farther than `limits`, m, in their order.
    pub close: Vec<u32>,
    limits: [f32; 2],
    /// How far from touching they are listed, m.
    listed_margin: f32,
    /// The close candidates that cross at the start of the substep.
    pub crossings: Crossings,
    /// The boxes of nodes, edges and triangles, with their body and in the world.
    nodes: [Vec<Box3>; 2],
    edges: [Vec<Box3>; 2],
    triangles: [Vec<Box3>; 2],
    /// By body: its box, where it has been; which bodies have a partner.
    body_boxes: Vec<Box3>,
    has_partner: Vec<bool>,
    /// By body: whether it has diverged.
    has_diverged: Vec<bool>,
    /// By body: how far it moves as a whole in the substep of the search, m.
    ways: Vec<Vec3A>,
    /// By body: the greatest radius, m.
    largest: Vec<f32>,
    order: Vec<(f32, u32)>,
    /// The pairs of bodies, balls behind them, with overlapping boxes.
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

    /// From now on pairs within a smaller margin may be enough.
    pub fn narrow(&mut self) {
        (self.listed_margin, self.limits) = (0.0, [-1.0; 2]);
    }

    /// Makes the candidates good for a substep: all pairs that come within `margin` m of touching are among them, in an order
    /// that does not depend on when they were found.
    pub fn ensure(&mut self, primitives: &Primitives, moving: Moving, (skins, margin): (&[Skin], f32)) {
        // Those that were found for fast motions are too many for slow ones.
        self.age = self.age.saturating_add(1);
        let many = MANY_PAIRS * (primitives.forest.edges.len() + primitives.forest.triangles.len());
        let is_old = self.age > self.max_age.max(MAX_AGE) && self.candidates.len() > many;
        self.is_good &= margin <= self.margin && !is_old;
        let is_new = !(self.is_good && self.still_holds(primitives, moving));
        if is_new {
            self.margin = self.margin.max(margin);
            self.search(primitives, moving, skins);
            // Where that finds as many again, it is done less often.
            let is_in_vain = is_old && self.candidates.len() > many;
            self.max_age = if is_in_vain { self.max_age.max(MAX_AGE).saturating_mul(2) } else { MAX_AGE };
            (self.is_good, self.age) = (!self.is_overfull, 0);
            self.limits = [-1.0; 2];
            // Beyond all scales it may not hold even now: then all candidates are looked at.
            if !self.still_holds(primitives, moving) {
                self.moved.iter_mut().for_each(|moved| moved.fill(f32::INFINITY));
                self.farthest = [f32::INFINITY; 2];
            }
        }
        let is_beyond = self.farthest.iter().zip(self.limits).any(|(farthest, limit)| *farthest > limit);
        if is_beyond || margin > self.listed_margin {
            self.listed_margin = self.listed_margin.max(margin);
            self.limits = self.farthest.map(|farthest| LIMIT_GROWTH * farthest);
            let had_any = !self.close.is_empty();
            self.list_close();
            if !had_any && !self.close.is_empty() && self.farthest[0] < f32::INFINITY {
                self.measure_all(primitives, moving);
            }
        }
        self.crossings.find(&self.candidates, &self.moved, moving);
    }

    /// Lists the candidates that may touch before any vertex is farther than the limits.
    fn list_close(&mut self) {
        let Self { candidates, close, crossings, limits, listed_margin, .. } = self;
        let most_moved = |candidate: &Candidate| 2.0 * limits[usize::from(!candidate.is_within)];
        let is_close = |candidate: &Candidate| {
            candidate.distance <= candidate.largest_reach() + *listed_margin + most_moved(candidate)
        };
        close.clear();
        close.extend((0..).zip(&*candidates).filter(|(_, one)| is_close(one)).map(|(number, _)| number));
        crossings.list(candidates, close, *limits);
    }

    /// The candidates that may touch.
    pub fn close(&self) -> impl Iterator<Item = &Candidate> {
        self.close.iter().map(|number| &self.candidates[*number as usize])
    }

    /// Whether each vertex is in its boxes.
    fn still_holds(&mut self, primitives: &Primitives, moving: Moving) -> bool {
        let (forest, radius) = (&primitives.forest, moving.particles.radius());
        let wants_each = !self.close.is_empty();
        let mut farthest = [0.0_f32; 2];
        for (number, body) in forest.bodies.iter().enumerate() {
            let spread = Spread::of(&body.runs, moving, &self.origins);
            let has_diverged = self::has_diverged(primitives, number, &spread, moving);
            if has_diverged != self.has_diverged[number] {
                return false;
            } else if has_diverged {
                continue;
            }
            let frames = if self.has_partner[number] { 2 } else { 1 };
            let (mut own, margins) = (spread.farthest(), self.least_margins[number]);
            let is_clear = (0..frames).all(|frame| own[frame] <= margins[frame]);
            if wants_each || !is_clear {
                own = [0.0; 2];
                if !self.measure_each(primitives, (number, &spread), moving, &mut own) {
                    return false;
                }
            }
            (0..frames).for_each(|frame| farthest[frame] = farthest[frame].max(own[frame]));
            let (all, reach) = (spread.position, self.largest[number]);
            let is_in = |end: Vec3A| self.body_boxes[number].contains(end, reach);
            if frames == 1 && !(is_in(all.least) && is_in(all.most)) {
                return false;
            }
        }
        for slot in primitives.balls.iter().map(|slot| *slot as usize) {
            let (ends, world) = (moving.ends(slot), &self.boxes[1][slot]);
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

    /// Measures how far each vertex of all bodies has moved.
    fn measure_all(&mut self, primitives: &Primitives, moving: Moving) {
        for (number, body) in primitives.forest.bodies.iter().enumerate() {
            let spread = Spread::of(&body.runs, moving, &self.origins);
            self.measure_each(primitives, (number, &spread), moving, &mut [0.0; 2]);
        }
    }

    /// Measures how far each vertex of a body has moved; whether all are within their margins.
    fn measure_each(
        &mut self,
        primitives: &Primitives,
        (number, spread): (usize, &Spread),
        moving: Moving,
        farthest: &mut [f32; 2],
    ) -> bool {
        let (origins, runs) = (&self.origins, &primitives.forest.bodies[number].runs[..]);
        let frames = if self.has_partner[number] { 2 } else { 1 };
        let drifts = [spread.drift(), [Vec3A::ZERO; 2]];
        let mut is_beyond = false;
        for frame in 0..frames {
            pulp::Arch::new().dispatch(EachMoved {
                runs,
                moving,
                origins,
                drift: drifts[frame],
                margins: &self.vertex_margins[frame],
                moved: &mut self.moved[frame],
                farthest: &mut farthest[frame],
                is_beyond: &mut is_beyond,
            });
        }
        !is_beyond
    }

    fn search(&mut self, primitives: &Primitives, moving: Moving, skins: &[Skin]) {
        let forest = &primitives.forest;
        self.make_boxes(primitives, moving);
        let count = moving.particles.len();
        self.moved.iter_mut().for_each(|moved| moved.resize(count, 0.0));
        for frame in 0..2 {
            let boxes = &self.boxes[frame];
            self.nodes[frame].resize(forest.nodes.len(), Box3::NOTHING);
            forest.bodies.iter().for_each(|body| forest.fit(body, boxes, &mut self.nodes[frame]));
            if frame == 0 || forest.bodies.len() + primitives.balls.len() > 1 {
                fit_primitives(&forest.edges, boxes, &mut self.edges[frame]);
                fit_primitives(&forest.triangles, boxes, &mut self.triangles[frame]);
            }
        }
        self.body_boxes.clear();
        for (number, body) in forest.bodies.iter().enumerate() {
            self.body_boxes.push(enlarged(self.nodes[1][body.nodes.start as usize], self.ways[number]));
        }
        self.has_partner.clear();
        self.has_partner.resize(forest.bodies.len(), false);
        let Self { candidates, nodes, edges, triangles, boxes, stack, vertex_margins, margin, .. } = self;
        let [within, world] = [0, 1].map(|frame| Boxes {
            nodes: &nodes[frame],
            vertices: &boxes[frame],
            edges: &edges[frame],
            triangles: &triangles[frame],
            is_within: frame == 0,
        });
        candidates.clear();
        let most = MAX_PAIRS[0] * (forest.edges.len() + forest.triangles.len()) + MAX_PAIRS[1];
        let mut finder =
            Finder { primitives, moving, skins, candidates, vertex_margins, margin: *margin, most };
        let families = moving.particles.families();
        for (body, _) in forest.bodies.iter().zip(&self.has_diverged).filter(|(_, diverged)| !**diverged) {
            if is_one_family(forest.vertices_of(body), families) {
                continue;
            }
            let root = body.nodes.start;
            finder.walk([root, root], within, stack);
        }
        // The boxes of bodies, swept along x; balls are bodies, too.
        self.order.clear();
        let present = (0..).zip(&self.body_boxes).filter(|(number, _)| !self.has_diverged[*number as usize]);
        self.order.extend(present.map(|(number, body)| (body.least.x, number)));
        let bodies = forest.bodies.len() as u32;
        let balls = (bodies..).zip(&primitives.balls);
        self.order.extend(balls.map(|(number, slot)| (world.vertices[*slot as usize].least.x, number)));
        self.order.sort_unstable_by(|(one, a), (other, b)| one.total_cmp(other).then(a.cmp(b)));
        let box_of = |number: u32| match number.checked_sub(bodies) {
            None => self.body_boxes[number as usize],
            Some(ball) => world.vertices[primitives.balls[ball as usize] as usize],
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
                    finder.walk([root, other], world, stack);
                }
                Some(ball) => {
                    let slot = primitives.balls[ball as usize];
                    finder.walk_ball(root, slot, world, stack);
                }
            }
        }
        self.is_overfull = self.candidates.len() >= most;
        if self.is_overfull {
            self.candidates.clear();
        }
    }

    /// Computes the margins and boxes of the vertices.
    fn make_boxes(&mut self, primitives: &Primitives, moving: Moving) {
        let Self { origins, boxes, vertex_margins, least_margins, has_diverged, ways, largest, .. } = self;
        let (forest, radius) = (&primitives.forest, moving.particles.radius());
        origins.copy_from(moving.start);
        boxes.iter_mut().for_each(|boxes| boxes.resize(moving.particles.len(), Box3::NOTHING));
        vertex_margins.iter_mut().for_each(|margins| margins.resize(moving.particles.len(), 0.0));
        has_diverged.clear();
        least_margins.clear();
        ways.clear();
        largest.clear();
        let margin = self.margin;
        let mut place = |slot: usize, way: Vec3A, frame: usize| {
            let (allowed, place) = margin_of(moving.ends(slot), way, (radius[slot], margin));
            (vertex_margins[frame][slot], boxes[frame][slot]) = (allowed, place);
            allowed
        };
        for (number, body) in forest.bodies.iter().enumerate() {
            let spread = Spread::of(&body.runs, moving, origins);
            has_diverged.push(self::has_diverged(primitives, number, &spread, moving));
            let [_, drift] = spread.drift();
            let (mut least, mut thickest) = ([f32::INFINITY; 2], 0.0_f32);
            for slot in forest.vertices_of(body).iter().map(|slot| *slot as usize) {
                let [start, end] = moving.ends(slot);
                for (frame, way) in [end - start - drift, end - start].into_iter().enumerate() {
                    least[frame] = least[frame].min(place(slot, way, frame));
                }
                thickest = thickest.max(radius[slot]);
            }
            least_margins.push(least);
            largest.push(thickest);
            ways.push(drift);
        }
        for slot in primitives.balls.iter().map(|slot| *slot as usize) {
            let [start, end] = moving.ends(slot);
            place(slot, end - start, 1);
        }
    }
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
