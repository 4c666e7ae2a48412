//! Colliders that move by themselves.

use bevy::prelude::*;

use crate::parameter;

use super::ParticleCollider;

/// A velocity at which a [`ParticleCollider`] moves and turns about its origin, in the axes of its parent (the world,
/// where it has none): each tick moves its `Transform`, which is eased between ticks as that of particles is (feature
/// `interpolation`).
///
/// A game may write the `Transform` as well, the rest of the motion goes on from there.
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

impl ColliderMotion {
    /// The velocities, of which those that are not finite are 0.
    fn valid(&self) -> [Vec3; 2] {
        let valid =
            |field, vector: Vec3| if parameter::finite(field, vector).is_ok() { vector } else { Vec3::ZERO };
        [valid("velocity", self.velocity), valid("angular_velocity", self.angular_velocity)]
    }

    /// Moves a `transform` on by `duration` seconds, or back.
    fn apply(&self, transform: &mut Transform, duration: f32) {
        let [velocity, angular_velocity] = self.valid();
        if velocity != Vec3::ZERO {
            transform.translation += velocity * duration;
        }
        if angular_velocity != Vec3::ZERO {
            let turn = Quat::from_scaled_axis(angular_velocity * duration);
            transform.rotation = (turn * transform.rotation).normalize();
        }
    }

    /// Where it was a `time_step` in s ago, if it is at `transform` now.
    pub(crate) fn before(&self, transform: &Transform, time_step: f32) -> Transform {
        let mut before = *transform;
        self.apply(&mut before, -time_step);
        before
    }
}

/// Moves the colliders with a [`ColliderMotion`] by one tick.
pub(crate) fn move_colliders(
    time: Res<Time>,
    mut colliders: Query<(&ColliderMotion, &mut Transform), With<ParticleCollider>>,
) {
    for (motion, mut transform) in &mut colliders {
        if motion.valid() != [Vec3::ZERO; 2] {
            motion.apply(&mut transform, time.delta_secs());
        }
    }
}
