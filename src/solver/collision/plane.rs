//! Half-spaces, against which all particles are tested in vectors.

use bevy::math::{Quat, Vec3, Vec3A};

use crate::solver::particles::{Particles, Vectors};

use super::bodies::Body;
use super::collider::Collider;
use super::material::{ContactProperties, Layers, Material, properties_of};
use super::response::{Approach, Rebound, SprungApproach, friction, tangential};
use super::{ContactCaches, ContactRecord, Substep};

/// A position and an orientation.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub struct Pose {
    /// A point of the surface, m.
    pub point: Vec3,
    /// Rotates +Y into the outward normal.
    pub rotation: Quat,
}

/// A plane at one moment.
#[derive(Debug, Clone, Copy)]
pub(super) struct Surface {
    pub point: Vec3A,
    pub normal: Vec3A,
    pub velocity: Vec3A,
    pub angular_velocity: Vec3A,
    /// The velocity of a conveyor, m/s.
    pub sliding: Vec3A,
    material: Material,
}

impl Collider {
    /// The plane above a half-space after the fraction `elapsed` of a tick of `time_step` seconds.
    pub(super) fn surface(&self, elapsed: f32, time_step: f32) -> Surface {
        let Self { start, target, material, surface_velocity, .. } = *self;
        let moving = start != target;
        let change = if moving { target.rotation * start.rotation.inverse() } else { Quat::IDENTITY };
        let rotation = if moving { start.rotation.slerp(target.rotation, elapsed) } else { target.rotation };
        let point = if moving { start.point.lerp(target.point, elapsed) } else { target.point };
        Surface {
            point: point.into(),
            normal: (rotation * Vec3::Y).into(),
            velocity: ((target.point - start.point) / time_step).into(),
            angular_velocity: (change.to_scaled_axis() / time_step).into(),
            sliding: if surface_velocity == Vec3::ZERO {
                Vec3A::ZERO
            } else {
                (rotation * surface_velocity).into()
            },
            material,
        }
    }
}

impl Surface {
    /// How deep the sphere overlaps the half-space, m; negative when it does not touch.
    pub fn depth(&self, position: Vec3A, radius: f32) -> f32 {
        radius - (position - self.point).dot(self.normal)
    }

    /// Whether a sphere touches, or is found so little above the surface as one that was projected onto
    /// it may be: by the roundings of its coordinates.
    #[inline]
    pub fn touches(&self, [x, y, z]: [f32; 3], radius: f32) -> bool {
        let (point, normal) = (self.point, self.normal);
        let depth = radius - ((x - point.x) * normal.x + (y - point.y) * normal.y + (z - point.z) * normal.z);
        let size = x.abs() + y.abs() + z.abs() + radius + point.x.abs() + point.y.abs() + point.z.abs();
        depth >= -4.0 * f32::EPSILON * size
    }

    /// Restitution and friction with what is of this `material`.
    pub fn coefficients(&self, material: Option<Material>) -> [f32; 2] {
        self.material.between(material)
    }

    /// The velocity of a point that moves with it, m/s.
    pub fn velocity_at(&self, position: Vec3A) -> Vec3A {
        let carried = self.velocity + self.angular_velocity.cross(position - self.point);
        if self.sliding == Vec3A::ZERO { carried } else { carried + self.sliding }
    }
}

/// A particle that touches a plane.
#[derive(Debug, Clone, Copy)]
pub(super) struct PlaneContact {
    pub slot: usize,
    /// The particle among the bodies.
    pub body: usize,
    /// The place of its surface among those of this substep.
    pub plane: usize,
    /// The number of the collider.
    pub collider: usize,
    surface_velocity: Vec3A,
    target_velocity: f32,
    friction: f32,
    /// Normal impulse given so far in this substep, N·s.
    pub impulse: f32,
}

impl PlaneContact {
    /// Whether the particle rebounds.
    pub fn rebounds(&self) -> bool {
        self.target_velocity > 0.0
    }

