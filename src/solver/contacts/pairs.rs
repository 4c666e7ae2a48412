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

use bevy::math::Vec3;

use crate::solver::particles::{Particles, Vectors};

use super::PairRules;
use super::candidates::{Candidates, Memory};
use super::response::{Approach, Rebound, friction, tangential};

/// A pair that touches.
#[derive(Debug, Clone, Copy)]
pub(super) struct PairContact {
    pub first: usize,
    pub second: usize,
    /// Index among the candidates.
    pair: usize,
    /// From the second to the first.
    pub normal: Vec3,
    target_velocity: f32,
    pub impulses: Memory,
    /// Whether the pair rests: its impulses are a load, and displace it as any force does.
    resting: bool,
    /// Whether the lower particle carries the upper one and cannot give way.
    supports: bool,
}

impl PairContact {
    /// How deep the pair overlaps along the normal of the contact, m. The normal stays as it was found:
    /// a particle that is lifted past the centre of the next one is still below it.
    fn depth(&self, particles: &Particles) -> f32 {
        let separation = particles.position.get(self.first) - particles.position.get(self.second);
        particles.radius[self.first] + particles.radius[self.second] - separation.dot(self.normal)
    }
}

/// The unit vector from `second` to `first`; +Y for two particles in the same place.
fn normal_between(first: Vec3, second: Vec3) -> (Vec3, f32) {
    let separation = first - second;
    let distance = separation.length();
    if distance == 0.0 {
        return (Vec3::Y, 0.0);
    }
    (separation / distance, distance)
}

/// Finds the touching pairs among the candidates, and forgets the impulses of the others.
pub(super) fn find(
    candidates: &mut Candidates,
    particles: &Particles,
    rebound: Rebound,
    found: &mut Vec<PairContact>,
) {
    let touching = candidates.bottom_up().filter_map(|(second, first, pair)| {
        let (position, radius) = (&particles.position, &particles.radius);
        let reach = radius[first] + radius[second];
        let separation = position.get(first) - position.get(second);
        let most = reach + rebound.slop;
        // Not a comparison with >: a non-finite pair does not touch.
        if !(separation.length_squared() <= most * most) {
            return None;
        }
        let (normal, distance) = normal_between(position.get(first), position.get(second));
        let relative = |vectors: &Vectors| (vectors.get(first) - vectors.get(second)).dot(normal);
        let approach = Approach {
            velocity: relative(&particles.velocity),
            acceleration: relative(&particles.acceleration),
            depth: (reach - distance).max(0.0),
        };
        let target_velocity = rebound.least_velocity_after(approach);
        let resting = target_velocity == 0.0 && approach.velocity.abs() <= 2.0 * rebound.resting_speed;
        if distance > reach && !resting {
            return None;
        }
        let impulses = candidates.memory(pair);
        Some(PairContact { first, second, pair, normal, target_velocity, impulses, resting, supports: false })
    });
    found.clear();
    found.extend(touching);
    candidates.forget_all();
}

/// Applies the impulses of the last substep.
pub(super) fn warm_start(contacts: &mut [PairContact], particles: &mut Particles, substep: f32) {
    for contact in contacts {
        // The normal has turned a little since: keep what is tangential to it now.
        contact.impulses.friction = tangential(contact.impulses.friction, contact.normal);
        let impulse = contact.normal * contact.impulses.normal + contact.impulses.friction;
        push_apart(contact, impulse, particles, substep);
    }
}

