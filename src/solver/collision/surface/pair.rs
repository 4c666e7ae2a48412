//! A pair of primitives: whether it stays apart during a displacement, and when it first comes near.

use bevy::math::Vec3A;

use super::closest::{Closest, closest, direction};

/// What is near what.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub(super) enum Kind {
    /// Corners: the vertex, then those of the triangle.
    #[default]
    VertexFace,
    /// Corners: the ends of one edge, then those of the other.
    EdgeEdge,
    /// Corners: the vertex, the ends of the edge, and one of these again.
    VertexEdge,
}

impl Kind {
    /// The number of corners of the first side.
    pub fn first_side(self) -> usize {
        if self == Self::EdgeEdge { 2 } else { 1 }
    }

    /// The number of corners of both sides.
    pub fn corners(self) -> usize {
        if self == Self::VertexEdge { 3 } else { 4 }
    }
}

/// The part of the distance at which two primitives touch that is always left between them.
pub(super) const MIN_DISTANCE_PART: f32 = 0.1;

/// The part of the least distance, beyond it, within which two have come near; of what was between them, if that is less.
pub(super) const CLOSE_PART: f32 = 0.25;

/// Rounding of distances and displacements, as a part of a coordinate.
pub(super) const DISTANCE_ROUNDING: f32 = 2e-6;

/// Number of steps of a conservative advancement, at most.
const MAX_STEPS: u32 = 256;

/// A distance that the two sides of a pair have at least, m, but for [`rounding_of`]: the distance along the line of their centres.
/// It is much cheaper than that of the closest points, and not much less for what lies side by side, as neighbours on a mesh do.
#[inline]
pub(super) fn least_apart(kind: Kind, corners: &[Vec3A; 4]) -> f32 {
    apart_along(kind, corners, between_centres(kind, corners))
}

/// The unit vector from the centre of the second side to that of the first; 0 if they are in one place.
#[inline]
pub(super) fn between_centres(kind: Kind, corners: &[Vec3A; 4]) -> Vec3A {
    // Relative to a corner, so that little is lost by rounding.
    let [a, b, c] = [1, 2, 3].map(|corner| corners[corner] - corners[0]);
    let direction = match kind {
        Kind::VertexFace => (a + b + c) / -3.0,
        Kind::EdgeEdge => 0.5 * (a - b - c),
        Kind::VertexEdge => -0.5 * (a + b),
    };
    direction.normalize_or_zero()
}

/// Another one: their distance along a `direction`, a unit vector. It is the true one along that of the closest points.
#[inline]
pub(super) fn apart_along(kind: Kind, corners: &[Vec3A; 4], direction: Vec3A) -> f32 {
    let [a, b, c] = [1, 2, 3].map(|corner| direction.dot(corners[corner] - corners[0]));
    match kind {
        Kind::VertexFace => -a.max(b).max(c),
        Kind::EdgeEdge => a.min(0.0) - b.max(c),
        Kind::VertexEdge => -a.max(b),
    }
}

/// By how much rounding may change the distance of two primitives with some corners, m.
pub(super) fn rounding_of(corners: &[Vec3A; 4]) -> f32 {
    let farthest = corners.iter().fold(Vec3A::ZERO, |most, corner| most.max(corner.abs()));
    DISTANCE_ROUNDING * farthest.max_element()
}

/// A distance below which a pair does not come on straight paths of its corners, from `start` to `end`, m, and the direction along which it
/// keeps it; `None` where it `is_far` by what is known before the closest points are.
///
/// It is less than the true one: what is told from it must not depend on rounding. What is apart along one direction at both ends is so all the way.
#[inline]
pub(super) fn distance_on_paths(
    kind: Kind,
    (start, end): (&[Vec3A; 4], Option<&[Vec3A; 4]>),
    is_far: impl Fn(f32) -> bool,
) -> Option<(f32, Vec3A)> {
    let rounding = rounding_of(start).max(end.map_or(0.0, rounding_of));
    let along = |direction: Vec3A| {
        let least = apart_along(kind, start, direction);
        end.map_or(least, |end| least.min(apart_along(kind, end, direction))) - rounding
    };
    if is_far(along(between_centres(kind, start))) {
        return None;
    }
    let mut found = direction(kind, start);
    let at_the_start = apart_along(kind, start, found) - rounding;
    let mut distance = end.map_or(at_the_start, |_| along(found));
    if let Some(end) = end.filter(|_| distance < 0.9 * at_the_start && !is_far(at_the_start)) {
        let at_the_end = direction(kind, end);
        let other = along(at_the_end);
        if other > distance {
            (distance, found) = (other, at_the_end);
        }
    }
    (!is_far(distance)).then_some((distance, found))
}

/// The straight paths of the corners of a pair.
#[derive(Debug, Clone, Copy)]
pub(super) struct PairPaths {
    pub kind: Kind,
    /// m.
    pub start: [Vec3A; 4],
    /// m.
    pub displacement: [Vec3A; 4],
}

impl PairPaths {
    /// Where the corners are when the part `time` of the path is done.
    pub fn at(&self, time: f32) -> [Vec3A; 4] {
        std::array::from_fn(|corner| self.start[corner] + time * self.displacement[corner])
    }

    /// The closest points then.
    pub fn closest(&self, time: f32) -> Closest {
        closest(self.kind, &self.at(time))
    }

