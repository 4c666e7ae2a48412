//! The bend of three particles: what makes a rope a rod.

use bevy::ecs::entity::MapEntities;
use bevy::prelude::*;

use crate::parameter::{self, InvalidParameter};

/// Resistance against bending at the middle one of three particles, on an entity of its own.
///
/// With s = x_a − 2 x_b + x_c, which is zero where b is in the middle between a and c, it holds the energy
/// ½ [`stiffness`](Self::stiffness) · ‖s‖². Its forces are along s: one part on a and c, minus two parts on b, so that
/// they change neither momentum nor angular momentum.
///
/// A rod of bending stiffness EI (N·m², the material's modulus times the second moment of its section) in links of h m
/// has bends of EI / h³ at all of its inner particles: ‖s‖ / h² is its curvature.
///
/// ```
/// use bevy::prelude::*;
/// use bevy_mass_spring::prelude::*;
///
/// /// A fishing rod of ten links of 20 cm, held by its first two particles.
/// fn spawn_rod(mut commands: Commands) {
///     let particles: Vec<Entity> = (0..=10)
///         .map(|number| {
///             let place = Transform::from_xyz(0.2 * number as f32, 1.0, 0.0);
///             let mut particle = commands.spawn((Particle::new(0.02, 0.01), place));
///             if number < 2 {
///                 particle.insert(Pinned);
///             }
///             particle.id()
///         })
///         .collect();
///     for link in particles.windows(2) {
///         commands.spawn(Spring::new(link[0], link[1], 0.2).with_stiffness(2e4));
///     }
///     for bend in particles.windows(3) {
///         commands.spawn(Bend::new(bend[0], bend[1], bend[2]).with_stiffness(3.0 / 0.2_f32.powi(3)));
///     }
/// }
/// ```
///
/// What is changed between two ticks goes from the old value to the new one over the substeps of the next tick, as that of
/// a [`Spring`](crate::spring::Spring) does. A bend with an end that does not exist, or with bad values, is left out of the
/// simulation, with one warning that names it, until it is corrected.
#[derive(Component, MapEntities, Reflect, Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Component, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct Bend {
    /// a, b and c, the second in the middle: three different entities with a [`Particle`](crate::particle::Particle).
    #[entities]
    pub particles: [Entity; 3],
    /// Stiffness k in N/m, finite and >= 0. Default 10.
    pub stiffness: f32,
    /// Damping along s in N·s/m, finite and >= 0. Default 0.
    pub damping: f32,
}

impl Bend {
    /// The stiffness that [`Bend::new`] gives, in N/m.
    pub const DEFAULT_STIFFNESS: f32 = 10.0;

    /// A bend at `middle` with the default stiffness, without damping.
    pub const fn new(first: Entity, middle: Entity, last: Entity) -> Self {
        Self { particles: [first, middle, last], stiffness: Self::DEFAULT_STIFFNESS, damping: 0.0 }
    }

    /// The same bend with another stiffness, in N/m.
    pub const fn with_stiffness(mut self, stiffness: f32) -> Self {
        self.stiffness = stiffness;
        self
    }

    /// The same bend with another damping, in N·s/m.
    pub const fn with_damping(mut self, damping: f32) -> Self {
        self.damping = damping;
        self
    }

    /// Checks that stiffness and damping are in their ranges.
    ///
    /// # Errors
    /// Names the field at fault.
    pub fn validate(&self) -> Result<(), InvalidParameter> {
        parameter::non_negative("stiffness", self.stiffness)?;
        parameter::non_negative("damping", self.damping)
    }
}
