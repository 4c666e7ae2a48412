//! Winches: parts that pay a rope out and take it in.

use std::sync::Arc;

use bevy::prelude::*;

use super::{ParticleNet, Spool};
use crate::parameter::{self, InvalidParameter};

/// Number of links that are added at a time: each addition has the net laid out anew in the solver.
const ADDED_LINKS: usize = 16;

/// Below its greatest force by this part of it, a winch begins to turn more slowly.
const DROOP: f32 = 0.1;

/// On the pinned [`Part::Start`](crate::nets::Part::Start) of a rope: pays the rope out there, or takes it in.
///
/// The rope changes its length link by link, without a jerk: see [`Spool`]. The particles that are wound up keep their
/// numbers and are held at the winch; rope beyond what was laid out gets new particles with the next numbers. A change of
/// speed is felt by what hangs on the rope: ramp it. To hold the rope give it the speed 0; without the component what is
/// wound up falls out.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_mass_spring::prelude::*;
/// # use bevy_mass_spring::nets::{Part, PartOf, Winch};
/// fn crane(mut commands: Commands, rope: Entity, jib: Entity) {
///     commands.entity(jib).with_child((PartOf(rope), Part::Start, Pinned, Winch { speed: -0.5, ..default() }));
/// }
/// ```
#[derive(Component, Reflect, Debug, Clone, Copy, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct Winch {
    /// The rate of the rest length of the rope outside, m/s, finite: positive pays out, negative takes in. Default 0.
    pub speed: f32,
    /// The tension of the rope at which the winch stalls while it takes in, N, finite and > 0; it turns more slowly in the
    /// last tenth. Default `None`: it never stalls.
    pub max_force: Option<f32>,
    /// Taking in ends at this rest length, m, finite and >= 0, and at half a link in any case. Default 0.
    pub min_length: f32,
    /// Paying out ends at this rest length, m, finite and >= 0. Default `None`: it never ends.
    pub max_length: Option<f32>,
}

#[cfg(feature = "serialize")]
use bevy::reflect::{ReflectDeserialize, ReflectSerialize};

impl Winch {
    /// Checks that all values are in their ranges.
    ///
    /// # Errors
    /// Names the field at fault.
    pub fn validate(&self) -> Result<(), InvalidParameter> {
        let Self { speed, max_force, min_length, max_length } = *self;
        if !speed.is_finite() {
            let value = format!("{speed:?}");
            return Err(InvalidParameter { field: "speed", value, expected: "a finite number" });
        }
        max_force.map_or(Ok(()), |force| parameter::positive("max_force", force))?;
        parameter::non_negative("min_length", min_length)?;
        max_length.map_or(Ok(()), |length| parameter::non_negative("max_length", length))
    }

    /// How far it turns in a tick of `time_step` s, m, with a rope of this rest length and tension, N.
    fn turn(&self, time_step: f64, length: f64, tension: f32) -> f64 {
        let by = f64::from(self.speed) * time_step;
        if by > 0.0 {
            let left = self.max_length.map_or(f64::INFINITY, |max_length| f64::from(max_length) - length);
            return by.min(left.max(0.0));
        }
        let force = self.max_force.map_or(1.0, |max_force| (max_force - tension) / (DROOP * max_force));
        let left = (length - f64::from(self.min_length)).max(0.0);
        (by * f64::from(force.clamp(0.0, 1.0))).max(-left)
    }
}

impl ParticleNet {
    /// Turns the winch at the first particle, which is where it will be after the tick. False if the net is no rope.
    pub(crate) fn turn_winch(&mut self, winch: &Winch, time_step: f64) -> bool {
        let mut spool = match self.spool.take() {
            Some(spool) => spool,
            None => match Spool::new(&self.topology) {
                Some(spool) => Box::new(spool),
                None => return false,
            },
        };
        let (number, ends) = spool.first_link();
        let [inner, outer] = ends.map(|end| end as usize);
        let spring = self.topology.springs[number as usize].1;
        let elongation = self.positions[inner].distance(self.positions[outer]) - spring.length_at_rest();
        let by = winch.turn(time_step, spool.length(), spring.stiffness * elongation);
        self.versions.touch_parameters();
        let topology = Arc::make_mut(&mut self.topology);
        if by > 0.0 && spool.held().len() == 1 {
            self.versions.touch_structure();
            spool.extend(ADDED_LINKS, topology, &mut self.positions, &mut self.velocities);
            if !self.applied_forces.is_empty() {
                self.applied_forces.resize(self.positions.len(), Vec3::ZERO);
            }
        }
        spool.turn(by, time_step, topology, &mut self.positions, &mut self.velocities);
        self.parts.held.extend_from_slice(spool.held());
        self.parts.held.sort_unstable();
        self.parts.held.dedup();
        self.spool = Some(spool);
        true
    }

    /// The rest length of the rope outside of its winch, m; `None` without one.
    pub fn wound_out(&self) -> Option<f64> {
        self.spool.as_ref().map(|spool| spool.length())
    }
}
