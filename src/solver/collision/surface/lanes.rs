//! The primitives of each cluster in arrays, so that those of two clusters that are far from each other are told apart eight at a time.
//!
//! The test is [`least_apart`](super::pair::least_apart): along the line of their centres.

use super::primitives::{Primitive, Primitives};
use super::search::Moving;
use super::tree::{CLUSTER, Cluster};

/// Number of edges of a cluster, at most, in whole vectors.
const EDGES: usize = 4 * CLUSTER;

/// The same of triangles.
const TRIANGLES: usize = 2 * CLUSTER;

/// Rounding, as a part of a coordinate.
const ROUNDING: f32 = 2e-6;

/// Numbers by primitive, as many for each cluster.
#[derive(Debug, Clone)]
struct Columns<const AXES: usize> {
    /// m.
    places: [Vec<f32>; AXES],
    /// By frame: its radius and how far it may get, m; −∞ where there is none.
    reaches: [Vec<f32>; 2],
}

impl<const AXES: usize> Default for Columns<AXES> {
    fn default() -> Self {
        Self { places: [const { Vec::new() }; AXES], reaches: Default::default() }
    }
}

impl<const AXES: usize> Columns<AXES> {
    fn resize(&mut self, count: usize) {
        self.places.iter_mut().for_each(|axis| axis.resize(count, 0.0));
        self.reaches.iter_mut().for_each(|reaches| {
            reaches.clear();
            reaches.resize(count, f32::NEG_INFINITY);
        });
    }

    fn set(&mut self, place: usize, numbers: [f32; AXES], reaches: [f32; 2]) {
        for (axis, number) in self.places.iter_mut().zip(numbers) {
            axis[place] = number;
        }
        for (column, reach) in self.reaches.iter_mut().zip(reaches) {
            column[place] = reach;
        }
    }

    fn get(&self, place: usize) -> [f32; AXES] {
        std::array::from_fn(|axis| self.places[axis][place])
    }
}

/// The edges and triangles of all clusters at the start of the substep of a search.
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
}

/// By primitive of one cluster: which of the other cluster are near it, one bit each.
pub(super) type Masks = [u32; EDGES];

impl Lanes {
    /// Fills the arrays. By frame and slot, `limits` are how far vertices may get, m.
    pub fn fill(&mut self, primitives: &Primitives, moving: Moving, limits: &[Vec<f32>; 2]) {
        let forest = &primitives.forest;
        self.edges.resize(forest.clusters.len() * EDGES);
        self.triangles.resize(forest.clusters.len() * TRIANGLES);
        let radius = moving.particles.radius();
        let corners = |primitive: &Primitive| {
            primitive.corners.map(|corner| bevy::math::Vec3A::from(moving.start.get(corner as usize)))
        };
        let reaches = |primitive: &Primitive, size: f32| {
            let largest =
                |of: &[f32]| primitive.corners.iter().map(|slot| of[*slot as usize]).fold(0.0, f32::max);
            [0, 1].map(|frame: usize| largest(radius) + largest(&limits[frame]) + ROUNDING * size)
        };
        for (number, cluster) in forest.clusters.iter().enumerate() {
            let edges = &forest.edges[cluster.edges.start as usize..cluster.edges.end as usize];
            for (place, edge) in (number * EDGES..).zip(edges) {
                let [a, b, _] = corners(edge);
                let (middle, half) = (0.5 * (a + b), 0.5 * (b - a));
                let size = a.abs().max(b.abs()).max_element();
                let ([x, y, z], [u, v, w]) = (middle.to_array(), half.to_array());
                self.edges.set(place, [x, y, z, u, v, w], reaches(edge, size));
            }
            let triangles =
                &forest.triangles[cluster.triangles.start as usize..cluster.triangles.end as usize];
            for (place, triangle) in (number * TRIANGLES..).zip(triangles) {
                let [a, b, c] = corners(triangle);
                let middle = (a + b + c) / 3.0;
                let size = a.abs().max(b.abs()).max(c.abs()).max_element();
                let [ways_a, ways_b, ways_c] = [a, b, c].map(|corner| (corner - middle).to_array());
                let mut numbers = [0.0; 12];
                for (place, axes) in [middle.to_array(), ways_a, ways_b, ways_c].into_iter().enumerate() {
                    numbers[3 * place..3 * place + 3].copy_from_slice(&axes);
                }
                self.triangles.set(place, numbers, reaches(triangle, size));
            }
        }
    }

    /// By edge of the first cluster: which edges of the second one are near.
    pub fn near_edges(&self, pair: ClusterPair) -> Masks {
        let mut masks = [0; EDGES];
        pulp::Arch::new().dispatch(NearEdges { edges: &self.edges, pair, masks: &mut masks });
        masks
    }

