//! Lines through space, by the length along them.

use bevy::math::DVec3;
use bevy::prelude::*;

use super::NetError;

/// Places at equal distances along the polyline `points`, measured along it: `segments` + 1 from end to end, or
/// `segments` around if it `is_closed`. And its length, m.
///
/// # Errors
/// If a point is not finite, or the line has no length.
pub(super) fn divide(points: &[Vec3], segments: u32, is_closed: bool) -> Result<(Vec<Vec3>, f64), NetError> {
    let lengths = measure(points, is_closed)?;
    let total = *lengths.last().expect("at least one point was measured");
    let count = if is_closed { segments } else { segments + 1 };
    let mut corner = 0;
    let place = |index| {
        let target = total * f64::from(index) / f64::from(segments);
        while corner + 2 < lengths.len() && lengths[corner + 1] < target {
            corner += 1;
        }
        let [from, to] = [corner, corner + 1].map(|point| points[point % points.len()].as_dvec3());
        let span = lengths[corner + 1] - lengths[corner];
        let along = if span > 0.0 { ((target - lengths[corner]) / span).min(1.0) } else { 0.0 };
        from.lerp(to, along).as_vec3()
    };
    Ok(((0..count).map(place).collect(), total))
}

/// A parabola from one place to another that is `slack` longer than the straight line, in parts of it, and hangs
/// towards −Y: near the catenary. Ends above each other have it hang towards X.
pub(super) fn sagging(start: Vec3, end: Vec3, slack: f32) -> Vec<Vec3> {
    const CHORDS: u16 = 256;
    let [start, end] = [start.as_dvec3(), end.as_dvec3()];
    let chord = end - start;
    let down = match DVec3::NEG_Y.reject_from_normalized(chord.normalize_or(DVec3::X)) {
        down if down.length() > 1e-3 => down.normalize(),
        _ => DVec3::X,
    };
    let place = |sag: f64, index: u16| {
        let along = f64::from(index) / f64::from(CHORDS);
        start + along * chord + 4.0 * sag * along * (1.0 - along) * down
    };
    let length = |sag: f64| -> f64 {
        (0..CHORDS).map(|index| place(sag, index).distance(place(sag, index + 1))).sum()
    };
    let target = chord.length() * (1.0 + f64::from(slack));
    // Twice the sag is less than the length, which grows with it.
    let (mut low, mut high) = (0.0, 0.5 * target);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if length(middle) < target { low = middle } else { high = middle }
    }
    (0..=CHORDS).map(|index| place(low, index).as_vec3()).collect()
}

/// The length of a line up to each of its points, m.
///
/// # Errors
/// If a point is not finite, or the line has no length.
pub(super) fn measure(points: &[Vec3], is_closed: bool) -> Result<Vec<f64>, NetError> {
    for point in points {
        crate::parameter::finite("path", *point)?;
    }
    let mut lengths = vec![0.0];
    let closing = is_closed.then(|| points.first()).flatten();
    let all: Vec<DVec3> = points.iter().chain(closing).map(|point| point.as_dvec3()).collect();
    let mut total = 0.0_f64;
    for pair in all.windows(2) {
        total += pair[0].distance(pair[1]);
        lengths.push(total);
    }
    if total > 0.0 && total.is_finite() {
        Ok(lengths)
    } else {
        Err(NetError::Degenerate { field: "path", lacks: "length" })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_corner_is_passed_at_equal_distances() {
        let points = [Vec3::ZERO, Vec3::X, Vec3::X, Vec3::new(1.0, 2.0, 0.0)];
        let (places, length) = divide(&points, 4, false).expect("a line");
        assert_eq!(length, 3.0);
        let expected =
            [Vec3::ZERO, Vec3::X * 0.75, Vec3::new(1.0, 0.5, 0.0), Vec3::new(1.0, 1.25, 0.0), points[3]];
        assert_eq!(places, expected);
    }

    #[test]
    fn a_loop_comes_back() {
        let points = [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y];
        let (places, length) = divide(&points, 8, true).expect("a line");
        assert_eq!((places.len(), length), (8, 4.0));
        assert_eq!(places[7], Vec3::new(0.0, 0.5, 0.0));
    }

    #[test]
    fn slack_is_the_length_beyond_the_chord() {
        for end in [Vec3::X, Vec3::new(1.0, 0.7, -0.3), Vec3::Y] {
            for slack in [1e-3, 0.2, 4.0] {
                let lengths = measure(&sagging(Vec3::ZERO, end, slack), false).expect("a line");
                let found = lengths.last().expect("a length") / f64::from(end.length()) - 1.0;
                // Chords of 1/256 are rounded to 1e-7 of a metre.
                assert!((found - f64::from(slack)).abs() < 3e-5, "{end} {slack}: {found}");
            }
        }
    }

    #[test]
    fn a_line_without_length_is_refused() {
        assert!(divide(&[Vec3::X], 3, false).is_err());
        assert!(divide(&[], 3, false).is_err());
        assert!(divide(&[Vec3::X, Vec3::X], 3, false).is_err());
        assert!(divide(&[Vec3::X, Vec3::NAN], 3, false).is_err());
    }
}