    /// Gives it the velocity that follows from its accelerations along the normal, where the substep began and where it led to, m/s², and from
    /// its displacement, m.
    pub fn adjust(
        &mut self,
        surface: &Surface,
        particles: &Particles,
        (rebound, accelerations, displacement): (Rebound, [f32; 2], Vec3A),
        own_properties: ContactProperties,
    ) {
        let [restitution, _] = surface.coefficients(own_properties.material);
        let velocity = Vec3A::from(particles.velocity.get(self.slot)) - self.surface_velocity;
        let displacement = displacement - rebound.substep * self.surface_velocity;
        let position = Vec3A::from(particles.position.get(self.slot));
        let [velocity, displacement] = [velocity, displacement].map(|vector| vector.dot(surface.normal));
        let depth = surface.depth(position, particles.radius()[self.slot]).max(0.0);
        let rebound = Rebound { restitution, ..rebound };
        let approach = SprungApproach { velocity, accelerations, displacement, depth };
        self.target_velocity = rebound.velocity_after_on_springs(approach).max(0.0);
    }
}

/// Number of particles that are tested together: most of them touch nothing, and the test runs in vectors.
const PARTICLES_PER_CHUNK: usize = 64;

/// What a search for contacts reads beside the particles.
#[derive(Clone, Copy)]
pub(super) struct Conditions<'a> {
    pub acceleration: &'a Vectors,
    pub rebound: Rebound,
    pub properties: &'a [ContactProperties],
    pub body_of: &'a [u32],
    pub is_implicit: &'a [bool],
}

/// Calls `found` with the slots of the free particles that touch `surface` and that no implicit step has seen
/// to.
pub(super) fn touching(
    surface: &Surface,
    particles: &Particles,
    is_implicit: &[bool],
    mut found: impl FnMut(usize),
) {
    let [x, y, z] = particles.position.axes();
    let [x, y, z, radius] = [x, y, z, particles.radius()].map(|array| array.chunks(PARTICLES_PER_CHUNK));
    for (chunk, (((x, y), z), radius)) in x.zip(y).zip(z).zip(radius).enumerate() {
        let mut touching = [false; PARTICLES_PER_CHUNK];
        let spheres = x.iter().zip(y).zip(z).zip(radius);
        for (touching, (((x, y), z), radius)) in touching.iter_mut().zip(spheres) {
            *touching = surface.touches([*x, *y, *z], *radius);
        }
        for (offset, _) in touching.iter().enumerate().filter(|(_, touching)| **touching) {
            let slot = chunk * PARTICLES_PER_CHUNK + offset;
            if particles.inverse_mass()[slot] == 0.0 || is_implicit.get(slot) == Some(&true) {
                continue;
            }
            found(slot);
        }
    }
}

/// Finds the free particles that touch the plane above a half-space.
pub(super) fn find(
    [plane, number]: [usize; 2],
    (collider, surface): (&Collider, &Surface),
    particles: &Particles,
    conditions: Conditions,
    contacts: &mut Vec<PlaneContact>,
) {
    let Conditions { acceleration, rebound, properties, body_of, is_implicit } = conditions;
    touching(surface, particles, is_implicit, |slot| {
        let own_properties = properties_of(properties, slot);
        if !own_properties.layers.meet(collider.layers) {
            return;
        }
        let [restitution, friction] = surface.material.between(own_properties.material);
        let rebound = Rebound { restitution, ..rebound };
        let position = Vec3A::from(particles.position.get(slot));
        let surface_velocity = surface.velocity_at(position);
        let approach = Approach {
            velocity: (Vec3A::from(particles.velocity.get(slot)) - surface_velocity).dot(surface.normal),
            acceleration: Vec3A::from(acceleration.get(slot)).dot(surface.normal),
            depth: surface.depth(position, particles.radius()[slot]).max(0.0),
        };
        let target_velocity = rebound.least_velocity_after(approach);
        let body = body_of[slot] as usize;
        contacts.push(PlaneContact {
            slot,
            body,
            plane,
            collider: number,
            surface_velocity,
            target_velocity,
            friction,
            impulse: 0.0,
        });
    });
}

/// Gives the particle its velocity after the contact, unless it moves away already, and friction.
pub(super) fn solve_velocity(contact: &mut PlaneContact, surface: &Surface, bodies: &mut [Body]) {
    let body = &mut bodies[contact.body];
    let relative = body.velocity - contact.surface_velocity;
    let change = contact.target_velocity - relative.dot(surface.normal);
    if change <= 0.0 {
        return;
    }
    let friction = friction(tangential(relative, surface.normal), contact.friction * change);
    body.velocity += surface.normal * change + friction;
    contact.impulse += change / body.inverse_mass;
}

