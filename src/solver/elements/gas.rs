//! Gases: closed surfaces of triangles with a gas inside.
//!
//! Isothermal: its pressure above that of the surroundings is p = p₀ V₀ / V, which comes from the energy
//! E = −p₀ V₀ ln (V / V₀). The volume V follows from the divergence theorem; its gradient at a particle is a third of the
//! area vectors ½ (b − a) × (c − a) of the faces there, so a particle is pushed by p times that. As those of a closed
//! surface add up to nothing, and so do their moments, no momentum or angular momentum comes from it.
//!
//! Below a thousandth of V₀, and inside out, the pressure stays what it is there and E goes on along its tangent: what is
//! squeezed flat is blown up again.

use bevy::math::{DVec3, Vec3};

use super::{Elements, Versions};
use crate::solver::state::Version;

/// The volume from which on the pressure rises no more, as a part of the rest volume.
const MIN_VOLUME: f64 = 1e-3;

/// A gas that is enclosed by a surface.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub struct Gas {
    /// Its pressure p₀ above that of the surroundings at the rest volume, Pa, >= 0.
    pub pressure: f32,
    /// The rest volume V₀, m³, > 0.
    pub rest_volume: f32,
}

impl Gas {
    /// p₀ V₀, J.
    fn content(&self) -> f64 {
        f64::from(self.pressure) * f64::from(self.rest_volume)
    }

    fn min_volume(&self) -> f64 {
        MIN_VOLUME * f64::from(self.rest_volume)
    }

    /// The pressure at a volume (m³), Pa; 0 where the volume is not finite: a fault is to stay where it is.
    pub fn pressure_at(&self, volume: f64) -> f64 {
        if volume.is_finite() { self.content() / volume.max(self.min_volume()) } else { 0.0 }
    }

    /// −dp/dV, Pa/m³.
    pub(in crate::solver) fn stiffness_at(&self, volume: f64) -> f64 {
        if volume > self.min_volume() { self.pressure_at(volume) / volume } else { 0.0 }
    }

    /// The energy against that at the rest volume, J.
    pub(in crate::solver) fn energy_at(&self, volume: f64) -> f64 {
        let least = self.min_volume();
        let reached = volume.max(least);
        -self.content()
            * (natural_logarithm(reached / f64::from(self.rest_volume)) + (volume - reached) / least)
    }

    /// The pressure at the end of a step of backward Euler, if the volume is `free` (m³) without it and a pressure p
    /// would make it larger by `yields` · p: p (free + yields p) = p₀ V₀.
    pub(in crate::solver) fn implicit_pressure(&self, free: f64, yields: f64) -> f64 {
        let root = (free * free + 4.0 * yields * self.content()).sqrt();
        // The form without cancellation, on either side.
        let pressure = match free > 0.0 {
            true => 2.0 * self.content() / (free + root),
            false if yields > 0.0 => (root - free) / (2.0 * yields),
            false => return self.pressure_at(free),
        };
        if pressure.is_finite() { pressure.min(self.content() / self.min_volume()) } else { 0.0 }
    }
}

/// ln x for a normal x > 0, from sums and products alone: the bits are the same on every machine. With x = 2ᵉ m and
/// z = (m − 1)/(m + 1), ln m = 2 (z + z³/3 + z⁵/5 + …), where z² <= 0.03.
fn natural_logarithm(x: f64) -> f64 {
    const MANTISSA: u64 = (1 << 52) - 1;
    let bits = x.to_bits();
    let exponent = (bits >> 52) as i64 - 1023;
    let mantissa = f64::from_bits((bits & MANTISSA) | 1023 << 52);
    let (exponent, mantissa) = if mantissa > std::f64::consts::SQRT_2 {
        (exponent + 1, 0.5 * mantissa)
    } else {
        (exponent, mantissa)
    };
    let z = (mantissa - 1.0) / (mantissa + 1.0);
    let series = (0..12).rev().fold(0.0, |sum, term| sum * z * z + 1.0 / f64::from(2 * term + 1));
    exponent as f64 * std::f64::consts::LN_2 + 2.0 * z * series
}

