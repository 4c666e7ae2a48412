//! Closest points of a point and a triangle, of two edges, and of a point and an edge.
//!
//! Ericson, *Real-time collision detection* (2005), sections 5.1.2, 5.1.5 and 5.1.9.

use bevy::math::{DVec3, Vec3A};

use super::pair::Kind;

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
            let [u, v, w] = on_triangle(DVec3::ZERO, [a, b, c]);
            (-(u * a + v * b + w * c), [1.0, u, v, w])
        }
        Kind::EdgeEdge => {
            let [s, t] = on_edges([DVec3::ZERO, a], [b, c]);
            (s * a - b.lerp(c, t), [1.0 - s, s, 1.0 - t, t])
        }
        Kind::VertexEdge => {
            let t = on_edge(DVec3::ZERO, [a, b]);
            (-a.lerp(b, t), [1.0, 1.0 - t, t, 0.0])
        }
    };
    Closest { apart: apart.as_vec3a(), weights: weights.map(|weight| weight as f32) }
}

/// Where on an edge it is closest to a point: 0 to 1.
fn on_edge(point: DVec3, [a, b]: [DVec3; 2]) -> f64 {
    let along = b - a;
    let length = along.length_squared();
    if length > 0.0 { ((point - a).dot(along) / length).clamp(0.0, 1.0) } else { 0.0 }
}

/// The barycentric coordinates of the point of a triangle that is closest to a point.
fn on_triangle(point: DVec3, [a, b, c]: [DVec3; 3]) -> [f64; 3] {
    let (ab, ac, ap) = (b - a, c - a, point - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let bp = point - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let t = d1 / (d1 - d3);
        return [1.0 - t, t, 0.0];
    }
    let cp = point - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let t = d2 / (d2 - d6);
        return [1.0 - t, 0.0, t];
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let t = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return [0.0, 1.0 - t, t];
    }
    let sum = va + vb + vc;
    if sum.is_nan() || sum <= 0.0 {
        // A triangle without area that its edges have not caught.
        let t = on_edge(point, [a, b]);
        return [1.0 - t, t, 0.0];
    }
    let (v, w) = (vb / sum, vc / sum);
    [1.0 - v - w, v, w]
}

/// Where two edges are closest to each other: 0 to 1 along each.
fn on_edges([p1, q1]: [DVec3; 2], [p2, q2]: [DVec3; 2]) -> [f64; 2] {
    let (d1, d2, r) = (q1 - p1, q2 - p2, p1 - p2);
    let (a, e, f) = (d1.length_squared(), d2.length_squared(), d2.dot(r));
    if a == 0.0 {
        return [0.0, if e > 0.0 { (f / e).clamp(0.0, 1.0) } else { 0.0 }];
    }
    let c = d1.dot(r);
    if e == 0.0 {
        return [(-c / a).clamp(0.0, 1.0), 0.0];
    }
    let b = d1.dot(d2);
    let denominator = a * e - b * b;
    // Of edges that are parallel, to rounding, any point will do for a start.
    let s = if denominator > 1e-12 * a * e { ((b * f - c * e) / denominator).clamp(0.0, 1.0) } else { 0.5 };
    let t = (b * s + f) / e;
    let clamped = t.clamp(0.0, 1.0);
    // Also where it was not clamped: parallel ones get their best s.
    [((b * clamped - c) / a).clamp(0.0, 1.0), clamped]
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
