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

/// In how many dimensions particles move.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_mass_spring::prelude::*;
/// # let mut app = App::new();
/// # app.add_plugins((MinimalPlugins, MassSpringPlugin::default()));
/// app.insert_resource(Dimensions::Two);
/// // Where a pixel is a metre, gravity is in pixels per s².
/// app.world_mut().resource_mut::<Environment>().gravity = Vec3::NEG_Y * 981.0;
/// # app.update();
/// ```
#[derive(Resource, Reflect, Debug, Clone, Copy, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[reflect(Resource, Default, Debug, Clone, PartialEq)]
pub enum Dimensions {
    /// All three of the world. The default.
    #[default]
    Three,
    /// x and y. The z of a `Transform` is its layer: the simulation neither reads nor writes it.
    ///
    /// Distances are measured in the plane, on whatever layers particles are; z of velocities, of gravity and of
    /// applied forces counts as 0. A `ParticleCollider` is where it cuts the plane of motion.
    ///
    /// All units stay as they are. Where coordinates are pixels, a metre is a pixel: gravity is in px/s², velocities
    /// in px/s, and forces in kg·px/s²; stiffness in N/m (kg/s²) has no length in it and stays the same number.
    Two,
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
