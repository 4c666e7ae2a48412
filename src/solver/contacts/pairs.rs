//! Particles against particles: finding the touching pairs and solving them.
//!
//! Velocities are solved by sequential impulses: each contact in turn is given the impulse that
//! brings its normal velocity to the wanted one, for a few rounds, starting from the impulses of the
//! substep before (Catto, *Iterative dynamics with temporal coherence*, 2005). One contact alone comes
//! out exactly as the formula of an impact of two bodies says; the start from the last impulses is what
//! lets a pile rest. What the few rounds leave undone would let a high pile sink into itself: a last
//! pass from the bottom up, in which what is supported from below does not give way, removes it
//! (shock propagation: Guendelman, Bridson and Fedkiw, *Nonconvex rigid bodies with stacking*, 2003).
//!
//! In a pair the first particle is the upper, the second the lower one.

use bevy::math::Vec3A;

use crate::solver::blocks;
use crate::solver::particles::Vectors;

use super::PairRules;
use super::bodies::Body;
use super::candidates::{Candidate, Candidates, Near, Past};
use super::response::{Approach, Rebound, friction, shortened, tangential};

/// The impulses that a contact has given.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Impulses {
    /// Normal impulse, N·s, >= 0.
    pub normal: f32,
    /// Friction impulse, N·s.
    pub friction: Vec3A,
}

/// A pair that touches.
#[derive(Debug, Clone, Copy)]
pub(super) struct PairContact {
    first: u32,
    second: u32,
    /// From the second to the first.
    pub normal: Vec3A,
    target_velocity: f32,
    /// 1 / (1/m1 + 1/m2), kg.
    reduced_mass: f32,
    pub impulses: Impulses,
    /// Whether the pair rests: its impulses are a load, and displace it as any force does.
    resting: bool,
    /// Whether the lower particle carries the upper one and cannot give way.
    supports: bool,
    /// Whether springs pull at either.
    sprung: bool,
}

impl PairContact {
    /// The slot of the upper particle.
    #[inline]
    pub fn first(&self) -> usize {
        self.first as usize
    }

    /// The slot of the lower particle.
    #[inline]
    pub fn second(&self) -> usize {
        self.second as usize
    }

    /// The upper and the lower particle.
    #[inline(always)]
    fn both<'a>(&self, bodies: &'a mut [Body]) -> [&'a mut Body; 2] {
        bodies.get_disjoint_mut([self.first(), self.second()]).expect("a pair is of two particles")
    }

    /// Gives both their impulse. If the pair rests, the impulse also takes back what the load displaced
    /// in this substep: velocity · `reach`, s (see [`Scheme::displacement_share`]).
    ///
    /// [`Scheme::displacement_share`]: crate::solver::Scheme::displacement_share
    #[inline(always)]
    fn apply(&self, impulse: Vec3A, [first, second]: [&mut Body; 2], reach: f32) {
        let first_change = impulse * first.inverse_mass;
        let second_change = impulse * -second.inverse_mass;
        first.velocity += first_change;
        second.velocity += second_change;
        if self.resting {
            first.position += first_change * reach;
            second.position += second_change * reach;
        }
    }
}

/// The unit vector along `separation`; +Y for two particles in the same place.
fn direction(separation: Vec3A, distance: f32) -> Vec3A {
    if distance == 0.0 { Vec3A::Y } else { separation / distance }
}

/// So many pairs are looked at as one part, and from so many parts on they are shared among threads.
const BLOCK: usize = 4096;
const WORTH_SHARING: usize = 4;

/// Lists in `near` the places of the pairs that are at most `slop` m apart; the others have no past.
fn look_near(pairs: &mut [Candidate], bodies: &[Body], slop: f32, near: &mut Near) {
    near.places.resize(pairs.len(), 0);
    near.counts.resize(pairs.len().div_ceil(BLOCK), 0);
    let parallel = near.counts.len() >= WORTH_SHARING;
    let parts = pairs.chunks_mut(BLOCK).zip(near.places.chunks_mut(BLOCK)).zip(&mut near.counts).enumerate();
    blocks::for_each(parts, parallel, |(block, ((pairs, places), count))| {
        // Without a branch: about half of the pairs are near, no processor could guess which.
        *count = 0;
        for (offset, pair) in pairs.iter_mut().enumerate() {
            let (upper, lower) = (&bodies[pair.upper as usize], &bodies[pair.lower as usize]);
            let most = upper.radius + lower.radius + slop;
            let is_near = (upper.position - lower.position).length_squared() <= most * most;
            places[*count] = (block * BLOCK + offset) as u32;
            *count += usize::from(is_near);
            pair.past = if is_near { pair.past } else { Past::Apart };
        }
    });
}

