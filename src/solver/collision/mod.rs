//! Collisions: of particles with colliders and with each other, after each substep.
//!
//! Every contact is resolved in three steps: the particles are *projected* out of each other (the correction shared by mass),
//! the approaching part of their velocity is removed, and given back with the coefficient of restitution; friction acts on
//! what is tangential. A pinned particle has infinite mass.
//!
//! The files: `memory.rs` what one tick hands on to the next, from which everything else follows; `response.rs` the formulas,
//! `stiff_rebounds.rs` the accelerations for them; `sweep.rs` what is too fast; `chains.rs`, `extents.rs`, `chain_search.rs`, `broad_phase.rs`, `grid.rs`, `cells.rs`, `all_pairs.rs`, `candidates.rs` and `list.rs`
//! which pairs may touch, `recall.rs` what is known of them; `whole_ticks.rs` ticks in which nothing can; `narrow.rs` which pairs do; `regions.rs` what can be solved at the same time; `pairs.rs`, `plane.rs` and
//! `touch.rs` the three kinds of contact, `solve.rs` the order in which they are solved. Colliders: `collider.rs` their poses, `shapes/`
//! their geometry, `material.rs` restitution, friction and layers, `touch_search.rs` which particles touch them, `feature_search.rs`
//! which edges and triangles do, `guard.rs` what would pass through, `presence.rs` whether they have changed. `rest.rs`: what stays
//! at rest.
//! `near_islands.rs` and `reach.rs`: which islands touch, by which schemes are chosen.

mod all_pairs;
mod bodies;
mod broad_phase;
mod candidates;
mod cells;
mod chain_search;
mod chains;
mod collider;
mod contact_forces;
mod crowds;
mod extents;
mod feature_search;
mod features;
mod grid;
mod guard;
mod list;
mod material;
mod memory;
mod narrow;
mod near_islands;
mod obstacles;
mod pairs;
mod plane;
mod presence;
mod reach;
mod recall;
mod record;
mod regions;
mod response;
mod rest;
mod round;
mod shapes;
mod solids;
mod solve;
mod stiff_pairs;
mod stiff_rebounds;
mod surface;
mod sweep;
mod touch;
mod touch_search;
mod whole_ticks;

use bevy::math::{Vec3, Vec3A};

use crate::solver::elements::Elements;
use crate::solver::particles::{Particles, Vectors};
use crate::solver::settings::{Integrator, StepSettings};
use bodies::Body;
use candidates::Candidates;
use chains::Proof;
pub use collider::Collider;
use collider::Placed;
pub(super) use contact_forces::{Assigned, ContactEnds, ContactForce};
use extents::MonotoneDirection;
use feature_search::FeatureSearch;
use features::Features;
pub(super) use features::{Feature, sum, weigh};
use guard::Guard;
pub(super) use material::properties_of;
pub use material::{CombineRule, ContactProperties, Exemptions, Layers, Material};
pub use memory::ContactMemory;
pub(super) use near_islands::NearIslands;
pub(super) use obstacles::{Obstacle, Obstacles, Surroundings};
use pairs::PairContacts;
pub use plane::Pose;
use plane::{PlaneContact, Surface};
pub(super) use presence::Presence;
pub(super) use reach::Scene;
pub use record::{ContactPartner, ContactRecord};
use response::Rebound;
pub(super) use shapes::Vicinity;
pub(crate) use shapes::{Crossing, Nearest, PlacedShape, Simplex};
pub use shapes::{MeshError, MeshKind, Shape};
pub(super) use stiff_pairs::{StiffPair, StiffPairs};
pub(super) use stiff_rebounds::Evaluated;
pub(super) use surface::{StiffContact, Surfaces};
use sweep::{Response, Sweep};
use touch_search::Touches;