    /// The distance of the sides along a direction when the part `time` of the path is done. As a function of time this is
    /// concave, so that on all the way they are at least as far apart along it as at one of its ends.
    pub fn gap(&self, direction: Vec3A, time: f32) -> f32 {
        // Relative to a corner, so that little is lost by rounding.
        let (sides, origin) = (self.kind.first_side(), self.start[0]);
        let along =
            |corner: usize| direction.dot((self.start[corner] - origin) + time * self.displacement[corner]);
        let first = (0..sides).map(along).fold(f32::INFINITY, f32::min);
        let second = (sides..self.kind.corners()).map(along).fold(f32::NEG_INFINITY, f32::max);
        first - second
    }

    /// The longest displacement, at most, of a point of one side relative to one of the other, m.
    pub fn relative_displacement(&self) -> f32 {
        let (sides, count) = (self.kind.first_side(), self.kind.corners());
        let mean = self.displacement[..count].iter().sum::<Vec3A>() / count as f32;
        let longest = |corners: &[Vec3A]| {
            corners
                .iter()
                .map(|displacement| (*displacement - mean).length_squared())
                .fold(0.0, f32::max)
                .sqrt()
        };
        longest(&self.displacement[..sides]) + longest(&self.displacement[sides..count])
    }

    /// Whether they are at least `least` m apart all the way along the direction of their closest points at the end.
    fn is_apart_at_the_end(&self, least: f32) -> bool {
        let apart = self.closest(1.0).apart;
        let distance = apart.length();
        distance >= least && self.gap(apart / distance, 0.0) >= least
    }

    /// When the sides, which are `distance` m apart at the start, first come as near as `least`, m: a part of the path; 1 if
    /// they never do. It is never later than that, and the distance then is at most 1 + [`CLOSE_PART`] times that: what stops does
    /// not depend on which pairs are looked at that never come so near.
    ///
    /// Conservative advancement (Mirtich 1996; for such pairs Li, Kaufman and Jiang, *Codimensional incremental potential
    /// contact*, 2021, section 5).
    pub fn first_near(&self, distance: f32, least: f32) -> f32 {
        self.first_within(distance, [least, least + CLOSE_PART * least.min(distance - least).max(0.0)])
    }

    /// The same, at a distance between `least` and `close`, m.
    pub fn first_within(&self, distance: f32, [least, close]: [f32; 2]) -> f32 {
        let speed = self.relative_displacement();
        if distance - speed > least || self.is_apart_at_the_end(least) {
            return 1.0;
        }
        let (mut time, mut now) = (0.0_f32, distance);
        for _ in 0..MAX_STEPS {
            let step = 0.95 * (now - least).max(0.0) / speed;
            if time + step >= 1.0 {
                return 1.0;
            }
            let next = self.closest(time + step).apart.length();
            if next.is_nan() || next <= close {
                return time + step * f32::from(u8::from(next > least));
            }
            time += step;
            now = next;
        }
        time
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FACE: [Vec3A; 3] =
        [Vec3A::new(-1.0, -1.0, 0.0), Vec3A::new(1.0, -1.0, 0.0), Vec3A::new(0.0, 1.0, 0.0)];

    fn flight(from: Vec3A, displacement: Vec3A) -> PairPaths {
        PairPaths {
            kind: Kind::VertexFace,
            start: [from, FACE[0], FACE[1], FACE[2]],
            displacement: [displacement, Vec3A::ZERO, Vec3A::ZERO, Vec3A::ZERO],
        }
    }

    #[test]
    fn a_point_stops_in_front_of_a_face_and_passes_beside_it() {
        let through = flight(Vec3A::Z, Vec3A::Z * -1000.0);
        let height = 1.0 - 1000.0 * through.first_near(1.0, 0.1);
        assert!((0.1..0.2).contains(&height), "{height}");
        assert_eq!(flight(Vec3A::Z + Vec3A::X * 3.0, Vec3A::Z * -1000.0).first_near(2.0, 0.1), 1.0);
        assert_eq!(flight(Vec3A::Z, Vec3A::Z * 1000.0).first_near(1.0, 0.1), 1.0);
        assert!(through.gap(Vec3A::Z, 1.0) < 0.0 && flight(Vec3A::Z, Vec3A::X).gap(Vec3A::Z, 1.0) > 0.9);
    }

    #[test]
    fn the_distance_along_the_line_of_centres_is_never_too_large() {
        for kind in [Kind::VertexFace, Kind::EdgeEdge, Kind::VertexEdge] {
            for number in 0..1000 {
                let corners: [Vec3A; 4] = std::array::from_fn(|corner| {
                    let place = (4 * number + corner) as f32 + Vec3A::new(0.1, 0.4, 0.7);
                    2.0 * (place * Vec3A::new(0.618, 0.414, 0.732)).fract() - 1.0
                });
                let (least, distance) = (least_apart(kind, &corners), closest(kind, &corners).apart.length());
                assert!(
                    least <= distance + rounding_of(&corners),
                    "{kind:?} {corners:?}: {least} > {distance}"
                );
            }
        }
        // Side by side it is exact.
        let edges = [Vec3A::X, Vec3A::Y, Vec3A::new(3.0, 0.0, 0.0), Vec3A::new(3.0, 1.0, 0.0)];
        assert!((least_apart(Kind::EdgeEdge, &edges) - 2.0).abs() < 1e-6);
    }

    #[test]
    fn what_moves_together_has_no_way_to_each_other() {
        let together = PairPaths { displacement: [Vec3A::splat(100.0); 4], ..flight(Vec3A::Z, Vec3A::ZERO) };
        assert!(together.relative_displacement() < 1e-4);
        assert_eq!(together.first_near(1.0, 0.9), 1.0);
    }
}
