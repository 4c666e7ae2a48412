//! Which edges and triangles of nets touch which colliders between their corners, at the end of a substep.
//!
//! Half-spaces need no search: if the spheres at the corners are above a plane, so is all that is between them. Features that move by
//! more than half their thickness and half that of the collider are swept.
//!
//! The pairs that may touch are listed when a tick begins, and again when the particles have moved by more than the margin of
//! the list. Each has a *clearance*, a lower bound of its distance: a distance changes by no more than the displacements of both
//! sides (it is Lipschitz continuous with constant 1 in each). Only where the clearance is used up the distance is computed again.
//!
//! A feature that touches, or nearly touches, keeps the contact point and the tangent plane that were found, its *anchor*, until it has
//! moved by a thousandth of its radius; it touches while that point is below that plane. The true contact point and plane have moved by
//! then, but the depth is wrong only by the square of that displacement over the sizes of both. So what rests is held in each substep
//! at the same point. Without that it would fall whenever it is slightly apart, be pushed out, and keep the springs vibrating that
//! press it against the collider.

use bevy::math::{DVec3, Vec3, Vec3A};

use super::collider::{Collider, Placed};
use super::features::{Feature, sum, weigh};
use super::material::{ContactProperties, properties_of};
use super::response::{Approach, Rebound};
use super::round::Following;
use super::shapes::{Arrival, Bounds, CornerPaths, Deepest, Nearest};
use super::touch::{AccumulatedCorrection, Touch};
use super::touch_search::{Search, rounding};
use crate::solver::parallel;
use crate::solver::particles::{Particles, Vectors};

/// Number of edges and triangles for which colliders are looked up together.
const CHUNK: usize = 16;

/// Number of chunks that one thread takes at a time.
const CHUNKS_PER_PART: usize = 32;

/// Number of edges and triangles from which on the parts are shared among threads.
const MIN_SHARED: usize = 4096;

/// The margin of a list, as a multiple of the longest displacement in a substep.
const MARGIN_IN_DISPLACEMENTS: f32 = 8.0;

/// What is added to that margin, as a fraction of the largest radius.
const MARGIN_IN_RADII: f32 = 0.5;

/// Depth that a feature may reach between its corners before its distance is computed again, as a fraction of its radius: what lies
/// flat on something costs no more than its corners.
const UNSEEN_IN_RADII: f64 = 0.005;

/// What is added to that depth, m.
const UNSEEN: f64 = 2e-5;

/// Displacement up to which an anchor is kept, as a fraction of the radius.
const HELD_IN_RADII: f64 = 0.001;

/// The search: a cache within a tick.
#[derive(Debug, Clone, Default)]
pub(super) struct FeatureSearch {
    parts: Vec<Part>,
    /// What is left of the margin of the lists, m; < 0 without a list.
    margin: f32,
    /// Where the particles were at the last search, m; none before the first of the tick.
    seen: Vectors,
    /// How far each particle has moved since, m, rounded up.
    displacements: Vec<f32>,
    /// The longest displacement of a point of each collider, m, rounded up.
    collider_displacements: Vec<f32>,
}

#[derive(Debug, Clone, Default)]
struct Part {
    /// By feature, then by place.
    pairs: Vec<Pair>,
    anchors: Vec<Anchor>,
    touches: Vec<Touch>,
    /// Working memory.
    near: Vec<u32>,
}

/// What a list of pairs depends on.
#[derive(Clone, Copy)]
pub(super) struct Surroundings<'a> {
    pub colliders: &'a [Collider],
    pub placed: &'a Placed,
    pub properties: &'a [ContactProperties],
    /// Positions at the start of the substep, m.
    pub previous: &'a Vectors,
}

/// A feature and a collider near it.
#[derive(Debug, Clone, Copy)]
struct Pair {
    /// The number of the feature in its part.
    feature: u32,
    /// The place of the collider.
    place: u32,
    /// By how much they are apart for certain, or their anchor holds, m; <= 0: nothing is known.
    clearance: f32,
    /// The number of their anchor in the part; [`NO_ANCHOR`](Self::NO_ANCHOR) if there is none.
    anchor: u32,
}

impl Pair {
    const NO_ANCHOR: u32 = u32::MAX;
}

/// The point of a feature that was the deepest when it was looked at, and the plane that touches the surface there, in the axes
/// of the shape.
#[derive(Debug, Clone, Copy)]
struct Anchor {
    weights: [f64; 3],
    foot: DVec3,
    normal: DVec3,
}

