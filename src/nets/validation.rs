//! What is wrong with a topology.

use bevy::math::Vec3;

use super::Topology;
use crate::parameter::{self, InvalidParameter};
use crate::solver::{self, Bend, Spring, enclosed_volume};
use crate::spring::Plasticity;

/// Why a [`Topology`] is refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum InvalidTopology {
    /// A net without particles.
    #[error("it has no particles")]
    Empty,
    /// The numbers of positions and masses differ.
    #[error("it has {positions} positions and {masses} masses, expected as many")]
    Lengths {
        /// The number of positions.
        positions: usize,
        /// The number of masses.
        masses: usize,
    },
    /// A value is outside its range.
    #[error("{list}[{index}]: {problem}")]
    Parameter {
        /// The list of the topology.
        list: &'static str,
        /// The place in the list.
        index: usize,
        /// What is wrong there.
        problem: InvalidParameter,
    },
    /// An element or triangle at a particle that does not exist.
    #[error("{list}[{index}] has particle {particle}, expected less than {count}")]
    MissingParticle {
        /// The list of the topology.
        list: &'static str,
        /// The place in the list.
        index: usize,
        /// The number that was given.
        particle: u32,
        /// The number of particles.
        count: usize,
    },
    /// An element or triangle that has a particle twice.
    #[error("{list}[{index}] has particle {particle} twice")]
    Loop {
        /// The list of the topology.
        list: &'static str,
        /// The place in the list.
        index: usize,
        /// The particle.
        particle: u32,
    },
    /// A gas in a surface that is not closed, or is inside out.
    #[error("its surface does not enclose its gas: it is open or inside out, around {volume} m³")]
    Open {
        /// The signed volume, m³.
        volume: f32,
    },
    /// The radius or pressure is outside its range.
    #[error(transparent)]
    Value(#[from] InvalidParameter),
}

impl Topology {
    /// Checks all numbers.
    ///
    /// # Errors
    /// Names the first one at fault.
    pub fn validate(&self) -> Result<(), InvalidTopology> {
        let count = self.positions.len();
        if count == 0 {
            return Err(InvalidTopology::Empty);
        }
        if count != self.masses.len() {
            return Err(InvalidTopology::Lengths { positions: count, masses: self.masses.len() });
        }
        parameter::non_negative("radius", self.radius)?;
        if !self.positions.iter().copied().map(Vec3::element_sum).sum::<f32>().is_finite() {
            check_all("positions", &self.positions, |position| parameter::finite("position", *position))?;
        }
        check_all("masses", &self.masses, |mass| parameter::mass("mass", *mass))?;
        // Nearly all are good: one pass over what is in memory; what is wrong with one is found out after.
        if !self.springs.iter().all(|(ends, spring)| is_plain(spring) && are_two(ends, count)) {
            check_all("springs", &self.springs, |(_, spring)| check_spring(spring))?;
            check_ends("springs", self.springs.iter().map(|(ends, _)| ends), count)?;
        }
        check_all("rods", &self.rods, |(_, bend)| check_bend(bend))?;
        check_all("hinges", &self.hinges, |(_, bend)| check_bend(bend))?;
        check_ends("rods", self.rods.iter().map(|(ends, _)| ends), count)?;
        check_ends("hinges", self.hinges.iter().map(|(ends, _)| ends), count)?;
        check_ends("triangles", self.triangles.iter(), count)?;
        self.air.validate()?;
        match self.pressure {
            Some(pressure) => self.check_gas(pressure),
            None => Ok(()),
        }
    }
}

impl Topology {
    /// Gas needs a closed surface around it, its outside outwards.
    fn check_gas(&self, pressure: f32) -> Result<(), InvalidTopology> {
        parameter::non_negative("pressure", pressure)?;
        let volume = enclosed_volume(&self.triangles, |particle| self.positions[particle as usize]) as f32;
        let mut edges: Vec<[u32; 2]> =
            self.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
        edges.sort_unstable();
        let is_closed = edges.windows(2).all(|pair| pair[0] != pair[1])
            && edges.iter().all(|[from, to]| edges.binary_search(&[*to, *from]).is_ok());
        match is_closed && volume > 0.0 && volume.is_finite() {
            true => Ok(()),
            false => Err(InvalidTopology::Open { volume }),
        }
    }
}

fn check_all<T>(
    list: &'static str,
    values: &[T],
    check: impl Fn(&T) -> Result<(), InvalidParameter>,
) -> Result<(), InvalidTopology> {
    for (index, value) in values.iter().enumerate() {
        check(value).map_err(|problem| InvalidTopology::Parameter { list, index, problem })?;
    }
    Ok(())
}

/// Whether a spring has good numbers, and none but those that all have.
fn is_plain(spring: &Spring) -> bool {
    let Spring { rest_length, stiffness, damping, .. } = *spring;
    // A number is ≥ +0 and finite if, as bits, it is below infinity.
    let largest = rest_length.to_bits().max(stiffness.to_bits()).max(damping.to_bits());
    largest < f32::INFINITY.to_bits()
        && spring.max_stretch.is_none()
        && spring.breaking_force.is_none()
        && spring.plasticity.is_none()
}

/// Whether these are two of `count` particles.
fn are_two([first, second]: &[u32; 2], count: usize) -> bool {
    first != second && (*first.max(second) as usize) < count
}

fn check_spring(spring: &Spring) -> Result<(), InvalidParameter> {
    parameter::non_negative("rest_length", spring.rest_length)?;
    parameter::non_negative("stiffness", spring.stiffness)?;
    parameter::non_negative("damping", spring.damping)?;
    spring.max_stretch.map_or(Ok(()), |limit| parameter::non_negative("max_stretch", limit))?;
    spring.breaking_force.map_or(Ok(()), |force| parameter::non_negative("breaking_force", force))?;
    let Some(solver::Plasticity { yield_strain, max_strain, strain }) = spring.plasticity else {
        return Ok(());
    };
    Plasticity { yield_strain, max_strain, strain }.validate()
}

fn check_bend<const N: usize>(bend: &Bend<N>) -> Result<(), InvalidParameter> {
    parameter::non_negative("rest_length", bend.rest_length)?;
    parameter::non_negative("stiffness", bend.stiffness)?;
    parameter::non_negative("damping", bend.damping)?;
    let largest = bend.weights.iter().fold(0.0_f32, |largest, weight| largest.max(weight.abs()));
    let sum: f32 = bend.weights.iter().sum();
    // Each weight is rounded to a part in 2^24.
    match sum.abs() <= 1e-6 * largest {
        true => Ok(()),
        false => Err(InvalidParameter {
            field: "weights",
            value: format!("{:?}", bend.weights),
            expected: "weights that add up to 0",
        }),
    }
}

fn check_ends<'a, const N: usize>(
    list: &'static str,
    all: impl Iterator<Item = &'a [u32; N]>,
    count: usize,
) -> Result<(), InvalidTopology> {
    for (index, ends) in all.enumerate() {
        for (number, &particle) in ends.iter().enumerate() {
            if particle as usize >= count {
                return Err(InvalidTopology::MissingParticle { list, index, particle, count });
            }
            if ends[..number].contains(&particle) {
                return Err(InvalidTopology::Loop { list, index, particle });
            }
        }
    }
    Ok(())
}
