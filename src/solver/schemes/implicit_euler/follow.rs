//! The point of an edge or a face that touches a solid, as it follows the iterates of a step.
//!
//! The gap of a feature is that of its deepest point, g(x) = min over w of the gap of Σ wᵢ xᵢ. Its slope is that with the weights kept
//! (the theorem of the envelope: Danskin, *SIAM J. Appl. Math.* 14, 641, 1966), so that the contact force is a continuous function of
//! the positions if the weights are those of the minimum, wherever the iteration is. Weights that are kept for a step hold a point that
//! is not the deepest one at its end: there the feature is inside the solid by the square of the distance between the two over twice the
//! radius of curvature, and the next step, which finds another point, pushes it out.
//!
//! In each iteration the weights take a step of Newton's method, within the feature, on the distance, which is convex outside of
//! convex solids; its curvature is that between the normals at neighbouring points. While the feature turns, the point may reach its
//! border: it stays there, where the gap is that of an edge or a corner.

use bevy::math::{DVec2, DVec3};

use super::block::Symmetric;
use super::contact::{Contact, Partner, Sums};
use super::system::Compound;
use crate::solver::elements::MAX_ENDS;
use crate::solver::graph::Linked;

/// The distance of the points at which normals are taken for the curvature of the surface, as a part of an edge.
const PROBE: f64 = 1e-4;

/// Number of steps of the weights in an iteration.
const STEPS: usize = 2;

/// Number of points that are tested along a step, at most: where the surface has edges, the first may be beyond the deepest one.
const SEARCHES: usize = 5;

/// A step below this part of an edge is none: its square over the radius of curvature is far below any depth that counts.
const NEGLIGIBLE: f64 = 1e-4;

/// What is added to the curvature along an edge, as a part of its length (a proximal point: Rockafellar, *SIAM J. Control Optim.* 14,
/// 877, 1976). What lies along a line of the surface is as deep everywhere: its point does not go from end to end for a turn by less.
const INERTIA: f64 = 0.01;

/// How far around a point triangles of a mesh are listed, as a part of an edge.
const NEAR: f64 = 0.02;

/// What is known of a feature with a contact point that follows.
#[derive(Debug, Clone, Copy)]
pub(super) struct Followed {
    /// The number of the feature in its island.
    pub feature: u32,
    /// At its corners, that of the contact's node first, m.
    pub radii: [f64; 3],
    /// The displacement of the surface in the step, m.
    pub carried: DVec3,
    /// The second derivatives of the gap along the edges from the first corner, m: xx, yy and xy; infinite where the point is kept.
    pub curvature: [f64; 3],
}

/// Where the point of a feature is kept.
pub(super) const KEPT: [f64; 3] = [f64::INFINITY, f64::INFINITY, 0.0];

/// A point of a feature: its place along the edges from the first corner to the others, 0 to 1.
#[derive(Clone, Copy)]
struct Place(DVec2);

impl Contact {
    /// Moves the point that touches to where the feature is deepest at these positions; `start` is where they were when the step began.
    pub fn follow(&mut self, position: &[DVec3], start: &[DVec3]) {
        let (Some(followed), Partner::Obstacle(obstacle)) = (self.followed, &self.partner) else { return };
        let radii = followed.radii;
        let corner = |place: usize| position[self.others[place].0];
        let first = position[self.node];
        let is_edge = self.count == 1;
        let edges = [corner(0) - first, if is_edge { DVec3::ZERO } else { corner(1) - first }];
        let thickening = [radii[1] - radii[0], if is_edge { 0.0 } else { radii[2] - radii[0] }];
        let (vicinity, margin) = (&mut self.vicinity, NEAR * edges[0].length());
        let mut look = |Place(at): Place| {
            let point = first + edges[0] * at.x + edges[1] * at.y;
            let radius = radii[0] + thickening[0] * at.x + thickening[1] * at.y;
            obstacle.gap_near(point, radius, (vicinity, margin))
        };
        let slopes = |normal: DVec3| {
            DVec2::new(normal.dot(edges[0]) - thickening[0], normal.dot(edges[1]) - thickening[1])
        };
        let mut at = DVec2::new(self.others[0].1, if is_edge { 0.0 } else { self.others[1].1 });
        let (mut gap, mut normal) = look(Place(at));
        let (mut has_moved, mut bends) = (false, KEPT);
        for _ in 0..STEPS {
            let slope = slopes(normal);
            // The tangent plane there is below all of a convex surface.
            let at_first = gap - slope.dot(at);
            let least = at_first + slope.min_element().min(0.0);
            if least > self.allowed && self.multiplier == 0.0 {
                break;
            }
            let mut probe = |along: DVec2| (slopes(look(Place(at + PROBE * along)).1) - slope) / PROBE;
            let along_first = probe(DVec2::X) + DVec2::X * (INERTIA * edges[0].length());
            let curvature = match is_edge {
                true => [along_first, DVec2::Y],
                false => [along_first, probe(DVec2::Y) + DVec2::Y * (INERTIA * edges[1].length())],
            };
            bends = [curvature[0].x, curvature[1].y, 0.5 * (curvature[0].y + curvature[1].x)];
            let step = step_within(at, slope, curvature, is_edge);
            if step.abs().max_element() < NEGLIGIBLE {
                break;
            }
            let rate = slope.dot(step);
            let mut share = 1.0;
            let found = (0..SEARCHES).find_map(|_| {
                let place = at + share * step;
                let (new_gap, new_normal) = look(Place(place));
                if new_gap < gap {
                    return Some((place, new_gap, new_normal));
                }
                // Where the slope along the step changes its sign, by a secant.
                let beyond = slopes(new_normal).dot(step);
                let part = if beyond > 0.0 { rate / (rate - beyond) } else { 0.5 };
                share *= part.clamp(0.1, 0.9);
                None
            });
            let Some(found) = found else { break };
            (at, gap, normal) = found;
            has_moved = true;
        }
        self.followed = Some(Followed { curvature: bends, ..followed });
        if !has_moved {
            return;
        }
        self.weight = 1.0 - at.x - at.y;
        (self.others[0].1, self.others[1].1) = (at.x, at.y);
        self.radius = radii[0] + thickening[0] * at.x + thickening[1] * at.y;
        self.origin = self.point(start) + followed.carried;
    }
}