/// How near a feature is to a collider.
enum Proximity {
    /// They are apart by so much for certain, m; what lies flat, nearly.
    Apart(f32),
    /// They touch, or will when they have moved by about so much, m.
    Near(Anchor, f32),
    /// The feature has met the collider on its way.
    Swept(Anchor),
}

impl FeatureSearch {
    /// To be called when a tick begins.
    pub fn begin_tick(&mut self) {
        self.margin = -1.0;
        self.seen.resize(0);
    }

    /// Appends what touches between its corners to `touches`.
    pub fn find(&mut self, features: &[Feature], search: Search, touches: &mut Vec<Touch>) {
        if features.is_empty() {
            return;
        }
        let longest = self.measure_displacements(search);
        self.margin -= longest;
        // NaN is stale.
        let is_stale = self.margin.is_nan() || self.margin < 0.0;
        if is_stale {
            let radius = search.particles.radius().iter().copied().fold(0.0, f32::max);
            self.margin = MARGIN_IN_DISPLACEMENTS * longest + MARGIN_IN_RADII * radius;
        }
        let (margin, displacements) =
            (self.margin, [&self.displacements[..], &self.collider_displacements[..]]);
        let size = CHUNK * CHUNKS_PER_PART;
        self.parts.resize_with(features.len().div_ceil(size), Part::default);
        let parts = self.parts.iter_mut().zip(features.chunks(size)).zip((0..).step_by(size));
        let Search { colliders, placed, properties, previous, particles, .. } = search;
        let surroundings = Surroundings { colliders, placed, properties, previous };
        parallel::for_each(parts, features.len() >= MIN_SHARED, |((part, features), first)| {
            if is_stale {
                part.list(surroundings, particles, features, margin);
            }
            part.find(search, (features, first), displacements);
        });
        self.parts.iter_mut().for_each(|part| touches.append(&mut part.touches));
    }

    /// Calls `visit` with the numbers of the features and the places of the colliders that may have touched in the substep,
    /// wherever contacts have moved the particles since the search, in the order of the features.
    pub fn for_each_near(
        &mut self,
        features: &[Feature],
        surroundings: Surroundings,
        particles: &Particles,
        mut visit: impl FnMut(u32, usize),
    ) {
        let axes = self.seen.axes().into_iter().zip(particles.position.axes());
        let farthest = |(seen, now): (&[f32], &[f32])| {
            seen.iter().zip(now).map(|(seen, now)| (now - seen).abs()).fold(0.0, f32::max)
        };
        // At most √3 times as far as along any axis; NaN is in no box.
        let moved = 2.0 * axes.map(farthest).fold(0.0, f32::max);
        let size = CHUNK * CHUNKS_PER_PART;
        if moved > self.margin {
            let radius = particles.radius().iter().copied().fold(0.0, f32::max);
            self.margin = MARGIN_IN_RADII * radius;
            for (part, features) in self.parts.iter_mut().zip(features.chunks(size)) {
                part.list(surroundings, particles, features, self.margin);
            }
        }
        for (first, part) in (0..).step_by(size).zip(&self.parts) {
            part.pairs.iter().for_each(|pair| visit(first + pair.feature, pair.place as usize));
        }
    }

    /// Measures how far all have moved since the last search; the longest.
    ///
    /// What rests is pushed into a collider and out of it in each substep. So it is not by way of where it was when the substep
    /// began: what is apart by more than it has moved since the last search, is apart now.
    fn measure_displacements(&mut self, search: Search) -> f32 {
        let position = &search.particles.position;
        if self.seen.len() != position.len() {
            self.seen.copy_from(search.previous);
        }
        let [from, to] = [&self.seen, position].map(Vectors::axes);
        self.displacements.clear();
        self.displacements.extend((0..position.len()).map(|slot| {
            let square = |axis: usize| (to[axis][slot] - from[axis][slot]).powi(2);
            // What rounding may hide.
            (square(0) + square(1) + square(2)).sqrt() * (1.0 + 8.0 * f32::EPSILON)
        }));
        let longest = self.displacements.iter().copied().fold(0.0, f32::max);
        self.seen.copy_from(position);
        self.collider_displacements.clear();
        self.collider_displacements.resize(search.placed.numbers.len(), 0.0);
        for place in search.placed.moving() {
            self.collider_displacements[place] = search.placed.max_displacement(place, search.colliders);
        }
        longest
    }
}

