//! The spring between two particles.

use bevy::ecs::entity::MapEntities;
use bevy::prelude::*;

use crate::parameter::{self, InvalidParameter};

/// A damped spring between two particles, on an entity of its own.
///
/// With d the unit vector from the second particle to the first, it pulls the first with
/// −[`stiffness`](Self::stiffness) · (length − [`rest_length`](Self::rest_length)) d
/// −[`damping`](Self::damping) · (relative velocity · d) d, and the second with the opposite
/// (Hooke's law with a dashpot along the spring). One that begins with both ends in the very same place parts
/// them along gravity, or in a direction of its own where there is none.
///
/// What is changed between two ticks (`rest_length`, `stiffness`, `damping`) goes from the old value to the new one in
/// equal parts over the substeps of the next tick, so that a winch that shortens its rope a little in every tick pulls
/// smoothly.
///
/// A spring whose particles do not exist or whose values are bad is left out of the simulation, with
/// one warning that names it, until it is corrected.
#[derive(Component, MapEntities, Reflect, Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Component, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct Spring {
    /// The two ends: two different entities with a [`Particle`](crate::particle::Particle).
    #[entities]
    pub particles: [Entity; 2],
    /// The length in m at which it exerts no force, finite and >= 0.
    pub rest_length: f32,
    /// Stiffness k in N/m, finite and >= 0. Default 1000.
    pub stiffness: f32,
    /// Damping along the spring in N·s/m, finite and >= 0. Default 1.
    pub damping: f32,
    /// Whether it only pulls, as a cable or a leash does: no force, nor that of the damper, while it is shorter than
    /// its rest length, and none that pushes. Default false.
    pub tension_only: bool,
    /// The strain limit: at the end of a tick it is never longer than (1 + `max_stretch`) rest lengths, whatever
    /// pulls at it, as far as its ends can be brought together. Finite and >= 0; 0 with no stiffness is a string that
    /// does not stretch. Default `None`: no limit.
    pub max_stretch: Option<f32>,
}

impl Spring {
    /// The stiffness that [`Spring::new`] gives, in N/m.
    pub const DEFAULT_STIFFNESS: f32 = 1000.0;
    /// The damping that [`Spring::new`] gives, in N·s/m.
    pub const DEFAULT_DAMPING: f32 = 1.0;

    /// A spring between `first` and `second` with `rest_length` in m and the default stiffness and damping.
    pub const fn new(first: Entity, second: Entity, rest_length: f32) -> Self {
        Self {
            particles: [first, second],
            rest_length,
            stiffness: Self::DEFAULT_STIFFNESS,
            damping: Self::DEFAULT_DAMPING,
            tension_only: false,
            max_stretch: None,
        }
    }

    /// The same spring with another stiffness, in N/m.
    pub const fn with_stiffness(mut self, stiffness: f32) -> Self {
        self.stiffness = stiffness;
        self
    }

    /// The same spring with another damping, in N·s/m.
    pub const fn with_damping(mut self, damping: f32) -> Self {
        self.damping = damping;
        self
    }

    /// The same spring as a cable, that only pulls: see [`tension_only`](Self::tension_only).
    pub const fn with_tension_only(mut self) -> Self {
        self.tension_only = true;
        self
    }

    /// The same spring with a strain limit: see [`max_stretch`](Self::max_stretch).
    pub const fn with_max_stretch(mut self, max_stretch: f32) -> Self {
        self.max_stretch = Some(max_stretch);
        self
    }

    /// Checks that rest length, stiffness, damping and strain limit are in their ranges.
    ///
    /// # Errors
    /// Names the field at fault.
    pub fn validate(&self) -> Result<(), InvalidParameter> {
        parameter::non_negative("rest_length", self.rest_length)?;
        parameter::non_negative("stiffness", self.stiffness)?;
        parameter::non_negative("damping", self.damping)?;
        self.max_stretch.map_or(Ok(()), |limit| parameter::non_negative("max_stretch", limit))
    }
}
