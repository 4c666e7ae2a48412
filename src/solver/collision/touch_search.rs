//! Which particles touch which colliders at the end of a substep, and where those are put that would have passed through one in it.
//!
//! Particles are tested in chunks of consecutive slots: where the swept box of a chunk overlaps no collider, nothing more is done. A
//! particle that moves by more than half its radius in the substep, relative to a collider, is swept: it collides with the tangent plane
//! at the first contact along its straight path, however thin the solid is and however far beyond it the path ends. It keeps its motion
//! along that plane, as a particle that slides on a half-space does.

use bevy::math::{DVec3, Vec3A};

use crate::solver::parallel;
use crate::solver::particles::{Particles, Vectors};

use super::collider::{Collider, Placed};
use super::material::{ContactProperties, properties_of};
use super::response::{Approach, Rebound};
use super::round::Following;
use super::shapes::{Bounds, Nearest, Vicinity};
use super::touch::{AccumulatedCorrection, Touch};

/// Number of consecutive particles that are looked for together.
const CHUNK: usize = 32;

/// Number of chunks that one thread takes at a time.
const CHUNKS_PER_PART: usize = 32;

/// Number of particles from which on the parts are shared among threads.
const MIN_SHARED: usize = 4096;

/// Displacement in a substep above which a particle is swept, as a part of its radius; it is put where its centre is as near
/// to the surface as that.
const SWEEP_THRESHOLD: f64 = 0.5;

/// Surfaces that one particle meets in a substep, at most.
const MAX_MEETINGS: usize = 8;

/// What a substep has of the surroundings of the particles.
#[derive(Clone, Copy)]
pub(super) struct Search<'a> {
    pub colliders: &'a [Collider],
    pub placed: &'a Placed,
    pub particles: &'a Particles,
    /// Positions at the start of the substep, m.
    pub previous: &'a Vectors,
    /// Of the last evaluation of the forces, m/s².
    pub acceleration: &'a Vectors,
    pub properties: &'a [ContactProperties],
    /// Whether an implicit step has seen to the particle in each slot.
    pub is_implicit: &'a [bool],
    pub rebound: Rebound,
    /// Whether sensors are asked for.
    pub senses: bool,
}

/// What a search has found.
#[derive(Debug, Clone, Default)]
pub(super) struct Touches {
    /// In the order of their first particles.
    pub all: Vec<Touch>,
    /// The slots and numbers of colliders that are sensors.
    pub sensed: Vec<(u32, u32)>,
    /// What contacts did in the last substep of this tick, by their keys, where they know of each other.
    pub last: Vec<(u64, AccumulatedCorrection)>,
    parts: Vec<Part>,
}

/// What has been found of a part of the particles.
#[derive(Debug, Clone, Default)]
struct Part {
    /// Its first slot.
    start: usize,
    /// Where threads share the parts.
    touches: Vec<Touch>,
    sensed: Vec<(u32, u32)>,
    /// Where swept particles are put, m.
    moved: Vec<(u32, DVec3)>,
    /// Working memory: what is near a chunk.
    near: Vec<u32>,
    /// By slot, from the first one of the part: what of a mesh was near it when it was last looked at. A cache.
    vicinities: Vec<Vicinity>,
}

impl Bounds {
    /// Wider by what rounding may take for a touch.
    fn widened(self) -> Self {
        let margin = 16.0 * f32::EPSILON * (self.low.abs() + self.high.abs());
        Self { low: self.low - margin, high: self.high + margin }
    }
}

/// A plane that a particle meets.
#[derive(Debug, Clone, Copy)]
struct Meeting {
    place: usize,
    foot: DVec3,
    normal: DVec3,
    /// How deep it would have come, m.
    depth: f64,
    /// The part of the substep after that.
    left: f64,
}

/// How far a coordinate of this size may be off by rounding, m.
pub(super) fn rounding(position: DVec3, radius: f64, foot: DVec3) -> f64 {
    let size = position.abs().element_sum() + radius + foot.abs().element_sum();
    4.0 * f64::from(f32::EPSILON) * size
}

