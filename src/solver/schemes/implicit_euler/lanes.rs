//! Two numbers, vectors or matrices side by side, which processors compute with at the same time.

use std::ops::{Add, AddAssign, Mul, Sub};

use bevy::math::DVec3;
use wide::f64x2;

use super::block::Symmetric;

/// Two numbers side by side.
pub(super) type Lanes = f64x2;

/// How many there are side by side: as many as the halves of a rope.
pub(super) const LANES: usize = 2;

/// Two vectors side by side.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct LaneVectors {
    pub x: Lanes,
    pub y: Lanes,
    pub z: Lanes,
}

/// Two symmetric matrices side by side.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct LaneMatrices {
    pub xx: Lanes,
    pub yy: Lanes,
    pub zz: Lanes,
    pub xy: Lanes,
    pub xz: Lanes,
    pub yz: Lanes,
}

impl LaneVectors {
    #[inline(always)]
    pub fn new([first, second]: [DVec3; LANES]) -> Self {
        let [x, y, z] = [[first.x, second.x], [first.y, second.y], [first.z, second.z]];
        Self { x: Lanes::new(x), y: Lanes::new(y), z: Lanes::new(z) }
    }

    #[inline(always)]
    pub fn split(self) -> [DVec3; LANES] {
        let [x, y, z] = [self.x.to_array(), self.y.to_array(), self.z.to_array()];
        [DVec3::new(x[0], y[0], z[0]), DVec3::new(x[1], y[1], z[1])]
    }

    #[inline(always)]
    pub fn dot(self, other: Self) -> Lanes {
        self.x * other.x + self.y * other.y + self.z * other.z
    }
}

impl Add for LaneVectors {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
    }
}

impl Sub for LaneVectors {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
    }
}

impl Mul<Lanes> for LaneVectors {
    type Output = Self;
    #[inline(always)]
    fn mul(self, factor: Lanes) -> Self {
        Self { x: self.x * factor, y: self.y * factor, z: self.z * factor }
    }
}

impl LaneMatrices {
    #[inline(always)]
    pub fn new([first, second]: [Symmetric; LANES]) -> Self {
        Self {
            xx: Lanes::new([first.xx, second.xx]),
            yy: Lanes::new([first.yy, second.yy]),
            zz: Lanes::new([first.zz, second.zz]),
            xy: Lanes::new([first.xy, second.xy]),
            xz: Lanes::new([first.xz, second.xz]),
            yz: Lanes::new([first.yz, second.yz]),
        }
    }

    #[inline(always)]
    pub fn split(self) -> [Symmetric; LANES] {
        let [xx, yy, zz] = [self.xx.to_array(), self.yy.to_array(), self.zz.to_array()];
        let [xy, xz, yz] = [self.xy.to_array(), self.xz.to_array(), self.yz.to_array()];
        [
            Symmetric { xx: xx[0], yy: yy[0], zz: zz[0], xy: xy[0], xz: xz[0], yz: yz[0] },
            Symmetric { xx: xx[1], yy: yy[1], zz: zz[1], xy: xy[1], xz: xz[1], yz: yz[1] },
        ]
    }

    /// See [`Symmetric::uniaxial`].
    #[inline(always)]
    pub fn uniaxial(direction: LaneVectors, along: Lanes, across: Lanes) -> Self {
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

    /// These + `values` I.
    #[inline(always)]
    pub fn plus_diagonal(self, values: Lanes) -> Self {
        Self { xx: self.xx + values, yy: self.yy + values, zz: self.zz + values, ..self }
    }

    /// These where the bits of the `mask` are set, and 0 elsewhere.
    #[inline(always)]
    pub fn masked(self, mask: Lanes) -> Self {
        let Self { xx, yy, zz, xy, xz, yz } = self;
        Self { xx: xx & mask, yy: yy & mask, zz: zz & mask, xy: xy & mask, xz: xz & mask, yz: yz & mask }
    }

    #[inline(always)]
    pub fn columns(self) -> [LaneVectors; 3] {
        let Self { xx, yy, zz, xy, xz, yz } = self;
        [
            LaneVectors { x: xx, y: xy, z: xz },
            LaneVectors { x: xy, y: yy, z: yz },
            LaneVectors { x: xz, y: yz, z: zz },
        ]
    }

    #[inline(always)]
    pub fn times(&self, vectors: LaneVectors) -> LaneVectors {
        LaneVectors {
            x: self.xx * vectors.x + self.xy * vectors.y + self.xz * vectors.z,
            y: self.xy * vectors.x + self.yy * vectors.y + self.yz * vectors.z,
            z: self.xz * vectors.x + self.yz * vectors.y + self.zz * vectors.z,
        }
    }
}

impl AddAssign for LaneMatrices {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        self.xx += other.xx;
        self.yy += other.yy;
        self.zz += other.zz;
        self.xy += other.xy;
        self.xz += other.xz;
        self.yz += other.yz;
    }
}
