//! Contacts of edges and triangles that have a thickness: ropes, cloths, balloons, jellies, and springs where asked, with
//! each other, with themselves and with loose balls.
//!
//! **Surfaces never cross** if they do not cross at the start. Three methods are known:
//! - *Continuous collision detection with a line search* (Li et al., *Incremental potential contact*, SIGGRAPH 2020): all
//!   particles stop at the first crossing that any pair would have. One contact stops everything, and each iteration
//!   solves a cubic, or a conservative advancement, for every pair.
//! - *Bounds on the displacement of each vertex* from the distances at the last search (Chen et al., *Offset geometric
//!   contact*, SIGGRAPH 2025): cheap and local, but a bound of a part of the distance is used up by what moves together or
//!   slides, as all of a falling cloth does, and each bound that is used up costs a search.
//! - *A certificate for each pair*, which is used here: sides that are apart along one direction at the start and at the end
//!   of straight paths were so all the way (`advance.rs`). It is as cheap as a bound (four products), as local (only
//!   particles of pairs that are not certified stop), exact for what slides and moves together, and needs no memory: all of
//!   this is a function of where particles are at the start and at the end of a substep. A few pairs that fail are advanced
//!   conservatively. The bounds of offset geometric contact remain for what they are best at, pairs that were not found: each
//!   vertex stays near the path on which it was expected to go on in the last search, or is searched for anew (`displacements.rs`).
//!
//! It is the last thing in a substep, after all that moves particles: any scheme, contacts of all kinds, strain limits.
//! Pinned particles keep their prescribed motion, and push the others.
//!
//! **What touches** (`contact.rs`, `solve.rs`): pairs that come nearer than the sum of their radii, those at the closest points.
//! Neighbours on a mesh keep half of the way along it (`near.rs`), if that is less. Pairs that cross at the start, or are in one place, are
//! ignored.
//!
//! What the next tick depends on is where surfaces stick to each other (`grip.rs`), which [`ContactMemory`] has: all else is caches.

mod advance;
mod closest;
mod confine;
mod contact;
mod crossing;
mod displacements;
mod follow;
mod force_velocities;
mod grip;
mod lanes;
mod list;
mod near;
mod order;
mod pair;
mod pair_collector;
mod primitives;
mod search;
mod solve;
mod spread;
mod steps;
mod stiff;
mod supports;
mod tree;
mod walks;

use advance::Advance;
use confine::{ATTEMPTS, Confinement};
use contact::{Contact, Evaluations, Examination};
pub(super) use grip::Grip;
use grip::Grips;
use primitives::Primitives;
use search::{Moving, Search};
use solve::Touching;
pub(in crate::solver) use stiff::StiffContact;
pub(super) use stiff::{CONTACT_HYSTERESIS, MAX_ELEMENT_SHARE};
use supports::Supports;
pub(super) use tree::Box3;

use super::material::ContactProperties;
use super::response::Rebound;
use super::{ContactCaches, ContactMemory, ContactPartner, ContactRecord, Evaluated, Substep};
use crate::solver::elements::{CollisionMesh, Elements};
use crate::solver::particles::{Particles, Vectors};
use crate::solver::settings::{Integrator, PairRules, StepSettings};

/// Number of times, at most, that what is to stop is looked for in a substep, each time among more pairs; after half of them, and
/// after the last one, all go back to where they were.
const MAX_STOPS: u32 = 16;

/// The place of a particle that touches nothing.
const NO_PLACE: u32 = u32::MAX;

/// The contacts of surfaces: caches and working memory.
#[derive(Debug, Clone, Default)]
pub(in crate::solver) struct Surfaces {
    primitives: Primitives,
    search: Search,
    /// Positions at the start of the substep, m.
    start: Vectors,
    /// Where an implicit step would end, m.
    end: Vectors,
    contacts: Vec<Contact>,
    grips: Grips,
    bodies: Vec<Touching>,
    supports: Supports,
    /// The place of each slot among the bodies.
    places: Vec<u32>,
    advance: Advance,
    confinement: Confinement,
    /// The contact properties of the last search.
    properties: Vec<ContactProperties>,
    is_active: bool,
}

impl Surfaces {
    /// To be called at the start of a tick.
    pub fn begin_tick(
        &mut self,
        memory: &mut ContactMemory,
        (mesh, elements, particles): (&CollisionMesh, &Elements, &Particles),
        (settings, properties): (&StepSettings, &[ContactProperties]),
    ) {
        let any = settings.pair_rules.is_some();
        if any && self.primitives.refresh(mesh, elements, particles, settings.collide_springs) {
            self.search.reset();
        }
        if any && self.properties != properties {
            self.properties.clear();
            self.properties.extend_from_slice(properties);
            self.search.reset();
        }
        self.is_active = any && self.primitives.any;
        if !self.is_active {
            self.clear(memory);
        }
    }

