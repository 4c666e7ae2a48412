//! A node of a tree, after its elimination.

use bevy::math::DVec3;

use super::block::{Factor, Symmetric};

/// The step of a node: its own part, and what the step of its parent adds.
///
/// The three columns of its coupling to the parent and, last, its own part, by component: four vectors side by side, which
/// compilers turn into vector instructions.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Eliminated {
    x: [f64; 4],
    y: [f64; 4],
    z: [f64; 4],
}

impl Eliminated {
    /// That of a node, from its factored block, the `link` that couples it to its parent, and its `right` side.
    #[inline]
    pub fn new(factor: &Factor, link: &Symmetric, right: DVec3) -> Self {
        let Factor { yx, zx, zy, inverse_pivots } = *factor;
        let right_x = [link.xx, link.xy, link.xz, right.x];
        let right_y = [link.xy, link.yy, link.yz, right.y];
        let right_z = [link.xz, link.yz, link.zz, right.z];
        let [mut x, mut y, mut z] = [[0.0; 4]; 3];
        for index in 0..4 {
            y[index] = right_y[index] - yx * right_x[index];
        }
        for index in 0..4 {
            z[index] = (right_z[index] - zx * right_x[index] - zy * y[index]) * inverse_pivots.z;
        }
        for index in 0..4 {
            y[index] = y[index] * inverse_pivots.y - zy * z[index];
        }
        for index in 0..4 {
            x[index] = right_x[index] * inverse_pivots.x - yx * y[index] - zx * z[index];
        }
        Self { x, y, z }
    }

    /// Its own part.
    #[inline]
    pub fn own(&self) -> DVec3 {
        DVec3::new(self.x[3], self.y[3], self.z[3])
    }

    /// Its step, from that of its parent.
    #[inline]
    pub fn step(&self, parent: DVec3) -> DVec3 {
        let component = |of: &[f64; 4]| of[3] + of[0] * parent.x + of[1] * parent.y + of[2] * parent.z;
        DVec3::new(component(&self.x), component(&self.y), component(&self.z))
    }

    /// What `link`, by which it is coupled to its parent, makes of it there: the matrix, which is symmetric, and the vector.
    #[inline]
    pub fn at_parent(&self, link: &Symmetric) -> (Symmetric, DVec3) {
        let Self { x, y, z } = self;
        let Symmetric { xx, yy, zz, xy, xz, yz } = *link;
        let [mut row_x, mut row_y, mut row_z] = [[0.0; 4]; 3];
        for index in 0..4 {
            row_x[index] = xx * x[index] + xy * y[index] + xz * z[index];
        }
        for index in 0..4 {
            row_y[index] = xy * x[index] + yy * y[index] + yz * z[index];
        }
        for index in 0..4 {
            row_z[index] = xz * x[index] + yz * y[index] + zz * z[index];
        }
        let matrix =
            Symmetric { xx: row_x[0], yy: row_y[1], zz: row_z[2], xy: row_x[1], xz: row_x[2], yz: row_y[2] };
        (matrix, DVec3::new(row_x[3], row_y[3], row_z[3]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_nodes_that_are_eliminated_one_after_the_other_solve_their_equations() {
        let link = Symmetric::uniaxial(DVec3::new(0.6, 0.0, 0.8), 9.0, 0.1);
        let mut own = Symmetric::uniaxial(DVec3::new(0.0, 0.28, 0.96), 4.0, 0.0).plus_diagonal(0.5);
        own += link;
        let mut parent = Symmetric::uniaxial(DVec3::new(0.28, 0.96, 0.0), 2.0, 1.0).plus_diagonal(0.5);
        parent += link;
        let rights = [DVec3::new(1.0, -2.0, 3.0), DVec3::new(-0.5, 4.0, 1.5)];
        // own x − link y = r, parent y − link x = s
        let eliminated = Eliminated::new(&own.factor(0.5), &link, rights[0]);
        let (matrix, vector) = eliminated.at_parent(&link);
        let mut left = parent;
        left -= matrix;
        let parent_step = left.factor(0.5).solve(rights[1] + vector);
        let step = eliminated.step(parent_step);
        let residuals = [
            own.times(step) - link.times(parent_step) - rights[0],
            parent.times(parent_step) - link.times(step) - rights[1],
        ];
        assert!(residuals.iter().all(|residual| residual.length() < 1e-13), "{residuals:?}");
        assert!((own.times(eliminated.own()) - rights[0]).length() < 1e-13);
    }
}
