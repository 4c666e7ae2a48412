//! Which integration scheme runs, and in how many substeps.

use bevy::prelude::*;
#[cfg(feature = "serialize")]
use bevy::reflect::{ReflectDeserialize, ReflectSerialize};

use crate::parameter::{self, InvalidParameter};
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

/// Whether what rests falls asleep: it costs nothing then, until something happens to it.
///
/// Particles, and what elements join, fall asleep together with all that they touch, when for the whole
/// [`delay`](Self::delay) each of them stayed within a fifth of [`speed`](Self::speed) · delay of where it was (loose ones
/// that touch something within 1 % of their radius, if that is more), was never faster than ten times that speed, and neither
/// dampers nor drag held it back. What elements hold is then out of balance by
/// less than 5.2 speed / delay (with the defaults a thousandth of gravity), so that neither a pendulum at its turning point nor
/// what creeps sleeps. Asleep they do not move by a bit and have no velocity.
///
/// What wakes them: what is awake and comes near, another [`AppliedForce`](crate::AppliedForce), velocity or `Transform`,
/// motion of what holds them, edits, changed settings, colliders that move or change. The sleeping ones are in
/// [`SleepingParticles`](crate::report::SleepingParticles), in apps that insert it.
///
/// Where it is enabled, loose particles in a pile that no contact lets slip stay where they are, as do those that
/// would move by less than a tenth of what gravity gives in a substep: piles come to rest. That changes where piles end up, which is
/// why it is off by default.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_mass_spring::prelude::*;
/// # let mut app = App::new();
/// app.insert_resource(SleepSettings { enabled: true, ..default() });
/// ```
#[derive(Resource, Reflect, Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[reflect(Resource, Default, Debug, Clone, PartialEq)]
pub struct SleepSettings {
    /// Whether anything falls asleep. Default false.
    pub enabled: bool,
    /// The speed that counts as rest, m/s, finite and >= 0. Default 0.001.
    pub speed: f32,
    /// For how long particles rest before they fall asleep, s, finite and > 0. Default 0.5.
    pub delay: f32,
}

impl SleepSettings {
    /// Checks that speed and delay are in their ranges.
    ///
    /// # Errors
    /// Names the field at fault.
    pub fn validate(&self) -> Result<(), InvalidParameter> {
        parameter::non_negative("speed", self.speed)?;
        parameter::positive("delay", self.delay)
    }
}

impl Default for SleepSettings {
    fn default() -> Self {
        Self { enabled: false, speed: 0.001, delay: 0.5 }
    }
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
