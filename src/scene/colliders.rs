//! The colliders of a scene file.

use bevy::math::{Quat, Vec3};
use bevy::prelude::*;
use serde::{Deserialize, Serialize};

use crate::collider::{ColliderMotion, ColliderShape, ParticleCollider};
use crate::parameter::{self, InvalidParameter};

/// One collider.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename = "Collider", deny_unknown_fields)]
pub struct SceneCollider {
    /// Its geometry, in its own axes.
    pub shape: ColliderShape,
    /// Where it is, m, finite.
    pub position: Vec3,
    /// Its rotation: a quaternion, finite and not zero; of any length. Default: none.
    #[serde(default, skip_serializing_if = "is_default")]
    pub rotation: Quat,
    /// Its velocity, m/s, finite. Default 0.
    #[serde(default, skip_serializing_if = "is_default")]
    pub velocity: Vec3,
    /// Its angular velocity about `position`, rad/s, finite. Default 0.
    #[serde(default, skip_serializing_if = "is_default")]
    pub angular_velocity: Vec3,
    /// Coefficient of restitution, 0 to 1. Default 0.
    #[serde(default)]
    pub restitution: f32,
    /// Coefficient of Coulomb friction, finite and >= 0. Default 0.
    #[serde(default)]
    pub friction: f32,
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

impl SceneCollider {
    /// Checks all but its shape.
    pub(super) fn validate(&self) -> Result<(), InvalidParameter> {
        parameter::finite("position", self.position)?;
        if self.unit_rotation().is_none() {
            let value = format!("{:?}", self.rotation.to_array());
            return Err(InvalidParameter {
                field: "rotation",
                value,
                expected: "finite numbers that are not all 0",
            });
        }
        parameter::finite("velocity", self.velocity)?;
        parameter::finite("angular_velocity", self.angular_velocity)?;
        parameter::fraction("restitution", self.restitution)?;
        parameter::non_negative("friction", self.friction)
    }

    /// The rotation at length 1; `None` if it is zero or not finite.
    fn unit_rotation(&self) -> Option<Quat> {
        let rotation = self.rotation.as_dquat();
        let length = rotation.length();
        (length > 0.0 && length.is_finite()).then(|| (rotation / length).as_quat())
    }

    /// Spawns it as an ordinary entity.
    pub(super) fn spawn(&self, commands: &mut Commands) -> Entity {
        let collider = ParticleCollider::new(self.shape.clone());
        let rotation = self.unit_rotation().unwrap_or_default();
        let mut entity = commands.spawn((
            collider.with_restitution(self.restitution).with_friction(self.friction),
            Transform::from_translation(self.position).with_rotation(rotation),
        ));
        let motion = ColliderMotion { velocity: self.velocity, angular_velocity: self.angular_velocity };
        if motion != ColliderMotion::default() {
            entity.insert(motion);
        }
        entity.id()
    }
}
