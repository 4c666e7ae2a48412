//! The primitives of each cluster in arrays, so that those of two clusters that are far from each other are told apart eight at a time.
//!
//! The test is [`least_apart`](super::pair::least_apart): along the line of their centres. In a search for the paths of one substep the distance
//! along the line of the centres at their start counts, at both of their ends.

mod columns;

use columns::Columns;

use super::pair::DISTANCE_ROUNDING;
use super::primitives::{Primitive, Primitives};
use super::search::Moving;
use super::tree::{CLUSTER, Cluster};

/// Number of edges of a cluster, at most, in whole vectors.
const EDGES: usize = 4 * CLUSTER;

/// The same of triangles.
const TRIANGLES: usize = 2 * CLUSTER;

/// The edges and triangles of all clusters in the substep of a search.
#[derive(Debug, Clone, Default)]
pub(super) struct Lanes {
    /// The middle, and half of the way from one end to the other.
    edges: Columns<6>,
    /// The middle, and the ways from there to the corners.
    triangles: Columns<12>,
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
    /// See [`PairQuery`](super::pair_collector::PairQuery).
    pub is_swept: bool,
}

/// A vertex.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Point {
    /// At the start and at the end of the substep, m.
    pub start: [f32; 3],
    pub end: [f32; 3],
    /// Its radius, how far it may get, and the distance from touching up to which pairs are wanted, m.
    pub reach: f32,
}

/// By primitive of one cluster: which of the other cluster are near it, one bit each.
pub(super) type Masks = [u32; EDGES];

impl Lanes {
    /// Fills the arrays. By frame and slot, `limits` are how far vertices may get, m; from their paths if these are `swept`.
    pub fn fill(
        &mut self,
        primitives: &Primitives,
        moving: Moving,
        (limits, is_swept): (&[Vec<f32>; 2], bool),
    ) {
        let forest = &primitives.forest;
        self.edges.resize(forest.clusters.len() * EDGES);
        self.triangles.resize(forest.clusters.len() * TRIANGLES);
        let radius = moving.particles.radius();
        let sides = if is_swept { 2 } else { 1 };
        let corners = |primitive: &Primitive, side: usize| {
            primitive.corners.map(|corner| moving.ends(corner as usize)[side])
        };
        let reaches = |primitive: &Primitive, size: f32| {
            let largest =
                |of: &[f32]| primitive.corners.iter().map(|slot| of[*slot as usize]).fold(0.0, f32::max);
            [0, 1].map(|frame: usize| largest(radius) + largest(&limits[frame]) + DISTANCE_ROUNDING * size)
        };
        for (number, cluster) in forest.clusters.iter().enumerate() {
            let edges = &forest.edges[cluster.edges.start as usize..cluster.edges.end as usize];
            for (place, edge) in (number * EDGES..).zip(edges) {
                let mut size = 0.0_f32;
                for side in 0..sides {
                    let [a, b, _] = corners(edge, side);
                    let (middle, half) = (0.5 * (a + b), 0.5 * (b - a));
                    size = size.max(a.abs().max(b.abs()).max_element());
                    let ([x, y, z], [u, v, w]) = (middle.to_array(), half.to_array());
                    self.edges.set(place, side, [x, y, z, u, v, w]);
                }
                self.edges.set_reaches(place, reaches(edge, size));
            }
            let triangles =
                &forest.triangles[cluster.triangles.start as usize..cluster.triangles.end as usize];
            for (place, triangle) in (number * TRIANGLES..).zip(triangles) {
                let mut size = 0.0_f32;
                for side in 0..sides {
                    let [a, b, c] = corners(triangle, side);
                    let middle = (a + b + c) / 3.0;
                    size = size.max(a.abs().max(b.abs()).max(c.abs()).max_element());
                    let [ways_a, ways_b, ways_c] = [a, b, c].map(|corner| (corner - middle).to_array());
                    let mut numbers = [0.0; 12];
                    for (place, axes) in [middle.to_array(), ways_a, ways_b, ways_c].into_iter().enumerate() {
                        numbers[3 * place..3 * place + 3].copy_from_slice(&axes);
                    }
                    self.triangles.set(place, side, numbers);
                }
                self.triangles.set_reaches(place, reaches(triangle, size));
            }
        }
    }

