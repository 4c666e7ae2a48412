//! The primitives of each cluster in arrays, so that those of two clusters that are far from each other are told apart eight at a time.
//!
//! The test is [`least_apart`](super::pair::least_apart): along the line of their centres. Where vertices are expected to go on, the distance along
//! the line of the centres at the start of their paths counts, at both ends of these.

mod columns;
mod near;

use columns::Columns;
use near::{NearEdges, NearTriangles};

use super::displacements::Displacements;
use super::pair::DISTANCE_ROUNDING;
use super::primitives::{Primitive, Primitives};
use super::tree::{CLUSTER, Cluster};

/// Number of edges of a cluster, at most, in whole vectors.
pub(super) const EDGES: usize = 4 * CLUSTER;

/// The same of triangles.
const TRIANGLES: usize = 2 * CLUSTER;

/// The edges and triangles of clusters where their vertices are expected.
#[derive(Debug, Clone, Default)]
pub(super) struct Lanes {
    /// The middle, and half of the way from one end to the other.
    edges: Columns<6>,
    /// The middle, and the ways from there to the corners.
    triangles: Columns<12>,
    /// By cluster.
    fresh: Vec<Fresh>,
    /// By cluster: whether its primitives are those of now.
    is_filled: Vec<bool>,
    are_moving: bool,
}

/// Which primitives of a cluster have a corner that has begun anew in the last renewal, one bit each.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Fresh {
    pub edges: u32,
    pub triangles: u32,
}

/// Two clusters, in which pairs are looked for.
#[derive(Clone, Copy)]
pub(super) struct ClusterPair<'a> {
    pub clusters: [&'a Cluster; 2],
    /// Their numbers.
    pub numbers: [u32; 2],
    /// 0 within a body, else 1.
    pub frame: usize,
    /// Distance from touching up to which pairs are wanted, m.
    pub margin: f32,
    /// Of each edge of the first one: with which of the second one its pairs are wanted, one bit each.
    pub wanted: Masks,
}

/// A vertex.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Point {
    /// At the start and at the end of its path, m.
    pub start: [f32; 3],
    pub end: [f32; 3],
    /// Its radius, how far it may get, and the distance from touching up to which pairs are wanted, m.
    pub reach: f32,
    /// Of which triangles its pairs are wanted, one bit each.
    pub wanted: u32,
}

/// By primitive of one cluster: which of the other cluster are near it, one bit each.
pub(super) type Masks = [u32; EDGES];

impl Lanes {
    /// Empties the arrays.
    pub fn begin(&mut self, primitives: &Primitives, displacements: &Displacements) {
        let count = primitives.forest.clusters.len();
        // All of them are set when they are filled in.
        self.edges.resize(count * EDGES);
        self.triangles.resize(count * TRIANGLES);
        self.fresh.resize(count, Fresh::default());
        self.is_filled.clear();
        self.is_filled.resize(count, false);
        self.are_moving = displacements.any_paths();
    }

    /// Those of a cluster of which pairs are wanted.
    pub fn fresh(&self, number: u32) -> Fresh {
        self.fresh[number as usize]
    }

