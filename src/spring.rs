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
/// A spring with particles that do not exist, or with bad values, is left out of the simulation, with
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
    /// The tension in N, damper included, beyond which it breaks: it exerts no force any more, and gets [`Broken`].
    /// Finite and >= 0. Default `None`: it never breaks.
    ///
    /// Of connected springs the one that is most overloaded breaks in a substep, and all that carry
    /// twice their breaking force. In ropes and trees nothing else breaks until the release has had the time to travel
    /// through all of it. Where the rounding of positions decides, within 8 ulp times the stiffness, a spring breaks at the end of a
    /// tick, and if it rests, by the tension that balances the loads.
    pub breaking_force: Option<f32>,
    /// How it yields. Default `None`: it is elastic.
    pub plasticity: Option<Plasticity>,
}

/// How a [`Spring`] yields: beyond a strain it stays longer, or shorter, than it was.
///
/// With the length l and the rest length l0 the elastic strain is l/l0 − 1 − p. It never exceeds the yield strain: the
/// plastic strain p follows, up to its limit. (Perfect plasticity in one dimension, Simo and Hughes, *Computational
/// Inelasticity*, 1998.)
#[derive(Reflect, Debug, Clone, Copy, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct Plasticity {
    /// The elastic strain beyond which it yields, finite and >= 0. Default 0.
    pub yield_strain: f32,
    /// The largest plastic strain either way, finite and >= 0. Default 0. A spring is shortened by its whole rest
    /// length at most.
    pub max_strain: f32,
    /// The plastic strain p, finite and >= -1: without force the spring is (1 + p) rest lengths long. One beyond
    /// `max_strain` can only come back. Default 0; the simulation writes it when the spring has yielded.
    pub strain: f32,
}

/// Marks a [`Spring`] that broke: it takes no part in the simulation.
///
/// The simulation inserts it together with the event [`Broke`](crate::Broke). Insert it to cut a spring; remove it to
/// mend one.
#[derive(Component, Reflect, Debug, Clone, Copy, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct Broken;

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
            breaking_force: None,
            plasticity: None,
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

    /// The same spring with a breaking force, in N: see [`breaking_force`](Self::breaking_force).
    pub const fn with_breaking_force(mut self, breaking_force: f32) -> Self {
        self.breaking_force = Some(breaking_force);
        self
    }

    /// The same spring, yielding beyond an elastic strain until it is strained by `max_strain`: see [`Plasticity`].
    pub const fn with_plasticity(mut self, yield_strain: f32, max_strain: f32) -> Self {
        self.plasticity = Some(Plasticity { yield_strain, max_strain, strain: 0.0 });
        self
    }

    /// Checks that rest length, stiffness, damping, strain limit and what it bears are in their ranges.
    ///
    /// # Errors
    /// Names the field at fault.
    pub fn validate(&self) -> Result<(), InvalidParameter> {
        parameter::non_negative("rest_length", self.rest_length)?;
        parameter::non_negative("stiffness", self.stiffness)?;
        parameter::non_negative("damping", self.damping)?;
        self.max_stretch.map_or(Ok(()), |limit| parameter::non_negative("max_stretch", limit))?;
        self.breaking_force.map_or(Ok(()), |force| parameter::non_negative("breaking_force", force))?;
        self.plasticity.map_or(Ok(()), |plasticity| plasticity.validate())
    }
}

impl Plasticity {
    /// Checks that the strains are in their ranges.
    ///
    /// # Errors
    /// Names the field at fault.
    pub fn validate(&self) -> Result<(), InvalidParameter> {
        let Self { yield_strain, max_strain, strain } = *self;
        parameter::non_negative("yield_strain", yield_strain)?;
        parameter::non_negative("max_strain", max_strain)?;
        if strain.is_finite() && strain >= -1.0 {
            return Ok(());
        }
        let expected = "a finite number >= -1";
        Err(InvalidParameter { field: "strain", value: format!("{strain:?}"), expected })
    }
}