/// What contacts compute with. All of it follows from [`ContactMemory`], particles and springs: a new one gives the same.
#[derive(Debug, Clone, Default)]
pub(super) struct ContactCaches {
    is_active: bool,
    candidates: Candidates,
    pair_contacts: PairContacts,
    plane_contacts: Vec<PlaneContact>,
    surfaces: Vec<Surface>,
    placed: Placed,
    touches: Touches,
    features: Features,
    feature_search: FeatureSearch,
    guard: Guard,
    bodies: Vec<Body>,
    /// Of the free chains in a tick that is taken as a whole, by what they do not touch themselves.
    directions: Vec<MonotoneDirection>,
    /// Positions at the start of the substep, m.
    previous: Vectors,
    has_previous: bool,
    sweep: Sweep,
    /// Whether the last substep of contacts has moved any particle.
    have_moved: bool,
    /// Where those of the last substep begin among the records, if they are recorded.
    first_record: usize,
    /// Whether the particle in each slot is in an island of an implicit step, of which what it touches is a part; empty if none is.
    is_implicit: Vec<bool>,
}

/// What a substep of the contacts reads.
#[derive(Clone, Copy)]
pub(super) struct Substep<'a> {
    pub elements: &'a Elements,
    pub colliders: &'a [Collider],
    /// The surfaces of particles by slot; of those beyond its end as of any.
    pub properties: &'a [ContactProperties],
    /// Of the last evaluation of the forces, m/s².
    pub acceleration: &'a Vectors,
    pub settings: &'a StepSettings,
    /// The scheme of the particles that are not stiff.
    pub integrator: Integrator,
    /// s.
    pub duration: f32,
    /// The fraction of the tick that has passed at its end.
    pub elapsed: f32,
}

impl Substep<'_> {
    /// How pairs rebound.
    fn rebound(&self) -> Rebound {
        let Self { settings, integrator, duration, .. } = *self;
        Rebound {
            restitution: settings.pair_rules.unwrap_or_default().restitution,
            substep: duration,
            resting_speed: settings.gravity.length() * duration,
            slop: settings.gravity.length() * duration * duration,
            velocity_lag: integrator.velocity_lag(),
        }
    }

    /// The unit vector against gravity; zero where there is none.
    fn up(&self) -> Vec3 {
        -self.settings.gravity.normalize_or_zero()
    }
}

impl ContactCaches {
    /// Whether anything may touch in this tick.
    pub fn is_active(&self) -> bool {
        self.is_active
    }

    /// Takes note of the particles that are no spheres of their own: see [`Surfaces::covered`].
    pub fn set_covered(&mut self, memory: &mut ContactMemory, particles: &Particles, covered: &[bool]) {
        if self.candidates.covered != covered {
            self.candidates.covered.clear();
            self.candidates.covered.extend_from_slice(covered);
            self.candidates.exclusions_version = None;
        }
        memory.check_spheres(particles.radius(), covered);
    }

    /// Takes note of the particles in the islands that implicit Euler advances.
    pub fn set_implicit(&mut self, count: usize, slots: impl Iterator<Item = usize>) {
        self.is_implicit.clear();
        for slot in slots {
            self.is_implicit.resize(count, false);
            self.is_implicit[slot] = true;
        }
    }

    /// Whether the particle in each slot is no sphere of its own; empty if all are.
    pub fn covered(&self) -> &[bool] {
        &self.candidates.covered
    }

    /// Whether the particle in each slot is in an island that an implicit scheme advances; empty where it advances none.
    pub fn implicit(&self) -> &[bool] {
        &self.is_implicit
    }

    /// Keeps the positions from which friction measures how far particles slipped, if anything may touch.
    pub fn begin_substep(
        &mut self,
        memory: &ContactMemory,
        positions: &Vectors,
        colliders: &[Collider],
        settings: &StepSettings,
    ) {
        let any_planes = settings.collide_with_colliders && !colliders.is_empty();
        let any_pairs = settings.pair_rules.is_some() && !memory.nothing_has_a_skin(positions.len());
        self.has_previous = any_planes || any_pairs;
        if self.has_previous {
            self.previous.copy_from(positions);
        }
    }

