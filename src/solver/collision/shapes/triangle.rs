//! Points and segments against single triangles (Ericson, *Real-Time Collision Detection*, 2005, section 5.1).

use bevy::math::DVec3;

/// Where on a triangle its nearest point lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::solver::collision) enum Feature {
    Face,
    /// The edge from this corner to the next one.
    Edge(usize),
    Corner(usize),
}

/// The barycentric coordinates of the point of a triangle that is next to `point`, and what that lies on.
#[inline]
pub(in crate::solver::collision) fn nearest(point: DVec3, [a, b, c]: [DVec3; 3]) -> ([f64; 3], Feature) {
    let (ab, ac, ap) = (b - a, c - a, point - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return ([1.0, 0.0, 0.0], Feature::Corner(0));
    }
    let bp = point - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return ([0.0, 1.0, 0.0], Feature::Corner(1));
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let part = d1 / (d1 - d3);
        return ([1.0 - part, part, 0.0], Feature::Edge(0));
    }
    let cp = point - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return ([0.0, 0.0, 1.0], Feature::Corner(2));
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let part = d2 / (d2 - d6);
        return ([1.0 - part, 0.0, part], Feature::Edge(2));
    }
    let va = d3 * d6 - d5 * d4;
    let (to_c, to_b) = (d4 - d3, d5 - d6);
    if va <= 0.0 && to_c >= 0.0 && to_b >= 0.0 {
        let part = to_c / (to_c + to_b);
        return ([0.0, 1.0 - part, part], Feature::Edge(1));
    }
    let sum = va + vb + vc;
    if sum.is_nan() || sum <= 0.0 {
        // A triangle without area that its edges have not caught.
        let part = (d1 / ab.length_squared()).clamp(0.0, 1.0);
        let part = if part.is_nan() { 0.0 } else { part };
        return ([1.0 - part, part, 0.0], Feature::Edge(0));
    }
    let scale = 1.0 / sum;
    let (v, w) = (vb * scale, vc * scale);
    ([1.0 - v - w, v, w], Feature::Face)
}

/// The same as a point.
#[inline]
pub(super) fn nearest_point(point: DVec3, corners: [DVec3; 3]) -> (DVec3, Feature) {
    let ([_, v, w], feature) = nearest(point, corners);
    let [a, b, c] = corners;
    let foot = match feature {
        Feature::Corner(corner) => corners[corner],
        Feature::Edge(0) => a + (b - a) * v,
        Feature::Edge(1) => b + (c - b) * w,
        Feature::Edge(_) => a + (c - a) * w,
        Feature::Face => a + (b - a) * v + (c - a) * w,
    };
    (foot, feature)
}

/// When the path from `from` to `to` crosses a triangle, as a part of it, and from which side: whether from that of its
/// normal. (Möller and Trumbore, *J. Graphics Tools* 2, 21, 1997.)
pub(super) fn crossing(from: DVec3, to: DVec3, [a, b, c]: [DVec3; 3]) -> Option<(f64, bool)> {
    let (ab, ac, displacement) = (b - a, c - a, to - from);
    let normal = ab.cross(ac);
    let approach = -displacement.dot(normal);
    if approach == 0.0 {
        return None;
    }
    let apart = from - a;
    let time = apart.dot(normal) / approach;
    if !(0.0..=1.0).contains(&time) {
        return None;
    }
    let across = displacement.cross(apart) / approach;
    let (v, w) = (-ac.dot(across), ab.dot(across));
    // Neighbours overlap by a little, so that nothing slips between them.
    let slack = 1e-9;
    (v >= -slack && w >= -slack && v + w <= 1.0 + slack).then_some((time, approach > 0.0))
}

