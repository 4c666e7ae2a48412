//! Which integration scheme runs, and in how many substeps.

use bevy::prelude::*;
#[cfg(feature = "serialize")]
use bevy::reflect::{ReflectDeserialize, ReflectSerialize};

pub use crate::solver::{Integrator, SubstepMode, UnknownIntegrator};

/// How a tick is integrated.
///
/// A named [`integrator`](Self::integrator) with [`SubstepMode::Fixed`] runs exactly that, whatever comes
/// of it: explicit Euler may be watched exploding. The defaults never do.
#[derive(Resource, Reflect, Debug, Clone, Copy, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[reflect(Resource, Default, Debug, Clone, PartialEq)]
pub struct SolverSettings {
    /// The integration scheme. Default [`Integrator::Auto`].
    pub integrator: Integrator,
    /// How many substeps a tick is divided into. Default [`SubstepMode::Auto`].
    pub substeps: SubstepMode,
}

/// What becomes of a spring when a particle that it joins is despawned.
#[derive(Resource, Reflect, Debug, Clone, Copy, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[reflect(Resource, Default, Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum OrphanedSprings {
    /// Its entity is despawned in the next tick. The default.
    #[default]
    Despawn,
    /// It stays, without effect, until it gets other ends; one warning names it.
    Keep,
}
