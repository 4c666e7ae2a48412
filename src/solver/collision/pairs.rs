//! Particles against particles: solving the touching pairs.
//!
//! Velocities are solved by sequential impulses: one contact after the other is given the impulse that
//! brings its normal velocity to the wanted one, for a few iterations, starting from the impulses of the
//! substep before (Catto, *Iterative dynamics with temporal coherence*, 2005). One contact alone comes
//! out exactly as the formula of an impact of two bodies says; the warm start from the last impulses is what
//! lets a pile rest. What the few iterations leave undone would let a high pile sink into itself: a last
//! pass from the bottom up, in which what is supported from below does not give way, removes it
//! (shock propagation: Guendelman, Bridson and Fedkiw, *Nonconvex rigid bodies with stacking*, 2003).
//!
//! In a pair the first particle is the upper, the second the lower one.

use bevy::math::{Vec3, Vec3A};

use super::bodies::Body;
use super::regions::{Group, Groups};
use super::response::{friction, shortened, tangential};
use crate::solver::settings::PairRules;

/// The impulses that a contact has given.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Impulses {
    /// Normal impulse, N·s, >= 0.
    pub normal: f32,
    /// Friction impulse on the upper particle, N·s.
    pub friction: Vec3,
}

impl Impulses {
    /// The same where the other particle counts as the upper one.
    pub fn of_other(self) -> Self {
        Self { normal: self.normal, friction: -self.friction }
    }
}

/// A pair that touches, in one cache line.
#[derive(Debug, Clone, Copy, Default)]
#[repr(align(64))]
pub(super) struct PairContact {
    /// Their places among the bodies of the group.
    pub first: u32,
    pub second: u32,
    /// From the second to the first.
    pub normal: Vec3A,
    pub target_velocity: f32,
    /// 1 / (1/m1 + 1/m2), kg.
    pub reduced_mass: f32,
    pub impulses: Impulses,
    /// Whether the pair rests: its impulses are a load, and displace it as any force does.
    pub resting: bool,
    /// Whether the lower particle carries the upper one and cannot give way.
    pub supports: bool,
    /// Whether springs pull at either.
    pub sprung: bool,
}

/// Piles read and write all contacts several times in a substep.
const _: () = assert!(size_of::<PairContact>() == 64);

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
        self.normal * self.impulses.normal + Vec3A::from(self.impulses.friction)
    }

    /// Whether it rests without slipping; what does not press neither holds nor pushes.
    #[inline(always)]
    fn sticks(&self, rules: PairRules) -> bool {
        let limit = STICKING_SHARE * rules.friction * self.impulses.normal;
        let presses = self.impulses.normal > 0.0;
        self.resting && (!presses || self.impulses.friction.length_squared() < limit * limit)
    }

    /// Gives both their impulse.
    #[inline(always)]
    fn apply(impulse: Vec3A, [first, second]: [&mut Body; 2]) {
        first.velocity += impulse * first.inverse_mass;
        second.velocity -= impulse * second.inverse_mass;
    }
}

/// The contacts, in the order of the candidates. Those of a group begin where its pairs begin.
#[derive(Debug, Clone, Default)]
pub(super) struct PairContacts {
    pub current: Vec<PairContact>,
    /// Those of the substep before.
    pub last: Vec<PairContact>,
}

impl PairContacts {
    /// Makes the contacts the last ones, with capacity for those of `pairs` pairs in their stead.
    pub fn swap_buffers(&mut self, pairs: usize) {
        std::mem::swap(&mut self.current, &mut self.last);
        self.reserve(pairs);
    }

    /// Makes the buffer large enough for the contacts of `pairs` pairs.
    pub fn reserve(&mut self, pairs: usize) {
        if self.current.len() < pairs {
            self.current.resize(pairs, PairContact::default());
        }
    }

    /// The contacts of a group.
    pub fn of(&self, group: &Group) -> &[PairContact] {
        &self.current[group.pairs.start..][..group.contacts]
    }

    /// The same, to be changed.
    pub fn of_mut(&mut self, group: &Group) -> &mut [PairContact] {
        &mut self.current[group.pairs.start..][..group.contacts]
    }

    /// Calls `work` for the contacts of each group.
    fn for_each_group(
        &mut self,
        groups: &mut Groups,
        bodies: &mut [Body],
        work: impl Fn(&mut Group, &mut [PairContact], &mut [Body]) + Sync,
    ) {
        groups.for_each(&mut self.current[..], bodies, |group, contacts, bodies| {
            let count = group.contacts;
            work(group, &mut contacts[..count], bodies);
        });
    }
}

/// Applies the impulses of the last substep.
pub(super) fn warm_start(contacts: &mut PairContacts, groups: &mut Groups, bodies: &mut [Body]) {
    contacts.for_each_group(groups, bodies, |_, contacts, bodies| {
        for contact in contacts {
            // The normal has turned a little since: keep what is tangential to it now.
            contact.impulses.friction = tangential(contact.impulses.friction.into(), contact.normal).into();
            PairContact::apply(contact.impulse(), contact.both(bodies));
        }
    });
}

/// One iteration over all contacts. Velocities along resting contacts are ignored up to `tolerance`, m/s.
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
            let old_friction = Vec3A::from(old.friction);
            let sticking = old_friction - tangential(relative, contact.normal) * contact.reduced_mass;
            let limit = rules.friction * contact.impulses.normal;
            let new_friction = shortened(sticking, limit);
            contact.impulses.friction = new_friction.into();
            change += new_friction - old_friction;
        }
        corrected = true;
        PairContact::apply(change, [first, second]);
    }
    corrected
}

