//! Planes: solid half-spaces that may move.

use bevy::math::{Quat, Vec3};

use crate::solver::particles::Particles;

use super::bodies::Body;
use super::response::{Approach, Rebound, friction, tangential};

/// A position and an orientation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// A point of the surface, m.
    pub point: Vec3,
    /// Turns +Y into the outward normal.
    pub rotation: Quat,
}

/// The half-space below the local +Y of a pose that moves from `start` to `target` during the tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// Pose at the start of the tick.
    pub start: Pose,
    /// Pose at the end of the tick.
    pub target: Pose,
    /// Coefficient of restitution, 0 to 1.
    pub restitution: f32,
    /// Coefficient of Coulomb friction, >= 0.
    pub friction: f32,
}

/// A plane at one moment.
#[derive(Debug, Clone, Copy)]
pub(super) struct Surface {
    point: Vec3,
    pub normal: Vec3,
    velocity: Vec3,
    angular_velocity: Vec3,
    restitution: f32,
    pub friction: f32,
}

impl Plane {
    /// A plane at rest through `point` with unit normal `normal`.
    pub fn resting(point: Vec3, normal: Vec3, restitution: f32, friction: f32) -> Self {
        let pose = Pose { point, rotation: Quat::from_rotation_arc(Vec3::Y, normal) };
        Self { start: pose, target: pose, restitution, friction }
    }

    /// The plane after the fraction `elapsed` of a tick of `time_step` seconds.
    pub(super) fn surface(&self, elapsed: f32, time_step: f32) -> Surface {
        let Self { start, target, restitution, friction } = *self;
        if start == target {
            return Surface {
                point: target.point,
                normal: target.rotation * Vec3::Y,
                velocity: Vec3::ZERO,
                angular_velocity: Vec3::ZERO,
                restitution,
                friction,
            };
        }
        let turn = target.rotation * start.rotation.inverse();
        Surface {
            point: start.point.lerp(target.point, elapsed),
            normal: start.rotation.slerp(target.rotation, elapsed) * Vec3::Y,
            velocity: (target.point - start.point) / time_step,
            angular_velocity: turn.to_scaled_axis() / time_step,
            restitution,
            friction,
        }
    }
}

impl Surface {
    /// How deep the sphere overlaps the half-space, m; negative when it does not touch.
    pub fn depth(&self, position: Vec3, radius: f32) -> f32 {
        radius - (position - self.point).dot(self.normal)
    }

    /// How far above the surface the sphere may be found that was projected onto it, m.
    fn rounding(&self, position: Vec3, radius: f32) -> f32 {
        4.0 * f32::EPSILON * (position.abs().max_element() + self.point.abs().max_element() + radius)
    }

    fn velocity_at(&self, position: Vec3) -> Vec3 {
        self.velocity + self.angular_velocity.cross(position - self.point)
    }
}

/// A particle that touches a plane.
#[derive(Debug, Clone, Copy)]
pub(super) struct PlaneContact {
    pub slot: usize,
    pub plane: usize,
    surface_velocity: Vec3,
    target_velocity: f32,
    /// Normal impulse given so far in this substep, N·s.
    pub impulse: f32,
}

/// Finds the free particles that touch `surface`.
pub(super) fn find(
    plane: usize,
    surface: &Surface,
    particles: &Particles,
    rebound: Rebound,
    found: &mut Vec<PlaneContact>,
) {
    let rebound = Rebound { restitution: surface.restitution, ..rebound };
    for (slot, &radius) in particles.radius.iter().enumerate() {
        let position = particles.position.get(slot);
        let depth = surface.depth(position, radius);
        if !(depth >= -surface.rounding(position, radius)) || particles.inverse_mass[slot] == 0.0 {
            continue;
        }
        let surface_velocity = surface.velocity_at(position);
        let approach = Approach {
            velocity: (particles.velocity.get(slot) - surface_velocity).dot(surface.normal),
            acceleration: particles.acceleration.get(slot).dot(surface.normal),
            depth: depth.max(0.0),
        };
        let target_velocity = rebound.least_velocity_after(approach);
        found.push(PlaneContact { slot, plane, surface_velocity, target_velocity, impulse: 0.0 });
    }
}

/// Gives the particle its velocity after the contact, unless it has left already, and rubs it.
pub(super) fn solve_velocity(contact: &mut PlaneContact, surface: &Surface, bodies: &mut [Body]) {
    let body = &mut bodies[contact.slot];
    let relative = body.velocity - contact.surface_velocity;
    let change = contact.target_velocity - relative.dot(surface.normal);
    if change <= 0.0 {
        return;
    }
    let rubbing = friction(tangential(relative, surface.normal), surface.friction * change);
    body.velocity += surface.normal * change + rubbing;
    contact.impulse += change / body.inverse_mass;
}

/// Puts the particle back onto the surface; static friction takes it back to where it stuck.
/// `previous` are the positions at the start of the substep, empty where there is no friction.
pub(super) fn solve_position(
    contact: &PlaneContact,
    surface: &Surface,
    bodies: &mut [Body],
    previous: &[Vec3],
    substep: f32,
) {
    let body = &mut bodies[contact.slot];
    let depth = surface.depth(body.position, body.radius);
    if depth <= 0.0 {
        return;
    }
    let mut correction = surface.normal * depth;
    if surface.friction > 0.0 {
        let slip = body.position - previous[contact.slot] - contact.surface_velocity * substep;
        correction += friction(tangential(slip, surface.normal), surface.friction * depth);
    }
    body.position += correction;
}