    /// Finds about where all were at the start of a substep in which nothing was expected to touch.
    fn reconstruct_previous(&mut self, particles: &Particles, duration: f32) {
        if std::mem::replace(&mut self.has_previous, true) {
            return;
        }
        self.previous.copy_from(&particles.position);
        for (start, velocity) in self.previous.axes_mut().into_iter().zip(particles.velocity.axes()) {
            start.iter_mut().zip(velocity).for_each(|(start, velocity)| *start -= duration * velocity);
        }
    }

    /// Finds all contacts at the end of a substep, for [`Self::solve`]. What sensors touch is found only if it `is_recorded`.
    pub fn find_all(
        &mut self,
        memory: &mut ContactMemory,
        particles: &mut Particles,
        substep: Substep,
        is_recorded: bool,
    ) {
        self.sweep.begin_substep();
        self.have_moved = substep.settings.pair_rules.is_some() && self.sweep(memory, particles, substep);
        self.find_touches(particles, substep, is_recorded);
        self.find(memory, particles, substep);
    }

    /// Solves the contacts that have been found, and appends them to `records`.
    pub fn solve(
        &mut self,
        particles: &mut Particles,
        substep: Substep,
        records: Option<&mut Vec<ContactRecord>>,
    ) {
        if self.count() == 0 {
            if let Some(records) = records {
                self.record(particles, records);
            }
            return;
        }
        self.have_moved = true;
        let Substep { settings, integrator, duration, .. } = substep;
        let rules = settings.pair_rules.unwrap_or_default();
        let gravity = settings.gravity.length();
        let tolerances =
            [rest::tolerated_error(settings), solve::COUPLED_ERROR].map(|error| error * gravity * duration);
        let falls_asleep = settings.sleep.is_some();
        let in_round = integrator == Integrator::Xpbd && touch::are_coupled(&self.touches.all);
        if in_round {
            self.solve_round(duration);
        } else {
            self.recall_touches();
        }
        self.solve_velocities((rules, falls_asleep), tolerances, integrator.displacement_share() * duration);
        self.hold_still(gravity * duration, falls_asleep);
        self.solve_positions(rules, duration, in_round);
        bodies::write_back(&self.bodies, particles, &self.candidates.regions);
        if let Some(records) = records {
            self.record(particles, records);
        }
    }

    /// Whether contacts have moved any particle in the last substep.
    pub fn have_moved(&self) -> bool {
        self.have_moved
    }

    /// Puts back what would have passed through another particle in this substep; whether there was any.
    fn sweep(&mut self, memory: &mut ContactMemory, particles: &mut Particles, substep: Substep) -> bool {
        let proof = self.candidates.check_chains(memory, particles, substep);
        if proof != Proof::Holds {
            self.reconstruct_previous(particles, substep.duration);
        }
        if proof != Proof::Fails && memory.nothing_has_a_skin(particles.len()) {
            return false;
        }
        let Self { candidates, previous, sweep, is_implicit, pair_contacts, .. } = self;
        candidates.derive(memory, pair_contacts, particles);
        // Free chains are not swept while their proof holds.
        let any_free = proof != Proof::Fails && memory.any_chains();
        let is_free = |memory: &ContactMemory, slot: usize| {
            any_free && memory.broad_phase.as_ref().is_some_and(|last| !last.has_skin(slot))
        };
        let is_fast_swept = |slot| !candidates.exclusions.is_covered(slot) && !is_free(memory, slot);
        if !sweep.find_fast(particles, previous, is_fast_swept) {
            return false;
        }
        // A list of this substep may lack pairs that touched on the way. One from before, if it is still good, has them.
        let is_complete = proof != Proof::Holds
            || any_free
            || candidates.refresh_for_sweep(memory, pair_contacts, (particles, previous), substep);
        let exclusions = &candidates.exclusions;
        let memory = &*memory;
        let is_swept = |slot| !exclusions.is_covered(slot) && !is_free(memory, slot);
        let mut grid = std::mem::take(&mut candidates.grid);
        let may_meet = |particles: &Particles, slots: [u32; 2]| {
            let stays = |slot: usize| particles.is_pinned(slot) || is_implicit.get(slot) == Some(&true);
            let layers = slots.map(|slot| material::properties_of(substep.properties, slot as usize).layers);
            !slots.iter().all(|slot| stays(*slot as usize))
                && (substep.properties.is_empty() || layers[0].meet(layers[1]))
                && !exclusions.contains(slots[0], slots[1])
        };
        let response = Response {
            rules: substep.settings.pair_rules.unwrap_or_default(),
            rebound: substep.rebound(),
            acceleration: substep.acceleration,
            exclusions,
            is_implicit,
        };
        let listed = candidates.found_pairs(memory, particles).filter(|_| is_complete);
        let around = (&mut grid, listed);
        let slides = |particles: &Particles, slots| response.slides(particles, slots);
        let may_slide = |particles: &Particles, slots| slides(particles, slots) && may_meet(particles, slots);
        let mut any = exclusions.any_sprung()
            && sweep.slide(around, particles, previous, is_swept, may_slide, response);
        let listed = candidates.found_pairs(memory, particles).filter(|_| is_complete);
        let around = (&mut grid, listed);
        let may_stop = |particles: &Particles, slots| !slides(particles, slots) && may_meet(particles, slots);
        let is_lone = |slot| particles.radius()[slot] > 0.0 && !exclusions.is_sprung(slot);
        if (0..particles.len()).any(is_lone) {
            any |= sweep.put_back(around, particles, previous, is_swept, may_stop);
        }
        candidates.grid = grid;
        any
    }

