//! One vector a particle, as three arrays.

use bevy::math::Vec3;

/// Coordinates and velocities below this are cleared, m or m/s: their squares would be subnormal numbers.
const NEGLIGIBLE: f32 = 1e-18;

/// One vector a particle, stored as three arrays.
#[derive(Debug, Clone, Default, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
pub struct Vectors {
    /// The x components.
    pub x: Vec<f32>,
    /// The y components.
    pub y: Vec<f32>,
    /// The z components.
    pub z: Vec<f32>,
}

/// See [`Vectors::clear_negligible`].
struct ClearNegligible<'a>([&'a mut [f32]; 3]);

impl pulp::WithSimd for ClearNegligible<'_> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> bool {
        // Of sizes as bits: these are in the order of the numbers, and those of what is not finite are above.
        let mut largest = 0;
        for axis in self.0 {
            for value in axis {
                let size = value.abs();
                largest = largest.max(size.to_bits());
                // Not by a condition: stores under a mask take many times as long on some processors. Plus 0: never −0.
                *value = *value * if size < NEGLIGIBLE { 0.0 } else { 1.0 } + 0.0;
            }
        }
        largest < f32::INFINITY.to_bits()
    }
}

impl Vectors {
    /// The number of vectors.
    pub fn len(&self) -> usize {
        self.x.len()
    }

    /// The vector in slot `index`.
    #[inline]
    pub fn get(&self, index: usize) -> Vec3 {
        Vec3::new(self.x[index], self.y[index], self.z[index])
    }

    /// Replaces the vector in slot `index`.
    #[inline]
    pub fn set(&mut self, index: usize, value: Vec3) {
        self.x[index] = value.x;
        self.y[index] = value.y;
        self.z[index] = value.z;
    }

    /// Adds `value` to the vector in slot `index`.
    #[cfg(test)]
    pub fn add(&mut self, index: usize, value: Vec3) {
        self.x[index] += value.x;
        self.y[index] += value.y;
        self.z[index] += value.z;
    }

    /// Appends a vector.
    pub fn push(&mut self, value: Vec3) {
        self.x.push(value.x);
        self.y.push(value.y);
        self.z.push(value.z);
    }

    /// Makes it `count` vectors; new ones are zero.
    #[inline]
    pub fn resize(&mut self, count: usize) {
        if self.len() == count {
            return;
        }
        for axis in self.axes_vec() {
            axis.resize(count, 0.0);
        }
    }

    /// Makes all vectors `value`.
    pub fn fill(&mut self, value: Vec3) {
        for (axis, value) in self.axes_mut().into_iter().zip(value.to_array()) {
            axis.fill(value);
        }
    }

    /// Clears negligible components: what decays would end as subnormal numbers, for which processors take ten
    /// times as long. Returns whether all components are finite.
    pub(in crate::solver) fn clear_negligible(&mut self) -> bool {
        pulp::Arch::new().dispatch(ClearNegligible(self.axes_mut()))
    }

    /// Makes each vector that of `other` less this one. Both are as long.
    pub fn subtract_from(&mut self, other: &Self) {
        for (axis, other) in self.axes_mut().into_iter().zip([&other.x, &other.y, &other.z]) {
            axis.iter_mut().zip(other).for_each(|(own, other)| *own = other - *own);
        }
    }

    /// Becomes a copy of `other`, without allocating if it is large enough already.
    pub fn copy_from(&mut self, other: &Self) {
        self.x.clone_from(&other.x);
        self.y.clone_from(&other.y);
        self.z.clone_from(&other.z);
    }

    /// The three arrays, to be treated alike.
    #[inline]
    pub fn axes(&self) -> [&[f32]; 3] {
        [&self.x, &self.y, &self.z]
    }

    /// The three arrays, to be treated alike.
    #[inline]
    pub fn axes_mut(&mut self) -> [&mut [f32]; 3] {
        [&mut self.x, &mut self.y, &mut self.z]
    }

    /// The three arrays in chunks of `size` vectors, the last one shorter.
    pub(in crate::solver) fn chunks_mut(&mut self, size: usize) -> impl Iterator<Item = [&mut [f32]; 3]> {
        let [x, y, z] = self.axes_mut().map(|axis| axis.chunks_mut(size));
        x.zip(y).zip(z).map(|((x, y), z)| [x, y, z])
    }

    fn axes_vec(&mut self) -> [&mut Vec<f32>; 3] {
        [&mut self.x, &mut self.y, &mut self.z]
    }
}

/// Splits off the first `count` vectors of a slice of [`Vectors`].
pub(crate) fn split_off<'a>(slice: &mut [&'a mut [f32]; 3], count: usize) -> [&'a mut [f32]; 3] {
    slice.each_mut().map(|axis| axis.split_off_mut(..count).expect("the slice has `count` vectors"))
}

/// Replaces vector `index` of a slice of [`Vectors`].
#[inline]
pub(crate) fn set(slice: &mut [&mut [f32]; 3], index: usize, value: Vec3) {
    for (axis, value) in slice.iter_mut().zip(value.to_array()) {
        axis[index] = value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn negligible_components_are_cleared_and_nothing_else() {
        let mut vectors = Vectors::default();
        let kept = [Vec3::new(1e-17, -1e-17, 0.0), Vec3::new(f32::INFINITY, -3.0, f32::MAX)];
        let negligible = Vec3::new(1e-19, -1e-40, f32::MIN_POSITIVE);
        for vector in [kept[0], negligible, kept[1]] {
            vectors.push(vector);
        }
        assert!(!vectors.clear_negligible());
        assert_eq!([0, 1, 2].map(|slot| vectors.get(slot)), [kept[0], Vec3::ZERO, kept[1]]);
        vectors.set(2, Vec3::new(1.0, f32::MAX, -f32::MAX));
        assert!(vectors.clear_negligible());
        vectors.set(0, Vec3::NAN);
        assert!(!vectors.clear_negligible());
        assert!(vectors.get(0).is_nan(), "faults stay to be found");
    }
}
