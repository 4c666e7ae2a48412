//! What surrounds the particles: gravity, the viscosity of the medium, and the air.

use bevy::prelude::*;

use crate::parameter::{self, InvalidParameter};

/// Gravity, the viscous medium and the air, one for all particles.
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
    /// The velocity of the air in m/s, finite. Default 0: it stands still.
    ///
    /// The air acts on ropes and on the surfaces of cloths, jellies and balloons, by drag and lift; not on single
    /// particles.
    pub wind: Vec3,
    /// The density of the air in kg/m³, finite and >= 0. Default 0: no aerodynamic forces. At sea level 1.225, water 1000.
    pub air_density: f32,
    /// How the wind varies in place and time. Default `None`: it does not.
    pub gusts: Option<Gusts>,
    /// Whether the air acts. Default true.
    pub air_enabled: bool,
}

/// Gusts: a velocity that is added to [`Environment::wind`], random, smooth in place and time, and carried along by the
/// wind. The same seed gives the same gusts, on every machine and after every restart.
#[derive(Reflect, Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serialize",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
#[reflect(Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct Gusts {
    /// The greatest gust along each axis, m/s, finite and >= 0. Default 2.
    pub strength: f32,
    /// The distance over which gusts differ, m, finite and > 0. Default 3.
    pub length: f32,
    /// The time in which a gust turns into another one as the wind carries it along, s, finite and > 0. Default 2.
    pub time: f32,
    /// Another seed gives other gusts. Default 0.
    pub seed: u32,
}

impl Default for Gusts {
    fn default() -> Self {
        Self { strength: 2.0, length: 3.0, time: 2.0, seed: 0 }
    }
}

impl Gusts {
    /// Checks that strength, length and time are in their ranges.
    ///
    /// # Errors
    /// Names the field at fault.
    pub fn validate(&self) -> Result<(), InvalidParameter> {
        parameter::non_negative("strength", self.strength)?;
        parameter::positive("length", self.length)?;
        parameter::positive("time", self.time)
    }
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

    /// The density of the air that acts, in kg/m³: zero when it is switched off.
    pub fn effective_air_density(&self) -> f32 {
        if self.air_enabled { self.air_density } else { 0.0 }
    }

    /// Checks that all values are in their ranges.
    ///
    /// # Errors
    /// Names the field at fault.
    pub fn validate(&self) -> Result<(), InvalidParameter> {
        parameter::finite("gravity", self.gravity)?;
        parameter::non_negative("viscosity", self.viscosity)?;
        parameter::finite("wind", self.wind)?;
        parameter::non_negative("air_density", self.air_density)?;
        self.gusts.map_or(Ok(()), |gusts| gusts.validate())
    }
}

impl Default for Environment {
    fn default() -> Self {
        Self {
            gravity: Vec3::new(0.0, -9.81, 0.0),
            gravity_enabled: true,
            viscosity: 0.0,
            viscosity_enabled: true,
            wind: Vec3::ZERO,
            air_density: 0.0,
            gusts: None,
            air_enabled: true,
        }
    }
}