    /// By vertex of one cluster, which are at these `points` with these reaches, m: which triangles of the cluster of this `number`, of
    /// which it has `count`, are near.
    pub fn near_triangles(
        &self,
        points: &[([f32; 3], f32)],
        (number, count): (u32, usize),
        frame: usize,
    ) -> Masks {
        let mut masks = [0; EDGES];
        let place = number as usize * TRIANGLES;
        let triangles = &self.triangles;
        pulp::Arch::new().dispatch(NearTriangles {
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

struct NearEdges<'a> {
    edges: &'a Columns<6>,
    pair: ClusterPair<'a>,
    masks: &'a mut Masks,
}

impl pulp::WithSimd for NearEdges<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) {
        let Self { edges, pair: ClusterPair { clusters, numbers, frame, margin }, masks } = self;
        let [first, second] = [0, 1].map(|side| numbers[side] as usize * EDGES);
        let [own, others] = [0, 1].map(|side: usize| clusters[side].edges.len());
        let range = second..second + EDGES;
        let reaches = S::as_simd_f32s(&edges.reaches[frame][range.clone()]).0;
        let mut columns = [reaches; 6];
        for (column, axis) in columns.iter_mut().zip(&edges.places) {
            *column = S::as_simd_f32s(&axis[range.clone()]).0;
        }
        let vectors = others.div_ceil(EDGES / reaches.len());
        for (place, mask) in (first..first + own).zip(&mut masks[..]) {
            let numbers = edges.get(place);
            let reach = simd.splat_f32s(edges.reaches[frame][place] + margin);
            let mut excess = [f32::INFINITY; EDGES];
            let out = S::as_mut_simd_f32s(&mut excess).0;
            for vector in 0..vectors {
                let zero = simd.splat_f32s(0.0);
                // The square of the distance of the middles, and how far each edge reaches along it.
                let (mut square, mut along, mut across) = (zero, zero, zero);
                for axis in 0..3 {
                    let apart = simd.sub_f32s(simd.splat_f32s(numbers[axis]), columns[axis][vector]);
                    square = simd.mul_add_f32s(apart, apart, square);
                    along = simd.mul_add_f32s(apart, simd.splat_f32s(numbers[axis + 3]), along);
                    across = simd.mul_add_f32s(apart, columns[axis + 3][vector], across);
                }
                let inner = simd.add_f32s(simd.abs_f32s(along), simd.abs_f32s(across));
                let wanted = simd.add_f32s(reach, reaches[vector]);
                let limit = simd.mul_f32s(wanted, simd.sqrt_f32s(square));
                out[vector] = simd.sub_f32s(simd.sub_f32s(square, inner), limit);
            }
            *mask = mask_of(&excess);
        }
    }
}

struct NearTriangles<'a> {
    triangles: &'a Columns<12>,
    points: &'a [([f32; 3], f32)],
    place: usize,
    count: usize,
    frame: usize,
    masks: &'a mut Masks,
}

impl pulp::WithSimd for NearTriangles<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) {
        let Self { triangles, points, place, count, frame, masks } = self;
        let range = place..place + TRIANGLES;
        let reaches = S::as_simd_f32s(&triangles.reaches[frame][range.clone()]).0;
        let mut columns = [reaches; 12];
        for (column, axis) in columns.iter_mut().zip(&triangles.places) {
            *column = S::as_simd_f32s(&axis[range.clone()]).0;
        }
        let vectors = count.div_ceil(TRIANGLES / reaches.len());
        for ((point, reach), mask) in points.iter().zip(&mut masks[..]) {
            let mut excess = [f32::INFINITY; EDGES];
            let out = S::as_mut_simd_f32s(&mut excess).0;
            for vector in 0..vectors {
                let zero = simd.splat_f32s(0.0);
                let (mut square, mut along) = (zero, [zero; 3]);
                for axis in 0..3 {
                    let apart = simd.sub_f32s(simd.splat_f32s(point[axis]), columns[axis][vector]);
                    square = simd.mul_add_f32s(apart, apart, square);
                    for corner in 0..3 {
                        let way = columns[3 + 3 * corner + axis][vector];
                        along[corner] = simd.mul_add_f32s(apart, way, along[corner]);
                    }
                }
                let inner = simd.max_f32s(simd.max_f32s(along[0], along[1]), along[2]);
                let wanted = simd.add_f32s(simd.splat_f32s(*reach), reaches[vector]);
                let limit = simd.mul_f32s(wanted, simd.sqrt_f32s(square));
                out[vector] = simd.sub_f32s(simd.sub_f32s(square, inner), limit);
            }
            *mask = mask_of(&excess);
        }
    }
}
