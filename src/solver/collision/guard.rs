//! Final check of a substep: no edge or triangle of a net passes through a collider, whatever has moved it.
//!
//! Contacts push a feature out where it is nearest to the surface; a fast one may be beyond a thin solid by then, or be pushed by
//! others. So each feature that moves by more than a twentieth of its radius (without a radius, by a quarter of the thickness of the
//! solid) is swept along its displacement (`shapes/arrival.rs`).
//! Where it would come nearer than a fraction of its thickness, it is pushed out of the collider there, so that it slides on along the
//! surface. Features that share its corners are then checked again, until none is pushed. Where that does not converge, corners stop,
//! and move with the collider. What is pushed or stopped has had an impact: it keeps its velocity along the surface, and rebounds by
//! the coefficient of restitution.

use bevy::math::{DVec3, Vec3A};

use super::collider::{Collider, SubstepMotion};
use super::feature_search::{FeatureSearch, Surroundings};
use super::features::{Feature, sum};
use super::material::properties_of;
use super::shapes::{Arrival, CornerPaths};
use super::touch_search::rounding;
use crate::solver::particles::{Particles, Vectors};

/// Distance that is always left between a feature and a collider, as a fraction of the radius of the feature.
const MIN_DISTANCE_PART: f64 = 0.1;

/// See [`max_slow_displacement`].
const FOLLOWED_PART: f32 = 0.5;

/// Number of first rounds, in which features are pushed out at the contact point.
const PUSHING_ROUNDS: u32 = 4;

/// Number of next rounds, in which all corners of features are lifted above the tangent plane.
const LIFTING_ROUNDS: u32 = 8;

/// Number of next rounds, in which corners stop where they meet the collider. In later ones they move with it from the start.
const STOPPING_ROUNDS: u32 = 6;

/// Number of all rounds, at most.
const MAX_ROUNDS: u32 = 32;

/// Number of iterations over the velocities of what was stopped, at most.
const VELOCITY_ITERATIONS: usize = 32;

/// What a substep has of the surroundings.
#[derive(Clone, Copy)]
pub(super) struct GuardContext<'a> {
    pub features: &'a [Feature],
    pub surroundings: Surroundings<'a>,
    /// Below this speed nothing rebounds, m/s.
    pub resting_speed: f32,
}

/// Working memory.
#[derive(Debug, Clone, Default)]
pub(super) struct Guard {
    /// Displacement up to which no feature is followed in this tick, m.
    slow_displacement: Option<f32>,
    /// How far each particle moves in the substep, m.
    displacements: Vec<f32>,
    /// The numbers of the features and the places of the colliders that are followed.
    pairs: Vec<[u32; 2]>,
    /// By slot: whether it was stopped in this round, or in the one before.
    is_new: [Vec<bool>; 2],
    stopped: Vec<u32>,
    impacts: Vec<Impact>,
}

/// The impact of a feature that was pushed out.
#[derive(Debug, Clone, Copy)]
struct Impact {
    slots: [usize; 3],
    count: usize,
    weights: [f32; 3],
    normal: Vec3A,
    surface_velocity: Vec3A,
    /// Its velocity along the normal afterwards, m/s, at least.
    target_velocity: f32,
}

impl Guard {
    /// The particles that were stopped in the last substep.
    pub fn stopped(&self) -> &[u32] {
        &self.stopped
    }

    /// To be called when a tick begins.
    pub fn begin_tick(&mut self) {
        self.slow_displacement = None;
        self.stopped.clear();
    }

    /// To be called when a substep begins.
    pub fn begin_substep(&mut self) {
        self.stopped.clear();
    }

    /// Stops the features that would pass through a collider; whether there were any.
    pub fn stop(
        &mut self,
        context: GuardContext,
        search: &mut FeatureSearch,
        particles: &mut Particles,
    ) -> bool {
        if context.features.is_empty() {
            return false;
        }
        self.list_pairs(context, search, particles);
        if self.pairs.is_empty() {
            return false;
        }
        self.impacts.clear();
        for flags in &mut self.is_new {
            flags.clear();
            flags.resize(particles.len(), false);
        }
        let known = self.stopped.len();
        for round in 0..MAX_ROUNDS {
            if !self.run_round(context, particles, round) {
                break;
            }
        }
        self.solve_velocities(particles);
        self.stopped.len() > known
    }

