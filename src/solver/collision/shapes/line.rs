//! The point of a line that is nearest to a convex shape. The distance is a convex function along the line: its minimum is found by
//! secants of the slope where the surface is smooth, by crossings of tangents where it has edges, else by bisection; two tangents bound
//! it from below.

use bevy::math::DVec3;

use super::Shape;
use super::feature::Deepest;

/// Number of points of an edge that are tested.
const MAX_POINTS: usize = 36;

/// How well the deepest point is known, m; what is not deeper than a corner by as much is left to that.
pub(super) const ACCURACY: f64 = 1e-8;

/// An edge and a convex shape.
pub(super) struct Line<'a> {
    pub shape: &'a Shape,
    /// m.
    pub ends: [DVec3; 2],
    /// At its ends, m.
    pub radii: [f64; 2],
}

impl Line<'_> {
    /// The point at this part of the way from the first end to the last.
    pub fn at(&self, part: f64) -> Deepest {
        let Self { shape, ends: [from, to], radii } = self;
        let nearest = shape.nearest(from.lerp(*to, part), 0.0);
        let radius = radii[0] + part * (radii[1] - radii[0]);
        Deepest { weights: [1.0 - part, part, 0.0], gap: nearest.distance - radius, nearest }
    }

    fn slope(&self, at: &Deepest) -> f64 {
        let Self { ends: [from, to], radii, .. } = self;
        at.nearest.normal.dot(*to - *from) - (radii[1] - radii[0])
    }

    /// The deepest point, if it is between the ends and not farther than `within`; or a bound of the gaps.
    pub fn deepest(&self, within: f64) -> Result<Deepest, f64> {
        let (first, last) = (self.at(0.0), self.at(1.0));
        let (low, high) = ((first.gap, self.slope(&first)), (last.gap, self.slope(&last)));
        let at_end = low.0.min(high.0);
        if low.1 >= 0.0 || high.1 <= 0.0 {
            return Err(at_end - ACCURACY);
        }
        let gradients = [first, last].map(|end| end.nearest.normal);
        self.search([low, high], gradients, within.min(at_end - ACCURACY)).map(|(found, _)| found)
    }

    /// The deepest point, ends included, and the gradient of the distance there: that of all there are, where the surface has
    /// an edge, along which the gap does not change on the line.
    pub fn least(&self) -> (Deepest, DVec3) {
        let (first, last) = (self.at(0.0), self.at(1.0));
        let (low, high) = ((first.gap, self.slope(&first)), (last.gap, self.slope(&last)));
        let gradients = [first, last].map(|end| end.nearest.normal);
        if low.1 >= 0.0 {
            return (first, gradients[0]);
        }
        if high.1 <= 0.0 {
            return (last, gradients[1]);
        }
        self.search([low, high], gradients, f64::INFINITY).unwrap_or((first, gradients[0]))
    }

    /// The same, given the gaps at the ends, the slopes there, of which one falls and the other rises, and the gradients.
    fn search(
        &self,
        [mut low, mut high]: [(f64, f64); 2],
        mut gradients: [DVec3; 2],
        within: f64,
    ) -> Result<(Deepest, DVec3), f64> {
        let (mut from, mut to) = (0.0, 1.0);
        let mut best: Option<Deepest> = None;
        for number in 0..MAX_POINTS {
            let bound = least_of_tangents([from, to], [low, high]);
            if bound > within {
                return Err(bound - ACCURACY);
            }
            if best.as_ref().is_some_and(|best| best.gap <= bound + 0.1 * ACCURACY) {
                break;
            }
            let middle = next_place([from, to], [low, high], number);
            let found = self.at(middle);
            let steepness = self.slope(&found);
            if best.as_ref().is_none_or(|best| found.gap < best.gap) {
                best = Some(found);
            }
            if steepness < 0.0 {
                (from, low, gradients[0]) = (middle, (found.gap, steepness), found.nearest.normal);
            } else {
                (to, high, gradients[1]) = (middle, (found.gap, steepness), found.nearest.normal);
            }
        }
        let share = low.1 / (low.1 - high.1);
        let gradient = gradients[0].lerp(gradients[1], share);
        best.map(|best| (best, gradient)).ok_or(f64::NEG_INFINITY)
    }
}

/// The distance from `from` at which the tangents at two places cross; `low` and `high` are value and slope at each.
fn crossing_of_tangents([from, to]: [f64; 2], [low, high]: [(f64, f64); 2]) -> f64 {
    let place = (low.0 - high.0 + high.1 * (to - from)) / (high.1 - low.1);
    // No `clamp`, which panics where all is NaN, as in a simulation that has diverged.
    place.max(0.0).min(to - from)
}

/// The value there: nothing of a convex function between them is below.
pub(super) fn least_of_tangents(places: [f64; 2], [low, high]: [(f64, f64); 2]) -> f64 {
    if high.1 <= low.1 {
        return low.0.min(high.0);
    }
    low.0 + low.1 * crossing_of_tangents(places, [low, high])
}

/// Where to look next for the least of a convex function that falls at `from` and rises at `to`.
pub(super) fn next_place([from, to]: [f64; 2], [low, high]: [(f64, f64); 2], number: usize) -> f64 {
    let offset = match number % 3 {
        0 => (to - from) * low.1 / (low.1 - high.1),
        1 => crossing_of_tangents([from, to], [low, high]),
        _ => 0.5 * (to - from),
    };
    from + offset.max(0.01 * (to - from)).min(0.99 * (to - from))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_edge_that_is_nowhere_has_no_deepest_point_and_stops_nothing() {
        let shape = Shape::ball(1.0);
        for bad in [f64::NAN, f64::INFINITY] {
            for ends in [[DVec3::splat(bad), DVec3::X], [DVec3::NEG_X * 2.0, DVec3::new(bad, 0.5, 0.0)]] {
                let line = Line { shape: &shape, ends, radii: [0.1, 0.1] };
                let _ = line.deepest(0.1);
                let _ = line.least();
            }
        }
        let nan = (f64::NAN, f64::NAN);
        assert!(least_of_tangents([f64::NAN, f64::NAN], [nan, nan]).is_nan());
        assert!((0..3).all(|number| next_place([f64::NAN, f64::NAN], [nan, nan], number).is_nan()));
    }
}
