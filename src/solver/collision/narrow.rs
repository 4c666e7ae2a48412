//! Narrow phase: which of the pairs that may touch do, and how.

use bevy::math::Vec3A;

use crate::solver::particles::Vectors;

use super::bodies::Body;
use super::candidates::Candidates;
use super::list::{Candidate, List, PairHistory};
use super::material::{ContactProperties, properties_of};
use super::pairs::{Impulses, PairContact, PairContacts};
use super::response::{Approach, Rebound};

/// Number of pairs of which the near ones are sorted out before they are examined.
const PAIRS_PER_CHUNK: usize = 256;

/// The cosine of the angle between normal and vertical from which on a contact supports the upper particle.
const MIN_SUPPORT_COSINE: f32 = 0.2;

/// What the examination of all pairs reads.
struct Search<'a> {
    slot_of: &'a [u32],
    acceleration: &'a Vectors,
    rebound: Rebound,
    up: Vec3A,
    /// Whether all motion is in a plane of constant z.
    is_flat: bool,
    last: &'a [PairContact],
    properties: &'a [ContactProperties],
    /// Whether an implicit step has moved any of the particles.
    any_implicit: bool,
}

/// Finds the touching pairs among the candidates, in each group from the bottom up, with the impulses that
/// they had in the substep before; and which bodies rest on which.
pub(super) fn find(
    candidates: &mut Candidates,
    bodies: &mut [Body],
    (acceleration, properties): (&Vectors, &[ContactProperties]),
    rebound: Rebound,
    (up, is_flat, any_implicit): (Vec3A, bool, bool),
    contacts: &mut PairContacts,
) {
    let Candidates { list: List { pairs, .. }, groups, regions, .. } = candidates;
    contacts.swap_buffers(pairs.len());
    let PairContacts { current, last } = contacts;
    let slot_of = &regions.slot_of;
    let search = Search { slot_of, acceleration, rebound, up, is_flat, last, properties, any_implicit };
    groups.for_each((&mut pairs[..], &mut current[..]), bodies, |group, (pairs, contacts), bodies| {
        (group.contacts, group.any_initial_overlaps) = (0, false);
        for pairs in pairs.chunks_mut(PAIRS_PER_CHUNK) {
            group.any_initial_overlaps |=
                search.find_contacts(pairs, group.bodies.start, bodies, |contact| {
                    contacts[group.contacts] = contact;
                    group.contacts += 1;
                    PairHistory::Contact((group.pairs.start + group.contacts - 1) as u32)
                });
        }
    });
}

impl Search<'_> {
    /// Finds the contacts among a few pairs of bodies that begin with the number `start`; whether any
    /// overlap from the start. `keep` takes each contact, and returns what to remember of it.
    fn find_contacts(
        &self,
        pairs: &mut [Candidate],
        start: usize,
        bodies: &mut [Body],
        mut keep: impl FnMut(PairContact) -> PairHistory,
    ) -> bool {
        // Without a branch: about half of the pairs are near, no processor could guess which.
        let (mut near, mut count) = ([(0, PairHistory::Apart); PAIRS_PER_CHUNK], 0);
        for (place, pair) in pairs.iter_mut().enumerate() {
            let [first, second] = places(pair, start);
            let (upper, lower) = (&bodies[first], &bodies[second]);
            let reach = upper.radius + lower.radius + self.rebound.slop;
            let is_near = (upper.position - lower.position).length_squared() <= reach * reach;
            near[count] = (place as u32, std::mem::replace(&mut pair.history, PairHistory::Apart));
            count += usize::from(is_near);
        }
        let mut any_initial_overlaps = false;
        for (place, history) in &near[..count] {
            let pair = &mut pairs[*place as usize];
            let ends = places(pair, start);
            let impulses = match *history {
                PairHistory::InitialOverlap if overlap(ends.map(|end| &bodies[end])) => {
                    pair.history = PairHistory::InitialOverlap;
                    any_initial_overlaps = true;
                    continue;
                }
                _ if self.any_implicit && solved_elsewhere(ends.map(|end| &bodies[end])) => continue,
                _ if !self.may_meet(ends, start) => continue,
                PairHistory::Contact(place) => self.last[place as usize].impulses,
                _ => Impulses::default(),
            };
            if let Some(contact) = self.contact(ends, start, impulses, bodies) {
                pair.history = keep(contact);
            }
        }
        any_initial_overlaps
    }

    /// Whether the layers of two bodies let them touch.
    #[inline]
    fn may_meet(&self, ends: [usize; 2], start: usize) -> bool {
        if self.properties.is_empty() {
            return true;
        }
        let [one, other] =
            ends.map(|place| properties_of(self.properties, self.slot_of[place + start] as usize).layers);
        one.meet(other)
    }

    /// The contact of two bodies, if they touch.
    #[inline(always)]
    fn contact(
        &self,
        [first, second]: [usize; 2],
        start: usize,
        impulses: Impulses,
        bodies: &mut [Body],
    ) -> Option<PairContact> {
        let Self { slot_of, acceleration, rebound, up, is_flat, .. } = self;
        let (upper, lower) = (&bodies[first], &bodies[second]);
        let reach = upper.radius + lower.radius;
        let separation = upper.position - lower.position;
        let distance = separation.length();
        let normal = match distance > 0.0 {
            true => separation / distance,
            false => direction([first, second].map(|place| slot_of[place + start]), *is_flat),
        };
        let velocity = (upper.velocity - lower.velocity).dot(normal);
        let mut target_velocity = 0.0;
        if velocity < 0.0 {
            let [first, second] =
                [first, second].map(|place| acceleration.get(slot_of[place + start] as usize));
            let acceleration = Vec3A::from(first - second).dot(normal);
            let depth = (reach - distance).max(0.0);
            target_velocity = rebound.velocity_after(Approach { velocity, acceleration, depth });
        }
        let resting = target_velocity == 0.0 && velocity.abs() < 2.0 * rebound.resting_speed;
        if distance > reach && !resting {
            return None;
        }
        let reduced_mass = 1.0 / (upper.inverse_mass + lower.inverse_mass);
        let sprung = upper.sprung || lower.sprung;
        let rise = normal.dot(*up);
        let supports = lower.supported && rise > MIN_SUPPORT_COSINE;
        let carries = lower.carried && rise > 0.0;
        bodies[first].supported |= supports;
        bodies[first].carried |= carries;
        for body in [first, second] {
            let body = &mut bodies[body];
            body.holds = body.holds.saturating_add(u8::from(resting));
            body.touching = body.touching.saturating_add(1);
        }
        Some(PairContact {
            first: first as u32,
            second: second as u32,
            normal,
            target_velocity,
            reduced_mass,
            impulses,
            resting,
            supports,
            sprung,
        })
    }
}

