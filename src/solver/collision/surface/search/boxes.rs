//! How far each vertex may get until a search is no longer good, and the box in which it is until then.

use bevy::math::Vec3A;

use super::super::pair::{CLOSE_PART, MIN_DISTANCE_PART};
use super::super::primitives::Primitives;
use super::super::spread::box_of_path;
use super::super::steps::Steps;
use super::super::tree::Box3;
use super::{BALL, Displacements, Moving, Search, has_diverged};

/// For how many substeps vertices are expected to go on, at most.
const SUBSTEPS: u32 = 8;

/// How far they are expected to go then, at most, with their body and in the world: a multiple of their radius, on average.
const MAX_PATHS: [f32; 2] = [16.0, 48.0];

/// How far a vertex may get until its pairs are looked for again, as a part of its radius.
const SKIN: f32 = 0.6;

/// By how many times as much as in the substep of the search a vertex may be off where it is expected, and by its skin.
const DEVIATIONS: f32 = 2.0;

/// The skin in a search for one substep.
const SHORT_SKIN: f32 = 0.1;

/// By how much vertices may be beyond their limits where pairs are wanted only to stop what would pass through something, as a part of their
/// radius: what is not known then is not nearer than 1 − 0.8 of the distance at which it touches, and what is stopped is nearer than that.
const STOP_SLACK: f32 = 0.8;

const _: () = assert!(STOP_SLACK < 1.0 - (1.0 + CLOSE_PART) * MIN_DISTANCE_PART);

impl Search {
    /// Computes the limits and boxes of the vertices, for paths of one substep if they are to be `short`, else of several, with room for ways within
    /// bodies if these are wanted.
    pub(super) fn make_boxes(
        &mut self,
        primitives: &Primitives,
        moving: Moving,
        (within, is_short): (bool, bool),
    ) {
        let Self { displacements, boxes, frames, drifts, largest, slacks, margins, places, .. } = self;
        let (forest, radius) = (&primitives.forest, moving.particles.radius());
        let steps = if is_short { Steps::of_moving(moving) } else { Steps::of_places(places) };
        drifts.clear();
        drifts.extend(forest.bodies.iter().map(|body| {
            let step = |slot: usize| steps.of(slot).into();
            Vec3A::from(Primitives::mean(forest.vertices_of(body), step))
        }));
        self.substeps = if is_short { 1 } else { substeps_of((primitives, radius), steps, drifts) };
        displacements.begin(moving, forest.bodies.len(), (steps, self.substeps));
        boxes.iter_mut().for_each(|boxes| boxes.resize(moving.particles.len(), Box3::NOTHING));
        frames.clear();
        largest.clear();
        slacks.clear();
        let skin = if is_short { SHORT_SKIN } else { SKIN };
        let place = |displacements: &mut Displacements, body: u32, slot: usize| {
            let far = displacements.distances((body, slot), moving);
            for (frame, [_, end]) in far.into_iter().enumerate() {
                let end = if within || frame == 1 { end } else { 0.0 };
                displacements
                    .limit((body, slot, frame), DEVIATIONS * end + skin * radius[slot] + f32::MIN_POSITIVE);
            }
        };
        for (number, body) in forest.bodies.iter().enumerate() {
            displacements.find_drift(number, primitives, moving);
            let spread = displacements.spread(number, primitives, moving);
            frames.push(usize::from(!has_diverged(primitives, number, &spread, moving)));
            let (mut thickest, mut thinnest) = (0.0_f32, f32::INFINITY);
            for slot in forest.vertices_of(body).iter().map(|slot| *slot as usize) {
                place(displacements, number as u32, slot);
                (thickest, thinnest) = (thickest.max(radius[slot]), thinnest.min(radius[slot]));
            }
            // The distance of two sides is that of their thickest corners, which boxes of the others do not keep. Neighbours touch at half of
            // the way along the mesh.
            let slack = (thinnest - (1.0 - STOP_SLACK) * thickest).max(0.0);
            slacks.push(slack.min(STOP_SLACK * 0.25 * primitives.shortest_link));
            largest.push(thickest + 0.5 * margins[1]);
        }
        primitives.balls.iter().for_each(|slot| place(displacements, BALL, *slot as usize));
        self.all_finite = true;
        for (number, body) in forest.bodies.iter().enumerate() {
            for slot in forest.vertices_of(body) {
                self.place_box(moving, (number as u32, *slot as usize));
            }
        }
        primitives.balls.iter().for_each(|slot| self.place_box(moving, (BALL, *slot as usize)));
    }

