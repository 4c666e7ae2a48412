//! The cells of the grid: which one a point is in, and which bucket that is in.

use bevy::math::{IVec3, Vec3};

/// The slot of a sphere, and its cell.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Label {
    pub slot: u32,
    pub class: u32,
    pub cell: IVec3,
}

/// Cells of one class in a row along x.
#[derive(Debug, Clone, Copy)]
pub(super) struct Row {
    pub class: u32,
    /// The first of them.
    pub cell: IVec3,
    pub count: i32,
}

impl Row {
    #[inline]
    pub fn contains(&self, label: &Label) -> bool {
        let Self { class, cell, count } = *self;
        label.class == class
            && label.cell.y == cell.y
            && label.cell.z == cell.z
            && (label.cell.x.wrapping_sub(cell.x) as u32) < count as u32
    }
}

/// The cell of a point. Points too far away for an i32 share the outermost cells.
pub(super) fn cell_of(point: Vec3, size: f32) -> IVec3 {
    let Vec3 { x, y, z } = point / size;
    IVec3::new(floor(x), floor(y), floor(z))
}

/// The greatest integer that is not above `value`, as near as an i32 comes; 0 for NaN. (`f32::floor` calls a function on
/// processors that may lack the instruction.)
#[inline]
fn floor(value: f32) -> i32 {
    let towards_zero = value as i32;
    towards_zero.saturating_sub(i32::from(towards_zero as f32 > value))
}

/// The bucket of a cell: a multiplicative hash of its row (Teschner et al. 2003), and from there along
/// x, so that the cells of a row lie side by side.
#[inline]
pub(super) fn bucket(class: u32, cell: IVec3, mask: u32) -> usize {
    let row = (cell.y as u32).wrapping_mul(19_349_663)
        ^ (cell.z as u32).wrapping_mul(83_492_791)
        ^ class.wrapping_mul(2_654_435_761);
    ((row ^ (row >> 15)).wrapping_add(cell.x as u32) & mask) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn floors_are_those_of_the_standard_library() {
        let many = (-1000..1000).map(|number| number as f32 * 7.3125);
        let special = [0.0, -0.0, 1.0, -1.0, -1e-30, 2.5, -2.5, 1e9, -1e9, 3e9, -3e9];
        let infinite = [f32::INFINITY, f32::NEG_INFINITY, f32::NAN];
        for value in many.chain(special).chain(infinite) {
            assert_eq!(floor(value), value.floor() as i32, "{value}");
        }
    }
}