impl Part {
    /// Lists the pairs that are at most `margin` m apart, and some more.
    fn list(&mut self, surroundings: Surroundings, particles: &Particles, features: &[Feature], margin: f32) {
        self.pairs.clear();
        self.anchors.clear();
        let Surroundings { colliders, placed, properties, previous } = surroundings;
        let bounds_of = |feature: &Feature| bounds_of(feature, previous, particles);
        for (first, chunk) in (0..).step_by(CHUNK).zip(features.chunks(CHUNK)) {
            let bounds = chunk.iter().map(bounds_of).fold(Bounds::EMPTY, Bounds::union);
            placed.near(&bounds.grown(margin), &mut self.near);
            if self.near.is_empty() {
                continue;
            }
            for (feature, number) in chunk.iter().zip(first..) {
                let own = bounds_of(feature);
                let layers = properties_of(properties, feature.corners[0] as usize).layers;
                for place in self.near.iter().copied() {
                    let collider = &colliders[placed.numbers[place as usize] as usize];
                    let clearance = own.distance(&placed.bounds[place as usize]);
                    if clearance <= margin && !collider.is_sensor && layers.meet(collider.layers) {
                        self.pairs.push(Pair { feature: number, place, clearance, anchor: Pair::NO_ANCHOR });
                    }
                }
            }
        }
    }

    /// Computes the distances of pairs anew where the clearance is used up, and finds those that touch.
    fn find(
        &mut self,
        search: Search,
        (features, first): (&[Feature], u32),
        [displacements, collider_displacements]: [&[f32]; 2],
    ) {
        let Self { pairs, anchors, touches, .. } = self;
        for pair in pairs {
            let feature = &features[pair.feature as usize];
            let [a, b, c] = feature.corners.map(|slot| displacements[slot as usize]);
            pair.clearance -= a.max(b).max(c) + collider_displacements[pair.place as usize];
            let is_known = pair.clearance > 0.0;
            if is_known && pair.anchor == Pair::NO_ANCHOR {
                continue;
            }
            let is_implicit = |slot: &u32| search.is_implicit.get(*slot as usize) == Some(&true);
            if feature.corners.iter().any(is_implicit) {
                continue;
            }
            let place = pair.place as usize;
            let key = first + pair.feature;
            if is_known {
                touches.extend(search.touch_at((feature, key), place, &anchors[pair.anchor as usize]));
                continue;
            }
            match search.proximity_of(feature, place) {
                Proximity::Apart(clearance) => (pair.clearance, pair.anchor) = (clearance, Pair::NO_ANCHOR),
                Proximity::Swept(anchor) => {
                    pair.anchor = Pair::NO_ANCHOR;
                    touches.extend(search.touch_at((feature, key), place, &anchor));
                }
                Proximity::Near(anchor, clearance) => {
                    pair.clearance = clearance;
                    if pair.anchor == Pair::NO_ANCHOR {
                        pair.anchor = anchors.len() as u32;
                        anchors.push(anchor);
                    } else {
                        anchors[pair.anchor as usize] = anchor;
                    }
                    touches.extend(search.touch_at((feature, key), place, &anchor));
                }
            }
        }
    }
}

/// What bounds a feature and its path in the substep.
fn bounds_of(feature: &Feature, previous: &Vectors, particles: &Particles) -> Bounds {
    let mut bounds = Bounds::EMPTY;
    let mut radius = 0.0_f32;
    for slot in feature.corners.map(|slot| slot as usize) {
        bounds = bounds.with(particles.position.get(slot)).with(previous.get(slot));
        radius = radius.max(particles.radius()[slot]);
    }
    let size = bounds.low.abs().max(bounds.high.abs()).max_element();
    bounds.grown(radius + 16.0 * f32::EPSILON * size)
}

