//! A particle, an edge or a triangle of a net as a solid: all within a radius of it. It is convex.

use bevy::math::DVec3;

use super::sweep::cast_to_convex;
use super::triangle::{self, Feature};
use super::{Crossing, Nearest};

/// Below this part of the coordinates a distance says nothing about its direction.
const ROUNDING: f64 = 1e-12;

/// What lies within a radius of a point, a segment or a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Simplex {
    /// m; those beyond `count` are the last one.
    corners: [DVec3; 3],
    /// 1 to 3.
    count: usize,
    /// m.
    radius: f64,
}

impl Simplex {
    /// That around 1 to 3 corners, m.
    pub fn new<const COUNT: usize>(corners: [DVec3; COUNT], radius: f64) -> Self {
        const { assert!(matches!(COUNT, 1..=3)) };
        Self { corners: [0, 1, 2].map(|corner| corners[corner.min(COUNT - 1)]), count: COUNT, radius }
    }

    /// How far a point is from its surface, m, negative inside, and the outward normal there.
    pub fn nearest(&self, point: DVec3) -> Nearest {
        self.nearest_facing(point, DVec3::Y)
    }

    /// Where a ball first touches it on the way of its centre; at time 0 where it does from the start.
    pub fn cast(&self, from: DVec3, to: DVec3, radius: f64) -> Option<Crossing> {
        if !self.may_meet(from, to, radius) {
            return None;
        }
        let back = (from - to).normalize_or(DVec3::Y);
        cast_to_convex(|point| self.nearest_facing(point, back), from, to, radius)
    }

    /// Whether a ball can touch it on the way of its centre, by the sphere around it.
    pub fn may_meet(&self, from: DVec3, to: DVec3, radius: f64) -> bool {
        let centre = self.corners[..self.count].iter().sum::<DVec3>() / self.count as f64;
        let square = |corner: &DVec3| corner.distance_squared(centre);
        let reach = self.corners.iter().map(square).fold(0.0, f64::max).sqrt() + self.radius + radius;
        let (way, apart) = (to - from, centre - from);
        let share = part_between_ends(apart.dot(way) / way.length_squared());
        // Wider by what rounding may take away.
        let limit = reach * (1.0 + 1e-9) + 1e-6 * (1.0 + radius);
        apart.distance_squared(way * share) <= limit * limit
    }

    /// A distance from a point beyond which nothing of it is, m.
    pub fn farthest(&self, point: DVec3) -> f64 {
        let distances = self.corners.iter().map(|corner| corner.distance(point));
        distances.fold(0.0, f64::max) + self.radius
    }

    /// The same as [`nearest`](Self::nearest); on the point, segment or triangle itself the normal is on the side of `front`.
    fn nearest_facing(&self, point: DVec3, front: DVec3) -> Nearest {
        let (foot, is_face) = self.foot(point);
        let apart = point - foot;
        let distance = apart.length();
        let is_known = distance > ROUNDING * point.abs().max_element().max(foot.abs().max_element());
        let side = if is_known { apart } else { front };
        let [a, b, c] = self.corners;
        let face = if is_face { (b - a).cross(c - a).try_normalize() } else { None };
        let normal = match face {
            Some(face) if face.dot(side) < 0.0 => -face,
            Some(face) => face,
            None => side.normalize_or(front),
        };
        Nearest { distance: distance - self.radius, normal }
    }

    /// The nearest point of the point, segment or triangle itself, and whether it is inside a triangle.
    fn foot(&self, point: DVec3) -> (DVec3, bool) {
        let [a, b, _] = self.corners;
        match self.count {
            1 => (a, false),
            2 => {
                let along = b - a;
                let share = (point - a).dot(along) / along.length_squared();
                (a + along * part_between_ends(share), false)
            }
            _ => {
                let (foot, feature) = triangle::nearest_point(point, self.corners);
                (foot, feature == Feature::Face)
            }
        }
    }
}

