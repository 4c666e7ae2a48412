//! Edges and triangles of an island that touch colliders between their corners.
//!
//! Which point of them touches is found where the island would fly; from there on it follows (`follow.rs`).
//!
//! Where they touch, some dozens of contacts of a net are nearly closed at once, and most have a neighbour that could hold in their place.
//! K therefore grows only where a solution has converged, and only that of contacts which are too deep in it, each with the force that
//! it has had (a penalty for each constraint: Bertsekas, *Constrained Optimization and Lagrange Multiplier Methods*, 1982, section
//! 2.2.5; of contacts: Simo and Laursen, *Computers & Structures* 42, 97, 1992). Of a light contact that is much stiffer than its force
//! asks for, the error of a solution decides whether it holds. Friction begins with an estimate of the normal forces: without, what
//! rests would slide in the first solution, and have to be brought back in the next.

use bevy::math::DVec3;

use super::contact::{Contact, Partner};
use super::contacts::{Contacts, MAX_REST, Motion, RECOVERY_SPEED};
use super::follow::{Followed, KEPT};
use super::{Island, Step};
use crate::solver::collision::{Feature, Obstacle, Obstacles, Surroundings, sum, weigh};
use crate::solver::particles::Particles;
use crate::solver::state::Version;

/// The first estimate of a normal force, as a multiple of what would hold the contact alone: elements press it more than that.
const ESTIMATE: f64 = 3.0;

/// What may be left of a depth, as a multiple of that of single particles.
const SOFTNESS: f64 = 10.0;

/// Factor by which K of what is deeper grows.
const GROWTH: f64 = 10.0;

/// The cosine of the angle between the normals on two sides of a solid, at most; round an edge it is about 0.
const OPPOSITE: f64 = -0.5;

/// Number of searches for contacts that a step has missed, at most.
const MAX_SEARCHES: usize = 3;

/// Number of solutions after each of them.
const PASSES_OF_MISSED: usize = 2;

/// The edges and triangles of an island, by node: a cache.
#[derive(Debug, Clone, Default)]
pub(super) struct IslandFeatures {
    all: Vec<Feature>,
    key: Option<Version>,
    /// Working memory.
    node_of: Vec<u32>,
}

impl Island {
    /// Makes its features those of all with a particle of it.
    pub fn refresh_features(&mut self, features: &[Feature], version: Version, particles: usize) {
        let Self { elimination, features: own, .. } = self;
        if own.key == Some(version) {
            return;
        }
        own.key = Some(version);
        own.node_of.clear();
        own.node_of.resize(particles, u32::MAX);
        for (node, slot) in (0..).zip(&elimination.slots) {
            own.node_of[*slot as usize] = node;
        }
        own.all.clear();
        let node_of = |slot: u32| own.node_of.get(slot as usize).copied().unwrap_or(u32::MAX);
        let nodes =
            features.iter().map(|feature| Feature { corners: feature.corners.map(node_of), ..*feature });
        let is_own = |feature: &Feature| {
            let known = feature.corners.iter().all(|node| *node != u32::MAX);
            known && feature.corners.iter().any(|node| (*node as usize) < elimination.free)
        };
        own.all.extend(nodes.filter(is_own));
        own.node_of = Vec::new();
    }

    /// Whether what is between particles has entered a collider on the way to the present iterate.
    pub fn features_enter(&self, particles: &Particles, step: Step) -> bool {
        let Self { elimination, system, features, .. } = self;
        let Step { obstacles, surroundings, h, .. } = step;
        obstacles.any_thin()
            && features.all.iter().any(|feature| {
                let nodes = feature.corners.map(|node| node as usize);
                let slots = nodes.map(|node| elimination.slots[node] as usize);
                let radii = slots.map(|slot| f64::from(particles.radius()[slot]));
                let from = slots.map(|slot| particles.position.get(slot).as_dvec3());
                let to = nodes.map(|node| system.position[node]);
                let mut any = false;
                obstacles.near_feature((slots[0], surroundings), [from, to], radii, h, |obstacle, _| {
                    any |= obstacle.deepest(feature.count, ([from, to], true), radii, h).is_some_and(
                        |(obstacle, weights)| obstacle.gap(sum(to, weights), weigh(radii, weights)).0 < 0.0,
                    );
                });
                any
            })
    }
}