    /// Lists the features that are fast, and the colliders that are near them.
    fn list_pairs(&mut self, context: GuardContext, search: &mut FeatureSearch, particles: &Particles) {
        let GuardContext { features, surroundings, .. } = context;
        let Surroundings { colliders, placed, previous, .. } = surroundings;
        let Self { displacements, pairs, .. } = self;
        pairs.clear();
        let [from, to] = [previous, &particles.position].map(Vectors::axes);
        displacements.clear();
        displacements.extend((0..particles.len()).map(|slot| {
            let square = |axis: usize| (to[axis][slot] - from[axis][slot]).powi(2);
            (square(0) + square(1) + square(2)).sqrt()
        }));
        let radius = |feature: &Feature| {
            let [a, b, c] = feature.corners.map(|slot| particles.radius()[slot as usize]);
            a.min(b).min(c)
        };
        let collider_displacement = placed.moving().map(|place| placed.max_displacement(place, colliders));
        let collider_displacement = collider_displacement.fold(0.0, f32::max);
        let thickness =
            |place: usize| colliders[placed.numbers[place] as usize].shape.half_thickness() as f32;
        let slow_displacement = *self.slow_displacement.get_or_insert_with(|| {
            let thinnest = (0..placed.numbers.len()).map(thickness).fold(f32::INFINITY, f32::min);
            let each = features.iter().map(|feature| max_slow_displacement(radius(feature), thinnest));
            each.fold(f32::INFINITY, f32::min)
        });
        if displacements.iter().copied().fold(0.0, f32::max) + collider_displacement <= slow_displacement {
            return;
        }
        let own_displacement = |feature: &Feature| {
            let [a, b, c] = feature.corners.map(|slot| displacements[slot as usize]);
            a.max(b).max(c)
        };
        search.for_each_near(features, surroundings, particles, |number, place| {
            let feature = &features[number as usize];
            let displacement = own_displacement(feature) + placed.max_displacement(place, colliders);
            if displacement > max_slow_displacement(radius(feature), thickness(place)) {
                pairs.push([number, place as u32]);
            }
        });
    }

    /// Stops those that come too near, in their order; whether there were any.
    fn run_round(&mut self, context: GuardContext, particles: &mut Particles, round: u32) -> bool {
        let GuardContext { features, surroundings, .. } = context;
        let Surroundings { colliders, placed, previous, .. } = surroundings;
        let Self { pairs, is_new, stopped, impacts, .. } = self;
        is_new.swap(0, 1);
        is_new[0].fill(false);
        let mut any = false;
        for [number, place] in pairs.iter().copied() {
            let (feature, place) = (&features[number as usize], place as usize);
            let slots = feature.corners.map(|slot| slot as usize);
            if round > 0 && !slots.iter().any(|slot| is_new[0][*slot] || is_new[1][*slot]) {
                continue;
            }
            if slots.iter().all(|slot| particles.is_pinned(*slot)) {
                continue;
            }
            let motion = &placed.motions[place];
            let positions = slots.map(|slot| particles.position.get(slot).as_dvec3());
            let paths = CornerPaths {
                from: slots.map(|slot| motion.from.to_local(previous.get(slot).as_dvec3())),
                to: positions.map(|position| motion.to.to_local(position)),
                count: feature.count,
            };
            let radius = slots.map(|slot| f64::from(particles.radius()[slot]));
            let radius = radius[0].min(radius[1]).min(radius[2]);
            let least =
                (MIN_DISTANCE_PART * radius).max(4.0 * rounding(positions[0], radius, motion.to.point));
            let collider = &colliders[placed.numbers[place] as usize];
            let Some(arrival) = collider.shape.arrival(&paths, least) else { continue };
            any = true;
            let kept = radius.max(arrival.limit);
            let mut intrusion = Intrusion { paths, arrival, kept, collider, motion, slots, particles };
            if round < PUSHING_ROUNDS {
                intrusion.push();
                impacts.push(context.impact_of((feature, place), &arrival, particles));
            } else if round < PUSHING_ROUNDS + LIFTING_ROUNDS {
                for corner in intrusion.lift() {
                    let mut weights = [0.0; 3];
                    weights[corner] = 1.0;
                    impacts.push(context.impact_of(
                        (feature, place),
                        &Arrival { weights, ..arrival },
                        particles,
                    ));
                }
            } else {
                let may_move_partly = round < PUSHING_ROUNDS + LIFTING_ROUNDS + STOPPING_ROUNDS;
                intrusion.stop(if may_move_partly { arrival.time } else { 0.0 });
            }
            for slot in slots.into_iter().filter(|slot| !particles.is_pinned(*slot)) {
                is_new[0][slot] = true;
                stopped.push(slot as u32);
            }
        }
        any
    }

    /// Removes the approaching velocity of what was stopped.
    fn solve_velocities(&self, particles: &mut Particles) {
        for _ in 0..VELOCITY_ITERATIONS {
            let mut any = false;
            for impact in &self.impacts {
                let inverse_mass = impact.slots.map(|slot| particles.inverse_mass()[slot]);
                let yields: f32 = (0..impact.count)
                    .map(|corner| impact.weights[corner].powi(2) * inverse_mass[corner])
                    .sum();
                let missing = impact.target_velocity - impact.speed(particles);
                if missing.is_nan() || missing <= 1e-6 * impact.target_velocity.abs() || yields == 0.0 {
                    continue;
                }
                any = true;
                let corners = impact.slots.iter().zip(impact.weights).zip(inverse_mass).take(impact.count);
                for ((slot, weight), inverse_mass) in corners {
                    let velocity = Vec3A::from(particles.velocity.get(*slot));
                    let velocity = velocity + impact.normal * (missing * weight * inverse_mass / yields);
                    particles.velocity.set(*slot, velocity.into());
                }
            }
            if !any {
                return;
            }
        }
    }
}