    /// Has those that are beyond their limits begin anew, with boxes about where they are.
    pub(super) fn renew_boxes(&mut self, moving: Moving) {
        let (radius, steps) = (moving.particles.radius(), Steps::of_places(&self.places));
        self.displacements.renew(moving, |slot| steps.of(slot), |slot| SKIN * radius[slot]);
        for place in 0..self.displacements.beyond.len() {
            let (body, slot) = self.displacements.beyond[place];
            self.place_box(moving, (body, slot as usize));
        }
    }

    /// Makes the boxes of a vertex of a body: with its body those of its path without what is common to the body.
    fn place_box(&mut self, moving: Moving, (body, slot): (u32, usize)) {
        let Self { displacements, boxes, drifts, margins, substeps, all_finite, .. } = self;
        let drift = drifts.get(body as usize).copied().unwrap_or_default();
        let path = displacements.path(slot);
        let gone = [*substeps - displacements.substeps_left(), *substeps];
        let own = [0, 1].map(|end| path[end] - gone[end] as f32 * drift);
        let radius = moving.particles.radius()[slot];
        for (frame, path) in [own, path].into_iter().enumerate() {
            let limit = displacements.limits[frame][slot];
            boxes[frame][slot] = box_of_path(path, limit, (radius, margins[frame]));
            *all_finite &= boxes[frame][slot].is_some() && moving.end.get(slot).is_finite();
        }
    }
}

/// For how many substeps vertices are expected to go on: as long as they go by a few of their radii.
fn substeps_of((primitives, radius): (&Primitives, &[f32]), steps: Steps, drifts: &[Vec3A]) -> u32 {
    let (mut thickness, mut own, mut all) = (0.0, 0.0, 0.0);
    for (body, drift) in primitives.forest.bodies.iter().zip(drifts) {
        for slot in primitives.forest.vertices_of(body).iter().map(|slot| *slot as usize) {
            let step = steps.of(slot);
            thickness += radius[slot];
            own += (step - *drift).length();
            all += step.length();
        }
    }
    let most = (MAX_PATHS[0] * thickness / own).min(MAX_PATHS[1] * thickness / all);
    (most as u32).clamp(1, SUBSTEPS)
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
        for (sweeps, speed) in [(0, 0.002), (SWEEPS, 1.0)] {
            let (primitives, particles, end) = crowd(speed);
            let moving = Moving { start: &particles.position, end: &end, particles: &particles };
            let touching = nearest(&primitives, moving, 1.0);
            let mut search = Search { sweeps, ..Search::default() };
            search.ensure(&primitives, moving, (&[], Some(0.0)));
            assert_eq!(search.is_short, sweeps > 0);
            let known = known(&search);
            assert!(known.is_superset(&touching), "{:?}", touching.difference(&known));
            assert!(touching.len() > 20, "{}", touching.len());
            assert!(sweeps == 0 || known.len() < 4 * touching.len(), "{} of {}", touching.len(), known.len());
        }
    }

    /// Vertices fly on, and a few of them are hit in each substep: only their pairs are found again, until they are many.
    #[test]
    fn what_is_hit_is_found_again() {
        let (primitives, mut particles, end) = crowd(0.02);
        let mut velocity: Vec<Vec3> =
            (0..particles.len()).map(|slot| end.get(slot) - particles.position.get(slot)).collect();
        let (mut search, mut seed) = (Search::default(), 3);
        // They have flown so before, too.
        let mut before = particles.position.clone();
        (0..before.len()).for_each(|slot| before.set(slot, before.get(slot) - velocity[slot]));
        search.begin_substep(&before);
        let mut renewals = 0;
        for substep in 0..40 {
            let start = particles.position.clone();
            // Not of balls, with one of which all begins anew.
            let all = (4 * SIDE * SIDE) as usize;
            let slot = ((random(&mut seed) + 1.0) * 0.5 * all as f32) as usize % all;
            velocity[slot] = 0.03 * random_vector(&mut seed);
            let mut end = start.clone();
            for (slot, velocity) in velocity.iter().enumerate() {
                end.set(slot, start.get(slot) + *velocity);
            }
            search.begin_substep(&start);
            let before = search.displacements.renewal;
            let moving = Moving { start: &start, end: &end, particles: &particles };
            search.ensure(&primitives, moving, (&[], Some(0.0)));
            renewals += u32::from(search.age > 0 && search.displacements.renewal > before);
            let (touching, known) = (nearest(&primitives, moving, 1.0), known(&search));
            assert!(known.is_superset(&touching), "{substep}: {:?}", touching.difference(&known));
            assert_eq!(known.len(), search.near().len(), "{substep}: some twice");
            particles.position.copy_from(&end);
        }
        assert!(renewals > 10, "{renewals}");
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