/// The parameters, from 0 to 1, of the points of two segments that are next to each other.
pub(in crate::solver::collision) fn nearest_parameters([p, q]: [DVec3; 2], [r, s]: [DVec3; 2]) -> [f64; 2] {
    let (d1, d2, apart) = (q - p, s - r, p - r);
    let (a, e, f) = (d1.length_squared(), d2.length_squared(), d2.dot(apart));
    if a <= 0.0 && e <= 0.0 {
        return [0.0, 0.0];
    }
    if a <= 0.0 {
        return [0.0, (f / e).clamp(0.0, 1.0)];
    }
    let c = d1.dot(apart);
    if e <= 0.0 {
        return [(-c / a).clamp(0.0, 1.0), 0.0];
    }
    let b = d1.dot(d2);
    let denominator = a * e - b * b;
    let parallel = denominator <= 1e-14 * a * e;
    let first = if parallel { 0.5 } else { ((b * f - c * e) / denominator).clamp(0.0, 1.0) };
    let second = (b * first + f) / e;
    let second_inside = second.clamp(0.0, 1.0);
    if second_inside == second && !parallel {
        return [first, second];
    }
    let first = ((b * second_inside - c) / a).clamp(0.0, 1.0);
    let second = ((b * first + f) / e).clamp(0.0, 1.0);
    [first, second]
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [DVec3; 3] = [DVec3::ZERO, DVec3::new(2.0, 0.0, 0.0), DVec3::new(0.0, 0.0, 1.0)];

    #[test]
    fn the_nearest_point_is_on_the_feature_that_is_named() {
        let cases = [
            (DVec3::new(0.3, 2.0, 0.3), DVec3::new(0.3, 0.0, 0.3), Feature::Face),
            (DVec3::new(1.0, 0.5, -3.0), DVec3::new(1.0, 0.0, 0.0), Feature::Edge(0)),
            (DVec3::new(-2.0, 0.1, 0.5), DVec3::new(0.0, 0.0, 0.5), Feature::Edge(2)),
            (DVec3::new(1.8, 0.0, 2.1), DVec3::new(1.0, 0.0, 0.5), Feature::Edge(1)),
            (DVec3::new(-1.0, 1.0, -1.0), DVec3::ZERO, Feature::Corner(0)),
            (DVec3::new(5.0, 0.0, -1.0), CORNERS[1], Feature::Corner(1)),
            (DVec3::new(-1.0, 0.0, 4.0), CORNERS[2], Feature::Corner(2)),
        ];
        for (point, expected, feature) in cases {
            let (found, on) = nearest_point(point, CORNERS);
            assert!(found.distance(expected) < 1e-12, "{point}: {found}");
            assert_eq!(on, feature, "{point}");
        }
    }

    #[test]
    fn a_way_crosses_where_it_does() {
        // The normal is (0, −2, 0): ab × ac.
        let from = DVec3::new(0.3, 1.0, 0.3);
        assert_eq!(crossing(from, from.with_y(-3.0), CORNERS), Some((0.25, false)));
        assert_eq!(crossing(from.with_y(-1.0), from, CORNERS), Some((0.5, true)));
        assert_eq!(crossing(from, from.with_y(0.5), CORNERS), None);
        let beside = DVec3::new(-0.1, 1.0, 0.3);
        assert_eq!(crossing(beside, beside.with_y(-1.0), CORNERS), None);
    }

    #[test]
    fn segments_are_nearest_where_no_other_points_are_nearer() {
        let segments = [
            [DVec3::new(0.0, 1.0, 0.0), DVec3::new(1.0, 1.0, 0.0)],
            [DVec3::new(0.5, 0.0, -1.0), DVec3::new(0.5, 0.2, 1.0)],
            [DVec3::new(3.0, 0.0, 0.0), DVec3::new(4.0, 2.0, 0.5)],
            [DVec3::new(-2.0, 3.0, 1.0), DVec3::new(-2.0, 3.0, 1.0)],
        ];
        for one in segments {
            for other in segments {
                let at = |segment: [DVec3; 2], part: f64| segment[0].lerp(segment[1], part);
                let [first, second] = nearest_parameters(one, other);
                let found = at(one, first).distance(at(other, second));
                let parts =
                    (0..=50).flat_map(|i| (0..=50).map(move |j| (f64::from(i) / 50.0, f64::from(j) / 50.0)));
                let least =
                    parts.map(|(i, j)| at(one, i).distance(at(other, j))).fold(f64::INFINITY, f64::min);
                assert!(found <= least + 1e-12, "{one:?} and {other:?}: {found} instead of {least}");
            }
        }
    }
}
