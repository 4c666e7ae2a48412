//! Which edges and triangles of nets touch which colliders between their corners, at the end of a substep.
//!
//! Corners are spheres of their own (`touch_search.rs`); half-spaces need nothing else, as what is between spheres above a
//! plane is above it. An edge is swept where it moves by more than half its thickness and half that of the collider.

use bevy::math::{DVec3, Vec3, Vec3A};

use super::material::skin_of;
use super::response::{Approach, Rebound};
use super::shapes::{Bounds, Deepest, Nearest};
use super::touch::{MAX_POINTS, Touch};
use super::touch_search::{Search, rounding};
use crate::solver::elements::{CollisionMesh, Elements};
use crate::solver::parallel;
use crate::solver::state::Version;

/// Number of edges and triangles that are looked for together.
const CHUNK: usize = 16;

/// Number of chunks that one thread takes at a time.
const CHUNKS_PER_PART: usize = 32;

/// Number of edges and triangles from which on the parts are shared among threads.
const MIN_SHARED: usize = 4096;

/// An edge or a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::solver) struct Feature {
    /// Slots; of an edge the last is the one before.
    pub corners: [u32; MAX_POINTS],
    /// How many there are.
    pub count: usize,
}

/// All edges, then all triangles: a cache.
#[derive(Debug, Clone, Default)]
pub(in crate::solver) struct Features {
    all: Vec<Feature>,
    key: Option<(Version, Version, bool)>,
    version: Version,
    parts: Vec<Part>,
}

#[derive(Debug, Clone, Default)]
struct Part {
    touches: Vec<Touch>,
    near: Vec<u32>,
}

impl Features {
    /// Makes them those of a mesh, and of loose springs, if these collide along their length.
    pub fn refresh(&mut self, mesh: &CollisionMesh, elements: &Elements, with_springs: bool) {
        let key = Some((mesh.version(), elements.ends_version(), with_springs));
        if self.key == key {
            return;
        }
        self.key = key;
        self.version = Version::new();
        self.all.clear();
        let edges = mesh.present_edges(elements, with_springs).map(|([a, b], _)| [a, b, b]);
        self.all.extend(edges.map(|corners| Feature { corners, count: 2 }));
        self.all.extend(mesh.present_triangles().map(|corners| Feature { corners, count: 3 }));
    }

    /// Changes with them.
    pub fn version(&self) -> Version {
        self.version
    }

    /// All of them.
    pub fn all(&self) -> &[Feature] {
        &self.all
    }

    /// Appends what touches between its corners to `touches`.
    pub fn find(&mut self, search: Search, touches: &mut Vec<Touch>) {
        let (all, size) = (&self.all, CHUNK * CHUNKS_PER_PART);
        self.parts.resize_with(all.len().div_ceil(size), Part::default);
        let parts = self.parts.iter_mut().zip(all.chunks(size));
        parallel::for_each(parts, all.len() >= MIN_SHARED, |(part, features)| part.find(search, features));
        self.parts.iter_mut().for_each(|part| touches.append(&mut part.touches));
    }
}

impl Part {
    fn find(&mut self, search: Search, features: &[Feature]) {
        let mut near = std::mem::take(&mut self.near);
        for chunk in features.chunks(CHUNK) {
            let bounds =
                chunk.iter().map(|feature| bounds_of(search, feature)).fold(Bounds::EMPTY, Bounds::union);
            search.placed.near(&bounds, &mut near);
            if near.is_empty() {
                continue;
            }
            for feature in chunk {
                self.look_at(search, feature, &near);
            }
        }
        self.near = near;
    }

