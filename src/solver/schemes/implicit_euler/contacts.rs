//! Contacts with what nothing in the step can move, as a part of the potential of the step.
//!
//! A particle that would enter an obstacle meets an energy ½ K (a − g)², where g < a is its gap at the end of the
//! step, and a <= 0 an overlap that it has had from the start: the active set of a quadratic penalty, which
//! Newton's method finds like every other minimum (a semi-smooth Newton method: Hintermüller, Ito and Kunisch,
//! *SIAM J. Optim.* 13, 865, 2002). K begins at [`STIFFENING`] times the inertia of the particle, and grows until
//! nothing enters an obstacle by more than [`SOFTNESS`] of the longest way of the step: a continuation, as the active
//! set is found in fewer steps from a softer one. The other particles of the island know of the contact within the
//! same step, so that no spring is compressed by it.
//! A barrier (Li et al., *Incremental potential contact*, 2020) would have to be resolved by many more Newton
//! steps, and would push from a distance.
//!
//! Coulomb friction is lagged (Li et al., 2020, section 5): the step is solved, then again with a potential μ N φ(‖u‖)
//! of the slip u along the surface, where N is the normal force of the last solution and φ is ‖u‖, but
//! quadratic below [`CREEP`] m/s.
//!
//! Restitution follows Poisson: after the step, an impact gives once more ε times the impulse that it has given
//! in the step, and the whole island answers to it by the same linear system, without the contacts that part.

use std::ops::Range;

use bevy::math::DVec3;

use super::block::Symmetric;
use super::newton::MAX_STEPS;
use crate::solver::collision::{ContactMemory, ContactRecord, Obstacle, Obstacles};
use crate::solver::graph::Elimination;
use crate::solver::particles::Particles;

/// What may be left of a way into an obstacle, as a part of the longest way of the step.
const SOFTNESS: f64 = 1e-3;

/// K at first, as a multiple of the inertia m/h² + ν/h of the particle; and by what it grows.
const STIFFENING: f64 = 1e3;
const GROWTH: f64 = 30.0;

/// Number of solutions of a step in search of its contacts, at most.
const MAX_PASSES: usize = 4;

/// An overlap is left at this speed at most, m/s, so that one that no motion made is no source of energy.
const RECOVERY_SPEED: f64 = 0.1;

/// Below this speed friction is viscous, m/s: what sticks creeps by less.
const CREEP: f64 = 1e-5;

/// Number of solutions with friction: each with the normal forces of the one before.
const FRICTION_PASSES: usize = 2;

/// Maximal number of Newton steps of a solution that another one follows.
const STEPS_OF_A_PASS: usize = 5;

/// The sine of the angle between two normals that are taken for different ones.
const MIN_ANGLE: f64 = 1e-6;

/// How far, as a multiple of the longest way of a particle of the island in free flight, obstacles are
/// looked for.
const REACH: f64 = 4.0;

/// A particle that touches an obstacle, or may in this step.
#[derive(Debug, Clone, Copy)]
struct Contact {
    node: usize,
    obstacle: Obstacle,
    /// m.
    radius: f64,
    /// N/m.
    inertia: f64,
    /// The gap at which it begins to be held, m, <= 0.
    allowed: f64,
    /// How far the surface moves in the step at the contact, m.
    surface_way: DVec3,
    /// The speed at which the particle and the surface come closer when the step begins, m/s; gravity's share of
    /// the step included.
    approach: f64,
    /// Towards the particle, where it was linearised last.
    normal: DVec3,
    /// The normal force there, N, >= 0.
    force: f64,
    /// The normal force that friction goes by, N; in a rebound, what is given again.
    lagged: f64,
    /// The force of friction where it was linearised last, N.
    friction: DVec3,
}