impl Touches {
    /// Removes what was found.
    pub fn clear(&mut self) {
        self.all.clear();
        self.sensed.clear();
    }

    /// Finds the free particles that touch colliders.
    pub fn find(&mut self, search: Search) {
        self.clear();
        let count = search.particles.len();
        let size = CHUNK * CHUNKS_PER_PART;
        self.parts.resize_with(count.div_ceil(size), Part::default);
        let Self { all, sensed, parts, .. } = self;
        let starts = (0..count).step_by(size);
        let ranges = starts.map(|start| start..count.min(start + size));
        if parallel::is_shared(count >= MIN_SHARED) {
            parallel::for_each(parts.iter_mut().zip(ranges), true, |(part, slots)| {
                let mut touches = std::mem::take(&mut part.touches);
                part.find(search, slots, &mut touches);
                part.touches = touches;
            });
            parts.iter_mut().for_each(|part| all.append(&mut part.touches));
        } else {
            parts.iter_mut().zip(ranges).for_each(|(part, slots)| part.find(search, slots, all));
        }
        parts.iter_mut().for_each(|part| sensed.append(&mut part.sensed));
    }

    /// Puts those back that would have passed through a collider.
    pub fn put_back(&mut self, particles: &mut Particles) {
        for (slot, position) in self.parts.iter_mut().flat_map(|part| part.moved.drain(..)) {
            particles.position.set(slot as usize, position.as_vec3());
        }
    }

    /// Takes note of the bodies that the particles are in this substep.
    pub fn number_bodies(&mut self, body_of: &[u32]) {
        for touch in &mut self.all {
            touch.bodies = touch.slots.map(|slot| body_of[slot as usize]);
        }
    }
}

impl Part {
    fn find(&mut self, search: Search, slots: std::ops::Range<usize>, touches: &mut Vec<Touch>) {
        let mut near = std::mem::take(&mut self.near);
        self.start = slots.start;
        for start in slots.clone().step_by(CHUNK) {
            let chunk = start..slots.end.min(start + CHUNK);
            search.placed.near(&search.bounds_of(chunk.clone()), &mut near);
            if near.is_empty() {
                continue;
            }
            for slot in chunk {
                let is_implicit = search.is_implicit.get(slot) == Some(&true);
                if search.particles.inverse_mass()[slot] == 0.0 {
                    continue;
                }
                let own = search.bounds_of_one(slot);
                if near.iter().any(|place| search.placed.bounds[*place as usize].overlaps(&own)) {
                    self.look_at(search, slot, (&near, &own, is_implicit), touches);
                }
            }
        }
        self.near = near;
    }

    /// Finds what one particle meets.
    fn look_at(
        &mut self,
        search: Search,
        slot: usize,
        (near, own, is_implicit): (&[u32], &Bounds, bool),
        touches: &mut Vec<Touch>,
    ) {
        let Search { colliders, placed, particles, previous, properties, .. } = search;
        let own_properties = properties_of(properties, slot);
        let radius = f64::from(particles.radius()[slot]);
        let end = particles.position.get(slot).as_dvec3();
        let collider = |place: usize| &colliders[placed.numbers[place] as usize];
        let candidates = || {
            let near = near.iter().map(|place| *place as usize);
            near.filter(|place| {
                placed.bounds[*place].overlaps(own) && own_properties.layers.meet(collider(*place).layers)
            })
        };
        if search.senses {
            for place in candidates().filter(|place| collider(*place).is_sensor) {
                let local = placed.motions[place].to.to_local(end);
                if collider(place).shape.nearest(local, 0.0).distance <= radius {
                    self.sensed.push((slot as u32, placed.numbers[place]));
                }
            }
        }
        if is_implicit {
            return;
        }
        let start = previous.get(slot).as_dvec3();
        let solid = || candidates().filter(|place| !collider(*place).is_sensor);
        let swept = search.first_meeting(solid(), [start, end], radius).map(|first| {
            search.sweep(
                (slot, first),
                |position| search.first_meeting(solid(), [start, position], radius),
                [start, end],
                radius,
            )
        });
        let position = swept.map_or(end, |(_, position)| position);
        if position != end {
            self.moved.push((slot as u32, position));
        }
        let meetings = || swept.iter().flat_map(|(meetings, _)| meetings.iter().flatten());
        touches.extend(meetings().map(|meeting| search.touch(slot, *meeting, position)));
        for place in solid().filter(|place| meetings().all(|meeting| meeting.place != *place)) {
            let to = placed.motions[place].to;
            let Some(nearest) = self.nearest(search, slot, place, position) else { continue };
            let normal = to.direction(&collider(place).shape, nearest.normal);
            let foot = position - normal * nearest.distance;
            let depth = radius - nearest.distance;
            if depth >= -rounding(position, radius, foot) {
                let depth = depth.max(0.0);
                let meeting = Meeting { place, foot, normal, depth, left: 0.0 };
                touches.push(search.touch(slot, meeting, position));
            }
        }
    }
}