    fn clear(&mut self, memory: &mut ContactMemory) {
        memory.grips.clear();
        self.contacts.clear();
        self.bodies.clear();
        self.advance.clear();
    }

    /// Whether any may touch in this tick.
    pub fn are_active(&self) -> bool {
        self.is_active
    }

    /// Whether all that may touch in this tick are rows of edges, without a triangle.
    pub fn are_rows(&self) -> bool {
        self.is_active && self.primitives.are_rows
    }

    /// To be called when a tick has been taken in which none could touch.
    pub fn rest(&mut self, memory: &mut ContactMemory) {
        self.clear(memory);
        self.search.reset();
    }

    /// Whether the particle in each slot is no sphere of its own; empty if all are.
    pub fn covered(&self) -> &[bool] {
        if self.is_active { &self.primitives.covered } else { &[] }
    }

    /// Whether what springs pull at may rebound in this tick.
    pub fn may_rebound(&self, settings: &StepSettings, properties: &[ContactProperties]) -> bool {
        let may = |rules: PairRules| rules.restitution > 0.0 || !properties.is_empty();
        self.is_active && settings.pair_rules.is_some_and(may)
    }

    /// Keeps where all are at the start of a substep.
    pub fn begin_substep(&mut self, particles: &Particles) {
        if self.is_active {
            self.search.begin_substep(&particles.position);
            self.start.copy_from(&particles.position);
        }
        self.begin_advance(particles);
    }

    /// To be called before the velocities of the particles change by forces.
    pub fn begin_advance(&mut self, particles: &Particles) {
        if self.is_active {
            self.advance.force_velocities.begin(particles);
        }
    }

    /// To be called when they have, before any contacts of the substep are solved.
    pub fn end_advance(&mut self, particles: &Particles) {
        if self.is_active {
            self.advance.force_velocities.end(particles);
        }
    }

    /// To be called when the velocities have changed by forces once more after the last substep.
    pub fn end_tick(&mut self, particles: &mut Particles) {
        if self.is_active {
            self.advance.force_velocities.end(particles);
            self.advance.lose_force_velocities(particles);
        }
    }

    /// Number of the contacts of the last substep.
    pub fn count(&self) -> usize {
        self.contacts.len()
    }

    /// Calls `visit` with the slots of the particles of which contacts were solved in this substep, or in the last one.
    pub fn for_each_in_contact(&self, mut visit: impl FnMut(usize)) {
        self.bodies.iter().for_each(|body| visit(body.slot as usize));
    }

    /// Calls `visit` with the slots of the particles that touched or were stopped in the last substep.
    pub fn for_each_touching(&self, mut visit: impl FnMut(usize)) {
        self.for_each_in_contact(&mut visit);
        self.advance.stopped().iter().for_each(|slot| visit(*slot as usize));
    }

    /// Solves the contacts at the end of a substep, and appends them to `records`; whether there are any. Those of particles that
    /// are all in islands of an implicit step, which has them, are left out.
    pub fn resolve(
        &mut self,
        memory: &mut ContactMemory,
        particles: &mut Particles,
        (substep, evaluated): (Substep, Option<Evaluated>),
        others: &ContactCaches,
        records: Option<&mut Vec<ContactRecord>>,
    ) -> bool {
        self.contacts.clear();
        self.bodies.clear();
        if self.is_active {
            self.grips.take(&mut memory.grips, particles.len());
        }
        memory.grips.clear();
        let Substep { settings, integrator, duration, acceleration, properties, .. } = substep;
        let is_implicit = others.implicit();
        let Some(rules) = settings.pair_rules.filter(|_| self.is_active) else { return false };
        let rebound = rebound_of(settings, (integrator, duration));
        self.ensure(particles, (properties, Some(rebound.slop)));
        let Self { contacts, search, primitives, start, .. } = self;
        let moving = Moving { start, end: &particles.position, particles };
        let on_mesh = &primitives.on_mesh[..];
        let evaluated = evaluated.map(|evaluated| evaluated.accelerations);
        let examination = Examination {
            moving,
            acceleration,
            evaluated: Evaluations { accelerations: evaluated, is_implicit },
            rebound,
            rules,
            properties,
            search,
            on_mesh,
        };
        let is_solved = |slot: &u32| {
            particles.is_pinned(*slot as usize) || is_implicit.get(*slot as usize) == Some(&true)
        };
        for near in search.near() {
            if is_implicit.is_empty() || !search.candidate(*near).slots.iter().all(is_solved) {
                contacts.extend(examination.contact(*near));
            }
        }
        if contacts.is_empty() {
            return false;
        }
        // In an order that does not depend on when they were found.
        contacts.sort_unstable_by_key(|contact| search.order(contact.candidate, primitives));
        self.grips.recall(contacts, &search.candidates);
        self.gather(particles);
        let Self { contacts, bodies, supports, .. } = self;
        supports.find(others.half_spaces(substep), (bodies, particles), properties);
        solve::solve_velocities(contacts, (bodies, supports), 0.02 * rebound.resting_speed);
        solve::solve_positions(contacts, bodies, supports);
        let Self { contacts, bodies, search, .. } = &*self;
        let slips = contacts.iter().filter_map(|contact| Some((contact, solve::slip(contact, bodies)?)));
        memory.grips.extend(
            slips.map(|(contact, slip)| Grip::new(&search.candidates[contact.candidate as usize], slip)),
        );
        for body in &self.bodies {
            particles.position.set(body.slot as usize, body.position.into());
            particles.velocity.set(body.slot as usize, body.velocity.into());
        }
        if let Some(records) = records {
            self.record(particles, records);
        }
        true
    }