/// The upper and the lower one of a pair among the bodies that begin with the number `start`.
#[inline(always)]
fn places(pair: &Candidate, start: usize) -> [usize; 2] {
    [pair.upper, pair.lower].map(|body| body as usize - start)
}

/// Whether their contact is a part of an implicit step.
fn solved_elsewhere([one, other]: [&Body; 2]) -> bool {
    // Of others only the particles of nets that an explicit scheme advances are left.
    let is_soft = |body: &Body| body.sprung && !body.implicit && body.inverse_mass > 0.0;
    let is_solved = |one: &Body, other: &Body| one.implicit && !is_soft(other);
    is_solved(one, other) || is_solved(other, one)
}

/// Whether two bodies overlap or touch.
fn overlap([one, other]: [&Body; 2]) -> bool {
    let reach = one.radius + other.radius;
    (one.position - other.position).length_squared() <= reach * reach
}

/// A unit vector for two particles in the same place, from the second to the first: it follows from their slots, and
/// many in one place come apart in all directions, or, where `is_flat`, in all of the plane of x and y.
fn direction([first, second]: [u32; 2], is_flat: bool) -> Vec3A {
    let mut bits = first.min(second).wrapping_mul(0x9E37_79B9) ^ first.max(second).wrapping_mul(0x85EB_CA6B);
    let mut coordinate = || {
        // A step of the hash by Wang, *Integer hash function*, 2007.
        bits = (bits ^ 61 ^ (bits >> 16)).wrapping_mul(9);
        bits = (bits ^ (bits >> 4)).wrapping_mul(0x27D4_EB2D);
        bits ^= bits >> 15;
        // Never zero, so that neither is the vector.
        (bits >> 8) as f32 + 0.5 - (1 << 23) as f32
    };
    let [x, y, z] = [coordinate(), coordinate(), coordinate()];
    let direction = Vec3A::new(x, y, if is_flat { 0.0 } else { z }).normalize();
    if first < second { direction } else { -direction }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_of_coincident_pairs_are_opposite_and_spread() {
        for is_flat in [false, true] {
            check_directions(is_flat);
        }
    }

    fn check_directions(is_flat: bool) {
        let mut sum = Vec3A::ZERO;
        for slot in 1..4000 {
            let normal = direction([0, slot], is_flat);
            assert_eq!(normal, -direction([slot, 0], is_flat));
            assert!(!is_flat || normal.z == 0.0);
            assert!((normal.length() - 1.0).abs() < 1e-6);
            sum += normal;
        }
        // A random walk of 4000 steps ends 63 from its start, hardly ever three times as far.
        assert!(sum.length() < 200.0, "{sum}");
    }
}