/// A gas and the surface that encloses it.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(in crate::solver) struct Enclosure {
    pub gas: Gas,
    /// The particles of the surface, each once.
    pub slots: Vec<u32>,
    /// The triangles, counter-clockwise seen from outside, as places in `slots`.
    pub triangles: Vec<[u32; 3]>,
}

impl Enclosure {
    pub fn new(triangles: &[[u32; 3]], gas: Gas) -> Self {
        let mut slots: Vec<u32> = triangles.as_flattened().to_vec();
        slots.sort_unstable();
        slots.dedup();
        let place = |slot: u32| slots.partition_point(|other| *other < slot) as u32;
        let triangles = triangles.iter().map(|triangle| triangle.map(place)).collect();
        Self { gas, slots, triangles }
    }

    /// Whether it exerts forces.
    pub fn acts(&self) -> bool {
        self.gas.pressure > 0.0 && !self.triangles.is_empty()
    }

    /// The volume in m³ where each particle of `slots` is at `position`; `gradient` becomes its gradient there, m².
    pub fn measure(&self, position: impl Fn(usize) -> DVec3, gradient: &mut Vec<DVec3>) -> f64 {
        gradient.clear();
        gradient.resize(self.slots.len(), DVec3::ZERO);
        let mut volume = 0.0;
        self.for_each_face(position, |[a, b, c], [second, third], from_origin| {
            let sixth = second.cross(third) / 6.0;
            volume += from_origin.dot(sixth);
            for corner in [a, b, c] {
                gradient[corner as usize] += sixth;
            }
        });
        volume
    }

    /// The same without the gradient.
    pub fn volume(&self, position: impl Fn(usize) -> DVec3) -> f64 {
        let mut volume = 0.0;
        self.for_each_face(position, |_, [second, third], from_origin| {
            volume += from_origin.dot(second.cross(third) / 6.0);
        });
        volume
    }

    /// The corners of each triangle, its sides from the first one, and where that is from the first particle.
    fn for_each_face(
        &self,
        position: impl Fn(usize) -> DVec3,
        mut visit: impl FnMut([u32; 3], [DVec3; 2], DVec3),
    ) {
        if self.triangles.is_empty() {
            return;
        }
        let origin = position(0);
        for corners in &self.triangles {
            let [a, b, c] = corners.map(|corner| position(corner as usize));
            visit(*corners, [b - a, c - a], a - origin);
        }
    }
}

/// All gases; a part of the state. A removed one leaves an empty place.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(in crate::solver) struct Gases {
    all: Vec<Enclosure>,
    /// Changes with any of them.
    version: Version,
}

impl Gases {
    /// All of them, empty places included.
    pub fn all(&self) -> &[Enclosure] {
        &self.all
    }

    /// Those that exert forces, with their numbers.
    pub fn acting(&self) -> impl Iterator<Item = (usize, &Enclosure)> + Clone {
        self.all.iter().enumerate().filter(|(_, enclosure)| enclosure.acts())
    }

    pub fn any_act(&self) -> bool {
        self.acting().next().is_some()
    }

    pub fn version(&self) -> Version {
        self.version
    }

    pub(super) fn push(&mut self, enclosure: Enclosure) -> usize {
        self.version = Version::new();
        self.all.push(enclosure);
        self.all.len() - 1
    }

    /// Changes the gas; whether it has begun or ceased to act.
    pub(super) fn set(&mut self, number: usize, gas: Gas) -> bool {
        self.version = Version::new();
        let enclosure = &mut self.all[number];
        let acted = enclosure.acts();
        enclosure.gas = gas;
        acted != enclosure.acts()
    }

    /// Empties the place of a gas.
    pub(super) fn remove(&mut self, number: usize) {
        self.version = Version::new();
        self.all[number] = Enclosure::default();
    }

    pub(super) fn renumber(&mut self, new_slots: &[u32]) {
        self.version = Version::new();
        for slot in self.all.iter_mut().flat_map(|enclosure| &mut enclosure.slots) {
            *slot = new_slots[*slot as usize];
        }
    }
}

impl Elements {
    /// The gases.
    pub(in crate::solver) fn gases(&self) -> &Gases {
        &self.gases
    }

    /// Appends a gas; its number.
    pub fn push_gas(&mut self, enclosure: Enclosure) -> usize {
        self.change_couplings();
        self.gases.push(enclosure)
    }