    /// Finds the pairs that may touch along the displacements to the present positions; whether anything was held back for it.
    fn ensure(&mut self, particles: &mut Particles, wanted: (&[ContactProperties], Option<f32>)) -> bool {
        let Self { search, primitives, start, confinement, .. } = self;
        search.ensure(primitives, Moving { start, end: &particles.position, particles }, wanted);
        let mut is_held = false;
        for with_common in ATTEMPTS {
            if !search.is_overfull {
                break;
            }
            confinement.find(primitives, (start, &particles.position, particles), with_common);
            confinement.shorten(start, &mut particles.position);
            confinement.slow(&mut particles.velocity);
            search.ensure(primitives, Moving { start, end: &particles.position, particles }, wanted);
            is_held = true;
        }
        is_held
    }

    /// Whether a pinned particle of a surface has moved in the substep, or one that collides.
    pub fn any_pushing(&self, particles: &Particles) -> bool {
        let Self { primitives, start, is_active, .. } = self;
        let pushes = |slot: usize| {
            let collides = primitives.on_mesh[slot] || particles.radius()[slot] > 0.0;
            particles.is_pinned(slot) && collides && particles.position.get(slot) != start.get(slot)
        };
        *is_active && (0..particles.len()).any(pushes)
    }

    /// To be called before the first stop of a substep.
    pub fn begin_stops(&mut self) {
        self.advance.clear();
    }

    /// Stops what would pass through something in this substep, whatever has moved it; whether there was any.
    ///
    /// `is_implicit` says that an implicit step ends here: the caller compares its energies.
    pub fn stop_crossings(
        &mut self,
        particles: &mut Particles,
        properties: &[ContactProperties],
        is_implicit: bool,
    ) -> bool {
        if !self.is_active {
            return false;
        }
        let mut any = false;
        for stop in 0..MAX_STOPS {
            if stop == MAX_STOPS / 2 {
                self.advance.put_back(&self.start, (particles, !is_implicit), &self.primitives.on_mesh);
            }
            // Where some stop and others go on they may meet what they would have gone along with.
            any |= self.ensure(particles, (properties, None));
            let Self { advance, search, primitives, start, .. } = self;
            if !advance.stop((search, primitives), start, particles, (stop, !is_implicit)) {
                return any;
            }
            any = true;
        }
        self.advance.put_back(&self.start, (particles, !is_implicit), &self.primitives.on_mesh);
        true
    }

    /// Copies the particles that touch something, and gives the contacts their places.
    fn gather(&mut self, particles: &Particles) {
        let Self { contacts, bodies, places, start, .. } = self;
        places.resize(particles.len(), NO_PLACE);
        for contact in &mut *contacts {
            for slot in &mut contact.places {
                let number = *slot as usize;
                if places[number] == NO_PLACE {
                    places[number] = bodies.len() as u32;
                    bodies.push(Touching {
                        position: particles.position.get(number).into(),
                        velocity: particles.velocity.get(number).into(),
                        start: start.get(number).into(),
                        inverse_mass: particles.inverse_mass()[number],
                        slot: *slot,
                    });
                }
                *slot = places[number];
            }
        }
        bodies.iter().for_each(|body| places[body.slot as usize] = NO_PLACE);
    }

    fn record(&self, particles: &Particles, records: &mut Vec<ContactRecord>) {
        for contact in self.contacts.iter().filter(|contact| contact.impulse > 0.0) {
            let slots = contact.places.map(|place| self.bodies[place as usize].slot);
            let ([first, second], point) = contact.nearest(slots, particles);
            let (slot, other, normal) = if first < second {
                (first, second, contact.normal)
            } else {
                (second, first, -contact.normal)
            };
            let other = ContactPartner::Particle(other);
            let (normal, impulse) = (normal.into(), contact.impulse);
            records.push(ContactRecord { slot, other, point, normal, impulse });
        }
    }
}

/// How what touches in a substep rebounds, with a restitution that is that of each pair.
fn rebound_of(settings: &StepSettings, (integrator, duration): (Integrator, f32)) -> Rebound {
    let gravity = settings.gravity.length();
    Rebound {
        restitution: 0.0,
        substep: duration,
        resting_speed: gravity * duration,
        slop: gravity * duration * duration,
        velocity_lag: integrator.velocity_lag(),
    }
}
