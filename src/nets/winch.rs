//! Winches: parts that pay a rope out and take it in.

use std::sync::Arc;

use bevy::prelude::*;

use super::haul::{Load, Outside};
use super::{ParticleNet, Spool};
use crate::parameter::{self, InvalidParameter};
use crate::solver::Spring;

/// Number of links that are added at a time: each addition has the net laid out anew in the solver.
const ADDED_LINKS: usize = 16;

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
    /// The tension of the rope to which the winch pulls while it takes in, N, finite and > 0, however stiff the rope: in
    /// each tick it turns as far as the speed says, or so far that the tension at the winch reaches this by the end of it. A
    /// load that weighs less is lifted at the full speed, once what force is left has made it that fast; one that weighs more
    /// is held: a stalled winch pays nothing out. What a load that stops within a tick has it take in too much, it pays out
    /// again in the next ones. Default `None`: it pulls with any force.
    ///
    /// The tension is that of the scheme: `Auto` and the implicit schemes hold it to a percent. Under
    /// [`Xpbd`](crate::Integrator::Xpbd) tensions converge with the substeps, and with few of them may be far from it.
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

    /// How far it turns in a tick of `time_step` s if nothing stalls it, m, with a rope of this rest length.
    fn turn(&self, time_step: f64, length: f64) -> f64 {
        let by = f64::from(self.speed) * time_step;
        if by > 0.0 {
            let left = self.max_length.map_or(f64::INFINITY, |max_length| f64::from(max_length) - length);
            return by.min(left.max(0.0));
        }
        by.max(f64::from(self.min_length).min(length) - length)
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
        let mut by = winch.turn(time_step, spool.length());
        match winch.max_force {
            Some(max_force) => by = self.stall(by, max_force.into(), time_step, &spool),
            None => self.haul = None,
        }
        self.versions.touch_parameters();
        let topology = Arc::make_mut(&mut self.topology);
        // What is paid out after it was taken in is there already.
        if by > 0.0 && winch.speed > 0.0 && spool.held().len() == 1 {
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

    /// How far a winch turns that would turn `by` metres, with a greatest force, N.
    fn stall(&mut self, by: f64, max_force: f64, time_step: f64, spool: &Spool) -> f64 {
        let mut haul = self.haul.unwrap_or_default();
        let pulled = self.pulled_links(spool).last().filter(|_| by < 0.0);
        let turn = if let Some((_, [_, end])) = pulled {
            // What hangs on another end now, or on a winch that is new, is found at rest.
            let is_same = |load: &Load| (load.end, load.is_held) == (end, self.is_pinned(end));
            let load = haul.load.filter(is_same).or_else(|| self.load(spool, true));
            let load = load.unwrap_or_default();
            -haul.take_in(-by, max_force, time_step, (load, self.rope_outside(spool, time_step)))
        } else {
            haul.release();
            by
        };
        self.haul = Some(haul);
        turn
    }

    /// After a tick: notes what its winch pulls at.
    pub(crate) fn note_load(&mut self) {
        let (Some(mut haul), Some(spool)) = (self.haul, &self.spool) else { return };
        haul.note(self.load(spool, false));
        self.haul = Some(haul);
    }

    /// The links from the winch to the next particle that is held, or to where the rope is broken, with their ends; the
    /// inner one first.
    fn pulled_links(&self, spool: &Spool) -> impl Iterator<Item = (Spring, [u32; 2])> {
        let links = spool.outside().map(|(number, ends)| (self.topology.springs[number as usize].1, ends));
        let mut is_over = false;
        links.take_while(move |(spring, ends)| {
            spring.stiffness > 0.0 && !std::mem::replace(&mut is_over, self.is_pinned(ends[1]))
        })
    }

    /// What a winch pulls at. The tension at it is that of the first link, or that of the whole rope if it is greater.
    /// `is_still`: what is held is not moving, wherever it was put.
    fn load(&self, spool: &Spool, is_still: bool) -> Option<Load> {
        let winch = spool.held()[0];
        let velocity = |particle: u32| match is_still && self.is_pinned(particle) {
            true => Vec3::ZERO,
            false => self.velocities[particle as usize],
        };
        let (mut load, mut first) = (Load::default(), None);
        let (mut elongation, mut compliance) = (0.0, 0.0);
        for (spring, [inner, outer]) in self.pulled_links(spool) {
            let place = |particle: u32| self.positions[particle as usize].as_dvec3();
            let along = place(outer) - place(inner);
            let beyond = along.length() - f64::from(spring.length_at_rest());
            // What is held at the winch moves as rope comes and goes.
            let inner = if first.is_some() { inner } else { winch };
            let rate = (velocity(inner) - velocity(outer)).as_dvec3().dot(along.normalize_or_zero());
            first.get_or_insert((beyond * f64::from(spring.stiffness), rate));
            elongation += beyond;
            compliance += 1.0 / f64::from(spring.stiffness);
            load.way += along.length();
            load.approach += rate;
            (load.end, load.is_held) = (outer, self.is_pinned(outer));
        }
        let (tension, inflow) = first?;
        let [winch, end] = [winch, load.end].map(|end| (self.positions[end as usize], velocity(end)));
        let straight = (end.0 - winch.0).as_dvec3().normalize_or_zero();
        load.closing = (winch.1 - end.1).as_dvec3().dot(straight);
        load.mean = elongation / compliance;
        (load.tension, load.inflow) = (tension.max(load.mean).max(0.0), inflow);
        Some(load)
    }

    /// What the rope outside of a winch is like in a tick of `time_step` s. Its end counts as a wall, a mass on the way m as
    /// the spring m / h² to one.
    fn rope_outside(&self, spool: &Spool, time_step: f64) -> Outside {
        let (mut compliance, mut damped, mut opposed, mut rest_length) = (0.0, 0.0, 0.0_f64, 0.0);
        let (mut first, mut last) = (None, spool.held()[0]);
        for (spring, [_, outer]) in self.pulled_links(spool) {
            let stiffness = f64::from(spring.stiffness);
            compliance += 1.0 / stiffness;
            damped += 1.0 / (stiffness + f64::from(spring.damping) / time_step);
            let mass = f64::from(self.topology.masses[outer as usize]);
            opposed = opposed.max(1.0 / (damped + time_step * time_step / mass));
            rest_length += f64::from(spring.length_at_rest());
            first.get_or_insert(stiffness * f64::from(spring.rest_length));
            last = outer;
        }
        let [winch, end] =
            [spool.held()[0], last].map(|particle| self.positions[particle as usize].as_dvec3());
        Outside {
            stiffness: 1.0 / compliance,
            opposed: opposed.max(1.0 / damped),
            stretch_stiffness: first.unwrap_or_default(),
            linear_density: spool.linear_density(),
            excess: rest_length - winch.distance(end),
        }
    }

    /// The rest length of the rope outside of its winch, m; `None` without one.
    pub fn wound_out(&self) -> Option<f64> {
        self.spool.as_ref().map(|spool| spool.length())
    }
}