impl Contact {
    /// Adds the stiffness by which a feature resists being turned about the point that touches: the point goes to the side that comes
    /// nearer, by the slopes C there over the curvature G, so that the second derivatives of the gap have a part −Cᵀ G⁻¹ C, and those of
    /// the energy one of +N Cᵀ G⁻¹ C. On a ball of radius R that is N R/l² for an edge of length l: more than the inertia of small ones.
    pub fn add_turning(&self, sums: &mut Sums) {
        let Some(Followed { curvature: [xx, yy, xy], .. }) = self.followed else { return };
        let (first, second) = (self.others[0].1, self.others[1].1);
        let mut add = |[x, y]: [f64; 2], bend: f64| {
            if !(bend > 0.0 && bend.is_finite()) {
                return;
            }
            let mut nodes = [self.node as u32; MAX_ENDS];
            let mut weights = [0.0; MAX_ENDS];
            weights[..3].copy_from_slice(&[-x - y, x, y]);
            for (node, (other, _)) in nodes[1..].iter_mut().zip(&self.others[..self.count]) {
                *node = *other as u32;
            }
            let nodes = Linked::new(u32::MAX, &nodes[..=self.count]);
            let block = Symmetric::uniaxial(self.normal, self.force / bend, 0.0);
            sums.compounds.push(Compound { nodes, weights, block });
        };
        let is_inner = |weight: f64| weight > 0.0;
        if self.count == 1 {
            if is_inner(first) && is_inner(self.weight) {
                add([1.0, 0.0], xx);
            }
            return;
        }
        match [is_inner(self.weight), is_inner(first), is_inner(second)] {
            [true, true, true] if xx.is_finite() => {
                add([1.0, 0.0], xx);
                add([-xy / xx, 1.0], yy - xy * xy / xx);
            }
            // On the border it goes along it.
            [true, true, false] => add([1.0, 0.0], xx),
            [true, false, true] => add([0.0, 1.0], yy),
            [false, true, true] => add([-1.0, 1.0], xx + yy - 2.0 * xy),
            _ => {}
        }
    }
}

/// The step to the least of a quadratic, given its slope and the columns of its second derivatives at a place of an edge or a triangle,
/// that stays within.
fn step_within(at: DVec2, slope: DVec2, [first, second]: [DVec2; 2], is_edge: bool) -> DVec2 {
    let across = 0.5 * (first.y + second.x);
    let model = |step: DVec2| {
        slope.dot(step)
            + 0.5 * (first.x * step.x * step.x + second.y * step.y * step.y)
            + across * step.x * step.y
    };
    // Along a segment from `from` in the direction `direction`.
    let along = |from: DVec2, direction: DVec2| {
        let rate = slope.dot(direction)
            + direction
                .dot(DVec2::new(first.x * from.x + across * from.y, across * from.x + second.y * from.y));
        let bend = first.x * direction.x * direction.x
            + second.y * direction.y * direction.y
            + 2.0 * across * direction.x * direction.y;
        let part = match bend > 0.0 {
            true => (-rate / bend).clamp(0.0, 1.0),
            false if rate > 0.0 => 0.0,
            false => 1.0,
        };
        from + direction * part
    };
    if is_edge {
        return along(-at, DVec2::X);
    }
    let determinant = first.x * second.y - across * across;
    if first.x > 0.0 && determinant > 1e-12 * first.x * second.y {
        let step = DVec2::new(across * slope.y - second.y * slope.x, across * slope.x - first.x * slope.y)
            / determinant;
        let end = at + step;
        if end.min_element() >= 0.0 && end.x + end.y <= 1.0 {
            return step;
        }
    }
    let borders = [along(-at, DVec2::X), along(-at, DVec2::Y), along(DVec2::X - at, DVec2::Y - DVec2::X)];
    borders.into_iter().fold(DVec2::ZERO, |best, step| if model(step) < model(best) { step } else { best })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// No place of a fine grid is lower than that at which the step ends, which is one of the triangle.
    #[test]
    fn a_step_ends_at_the_least_of_the_quadratic_within_the_triangle() {
        let at = DVec2::new(0.3, 0.2);
        for number in 0..200_u32 {
            let part = |scale: u32| f64::from(number * scale % 101) / 50.5 - 1.0;
            let slope = DVec2::new(part(13), part(29));
            let (x, y, across) = (1.5 + part(37), 1.5 + part(53), 0.4 * part(71));
            let model = |step: DVec2| {
                slope.dot(step) + 0.5 * (x * step.x * step.x + y * step.y * step.y) + across * step.x * step.y
            };
            let step = step_within(at, slope, [DVec2::new(x, across), DVec2::new(across, y)], false);
            let end = at + step;
            assert!(end.min_element() > -1e-12 && end.x + end.y < 1.0 + 1e-12, "{number}: {end}");
            for (i, j) in (0..=40_u8).flat_map(|i| (0..=40 - i).map(move |j| (i, j))) {
                let place = DVec2::new(f64::from(i), f64::from(j)) / 40.0;
                assert!(model(step) <= model(place - at) + 1e-9, "{number}: {place} is lower than {end}");
            }
        }
    }
}
