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

use crate::solver::particles::Vectors;

use super::PairRules;
use super::bodies::Body;
use super::candidates::Candidates;
use super::list::{Candidate, Past};
use super::regions::{Group, Groups};
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
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct PairContact {
    /// Their places among the bodies of the group.
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
    /// The upper particle's place among the bodies of the group.
    #[inline]
    pub fn first(&self) -> usize {
        self.first as usize
    }

    /// The lower particle's place among the bodies of the group.
    #[inline]
    pub fn second(&self) -> usize {
        self.second as usize
    }

    /// The upper and the lower particle.
    #[inline(always)]
    fn both<'a>(&self, bodies: &'a mut [Body]) -> [&'a mut Body; 2] {
        bodies.get_disjoint_mut([self.first(), self.second()]).expect("a pair is of two particles")
    }

    /// All that it gives the first particle, N·s.
    #[inline(always)]
    fn impulse(&self) -> Vec3A {
        self.normal * self.impulses.normal + self.impulses.friction
    }

    /// Gives both their impulse.
    #[inline(always)]
    fn apply(impulse: Vec3A, [first, second]: [&mut Body; 2]) {
        first.velocity += impulse * first.inverse_mass;
        second.velocity -= impulse * second.inverse_mass;
    }
}

/// The unit vector along `separation`; +Y for two particles in the same place.
fn direction(separation: Vec3A, distance: f32) -> Vec3A {
    if distance == 0.0 { Vec3A::Y } else { separation / distance }
}

/// So many pairs are looked at before the near ones among them are looked at closely.
const BLOCK: usize = 256;

/// The contacts, in the order of the candidates: each group has as much room as it has pairs.
#[derive(Debug, Clone, Default)]
pub(super) struct PairContacts {
    room: Vec<PairContact>,
    /// Those of the substep before.
    last: Vec<PairContact>,
}

impl PairContacts {
    /// Makes the contacts the last ones, and room for `pairs` new ones.
    fn turn(&mut self, pairs: usize) {
        std::mem::swap(&mut self.room, &mut self.last);
        if self.room.len() < pairs {
            self.room.resize(pairs, PairContact::default());
        }
    }

    /// The contacts of a group.
    pub fn of(&self, group: &Group) -> &[PairContact] {
        &self.room[group.pairs.start..][..group.contacts]
    }

    /// Calls `work` for the contacts of each group.
    fn for_each_group(
        &mut self,
        groups: &mut Groups,
        bodies: &mut [Body],
        work: impl Fn(&mut Group, &mut [PairContact], &mut [Body]) + Sync,
    ) {
        groups.for_each(&mut self.room[..], bodies, |group, room, bodies| {
            let count = group.contacts;
            work(group, &mut room[..count], bodies);
        });
    }
}

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

/// Applies the impulses of the last substep.
pub(super) fn warm_start(contacts: &mut PairContacts, groups: &mut Groups, bodies: &mut [Body]) {
    contacts.for_each_group(groups, bodies, |_, contacts, bodies| {
        for contact in contacts {
            // The normal has turned a little since: keep what is tangential to it now.
            contact.impulses.friction = tangential(contact.impulses.friction, contact.normal);
            PairContact::apply(contact.impulse(), contact.both(bodies));
        }
    });
}

/// One round over all contacts. Velocities along resting contacts are left alone up to `tolerance`, m/s.
/// Returns whether any had to be corrected.
pub(super) fn solve_velocities(
    contacts: &mut PairContacts,
    groups: &mut Groups,
    rules: PairRules,
    bodies: &mut [Body],
    tolerance: f32,
) -> bool {
    contacts.for_each_group(groups, bodies, |group, contacts, bodies| {
        group.corrected = correct_velocities(contacts, rules, bodies, tolerance);
    });
    groups.were_corrected()
}

fn correct_velocities(
    contacts: &mut [PairContact],
    rules: PairRules,
    bodies: &mut [Body],
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
        PairContact::apply(change, [first, second]);
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
pub(super) fn solve_positions(
    contacts: &mut PairContacts,
    groups: &mut Groups,
    rules: PairRules,
    bodies: &mut [Body],
) {
    contacts.for_each_group(groups, bodies, |_, contacts, bodies| separate(contacts, rules, bodies));
}

fn separate(contacts: &[PairContact], rules: PairRules, bodies: &mut [Body]) {
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

/// Ends the rounds over the velocities. Impulses of resting pairs are a load, which displaced them in this
/// substep as any force does: velocity · `reach`, s (see [`Scheme::displacement_share`]); this is taken back.
/// And what still sinks onto something supported is stopped.
///
/// [`Scheme::displacement_share`]: crate::solver::Scheme::displacement_share
pub(super) fn finish_velocities(
    contacts: &mut PairContacts,
    groups: &mut Groups,
    bodies: &mut [Body],
    reach: f32,
) {
    contacts.for_each_group(groups, bodies, |_, contacts, bodies| {
        for contact in contacts {
            let [upper, lower] = contact.both(bodies);
            if contact.resting {
                let impulse = contact.impulse() * reach;
                upper.position += impulse * upper.inverse_mass;
                lower.position -= impulse * lower.inverse_mass;
            }
            let approach = (upper.velocity - lower.velocity).dot(contact.normal);
            if contact.supports && approach < 0.0 && upper.inverse_mass > 0.0 {
                upper.velocity -= contact.normal * approach;
            }
        }
    });
}