impl ContactCaches {
    /// What touched a collider in the last substep approaches it no longer; the impulse is added to the `records` of that substep.
    pub fn stop_approaching(&self, particles: &mut Particles, records: &mut [ContactRecord]) {
        let mut records = records.get_mut(self.first_record..).into_iter().flatten();
        let mut record = |impulse: f32| {
            if let Some(record) = records.next() {
                record.impulse += impulse;
            }
        };
        for contact in &self.plane_contacts {
            let normal = self.surfaces[contact.plane].normal;
            let velocity = Vec3A::from(particles.velocity.get(contact.slot));
            let approach = (contact.surface_velocity - velocity).dot(normal);
            if approach > 0.0 {
                particles.velocity.set(contact.slot, (velocity + normal * approach).into());
            }
            record(approach.max(0.0) / particles.inverse_mass()[contact.slot]);
        }
        self.touches.all.iter().for_each(|touch| record(touch.stop_approaching(particles)));
    }

    /// The half-spaces at the end of a substep, but for sensors, with the layers that they meet.
    pub(super) fn half_spaces<'a>(
        &'a self,
        substep: Substep<'a>,
    ) -> impl Iterator<Item = (Surface, Layers)> + 'a {
        let Substep { colliders, settings, elapsed, .. } = substep;
        let all = self.placed.planes.iter().map(move |number| &colliders[*number as usize]);
        all.filter(move |collider| settings.collide_with_colliders && !collider.is_sensor)
            .map(move |collider| (collider.surface(elapsed, settings.time_step), collider.layers))
    }

    /// Moves the particles visited by `each`, pressed into a half-space by surface contacts, back onto it.
    pub fn put_onto_half_spaces(
        &self,
        each: impl Fn(&mut dyn FnMut(usize)),
        particles: &mut Particles,
        substep: Substep,
    ) {
        for (surface, layers) in self.half_spaces(substep) {
            each(&mut |slot| {
                let own_properties = properties_of(substep.properties, slot);
                if !particles.is_pinned(slot) && own_properties.layers.meet(layers) {
                    put_onto(&surface, particles, own_properties, slot);
                }
            });
        }
    }
}

/// Moves a particle that others have pressed into a half-space back onto it, and removes its approaching velocity, with friction.
fn put_onto(surface: &Surface, particles: &mut Particles, own_properties: ContactProperties, slot: usize) {
    let position = Vec3A::from(particles.position.get(slot));
    let radius = particles.radius()[slot];
    let depth = surface.depth(position, radius);
    if depth.is_nan() || depth <= 0.0 {
        return;
    }
    let [_, coefficient] = surface.coefficients(own_properties.material);
    let velocity = Vec3A::from(particles.velocity.get(slot));
    let relative = velocity - surface.velocity_at(position);
    let change = (-relative.dot(surface.normal)).max(0.0);
    let rubbed = friction(tangential(relative, surface.normal), coefficient * change);
    particles.position.set(slot, (position + surface.normal * depth).into());
    particles.velocity.set(slot, (velocity + surface.normal * change + rubbed).into());
}

/// Takes note whether the particle slips, at more than `tolerance` m/s, or is moved along.
pub(super) fn note_slip(contact: &PlaneContact, surface: &Surface, bodies: &mut [Body], tolerance: f32) {
    let body = &mut bodies[contact.body];
    let slip = tangential(body.velocity - contact.surface_velocity, surface.normal);
    let slips = contact.friction == 0.0 || slip.length_squared() > tolerance * tolerance;
    body.slips |= (contact.impulse > 0.0 && slips) || contact.surface_velocity != Vec3A::ZERO;
}

/// Puts the particle back onto the surface; static friction, back to where it stuck.
pub(super) fn solve_position(contact: &PlaneContact, surface: &Surface, bodies: &mut [Body], substep: f32) {
    let body = &mut bodies[contact.body];
    let depth = surface.depth(body.position, body.radius);
    if depth <= 0.0 {
        return;
    }
    let mut correction = surface.normal * depth;
    if contact.friction > 0.0 {
        let slip = body.moved() - contact.surface_velocity * substep;
        correction += friction(tangential(slip, surface.normal), contact.friction * depth);
    }
    body.position += correction;
}
