//! Energy, momentum and extremes of a state, accumulated in f64.

use bevy::math::{DVec3, Vec3};

use super::SolverState;

/// Physical quantities of a whole state. Pinned particles have no energy and no momentum.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Totals {
    /// Σ ½ m v², J.
    pub kinetic_energy: f64,
    /// Σ ½ k (l − l0)², J.
    pub elastic_energy: f64,
    /// −Σ m g·x, J.
    pub gravitational_energy: f64,
    /// Σ m v, N·s.
    pub momentum: DVec3,
    /// The largest speed of a free particle, m/s.
    pub max_speed: f64,
    /// The largest |l − l0| / l0 of the springs with l0 > 0.
    pub max_stretch: f64,
    /// The mean |l − l0| / l0 of the springs with l0 > 0.
    pub mean_stretch: f64,
}

/// Sums up `state` in the gravity field `gravity` (m/s²).
pub fn totals(state: &SolverState, gravity: Vec3) -> Totals {
    let mut totals = Totals::default();
    add_particles(state, gravity.as_dvec3(), &mut totals);
    add_springs(state, &mut totals);
    totals
}

fn add_particles(state: &SolverState, gravity: DVec3, totals: &mut Totals) {
    let particles = &state.particles;
    for slot in 0..particles.len() {
        let inverse_mass = f64::from(particles.inverse_mass[slot]);
        if inverse_mass == 0.0 {
            continue;
        }
        let mass = 1.0 / inverse_mass;
        let position = particles.position.get(slot).as_dvec3();
        let velocity = particles.velocity.get(slot).as_dvec3();
        totals.kinetic_energy += 0.5 * mass * velocity.length_squared();
        totals.gravitational_energy -= mass * gravity.dot(position);
        totals.momentum += mass * velocity;
        totals.max_speed = totals.max_speed.max(velocity.length());
    }
}

fn add_springs(state: &SolverState, totals: &mut Totals) {
    let springs = &state.springs;
    let mut stretched_springs = 0_usize;
    for index in 0..springs.len() {
        let (first, second) = springs.ends(index);
        let position = &state.particles.position;
        let separation = position.get(first).as_dvec3() - position.get(second).as_dvec3();
        let rest_length = f64::from(springs.rest_length()[index]);
        let elongation = separation.length() - rest_length;
        totals.elastic_energy += 0.5 * f64::from(springs.stiffness()[index]) * elongation * elongation;
        if rest_length > 0.0 {
            let stretch = elongation.abs() / rest_length;
            totals.max_stretch = totals.max_stretch.max(stretch);
            totals.mean_stretch += stretch;
            stretched_springs += 1;
        }
    }
    totals.mean_stretch /= stretched_springs.max(1) as f64;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_of_two_particles_and_a_spring() {
        let mut state = SolverState::default();
        state.particles.push(Vec3::new(0.0, 3.0, 0.0), Vec3::new(3.0, 4.0, 0.0), 2.0, 0.0);
        state.particles.push(Vec3::new(0.0, 1.0, 0.0), Vec3::ONE, f32::INFINITY, 0.0);
        state.springs.push(0, 1, 1.6, 50.0, 1.0);
        let totals = totals(&state, Vec3::new(0.0, -10.0, 0.0));
        assert_eq!(totals.kinetic_energy, 25.0);
        assert_eq!(totals.gravitational_energy, 60.0);
        assert_eq!(totals.momentum, DVec3::new(6.0, 8.0, 0.0));
        assert_eq!(totals.max_speed, 5.0);
        assert!((totals.elastic_energy - 4.0).abs() < 1e-6);
        assert!((totals.max_stretch - 0.25).abs() < 1e-6);
        assert_eq!(totals.max_stretch, totals.mean_stretch);
    }

    #[test]
    fn an_empty_state_has_none() {
        assert_eq!(totals(&SolverState::default(), Vec3::NEG_Y), Totals::default());
    }
}
