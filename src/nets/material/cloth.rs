//! Materials of cloths and of the skins of balloons.

use bevy::prelude::*;

use crate::parameter::{self, InvalidParameter};

/// What a cloth is made of.
///
/// Stiffnesses are forces per width, as fabric is measured (KES-F: 1 gf/cm = 0.981 N/m, 1 gf/(cm·°) of shear = 56.2
/// N/m, 1 gf·cm²/cm of bending = 9.81e-5 N·m). The constants of woven cloths are typical of the ranges in Kawabata,
/// *The Standardization and Analysis of Hand Evaluation*, 2nd ed. 1980, as each says; those of films and sheets
/// follow from modulus E, thickness t and Poisson's ratio 1/3: E t, 3/8 E t and E t³/12. Retardation times are
/// [estimates](super::RopeMaterial).
#[derive(Reflect, Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct ClothMaterial {
    /// Mass per area, kg/m², > 0.
    pub area_density: f32,
    /// Stretch stiffness K, N/m, > 0: a strip of width w and length l pulled by F along the threads, its sides free,
    /// lengthens by F l / (w K). Of a mesh: in every direction.
    pub stretch_stiffness: f32,
    /// Shear stiffness G, N/m, >= 0: the shear force per width that turns warp against weft by one radian, and, as
    /// springs have it, the Poisson coupling: Poisson's ratio is 2 G / (K + √(K² + 4 G²)). Meshes have 3/8 K
    /// instead.
    pub shear_stiffness: f32,
    /// Bending stiffness D, N·m, >= 0: a strip of width w under a moment M, its sides free, bends to the curvature
    /// M / (w D).
    pub bending_stiffness: f32,
    /// Retardation time τ, s, >= 0 (Kelvin–Voigt): every damping is τ times its stiffness.
    pub retardation_time: f32,
}

#[cfg(feature = "serialize")]
use bevy::reflect::{ReflectDeserialize, ReflectSerialize};

/// Cotton.
impl Default for ClothMaterial {
    fn default() -> Self {
        Self::COTTON
    }
}

impl ClothMaterial {
    /// Silk habotai: 60 g/m², 2 % at 490 N/m, shear 0.3 gf/(cm·°), bending 0.03 gf·cm²/cm (Kawabata 1980).
    pub const SILK: Self = Self {
        area_density: 0.06,
        stretch_stiffness: 2.5e4,
        shear_stiffness: 17.0,
        bending_stiffness: 3e-6,
        retardation_time: 2e-3,
    };

    /// Plain cotton: 150 g/m², 3 % at 490 N/m, shear 1 gf/(cm·°), bending 0.08 gf·cm²/cm (Kawabata 1980).
    pub const COTTON: Self = Self {
        area_density: 0.15,
        stretch_stiffness: 1.6e4,
        shear_stiffness: 56.0,
        bending_stiffness: 8e-6,
        retardation_time: 5e-3,
    };

    /// Worsted wool suiting: 220 g/m², 4 % at 490 N/m, shear 0.7 gf/(cm·°), bending 0.12 gf·cm²/cm (Kawabata 1980).
    pub const WOOL: Self = Self {
        area_density: 0.22,
        stretch_stiffness: 1.2e4,
        shear_stiffness: 39.0,
        bending_stiffness: 1.2e-5,
        retardation_time: 1e-2,
    };

    /// Denim: 400 g/m², 1.5 % at 490 N/m, shear 4 gf/(cm·°), bending 0.8 gf·cm²/cm (the stiff end of Kawabata's
    /// ranges).
    pub const DENIM: Self = Self {
        area_density: 0.4,
        stretch_stiffness: 3.3e4,
        shear_stiffness: 225.0,
        bending_stiffness: 8e-5,
        retardation_time: 1e-2,
    };

    /// Leather of 1.2 mm: density 950 kg/m³, Young's modulus 0.1 GPa (Ashby, *Materials Selection in Mechanical
    /// Design*, 4th ed., app. A: 810 to 1050 kg/m³, 0.1 to 0.5 GPa).
    pub const LEATHER: Self = Self {
        area_density: 1.14,
        stretch_stiffness: 1.2e5,
        shear_stiffness: 4.5e4,
        bending_stiffness: 1.44e-2,
        retardation_time: 1e-2,
    };

