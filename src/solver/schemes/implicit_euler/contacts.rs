//! Contacts as a part of the potential of the step: with obstacles, which nothing in the step can move, and between
//! particles of the island.
//!
//! A particle that would enter an obstacle, or another particle, meets an energy ½ K (a − g)², where g < a is its gap at the end of the
//! step, and a <= 0 an overlap that it has had from the start: the active set of a quadratic penalty, which
//! Newton's method finds like every other minimum (a semi-smooth Newton method: Hintermüller, Ito and Kunisch,
//! *SIAM J. Optim.* 13, 865, 2002). K begins at [`STIFFENING`] times the inertia of the particle, and grows until
//! nothing enters an obstacle by more than [`SOFTNESS`] of the longest displacement of the step: a continuation, as the active
//! set is found in fewer steps from a softer one; and each solution adds the force of the one before, so that little
//! depth is left (the augmented Lagrangian: Hestenes, *J. Optim. Theory Appl.* 4, 303, 1969). The other particles of
//! the island respond to the contact within the same step, so that no spring is compressed by it. A barrier (Li et al., *Incremental
//! potential contact*, 2020) would take many more Newton steps, and would push from a distance.
//!
//! K grows only where the forces of the solution before have not taken most of the depth away.
//!
//! Coulomb friction is lagged (Li et al., 2020, section 5): the step is solved with a potential μ N φ(‖u‖) of the slip u along the
//! surface (`friction.rs`), where N is the normal force of the solution before, and again where N has changed by more than
//! [`FRICTION_TOLERANCE`]. φ is ‖u‖, but quadratic below [`CREEP`] m/s.
//!
//! A step begins with the contact forces of the one before, and with what stuck there (`remembered.rs`).
//!
//! Restitution: after the step, what has approached at the speed u is sent back at ε u, and the whole island answers
//! to it by the same linear system.

use std::ops::Range;

use bevy::math::DVec3;

use super::contact::{Approach, Contact, Partner, Sums};
use super::newton::MAX_STEPS;
use crate::solver::collision::{ContactMemory, Obstacles, StiffPair, Surroundings};
use crate::solver::graph::{Elimination, Exclusions};
use crate::solver::particles::Particles;
use crate::solver::settings::PairRules;

/// What may be left of a way into an obstacle, as a part of the longest displacement of the step.
const SOFTNESS: f64 = 1e-4;

/// K at first, as a multiple of the inertia m/h² + ν/h of the particle.
const STIFFENING: f64 = 1e3;

/// Factor by which K grows from one solution to the next.
const GROWTH: f64 = 30.0;

/// Number of solutions of a step in search of its contacts, at most; and with edges and faces, which touch by other points in each.
const MAX_PASSES: usize = 5;
const MAX_FEATURE_PASSES: usize = 20;

/// The same where surfaces touch: few of these are solved until they converge.
pub(super) const MAX_SURFACE_PASSES: usize = 2;

/// Number of Newton steps of the last solution where surfaces touch, at most.
const MAX_SURFACE_STEPS: usize = 12;

/// Number of solutions after which no contact of surfaces becomes stiffer any more.
const MAX_HARDENING_PASSES: usize = 6;

/// An overlap is left at this speed at most, m/s, so that one that no motion made is no source of energy.
pub(super) const RECOVERY_SPEED: f64 = 0.1;

/// Below this speed friction is viscous, m/s: what sticks creeps by less.
const CREEP: f64 = 1e-5;

/// How far the limits of friction may be from those that a solution went by, as a part of their sum.
const FRICTION_TOLERANCE: f64 = 0.02;

/// Number of solutions with friction where faces touch: each with the normal forces of the one before.
const FACE_FRICTION_PASSES: usize = 2;

/// The part of [`max_depth`](Contacts::max_depth) that may be left where contacts begin with the forces of the last step: what rests stays
/// where it is to the bit.
const REST: f64 = 0.1;

/// What a solution may leave of the greatest depth of the one before; where it is more, K grows.
pub(super) const MAX_REST: f64 = 0.25;