    /// Fills in the primitives of a cluster.
    pub fn fill(
        &mut self,
        number: u32,
        (primitives, radius): (&Primitives, &[f32]),
        displacements: &Displacements,
    ) {
        let (forest, number) = (&primitives.forest, number as usize);
        if std::mem::replace(&mut self.is_filled[number], true) {
            return;
        }
        let limits = &displacements.limits;
        let sides = if self.are_moving { 2 } else { 1 };
        let reaches = |corners: &[u32], size: f32| {
            let largest = |of: &[f32]| corners.iter().map(|slot| of[*slot as usize]).fold(0.0, f32::max);
            [0, 1].map(|frame: usize| largest(radius) + largest(&limits[frame]) + DISTANCE_ROUNDING * size)
        };
        let paths =
            |primitive: &Primitive| primitive.corners.map(|corner| displacements.path(corner as usize));
        let mut fresh = Fresh::default();
        let cluster = &forest.clusters[number];
        self.edges.clear_reaches(number * EDGES..(number + 1) * EDGES);
        self.triangles.clear_reaches(number * TRIANGLES..(number + 1) * TRIANGLES);
        let edges = &forest.edges[cluster.edges.start as usize..cluster.edges.end as usize];
        for (bit, edge) in edges.iter().enumerate() {
            let (place, mut size) = (number * EDGES + bit, 0.0_f32);
            let [ends_a, ends_b, _] = paths(edge);
            for side in 0..sides {
                let [a, b] = [ends_a[side], ends_b[side]];
                let (middle, half) = (0.5 * (a + b), 0.5 * (b - a));
                size = size.max(a.abs().max(b.abs()).max_element());
                let ([x, y, z], [u, v, w]) = (middle.to_array(), half.to_array());
                self.edges.set(place, side, [x, y, z, u, v, w]);
            }
            self.edges.set_reaches(place, reaches(&edge.corners[..2], size));
            fresh.edges |= u32::from(displacements.any_renewed(&edge.corners[..2])) << bit;
        }
        let triangles = &forest.triangles[cluster.triangles.start as usize..cluster.triangles.end as usize];
        for (bit, triangle) in triangles.iter().enumerate() {
            let (place, mut size) = (number * TRIANGLES + bit, 0.0_f32);
            let [ends_a, ends_b, ends_c] = paths(triangle);
            for side in 0..sides {
                let [a, b, c] = [ends_a[side], ends_b[side], ends_c[side]];
                let middle = (a + b + c) / 3.0;
                size = size.max(a.abs().max(b.abs()).max(c.abs()).max_element());
                let [ways_a, ways_b, ways_c] = [a, b, c].map(|corner| (corner - middle).to_array());
                let mut numbers = [0.0; 12];
                for (place, axes) in [middle.to_array(), ways_a, ways_b, ways_c].into_iter().enumerate() {
                    numbers[3 * place..3 * place + 3].copy_from_slice(&axes);
                }
                self.triangles.set(place, side, numbers);
            }
            self.triangles.set_reaches(place, reaches(&triangle.corners, size));
            fresh.triangles |= u32::from(displacements.any_renewed(&triangle.corners)) << bit;
        }
        self.fresh[number] = fresh;
    }

    /// By edge of the first cluster: which edges of the second one are near.
    pub fn near_edges(&self, pair: ClusterPair) -> Masks {
        let mut masks = [0; EDGES];
        let (edges, arch) = (&self.edges, pulp::Arch::new());
        match self.are_moving {
            true => arch.dispatch(NearEdges::<true> { edges, pair, masks: &mut masks }),
            false => arch.dispatch(NearEdges::<false> { edges, pair, masks: &mut masks }),
        }
        masks
    }

    /// By vertex of one cluster, which are these `points`: which triangles of the cluster of this `number`, of
    /// which it has `count`, are near.
    pub fn near_triangles(&self, points: &[Point], (number, count): (u32, usize), frame: usize) -> Masks {
        match self.are_moving {
            true => self.triangles_near::<true>(points, (number, count), frame),
            false => self.triangles_near::<false>(points, (number, count), frame),
        }
    }