    /// A sheet of natural rubber of 1 mm: density 930 kg/m³, Young's modulus 1.5 MPa (Ashby, app. A).
    pub const RUBBER_SHEET: Self = Self {
        area_density: 0.93,
        stretch_stiffness: 1.5e3,
        shear_stiffness: 560.0,
        bending_stiffness: 1.25e-4,
        retardation_time: 5e-3,
    };

    /// Office paper of 80 g/m² and 0.1 mm: Young's modulus 4 GPa (Ashby, app. A: 3 to 8.9 GPa).
    pub const PAPER: Self = Self {
        area_density: 0.08,
        stretch_stiffness: 4e5,
        shear_stiffness: 1.5e5,
        bending_stiffness: 3.3e-4,
        retardation_time: 1e-4,
    };

    /// All of these, by their names.
    pub const ALL: [(&'static str, Self); 7] = [
        ("SILK", Self::SILK),
        ("COTTON", Self::COTTON),
        ("WOOL", Self::WOOL),
        ("DENIM", Self::DENIM),
        ("LEATHER", Self::LEATHER),
        ("RUBBER_SHEET", Self::RUBBER_SHEET),
        ("PAPER", Self::PAPER),
    ];

    /// Checks that all numbers are in their ranges.
    ///
    /// # Errors
    /// Names the field at fault.
    pub fn validate(&self) -> Result<(), InvalidParameter> {
        parameter::positive("area_density", self.area_density)?;
        parameter::positive("stretch_stiffness", self.stretch_stiffness)?;
        parameter::non_negative("shear_stiffness", self.shear_stiffness)?;
        parameter::non_negative("bending_stiffness", self.bending_stiffness)?;
        parameter::non_negative("retardation_time", self.retardation_time)
    }
}

/// What the skin of a balloon is made of, and the gas in it.
#[derive(Reflect, Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct BalloonMaterial {
    /// Mass of the skin per area, kg/m², > 0.
    pub area_density: f32,
    /// Stretch stiffness of the skin, N/m, > 0: modulus times thickness. Poisson's ratio is 1/3.
    pub stretch_stiffness: f32,
    /// Bending stiffness D of the skin, N·m, >= 0.
    pub bending_stiffness: f32,
    /// Pressure of the gas above the surroundings at the rest volume, Pa, >= 0.
    pub pressure: f32,
    /// Retardation time τ, s, >= 0 (Kelvin–Voigt): every damping is τ times its stiffness.
    pub retardation_time: f32,
}

/// Latex.
impl Default for BalloonMaterial {
    fn default() -> Self {
        Self::LATEX
    }
}

impl BalloonMaterial {
    /// A party balloon, blown up to a skin of 0.05 mm of natural rubber: density 930 kg/m³, Young's modulus 1.5 MPa
    /// (Ashby, *Materials Selection in Mechanical Design*, 4th ed., app. A). 15 Pa stretch one of 0.15 m of radius by
    /// 1 %: p r / (3 K).
    pub const LATEX: Self = Self {
        area_density: 0.0465,
        stretch_stiffness: 75.0,
        bending_stiffness: 0.0,
        pressure: 15.0,
        retardation_time: 5e-3,
    };

    /// An inflatable ball of soft PVC of 0.25 mm: density 1300 kg/m³, Young's modulus 10 MPa. Both go by the plasticiser
    /// and are chosen within the stated ranges: 1100 to 1450 kg/m³ for mouldings of flexible PVC (*Boletim Técnico nº 03
    /// PVC: Propriedades de referência dos compostos de PVC*, rev. 1, July 2002), 1.5 to 15 MPa for soft PVC (Bewin
    /// Plastics, a maker of PVC sheets, `bewinplastics.com/news-show-1038859.html`).
    pub const VINYL: Self = Self {
        area_density: 0.325,
        stretch_stiffness: 2.5e3,
        bending_stiffness: 1.3e-5,
        pressure: 500.0,
        retardation_time: 5e-3,
    };

    /// All of these, by their names.
    pub const ALL: [(&'static str, Self); 2] = [("LATEX", Self::LATEX), ("VINYL", Self::VINYL)];

    /// Checks that all numbers are in their ranges.
    ///
    /// # Errors
    /// Names the field at fault.
    pub fn validate(&self) -> Result<(), InvalidParameter> {
        parameter::positive("area_density", self.area_density)?;
        parameter::positive("stretch_stiffness", self.stretch_stiffness)?;
        parameter::non_negative("bending_stiffness", self.bending_stiffness)?;
        parameter::non_negative("pressure", self.pressure)?;
        parameter::non_negative("retardation_time", self.retardation_time)
    }
}