/// Maximal number of Newton steps of a solution that another one follows.
const STEPS_OF_A_PASS: usize = 5;

/// How far, as a multiple of the longest displacement of a particle of the island in free flight, obstacles are
/// looked for.
const REACH: f64 = 4.0;

/// The contacts of an island in one step.
#[derive(Debug, Clone, Default)]
pub(super) struct Contacts {
    pub(super) contacts: Vec<Contact>,
    /// K as a multiple of the inertia of the particle.
    pub(super) stiffness: f64,
    /// How deep a particle may enter an obstacle, m.
    pub(super) max_depth: f64,
    /// Number of solutions so far.
    pub(super) passes: usize,
    /// The same at most.
    pub(super) max_passes: usize,
    /// Whether there may be as many as without surfaces where a solution has not come close enough.
    pub(super) goes_on: bool,
    /// Number of searches for contacts that were missed.
    pub(super) searches: usize,
    /// The slip below which friction is viscous, m.
    creep: f64,
    /// How far obstacles were looked for, m.
    pub(super) reach: f64,
    /// Whether there are any of edges and faces with obstacles.
    pub(super) has_features: bool,
    /// Whether there are any of faces, or of surfaces with each other.
    pub(super) has_faces: bool,
    /// The depth of what was deepest after the last solution that came close enough, m.
    deepest: f64,
    mode: Mode,
    /// The part of their forces with which those from outside are published.
    pub(super) published_share: f64,
    /// Whether the next linearisation follows a whole Newton step.
    pub is_whole_step: bool,
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
    /// Of particles that do not collide with each other.
    pub families: &'a [u32],
}

