//! Impulses between touching primitives, distributed by the barycentric weights of the closest points.
//!
//! An impulse p on the first side and −p on the second give particle i, of mass mᵢ, the velocity wᵢ p / mᵢ. The weights add
//! up to zero, so that no momentum comes or goes. The rules are those of two spheres (`../pairs.rs`, `../response.rs`).
//!
//! Positions are corrected as velocities are: by the projected Gauss–Seidel method (Catto, *Iterative dynamics with temporal
//! coherence*, GDC 2005). What a contact has corrected in all iterations is what its cone of friction follows from. What one contact
//! moves another one along its tangent is taken back by friction there, and what was too much is taken back along the normal.
//!
//! *What sticks does not creep.* Whatever the iterations leave of the slip of a contact that sticks is remembered (`grip.rs`), and
//! taken back in the next substeps, by no more than friction can: Baumgarte's stabilisation of static friction, of positions
//! alone, so that it gives no velocity.

use bevy::math::Vec3A;

use super::contact::Contact;
use super::pair::MIN_DISTANCE_PART;
use super::supports::Supports;

use super::super::response::{shortened, tangential};

/// Number of iterations over the velocities, at most.
const VELOCITY_ITERATIONS: usize = 12;

/// Number of iterations over the positions, and over those of what lies on a half-space; and of those, at most, while anything is nearer
/// than the least distance, as where many layers are pressed together.
const POSITION_ITERATIONS: usize = 4;
const SUPPORTED_ITERATIONS: usize = 12;
const URGENT_ITERATIONS: usize = 32;

/// The part of an older overlap that is removed in each substep where springs press: see `../pairs.rs`.
const SPRUNG_CORRECTION: f32 = 0.04;

/// The part of an older slip that is taken back in each substep.
const SLIP_CORRECTION: f32 = 0.1;

/// A contact slips that bears this part of the friction that it can.
const STICKING_SHARE: f32 = 0.999;

/// Distances below this multiple of the least one are corrected in any case.
const URGENT: f32 = 2.0;

/// A particle that touches something.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Touching {
    pub position: Vec3A,
    pub velocity: Vec3A,
    /// The position at the start of the substep, m.
    pub start: Vec3A,
    pub inverse_mass: f32,
    pub slot: u32,
}

/// Σ wᵢ xᵢ.
#[inline(always)]
fn combine(contact: &Contact, bodies: &[Touching], of: impl Fn(&Touching) -> Vec3A) -> Vec3A {
    let Contact { places, weights, .. } = contact;
    let [a, b, c, d] = places.map(|place| of(&bodies[place as usize]));
    weights[0] * a + weights[1] * b + weights[2] * c + weights[3] * d
}

/// Gives the particles their shares of an impulse.
#[inline(always)]
fn apply(
    contact: &Contact,
    bodies: &mut [Touching],
    impulse: Vec3A,
    to: impl Fn(&mut Touching) -> &mut Vec3A,
) {
    for (place, weight) in contact.places.into_iter().zip(contact.weights) {
        let body = &mut bodies[place as usize];
        let change = impulse * (weight * body.inverse_mass);
        *to(body) += change;
    }
}

/// Finds the impulses. Velocities along resting contacts are ignored up to `tolerance`, m/s.
pub(super) fn solve_velocities(
    contacts: &mut [Contact],
    (bodies, supports): (&mut [Touching], &mut Supports),
    tolerance: f32,
) {
    for _ in 0..VELOCITY_ITERATIONS {
        let mut corrected = false;
        for contact in &mut *contacts {
            corrected |= correct_velocity(contact, bodies, tolerance);
        }
        corrected |= supports.correct_velocities(bodies, tolerance);
        if !corrected {
            break;
        }
    }
}