    /// By edge of the first cluster: which edges of the second one are near.
    pub fn near_edges(&self, pair: ClusterPair) -> Masks {
        let mut masks = [0; EDGES];
        let (edges, arch) = (&self.edges, pulp::Arch::new());
        match pair.is_swept {
            true => arch.dispatch(NearEdges::<true> { edges, pair, masks: &mut masks }),
            false => arch.dispatch(NearEdges::<false> { edges, pair, masks: &mut masks }),
        }
        masks
    }

    /// By vertex of one cluster, which are these `points`: which triangles of the cluster of this `number`, of
    /// which it has `count`, are near.
    pub fn near_triangles(
        &self,
        points: &[Point],
        (number, count): (u32, usize),
        (frame, is_swept): (usize, bool),
    ) -> Masks {
        match is_swept {
            true => self.triangles_near::<true>(points, (number, count), frame),
            false => self.triangles_near::<false>(points, (number, count), frame),
        }
    }

    fn triangles_near<const IS_SWEPT: bool>(
        &self,
        points: &[Point],
        (number, count): (u32, usize),
        frame: usize,
    ) -> Masks {
        let mut masks = [0; EDGES];
        let (place, triangles) = (number as usize * TRIANGLES, &self.triangles);
        pulp::Arch::new().dispatch(NearTriangles::<IS_SWEPT> {
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

/// The bits of those that are not positive.
#[inline(always)]
fn mask_of(excess: &[f32; EDGES]) -> u32 {
    (0..EDGES).fold(0, |mask, place| mask | u32::from(excess[place] <= 0.0) << place)
}

struct NearEdges<'a, const IS_SWEPT: bool> {
    edges: &'a Columns<6>,
    pair: ClusterPair<'a>,
    masks: &'a mut Masks,
}

impl<const IS_SWEPT: bool> pulp::WithSimd for NearEdges<'_, IS_SWEPT> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) {
        let Self { edges, pair: ClusterPair { clusters, numbers, frame, margin, .. }, masks } = self;
        let [first, second] = [0, 1].map(|side| numbers[side] as usize * EDGES);
        let [own, others] = [0, 1].map(|side: usize| clusters[side].edges.len());
        let range = second..second + EDGES;
        let reaches = S::as_simd_f32s(&edges.reaches[frame][range.clone()]).0;
        let columns = edges.vectors::<S>(range.clone(), 0);
        let later = if IS_SWEPT { edges.vectors::<S>(range, 1) } else { columns };
        let vectors = others.div_ceil(EDGES / reaches.len());
        for (place, mask) in (first..first + own).zip(&mut masks[..]) {
            let numbers = edges.get(place, 0);
            let end = if IS_SWEPT { edges.get(place, 1) } else { numbers };
            let reach = simd.splat_f32s(edges.reaches[frame][place] + margin);
            let mut excess = [f32::INFINITY; EDGES];
            let out = S::as_mut_simd_f32s(&mut excess).0;
            for vector in 0..vectors {
                let zero = simd.splat_f32s(0.0);
                // The square of the distance of the middles, and how far each edge reaches along it.
                let (mut square, mut along, mut across) = (zero, zero, zero);
                let mut between = [zero; 3];
                for axis in 0..3 {
                    let apart = simd.sub_f32s(simd.splat_f32s(numbers[axis]), columns[axis][vector]);
                    between[axis] = apart;
                    square = simd.mul_add_f32s(apart, apart, square);
                    along = simd.mul_add_f32s(apart, simd.splat_f32s(numbers[axis + 3]), along);
                    across = simd.mul_add_f32s(apart, columns[axis + 3][vector], across);
                }
                let inner = simd.add_f32s(simd.abs_f32s(along), simd.abs_f32s(across));
                let wanted = simd.add_f32s(reach, reaches[vector]);
                let limit = simd.mul_f32s(wanted, simd.sqrt_f32s(square));
                let mut least = simd.sub_f32s(square, inner);
                if IS_SWEPT {
                    let (mut apart, mut along, mut across) = (zero, zero, zero);
                    for axis in 0..3 {
                        let way = simd.sub_f32s(simd.splat_f32s(end[axis]), later[axis][vector]);
                        apart = simd.mul_add_f32s(between[axis], way, apart);
                        along = simd.mul_add_f32s(between[axis], simd.splat_f32s(end[axis + 3]), along);
                        across = simd.mul_add_f32s(between[axis], later[axis + 3][vector], across);
                    }
                    let inner = simd.add_f32s(simd.abs_f32s(along), simd.abs_f32s(across));
                    least = simd.min_f32s(simd.sub_f32s(apart, inner), least);
                }
                out[vector] = simd.sub_f32s(least, limit);
            }
            *mask = mask_of(&excess);
        }
    }
}

struct NearTriangles<'a, const IS_SWEPT: bool> {
    triangles: &'a Columns<12>,
    points: &'a [Point],
    place: usize,
    count: usize,
    frame: usize,
    masks: &'a mut Masks,
}

