//! The displacement of surfaces that cannot be kept apart otherwise: that of the pinned particles near them.
//!
//! A smooth field of small displacements causes no crossing, as neighbouring points move alike. Here it is
//! the mean displacement of the pinned particles, weighted by the inverse fourth power of the distance from each (Shepard,
//! *A two-dimensional interpolation function for irregularly-spaced data*, ACM National Conference, 1968), which fades out far
//! from all of them.

use bevy::math::Vec3A;

use crate::solver::particles::{Particles, Vectors};

/// Within how many of the longest displacements and the greatest radii, together, the field has faded to a half.
const REACH: f32 = 16.0;

/// The displacement field that follows the displacements of all pinned particles that collide.
#[derive(Debug, Clone, Default)]
pub(super) struct DisplacementField {
    /// Where they are at the start, and how far they go; m.
    sources: Vec<[Vec3A; 2]>,
    /// The weight of staying where one is, 1/m⁴.
    rest: f32,
}

impl DisplacementField {
    /// Measures it, along the displacements from `start` to the present positions.
    pub fn measure(&mut self, start: &Vectors, particles: &Particles, on_mesh: &[bool]) {
        let Self { sources, rest } = self;
        sources.clear();
        let (mut longest, mut thickest) = (0.0_f32, 0.0_f32);
        for slot in (0..particles.len()).filter(|slot| particles.is_pinned(*slot)) {
            let radius = particles.radius()[slot];
            let [from, to] = [start, &particles.position].map(|places| Vec3A::from(places.get(slot)));
            if (on_mesh[slot] || radius > 0.0) && (from + to).is_finite() {
                sources.push([from, to - from]);
                (longest, thickest) = (longest.max(from.distance(to)), thickest.max(radius));
            }
        }
        if longest == 0.0 {
            sources.clear();
        }
        *rest = (REACH * (longest + thickest)).powi(-4);
    }

    /// The displacement at a place, m.
    pub fn at(&self, place: Vec3A) -> Vec3A {
        let (mut sum, mut weights) = (Vec3A::ZERO, self.rest);
        for [from, displacement] in &self.sources {
            let weight = place.distance_squared(*from).max(f32::MIN_POSITIVE.sqrt()).powi(-2);
            (sum, weights) = (sum + weight * *displacement, weights + weight);
        }
        if self.sources.is_empty() { Vec3A::ZERO } else { sum / weights }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_beside_a_pinned_particle_goes_with_it_and_what_is_far_away_stays() {
        let field = DisplacementField {
            sources: vec![[Vec3A::ZERO, Vec3A::X], [Vec3A::Y * 100.0, Vec3A::Z]],
            rest: 8.0_f32.powi(-4),
        };
        assert!(field.at(Vec3A::splat(0.1)).distance(Vec3A::X) < 1e-4);
        assert!(field.at(Vec3A::X * 8.0).distance(0.5 * Vec3A::X) < 1e-3);
        assert!(field.at(Vec3A::X * 1000.0).length() < 1e-6);
        assert_eq!(field.at(Vec3A::Y * 100.0), Vec3A::Z);
        assert_eq!(DisplacementField::default().at(Vec3A::ZERO), Vec3A::ZERO);
    }
}