/// Finds the touching pairs among the candidates, from the bottom up, with the impulses that they had in
/// `last`, the contacts of the substep before; and finds out who rests on whom.
pub(super) fn find(
    candidates: &mut Candidates,
    bodies: &mut [Body],
    acceleration: &Vectors,
    rebound: Rebound,
    up: Vec3A,
    last: &[PairContact],
    found: &mut Vec<PairContact>,
) {
    found.clear();
    let (pairs, joints, near) = candidates.pairs();
    look_near(pairs, bodies, rebound.slop, near);
    let places = near.places.chunks(BLOCK).zip(&near.counts).flat_map(|(places, count)| &places[..*count]);
    for place in places {
        let candidate = &mut pairs[*place as usize];
        let past = std::mem::replace(&mut candidate.past, Past::Apart);
        let (first, second) = (candidate.upper as usize, candidate.lower as usize);
        let (upper, lower) = (&bodies[first], &bodies[second]);
        let reach = upper.radius + lower.radius;
        let separation = upper.position - lower.position;
        let squared = separation.length_squared();
        if past == Past::Entangled && squared <= reach * reach {
            candidate.past = Past::Entangled;
            continue;
        }
        let distance = squared.sqrt();
        let normal = direction(separation, distance);
        let approach = Approach {
            velocity: (upper.velocity - lower.velocity).dot(normal),
            acceleration: Vec3A::from(acceleration.get(first) - acceleration.get(second)).dot(normal),
            depth: (reach - distance).max(0.0),
        };
        let target_velocity = rebound.least_velocity_after(approach);
        let resting = target_velocity == 0.0 && approach.velocity.abs() < 2.0 * rebound.resting_speed;
        if distance > reach && !resting {
            continue;
        }
        let reduced_mass = 1.0 / (upper.inverse_mass + lower.inverse_mass);
        let supported = lower.supported && normal.dot(up) > STEEPEST_SUPPORT;
        bodies[first].supported |= supported;
        bodies[first].holds += u32::from(resting);
        bodies[second].holds += u32::from(resting);
        candidate.past = Past::Contact(found.len() as u32);
        found.push(PairContact {
            first: candidate.upper,
            second: candidate.lower,
            normal,
            target_velocity,
            reduced_mass,
            impulses: match past {
                Past::Contact(index) => last[index as usize].impulses,
                _ => Impulses::default(),
            },
            resting,
            supports: supported,
            sprung: joints.is_sprung(first) || joints.is_sprung(second),
        });
    }
}

/// Applies the impulses of the last substep.
pub(super) fn warm_start(contacts: &mut [PairContact], bodies: &mut [Body], reach: f32) {
    for contact in contacts {
        // The normal has turned a little since: keep what is tangential to it now.
        contact.impulses.friction = tangential(contact.impulses.friction, contact.normal);
        let impulse = contact.normal * contact.impulses.normal + contact.impulses.friction;
        contact.apply(impulse, contact.both(bodies), reach);
    }
}

/// One round over all contacts. Velocities along resting contacts are left alone up to `tolerance`, m/s.
/// Returns whether any had to be corrected.
pub(super) fn solve_velocities(
    contacts: &mut [PairContact],
    rules: PairRules,
    bodies: &mut [Body],
    reach: f32,
    tolerance: f32,
) -> bool {
    let mut corrected = false;
    for contact in contacts {
        let [first, second] = contact.both(bodies);
        let relative = first.velocity - second.velocity;
        let old = contact.impulses;
        let missing = contact.target_velocity - relative.dot(contact.normal);
        if missing <= 0.0 && old.normal == 0.0 {
            continue;
        }
        let error = if rules.friction > 0.0 { relative.length_squared() } else { missing * missing };
        if contact.resting && error < tolerance * tolerance {
            continue;
        }
        contact.impulses.normal = (old.normal + missing * contact.reduced_mass).max(0.0);
        let mut change = contact.normal * (contact.impulses.normal - old.normal);
        if rules.friction > 0.0 {
            let sticking = old.friction - tangential(relative, contact.normal) * contact.reduced_mass;
            let limit = rules.friction * contact.impulses.normal;
            contact.impulses.friction = shortened(sticking, limit);
            change += contact.impulses.friction - old.friction;
        }
        corrected = true;
        contact.apply(change, [first, second], reach);
    }
    corrected
}

/// The part of its overlap that a resting pair in a pile is separated by in each round: it shares its
/// particles with others, which would be hit by the whole correction.
const RESTING_CORRECTION: f32 = 0.5;

/// The overlap that a resting pair in a pile may keep, as a part of its reach.
const RESTING_OVERLAP: f32 = 0.001;

/// The part of an older overlap that a pair on springs is separated by in each round. To separate it
/// lifts the springs that press it together; whatever is more than undoing its approach in this substep
/// would give them energy that nobody pays for.
const SPRUNG_CORRECTION: f32 = 0.01;

/// Separates overlapping pairs, the lighter particle moving more; static friction takes both back to
/// where they stuck.
pub(super) fn solve_positions(contacts: &[PairContact], rules: PairRules, bodies: &mut [Body]) {
    for contact in contacts {
        let [first, second] = contact.both(bodies);
        let reach = first.radius + second.radius;
        // The normal stays as it was found: who is lifted past the centre of the next is still below it.
        let depth = reach - (first.position - second.position).dot(contact.normal);
        let shared = contact.resting && first.holds + second.holds > 2;
        let (most, part) = if shared { (RESTING_OVERLAP * reach, RESTING_CORRECTION) } else { (0.0, 1.0) };
        if depth <= most {
            continue;
        }
        let mut depth = part * (depth - most);
        if contact.sprung {
            let approached = (second.moved() - first.moved()).dot(contact.normal);
            depth = depth.min(approached + SPRUNG_CORRECTION * depth);
            if depth <= 0.0 {
                continue;
            }
        }
        let mut correction = contact.normal * depth;
        if rules.friction > 0.0 {
            let slip = tangential(first.moved() - second.moved(), contact.normal);
            correction += friction(slip, rules.friction * depth);
        }
        let correction = correction * contact.reduced_mass;
        first.position += correction * first.inverse_mass;
        second.position -= correction * second.inverse_mass;
    }
}

/// How steep a contact must be, as the cosine to the vertical, to support the upper particle.
const STEEPEST_SUPPORT: f32 = 0.2;

/// Stops what still sinks onto something supported.
pub(super) fn stop_sinking(contacts: &[PairContact], bodies: &mut [Body]) {
    for contact in contacts.iter().filter(|contact| contact.supports) {
        let [upper, lower] = contact.both(bodies);
        let approach = (upper.velocity - lower.velocity).dot(contact.normal);
        if approach < 0.0 && upper.inverse_mass > 0.0 {
            upper.velocity -= contact.normal * approach;
        }
    }
}