    fn look_at(&mut self, search: Search, feature: &Feature, near: &[u32]) {
        let Search { colliders, placed, particles, skins, is_implicit, .. } = search;
        let corners = feature.corners.map(|slot| slot as usize);
        if corners.iter().any(|slot| is_implicit.get(*slot) == Some(&true)) {
            return;
        }
        let own = bounds_of(search, feature);
        let layers = skin_of(skins, corners[0]).layers;
        let positions = corners.map(|slot| particles.position.get(slot).as_dvec3());
        let radii = corners.map(|slot| f64::from(particles.radius()[slot]));
        let starts = corners.map(|slot| search.previous.get(slot).as_dvec3());
        for place in near.iter().map(|place| *place as usize) {
            let collider = &colliders[placed.numbers[place] as usize];
            if collider.is_sensor || !placed.bounds[place].overlaps(&own) || !layers.meet(collider.layers) {
                continue;
            }
            let moment = &placed.moments[place];
            let to = moment.to;
            let local = positions.map(|position| to.to_local(position));
            let before = starts.map(|start| moment.from.to_local(start));
            let shape = &collider.shape;
            let within = rounding(positions[0], radii[0], to.point);
            let swept = (feature.count == 2).then(|| {
                let way = before[0].distance(local[0]).max(before[1].distance(local[1]));
                let radius = 0.5 * radii[0].min(radii[1]);
                let is_fast = way > radius.max(0.5 * shape.half_thickness());
                is_fast.then(|| {
                    shape.first_touch_of_edge([before[0], before[1]], [local[0], local[1]], radius)
                })?
            });
            let found = match swept.flatten() {
                Some((crossing, weights)) => {
                    let point = sum(local, weights);
                    let height = (point - crossing.foot).dot(crossing.normal);
                    let nearest = Nearest { distance: height, normal: crossing.normal };
                    Some(Deepest { weights, gap: height - weigh(radii, weights), nearest })
                }
                None if feature.count == 2 => {
                    shape.deepest_on_edge([local[0], local[1]], [radii[0], radii[1]], within)
                }
                None => shape.deepest_on_triangle(local, radii, within),
            };
            if let Some(found) = found {
                let normal = to.direction(shape, found.nearest.normal);
                self.touches.extend(search.touch_of(feature, found, place, normal));
            }
        }
    }
}

/// What bounds a feature and its way in the substep.
fn bounds_of(search: Search, feature: &Feature) -> Bounds {
    let mut bounds = Bounds::EMPTY;
    let mut radius = 0.0_f32;
    for slot in feature.corners.map(|slot| slot as usize) {
        bounds = bounds.with(search.particles.position.get(slot)).with(search.previous.get(slot));
        radius = radius.max(search.particles.radius()[slot]);
    }
    let size = bounds.low.abs().max(bounds.high.abs()).max_element();
    bounds.grown(radius + 16.0 * f32::EPSILON * size)
}

/// Σ wᵢ xᵢ.
pub(in crate::solver) fn sum(points: [DVec3; MAX_POINTS], weights: [f64; MAX_POINTS]) -> DVec3 {
    points[0] * weights[0] + points[1] * weights[1] + points[2] * weights[2]
}

/// Σ wᵢ rᵢ.
pub(in crate::solver) fn weigh(numbers: [f64; MAX_POINTS], weights: [f64; MAX_POINTS]) -> f64 {
    numbers[0] * weights[0] + numbers[1] * weights[1] + numbers[2] * weights[2]
}

impl Search<'_> {
    /// The contact of a point of a feature; `None` if it cannot move.
    fn touch_of(&self, feature: &Feature, found: Deepest, place: usize, normal: DVec3) -> Option<Touch> {
        let Deepest { weights, gap, .. } = found;
        let slots = feature.corners.map(|slot| slot as usize);
        let inverse = slots.map(|slot| f64::from(self.particles.inverse_mass()[slot]));
        let mobility: f64 = (0..feature.count).map(|end| weights[end] * weights[end] * inverse[end]).sum();
        if mobility <= 0.0 {
            return None;
        }
        let number = self.placed.numbers[place];
        let collider = &self.colliders[number as usize];
        let of = |vectors: &crate::solver::particles::Vectors| {
            sum(slots.map(|slot| vectors.get(slot).as_dvec3()), weights)
        };
        let point = of(&self.particles.position);
        let radius = weigh(slots.map(|slot| f64::from(self.particles.radius()[slot])), weights);
        let foot = point - normal * (gap + radius);
        let surface_velocity = self.placed.moments[place].velocity_at(collider, foot);
        let [restitution, friction] = collider.material.between(skin_of(self.skins, slots[0]).material);
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
            count: feature.count,
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
        })
    }
}
