//! Rigid motions, and how one is recognised in where points were and where they are.

use bevy::math::{DMat3, DQuat, DVec3};
use bevy::prelude::*;

/// A rotation about a point, which then comes to another one.
#[derive(Debug, Clone, Copy)]
pub(super) struct RigidMotion {
    rotation: DMat3,
    from: DVec3,
    to: DVec3,
}

impl RigidMotion {
    /// The motion of an isometry of the world, between points that are measured from `origin`.
    pub fn of_isometry(isometry: Isometry3d, origin: Vec3) -> Self {
        let rotation = DMat3::from_quat(isometry.rotation.as_dquat().normalize());
        let to = DVec3::from(Vec3::from(isometry.translation)) - origin.as_dvec3();
        Self { rotation, from: -origin.as_dvec3(), to }
    }

    /// Where a point comes to.
    pub fn apply(&self, point: DVec3) -> DVec3 {
        self.to + self.rotation * (point - self.from)
    }

    /// A vector after the motion.
    pub fn turn(&self, vector: Vec3) -> Vec3 {
        if self.is_translation() { vector } else { (self.rotation * vector.as_dvec3()).as_vec3() }
    }

    /// An orientation after the motion.
    pub fn turn_rotation(&self, rotation: Quat) -> Quat {
        if self.is_translation() {
            return rotation;
        }
        (DQuat::from_mat3(&self.rotation) * rotation.as_dquat()).as_quat().normalize()
    }

    pub fn is_translation(&self) -> bool {
        self.rotation == DMat3::IDENTITY
    }

    /// The motion that takes the first point of each pair to the second one within about `tolerance`, m; it does so
    /// exactly with the first pair. `None` if there is none, or if none of them moves.
    ///
    /// The rotation is that between the triangles of three points: the first one, the one farthest from it, and the
    /// one farthest from the line through these. Where all are on a line, it is the least one.
    pub fn fit(pairs: &[[DVec3; 2]], tolerance: f64) -> Option<Self> {
        let &[from, to] = pairs.first()?;
        let displacement = to - from;
        if pairs.iter().all(|[before, after]| before.distance(*after) <= tolerance) {
            return None;
        }
        let translation = Self { rotation: DMat3::IDENTITY, from, to };
        if pairs.iter().all(|[before, after]| (*after - *before).distance(displacement) <= tolerance) {
            return Some(translation);
        }
        let farthest = |distance: &dyn Fn(DVec3) -> f64| {
            let larger = |best: &mut (f64, [DVec3; 2]), pair: &[DVec3; 2]| {
                let found = distance(pair[0] - from);
                if found > best.0 {
                    *best = (found, *pair);
                }
            };
            let mut best = (0.0, [from, to]);
            pairs.iter().for_each(|pair| larger(&mut best, pair));
            best.1
        };
        let far = farthest(&|arm| arm.length_squared());
        let [line, turned_line] = [(far[0] - from).try_normalize()?, (far[1] - to).try_normalize()?];
        let wide = farthest(&|arm| arm.reject_from_normalized(line).length_squared());
        let side = (wide[0] - from).reject_from_normalized(line);
        let turned_side = (wide[1] - to).reject_from_normalized(turned_line);
        let rotation = if side.length() > 4.0 * tolerance {
            let frame = |line: DVec3, side: DVec3| DMat3::from_cols(line, side, line.cross(side));
            let turned = frame(turned_line, turned_side.try_normalize()?);
            turned * frame(line, side.normalize()).transpose()
        } else {
            DMat3::from_quat(DQuat::from_rotation_arc(line, turned_line))
        };
        let motion = Self { rotation, from, to };
        // The errors of three points add up in that of a fourth.
        let fits = |[before, after]: &[DVec3; 2]| motion.apply(*before).distance(*after) <= 4.0 * tolerance;
        pairs.iter().all(fits).then_some(motion)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOLERANCE: f64 = 1e-6;

    fn points() -> Vec<DVec3> {
        [[0.0, 0.0, 0.0], [1.0, 0.2, 0.0], [0.3, 1.4, -0.2], [-0.7, 0.1, 0.9]].map(DVec3::from_array).to_vec()
    }

    fn pairs(points: &[DVec3], motion: impl Fn(DVec3) -> DVec3) -> Vec<[DVec3; 2]> {
        points.iter().map(|point| [*point, motion(*point)]).collect()
    }

    #[test]
    fn translations_and_rotations_are_found() {
        let turn = DQuat::from_rotation_y(1.2) * DQuat::from_rotation_x(-2.9);
        let shift = DVec3::new(3.0, -100.0, 7.0);
        let translated = RigidMotion::fit(&pairs(&points(), |point| point + shift), TOLERANCE).unwrap();
        assert!(translated.is_translation() && translated.turn(Vec3::X) == Vec3::X);
        assert!(translated.apply(DVec3::X).distance(DVec3::X + shift) < 1e-12);
        let turned = RigidMotion::fit(&pairs(&points(), |point| turn * point + shift), TOLERANCE).unwrap();
        assert!(turned.apply(DVec3::X).distance(turn * DVec3::X + shift) < 1e-12);
        assert!(turned.turn(Vec3::X).distance((turn * DVec3::X).as_vec3()) < 1e-6);
        assert!(turned.turn_rotation(Quat::IDENTITY).angle_between(turn.as_quat()) < 1e-3);
    }

    #[test]
    fn points_on_a_line_turn_as_little_as_they_can() {
        let line = [0.0, 0.5, 1.0, 1.5].map(|along| DVec3::Y * -along);
        let turn = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2);
        let found = RigidMotion::fit(&pairs(&line, |point| turn * point), TOLERANCE).unwrap();
        assert!(found.turn(Vec3::Z).distance(Vec3::Z) < 1e-6 && found.turn(Vec3::X).distance(Vec3::Y) < 1e-6);
    }

    #[test]
    fn what_is_deformed_mirrored_or_at_rest_is_no_motion() {
        let no_motion = |motion: &dyn Fn(DVec3) -> DVec3| {
            assert!(RigidMotion::fit(&pairs(&points(), motion), TOLERANCE).is_none());
        };
        no_motion(&|point| point);
        no_motion(&|point| point + DVec3::splat(1e-7));
        no_motion(&|point| point * 1.01 + DVec3::X);
        no_motion(&|point| point * DVec3::new(-1.0, 1.0, 1.0));
        no_motion(&|point| if point == DVec3::ZERO { point } else { point + DVec3::Y });
        assert!(RigidMotion::fit(&[], TOLERANCE).is_none());
    }

    #[test]
    fn an_isometry_of_the_world_is_the_same_from_any_origin() {
        let isometry = Isometry3d::new(Vec3::new(1.0, 2.0, 3.0), Quat::from_rotation_z(0.7));
        let place = Vec3::new(640.5, 2.0, -1.0);
        let expected = isometry.rotation.as_dquat() * place.as_dvec3() + DVec3::new(1.0, 2.0, 3.0);
        for origin in [Vec3::ZERO, Vec3::X * 640.0] {
            let seen = (place - origin).as_dvec3();
            let found = RigidMotion::of_isometry(isometry, origin).apply(seen) + origin.as_dvec3();
            assert!(found.distance(expected) < 1e-4, "{found} {expected}");
        }
    }
}
