//! The distance of each of some primitives from those of a cluster, in vectors.

use wide::{CmpLe, f32x4};

use super::columns::Columns;
use super::{ClusterPair, EDGES, Masks, Point, TRIANGLES};

/// The bits of those that are not positive.
#[inline(always)]
fn mask_of(excess: &[f32; EDGES]) -> u32 {
    let mut mask = 0;
    for (place, four) in excess.as_chunks::<4>().0.iter().enumerate() {
        mask |= (f32x4::from(*four).cmp_le(f32x4::ZERO).move_mask() as u32) << (4 * place);
    }
    mask
}

/// Finds which edges of two clusters are near each other.
pub(super) struct NearEdges<'a, const ARE_MOVING: bool> {
    pub edges: &'a Columns<6>,
    pub pair: ClusterPair<'a>,
    pub masks: &'a mut Masks,
}

impl<const ARE_MOVING: bool> pulp::WithSimd for NearEdges<'_, ARE_MOVING> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) {
        let Self { edges, pair: ClusterPair { clusters, numbers, frame, margin, wanted }, masks } = self;
        let [first, second] = [0, 1].map(|side| numbers[side] as usize * EDGES);
        let [own, others] = [0, 1].map(|side: usize| clusters[side].edges.len());
        let range = second..second + EDGES;
        let reaches = S::as_simd_f32s(&edges.reaches[frame][range.clone()]).0;
        let columns = edges.vectors::<S>(range.clone(), 0);
        let later = if ARE_MOVING { edges.vectors::<S>(range, 1) } else { columns };
        let vectors = others.div_ceil(EDGES / reaches.len());
        for ((place, mask), wanted) in (first..first + own).zip(&mut masks[..]).zip(wanted) {
            if wanted == 0 {
                continue;
            }
            let numbers = edges.get(place, 0);
            let end = if ARE_MOVING { edges.get(place, 1) } else { numbers };
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
                if ARE_MOVING {
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
            *mask = mask_of(&excess) & wanted;
        }
    }
}

/// Finds which of `count` triangles from a `place` on are near some points.
pub(super) struct NearTriangles<'a, const ARE_MOVING: bool> {
    pub triangles: &'a Columns<12>,
    pub points: &'a [Point],
    pub place: usize,
    pub count: usize,
    pub frame: usize,
    pub masks: &'a mut Masks,
}

impl<const ARE_MOVING: bool> pulp::WithSimd for NearTriangles<'_, ARE_MOVING> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) {
        let Self { triangles, points, place, count, frame, masks } = self;
        let range = place..place + TRIANGLES;
        let reaches = S::as_simd_f32s(&triangles.reaches[frame][range.clone()]).0;
        let columns = triangles.vectors::<S>(range.clone(), 0);
        let later = if ARE_MOVING { triangles.vectors::<S>(range, 1) } else { columns };
        let vectors = count.div_ceil(TRIANGLES / reaches.len());
        for (Point { start, end, reach, wanted, .. }, mask) in points.iter().zip(&mut masks[..]) {
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
                if ARE_MOVING {
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
            *mask = mask_of(&excess) & wanted;
        }
    }
}
