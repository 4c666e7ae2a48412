//! The motion of the particle in the grip towards its target.

use bevy::prelude::*;

use super::grip::{Grip, Held};
use super::{ParticleDrag, ParticleDragSettings};
use crate::environment::Environment;
use crate::nets::{PartState, ParticleNet};
use crate::particle::{AppliedForce, Particle, ParticleVelocity, Pinned};
use crate::settings::Dimensions;

/// Entities that are moved by their `Transform`.
type Movable<'w, 's> = Query<'w, 's, (&'static mut Transform, Option<&'static ChildOf>, Has<Pinned>)>;

/// Moves a pinned particle to the target; a free one too while time is paused, when no force acts.
pub(super) fn place_particle(
    (drag, grip): (Res<ParticleDrag>, Res<Grip>),
    (time, dimensions): (Res<Time<Virtual>>, Res<Dimensions>),
    mut movable: Movable,
    mut nets: Query<&mut ParticleNet>,
    parts: Query<&PartState>,
    frames: Query<&GlobalTransform>,
) {
    let (Some(held), Some(target)) = (&grip.0, drag.target) else { return };
    let (entity, is_paused) = (held.handle.entity, time.is_paused());
    let Some(index) = held.handle.index else {
        if movable.get(entity).is_ok_and(|(.., is_pinned)| is_pinned || is_paused) {
            move_entity(entity, target, *dimensions, &mut movable, &frames);
        }
        return;
    };
    let Ok(mut net) = nets.get_mut(entity) else { return };
    let Some(place) = net.positions().get(index as usize).copied() else { return };
    let target = match *dimensions {
        Dimensions::Two => target.with_z(place.z),
        Dimensions::Three => target,
    };
    if let Some((holder, arm)) = held.holder {
        move_entity(holder, target + arm, *dimensions, &mut movable, &frames);
    }
    let is_own_pin = held.holder.is_none() && net.pinned().binary_search(&index).is_ok();
    if (is_paused || is_own_pin) && place != target {
        // The next tick would put the particles of a pinned part there; paused, there is none.
        let together = held.holder.and_then(|(holder, _)| parts.get(holder).ok());
        let alone = [index];
        let together = together.map_or(&alone[..], PartState::particles);
        let positions = net.positions_mut();
        for particle in together.iter().filter(|particle| **particle != index) {
            if let Some(other) = positions.get_mut(*particle as usize) {
                *other += target - place;
            }
        }
        positions[index as usize] = target;
    }
}

/// Moves an entity to a place in the world, in two dimensions within its layer.
fn move_entity(
    entity: Entity,
    target: Vec3,
    dimensions: Dimensions,
    movable: &mut Movable,
    frames: &Query<&GlobalTransform>,
) {
    let Ok((mut transform, parent, _)) = movable.get_mut(entity) else { return };
    let local = match parent.and_then(|parent| frames.get(parent.parent()).ok()) {
        Some(parent) => parent.affine().inverse().transform_point3(target),
        None => target,
    };
    let local = match dimensions {
        Dimensions::Two => local.with_z(transform.translation.z),
        Dimensions::Three => local,
    };
    if local.is_finite() && transform.translation != local {
        transform.translation = local;
    }
}

/// Adds the pull to the force on a free particle, for this tick only.
pub(super) fn pull_particle(
    time: Res<Time>,
    settings: Res<ParticleDragSettings>,
    environment: Option<Res<Environment>>,
    (drag, mut grip): (Res<ParticleDrag>, ResMut<Grip>),
    mut particles: Query<(&Particle, &ParticleVelocity, Option<&mut AppliedForce>), Without<Pinned>>,
    mut nets: Query<&mut ParticleNet>,
    helper: TransformHelper,
    mut commands: Commands,
) {
    let (Some(held), Some(target)) = (&mut grip.0, drag.target) else { return };
    let gravity = environment.map_or(Vec3::ZERO, |environment| environment.effective_gravity());
    let pull_at = |held: &mut Held, mass: f32, position: Vec3, velocity: Vec3| {
        let away = target - position;
        let acceleration = pull_acceleration(away, velocity, &mut held.load, time.delta_secs(), &settings);
        Some(mass * (acceleration - gravity)).filter(|pull| pull.is_finite())
    };
    let entity = held.handle.entity;
    if let Some(index) = held.handle.index {
        let Ok(mut net) = nets.get_mut(entity) else { return };
        let place = index as usize;
        if place >= net.len() || held.holder.is_some() || net.pinned().binary_search(&index).is_ok() {
            return;
        }
        let (mass, position, velocity) =
            (net.masses()[place], net.positions()[place], net.velocities()[place]);
        if let Some(pull) = pull_at(held, mass, position, velocity) {
            held.inserted_force = net.applied_forces().is_empty();
            // Forces are read in each tick: the arrays as such have not changed.
            let force = &mut net.bypass_change_detection().applied_forces_mut()[place];
            held.pull = Some((*force, *force + pull));
            *force += pull;
        }
        return;
    }
    let Ok((particle, velocity, force)) = particles.get_mut(entity) else { return };
    let Some(mut force) = force else {
        // From the next tick on; commands cannot reach this one in every schedule.
        commands.entity(entity).try_insert(AppliedForce::default());
        held.inserted_force = true;
        return;
    };
    let Ok(position) = helper.compute_global_transform(entity) else { return };
    if let Some(pull) = pull_at(held, particle.mass, position.translation(), velocity.0) {
        held.pull = Some((force.0, force.0 + pull));
        force.0 += pull;
    }
}