    fn triangles_near<const ARE_MOVING: bool>(
        &self,
        points: &[Point],
        (number, count): (u32, usize),
        frame: usize,
    ) -> Masks {
        let mut masks = [0; EDGES];
        let (place, triangles) = (number as usize * TRIANGLES, &self.triangles);
        pulp::Arch::new().dispatch(NearTriangles::<ARE_MOVING> {
            triangles,
            points,
            place,
            count,
            frame,
            masks: &mut masks,
        });
        masks
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::Vec3;

    use super::super::pair::{Kind, PairPaths};
    use super::super::search::Moving;
    use super::super::steps::Steps;
    use super::super::tree::Forest;
    use super::*;
    use crate::solver::particles::Particles;

    /// The largest numbers of edges, triangles and vertices of a cluster.
    const COUNTS: [u32; 3] = [3 * CLUSTER as u32, CLUSTER as u32, 8];

    /// Two clusters of primitives with random corners, `reach` m about a point.
    fn random(at: Vec3, reach: f32) -> (Primitives, Particles) {
        let (mut particles, mut forest) = (Particles::default(), Forest::default());
        let mut seed = 1_u32;
        let mut random = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 8) as f32 / (1_u32 << 23) as f32 - 1.0
        };
        let mut corner = |centre: Vec3| {
            particles.push(centre + reach * Vec3::new(random(), random(), random()), Vec3::ZERO, 1.0, 0.1);
            particles.len() as u32 - 1
        };
        for number in 0..2 {
            let centre = at + Vec3::X * reach * number as f32;
            forest.clusters.push(Cluster {
                edges: number * COUNTS[0]..(number + 1) * COUNTS[0],
                triangles: number * COUNTS[1]..(number + 1) * COUNTS[1],
                vertices: number * COUNTS[2]..(number + 1) * COUNTS[2],
                ..Cluster::default()
            });
            for _ in 0..COUNTS[0] {
                let [a, b] = [corner(centre), corner(centre)];
                forest.edges.push(Primitive { corners: [a, b, b], ..Primitive::default() });
            }
            for _ in 0..COUNTS[1] {
                let corners = [corner(centre), corner(centre), corner(centre)];
                forest.triangles.push(Primitive { corners, ..Primitive::default() });
            }
            forest.vertices.extend((0..COUNTS[2]).map(|_| corner(centre)));
        }
        let mut primitives = Primitives::default();
        primitives.forest = forest;
        (primitives, particles)
    }

    /// How near a pair comes on straight paths, m, at some times of these.
    fn nearest_on(paths: PairPaths) -> f32 {
        let times = (0..=16_u8).map(|time| f32::from(time) / 16.0);
        times.map(|time| paths.closest(time).apart.length()).fold(f32::INFINITY, f32::min)
    }

    #[test]
    fn what_may_touch_is_never_taken_for_far() {
        for moves in [false, true] {
            let (mut near, mut far) = (0, 0);
            for (at, reach) in [(Vec3::ZERO, 1.0), (Vec3::new(300.0, -20.0, 5.0), 1.0), (Vec3::ONE, 1e-3)] {
                let (primitives, particles) = random(at, reach);
                let (start, forest) = (&particles.position, &primitives.forest);
                let mut end = start.clone();
                for slot in 0..particles.len() {
                    let way = |scale: usize| 0.5 * reach * ((slot * scale % 101) as f32 / 50.0 - 1.0);
                    end.set(slot, start.get(slot) + Vec3::new(way(13), way(29), way(37)));
                }
                let moving = Moving { start, end: if moves { &end } else { start }, particles: &particles };
                let mut displacements = Displacements::default();
                displacements.begin(moving, 0, (Steps::of_moving(moving), u32::from(moves)));
                for slot in 0..particles.len() {
                    displacements.limit((0, slot, 0), 0.05 * reach);
                    displacements.limit((0, slot, 1), 0.02 * reach);
                }
                let mut lanes = Lanes::default();
                lanes.begin(&primitives, &displacements);
                for number in 0..2 {
                    lanes.fill(number, (&primitives, particles.radius()), &displacements);
                }
                let nearest = |kind: Kind, slots: [u32; 4]| {
                    let ends = slots.map(|slot| moving.ends(slot as usize));
                    let (start, displacement) =
                        (ends.map(|[start, _]| start), ends.map(|[start, end]| end - start));
                    nearest_on(PairPaths { kind, start, displacement })
                };
                for (frame, limit) in [(0, 0.05 * reach), (1, 0.02 * reach)] {
                    let margin = 0.03 * reach - 0.2;
                    let most = 0.2 + 2.0 * limit + margin;
                    let mut check = |bit: u32, distance: f32, pair: &str| {
                        assert!(bit == 1 || distance > most, "{pair} at {at}: {distance} m of {most}");
                        (near, far) = (near + bit, far + (1 - bit));
                    };
                    let clusters = [&forest.clusters[0], &forest.clusters[1]];
                    let pair =
                        ClusterPair { clusters, numbers: [0, 1], frame, margin, wanted: [u32::MAX; EDGES] };
                    for (number, mask) in
                        lanes.near_edges(pair).into_iter().enumerate().take(COUNTS[0] as usize)
                    {
                        assert_eq!(mask >> COUNTS[0], 0);
                        for other in 0..COUNTS[0] {
                            let [a, b, _] = forest.edges[number].corners;
                            let [c, d, _] = forest.edges[(COUNTS[0] + other) as usize].corners;
                            check(mask >> other & 1, nearest(Kind::EdgeEdge, [a, b, c, d]), "edges");
                        }
                    }
                    let vertices = &forest.vertices[..COUNTS[2] as usize];
                    let point = |slot: &u32| {
                        let [start, end] = moving.ends(*slot as usize).map(|place| place.to_array());
                        Point { start, end, reach: 0.1 + limit + margin, wanted: u32::MAX }
                    };
                    let points: Vec<Point> = vertices.iter().map(point).collect();
                    let masks = lanes.near_triangles(&points, (1, COUNTS[1] as usize), frame);
                    for (slot, mask) in vertices.iter().zip(masks) {
                        assert_eq!(mask >> COUNTS[1], 0);
                        for other in 0..COUNTS[1] {
                            let [a, b, c] = forest.triangles[(COUNTS[1] + other) as usize].corners;
                            let distance = nearest(Kind::VertexFace, [*slot, a, b, c]);
                            check(mask >> other & 1, distance, "vertex and face");
                        }
                    }
                }
            }
            assert!(near > 100 && far > 100, "{near} and {far}");
        }
    }
}