fn correct_velocity(contact: &mut Contact, bodies: &mut [Touching], tolerance: f32) -> bool {
    let relative = combine(contact, bodies, |body| body.velocity);
    let missing = contact.target_velocity - relative.dot(contact.normal);
    if missing <= 0.0 && contact.impulse == 0.0 {
        return false;
    }
    let error = if contact.coefficient > 0.0 { relative.length_squared() } else { missing * missing };
    if contact.resting && error < tolerance * tolerance {
        return false;
    }
    let impulse = (contact.impulse + missing * contact.mass).max(0.0);
    let mut change = contact.normal * (impulse - contact.impulse);
    contact.impulse = impulse;
    if contact.coefficient > 0.0 {
        let sticking = contact.friction - tangential(relative, contact.normal) * contact.mass;
        let new = shortened(sticking, contact.coefficient * impulse);
        change += new - contact.friction;
        contact.friction = new;
    }
    apply(contact, bodies, change, |body| &mut body.velocity);
    true
}

/// Parts what is nearer than it may be; static friction puts it back to where it stuck.
pub(super) fn solve_positions(contacts: &mut [Contact], bodies: &mut [Touching], supports: &mut Supports) {
    let count = if supports.any() { SUPPORTED_ITERATIONS } else { POSITION_ITERATIONS };
    for contact in &mut *contacts {
        contact.overlap = if contact.sprung { kept_overlap(contact, bodies) } else { 0.0 };
    }
    for iteration in 0..URGENT_ITERATIONS {
        let is_urgent_only = iteration >= count;
        let mut any_urgent = false;
        for contact in &mut *contacts {
            any_urgent |= separate(contact, bodies, is_urgent_only);
        }
        supports.correct_positions(bodies);
        if iteration + 1 >= count && !any_urgent {
            break;
        }
    }
}

/// How much nearer than it may be a contact is, along its normal, m.
#[inline(always)]
fn depth(contact: &Contact, bodies: &[Touching], of: impl Fn(&Touching) -> Vec3A) -> f32 {
    let origin = of(&bodies[contact.places[0] as usize]);
    contact.reach - combine(contact, bodies, |body| of(body) - origin).dot(contact.normal)
}

/// What a contact that springs press keeps of its overlap at the start of the substep, m.
fn kept_overlap(contact: &Contact, bodies: &[Touching]) -> f32 {
    let depth = depth(contact, bodies, |body| body.start);
    let urgent = (URGENT * MIN_DISTANCE_PART * contact.reach).min(URGENT * (contact.reach - depth));
    ((1.0 - SPRUNG_CORRECTION) * depth).clamp(0.0, contact.reach - urgent.max(0.0))
}

/// Parts the sides of a contact; whether they were nearer than the least distance. `is_urgent_only` leaves the others alone.
fn separate(contact: &mut Contact, bodies: &mut [Touching], is_urgent_only: bool) -> bool {
    let depth = depth(contact, bodies, |body| body.position);
    let is_urgent = contact.reach - depth < MIN_DISTANCE_PART * contact.reach;
    if is_urgent_only && !is_urgent {
        return false;
    }
    let lifted = (contact.lifted + depth - contact.overlap).max(0.0);
    if lifted == 0.0 && contact.lifted == 0.0 {
        return false;
    }
    let mut correction = contact.normal * (lifted - contact.lifted);
    contact.lifted = lifted;
    if contact.coefficient > 0.0 {
        let slip = moved(contact, bodies) + SLIP_CORRECTION * contact.slip;
        let held = shortened(contact.held - slip, contact.coefficient * lifted);
        correction += held - contact.held;
        contact.held = held;
    }
    apply(contact, bodies, correction * contact.mass, |body| &mut body.position);
    is_urgent
}

/// How far a contact has slipped in the substep, m.
#[inline(always)]
fn moved(contact: &Contact, bodies: &[Touching]) -> Vec3A {
    tangential(combine(contact, bodies, |body| body.position - body.start), contact.normal)
}

/// How far a contact is from where it sticks, m; `None` of one that slips or bears nothing.
pub(super) fn slip(contact: &Contact, bodies: &[Touching]) -> Option<Vec3A> {
    let limit = STICKING_SHARE * contact.coefficient * contact.impulse;
    let sticks = contact.friction.length_squared() < limit * limit;
    sticks.then(|| contact.slip + moved(contact, bodies))
}