/// A feature that would come too near to a collider.
struct Intrusion<'a> {
    paths: CornerPaths,
    arrival: Arrival,
    /// How far from the shape it is put, m: where it touches it.
    kept: f64,
    collider: &'a Collider,
    motion: &'a SubstepMotion,
    slots: [usize; 3],
    particles: &'a mut Particles,
}

impl Intrusion<'_> {
    /// Puts the free corners where they are to end, in the axes of the shape.
    fn put(&mut self, place: impl Fn(usize) -> Option<DVec3>) {
        for corner in 0..self.paths.count {
            let slot = self.slots[corner];
            if let Some(local) = place(corner).filter(|_| !self.particles.is_pinned(slot)) {
                self.particles.position.set(slot, self.motion.to.to_world(local).as_vec3());
            }
        }
    }

    /// Pushes it out at the point that meets the shape, each corner by its share.
    fn push(&mut self) {
        let Self { paths, arrival, .. } = *self;
        let inverse_mass = self.slots.map(|slot| f64::from(self.particles.inverse_mass()[slot]));
        let share = |corner: usize| arrival.weights[corner] * inverse_mass[corner];
        let yields: f64 = (0..paths.count).map(|corner| arrival.weights[corner] * share(corner)).sum();
        let height = (sum(paths.to, arrival.weights) - arrival.foot).dot(arrival.normal);
        let push = ((self.kept - height) / yields).max(0.0);
        if push.is_finite() {
            self.put(|corner| Some(paths.to[corner] + arrival.normal * (push * share(corner))));
        }
    }

    /// Lifts each corner above the plane between it and the shape; those that were below it.
    fn lift(&mut self) -> impl Iterator<Item = usize> + use<> {
        let Self { paths, arrival, kept, .. } = *self;
        let missing = move |corner: usize| {
            let height = (paths.to[corner] - arrival.foot).dot(arrival.normal);
            Some(kept - height).filter(|missing| *missing > 0.0)
        };
        self.put(|corner| Some(paths.to[corner] + arrival.normal * missing(corner)?));
        (0..paths.count).filter(move |corner| missing(*corner).is_some())
    }

    /// Has it go the part `time` of its way, relative to the collider, and as fast.
    fn stop(&mut self, time: f64) {
        let paths = self.paths;
        self.put(|corner| Some(paths.from[corner].lerp(paths.to[corner], time)));
        for slot in self.slots[..paths.count].iter().copied() {
            if !self.particles.is_pinned(slot) {
                let position = self.particles.position.get(slot).as_dvec3();
                let surface = self.motion.velocity_at(self.collider, position);
                let velocity = self.particles.velocity.get(slot).as_dvec3();
                self.particles.velocity.set(slot, surface.lerp(velocity, time).as_vec3());
            }
        }
    }
}

impl Impact {
    /// The velocity along the normal, relative to the surface, m/s.
    fn speed(&self, particles: &Particles) -> f32 {
        let each = (0..self.count)
            .map(|corner| Vec3A::from(particles.velocity.get(self.slots[corner])) * self.weights[corner]);
        (each.sum::<Vec3A>() - self.surface_velocity).dot(self.normal)
    }
}

impl GuardContext<'_> {
    /// The impact of a feature that was stopped.
    fn impact_of(
        &self,
        (feature, place): (&Feature, usize),
        arrival: &Arrival,
        particles: &Particles,
    ) -> Impact {
        let Surroundings { colliders, placed, properties, .. } = self.surroundings;
        let motion = &placed.motions[place];
        let collider = &colliders[placed.numbers[place] as usize];
        let slots = feature.corners.map(|slot| slot as usize);
        let normal: DVec3 = motion.to.direction(&collider.shape, arrival.normal);
        let surface_velocity = motion.velocity_at(collider, motion.to.to_world(arrival.foot));
        let impact = Impact {
            slots,
            count: feature.count,
            weights: arrival.weights.map(|weight| weight as f32),
            normal: Vec3A::from(normal.as_vec3()),
            surface_velocity: Vec3A::from(surface_velocity.as_vec3()),
            target_velocity: 0.0,
        };
        let [restitution, _] = collider.material.between(properties_of(properties, slots[0]).material);
        let rebound = -restitution * impact.speed(particles);
        Impact { target_velocity: if rebound > self.resting_speed { rebound } else { 0.0 }, ..impact }
    }
}

/// Displacement up to which a feature is not followed, m: it leads to half of what is always left, or, without a radius, to half the
/// thickness of the collider, from where contacts push it out on the right side.
fn max_slow_displacement(radius: f32, half_thickness: f32) -> f32 {
    FOLLOWED_PART * if radius > 0.0 { MIN_DISTANCE_PART as f32 * radius } else { half_thickness }
}