/// The part of its overlap that a resting pair in a pile is separated by in each iteration: it shares its
/// particles with others, which the whole correction would push into their neighbours.
const RESTING_CORRECTION: f32 = 0.5;

/// The overlap that a resting pair in a pile may keep, as a part of its reach.
const RESTING_OVERLAP: f32 = 0.001;

/// The overlap that a pair may keep of which both stay where they are, as a part of its reach: each correction would set
/// the next ones of the pile in motion, again and again.
const HELD_OVERLAP: f32 = 0.004;

/// A contact slips that bears this part of the friction that it can.
const STICKING_SHARE: f32 = 0.999;

/// Number of particles that one touches above which it is in a crowd: no more of its size fit around it without overlaps.
/// Each would throw it out by all of its overlap.
const MAX_TOUCHING: u8 = 12;

/// The part of an older overlap that a pair on springs is separated by in each iteration. To separate it
/// stretches the springs that press it together; whatever is more than undoing its approach in this substep
/// would give them energy from nowhere.
const SPRUNG_CORRECTION: f32 = 0.01;

/// Separates overlapping pairs, the lighter particle moving more; static friction puts both back to
/// where they stuck. In a crowd what is more than undoing the approach of a pair in this substep is at most the part
/// `recovery` of the sum of their radii, for all pairs of a particle together.
///
/// What an implicit step has put somewhere stays there, as elsewhere its springs would be stretched: the other one, of a net that
/// an explicit scheme advances (see `narrow.rs`), gives way alone.
pub(super) fn solve_positions(
    contacts: &mut PairContacts,
    groups: &mut Groups,
    rules: PairRules,
    bodies: &mut [Body],
    recovery: f32,
) {
    contacts.for_each_group(groups, bodies, |_, contacts, bodies| {
        separate(contacts, rules, bodies, recovery);
    });
}

fn separate(contacts: &[PairContact], rules: PairRules, bodies: &mut [Body], recovery: f32) {
    for contact in contacts {
        let [first, second] = contact.both(bodies);
        let reach = first.radius + second.radius;
        // The normal stays as it was found: a particle lifted past the centre of the next is still below it.
        let distance = (first.position - second.position).dot(contact.normal);
        let depth = reach - distance;
        let shared = contact.resting && u16::from(first.holds) + u16::from(second.holds) > 2;
        let (allowed, part) = if shared { (RESTING_OVERLAP * reach, RESTING_CORRECTION) } else { (0.0, 1.0) };
        let kept = if contact.resting && first.held && second.held { HELD_OVERLAP * reach } else { allowed };
        if depth <= kept {
            continue;
        }
        let mut depth = part * (depth - allowed);
        let touching = first.touching.max(second.touching);
        let approached = || (second.moved() - first.moved()).dot(contact.normal);
        if touching > MAX_TOUCHING && !contact.sprung {
            depth = depth.min(approached().max(0.0) + recovery * reach / f32::from(touching));
        }
        if contact.sprung {
            depth = depth.min(approached() + SPRUNG_CORRECTION * depth);
            if depth <= 0.0 {
                continue;
            }
        }
        let mut correction = contact.normal * depth;
        if rules.friction > 0.0 {
            let slip = tangential(first.moved() - second.moved(), contact.normal);
            correction += friction(slip, rules.friction * depth);
        }
        match [first.implicit, second.implicit] {
            [true, false] => second.position -= correction,
            [false, true] => first.position += correction,
            _ => {
                let correction = correction * contact.reduced_mass;
                first.position += correction * first.inverse_mass;
                second.position -= correction * second.inverse_mass;
            }
        }
        if contact.sprung {
            keep_angular_momentum(contact, distance, depth, [first, second]);
        }
    }
}

/// Slows the turning of two bodies about each other that have been moved from `distance` m apart to `depth` m more:
/// m r × v stays what it was. Else two balls that springs press together while they turn would be spun up by
/// their contact, which moves them outwards in each substep.
#[inline(always)]
fn keep_angular_momentum(contact: &PairContact, distance: f32, depth: f32, [first, second]: [&mut Body; 2]) {
    if distance > 0.0 {
        let turning = tangential(first.velocity - second.velocity, contact.normal);
        let lost = turning * (contact.reduced_mass * depth / (distance + depth));
        PairContact::apply(-lost, [first, second]);
    }
}

/// Ends the iterations over the velocities. Impulses of resting pairs are a load, which displaced them in this
/// substep as any force does: velocity · `reach`, s (see [`Integrator::displacement_share`]); this is taken back.
/// And what still sinks onto something supported is stopped.
///
/// Takes note of the bodies that slip, where that is asked for with the rules of their friction.
///
/// [`Integrator::displacement_share`]: crate::solver::Integrator::displacement_share
pub(super) fn finish_velocities(
    contacts: &mut PairContacts,
    groups: &mut Groups,
    bodies: &mut [Body],
    (friction, reach): (Option<PairRules>, f32),
) {
    contacts.for_each_group(groups, bodies, |_, contacts, bodies| {
        for contact in contacts {
            let [upper, lower] = contact.both(bodies);
            if friction.is_some_and(|rules| !contact.sticks(rules)) {
                (upper.slips, lower.slips) = (true, true);
            }
            if contact.resting {
                let impulse = contact.impulse() * reach;
                upper.position += impulse * upper.displaced_inverse_mass();
                lower.position -= impulse * lower.displaced_inverse_mass();
            }
            let approach = (upper.velocity - lower.velocity).dot(contact.normal);
            if contact.supports && approach < 0.0 && upper.inverse_mass > 0.0 {
                upper.velocity -= contact.normal * approach;
            }
        }
    });
}
