//! Closest points of a point and a triangle, of two edges, and of a point and an edge.

use bevy::math::{DVec3, Vec3A};

use super::pair::Kind;

use super::super::shapes::triangle;

/// The closest points of the two sides of a pair.
#[derive(Debug, Clone, Copy)]
pub(super) struct Closest {
    /// From the second side to the first, m.
    pub apart: Vec3A,
    /// Those of the corners, >= 0, which add up to 1 on each side.
    pub weights: [f32; 4],
}

/// The closest points of a pair of this `kind` with these corners. In f64: triangles may be stretched to slivers.
pub(super) fn closest(kind: Kind, corners: &[Vec3A; 4]) -> Closest {
    // From a corner, so that the rest is exact.
    let [a, b, c] = [1, 2, 3].map(|corner| (corners[corner] - corners[0]).as_dvec3());
    let (apart, weights) = match kind {
        Kind::VertexFace => {
            let ([u, v, w], _) = triangle::nearest(DVec3::ZERO, [a, b, c]);
            (-(u * a + v * b + w * c), [1.0, u, v, w])
        }
        Kind::EdgeEdge => {
            let [s, t] = triangle::nearest_parameters([DVec3::ZERO, a], [b, c]);
            (s * a - b.lerp(c, t), [1.0 - s, s, 1.0 - t, t])
        }
        Kind::VertexEdge => {
            let t = on_edge(DVec3::ZERO, [a, b]);
            (-a.lerp(b, t), [1.0, 1.0 - t, t, 0.0])
        }
    };
    Closest { apart: apart.as_vec3a(), weights: weights.map(|weight| weight as f32) }
}

/// About the direction from the closest point of the second side to that of the first, a unit vector or 0: cheap, in f32. Whatever it is, what is apart
/// along it is apart.
#[inline]
pub(super) fn direction(kind: Kind, corners: &[Vec3A; 4]) -> Vec3A {
    let [a, b, c] = [1, 2, 3].map(|corner| corners[corner] - corners[0]);
    let apart = match kind {
        Kind::VertexFace => from_face([a, b, c]),
        Kind::EdgeEdge => between_edges(a, [b, c]),
        Kind::VertexEdge => from_edge([a, b]),
    };
    apart.normalize_or_zero()
}

/// From the nearest point of a segment to the origin.
#[inline]
fn from_edge([a, b]: [Vec3A; 2]) -> Vec3A {
    let along = b - a;
    let part = -a.dot(along) / along.length_squared().max(f32::MIN_POSITIVE);
    -(a + along * part.clamp(0.0, 1.0))
}

/// From the nearest point of a triangle to the origin.
#[inline]
fn from_face([a, b, c]: [Vec3A; 3]) -> Vec3A {
    let normal = (b - a).cross(c - a);
    let outside = [(a, b), (b, c), (c, a)].map(|(from, to)| normal.dot((to - from).cross(from)));
    // The origin is above the face if it is on the inner side of each edge.
    if outside.iter().all(|side| *side <= 0.0) {
        return normal * -normal.dot(a).signum();
    }
    let nearer =
        |one: Vec3A, other: Vec3A| if other.length_squared() < one.length_squared() { other } else { one };
    nearer(nearer(from_edge([a, b]), from_edge([b, c])), from_edge([c, a]))
}

/// From the nearest point of a segment to that of one from the origin to `own`.
#[inline]
fn between_edges(own: Vec3A, [from, to]: [Vec3A; 2]) -> Vec3A {
    let along = to - from;
    let (a, e) = (own.length_squared().max(f32::MIN_POSITIVE), along.length_squared().max(f32::MIN_POSITIVE));
    let (b, c, f) = (own.dot(along), -own.dot(from), -along.dot(from));
    let first = ((b * f - c * e) / (a * e - b * b).max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
    let second = ((b * first + f) / e).clamp(0.0, 1.0);
    let first = ((b * second - c) / a).clamp(0.0, 1.0);
    own * first - (from + along * second)
}

/// Where on an edge it is closest to a point: 0 to 1.
fn on_edge(point: DVec3, [a, b]: [DVec3; 2]) -> f64 {
    let along = b - a;
    let length = along.length_squared();
    if length > 0.0 { ((point - a).dot(along) / length).clamp(0.0, 1.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn distance(kind: Kind, corners: [[f32; 3]; 4]) -> f32 {
        let corners = corners.map(Vec3A::from_array);
        let found = closest(kind, &corners);
        let sides = kind.first_side();
        let sums = [&found.weights[..sides], &found.weights[sides..]].map(|side| side.iter().sum::<f32>());
        assert!(sums.iter().all(|sum| (sum - 1.0).abs() < 1e-5), "{sums:?}");
        let sign = |place: usize| if place < sides { 1.0 } else { -1.0 };
        let apart: Vec3A = (0..4).map(|place| corners[place] * (sign(place) * found.weights[place])).sum();
        assert!(apart.distance(found.apart) < 1e-5);
        found.apart.length()
    }

    #[test]
    fn points_find_the_inside_the_edges_and_the_corners_of_a_triangle() {
        let triangle = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        for (point, expected) in [
            ([0.2, 0.3, 0.5], 0.5),
            ([0.5, -2.0, 0.0], 2.0),
            ([-3.0, -4.0, 0.0], 5.0),
            ([1.0, 1.0, 0.0], 0.5_f32.sqrt()),
            ([4.0, 0.0, 4.0], 5.0),
        ] {
            let corners = [point, triangle[0], triangle[1], triangle[2]];
            assert!((distance(Kind::VertexFace, corners) - expected).abs() < 1e-5, "{point:?}");
        }
    }

    #[test]
    fn edges_may_cross_be_parallel_or_end_to_end() {
        for (corners, expected) in [
            ([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.3], [0.0, 1.0, 0.3]], 0.3),
            ([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.9, 0.2, 0.0], [3.0, 0.2, 0.0]], 0.2),
            ([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [4.0, 4.0, 0.0], [9.0, 4.0, 0.0]], 5.0),
            ([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [-1.0, 1.0, 0.0], [1.0, 1.0, 0.0]], 1.0),
        ] {
            assert!((distance(Kind::EdgeEdge, corners) - expected).abs() < 1e-5, "{corners:?}");
        }
        let corners = [[2.0, 1.0, 0.0], [0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [9.0, 9.0, 9.0]];
        assert!((distance(Kind::VertexEdge, corners) - 1.0).abs() < 1e-6);
    }
}
