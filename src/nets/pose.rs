//! Where particles are as a whole: their centre of mass, and the rotation that fits best.

use bevy::math::{DMat3, DQuat, DVec3};
use bevy::prelude::*;

use super::ParticleNet;

/// The most particles by which a rotation is found.
const SAMPLE: usize = 256;
/// The most iterations of the rotation, and the square of the turn at which they end.
const ITERATIONS: usize = 32;
const TOLERANCE: f64 = 1e-18;

/// Centre of mass and rotation of some particles of a net.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct NetPose {
    /// The centre of mass, in the world, m.
    pub centre: DVec3,
    /// The same at rest, in the frame of the recipe, m.
    pub rest_centre: DVec3,
    /// From the frame of the recipe to the world.
    pub rotation: DQuat,
}

impl ParticleNet {
    /// The pose of `particles`, of which there is one at least; `guess` is a rotation near the result, which it is where
    /// the particles do not tell, as of those in a line. Places at rest are stretched by `scale`.
    pub(crate) fn pose_of(
        &self,
        particles: impl ExactSizeIterator<Item = usize> + Clone,
        guess: Quat,
        scale: Vec3,
    ) -> NetPose {
        let topology = self.topology();
        let rest = |particle: usize| (topology.positions[particle] * scale).as_dvec3();
        let place = |particle: usize| self.positions()[particle].as_dvec3();
        let mass = |particle: usize| f64::from(topology.masses[particle]);
        let (mut centre, mut rest_centre, mut total) = (DVec3::ZERO, DVec3::ZERO, 0.0);
        for particle in particles.clone() {
            let own = mass(particle);
            centre += place(particle) * own;
            rest_centre += rest(particle) * own;
            total += own;
        }
        (centre, rest_centre) = (centre / total, rest_centre / total);
        let mut covariance = DMat3::ZERO;
        for particle in particles.clone().step_by(particles.len().div_ceil(SAMPLE).max(1)) {
            let (now, then) = (place(particle) - centre, rest(particle) - rest_centre);
            let weighted = now * mass(particle);
            covariance += DMat3::from_cols(weighted * then.x, weighted * then.y, weighted * then.z);
        }
        let rotation = rotation_of(covariance, guess.as_dquat().normalize());
        NetPose { centre, rest_centre, rotation }
    }
}

/// The rotation R that makes Σ R_j · A_j the largest, for the covariance A, from a guess.
///
/// Müller, Bender, Chentanez and Macklin, *A robust method to extract the rotational part of deformations* (2016): turn
/// by ω = Σ R_j × A_j / |Σ R_j · A_j| until that is zero. Each turn is here by 2 arctan(|ω| / 2) instead of |ω|, which
/// needs no trigonometric function.
fn rotation_of(covariance: DMat3, guess: DQuat) -> DQuat {
    let mut rotation = guess;
    for _ in 0..ITERATIONS {
        let axes = DMat3::from_quat(rotation);
        let pairs = [
            (axes.x_axis, covariance.x_axis),
            (axes.y_axis, covariance.y_axis),
            (axes.z_axis, covariance.z_axis),
        ];
        let torque: DVec3 = pairs.iter().map(|(axis, column)| axis.cross(*column)).sum();
        let fit: f64 = pairs.iter().map(|(axis, column)| axis.dot(*column)).sum();
        if !(fit.abs() > f64::MIN_POSITIVE && torque.is_finite()) {
            break;
        }
        let turn = torque / fit.abs();
        if turn.length_squared() < TOLERANCE {
            break;
        }
        let half = 0.5 * turn;
        rotation = (DQuat::from_xyzw(half.x, half.y, half.z, 1.0).normalize() * rotation).normalize();
    }
    rotation
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::super::Topology;
    use super::*;

    fn pose(rest: &[Vec3], now: impl Fn(Vec3) -> Vec3, guess: Quat) -> NetPose {
        let topology =
            Topology { positions: rest.to_vec(), masses: vec![0.5; rest.len()], ..Topology::default() };
        let net = ParticleNet::laid_out(Arc::new(topology), now);
        net.pose_of(0..rest.len(), guess, Vec3::ONE)
    }

    #[test]
    fn the_pose_of_a_rigid_body_is_its_own() {
        let rest = [Vec3::ZERO, Vec3::X, Vec3::Y * 2.0, Vec3::new(0.3, 0.1, -0.7)];
        for turn in [Quat::from_rotation_y(3.0), Quat::from_rotation_x(-2.0) * Quat::from_rotation_z(1.4)] {
            let found = pose(&rest, |place| turn * place + Vec3::Z * 5.0, Quat::IDENTITY);
            assert!(
                found.rotation.as_quat().angle_between(turn) < 1e-3,
                "{turn} is found as {}",
                found.rotation
            );
            let origin = found.centre - found.rotation * found.rest_centre;
            assert!(origin.distance(DVec3::Z * 5.0) < 1e-6);
        }
    }

    /// About their line nothing is known of points on it: the guess stays.
    #[test]
    fn points_on_a_line_keep_the_guess_about_it() {
        let rest = [Vec3::ZERO, Vec3::X, Vec3::X * 3.0];
        let guess = Quat::from_rotation_x(0.8);
        let found = pose(&rest, |place| place, guess).rotation.as_quat();
        assert!(found.angle_between(guess) < 1e-3);
        let turned = pose(&rest, |place| Vec3::Y * place.x, guess).rotation.as_quat();
        assert!((turned * Vec3::X).distance(Vec3::Y) < 1e-5);
        assert_eq!(pose(&[Vec3::ONE], |place| place, guess).rotation.as_quat(), guess.normalize());
    }
}