/// The contacts of an island in one step.
#[derive(Debug, Clone, Default)]
pub(super) struct Contacts {
    contacts: Vec<Contact>,
    /// K as a multiple of the inertia of the particle.
    stiffness: f64,
    /// How deep a particle may enter an obstacle, m.
    max_depth: f64,
    /// Number of solutions so far.
    passes: usize,
    /// The slip below which friction is viscous, m.
    creep: f64,
    /// How far obstacles were looked for, m.
    reach: f64,
    mode: Mode,
    /// Whether other contacts held in the last linearisation than in the one before.
    pub changed: bool,
}

/// What a linearisation is for.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
enum Mode {
    #[default]
    Step,
    /// The rebound.
    Rebound,
}

/// Which particles of an island do not collide with pinned ones.
pub(super) struct PairFilter<'a> {
    /// The node and the pinned slot that overlap at rest: a spring joins them.
    pub excluded: &'a [(u32, u32)],
    /// The pinned slots that any spring pulls at.
    pub sprung: &'a [u32],
    pub memory: &'a ContactMemory,
}

impl PairFilter<'_> {
    /// Whether the particle of a node, in a `slot`, and a pinned one may collide, which overlap at the start or not.
    pub fn may_collide(&self, node: usize, slot: u32, pinned: u32, overlap: bool) -> bool {
        let memory = self.memory;
        let is_new = || !(memory.has_searched(slot) && memory.has_searched(pinned));
        let tangled = || memory.are_entangled(slot, pinned) || (is_new() && self.sprung.contains(&pinned));
        !self.excluded.contains(&(node as u32, pinned)) && !(overlap && tangled())
    }
}

/// The step of an island, as its contacts see it.
pub(super) struct Motion<'a> {
    pub elimination: &'a Elimination,
    pub particles: &'a Particles,
    /// By node: the positions at the start, and in free flight at the end, m.
    pub start: &'a [DVec3],
    pub flight: &'a [DVec3],
    /// By node, N/m.
    pub inertia: &'a [f64],
    /// s.
    pub h: f64,
}

impl Contacts {
    /// Looks for the contacts of a step.
    pub fn begin(&mut self, motion: &Motion, obstacles: &Obstacles, filter: &PairFilter, least_reach: f64) {
        let Motion { elimination, particles, start, flight, inertia, h } = *motion;
        self.contacts.clear();
        self.mode = Mode::Step;
        self.changed = false;
        if obstacles.is_empty() {
            return;
        }
        let free = 0..elimination.free;
        let longest = longest_way(free.clone(), start, flight);
        (self.stiffness, self.passes) = (STIFFENING, 0);
        self.max_depth = SOFTNESS * longest;
        self.creep = CREEP * h;
        self.reach = least_reach.max(REACH * longest);
        for node in free {
            let slot = elimination.slots[node];
            let radius = f64::from(particles.radius()[slot as usize]);
            obstacles.near(start[node], radius, [self.reach, h], |obstacle| {
                let surface_way = h * obstacle.velocity_at(start[node]);
                // The obstacle is where it is at the end of the step.
                let (gap, normal) = obstacle.gap(start[node] + surface_way, radius);
                if let Some(pinned) = obstacle.pinned_slot()
                    && (radius == 0.0 || !filter.may_collide(node, slot, pinned as u32, gap < 0.0))
                {
                    return;
                }
                let approach = (surface_way - (flight[node] - start[node])).dot(normal) / h;
                let allowed = (gap + RECOVERY_SPEED * h).min(0.0);
                self.contacts.push(Contact {
                    node,
                    obstacle: *obstacle,
                    radius,
                    inertia: inertia[node],
                    allowed,
                    surface_way,
                    approach,
                    normal,
                    force: 0.0,
                    lagged: 0.0,
                    friction: DVec3::ZERO,
                });
            });
        }
    }

    /// Looks for none: nothing is held.
    pub fn clear(&mut self) {
        self.contacts.clear();
        (self.mode, self.changed) = (Mode::Step, false);
    }

    /// The nodes that were held in the last linearisation.
    pub fn held_nodes(&self) -> impl Iterator<Item = usize> {
        self.contacts.iter().filter(|contact| contact.force > 0.0).map(|contact| contact.node)
    }