    /// Changes a gas.
    pub fn set_gas(&mut self, number: usize, gas: Gas) {
        if self.gases.set(number, gas) {
            self.change_couplings();
        }
    }

    /// Empties the place of a gas.
    pub fn remove_gas(&mut self, number: usize) {
        self.gases.remove(number);
        self.change_couplings();
    }

    /// Takes note that a gas couples other particles than before.
    fn change_couplings(&mut self) {
        let new = Version::new();
        self.versions = Versions { all: new, rates: new, ends: new, ..self.versions };
    }
}

/// The volume that closed triangles enclose, m³, by the divergence theorem; > 0 if they are counter-clockwise seen from
/// outside.
pub fn enclosed_volume(triangles: &[[u32; 3]], position: impl Fn(u32) -> Vec3) -> f64 {
    let enclosure = Enclosure::new(triangles, Gas::default());
    enclosure.volume(|place| position(enclosure.slots[place]).as_dvec3())
}

/// What a gas is at the end of a tick.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[non_exhaustive]
pub struct GasReading {
    /// Its volume, m³.
    pub volume: f64,
    /// Its pressure above that of the surroundings, Pa; 0 where it was removed.
    pub pressure: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [DVec3; 4] = [
        DVec3::new(10.0, 0.0, 0.0),
        DVec3::new(11.0, 0.0, 0.0),
        DVec3::new(10.0, 2.0, 0.0),
        DVec3::new(10.0, 0.0, 3.0),
    ];

    fn tetrahedron() -> Enclosure {
        let gas = Gas { pressure: 100.0, rest_volume: 1.0 };
        Enclosure::new(&[[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], gas)
    }

    #[test]
    fn the_volume_of_a_tetrahedron_and_its_gradient() {
        let enclosure = tetrahedron();
        let mut gradient = Vec::new();
        let volume = enclosure.measure(|place| CORNERS[place], &mut gradient);
        assert!((volume - 1.0).abs() < 1e-14);
        assert!(gradient.iter().sum::<DVec3>().length() < 1e-14);
        for (place, slope_of_volume) in gradient.iter().enumerate() {
            for axis in DVec3::AXES {
                let moved = |by: f64| {
                    enclosure
                        .volume(|other| CORNERS[other] + if other == place { axis * by } else { DVec3::ZERO })
                };
                let slope = (moved(1e-4) - moved(-1e-4)) / 2e-4;
                assert!((slope - slope_of_volume.dot(axis)).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn pressure_is_the_slope_of_the_energy_even_inside_out() {
        let gas = Gas { pressure: 50.0, rest_volume: 2.0 };
        for volume in [-1.0, 1e-3, 0.5, 2.0, 7.0] {
            let slope = (gas.energy_at(volume + 1e-6) - gas.energy_at(volume - 1e-6)) / 2e-6;
            let pressure = gas.pressure_at(volume);
            assert!((slope + pressure).abs() < 1e-6 * pressure.max(1.0), "{volume}: {slope} {pressure}");
        }
        assert_eq!((gas.energy_at(2.0), gas.pressure_at(f64::NAN)), (0.0, 0.0));
    }

    #[test]
    fn the_implicit_pressure_is_that_of_the_volume_it_leads_to() {
        let gas = Gas { pressure: 50.0, rest_volume: 2.0 };
        for (free, yields) in [(2.0, 0.0), (2.0, 0.3), (0.0, 0.1), (-1.0, 0.1), (5.0, 100.0)] {
            let pressure = gas.implicit_pressure(free, yields);
            assert!(
                (pressure * (free + yields * pressure) - 100.0).abs() < 1e-9,
                "{free} {yields}: {pressure}"
            );
        }
    }

    #[test]
    fn logarithms_are_those_of_the_library() {
        for x in [1e-300, 1e-3, 0.7, 1.0, 1.5, 2.0, 1e5, 1e300_f64] {
            let (found, expected) = (natural_logarithm(x), x.ln());
            assert!(
                (found - expected).abs() <= 4.0 * f64::EPSILON * expected.abs(),
                "{x}: {found} {expected}"
            );
        }
    }
}