impl Search<'_> {
    /// How near a feature is to a collider now.
    fn proximity_of(&self, feature: &Feature, place: usize) -> Proximity {
        let Search { colliders, placed, particles, .. } = *self;
        let apart = bounds_of(feature, self.previous, particles).distance(&placed.bounds[place]);
        if apart > 0.0 {
            return Proximity::Apart(apart);
        }
        let corners = feature.corners.map(|slot| slot as usize);
        let positions = corners.map(|slot| particles.position.get(slot).as_dvec3());
        let radii = corners.map(|slot| f64::from(particles.radius()[slot]));
        let starts = corners.map(|slot| self.previous.get(slot).as_dvec3());
        let motion = &placed.motions[place];
        let local = positions.map(|position| motion.to.to_local(position));
        let before = starts.map(|start| motion.from.to_local(start));
        let shape = &colliders[placed.numbers[place] as usize].shape;
        let paths = CornerPaths { from: before, to: local, count: feature.count };
        if let Some(Arrival { normal, foot, weights, .. }) = shape.swept(&paths, radii) {
            return Proximity::Swept(Anchor { weights, foot, normal });
        }
        let within = rounding(positions[0], radii[0], motion.to.point);
        let radius = weigh(radii, [1.0 / 3.0; 3]);
        let unseen = UNSEEN_IN_RADII * radius + UNSEEN;
        let reach = within + unseen;
        let found = match feature.count {
            2 => shape.deepest_on_edge([local[0], local[1]], [radii[0], radii[1]], reach),
            _ => shape.deepest_on_triangle(local, radii, reach),
        };
        let rounded_down = |displacement: f64| displacement as f32 * (1.0 - f32::EPSILON);
        match found {
            Ok(Deepest { weights, gap, nearest: Nearest { distance, normal }, .. }) => {
                let foot = sum(local, weights) - normal * distance;
                Proximity::Near(
                    Anchor { weights, foot, normal },
                    rounded_down((gap - 2.0 * within).max(HELD_IN_RADII * radius)),
                )
            }
            Err(least) => Proximity::Apart(rounded_down((least - 2.0 * within).max(unseen))),
        }
    }

    /// The contact of a feature with the plane of an anchor, if the point is on it or below; `None` if it cannot move.
    fn touch_at(&self, (feature, key): (&Feature, u32), place: usize, anchor: &Anchor) -> Option<Touch> {
        let Anchor { weights, foot, normal } = *anchor;
        let number = self.placed.numbers[place];
        // After those of the particles.
        let key = 1 << 63 | u64::from(key) << 32 | u64::from(number);
        let collider = &self.colliders[number as usize];
        let motion = &self.placed.motions[place];
        let slots = feature.corners.map(|slot| slot as usize);
        let of = |vectors: &Vectors| sum(slots.map(|slot| vectors.get(slot).as_dvec3()), weights);
        let point = of(&self.particles.position);
        let radius = weigh(slots.map(|slot| f64::from(self.particles.radius()[slot])), weights);
        let normal = motion.to.direction(&collider.shape, normal);
        let gap = (point - motion.to.to_world(foot)).dot(normal) - radius;
        if gap.is_nan() || gap > rounding(point, radius, motion.to.point) {
            return None;
        }
        let inverse = slots.map(|slot| f64::from(self.particles.inverse_mass()[slot]));
        let mobility: f64 = (0..feature.count).map(|end| weights[end] * weights[end] * inverse[end]).sum();
        if mobility <= 0.0 {
            return None;
        }
        let surface_velocity = motion.velocity_at(collider, point - normal * (gap + radius));
        let [restitution, friction] =
            collider.material.between(properties_of(self.properties, slots[0]).material);
        let rebound = Rebound { restitution, ..self.rebound };
        let target_velocity = rebound.least_velocity_after(Approach {
            velocity: (of(&self.particles.velocity) - surface_velocity).dot(normal) as f32,
            acceleration: of(self.acceleration).dot(normal) as f32,
            depth: (-gap).max(0.0) as f32,
        });
        let weights = weights.map(|weight| weight as f32);
        // As the solution adds them up, in f32.
        let place =
            slots.iter().zip(weights).map(|(slot, weight)| self.particles.position.get(*slot) * weight);
        let place: Vec3 = place.take(feature.count).sum();
        Some(Touch {
            slots: feature.corners,
            bodies: [0; 3],
            count: feature.count as u32,
            weights,
            shares: [0, 1, 2].map(|end| (f64::from(weights[end]) * inverse[end] / mobility) as f32),
            collider: number,
            normal: Vec3A::from(normal.as_vec3()),
            place: Vec3A::from(place),
            depth: -gap as f32,
            radius: radius as f32,
            surface_velocity: Vec3A::from(surface_velocity.as_vec3()),
            target_velocity,
            friction,
            mass: (1.0 / mobility) as f32,
            impulse: 0.0,
            accumulated: AccumulatedCorrection::default(),
            following: Following::default(),
            key,
        })
    }
}
