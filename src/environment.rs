//! What surrounds the particles: gravity and the viscosity of the medium.

use bevy::prelude::*;

use crate::parameter::{self, InvalidParameter};

/// Gravity and the viscous medium, one for all particles.
///
/// Each can be switched off without losing its value.
#[derive(Resource, Reflect, Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serialize",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
#[reflect(Resource, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct Environment {
    /// The acceleration g of gravity in m/s², finite. Default (0, −9.81, 0).
    pub gravity: Vec3,
    /// Whether gravity acts. Default true.
    pub gravity_enabled: bool,
    /// The viscosity ν of the medium in N·s/m, finite and >= 0: each particle feels −ν · velocity. Default 0.
    pub viscosity: f32,
    /// Whether the viscosity acts. Default true.
    pub viscosity_enabled: bool,
}

impl Environment {
    /// The gravity that acts, in m/s²: zero when it is switched off.
    pub fn effective_gravity(&self) -> Vec3 {
        if self.gravity_enabled { self.gravity } else { Vec3::ZERO }
    }

    /// The viscosity that acts, in N·s/m: zero when it is switched off.
    pub fn effective_viscosity(&self) -> f32 {
        if self.viscosity_enabled { self.viscosity } else { 0.0 }
    }

    /// Checks that gravity and viscosity are in their ranges.
    ///
    /// # Errors
    /// Names the field at fault.
    pub fn validate(&self) -> Result<(), InvalidParameter> {
        parameter::finite("gravity", self.gravity)?;
        parameter::non_negative("viscosity", self.viscosity)
    }
}

impl Default for Environment {
    fn default() -> Self {
        Self {
            gravity: Vec3::new(0.0, -9.81, 0.0),
            gravity_enabled: true,
            viscosity: 0.0,
            viscosity_enabled: true,
        }
    }
}
