//! Colliders that move by themselves.

use bevy::prelude::*;

use crate::parameter;

use super::ParticleCollider;

/// A velocity at which a [`ParticleCollider`] moves and turns about its origin, in the axes of its parent (the world,
/// where it has none): each tick moves its `Transform`.
#[derive(Component, Reflect, Debug, Clone, Copy, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct ColliderMotion {
    /// m/s. Default 0. Ignored if not finite.
    pub velocity: Vec3,
    /// rad/s. Default 0. Ignored if not finite.
    pub angular_velocity: Vec3,
}

/// Moves the colliders with a [`ColliderMotion`] by one tick.
pub(crate) fn move_colliders(
    time: Res<Time>,
    mut colliders: Query<(&ColliderMotion, &mut Transform), With<ParticleCollider>>,
) {
    for (motion, mut transform) in &mut colliders {
        let duration = time.delta_secs();
        if parameter::finite("velocity", motion.velocity).is_ok() && motion.velocity != Vec3::ZERO {
            transform.translation += motion.velocity * duration;
        }
        if parameter::finite("angular_velocity", motion.angular_velocity).is_ok()
            && motion.angular_velocity != Vec3::ZERO
        {
            let turn = Quat::from_scaled_axis(motion.angular_velocity * duration);
            transform.rotation = (turn * transform.rotation).normalize();
        }
    }
}
