//! Materials of jellies.

use bevy::prelude::*;

use crate::parameter::{self, InvalidParameter};

/// What a jelly is made of. Poisson's ratio is 1/4, as springs have it. Retardation times of the constants are
/// [estimates](super::RopeMaterial).
#[derive(Reflect, Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct JellyMaterial {
    /// Density, kg/m³, > 0.
    pub density: f32,
    /// Young's modulus E, Pa, > 0: a bar of cross-section A and length l pulled by F lengthens by F l / (A E).
    pub youngs_modulus: f32,
    /// Retardation time τ, s, >= 0 (Kelvin–Voigt): every damping is τ times its stiffness.
    pub retardation_time: f32,
}

#[cfg(feature = "serialize")]
use bevy::reflect::{ReflectDeserialize, ReflectSerialize};

/// Ballistic gelatine: a cube of one metre stands, shorter by a twentieth.
impl Default for JellyMaterial {
    fn default() -> Self {
        Self::BALLISTIC_GELATINE
    }
}

impl JellyMaterial {
    /// A firm gelatine dessert, one part of gelatine in 12 of water: Bonavia (arXiv 2512.20502, 2025) measured
    /// instantaneous stiffnesses of 4.3 kPa at 1 : 20 to 277 kPa at 1 : 2, in between by a power law: 11 kPa.
    pub const GELATINE: Self = Self { density: 1020.0, youngs_modulus: 1e4, retardation_time: 0.01 };

    /// Ballistic gelatine of 10 % at 4 °C: about 100 kPa (Cronin and Falzon, *Characterization of 10% ballistic
    /// gelatin*, 2011).
    pub const BALLISTIC_GELATINE: Self =
        Self { density: 1030.0, youngs_modulus: 1e5, retardation_time: 3e-3 };

    /// Soft silicone rubber, Shore 00-30: 69 kPa of stress at a strain of 100 %, taken as Young's modulus; density 1070
    /// kg/m³ (Smooth-On, Ecoflex 00-30, technical bulletin).
    pub const SOFT_SILICONE: Self = Self { density: 1070.0, youngs_modulus: 6.9e4, retardation_time: 5e-3 };

    /// Soft natural rubber: 1.5 MPa, 930 kg/m³ (Ashby, *Materials Selection in Mechanical Design*, 4th ed., app. A).
    pub const SOFT_RUBBER: Self = Self { density: 930.0, youngs_modulus: 1.5e6, retardation_time: 2e-3 };

    /// Flexible polymer foam of low density: 1 MPa at the soft end, 50 kg/m³ (Ashby, app. A: 38 to 70 kg/m³, 1 to 3
    /// MPa).
    pub const FOAM: Self = Self { density: 50.0, youngs_modulus: 1e6, retardation_time: 0.01 };

    /// All of these, by their names.
    pub const ALL: [(&'static str, Self); 5] = [
        ("GELATINE", Self::GELATINE),
        ("BALLISTIC_GELATINE", Self::BALLISTIC_GELATINE),
        ("SOFT_SILICONE", Self::SOFT_SILICONE),
        ("SOFT_RUBBER", Self::SOFT_RUBBER),
        ("FOAM", Self::FOAM),
    ];

    /// Checks that all numbers are in their ranges.
    ///
    /// # Errors
    /// Names the field at fault.
    pub fn validate(&self) -> Result<(), InvalidParameter> {
        parameter::positive("density", self.density)?;
        parameter::positive("youngs_modulus", self.youngs_modulus)?;
        parameter::non_negative("retardation_time", self.retardation_time)
    }
}
