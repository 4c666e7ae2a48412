//! Where particles are as a whole: their centre of mass, and the rotation that fits best.

use bevy::math::{DMat3, DMat4, DQuat, DVec3, DVec4};
use bevy::prelude::*;

use super::ParticleNet;

/// The most particles by which a rotation is found.
const SAMPLE: usize = 256;
/// The number of squarings of the matrix of the rotation: its 4096th power.
const SQUARINGS: usize = 12;
/// The square of the part of the guess in the eigenspace, relative to the matrix, below which it is rounding.
const MIN_PROJECTION: f64 = 1e-20;

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

/// The rotation R that makes Σ R_j · A_j the largest, for the covariance A; of several the one that is nearest to the guess.
///
/// For a unit quaternion q that sum is qᵀ K q, with a symmetric K (Davenport's q-method: Horn, *Closed-form solution of
/// absolute orientation using unit quaternions*, 1987): what is sought are its eigenvectors of the largest eigenvalue.
/// Powers of K + ‖K‖, which has no negative eigenvalues, project on them.
fn rotation_of(covariance: DMat3, guess: DQuat) -> DQuat {
    let DMat3 { x_axis, y_axis, z_axis } = covariance;
    let trace = x_axis.x + y_axis.y + z_axis.z;
    let torque = DVec3::X.cross(x_axis) + DVec3::Y.cross(y_axis) + DVec3::Z.cross(z_axis);
    let symmetric = covariance + covariance.transpose() - DMat3::from_diagonal(DVec3::splat(trace));
    let matrix = DMat4::from_cols(
        symmetric.x_axis.extend(torque.x),
        symmetric.y_axis.extend(torque.y),
        symmetric.z_axis.extend(torque.z),
        torque.extend(trace),
    );
    let norm = matrix.to_cols_array().iter().map(|entry| entry * entry).sum::<f64>().sqrt();
    if !(norm > f64::MIN_POSITIVE && norm.is_finite()) {
        return guess;
    }
    let mut power = matrix * (1.0 / norm) + DMat4::IDENTITY;
    for _ in 0..SQUARINGS {
        power *= power;
        let largest = power.to_cols_array().iter().fold(0.0_f64, |largest, entry| largest.max(entry.abs()));
        power *= 1.0 / largest;
    }
    // A guess at right angles to all of them says nothing; a column does then.
    let columns = [power.x_axis, power.y_axis, power.z_axis, power.w_axis];
    let column =
        columns.into_iter().max_by(|one, other| one.length_squared().total_cmp(&other.length_squared()));
    let projected = power * DVec4::from(guess);
    let found =
        if projected.length_squared() > MIN_PROJECTION { projected } else { column.unwrap_or(DVec4::W) };
    DQuat::from_vec4(found.normalize())
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
