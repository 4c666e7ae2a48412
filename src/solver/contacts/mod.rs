//! Collisions: of particles with planes and with each other, after each substep.
//!
//! Every contact is answered in three steps: the particles are *projected* out of each other (the
//! correction shared by mass), the approaching part of their velocity is removed, and given back with
//! the coefficient of restitution; friction acts on what is tangential. A pinned particle has infinite
//! mass. The files: `response.rs` the formulas; `grid.rs`, `joints.rs`, `candidates.rs` and `list.rs` who may
//! touch whom; `narrow.rs` who does; `regions.rs` what can be solved at the same time; `pairs.rs` and `plane.rs`
//! the two kinds of contact.

mod bodies;
mod candidates;
mod grid;
mod joints;
mod list;
mod narrow;
mod pairs;
mod plane;
mod regions;
mod response;

use bevy::math::{Vec3, Vec3A};

use super::StepSettings;
use super::particles::{Particles, Vectors};
use super::springs::Springs;
use bodies::Body;
use candidates::Candidates;
use pairs::PairContacts;
pub use plane::{Plane, Pose};
use plane::{PlaneContact, Surface};
use response::Rebound;

/// Most rounds over the velocities of all contacts in each substep.
const VELOCITY_ROUNDS: usize = 3;

/// The velocity that is left uncorrected in a resting contact, as a part of what gravity gives in a
/// substep: a settled pile then needs one look and no work.
const SETTLED_ERROR: f32 = 0.02;

/// Rounds over their positions.
const POSITION_ROUNDS: usize = 2;

/// As many contacts, at least, hold a jammed particle: fewer leave it free to slide or roll.
const JAMMING_CONTACTS: u32 = 3;

/// How particles collide with each other.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct PairRules {
    /// Coefficient of restitution, 0 to 1.
    pub restitution: f32,
    /// Coefficient of Coulomb friction, >= 0.
    pub friction: f32,
}

/// A contact in one substep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactRecord {
    /// Slot of the particle that is pushed along the normal.
    pub slot: usize,
    /// What it touches.
    pub other: ContactPartner,
    /// Where, m.
    pub point: Vec3,
    /// Unit vector towards the particle.
    pub normal: Vec3,
    /// Normal impulse, N·s.
    pub impulse: f32,
}

/// What a particle touches.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum ContactPartner {
    /// The plane of this index in [`Contacts::planes`].
    Plane(usize),
    /// The particle in this slot.
    Particle(usize),
}

/// The planes, the contacts, and what is remembered of them from substep to substep.
#[derive(Debug, Clone, Default)]
pub struct Contacts {
    /// The planes.
    pub planes: Vec<Plane>,
    /// Whether contacts are recorded.
    pub recording: bool,
    /// The contacts of all substeps of the last tick, if they are recorded.
    pub records: Vec<ContactRecord>,
    candidates: Candidates,
    pair_contacts: PairContacts,
    plane_contacts: Vec<PlaneContact>,
    surfaces: Vec<Surface>,
    bodies: Vec<Body>,
    /// Positions at the start of the substep, m.
    previous: Vectors,
}

impl Contacts {
    /// Touching pairs at the end of the last substep: of particles and of particles with planes.
    pub fn count(&self) -> usize {
        self.pair_count() + self.plane_contacts.len()
    }

    fn pair_count(&self) -> usize {
        self.candidates.groups().contacts()
    }

    /// Forgets all impulses and candidates, as if the simulation had just started.
    pub fn forget(&mut self) {
        self.candidates.clear();
    }

    /// To be called when a radius, a mass or a spring has changed.
    pub fn invalidate(&mut self) {
        self.candidates.invalidate();
    }

    /// To be called when particles were added or removed: `new_slots[old]` is the new slot of each
    /// particle, `None` for those that are gone; the order of those that stay must be unchanged.
    /// `count` is their new number.
    pub fn renumber(&mut self, new_slots: &[Option<u32>], count: usize) {
        self.candidates.renumber(new_slots, count);
    }

    pub(super) fn begin_tick(&mut self) {
        self.records.clear();
    }

    /// Keeps the positions from which friction measures how far things slipped.
    pub(super) fn begin_substep(&mut self, particles: &Particles, settings: &StepSettings) {
        let planes = settings.collide_with_planes && !self.planes.is_empty();
        if planes || settings.pair_rules.is_some() {
            self.previous.copy_from(&particles.position);
        }
    }

    /// Answers all contacts at the end of a substep, the fraction `elapsed` of the tick having passed.
    pub(super) fn resolve(
        &mut self,
        particles: &mut Particles,
        springs: &Springs,
        settings: &StepSettings,
        substep: f32,
        elapsed: f32,
    ) {
        self.find(particles, springs, settings, substep, elapsed);
        if self.count() == 0 {
            return;
        }
        let rules = settings.pair_rules.unwrap_or_default();
        let gravity = settings.gravity.length();
        self.solve_velocities(rules, gravity * substep, settings.scheme.displacement_share() * substep);
        self.hold_jammed(gravity * substep);
        self.solve_positions(rules, substep);
        bodies::write_back(&self.bodies, particles, self.candidates.regions());
        if self.recording {
            self.record(particles);
        }
    }