impl<const IS_SWEPT: bool> pulp::WithSimd for NearTriangles<'_, IS_SWEPT> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) {
        let Self { triangles, points, place, count, frame, masks } = self;
        let range = place..place + TRIANGLES;
        let reaches = S::as_simd_f32s(&triangles.reaches[frame][range.clone()]).0;
        let columns = triangles.vectors::<S>(range.clone(), 0);
        let later = if IS_SWEPT { triangles.vectors::<S>(range, 1) } else { columns };
        let vectors = count.div_ceil(TRIANGLES / reaches.len());
        for (Point { start, end, reach }, mask) in points.iter().zip(&mut masks[..]) {
            let mut excess = [f32::INFINITY; EDGES];
            let out = S::as_mut_simd_f32s(&mut excess).0;
            for vector in 0..vectors {
                let zero = simd.splat_f32s(0.0);
                let (mut square, mut along, mut between) = (zero, [zero; 3], [zero; 3]);
                for axis in 0..3 {
                    let apart = simd.sub_f32s(simd.splat_f32s(start[axis]), columns[axis][vector]);
                    between[axis] = apart;
                    square = simd.mul_add_f32s(apart, apart, square);
                    for corner in 0..3 {
                        let way = columns[3 + 3 * corner + axis][vector];
                        along[corner] = simd.mul_add_f32s(apart, way, along[corner]);
                    }
                }
                let inner = simd.max_f32s(simd.max_f32s(along[0], along[1]), along[2]);
                let wanted = simd.add_f32s(simd.splat_f32s(*reach), reaches[vector]);
                let limit = simd.mul_f32s(wanted, simd.sqrt_f32s(square));
                let mut least = simd.sub_f32s(square, inner);
                if IS_SWEPT {
                    let (mut apart, mut along) = (zero, [zero; 3]);
                    for axis in 0..3 {
                        let way = simd.sub_f32s(simd.splat_f32s(end[axis]), later[axis][vector]);
                        apart = simd.mul_add_f32s(between[axis], way, apart);
                        for corner in 0..3 {
                            let way = later[3 + 3 * corner + axis][vector];
                            along[corner] = simd.mul_add_f32s(between[axis], way, along[corner]);
                        }
                    }
                    let inner = simd.max_f32s(simd.max_f32s(along[0], along[1]), along[2]);
                    least = simd.min_f32s(simd.sub_f32s(apart, inner), least);
                }
                out[vector] = simd.sub_f32s(least, limit);
            }
            *mask = mask_of(&excess);
        }
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::Vec3;

    use super::super::pair::{Kind, PairPaths};
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
        for is_swept in [false, true] {
            let (mut near, mut far) = (0, 0);
            for (at, reach) in [(Vec3::ZERO, 1.0), (Vec3::new(300.0, -20.0, 5.0), 1.0), (Vec3::ONE, 1e-3)] {
                let (primitives, particles) = random(at, reach);
                let limits = [vec![0.05 * reach; particles.len()], vec![0.02 * reach; particles.len()]];
                let (start, forest) = (&particles.position, &primitives.forest);
                let mut end = start.clone();
                for slot in 0..particles.len() {
                    let way = |scale: usize| 0.5 * reach * ((slot * scale % 101) as f32 / 50.0 - 1.0);
                    end.set(slot, start.get(slot) + Vec3::new(way(13), way(29), way(37)));
                }
                let moving =
                    Moving { start, end: if is_swept { &end } else { start }, particles: &particles };
                let mut lanes = Lanes::default();
                lanes.fill(&primitives, moving, (&limits, is_swept));
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
                    let pair = ClusterPair { clusters, numbers: [0, 1], frame, margin, is_swept };
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
                        Point { start, end, reach: 0.1 + limit + margin }
                    };
                    let points: Vec<Point> = vertices.iter().map(point).collect();
                    let masks = lanes.near_triangles(&points, (1, COUNTS[1] as usize), (frame, is_swept));
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