    /// Whether there may be any contact.
    pub fn any(&self) -> bool {
        !self.contacts.is_empty()
    }

    /// Whether any contact held in the last linearisation.
    pub fn hold(&self) -> bool {
        self.contacts.iter().any(|contact| contact.force > 0.0)
    }

    /// Whether obstacles were looked for far enough for where the nodes are now; if not, how far they are to be.
    pub fn missing_reach(&self, free: usize, start: &[DVec3], position: &[DVec3]) -> Option<f64> {
        let longest = longest_way(0..free, start, position);
        (longest > self.reach && longest.is_finite()).then_some(longest)
    }

    /// The force of all contacts, N.
    pub fn force(&self) -> DVec3 {
        self.contacts.iter().map(|contact| contact.normal * contact.force + contact.friction).sum()
    }

    /// The part of a displacement that leads into no obstacle and away from none.
    pub fn along_surfaces(&self, displacement: DVec3) -> DVec3 {
        let mut basis = [DVec3::ZERO; 3];
        let mut count = 0;
        for contact in self.contacts.iter().filter(|contact| contact.force > 0.0) {
            let outside = perpendicular(contact.normal, &basis);
            if count < 3 && outside.length_squared() > MIN_ANGLE * MIN_ANGLE {
                basis[count] = outside.normalize();
                count += 1;
            }
        }
        perpendicular(displacement, &basis)
    }

    /// Number of Newton steps of the next solution, at most.
    pub fn max_steps(&self) -> usize {
        let is_last = !self.any() || self.passes + 1 == MAX_PASSES;
        if is_last { MAX_STEPS } else { STEPS_OF_A_PASS }
    }

    /// To be called after each solution of the step: whether another one is due, with stiffer contacts or with
    /// the friction that follows from this one, or if it has not come close enough.
    pub fn refine(&mut self, is_solved: bool) -> bool {
        self.passes += 1;
        let mut rubs = false;
        let mut deepest = 0.0_f64;
        for contact in self.contacts.iter_mut().filter(|contact| contact.force > 0.0) {
            rubs |= contact.obstacle.friction > 0.0;
            deepest = deepest.max(contact.force / (self.stiffness * contact.inertia));
        }
        for contact in &mut self.contacts {
            contact.lagged = contact.force;
        }
        let is_deep = deepest > self.max_depth;
        if is_deep {
            self.stiffness *= GROWTH;
        }
        let is_due = is_deep || !is_solved || (rubs && self.passes <= FRICTION_PASSES);
        is_due && self.any() && self.passes < MAX_PASSES
    }

    /// The energy at these positions, J.
    pub fn energy(&self, position: &[DVec3], start: &[DVec3]) -> f64 {
        let energy = |contact: &Contact| {
            let (gap, normal) = contact.obstacle.gap(position[contact.node], contact.radius);
            let depth = (contact.allowed - gap).max(0.0);
            let slip = position[contact.node] - start[contact.node] - contact.surface_way;
            let limit = contact.obstacle.friction * contact.lagged;
            let friction = rub(slip - normal * slip.dot(normal), normal, limit, self.creep);
            0.5 * self.stiffness * contact.inertia * depth * depth + friction.energy
        };
        self.contacts.iter().map(energy).sum()
    }

