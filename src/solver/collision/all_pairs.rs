//! Which of a few spheres overlap: all are tested against all, which up to some hundreds of them costs less than a grid.

use bevy::math::Vec3;

/// Spheres tested together: a vector of AVX2.
const LANES: usize = 8;

/// The spheres; the arrays are kept between uses.
#[derive(Debug, Clone, Default)]
pub(super) struct AllPairs {
    slots: Vec<u32>,
    /// Centres and radii, m, padded to whole vectors with spheres that overlap nothing.
    axes: [Vec<f32>; 4],
}

impl AllPairs {
    /// Takes the spheres (slot, centre, radius > 0).
    pub fn set(&mut self, spheres: impl Iterator<Item = (u32, Vec3, f32)>) {
        let Self { slots, axes } = self;
        slots.clear();
        axes.iter_mut().for_each(Vec::clear);
        for (slot, centre, radius) in spheres {
            slots.push(slot);
            for (axis, value) in axes.iter_mut().zip([centre.x, centre.y, centre.z, radius]) {
                axis.push(value);
            }
        }
        let padded = slots.len().next_multiple_of(LANES);
        axes.iter_mut().for_each(|axis| axis.resize(padded, f32::NAN));
    }

    /// Calls `found` for each sphere with each one behind it that overlaps it, in order: with the number of the first, and
    /// the slots of both. Where that returns false it goes on with the next sphere.
    pub fn for_each_pair(&self, found: impl FnMut(usize, [u32; 2]) -> bool) {
        pulp::Arch::new().dispatch(EachPair { all_pairs: self, found });
    }
}

/// [`AllPairs::for_each_pair`].
struct EachPair<'a, F> {
    all_pairs: &'a AllPairs,
    found: F,
}

impl<F: FnMut(usize, [u32; 2]) -> bool> pulp::WithSimd for EachPair<'_, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { all_pairs: AllPairs { slots, axes }, mut found } = self;
        let [x, y, z, radius] = axes;
        for one in 0..slots.len() {
            let own = [x[one], y[one], z[one], radius[one]];
            // From the vector on that holds the next sphere.
            let first = (one + 1) / LANES * LANES;
            let (x, _) = x[first..].as_chunks::<LANES>();
            let (y, _) = y[first..].as_chunks::<LANES>();
            let (z, _) = z[first..].as_chunks::<LANES>();
            let (radius, _) = radius[first..].as_chunks::<LANES>();
            'others: for (chunk, (((x, y), z), radius)) in x.iter().zip(y).zip(z).zip(radius).enumerate() {
                let (mut near, mut any) = ([0_u32; LANES], 0);
                for lane in 0..LANES {
                    let away = [x[lane] - own[0], y[lane] - own[1], z[lane] - own[2]];
                    let reach = radius[lane] + own[3];
                    let distance_squared = away[0] * away[0] + away[1] * away[1] + away[2] * away[2];
                    near[lane] = u32::from(distance_squared <= reach * reach);
                    any |= near[lane];
                }
                if any == 0 {
                    continue;
                }
                for (lane, near) in near.into_iter().enumerate() {
                    let other = first + chunk * LANES + lane;
                    if near != 0 && other > one && !found(one, [slots[one], slots[other]]) {
                        break 'others;
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_overlap_is_found_once_and_in_order() {
        for count in [0, 1, 2, 7, 8, 9, 30] {
            let spheres = (0..count).map(|place| (place + 5, Vec3::X * place as f32, 0.75));
            let mut all_pairs = AllPairs::default();
            all_pairs.set(spheres);
            let mut pairs = Vec::new();
            all_pairs.for_each_pair(|one, slots| {
                assert_eq!(one as u32 + 5, slots[0]);
                pairs.push(slots);
                true
            });
            let expected: Vec<_> = (1..count).map(|place| [place + 4, place + 5]).collect();
            assert_eq!(pairs, expected, "{count} in a row");
        }
    }

    #[test]
    fn it_goes_on_with_the_next_sphere_where_it_is_broken_off() {
        let mut all_pairs = AllPairs::default();
        all_pairs.set((0..20).map(|slot| (slot, Vec3::ONE, 0.1)));
        let mut count = 0;
        all_pairs.for_each_pair(|_, _| {
            count += 1;
            false
        });
        assert_eq!(count, 19, "the last has none behind it");
        all_pairs.set([(0, Vec3::NAN, 0.1), (1, Vec3::ZERO, 0.1), (2, Vec3::ZERO, f32::NAN)].into_iter());
        all_pairs.for_each_pair(|_, slots| panic!("{slots:?}"));
    }
}