impl Contacts {
    /// Adds the contacts of what is between particles.
    pub fn add_features(
        &mut self,
        motion: &Motion,
        features: &IslandFeatures,
        (obstacles, surroundings): (&Obstacles, Surroundings),
    ) {
        let Motion { elimination, particles, start, flight, h, .. } = *motion;
        self.searches = 0;
        for (number, feature) in (0..).zip(&features.all) {
            let nodes = feature.corners.map(|node| node as usize);
            let slots = nodes.map(|node| elimination.slots[node] as usize);
            let radii = slots.map(|slot| f64::from(particles.radius()[slot]));
            let from = nodes.map(|node| start[node]);
            let to = nodes.map(|node| if node < elimination.free { flight[node] } else { start[node] });
            let seen = (slots[0], surroundings);
            obstacles.near_feature(seen, [from, to], radii, h, |obstacle, coefficients| {
                let found = obstacle.deepest(feature.count, ([from, to], true), radii, h);
                let Some((met, weights)) = found else { return };
                let is_swept = !met.is_curved();
                let (_, facing) = met.gap(sum(to, weights), weigh(radii, weights));
                let mut add = |obstacle: Obstacle, weights: [f64; 3]| {
                    let contact = feature_contact(motion, (number, feature), obstacle, weights, coefficients);
                    self.has_features |= contact.is_some();
                    self.has_faces |= contact.is_some() && feature.count > 2;
                    self.contacts.extend(contact);
                };
                add(met, weights);
                // What is fast meets a plane on its way, at a point that is the deepest one there only; if it is not on the other side of
                // the solid then, that follows.
                let slow = is_swept.then(|| obstacle.deepest(feature.count, ([from, to], false), radii, h));
                if let Some((solid, weights)) = slow.flatten() {
                    let (_, normal) = solid.gap(sum(to, weights), weigh(radii, weights));
                    if normal.dot(facing) > OPPOSITE {
                        add(solid, weights);
                    }
                }
            });
        }
    }

    /// To be called when a step has been solved: adds what is deep in an obstacle and has no contact, as it began beside it; whether there
    /// is any, so that the step is to be solved again.
    pub fn add_missed(
        &mut self,
        motion: &Motion,
        position: &[DVec3],
        features: &IslandFeatures,
        (obstacles, surroundings): (&Obstacles, Surroundings),
    ) -> bool {
        if !self.has_features || self.searches == MAX_SEARCHES {
            return false;
        }
        self.searches += 1;
        let Motion { elimination, particles, start, .. } = *motion;
        let known = self.contacts.len();
        for (number, feature) in (0..).zip(&features.all) {
            let nodes = feature.corners.map(|node| node as usize);
            let slots = nodes.map(|node| elimination.slots[node] as usize);
            let radii = slots.map(|slot| f64::from(particles.radius()[slot]));
            let [from, to] = [nodes.map(|node| start[node]), nodes.map(|node| position[node])];
            obstacles.near_feature((slots[0], surroundings), [to, to], radii, 0.0, |obstacle, coefficients| {
                let Some((solid, weights)) = obstacle.deepest(feature.count, ([to, to], false), radii, 0.0) else { return };
                let (gap, normal) = solid.gap(sum(to, weights), weigh(radii, weights));
                // What came from the other side is held by a plane that it has met.
                let came = solid.gap(sum(from, weights), 0.0).1;
                let is_known = |contact: &Contact| {
                    let number = contact.followed.is_some_and(|followed| followed.feature == number);
                    number && matches!(&contact.partner, Partner::Obstacle(other) if other.partner == solid.partner)
                };
                if gap < -SOFTNESS * self.max_depth && came.dot(normal) > OPPOSITE && !self.contacts.iter().any(is_known) {
                    let contact = feature_contact(motion, (number, feature), solid, weights, coefficients);
                    self.contacts.extend(contact);
                }
            });
        }
        let any = self.contacts.len() > known;
        if any {
            self.passes = self.passes.min(self.max_passes.saturating_sub(PASSES_OF_MISSED));
        }
        any
    }