impl PairFilter<'_> {
    /// Whether the particle of a node, in a `slot`, and a pinned one may collide, which overlap at the start or not.
    pub fn may_collide(&self, node: usize, slot: u32, pinned: u32, overlap: bool) -> bool {
        let memory = self.memory;
        let is_new = || !(memory.has_searched(slot) && memory.has_searched(pinned));
        let overlap_initially =
            || memory.overlap_from_the_start(slot, pinned) || (is_new() && self.sprung.contains(&pinned));
        !(self.excluded.contains(&(node as u32, pinned))
            || Exclusions::are_of_one_family(self.families, slot, pinned)
            || overlap && overlap_initially())
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
    pub fn begin(
        &mut self,
        motion: &Motion,
        (obstacles, surroundings): (&Obstacles, Surroundings),
        filter: &PairFilter,
        least_reach: f64,
    ) {
        let Motion { elimination, particles, start, flight, inertia, h } = *motion;
        self.contacts.clear();
        self.mode = Mode::Step;
        (self.changed, self.has_features, self.has_faces) = (false, false, false);
        self.is_whole_step = false;
        let free = 0..elimination.free;
        let longest = max_displacement(free.clone(), start, flight);
        (self.stiffness, self.passes, self.max_passes) = (STIFFENING, 0, MAX_PASSES);
        (self.published_share, self.goes_on, self.deepest) = (1.0, false, f64::INFINITY);
        self.max_depth = SOFTNESS * longest;
        self.creep = CREEP * h;
        self.reach = least_reach.max(REACH * longest);
        if obstacles.is_empty() {
            return;
        }
        for node in free {
            let slot = elimination.slots[node];
            let radius = f64::from(particles.radius()[slot as usize]);
            let near = (slot as usize, surroundings);
            obstacles.near(
                near,
                start[node],
                radius,
                [self.reach, h],
                |obstacle, [restitution, friction]| {
                    let surface_displacement = h * obstacle.motion_at(start[node]);
                    let path = [start[node], flight[node]];
                    let obstacle =
                        obstacle.met(path, radius).unwrap_or_else(|| obstacle.seen_from(start[node]));
                    // The obstacle is where it is at the end of the step.
                    let (gap, normal) = obstacle.gap(start[node] + surface_displacement, radius);
                    if let Some(pinned) = obstacle.pinned_slot()
                        && (radius == 0.0 || !filter.may_collide(node, slot, pinned as u32, gap < 0.0))
                    {
                        return;
                    }
                    let approach = (surface_displacement - (flight[node] - start[node])).dot(normal) / h;
                    self.contacts.push(Contact {
                        radius,
                        inertia: inertia[node],
                        allowed: (gap + RECOVERY_SPEED * h).min(0.0),
                        origin: start[node] + surface_displacement + h * obstacle.sliding(),
                        approach,
                        normal,
                        restitution,
                        friction,
                        ..Contact::new(node, Partner::Obstacle(obstacle))
                    });
                },
            );
        }
    }

    /// Adds contacts between particles of the island; `node_of` has the nodes of their slots.
    pub fn add_pairs(&mut self, motion: &Motion, pairs: &[StiffPair], node_of: &[u32], rules: PairRules) {
        let Motion { particles, start, flight, inertia, h, .. } = *motion;
        for StiffPair { slots, normal } in pairs {
            let [node, other] = slots.map(|slot| node_of[slot as usize] as usize);
            let [radius, other_radius] = slots.map(|slot| f64::from(particles.radius()[slot as usize]));
            let reach = radius + other_radius;
            let apart = start[node] - start[other];
            let approach = (apart - (flight[node] - flight[other])).dot(*normal) / h;
            let gap = apart.dot(*normal) - reach;
            let partner = Partner::Node { node: other, normal: *normal, reach };
            self.contacts.push(Contact {
                radius,
                inertia: 1.0 / (1.0 / inertia[node] + 1.0 / inertia[other]),
                allowed: (gap + RECOVERY_SPEED * h).min(0.0),
                origin: apart,
                approach,
                normal: *normal,
                restitution: f64::from(rules.restitution),
                friction: f64::from(rules.friction),
                ..Contact::new(node, partner)
            });
        }
    }

    /// Looks for none: nothing is held.
    pub fn clear(&mut self) {
        self.contacts.clear();
        (self.mode, self.changed, self.has_features) = (Mode::Step, false, false);
        self.has_faces = false;
    }

    /// Whether there may be any contact.
    pub fn any(&self) -> bool {
        !self.contacts.is_empty()
    }

    /// Whether anything that was held might rebound.
    pub fn may_rebound(&self) -> bool {
        let may = |contact: &Contact| contact.force > 0.0 && contact.restitution * contact.approach > 0.0;
        self.contacts.iter().any(may)
    }

    /// Whether any contact held in the last linearisation.
    pub fn hold(&self) -> bool {
        self.contacts.iter().any(|contact| contact.force > 0.0)
    }

    /// Whether obstacles were looked for far enough for where the nodes are now; if not, how far they are to be.
    pub fn missing_reach(&self, free: usize, start: &[DVec3], position: &[DVec3]) -> Option<f64> {
        let longest = max_displacement(0..free, start, position);
        (longest > self.reach && longest.is_finite()).then_some(longest)
    }

    /// Number of Newton steps of the next solution, at most.
    pub fn max_steps(&self) -> usize {
        let is_last = !self.any() || self.passes + 1 >= self.max_passes;
        match is_last {
            true if self.max_passes == MAX_SURFACE_PASSES => MAX_SURFACE_STEPS,
            false if !self.has_features => STEPS_OF_A_PASS,
            _ => MAX_STEPS,
        }
    }

    /// To be called after each solution: whether another one is due, with stiffer contacts, new friction, or to come close enough.
    pub fn refine(&mut self, position: &[DVec3], is_solved: bool) -> bool {
        self.passes += 1;
        for contact in &mut self.contacts {
            let normal = contact.press(position, self.stiffness);
            if !self.has_faces {
                contact.rub(position, normal, self.creep);
            }
        }
        let mut deepest = 0.0_f64;
        // Of the limits of friction: how far they are from those that this solution went by, and their sum, N.
        let (mut change, mut sum) = (0.0, 0.0);
        for contact in &self.contacts {
            change += contact.friction * (contact.force - contact.lagged).abs();
            sum += contact.friction * contact.force;
            if contact.force > 0.0 && !matches!(contact.partner, Partner::Surface { .. }) {
                deepest = deepest.max(contact.depth.abs());
            }
        }
        let rubs = match self.has_faces {
            true => sum > 0.0 && self.passes <= FACE_FRICTION_PASSES,
            false => change > FRICTION_TOLERANCE * sum,
        };
        for contact in &mut self.contacts {
            contact.lagged = contact.force;
            // Many contacts of surfaces do the same: which of them hold is not found to the last one.
            if is_solved && !matches!(contact.partner, Partner::Surface { .. }) {
                contact.multiplier = contact.force;
            }
        }
        let mut any_harder = false;
        if self.passes < MAX_HARDENING_PASSES {
            for contact in &mut self.contacts {
                any_harder |= contact.harden();
            }
        }
        let is_deep = match self.has_features {
            true => is_solved && self.stiffen(),
            false if self.has_faces => deepest > self.max_depth,
            false => deepest > REST * self.max_depth,
        };
        // The forces of the solution before take most of the depth away, if K is great enough.
        let is_soft = self.has_faces || (is_solved && deepest > MAX_REST * self.deepest);
        if is_deep && !self.has_features && is_soft {
            self.stiffness *= GROWTH;
        }
        if is_solved {
            self.deepest = deepest;
        }
        let max_passes = if self.goes_on && !is_solved { MAX_PASSES } else { self.max_passes };
        let of_features = self.has_features && max_passes == MAX_PASSES;
        let max_passes = if of_features { MAX_FEATURE_PASSES } else { max_passes };
        let is_due = is_deep || !is_solved || rubs;
        any_harder || (is_due && self.any() && self.passes < max_passes)
    }

    /// The energy at these positions, J.
    pub fn energy(&self, position: &[DVec3]) -> f64 {
        self.contacts.iter().map(|contact| contact.energy(position, self.stiffness, self.creep)).sum()
    }

    /// Adds forces and stiffness of the contacts at the present positions to those of the nodes; their energy in J. `start` is where
    /// the nodes were when the step began.
    pub fn linearise(&mut self, [position, start]: [&[DVec3]; 2], mut sums: Sums) -> f64 {
        let Self { contacts, stiffness, creep, mode, changed, is_whole_step, has_faces, .. } = self;
        let approach = Approach {
            stiffness: *stiffness,
            creep: *creep,
            is_whole_step: *is_whole_step,
            has_faces: *has_faces,
        };
        *changed = false;
        let mut energy = 0.0;
        for contact in contacts {
            if *mode == Mode::Rebound {
                contact.send_back(*stiffness, &mut sums);
                continue;
            }
            contact.follow(position, start);
            let (was_held, friction) = (contact.force > 0.0, contact.friction_state);
            energy += contact.linearise(position, approach, &mut sums);
            *changed |= was_held != (contact.force > 0.0) || friction.differs(contact.friction_state);
        }
        energy
    }

    /// Prepares the next linearisation for the rebound in a step of `h` seconds; whether anything rebounds: what would
    /// do so faster than `resting_speed`, m/s, and than what `pull` gives it in the step, the force of the elements on
    /// each node at its start, N.
    pub fn begin_rebound(&mut self, position: &[DVec3], pull: &[DVec3], resting_speed: f64, h: f64) -> bool {
        let mut any = false;
        for contact in self.contacts.iter_mut().filter(|contact| contact.force > 0.0) {
            let speed = contact.restitution * contact.approach;
            let resting_speed = resting_speed + contact.pressing_speed(pull, h);
            // The step has brought it to the surface.
            let left = -contact.displacement(position).dot(contact.normal);
            contact.rebound = if speed > resting_speed { h * speed + left } else { 0.0 };
            any |= contact.rebound > 0.0;
        }
        if any {
            self.mode = Mode::Rebound;
        }
        any
    }
}

/// The longest displacement of a node, m.
pub(super) fn max_displacement(nodes: Range<usize>, start: &[DVec3], end: &[DVec3]) -> f64 {
    nodes.map(|node| end[node].distance_squared(start[node])).fold(0.0, f64::max).sqrt()
}
