//! Bounds on the frequencies that gases add: they depend on where the particles are.
//!
//! The Hessian of a gas is p/V g gᵀ − p ∇²V. With the masses m the first term has the one eigenvalue p/V Σ ‖gᵢ‖²/mᵢ. In
//! the second, particles i and j with a common edge are coupled by the cross product with a sixth of the vector between
//! the two corners opposite of it: by Gershgorin's theorem no eigenvalue is larger than p/mᵢ times the sum of these at
//! one particle, at most a sixth of all sides of the faces that end there.

use bevy::math::DVec3;

use crate::solver::elements::{Elements, Enclosure};
use crate::solver::particles::Particles;

/// Bounds on ω² of each gas, 1/s²; with working memory.
#[derive(Debug, Clone, Default)]
pub(super) struct GasBounds {
    /// The number of each acting gas, and its bound.
    pub all: Vec<(usize, f64)>,
    gradient: Vec<DVec3>,
    sides: Vec<f64>,
    owner: Vec<u32>,
    shares: bool,
}

impl GasBounds {
    /// Takes them where the particles are now.
    pub fn refresh(&mut self, elements: &Elements, particles: &Particles) {
        self.all.clear();
        self.shares = false;
        for (number, enclosure) in elements.gases().acting() {
            let bound = self.bound(enclosure, particles);
            self.all.push((number, bound));
        }
        if self.all.len() > 1 {
            self.owner.clear();
            self.owner.resize(particles.len(), u32::MAX);
            for (number, enclosure) in elements.gases().acting() {
                for slot in &enclosure.slots {
                    let owner = &mut self.owner[*slot as usize];
                    self.shares |= *owner != u32::MAX && *owner != number as u32;
                    *owner = number as u32;
                }
            }
        }
    }

    /// A bound on ω² of some of the gases together, 1/s².
    pub fn of(&self, is_wanted: impl Fn(usize) -> bool) -> f64 {
        let bounds = self.all.iter().filter(|(number, _)| is_wanted(*number)).map(|(_, bound)| *bound);
        // Those that share no particle move apart from each other.
        if self.shares { bounds.sum() } else { bounds.fold(0.0, f64::max) }
    }

    fn bound(&mut self, enclosure: &Enclosure, particles: &Particles) -> f64 {
        let Self { gradient, sides, .. } = self;
        let at = |place: usize| particles.position.get(enclosure.slots[place] as usize).as_dvec3();
        let volume = enclosure.measure(at, gradient);
        sides.clear();
        sides.resize(enclosure.slots.len(), 0.0);
        for corners in &enclosure.triangles {
            for (first, second) in [(0, 1), (1, 2), (2, 0)] {
                let (first, second) = (corners[first] as usize, corners[second] as usize);
                let side = at(first).distance(at(second));
                sides[first] += side;
                sides[second] += side;
            }
        }
        let (mut along, mut across) = (0.0, 0.0_f64);
        for ((slot, gradient), sides) in enclosure.slots.iter().zip(&*gradient).zip(&*sides) {
            let inverse_mass = f64::from(particles.inverse_mass()[*slot as usize]);
            along += gradient.length_squared() * inverse_mass;
            across = across.max(sides / 6.0 * inverse_mass);
        }
        let bound = enclosure.gas.stiffness_at(volume) * along + enclosure.gas.pressure_at(volume) * across;
        // A fault is to be found where it is, not to ask for the most substeps of all.
        if bound.is_finite() { bound } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::Vec3;

    use super::*;
    use crate::solver::elements::Gas;

    /// An octahedron breathes with ω² = p/V Σ g²/m − …: the bound is above the Rayleigh quotient of every motion.
    #[test]
    fn no_motion_of_an_octahedron_is_faster_than_the_bound() {
        let corners = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];
        let mut particles = Particles::default();
        for (number, corner) in (1_u16..).zip(corners) {
            particles.push(corner, Vec3::ZERO, f32::from(number), 0.0);
        }
        let faces = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
        let gas = Gas { pressure: 3.0, rest_volume: 1.0 };
        let mut elements = Elements::default();
        elements.push_gas(Enclosure::new(&faces, gas));
        let mut bounds = GasBounds::default();
        bounds.refresh(&elements, &particles);
        let bound = bounds.of(|_| true);
        let energy = |direction: &[DVec3], by: f64| {
            let enclosure = &elements.gases().all()[0];
            gas.energy_at(enclosure.volume(|place| corners[place].as_dvec3() + direction[place] * by))
        };
        let mut largest = 0.0_f64;
        for sample in 0..500_u32 {
            let number = |place: u32| f64::from((sample * 7919 + place * 104_729) % 1009) / 504.5 - 1.0;
            let direction: Vec<DVec3> = (0..6)
                .map(|place| match sample {
                    0 => corners[place as usize].as_dvec3() * f64::from(place + 1),
                    _ => DVec3::new(number(3 * place), number(3 * place + 1), number(3 * place + 2)),
                })
                .collect();
            let kinetic: f64 =
                (1..).zip(&direction).map(|(w, way)| way.length_squared() / f64::from(w)).sum();
            let h = 1e-3;
            let curvature = energy(&direction, h) - 2.0 * energy(&direction, 0.0) + energy(&direction, -h);
            largest = largest.max(curvature / (h * h) / kinetic);
        }
        assert!(largest < bound && largest > 0.1 * bound, "{largest} {bound}");
    }
}