    /// Writes what the next ticks depend on into the memory.
    pub fn end_tick(&mut self, memory: &mut ContactMemory) {
        self.candidates.store(memory, &self.pair_contacts);
    }

    fn find(&mut self, memory: &mut ContactMemory, particles: &Particles, substep: Substep) {
        let Substep { colliders, acceleration, settings, properties, elapsed, .. } = substep;
        let rebound = substep.rebound();
        let Self { candidates, pair_contacts, previous, .. } = self;
        if settings.pair_rules.is_some() {
            candidates.refresh(memory, pair_contacts, (particles, previous), substep);
        } else {
            candidates.disable(memory, particles.len());
            // Rebounds from colliders depend on which particles are on springs.
            candidates.refresh_exclusions(memory, particles, substep.elements);
        }
        self.plane_contacts.clear();
        self.surfaces.clear();
        let body_of = &self.candidates.regions.body_of[..];
        if settings.collide_with_colliders {
            let is_implicit = &self.is_implicit[..];
            let conditions = plane::Conditions { acceleration, rebound, properties, body_of, is_implicit };
            for number in self.placed.planes.iter().map(|number| *number as usize) {
                let collider = &colliders[number];
                let surface = collider.surface(elapsed, settings.time_step);
                let numbers = [self.surfaces.len(), number];
                let found = &mut self.plane_contacts;
                plane::find(numbers, (collider, &surface), particles, conditions, found);
                self.surfaces.push(surface);
            }
        }
        self.touches.number_bodies(body_of);
        let any_pairs = !self.candidates.list.pairs.is_empty();
        if any_pairs || !self.plane_contacts.is_empty() || !self.touches.all.is_empty() {
            let Candidates { regions, exclusions, .. } = &self.candidates;
            let marks = (exclusions, &self.is_implicit[..]);
            bodies::fill(&mut self.bodies, particles, &self.previous, regions, marks);
        }
        if any_pairs {
            let up = Vec3A::from(substep.up());
            for contact in &self.plane_contacts {
                let body = &mut self.bodies[contact.body];
                let carries = self.surfaces[contact.plane].normal.dot(up) > 0.0;
                body.supported |= carries;
                body.carried |= carries;
                body.hold();
            }
            for touch in &self.touches.all {
                let body = &mut self.bodies[touch.bodies[0] as usize];
                let carries = touch.normal.dot(up) > 0.0;
                body.supported |= carries;
                body.carried |= carries;
                body.hold();
            }
            let Self { candidates, bodies, pair_contacts, .. } = self;
            let sides = (up, settings.is_flat, !self.is_implicit.is_empty());
            narrow::find(candidates, bodies, (acceleration, properties), rebound, sides, pair_contacts);
        }
    }
}
