//! Plastic nets: what stays longer, or shorter, than it was.

use std::sync::Arc;

use bevy::prelude::*;

use super::{ParticleNet, Topology};
use crate::parameter::{self, InvalidParameter};
use crate::solver::{Plasticity, Spring};

/// Beside a net: at which strain its springs yield, and stay longer, or shorter, than they were. Default: they never do.
///
/// Perfect plasticity, independent of the rate, spring by spring (J. C. Simo and T. J. R. Hughes, *Computational
/// Inelasticity*, 1998, box 1.4, without hardening): with the length l and the rest length l₀ of a spring its elastic
/// strain is e = l/l₀ − 1 − p. It never exceeds the yield strain ε either way: the plastic strain p follows, up to its
/// limit, from where on the spring is elastic again. A spring that was stretched to the strain s and is let go keeps
/// p = s − ε. Where the net only pulls (`tension_only`), nothing yields by being shortened. Bends stay elastic.
///
/// - A **rope** or a cloth of no shear stiffness, stretched along the threads by the strain s, keeps s − ε.
/// - Of a **cloth** the threads yield first and the diagonals remain elastic until three times ε or more. With the stretch and
///   shear stiffnesses K and G, C = (K + √(K² + 4 G²)) / 2, it keeps (s − ε)(C − G) / K.
/// - Of a **jelly** under an axial load the springs along it yield first: beyond ε its tangent modulus is 3/5 of Young's
///   modulus, and it keeps 2/5 (s − ε), until the diagonals yield, too, at s = 8/3 ε.
///
/// Changed values act from the next tick on, and what has yielded stays so, also with `None`; so it does in another material, in
/// pieces that are torn off, and on a winch. Bad values are named in the log once, and nothing is changed then. It is a
/// component of its own, as [`Breaking`](crate::nets::Breaking) is: to remove it changes nothing.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_mass_spring::prelude::*;
/// fn wire(mut commands: Commands) {
///     // Soft steel yields at 0.2 % and bears a fifth of its length.
///     let wire = Rope::new(1.0).with_material(RopeMaterial::STEEL_ROD.of_diameter(2e-3, true));
///     commands.spawn((wire, Yielding { strain: Some(2e-3), max_strain: Some(0.2) }));
/// }
/// ```
#[derive(Component, Reflect, Debug, Clone, Copy, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct Yielding {
    /// The elastic strain beyond which springs yield, a part of their rest lengths. Finite and >= 0. Default `None`: never.
    pub strain: Option<f32>,
    /// The greatest plastic strain, either way, a part of the rest lengths; no spring is shortened by more than all of
    /// its own. One that is beyond a limit that was lowered can only come back. Finite and >= 0. Default `None`: no limit.
    pub max_strain: Option<f32>,
}

#[cfg(feature = "serialize")]
use bevy::reflect::{ReflectDeserialize, ReflectSerialize};

impl Yielding {
    /// Checks that both are in their ranges.
    ///
    /// # Errors
    /// Names the field at fault.
    pub fn validate(&self) -> Result<(), InvalidParameter> {
        self.strain.map_or(Ok(()), |strain| parameter::non_negative("strain", strain))?;
        self.max_strain.map_or(Ok(()), |strain| parameter::non_negative("max_strain", strain))
    }

    /// Gives the springs of a net these strains. They keep the plastic strain that they have.
    pub fn give_to(&self, topology: &mut Topology) {
        for (_, spring) in &mut topology.springs {
            spring.plasticity = self.of(spring);
        }
    }

    /// How a spring yields.
    pub(super) fn of(&self, spring: &Spring) -> Option<Plasticity> {
        let strain = spring.plasticity.map_or(0.0, |plasticity| plasticity.strain);
        // No strain is beyond the largest number.
        let yield_strain = self.strain.unwrap_or(f32::MAX);
        let max_strain = self.max_strain.unwrap_or(f32::MAX);
        let is_elastic = self.strain.is_none() && strain == 0.0;
        (!is_elastic).then_some(Plasticity { yield_strain, max_strain, strain })
    }
}

impl ParticleNet {
    /// Gives the springs their yield strains, where they have not got them.
    pub(crate) fn give_yielding(&mut self, yielding: Yielding) {
        yielding.give_to(Arc::make_mut(&mut self.topology));
        if let Some(spool) = &mut self.spool {
            spool.give_yielding(&yielding);
        }
        self.yielding = yielding;
        self.versions.touch_parameters();
    }

    /// How its springs yield.
    pub(crate) fn yielding(&self) -> Yielding {
        self.yielding
    }

    /// A spring has another plastic strain by now.
    pub(crate) fn yield_spring(&mut self, spring: u32, strain: f32) {
        if let Some((_, spring)) = Arc::make_mut(&mut self.topology).springs.get_mut(spring as usize)
            && let Some(plasticity) = &mut spring.plasticity
        {
            plasticity.strain = strain;
            self.versions.touch_parameters();
        }
    }
}