impl Part {
    /// The nearest point of a shape, if it is at most `within` m away or the particle is inside.
    fn nearest(&mut self, search: Search, slot: usize, place: usize, position: DVec3) -> Option<Nearest> {
        let motion = &search.placed.motions[place];
        let shape = &search.colliders[search.placed.numbers[place] as usize].shape;
        let local = motion.to.to_local(position);
        let Some(mesh) = shape.as_mesh() else { return Some(shape.nearest(local, 0.0)) };
        let radius = f64::from(search.particles.radius()[slot]);
        let within = radius + 1.1 * rounding(position, radius, position);
        if self.vicinities.is_empty() {
            self.vicinities.resize(CHUNK * CHUNKS_PER_PART, Vicinity::default());
        }
        let margin = || {
            let before = motion.from.to_local(search.previous.get(slot).as_dvec3());
            0.1 * radius + 8.0 * local.distance(before)
        };
        self.vicinities[slot - self.start].nearest(mesh, (local, 0.0), within, margin)
    }
}

impl Search<'_> {
    /// What bounds a particle and its path in the substep.
    fn bounds_of_one(&self, slot: usize) -> Bounds {
        let (now, before) = (self.particles.position.get(slot), self.previous.get(slot));
        let radius = self.particles.radius()[slot];
        Bounds { low: now.min(before) - radius, high: now.max(before) + radius }.widened()
    }

    /// What bounds consecutive particles and their displacements in the substep.
    fn bounds_of(&self, slots: std::ops::Range<usize>) -> Bounds {
        let radius = &self.particles.radius()[slots.clone()];
        let mut bounds = Bounds::EMPTY;
        let axes = self.particles.position.axes().into_iter().zip(self.previous.axes()).enumerate();
        for (axis, (now, before)) in axes {
            let (now, before) = (&now[slots.clone()], &before[slots.clone()]);
            let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
            for ((now, before), radius) in now.iter().zip(before).zip(radius) {
                low = low.min(now.min(*before) - radius);
                high = high.max(now.max(*before) + radius);
            }
            (bounds.low[axis], bounds.high[axis]) = (low, high);
        }
        bounds.widened()
    }

    /// All that a swept particle meets, the `first` one and those which `next` finds on the way to where it is put; and
    /// where that is.
    fn sweep(
        &self,
        (slot, first): (usize, Meeting),
        mut next: impl FnMut(DVec3) -> Option<Meeting>,
        [start, end]: [DVec3; 2],
        radius: f64,
    ) -> ([Option<Meeting>; MAX_MEETINGS], DVec3) {
        let mut meetings = [None; MAX_MEETINGS];
        let mut position = end;
        let mut found = Some(first);
        for meeting in &mut meetings {
            let Some(met) = found else { return (meetings, position) };
            *meeting = Some(met);
            let kept = SWEEP_THRESHOLD * radius + rounding(position, radius, met.foot);
            let pushed = kept - (position - met.foot).dot(met.normal);
            position += met.normal * pushed;
            position -= self.undone_slip(slot, met, position, pushed);
            found = next(position);
        }
        // Caught between surfaces: it stays where it was.
        (meetings, start)
    }

    /// How much of the slip since the meeting static friction undoes, of a particle that was pushed back by `pushed` m, m.
    fn undone_slip(&self, slot: usize, met: Meeting, position: DVec3, pushed: f64) -> DVec3 {
        let collider = &self.colliders[self.placed.numbers[met.place] as usize];
        let [_, friction] = collider.material.between(properties_of(self.properties, slot).material);
        if friction == 0.0 {
            return DVec3::ZERO;
        }
        let carried = self.placed.motions[met.place].sliding(collider) * f64::from(self.rebound.substep);
        let apart = position - met.foot - carried * met.left;
        let slip = apart - met.normal * apart.dot(met.normal);
        slip.clamp_length_max(f64::from(friction) * pushed.max(0.0))
    }

    /// The first of these colliders that a particle meets on its way, if it is so fast that it is to be swept.
    fn first_meeting(
        &self,
        places: impl Iterator<Item = usize>,
        [start, end]: [DVec3; 2],
        radius: f64,
    ) -> Option<Meeting> {
        let kept = SWEEP_THRESHOLD * radius;
        let is_slow = start.distance_squared(end) < kept * kept;
        if is_slow && self.placed.moving().next().is_none() {
            return None;
        }
        let mut first: Option<(f64, Meeting)> = None;
        for place in places {
            let motion = &self.placed.motions[place];
            let (from, to) = (motion.from.to_local(start), motion.to.to_local(end));
            if from.distance_squared(to) <= kept * kept {
                continue;
            }
            let shape = &self.colliders[self.placed.numbers[place] as usize].shape;
            let Some(touch) = shape.first_touch(from, to, kept) else { continue };
            if first.as_ref().is_none_or(|(time, _)| touch.time < *time) {
                let (foot, normal) =
                    (motion.to.to_world(touch.foot), motion.to.direction(shape, touch.normal));
                let depth = (radius - (end - foot).dot(normal)).max(0.0);
                first = Some((touch.time, Meeting { place, foot, normal, depth, left: 1.0 - touch.time }));
            }
        }
        first.map(|(_, meeting)| meeting)
    }

    /// The contact of a particle that is at `position` with a plane that it has met.
    fn touch(&self, slot: usize, meeting: Meeting, position: DVec3) -> Touch {
        let Meeting { place, foot, normal, depth, .. } = meeting;
        let number = self.placed.numbers[place];
        let collider = &self.colliders[number as usize];
        let surface_velocity = self.placed.motions[place].velocity_at(collider, foot);
        let [restitution, friction] =
            collider.material.between(properties_of(self.properties, slot).material);
        let velocity = self.particles.velocity.get(slot).as_dvec3();
        let rebound = Rebound { restitution, ..self.rebound };
        let target_velocity = rebound.least_velocity_after(Approach {
            velocity: (velocity - surface_velocity).dot(normal) as f32,
            acceleration: self.acceleration.get(slot).as_dvec3().dot(normal) as f32,
            depth: depth as f32,
        });
        let radius = self.particles.radius()[slot];
        // As it will be in the arrays.
        let position = position.as_vec3();
        let height = (position.as_dvec3() - foot).dot(normal);
        Touch {
            slots: [slot as u32; 3],
            bodies: [0; 3],
            count: 1,
            weights: [1.0, 0.0, 0.0],
            shares: [1.0, 0.0, 0.0],
            collider: number,
            normal: Vec3A::from(normal.as_vec3()),
            place: Vec3A::from(position),
            depth: (f64::from(radius) - height) as f32,
            radius,
            surface_velocity: Vec3A::from(surface_velocity.as_vec3()),
            target_velocity,
            friction,
            mass: 1.0 / self.particles.inverse_mass()[slot],
            impulse: 0.0,
            accumulated: AccumulatedCorrection::default(),
            following: Following::default(),
            key: (slot as u64) << 32 | u64::from(number),
        }
    }
}