/// One round over all contacts.
pub(super) fn solve_velocities(
    contacts: &mut [PairContact],
    rules: PairRules,
    particles: &mut Particles,
    substep: f32,
) {
    for contact in contacts {
        let (first, second, normal) = (contact.first, contact.second, contact.normal);
        let inverse_mass = particles.inverse_mass[first] + particles.inverse_mass[second];
        let relative = particles.velocity.get(first) - particles.velocity.get(second);

        let old = contact.impulses;
        let wanted = (contact.target_velocity - relative.dot(normal)) / inverse_mass;
        contact.impulses.normal = (old.normal + wanted).max(0.0);
        if rules.friction > 0.0 {
            let sticking = old.friction - tangential(relative, normal) / inverse_mass;
            let limit = rules.friction * contact.impulses.normal;
            contact.impulses.friction = sticking.clamp_length_max(limit);
        }
        let change =
            normal * (contact.impulses.normal - old.normal) + (contact.impulses.friction - old.friction);
        push_apart(contact, change, particles, substep);
    }
}

fn push_apart(contact: &PairContact, impulse: Vec3, particles: &mut Particles, substep: f32) {
    let (first, second) = (contact.first, contact.second);
    let first_change = impulse * particles.inverse_mass[first];
    let second_change = impulse * -particles.inverse_mass[second];
    particles.velocity.add(first, first_change);
    particles.velocity.add(second, second_change);
    if contact.resting {
        particles.position.add(first, first_change * substep);
        particles.position.add(second, second_change * substep);
    }
}

/// The part of its overlap that a resting pair is separated by in each round.
const RESTING_CORRECTION: f32 = 0.5;

/// Separates overlapping pairs, the lighter particle moving more; static friction takes both back to
/// where they stuck.
///
/// `previous` are the positions at the start of the substep, empty where there is no friction.
pub(super) fn solve_positions(
    contacts: &[PairContact],
    rules: PairRules,
    particles: &mut Particles,
    previous: &Vectors,
) {
    for contact in contacts {
        let (first, second) = (contact.first, contact.second);
        let normal = contact.normal;
        let depth = contact.depth(particles);
        if depth <= 0.0 {
            continue;
        }
        // A pile is lifted gently: each pair shares its particles with others, which would be hit by
        // the whole correction.
        let depth = if contact.resting { RESTING_CORRECTION * depth } else { depth };
        let mut correction = normal * depth;
        if rules.friction > 0.0 {
            let moved = |slot: usize| particles.position.get(slot) - previous.get(slot);
            let slip = tangential(moved(first) - moved(second), normal);
            correction += friction(slip, rules.friction * depth);
        }
        let (first_share, second_share) = (particles.inverse_mass[first], particles.inverse_mass[second]);
        let correction = correction / (first_share + second_share);
        particles.position.add(first, correction * first_share);
        particles.position.add(second, correction * -second_share);
    }
}

/// How steep a contact must be, as the cosine to the vertical, to support the upper particle.
const STEEPEST_SUPPORT: f32 = 0.2;

/// Whose weight rests on the ground: `supported` begins with what touches it, and grows upwards.
pub(super) fn propagate_support(contacts: &mut [PairContact], up: Vec3, supported: &mut [bool]) {
    for contact in contacts {
        contact.supports = supported[contact.second] && contact.normal.dot(up) > STEEPEST_SUPPORT;
        supported[contact.first] |= contact.supports;
    }
}

/// Stops what still sinks onto something supported.
pub(super) fn stop_sinking(contacts: &[PairContact], particles: &mut Particles) {
    for contact in contacts.iter().filter(|contact| contact.supports) {
        let (first, second, normal) = (contact.first, contact.second, contact.normal);
        let relative = particles.velocity.get(first) - particles.velocity.get(second);
        let approach = relative.dot(normal);
        if approach < 0.0 && particles.inverse_mass[first] > 0.0 {
            particles.velocity.add(first, normal * -approach);
        }
    }
}

/// Counts the resting contacts of each particle.
pub(super) fn count_holds(contacts: &[PairContact], holds: &mut [u32]) {
    for contact in contacts.iter().filter(|contact| contact.resting) {
        holds[contact.first] += 1;
        holds[contact.second] += 1;
    }
}

/// Remembers the impulses for the next substep.
pub(super) fn remember(contacts: &[PairContact], candidates: &mut Candidates) {
    for contact in contacts {
        candidates.remember(contact.pair, contact.impulses);
    }
}