    /// Adds forces and stiffness of the contacts at the present positions to those of the nodes; their energy in J.
    pub fn linearise(
        &mut self,
        position: &[DVec3],
        start: &[DVec3],
        right: &mut [DVec3],
        diagonal: &mut [Symmetric],
    ) -> f64 {
        let Self { contacts, stiffness, creep, mode, changed, .. } = self;
        *changed = false;
        let mut energy = 0.0;
        for contact in contacts {
            let node = contact.node;
            if *mode == Mode::Rebound {
                contact.rebound(*stiffness * contact.inertia, &mut right[node], &mut diagonal[node]);
                continue;
            }
            let (gap, normal) = contact.obstacle.gap(position[node], contact.radius);
            let depth = contact.allowed - gap;
            let was_held = contact.force > 0.0;
            contact.normal = normal;
            let stiffness = *stiffness * contact.inertia;
            contact.force = stiffness * depth.max(0.0);
            *changed |= was_held != (contact.force > 0.0);
            if depth > 0.0 {
                energy += 0.5 * contact.force * depth;
                right[node] += normal * contact.force;
                diagonal[node] += Symmetric::uniaxial(normal, stiffness, 0.0);
            }
            let limit = contact.obstacle.friction * contact.lagged;
            if limit > 0.0 {
                let slip = position[node] - start[node] - contact.surface_way;
                let found = rub(slip - normal * slip.dot(normal), normal, limit, *creep);
                energy += found.energy;
                right[node] += found.force;
                diagonal[node] += found.stiffness;
                contact.friction = found.force;
            }
        }
        energy
    }

    /// Prepares the next linearisation for the rebound; whether anything rebounds: what approached faster than
    /// `resting_speed`, m/s.
    pub fn begin_rebound(&mut self, resting_speed: f64) -> bool {
        let mut any = false;
        for contact in self.contacts.iter_mut().filter(|contact| contact.force > 0.0) {
            let Contact { obstacle, approach, .. } = *contact;
            let rebounds = obstacle.restitution > 0.0 && obstacle.restitution * approach > resting_speed;
            contact.lagged = if rebounds { obstacle.restitution * contact.force } else { 0.0 };
            any |= rebounds;
        }
        if any {
            self.mode = Mode::Rebound;
        }
        any
    }

    /// The contacts that have held a particle in a step of `h` seconds, at its end.
    pub fn records(
        &self,
        elimination: &Elimination,
        position: &[DVec3],
        h: f64,
        mut record: impl FnMut(ContactRecord),
    ) {
        for contact in self.contacts.iter().filter(|contact| contact.force > 0.0) {
            let Contact { node, normal, radius, force, lagged, .. } = *contact;
            let rebound = if self.mode == Mode::Rebound { lagged } else { 0.0 };
            record(ContactRecord {
                slot: elimination.slots[node] as usize,
                other: contact.obstacle.partner,
                point: (position[node] - normal * radius).as_vec3(),
                normal: normal.as_vec3(),
                impulse: (h * (force + rebound)) as f32,
            });
        }
    }
}

/// The part of a vector perpendicular to orthonormal ones, or zeros.
fn perpendicular(vector: DVec3, basis: &[DVec3]) -> DVec3 {
    basis.iter().fold(vector, |rest, direction| rest - *direction * rest.dot(*direction))
}

/// The longest way of a node, m.
fn longest_way(nodes: Range<usize>, start: &[DVec3], end: &[DVec3]) -> f64 {
    nodes.map(|node| end[node].distance_squared(start[node])).fold(0.0, f64::max).sqrt()
}

impl Contact {
    /// The force of the step, and what is given again; what does not rebound stays held.
    fn rebound(&self, stiffness: f64, right: &mut DVec3, diagonal: &mut Symmetric) {
        if self.force > 0.0 {
            let again = self.lagged / self.force;
            *right += self.normal * (self.force + self.lagged) + self.friction * (1.0 + again);
            if self.lagged == 0.0 {
                *diagonal += Symmetric::uniaxial(self.normal, stiffness, 0.0);
            }
        }
    }
}

/// What friction contributes.
struct Friction {
    energy: f64,
    force: DVec3,
    stiffness: Symmetric,
}

/// Friction against a slip of at most `limit` N: its potential is limit · ‖slip‖, but quadratic below `creep` m.
fn rub(slip: DVec3, normal: DVec3, limit: f64, creep: f64) -> Friction {
    let length = slip.length();
    let weight = limit / length.max(creep);
    let energy = match length < creep {
        true => 0.5 * weight * length * length,
        false => limit * (length - 0.5 * creep),
    };
    // The quadratic that touches the potential from above: a step never overshoots.
    Friction { energy, force: slip * -weight, stiffness: Symmetric::uniaxial(normal, 0.0, weight) }
}
