//! Numbers of primitives in arrays.

use std::ops::Range;

/// Numbers by primitive, as many for each cluster.
#[derive(Debug, Clone)]
pub(super) struct Columns<const AXES: usize> {
    /// At the start of their paths, and at the end where there are any, m.
    places: [[Vec<f32>; AXES]; 2],
    /// By frame: its radius and how far it may get, m; −∞ where there is none.
    pub reaches: [Vec<f32>; 2],
}

impl<const AXES: usize> Default for Columns<AXES> {
    fn default() -> Self {
        Self { places: [const { [const { Vec::new() }; AXES] }; 2], reaches: Default::default() }
    }
}

impl<const AXES: usize> Columns<AXES> {
    pub fn resize(&mut self, count: usize) {
        self.places.iter_mut().flatten().for_each(|axis| axis.resize(count, 0.0));
        self.reaches.iter_mut().for_each(|reaches| reaches.resize(count, f32::NEG_INFINITY));
    }

    /// There are none in some places.
    pub fn clear_reaches(&mut self, places: Range<usize>) {
        self.reaches.iter_mut().for_each(|reaches| reaches[places.clone()].fill(f32::NEG_INFINITY));
    }

    pub fn set(&mut self, place: usize, side: usize, numbers: [f32; AXES]) {
        for (axis, number) in self.places[side].iter_mut().zip(numbers) {
            axis[place] = number;
        }
    }

    pub fn set_reaches(&mut self, place: usize, reaches: [f32; 2]) {
        for (column, reach) in self.reaches.iter_mut().zip(reaches) {
            column[place] = reach;
        }
    }

    pub fn get(&self, place: usize, side: usize) -> [f32; AXES] {
        std::array::from_fn(|axis| self.places[side][axis][place])
    }

    /// The columns of some places, in vectors.
    #[inline(always)]
    pub fn vectors<S: pulp::Simd>(&self, places: Range<usize>, side: usize) -> [&[S::f32s]; AXES] {
        let mut columns: [&[S::f32s]; AXES] = [&[]; AXES];
        for (column, axis) in columns.iter_mut().zip(&self.places[side]) {
            *column = S::as_simd_f32s(&axis[places.clone()]).0;
        }
        columns
    }
}
