//! Materials of ropes.

use bevy::prelude::*;

use crate::parameter::{self, InvalidParameter};

/// What a rope is made of.
///
/// The constants are those of ropes of [`REFERENCE_DIAMETER`](Self::REFERENCE_DIAMETER);
/// [`of_diameter`](Self::of_diameter) makes others of them. Two of their numbers are in no data sheet. The bending stiffness
/// of a fibre rope, in which yarns slide, lies between that of the yarns and that of a solid rod, EA d² / 16: the constants
/// have 1/144 (hemp) to 1/3500 (polyethylene) of the latter. Retardation times are estimates: τ damps an oscillation of the
/// frequency f with the loss factor 2π f τ, in rubber (5 ms) 0.03 at 1 Hz and 0.3 at 10 Hz.
#[derive(Reflect, Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct RopeMaterial {
    /// Mass per length, kg/m, > 0.
    pub linear_density: f32,
    /// Stretch stiffness EA, N, > 0: a rope of length l pulled by F lengthens by F l / EA.
    pub stretch_stiffness: f32,
    /// Bending stiffness EI, N·m², >= 0: a moment M bends it to the curvature M / EI.
    pub bending_stiffness: f32,
    /// Retardation time τ, s, >= 0 (Kelvin–Voigt): every damping is τ times its stiffness.
    pub retardation_time: f32,
}

#[cfg(feature = "serialize")]
use bevy::reflect::{ReflectDeserialize, ReflectSerialize};

/// Hemp.
impl Default for RopeMaterial {
    fn default() -> Self {
        Self::HEMP
    }
}

impl RopeMaterial {
    /// The diameter of the ropes that the constants describe, m.
    pub const REFERENCE_DIAMETER: f32 = 0.01;

    /// Wire rope 6×19 with a fibre core, of 10 mm. Mass 0.359 kg/m and metallic cross-section 38.4 mm² (EN 12385-4, in
    /// Feyrer, *Wire Ropes*, 2nd ed. 2015, table 1.9); modulus of the rope on that area about 100 GPa (Feyrer, ch. 2);
    /// bending stiffness the sum of those of its 114 wires of 0.65 mm, E = 200 GPa, which slide (Costello, *Theory of
    /// Wire Rope*, 1997).
    pub const STEEL_CABLE: Self = Self {
        linear_density: 0.359,
        stretch_stiffness: 3.84e6,
        bending_stiffness: 0.2,
        retardation_time: 1e-3,
    };

    /// Three-strand natural fibre (hemp, manila) of 10 mm: about 0.067 kg/m, breaks near 6 kN at an elongation near
    /// 13 % (McKenna, Hearle and O'Hear, *Handbook of Fibre Rope Technology*, 2004): EA is the secant.
    pub const HEMP: Self = Self {
        linear_density: 0.067,
        stretch_stiffness: 4.6e4,
        bending_stiffness: 2e-3,
        retardation_time: 0.02,
    };

    /// Three-strand nylon (polyamide 6) of 10 mm: about 0.062 kg/m, breaks near 20 kN at an elongation near 40 %
    /// (McKenna, Hearle and O'Hear 2004).
    pub const NYLON: Self = Self {
        linear_density: 0.062,
        stretch_stiffness: 5.0e4,
        bending_stiffness: 1e-3,
        retardation_time: 0.02,
    };

    /// Braided high-modulus polyethylene of 10 mm: about 0.052 kg/m, breaks near 100 kN at an elongation near 3.5 %
    /// (McKenna, Hearle and O'Hear 2004).
    pub const POLYETHYLENE: Self = Self {
        linear_density: 0.052,
        stretch_stiffness: 2.8e6,
        bending_stiffness: 5e-3,
        retardation_time: 5e-3,
    };

    /// A cord of natural rubber of 10 mm: density 930 kg/m³, Young's modulus 1.5 MPa (Ashby, *Materials Selection in
    /// Mechanical Design*, 4th ed., app. A); solid, so that EI = E π d⁴/64.
    pub const RUBBER_CORD: Self = Self {
        linear_density: 0.073,
        stretch_stiffness: 118.0,
        bending_stiffness: 7.4e-4,
        retardation_time: 5e-3,
    };

    /// A rod of spring steel of 10 mm: density 7850 kg/m³, Young's modulus 206 GPa (EN 10270-1); solid.
    pub const STEEL_ROD: Self = Self {
        linear_density: 0.6165,
        stretch_stiffness: 1.618e7,
        bending_stiffness: 101.1,
        retardation_time: 1e-4,
    };

    /// The same material in a rope of another diameter, m: mass and stretch stiffness go by its square. So does the
    /// bending stiffness per yarn or wire, of which there are more: EI goes by the fourth power only in a solid rod,
    /// as `is_solid` says.
    pub fn of_diameter(self, diameter: f32, is_solid: bool) -> Self {
        let squared = (diameter / Self::REFERENCE_DIAMETER) * (diameter / Self::REFERENCE_DIAMETER);
        Self {
            linear_density: self.linear_density * squared,
            stretch_stiffness: self.stretch_stiffness * squared,
            bending_stiffness: self.bending_stiffness * squared * if is_solid { squared } else { 1.0 },
            ..self
        }
    }

    /// All of these, by their names.
    pub const ALL: [(&'static str, Self); 6] = [
        ("STEEL_CABLE", Self::STEEL_CABLE),
        ("HEMP", Self::HEMP),
        ("NYLON", Self::NYLON),
        ("POLYETHYLENE", Self::POLYETHYLENE),
        ("RUBBER_CORD", Self::RUBBER_CORD),
        ("STEEL_ROD", Self::STEEL_ROD),
    ];

    /// Checks that all numbers are in their ranges.
    ///
    /// # Errors
    /// Names the field at fault.
    pub fn validate(&self) -> Result<(), InvalidParameter> {
        parameter::positive("linear_density", self.linear_density)?;
        parameter::positive("stretch_stiffness", self.stretch_stiffness)?;
        parameter::non_negative("bending_stiffness", self.bending_stiffness)?;
        parameter::non_negative("retardation_time", self.retardation_time)
    }
}
