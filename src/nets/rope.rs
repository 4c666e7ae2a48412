//! The recipe of a rope.

use bevy::math::Curve;
use bevy::prelude::*;

use super::path::{divide, measure, sagging};
use super::{Air, Layout, NetError, RopeMaterial, Topology};
use crate::parameter;
use crate::solver::{Bend, Spring};

/// A rope, chain, cable or rod: particles in a row, joined by springs, stiff against bending if its material is.
///
/// Particle 0 is its start, and the others follow along its path. Each has the mass of the rope next to it. The path
/// and the number of segments act when the component is inserted; the material, the radius and the limits also
/// later.
///
/// A spring of a segment of length h has k = EA / h; with n of them in a row a rope of length l = n h lengthens by
/// n F / k = F l / EA. At each particle between two segments there is a bend ½ k ‖x₀ − 2 x₁ + x₂‖²: the second
/// difference is h² times the curvature κ, and the energy of the rope next to the particle ½ EI κ² h, so that
/// k = EI / h³.
#[derive(Component, Reflect, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[require(Transform)]
pub struct Rope {
    /// Topology: the line along which it is laid out, corner by corner, m; its length is that of the rope. Default:
    /// 1 m straight down.
    pub path: Vec<Vec3>,
    /// Topology: whether its end is joined to its start. Default false.
    pub is_closed: bool,
    /// Topology: the number of segments; `None`, the default: as many as `spacing` says.
    pub segments: Option<u32>,
    /// Topology: the greatest length of a segment where `segments` is `None`, m, > 0. Default 0.1.
    pub spacing: f32,
    /// Half of its thickness, m, >= 0. Default 0.02.
    pub radius: f32,
    /// What it is made of.
    pub material: RopeMaterial,
    /// Whether it is bent at rest as it is laid out, as a coil spring is; `false`, the default: straight.
    pub keeps_shape: bool,
    /// Whether its segments only pull: no force while shorter than at rest. Default false.
    pub tension_only: bool,
    /// The strain limit of its segments, >= 0: never longer than (1 + this) rest lengths. Default `None`.
    pub max_stretch: Option<f32>,
    /// The coefficients of the air's forces on length × diameter.
    pub air: Air,
}

#[cfg(feature = "serialize")]
use bevy::reflect::{ReflectDeserialize, ReflectSerialize};

impl Default for Rope {
    fn default() -> Self {
        Self {
            path: vec![Vec3::ZERO, Vec3::NEG_Y],
            is_closed: false,
            segments: None,
            spacing: 0.1,
            radius: 0.02,
            material: RopeMaterial::default(),
            keeps_shape: false,
            tension_only: false,
            max_stretch: None,
            air: Air::default(),
        }
    }
}

/// A rope from the first end to the second.
impl From<Segment3d> for Rope {
    fn from(segment: Segment3d) -> Self {
        Self::between(segment.point1(), segment.point2())
    }
}

/// A rope through the corners of a line.
impl From<Polyline3d> for Rope {
    fn from(line: Polyline3d) -> Self {
        Self { path: line.vertices, ..Self::default() }
    }
}

impl Rope {
    /// The greatest number of segments of a rope.
    pub const MAX_SEGMENTS: u32 = 1 << 24;

    /// Number of samples of a curve, by which its length is measured.
    const CURVE_SAMPLES: u16 = 1024;

    /// A rope of `length`, m, that hangs straight down from the origin.
    pub fn new(length: f32) -> Self {
        Self::between(Vec3::ZERO, Vec3::NEG_Y * length)
    }

    /// A straight rope from one place to another, m.
    pub fn between(start: Vec3, end: Vec3) -> Self {
        Self { path: vec![start, end], ..Self::default() }
    }

    /// A rope that hangs between two places, m, longer than their distance by `slack` of it (0.1: by a tenth).
    pub fn hanging(start: Vec3, end: Vec3, slack: f32) -> Self {
        Self { path: sagging(start, end, slack), ..Self::default() }
    }

    /// A rope along a curve, as Bevy's [`CubicCurve`] is one. Its length is that of 1024 chords of equal parts of the
    /// domain. A curve with an unbounded domain gives an empty path, which [`topology`](Self::topology) refuses.
    pub fn along(curve: impl Curve<Vec3>) -> Self {
        let domain = curve.domain();
        let path = match domain.is_bounded() {
            true => (0..=Self::CURVE_SAMPLES)
                .map(|sample| f32::from(sample) / f32::from(Self::CURVE_SAMPLES))
                .map(|along| curve.sample_clamped(domain.start() + (domain.end() - domain.start()) * along))
                .collect(),
            false => Vec::new(),
        };
        Self { path, ..Self::default() }
    }

    /// The same rope as a loop.
    pub fn with_closed(mut self) -> Self {
        self.is_closed = true;
        self
    }