/// 0 to 1; 0 of NaN, where both ends are one.
fn part_between_ends(part: f64) -> f64 {
    if part > 0.0 { part.min(1.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In the plane y = 0, with right angles at the first corner.
    const CORNERS: [DVec3; 3] = [DVec3::ZERO, DVec3::new(2.0, 0.0, 0.0), DVec3::new(0.0, 0.0, 1.0)];

    fn check(found: Option<Crossing>, time: f64, foot: DVec3, normal: DVec3) {
        let found = found.expect("it is met");
        // A gap of 1e-7 (1 + radius) is none.
        assert!((found.time - time).abs() < 1e-6, "{found:?}");
        assert!(found.foot.distance(foot) < 1e-6 && found.normal.distance(normal) < 1e-6, "{found:?}");
    }

    #[test]
    fn a_ball_meets_a_thick_triangle_on_its_face_its_edge_and_its_corner() {
        let thick = Simplex::new(CORNERS, 0.1);
        let above = DVec3::new(0.5, 2.0, 0.25);
        check(thick.cast(above, above.with_y(-2.0), 0.0), 1.9 / 4.0, above.with_y(0.1), DVec3::Y);
        check(thick.cast(above, above.with_y(-2.0), 0.3), 1.6 / 4.0, above.with_y(0.1), DVec3::Y);
        let below = above.with_y(-2.0);
        check(thick.cast(below, above, 0.3), 1.6 / 4.0, below.with_y(-0.1), DVec3::NEG_Y);
        // Beside the edge along x by 0.24 m, with 0.4 m between the centre and the edge: 0.32 m above.
        let beside = DVec3::new(1.0, 2.0, -0.24);
        let normal = DVec3::new(0.0, 0.8, -0.6);
        let foot = DVec3::X + normal * 0.1;
        check(thick.cast(beside, beside.with_y(-2.0), 0.3), 1.68 / 4.0, foot, normal);
        // Beyond the corner at (2, 0, 0) by (0.1, ·, −0.2): √(0.4² − 0.05) m above.
        let beyond = DVec3::new(2.1, 2.0, -0.2);
        let height = 0.11_f64.sqrt();
        let normal = DVec3::new(0.1, height, -0.2) / 0.4;
        let time = (2.0 - height) / 4.0;
        check(thick.cast(beyond, beyond.with_y(-2.0), 0.3), time, CORNERS[1] + normal * 0.1, normal);
        assert_eq!(thick.cast(beyond.with_z(-0.4), beyond.with_z(-0.4).with_y(-2.0), 0.3), None);
    }

    #[test]
    fn a_ray_meets_what_has_no_thickness_from_either_side() {
        let thin = Simplex::new(CORNERS, 0.0);
        let (above, below) = (DVec3::new(0.5, 2.0, 0.25), DVec3::new(0.5, -2.0, 0.25));
        check(thin.cast(above, below, 0.0), 0.5, above.with_y(0.0), DVec3::Y);
        check(thin.cast(below, above, 0.0), 0.5, above.with_y(0.0), DVec3::NEG_Y);
        assert_eq!(thin.cast(above.with_x(1.6), below.with_x(1.6), 0.0), None);
        // Along the plane of the triangle: onto its edge.
        let found = thin.cast(DVec3::new(-1.0, 0.0, 0.25), DVec3::new(3.0, 0.0, 0.25), 0.0).unwrap();
        assert!((found.time - 0.25).abs() < 1e-6, "{found:?}");
    }

    #[test]
    fn what_touches_at_the_start_is_met_at_once() {
        let capsule = Simplex::new([DVec3::ZERO, DVec3::X], 0.2);
        let inside = DVec3::new(0.5, 0.1, 0.0);
        for to in [inside + DVec3::Y, inside - DVec3::Y, inside] {
            check(capsule.cast(inside, to, 0.0), 0.0, DVec3::new(0.5, 0.2, 0.0), DVec3::Y);
        }
        assert_eq!(capsule.cast(inside + DVec3::Y, inside + DVec3::Y, 0.0), None);
        let nearest = capsule.nearest(DVec3::new(-0.3, 0.4, 0.0));
        assert!((nearest.distance - 0.3).abs() < 1e-12, "{nearest:?}");
        assert!(nearest.normal.distance(DVec3::new(-0.6, 0.8, 0.0)) < 1e-12);
        let centre = Simplex::new([DVec3::ONE], 0.5).nearest(DVec3::ONE);
        assert_eq!(centre, Nearest { distance: -0.5, normal: DVec3::Y });
    }

    /// Of random ones: what is said to be the first contact is one, and nothing before it is.
    #[test]
    fn no_point_of_the_way_before_the_contact_is_nearer() {
        let mut seed = 7_u32;
        let mut random = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(seed >> 8) / f64::from(1_u32 << 24) - 0.5
        };
        let mut hits = 0;
        for number in 0..600 {
            let mut place = |size: f64| DVec3::new(random(), random(), random()) * size;
            let [a, b, c] = [place(2.0), place(2.0), place(2.0)];
            let (from, to) = (place(4.0), place(4.0));
            let solid = match number % 3 {
                0 => Simplex::new([a], 0.3),
                1 => Simplex::new([a, b], 0.1),
                _ => Simplex::new([a, b, c], 0.05),
            };
            let radius = [0.0, 0.2][number % 2];
            let gap = |time: f64| solid.nearest(from.lerp(to, time)).distance - radius;
            let found = solid.cast(from, to, radius);
            let end = found.map_or(1.0, |found| found.time);
            // Up to 1e-7 (1 + radius) is none, and as much is left for the rounding of the way.
            for step in 0..200 {
                let time = end * f64::from(step) / 200.0;
                assert!(end == 0.0 || gap(time) > -1e-6, "{number}: {} at {time}", gap(time));
            }
            if let Some(Crossing { time, foot, .. }) = found {
                hits += 1;
                assert!(time == 0.0 || gap(time).abs() < 1e-6, "{number}: {}", gap(time));
                assert!(solid.nearest(foot).distance.abs() < 1e-9, "{number}");
            }
        }
        assert!(hits > 30, "{hits}");
    }

    #[test]
    fn what_is_nowhere_is_not_met() {
        for bad in [f64::NAN, f64::INFINITY] {
            let solid = Simplex::new([DVec3::ZERO, DVec3::new(bad, 0.0, 0.0)], 0.1);
            assert_eq!(solid.cast(DVec3::Y, DVec3::NEG_Y, 0.0).filter(|found| found.time.is_nan()), None);
            let solid = Simplex::new([DVec3::splat(bad)], 0.1);
            assert_eq!(solid.cast(DVec3::Y, DVec3::NEG_Y, 0.0), None);
        }
    }
}