/// Puts the force back to what the game had set, to the last bit.
pub(super) fn remove_pull(
    mut grip: ResMut<Grip>,
    mut forces: Query<&mut AppliedForce>,
    mut nets: Query<&mut ParticleNet>,
) {
    let Some(held) = &mut grip.0 else { return };
    let Some((before, after)) = held.pull.take() else { return };
    let entity = held.handle.entity;
    match held.handle.index {
        Some(index) => {
            let Ok(mut net) = nets.get_mut(entity) else { return };
            let net = net.bypass_change_detection();
            if net.applied_forces().get(index as usize) == Some(&after) {
                net.applied_forces_mut()[index as usize] = before;
            }
            if held.inserted_force && net.applied_forces().iter().all(|force| *force == Vec3::ZERO) {
                net.clear_applied_forces();
            }
        }
        None => {
            if let Ok(mut force) = forces.get_mut(entity)
                && force.0 == after
            {
                force.0 = before;
            }
        }
    }
}

/// The acceleration that brings a particle to rest at `away` from here.
///
/// a = ω² away − 2 ω v, critically damped, and in addition the `load`, the integral of ω³/8 away: it
/// converges to the weight of what hangs from the particle, which would else sag below the pointer.
/// All is held constant over a time step h. For u = ωh < 0.9 the eigenvalues of that recurrence are
/// inside the unit circle; 0.5 leaves a margin for the springs and dampers that pull as well.
fn pull_acceleration(
    away: Vec3,
    velocity: Vec3,
    load: &mut Vec3,
    step: f32,
    settings: &ParticleDragSettings,
) -> Vec3 {
    let limit = settings.max_acceleration;
    let frequency = if step > 0.0 { settings.frequency.min(0.5 / step) } else { settings.frequency };
    let wanted = frequency * frequency * away - 2.0 * frequency * velocity + *load;
    if wanted.length() <= limit {
        // Only while the pull is not at its limit: the load must not wind up towards a target out of reach.
        *load += step * 0.125 * frequency.powi(3) * away;
        *load = load.clamp_length_max(0.5 * limit);
    }
    wanted.clamp_length_max(limit)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pulls a particle that something else pulls down; returns where it comes to rest and how far it went.
    fn settle(step: f32, burden: Vec3, target: Vec3) -> (Vec3, Vec3, f32) {
        let settings = ParticleDragSettings::default();
        let (mut position, mut velocity) = (Vec3::ZERO, Vec3::new(0.0, 3.0, 0.0));
        let (mut load, mut farthest) = (Vec3::ZERO, 0.0f32);
        for _ in 0..(5.0 / step) as usize {
            let acceleration =
                burden + pull_acceleration(target - position, velocity, &mut load, step, &settings);
            position += step * velocity + 0.5 * step * step * acceleration;
            velocity += step * acceleration;
            farthest = farthest.max(position.distance(target));
        }
        (position, velocity, farthest)
    }

    #[test]
    fn the_pull_brings_a_particle_to_rest_on_the_target_at_any_time_step() {
        let target = Vec3::new(1.0, 0.5, -0.2);
        for step in [1.0 / 240.0, 1.0 / 60.0, 1.0 / 20.0] {
            for burden in [Vec3::ZERO, Vec3::new(0.0, -100.0, 0.0)] {
                let (position, velocity, farthest) = settle(step, burden, target);
                assert!(position.distance(target) < 1e-3, "{step} {burden}: {position}");
                assert!(velocity.length() < 1e-2, "{step} {burden}: {velocity}");
                assert!(farthest < 1.5, "{step} {burden}: overshoots to {farthest}");
            }
        }
    }

    #[test]
    fn the_pull_is_limited() {
        let settings = ParticleDragSettings { max_acceleration: 50.0, ..Default::default() };
        let mut load = Vec3::ZERO;
        let acceleration = pull_acceleration(Vec3::X * 1e6, Vec3::ZERO, &mut load, 1.0 / 60.0, &settings);
        assert!((acceleration.length() - 50.0).abs() < 1e-3 && load == Vec3::ZERO);
    }
}