    fn find(
        &mut self,
        particles: &Particles,
        springs: &Springs,
        settings: &StepSettings,
        substep: f32,
        elapsed: f32,
    ) {
        let rules = settings.pair_rules.unwrap_or_default();
        let rebound = Rebound {
            restitution: rules.restitution,
            substep,
            resting_speed: settings.gravity.length() * substep,
            slop: settings.gravity.length() * substep * substep,
            velocity_lag: settings.scheme.velocity_lag(),
        };
        let up = -settings.gravity.normalize_or_zero();
        if settings.pair_rules.is_some() {
            self.candidates.refresh(particles, springs, &self.previous, up, settings.time_step);
        } else {
            self.candidates.disband(particles.len());
        }
        self.plane_contacts.clear();
        self.surfaces.clear();
        if settings.collide_with_planes {
            let body_of = &self.candidates.regions().body_of;
            for (index, plane) in self.planes.iter().enumerate() {
                let surface = plane.surface(elapsed, settings.time_step);
                plane::find(index, &surface, particles, rebound, body_of, &mut self.plane_contacts);
                self.surfaces.push(surface);
            }
        }
        let any_pairs = !self.candidates.is_empty();
        if any_pairs || !self.plane_contacts.is_empty() {
            let (regions, joints) = (self.candidates.regions(), self.candidates.joints());
            bodies::fill(&mut self.bodies, particles, &self.previous, regions, joints);
        }
        if any_pairs {
            let up = Vec3A::from(up);
            for contact in &self.plane_contacts {
                let body = &mut self.bodies[contact.body];
                body.supported |= self.surfaces[contact.plane].normal.dot(up) > 0.0;
                body.holds += 1;
            }
            let Self { candidates, bodies, pair_contacts, .. } = self;
            narrow::find(candidates, bodies, &particles.acceleration, rebound, up, pair_contacts);
        }
    }

    fn solve_velocities(&mut self, rules: PairRules, resting_speed: f32, reach: f32) {
        let pairs = self.pair_count() > 0;
        if pairs {
            let tolerance = SETTLED_ERROR * resting_speed;
            let Self { pair_contacts, candidates, bodies, .. } = self;
            pairs::warm_start(pair_contacts, candidates.groups_mut(), bodies);
            for _ in 0..VELOCITY_ROUNDS {
                // The planes come first, so that a pair does not take for an escape what is only the
                // load of the pile above it.
                self.solve_plane_velocities();
                let Self { pair_contacts, candidates, bodies, .. } = self;
                let groups = candidates.groups_mut();
                if !pairs::solve_velocities(pair_contacts, groups, rules, bodies, tolerance) {
                    break;
                }
            }
        }
        self.solve_plane_velocities();
        if pairs {
            let Self { pair_contacts, candidates, bodies, .. } = self;
            pairs::finish_velocities(pair_contacts, candidates.groups_mut(), bodies, reach);
        }
    }

    fn solve_plane_velocities(&mut self) {
        for contact in &mut self.plane_contacts {
            plane::solve_velocity(contact, &self.surfaces[contact.plane], &mut self.bodies);
        }
    }

    /// Leaves a particle where it was that others hold from at least three sides, on the ground, and that
    /// is slower than what gravity gives in a substep: it is jammed. Without it a pile would simmer at
    /// that speed for ever, as the corrections of its overlaps stir it.
    fn hold_jammed(&mut self, resting_speed: f32) {
        if self.pair_count() == 0 {
            return;
        }
        bodies::for_each(&mut self.bodies, self.candidates.regions(), |body| {
            let held = body.holds >= JAMMING_CONTACTS && body.supported && body.inverse_mass > 0.0;
            if held && body.velocity.length_squared() < resting_speed * resting_speed {
                body.velocity = Vec3A::ZERO;
                body.position = body.previous;
            }
        });
    }

    fn solve_positions(&mut self, rules: PairRules, substep: f32) {
        let Self { pair_contacts, plane_contacts, candidates, surfaces, bodies, .. } = self;
        for _ in 0..POSITION_ROUNDS {
            pairs::solve_positions(pair_contacts, candidates.groups_mut(), rules, bodies);
            for contact in &*plane_contacts {
                plane::solve_position(contact, &surfaces[contact.plane], bodies, substep);
            }
        }
    }

    fn record(&mut self, particles: &Particles) {
        for contact in &self.plane_contacts {
            let normal = Vec3::from(self.surfaces[contact.plane].normal);
            self.records.push(ContactRecord {
                slot: contact.slot,
                other: ContactPartner::Plane(contact.plane),
                point: particles.position.get(contact.slot) - normal * particles.radius[contact.slot],
                normal,
                impulse: contact.impulse,
            });
        }
        let slot_of = &self.candidates.regions().slot_of;
        for group in self.candidates.groups().iter() {
            let slot = |place: usize| slot_of[group.bodies.start + place] as usize;
            for contact in self.pair_contacts.of(group) {
                let (first, second) = (slot(contact.first()), slot(contact.second()));
                // The same way round whoever is the upper one, as that may change within a tick.
                let (slot, other, normal) = if first < second {
                    (first, second, contact.normal)
                } else {
                    (second, first, -contact.normal)
                };
                let normal = Vec3::from(normal);
                self.records.push(ContactRecord {
                    slot,
                    other: ContactPartner::Particle(other),
                    point: particles.position.get(slot) - normal * particles.radius[slot],
                    normal,
                    impulse: contact.impulses.normal,
                });
            }
        }
    }
}
