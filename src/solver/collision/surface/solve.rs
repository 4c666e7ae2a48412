//! What touching primitives do to each other: impulses that share out by the weights of the closest points.
//!
//! An impulse p on the first side and −p on the second give particle i, of mass mᵢ, the velocity wᵢ p / mᵢ. The weights add
//! up to zero, so that no momentum comes or goes. The rules are those of two spheres (`../pairs.rs`, `../response.rs`).

use bevy::math::Vec3A;

use super::contact::Contact;
use super::pair::LEAST_PART;

use super::super::response::{friction, shortened, tangential};

/// Number of iterations over the velocities, at most.
const VELOCITY_ITERATIONS: usize = 12;

/// Number of iterations over the positions; and of those, at most, while anything is nearer than the least distance, as where many
/// layers are pressed together.
const POSITION_ITERATIONS: usize = 4;
const URGENT_ITERATIONS: usize = 32;

/// The part of an older overlap that is removed in each iteration where springs press: see `../pairs.rs`.
const SPRUNG_CORRECTION: f32 = 0.01;

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

/// Finds the impulses. Velocities along resting contacts are left alone up to `tolerance`, m/s.
pub(super) fn solve_velocities(contacts: &mut [Contact], bodies: &mut [Touching], tolerance: f32) {
    for _ in 0..VELOCITY_ITERATIONS {
        let mut corrected = false;
        for contact in &mut *contacts {
            corrected |= correct_velocity(contact, bodies, tolerance);
        }
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
pub(super) fn solve_positions(contacts: &[Contact], bodies: &mut [Touching]) {
    for iteration in 0..URGENT_ITERATIONS {
        let is_urgent_only = iteration >= POSITION_ITERATIONS;
        let mut any_urgent = false;
        for contact in contacts {
            any_urgent |= separate(contact, bodies, is_urgent_only);
        }
        if iteration + 1 >= POSITION_ITERATIONS && !any_urgent {
            break;
        }
    }
}

/// Parts the sides of a contact; whether they were nearer than the least distance. `is_urgent_only` leaves the others alone.
fn separate(contact: &Contact, bodies: &mut [Touching], is_urgent_only: bool) -> bool {
    let origin = bodies[contact.places[0] as usize].position;
    let gap = combine(contact, bodies, |body| body.position - origin).dot(contact.normal);
    let mut depth = contact.reach - gap;
    let is_urgent = gap < LEAST_PART * contact.reach;
    if depth <= 0.0 || is_urgent_only && !is_urgent {
        return false;
    }
    let moved = combine(contact, bodies, |body| body.position - body.start);
    if contact.sprung {
        let approached = -moved.dot(contact.normal);
        let urgent = (URGENT * LEAST_PART * contact.reach - gap).max(0.0);
        depth = depth.min(approached + SPRUNG_CORRECTION * depth).max(urgent);
        if depth <= 0.0 {
            return false;
        }
    }
    let mut correction = contact.normal * depth;
    if contact.coefficient > 0.0 {
        correction += friction(tangential(moved, contact.normal), contact.coefficient * depth);
    }
    apply(contact, bodies, correction * contact.mass, |body| &mut body.position);
    is_urgent
}
