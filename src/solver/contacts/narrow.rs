//! Narrow phase: which of the pairs that may touch do, and how.

use bevy::math::Vec3A;

use crate::solver::particles::Vectors;

use super::bodies::Body;
use super::candidates::Candidates;
use super::list::{Candidate, Past};
use super::pairs::{Impulses, PairContact, PairContacts};
use super::response::{Approach, Rebound};

/// So many pairs are looked at before the near ones among them are looked at closely.
const BLOCK: usize = 256;

/// How steep a contact must be, as the cosine to the vertical, to support the upper particle.
const STEEPEST_SUPPORT: f32 = 0.2;

/// What all pairs are looked at with.
struct Search<'a> {
    slot_of: &'a [u32],
    acceleration: &'a Vectors,
    rebound: Rebound,
    up: Vec3A,
    last: &'a [PairContact],
}

/// Finds the touching pairs among the candidates, in each group from the bottom up, with the impulses that
/// they had in the substep before; and finds out who rests on whom.
pub(super) fn find(
    candidates: &mut Candidates,
    bodies: &mut [Body],
    acceleration: &Vectors,
    rebound: Rebound,
    up: Vec3A,
    contacts: &mut PairContacts,
) {
    let (pairs, groups, regions) = candidates.pairs();
    contacts.turn(pairs.len());
    let PairContacts { room, last } = contacts;
    let search = Search { slot_of: &regions.slot_of, acceleration, rebound, up, last };
    groups.for_each((pairs, &mut room[..]), bodies, |group, (pairs, room), bodies| {
        group.contacts = 0;
        for pairs in pairs.chunks_mut(BLOCK) {
            search.look_at(pairs, group.bodies.start, bodies, |contact| {
                room[group.contacts] = contact;
                group.contacts += 1;
                Past::Contact((group.pairs.start + group.contacts - 1) as u32)
            });
        }
    });
}

impl Search<'_> {
    /// Finds the contacts among a few pairs of bodies that begin with the number `start`. `keep` takes each,
    /// and tells what to remember of it.
    fn look_at(
        &self,
        pairs: &mut [Candidate],
        start: usize,
        bodies: &mut [Body],
        mut keep: impl FnMut(PairContact) -> Past,
    ) {
        // Without a branch: about half of the pairs are near, no processor could guess which.
        let (mut near, mut count) = ([(0, Past::Apart); BLOCK], 0);
        for (place, pair) in pairs.iter_mut().enumerate() {
            let [first, second] = places(pair, start);
            let (upper, lower) = (&bodies[first], &bodies[second]);
            let most = upper.radius + lower.radius + self.rebound.slop;
            let is_near = (upper.position - lower.position).length_squared() <= most * most;
            near[count] = (place as u32, std::mem::replace(&mut pair.past, Past::Apart));
            count += usize::from(is_near);
        }
        for (place, past) in &near[..count] {
            let pair = &mut pairs[*place as usize];
            let ends = places(pair, start);
            let impulses = match *past {
                Past::Entangled if overlap(ends.map(|end| &bodies[end])) => {
                    pair.past = Past::Entangled;
                    continue;
                }
                Past::Contact(place) => self.last[place as usize].impulses,
                _ => Impulses::default(),
            };
            if let Some(contact) = self.contact(ends, start, impulses, bodies) {
                pair.past = keep(contact);
            }
        }
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
        let Self { slot_of, acceleration, rebound, up, .. } = self;
        let (upper, lower) = (&bodies[first], &bodies[second]);
        let reach = upper.radius + lower.radius;
        let separation = upper.position - lower.position;
        let distance = separation.length();
        let normal = direction(separation, distance);
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
        let supports = lower.supported && normal.dot(*up) > STEEPEST_SUPPORT;
        bodies[first].supported |= supports;
        bodies[first].holds += u32::from(resting);
        bodies[second].holds += u32::from(resting);
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

/// Whether two bodies overlap or touch.
fn overlap([one, other]: [&Body; 2]) -> bool {
    let reach = one.radius + other.radius;
    (one.position - other.position).length_squared() <= reach * reach
}

/// The unit vector along `separation`; +Y for two particles in the same place.
fn direction(separation: Vec3A, distance: f32) -> Vec3A {
    if distance == 0.0 { Vec3A::Y } else { separation / distance }
}
