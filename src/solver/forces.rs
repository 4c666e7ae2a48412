//! The forces on particles, one function each, and Newton's second law.
//!
//! [`accelerations`] takes the springs one after the other, as one would write it first. The steps take
//! [`evaluate`], which does the same by the kernel: eight at a time, and on all threads.

use bevy::math::Vec3;

use super::blocks;
use super::kernel::{self, Accelerate, Motion, Target};
use super::particles::{Particles, Vectors};
use super::springs::Springs;

/// The parameters of the forces that act on every particle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Field {
    /// Acceleration of gravity, m/s².
    pub gravity: Vec3,
    /// Viscosity of the medium ν, N·s/m.
    pub viscosity: f32,
}

/// Accelerations of all particles at the given positions and velocities, into `acceleration`.
///
/// `applied_force` and `inverse_mass` are those of [`Particles`].
pub fn accelerations(
    applied_force: &Vectors,
    inverse_mass: &[f32],
    springs: &Springs,
    field: Field,
    position: &Vectors,
    velocity: &Vectors,
    acceleration: &mut Vectors,
) {
    let force = acceleration;
    force.copy_from(applied_force);
    if field.viscosity > 0.0 {
        add_viscosity(field.viscosity, velocity, force);
    }
    add_spring_forces(springs, position, velocity, force);
    apply_second_law(inverse_mass, field.gravity, force);
}

/// Evaluates the forces at the present state of `particles`, into their `acceleration`.
///
/// The sum of the forces on a particle is rounded in another order than by [`accelerations`], always
/// the same.
pub fn evaluate(particles: &mut Particles, springs: &mut Springs, field: Field) {
    springs.prepare(particles.len());
    let Particles { position, velocity, applied_force, acceleration, inverse_mass, .. } = particles;
    let motion = Motion {
        position: position.axes(),
        velocity: velocity.axes(),
        applied_force: applied_force.axes(),
        inverse_mass,
    };
    evaluate_motion(motion, springs, field, acceleration);
}

/// Evaluates the forces of `motion` into `acceleration`. The springs must be prepared.
pub(super) fn evaluate_motion(motion: Motion, springs: &Springs, field: Field, acceleration: &mut Vectors) {
    let batches = springs.batches();
    let size = batches.block_size;
    let parts = batches.blocks.iter().zip(acceleration.chunks_mut(size)).enumerate();
    blocks::for_each(parts, batches.are_worth_sharing(), |(number, (block, acceleration))| {
        let target = Target { start: number * size, acceleration };
        kernel::run(Accelerate { block, motion, field, target });
    });
}

/// Adds −ν v, the drag of the medium.
fn add_viscosity(viscosity: f32, velocity: &Vectors, force: &mut Vectors) {
    for (force, velocity) in force.axes_mut().into_iter().zip(velocity.axes()) {
        for (force, velocity) in force.iter_mut().zip(velocity) {
            *force -= viscosity * velocity;
        }
    }
}

/// The force of a damped spring on its first particle; the second feels the opposite.
///
/// `separation` = x_first − x_second and `relative_velocity` = v_first − v_second. With d the
/// direction of the separation, the ideal spring pulls with −k (‖separation‖ − l0) d (Hooke's law) and
/// the damper with −c (relative_velocity · d) d. Without a direction there is no force.
#[inline]
pub fn spring_force(
    separation: Vec3,
    relative_velocity: Vec3,
    rest_length: f32,
    stiffness: f32,
    damping: f32,
) -> Vec3 {
    let length = separation.length();
    let direction = separation * if length == 0.0 { 0.0 } else { 1.0 / length };
    let tension = stiffness * (length - rest_length) + damping * relative_velocity.dot(direction);
    direction * -tension
}

/// Adds the force of every spring, equal and opposite on its two ends.
fn add_spring_forces(springs: &Springs, position: &Vectors, velocity: &Vectors, force: &mut Vectors) {
    for spring in 0..springs.len() {
        let (first, second) = springs.ends(spring);
        let pull = spring_force(
            position.get(first) - position.get(second),
            velocity.get(first) - velocity.get(second),
            springs.rest_length()[spring],
            springs.stiffness()[spring],
            springs.damping()[spring],
        );
        force.add(first, pull);
        force.add(second, -pull);
    }
}

/// Turns forces into accelerations: a = f / m + g, and 0 for pinned particles.
///
/// Gravity is added as an acceleration, so that free fall does not depend on the mass, not even by a
/// rounding.
fn apply_second_law(inverse_mass: &[f32], gravity: Vec3, force: &mut Vectors) {
    for (force, gravity) in force.axes_mut().into_iter().zip(gravity.to_array()) {
        for (force, &inverse_mass) in force.iter_mut().zip(inverse_mass) {
            *force = if inverse_mass > 0.0 { *force * inverse_mass + gravity } else { 0.0 };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FIELD: Field = Field { gravity: Vec3::new(0.0, -9.81, 0.0), viscosity: 0.0 };

    #[test]
    fn a_stretched_spring_pulls_its_ends_together() {
        let force = spring_force(Vec3::X * 1.5, Vec3::ZERO, 1.0, 200.0, 3.0);
        assert_eq!(force, Vec3::X * -100.0);
        let force = spring_force(Vec3::X * 0.5, Vec3::ZERO, 1.0, 200.0, 3.0);
        assert_eq!(force, Vec3::X * 100.0);
    }

    #[test]
    fn the_damper_acts_along_the_spring_only() {
        let along = spring_force(Vec3::Y, Vec3::new(5.0, 2.0, 7.0), 1.0, 200.0, 3.0);
        assert_eq!(along, Vec3::Y * -6.0);
    }

    #[test]
    fn coincident_particles_feel_no_force() {
        assert_eq!(spring_force(Vec3::ZERO, Vec3::ONE, 1.0, 200.0, 3.0), Vec3::ZERO);
    }

    #[test]
    fn action_and_reaction_cancel_to_the_last_bit() {
        let mut particles = Particles::default();
        particles.push(Vec3::new(0.1, 0.7, -0.3), Vec3::new(3.0, -2.0, 0.5), 1.0, 0.0);
        particles.push(Vec3::new(-0.4, 0.2, 0.9), Vec3::new(-1.0, 0.3, 0.2), 1.0, 0.0);
        let mut springs = Springs::default();
        springs.push(0, 1, 0.3, 123.4, 5.6);
        evaluate(&mut particles, &mut springs, Field { gravity: Vec3::ZERO, viscosity: 0.0 });
        assert_eq!(particles.acceleration.get(0), -particles.acceleration.get(1));
        assert!(particles.acceleration.get(0).length() > 1.0);
    }

    #[test]
    fn weight_viscosity_and_applied_force_add_up() {
        let mut particles = Particles::default();
        particles.push(Vec3::ZERO, Vec3::new(2.0, 0.0, 0.0), 4.0, 0.0);
        particles.applied_force.set(0, Vec3::new(0.0, 0.0, 8.0));
        evaluate(&mut particles, &mut Springs::default(), Field { viscosity: 6.0, ..FIELD });
        assert_eq!(particles.acceleration.get(0), Vec3::new(-3.0, -9.81, 2.0));
    }

    #[test]
    fn nothing_accelerates_a_pinned_particle() {
        let mut particles = Particles::default();
        particles.push(Vec3::ZERO, Vec3::ONE, f32::INFINITY, 0.0);
        particles.applied_force.set(0, Vec3::ONE);
        evaluate(&mut particles, &mut Springs::default(), Field { viscosity: 6.0, ..FIELD });
        assert_eq!(particles.acceleration.get(0), Vec3::ZERO);
    }
}
