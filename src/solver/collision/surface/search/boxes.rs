//! How far each vertex may get until a search is no longer good, and the box in which it is until then.

use bevy::math::Vec3A;

use super::super::pair::{CLOSE_PART, MIN_DISTANCE_PART};
use super::super::primitives::Primitives;
use super::super::spread::{Spread, margin_of, slow_limit, swept_margin_of};
use super::super::tree::Box3;
use super::{Moving, Search, has_diverged};

/// Only lists of a search that allowed for fast motion are rebuilt with age: its limits were, on average, wider than those of vertices at
/// rest by this factor. A new search at narrow margins would find as many pairs again.
const MIN_WIDENING: f32 = 1.5;

/// By how much vertices may be beyond their limits where pairs are wanted only to stop what would pass through something, as a part of their
/// radius: what is not known then is not nearer than 1 − 0.8 of the distance at which it touches, and what is stopped is nearer than that.
const STOP_SLACK: f32 = 0.8;

const _: () = assert!(STOP_SLACK < 1.0 - (1.0 + CLOSE_PART) * MIN_DISTANCE_PART);

impl Search {
    /// Computes the margins and boxes of the vertices, with room for ways within bodies if these are wanted, or for the paths of the
    /// substep only. By how much wider the limits are than those of vertices at rest, on average.
    pub(super) fn make_boxes(
        &mut self,
        primitives: &Primitives,
        moving: Moving,
        (within, is_swept): (bool, bool),
    ) -> f32 {
        let Self { displacements, boxes, frames, drifts, largest, slacks, all_finite, .. } = self;
        *all_finite = true;
        let (forest, radius) = (&primitives.forest, moving.particles.radius());
        displacements.begin(moving, forest.bodies.len(), is_swept);
        boxes.iter_mut().for_each(|boxes| boxes.resize(moving.particles.len(), Box3::NOTHING));
        frames.clear();
        drifts.clear();
        largest.clear();
        slacks.clear();
        let margins = self.margins;
        // All limits, and what they would be of slow vertices, m.
        let mut sums = [0.0; 2];
        let mut place = |slot: usize, displacement: Vec3A, frame: usize| {
            let size = (radius[slot], margins[frame]);
            let (limit, place) = match is_swept {
                true => swept_margin_of(moving.ends(slot), displacement, size),
                false => margin_of(moving.ends(slot), displacement, size),
            };
            boxes[frame][slot] = place;
            *all_finite &= place.is_some();
            (sums[0], sums[1]) = (sums[0] + limit, sums[1] + slow_limit(radius[slot]));
            limit
        };
        for (number, body) in forest.bodies.iter().enumerate() {
            let spread = Spread::of(&body.runs, moving, [&displacements.origins; 2]);
            frames.push(usize::from(!has_diverged(primitives, number, &spread, moving)));
            let [_, drift] = spread.drift();
            let (mut thickest, mut thinnest) = (0.0_f32, f32::INFINITY);
            for slot in forest.vertices_of(body).iter().map(|slot| *slot as usize) {
                let [start, end] = moving.ends(slot);
                let own = if within { end - start - drift } else { Vec3A::ZERO };
                for (frame, displacement) in [own, end - start].into_iter().enumerate() {
                    displacements.limit((number, slot, frame), place(slot, displacement, frame));
                }
                (thickest, thinnest) = (thickest.max(radius[slot]), thinnest.min(radius[slot]));
            }
            // The distance of two sides is that of their thickest corners, which boxes of the others do not keep. Neighbours touch at half of
            // the way along the mesh.
            let slack = (thinnest - (1.0 - STOP_SLACK) * thickest).max(0.0);
            slacks.push(slack.min(STOP_SLACK * 0.25 * primitives.shortest_link));
            largest.push(thickest + 0.5 * margins[1]);
            drifts.push(drift);
        }
        for slot in primitives.balls.iter().map(|slot| *slot as usize) {
            let [start, end] = moving.ends(slot);
            displacements.limits[1][slot] = place(slot, end - start, 1);
        }
        self.is_wide = sums[0] > MIN_WIDENING * sums[1];
        sums[0] / sums[1]
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use bevy::math::Vec3;

    use super::super::super::pair::Kind;
    use super::super::{Candidate, SWEEPS};
    use super::*;
    use crate::solver::elements::{CollisionMesh, Elements};
    use crate::solver::particles::{Particles, Vectors};

    /// Number of vertices along a side of a sheet.
    const SIDE: u32 = 6;

    /// A number from −1 to 1.
    fn random(seed: &mut u32) -> f32 {
        *seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (*seed >> 8) as f32 / (1_u32 << 23) as f32 - 1.0
    }

    fn random_vector(seed: &mut u32) -> Vec3 {
        Vec3::new(random(seed), random(seed), random(seed))
    }

    /// Creased sheets of two radii above each other with balls between them, and where they would be a substep later: at a `speed` of 1 they go
    /// many times their thickness together, and a few times it each vertex by itself.
    fn crowd(speed: f32) -> (Primitives, Particles, Vectors) {
        let mut seed = 1;
        let (mut particles, mut mesh) = (Particles::default(), CollisionMesh::default());
        for layer in 0..4_u8 {
            let (first, radius) = (particles.len() as u32, if layer % 2 == 0 { 0.02 } else { 0.03 });
            for (i, j) in (0..SIDE).flat_map(|i| (0..SIDE).map(move |j| (i, j))) {
                let place = Vec3::new(i as f32, f32::from(layer), j as f32) * 0.1;
                particles.push(place + 0.02 * random_vector(&mut seed), Vec3::ZERO, 1.0, radius);
            }
            let at = |i: u32, j: u32| first + i * SIDE + j;
            let cells = (0..SIDE - 1).flat_map(|i| (0..SIDE - 1).map(move |j| (i, j)));
            mesh.add_triangles(cells.flat_map(|(i, j)| {
                [[at(i, j), at(i + 1, j), at(i, j + 1)], [at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]]
            }));
        }
        for _ in 0..8 {
            let place = 0.25 + 0.25 * random_vector(&mut seed);
            particles.push(place, Vec3::ZERO, 1.0, 0.02);
        }
        let mut end = particles.position.clone();
        for slot in 0..particles.len() {
            let displacement = Vec3::NEG_Y * 0.5 + 0.12 * random_vector(&mut seed);
            end.set(slot, end.get(slot) + speed * displacement);
        }
        let mut primitives = Primitives::default();
        primitives.refresh(&mesh, &Elements::default(), &particles, false);
        (primitives, particles, end)
    }

    /// All pairs that come as near on their paths as this part of the distance at which they touch.
    fn nearest(primitives: &Primitives, moving: Moving, part: f32) -> BTreeSet<([u32; 4], Kind)> {
        let (forest, radius) = (&primitives.forest, moving.particles.radius());
        let mut all = BTreeSet::new();
        let mut add = |slots: [u32; 4], kind: Kind| {
            let (one, other) = slots.split_at(kind.first_side());
            let largest = |side: &[u32]| side.iter().map(|slot| radius[*slot as usize]).fold(0.0, f32::max);
            let reach = (largest(one) + largest(other)).min(0.5 * primitives.near.way(one, other));
            let paths = Candidate { slots, kind, ..Candidate::default() }.paths(moving);
            let times = (0..=64_u8).map(|time| f32::from(time) / 64.0);
            let distance = times.map(|time| paths.closest(time).apart.length()).fold(f32::INFINITY, f32::min);
            if one.iter().all(|slot| !other.contains(slot)) && distance < part * reach {
                all.insert((slots, kind));
            }
        };
        for triangle in &forest.triangles {
            let [a, b, c] = triangle.corners;
            (0..moving.particles.len() as u32).for_each(|slot| add([slot, a, b, c], Kind::VertexFace));
        }
        for (number, edge) in forest.edges.iter().enumerate() {
            for other in &forest.edges[number + 1..] {
                let (one, other) = if edge.corners < other.corners { (edge, other) } else { (other, edge) };
                add([one.corners[0], one.corners[1], other.corners[0], other.corners[1]], Kind::EdgeEdge);
            }
        }
        all
    }

    fn known(search: &Search) -> BTreeSet<([u32; 4], Kind)> {
        search.near().iter().map(|near| search.candidate(*near)).map(|pair| (pair.slots, pair.kind)).collect()
    }

    #[test]
    fn whatever_a_search_allows_for_it_knows_all_that_touches_in_the_substep() {
        for (sweeps, speed) in [(0, 0.02), (SWEEPS, 1.0)] {
            let (primitives, particles, end) = crowd(speed);
            let moving = Moving { start: &particles.position, end: &end, particles: &particles };
            let touching = nearest(&primitives, moving, 1.0);
            let mut search = Search { sweeps, ..Search::default() };
            search.ensure(&primitives, moving, (&[], Some(0.0)));
            assert_eq!(search.displacements.is_swept, sweeps > 0);
            let known = known(&search);
            assert!(known.is_superset(&touching), "{:?}", touching.difference(&known));
            assert!(touching.len() > 20, "{}", touching.len());
            assert!(sweeps == 0 || known.len() < 4 * touching.len(), "{} of {}", touching.len(), known.len());
        }
    }

    #[test]
    fn within_the_slack_nothing_is_missed_that_would_be_stopped() {
        let mut seed = 7;
        for (sweeps, speed) in [(0, 0.02), (SWEEPS, 1.0)] {
            let (primitives, particles, end) = crowd(speed);
            let mut search = Search { sweeps, ..Search::default() };
            let moving = Moving { start: &particles.position, end: &end, particles: &particles };
            search.ensure(&primitives, moving, (&[], Some(0.0)));
            // Balls have none.
            let mut pushed = end.clone();
            let radius = particles.radius();
            for slot in (0..particles.len()).filter(|slot| primitives.on_mesh[*slot]) {
                let way = random_vector(&mut seed).normalize_or_zero() * (0.6 * radius[slot]);
                pushed.set(slot, end.get(slot) + way);
            }
            let moving = Moving { start: &particles.position, end: &pushed, particles: &particles };
            search.ensure(&primitives, moving, (&[], None));
            assert_eq!(search.age, 1, "it has searched anew");
            let close = nearest(&primitives, moving, (1.0 + CLOSE_PART) * MIN_DISTANCE_PART);
            assert!(sweeps == 0 || close.len() > 10, "{}", close.len());
            assert!(known(&search).is_superset(&close), "{:?}", close.difference(&known(&search)));
        }
    }
}