    /// To be called when all contacts have been added: estimates the normal forces that friction goes by, where features may touch for the
    /// first time.
    pub fn estimate_forces(&mut self, flight: &[DVec3]) {
        if self.has_features && self.contacts.iter().all(|contact| contact.lagged == 0.0) {
            for contact in &mut self.contacts {
                let (gap, _) = contact.gap(flight);
                contact.lagged = (ESTIMATE * contact.inertia * (contact.allowed - gap)).max(0.0);
            }
        }
    }

    /// Stiffens what an obstacle holds too deep; whether there is any.
    pub(super) fn stiffen(&mut self) -> bool {
        let allowed = SOFTNESS * self.max_depth;
        let mut any = false;
        for contact in &mut self.contacts {
            let is_obstacle = matches!(contact.partner, Partner::Obstacle(_) | Partner::Node { .. });
            if !is_obstacle || contact.force == 0.0 {
                continue;
            }
            let depth = contact.depth.abs();
            if depth > allowed {
                any = true;
                if self.has_faces || depth > MAX_REST * contact.last_depth {
                    contact.hardness *= GROWTH;
                }
            }
            contact.last_depth = depth;
        }
        any
    }

    /// The work of obstacles on what leaves an overlap in a step of `h` seconds, J, where features touch; of each contact at most the
    /// energy of the greatest speed at which it may leave.
    pub fn recovery(&self, start: &[DVec3], h: f64) -> f64 {
        let of = |contact: &Contact| {
            if contact.force == 0.0 || !matches!(contact.partner, Partner::Obstacle(_)) {
                return 0.0;
            }
            let (gap, _) = contact.gap(start);
            let longest = RECOVERY_SPEED * h;
            (contact.force * (-gap).max(0.0)).min(0.5 * contact.inertia * longest * longest)
        };
        if self.has_features { self.contacts.iter().map(of).sum() } else { 0.0 }
    }
}

fn feature_contact(
    motion: &Motion,
    (number, feature): (u32, &Feature),
    obstacle: Obstacle,
    weights: [f64; 3],
    [restitution, friction]: [f64; 2],
) -> Option<Contact> {
    let Motion { elimination, particles, start, flight, inertia, h } = *motion;
    let nodes = feature.corners.map(|node| node as usize);
    let is_free = |place: usize| nodes[place] < elimination.free;
    let own = 0..feature.count;
    let mobility: f64 = own
        .clone()
        .filter(|place| is_free(*place))
        .map(|place| weights[place] * weights[place] / inertia[nodes[place]])
        .sum();
    // The free one of the largest weight stands for all.
    let first =
        own.filter(|place| is_free(*place)).max_by(|one, other| weights[*one].total_cmp(&weights[*other]))?;
    let of = |vectors: &[DVec3], pinned: &[DVec3]| {
        let each = nodes.map(|node| if node < elimination.free { vectors[node] } else { pinned[node] });
        sum(each, weights)
    };
    let radii = nodes.map(|node| f64::from(particles.radius()[elimination.slots[node] as usize]));
    let (radius, begin) = (weigh(radii, weights), of(start, start));
    let surface_displacement = h * obstacle.motion_at(begin);
    let (gap, normal) = obstacle.gap(begin + surface_displacement, radius);
    let approach = (surface_displacement - (of(flight, start) - begin)).dot(normal) / h;
    let mut others = [(0, 0.0); 3];
    let rest = (0..feature.count).filter(|place| *place != first);
    rest.zip(&mut others).for_each(|(place, other)| *other = (nodes[place], weights[place]));
    let mut own_radii = [radii[first]; 3];
    let rest = (0..feature.count).filter(|place| *place != first);
    rest.zip(&mut own_radii[1..]).for_each(|(place, own)| *own = radii[place]);
    let carried = surface_displacement + h * obstacle.sliding();
    let followed = obstacle.is_curved().then_some(Followed {
        feature: number,
        radii: own_radii,
        carried,
        curvature: KEPT,
    });
    Some(Contact {
        followed,
        weight: weights[first],
        others,
        count: feature.count - 1,
        radius,
        inertia: 1.0 / mobility,
        allowed: (gap + RECOVERY_SPEED * h).min(0.0),
        origin: begin + carried,
        approach,
        normal,
        restitution,
        friction,
        ..Contact::new(nodes[first], Partner::Obstacle(obstacle))
    })
}