    /// The same rope with exactly this number of segments.
    pub fn with_segments(mut self, segments: u32) -> Self {
        self.segments = Some(segments);
        self
    }

    /// The same rope with segments of at most this length, m.
    pub fn with_spacing(mut self, spacing: f32) -> Self {
        self.spacing = spacing;
        self.segments = None;
        self
    }

    /// The same rope with another radius, m.
    pub fn with_radius(mut self, radius: f32) -> Self {
        self.radius = radius;
        self
    }

    /// The same rope of another material.
    pub fn with_material(mut self, material: RopeMaterial) -> Self {
        self.material = material;
        self
    }

    /// The same rope, bent at rest as it is laid out.
    pub fn with_kept_shape(mut self) -> Self {
        self.keeps_shape = true;
        self
    }

    /// The same rope with a strain limit of its segments, >= 0.
    pub fn with_max_stretch(mut self, max_stretch: f32) -> Self {
        self.max_stretch = Some(max_stretch);
        self
    }

    /// The same rope with segments that only pull.
    pub fn with_tension_only(mut self) -> Self {
        self.tension_only = true;
        self
    }

    /// The same rope with other coefficients of the air's forces.
    pub fn with_air(mut self, air: Air) -> Self {
        self.air = air;
        self
    }

    /// Checks all numbers but the path.
    ///
    /// # Errors
    /// Names the field at fault.
    pub fn validate(&self) -> Result<(), NetError> {
        parameter::positive("spacing", self.spacing)?;
        super::check_numbers(self.radius, self.material.validate(), self.max_stretch, self.air)
    }

    /// The particles, springs and bends of this rope.
    ///
    /// # Errors
    /// If a number is outside its range, or the path has no length.
    pub fn topology(&self) -> Result<Topology, NetError> {
        self.validate()?;
        let segments = self.resolve_segments()?;
        let (positions, length) = divide(&self.path, segments, self.is_closed)?;
        let count = positions.len() as u32;
        let numbers = move |first: u32, offset: u32| (first + offset) % count;
        let mass = f64::from(self.material.linear_density) * length / f64::from(segments);
        let of_particle = |index: u32| match !self.is_closed && (index == 0 || index == segments) {
            true => 0.5 * mass,
            false => mass,
        };
        let step = length / f64::from(segments);
        let spring = |first| self.segment([first, numbers(first, 1)], &positions, step);
        let springs = (0..segments).map(spring).collect();
        let bends = if self.is_closed { segments } else { segments - 1 };
        let bends = if self.material.bending_stiffness > 0.0 { bends } else { 0 };
        let bend = |first| self.bend([0, 1, 2].map(|offset| numbers(first, offset)), &positions, step);
        let topology = Topology {
            masses: (0..count).map(|index| of_particle(index) as f32).collect(),
            radius: self.radius,
            springs,
            rods: (0..bends).map(bend).collect(),
            layout: Layout::Rope { is_closed: self.is_closed },
            air: self.air,
            positions,
            ..Topology::default()
        };
        topology.checked()
    }

    fn resolve_segments(&self) -> Result<u32, NetError> {
        let least = if self.is_closed { 3 } else { 1 };
        let count = match self.segments {
            Some(segments) => segments.into(),
            None => {
                let lengths = measure(&self.path, self.is_closed)?;
                let length = lengths.last().copied().unwrap_or_default();
                super::cells_along(length, self.spacing).max(least)
            }
        };
        NetError::count("segments", count, least, Self::MAX_SEGMENTS.into())
    }

    fn segment(&self, ends: [u32; 2], positions: &[Vec3], step: f64) -> ([u32; 2], Spring) {
        let [start, end] = ends.map(|end| positions[end as usize].as_dvec3());
        let stiffness = f64::from(self.material.stretch_stiffness) / step;
        let spring = Spring {
            rest_length: start.distance(end) as f32,
            stiffness: stiffness as f32,
            damping: (stiffness * f64::from(self.material.retardation_time)) as f32,
            tension_only: self.tension_only,
            max_stretch: self.max_stretch,
            ..Spring::default()
        };
        (ends, spring)
    }

    fn bend(&self, ends: [u32; 3], positions: &[Vec3], step: f64) -> ([u32; 3], Bend<3>) {
        let [a, b, c] = ends.map(|end| positions[end as usize].as_dvec3());
        let stiffness = f64::from(self.material.bending_stiffness) / (step * step * step);
        let bend = Bend {
            rest_length: if self.keeps_shape { (a - 2.0 * b + c).length() as f32 } else { 0.0 },
            stiffness: stiffness as f32,
            damping: (stiffness * f64::from(self.material.retardation_time)) as f32,
            weights: [1.0, -2.0, 1.0],
        };
        (ends, bend)
    }
}
