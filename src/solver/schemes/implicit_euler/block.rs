//! Symmetric 3×3 matrices: what one particle or one spring contributes to the linear system.

use bevy::math::{DMat3, DVec3};

/// A symmetric 3×3 matrix.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Symmetric {
    pub xx: f64,
    pub yy: f64,
    pub zz: f64,
    pub xy: f64,
    pub xz: f64,
    pub yz: f64,
}

impl Symmetric {
    /// `along` d dᵀ + `across` (I − d dᵀ), with the unit vector d = `direction`.
    #[inline]
    pub fn uniaxial(direction: DVec3, along: f64, across: f64) -> Self {
        let scaled = direction * (along - across);
        Self {
            xx: across + scaled.x * direction.x,
            yy: across + scaled.y * direction.y,
            zz: across + scaled.z * direction.z,
            xy: scaled.x * direction.y,
            xz: scaled.x * direction.z,
            yz: scaled.y * direction.z,
        }
    }

    /// This + `value` I.
    #[inline]
    pub fn plus_diagonal(self, value: f64) -> Self {
        Self { xx: self.xx + value, yy: self.yy + value, zz: self.zz + value, ..self }
    }

    /// This · `factor`.
    pub fn scaled(self, factor: f64) -> Self {
        let Self { xx, yy, zz, xy, xz, yz } = self;
        let [xx, yy, zz, xy, xz, yz] = [xx, yy, zz, xy, xz, yz].map(|entry| entry * factor);
        Self { xx, yy, zz, xy, xz, yz }
    }

    /// This · `vector`.
    #[inline]
    pub fn times(&self, vector: DVec3) -> DVec3 {
        DVec3::new(
            self.xx * vector.x + self.xy * vector.y + self.xz * vector.z,
            self.xy * vector.x + self.yy * vector.y + self.yz * vector.z,
            self.xz * vector.x + self.yz * vector.y + self.zz * vector.z,
        )
    }

    /// Of a matrix that is known to be symmetric.
    pub fn from_matrix(matrix: &DMat3) -> Self {
        let DMat3 { x_axis: x, y_axis: y, z_axis: z } = *matrix;
        Self { xx: x.x, yy: y.y, zz: z.z, xy: x.y, xz: x.z, yz: y.z }
    }

    /// The same as a matrix like any other.
    #[inline]
    pub fn matrix(&self) -> DMat3 {
        let [x, y, z] = self.columns();
        DMat3::from_cols(x, y, z)
    }

    /// `left`ᵀ · `right`, where that is known to be symmetric.
    #[inline]
    pub fn of_product(left: &DMat3, right: &DMat3) -> Self {
        Self {
            xx: left.x_axis.dot(right.x_axis),
            yy: left.y_axis.dot(right.y_axis),
            zz: left.z_axis.dot(right.z_axis),
            xy: left.x_axis.dot(right.y_axis),
            xz: left.x_axis.dot(right.z_axis),
            yz: left.y_axis.dot(right.z_axis),
        }
    }

    /// The columns.
    #[inline]
    fn columns(&self) -> [DVec3; 3] {
        [
            DVec3::new(self.xx, self.xy, self.xz),
            DVec3::new(self.xy, self.yy, self.yz),
            DVec3::new(self.xz, self.yz, self.zz),
        ]
    }

    /// L D Lᵀ of this, which is known to be at least `least` I > 0: so are its pivots, whatever the
    /// rounding makes of them.
    #[inline]
    pub fn factor(&self, least: f64) -> Factor {
        // One instruction, where `f64::max` takes five; `least` for NaN, as there.
        let bounded = |pivot: f64| if pivot > least { pivot } else { least };
        let inverse_x = 1.0 / bounded(self.xx);
        let (yx, zx) = (self.xy * inverse_x, self.xz * inverse_x);
        let inverse_y = 1.0 / bounded(self.yy - yx * self.xy);
        let below = self.yz - yx * self.xz;
        let zy = below * inverse_y;
        let inverse_z = 1.0 / bounded(self.zz - zx * self.xz - zy * below);
        Factor { yx, zx, zy, inverse_pivots: DVec3::new(inverse_x, inverse_y, inverse_z) }
    }
}

impl std::ops::AddAssign for Symmetric {
    #[inline]
    fn add_assign(&mut self, other: Self) {
        self.xx += other.xx;
        self.yy += other.yy;
        self.zz += other.zz;
        self.xy += other.xy;
        self.xz += other.xz;
        self.yz += other.yz;
    }
}

impl std::ops::SubAssign for Symmetric {
    #[inline]
    fn sub_assign(&mut self, other: Self) {
        self.xx -= other.xx;
        self.yy -= other.yy;
        self.zz -= other.zz;
        self.xy -= other.xy;
        self.xz -= other.xz;
        self.yz -= other.yz;
    }
}

/// The factors of a [`Symmetric`]: L has ones on its diagonal.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Factor {
    pub yx: f64,
    pub zx: f64,
    pub zy: f64,
    pub inverse_pivots: DVec3,
}

impl Factor {
    /// The solution of matrix · solution = `right`.
    #[inline]
    pub fn solve(&self, right: DVec3) -> DVec3 {
        let y = right.y - self.yx * right.x;
        let z = right.z - self.zx * right.x - self.zy * y;
        let z = z * self.inverse_pivots.z;
        let y = y * self.inverse_pivots.y - self.zy * z;
        let x = right.x * self.inverse_pivots.x - self.yx * y - self.zx * z;
        DVec3::new(x, y, z)
    }

    /// yx, zx, zy of L, and the inverted pivots.
    pub fn entries(&self) -> [f64; 6] {
        let [x, y, z] = self.inverse_pivots.to_array();
        [self.yx, self.zx, self.zy, x, y, z]
    }

    /// The inverse.
    pub fn inverse(&self) -> Symmetric {
        let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| self.solve(axis));
        Symmetric { xx: x.x, yy: y.y, zz: z.z, xy: y.x, xz: z.x, yz: z.y }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_uniaxial_matrix_stretches_along_and_across() {
        let direction = DVec3::new(2.0, -1.0, 2.0) / 3.0;
        let across = DVec3::new(1.0, 2.0, 0.0);
        let matrix = Symmetric::uniaxial(direction, 7.0, 0.5);
        assert!((matrix.times(direction) - 7.0 * direction).length() < 1e-15);
        assert!((matrix.times(across) - 0.5 * across).length() < 1e-15);
    }

    #[test]
    fn solving_undoes_multiplying() {
        let mut matrix = Symmetric::uniaxial(DVec3::new(0.6, 0.0, 0.8), 9.0, 0.1);
        matrix += Symmetric::uniaxial(DVec3::new(0.0, 0.28, 0.96), 4.0, 0.0).plus_diagonal(0.5);
        let vector = DVec3::new(1.0, -2.0, 3.0);
        let factor = matrix.factor(0.5);
        assert!((factor.solve(matrix.times(vector)) - vector).length() < 1e-14);
    }

    #[test]
    fn pivots_that_rounding_lost_are_made_up_for() {
        let matrix = Symmetric::uniaxial(DVec3::new(0.6, 0.8, 0.0), 1e20, 0.0).plus_diagonal(1.0);
        assert!(matrix.factor(1.0).solve(DVec3::ONE).is_finite());
    }
}
