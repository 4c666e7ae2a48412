//! Shapes of colliders, in their own axes: the distance of a point, and its first contact along a displacement.
//!
//! Half-space, ball, capsule, box and the frustum (which cylinders and cones are) have closed forms; meshes, and convex
//! hulls as meshes, a tree of their triangles; a compound is the union of its parts. All is in f64: what an implicit
//! step solves for is finer than f32, and only near pairs are computed. Big shapes are shared, not copied.

mod arrival;
mod feature;
mod fingerprint;
mod line;
mod mesh;
mod normals;
mod outline;
mod placed;
mod primitives;
mod round;
mod separation;
mod simplex;
mod sweep;
mod tree;
pub(super) mod triangle;
mod vicinity;

use std::sync::Arc;

use bevy::math::{DMat3, DQuat, DVec3, Quat, Vec3};

use super::plane::Pose;
pub(in crate::solver::collision) use arrival::{Arrival, CornerPaths};
pub(in crate::solver) use feature::Deepest;
pub(in crate::solver) use fingerprint::Fingerprint;
pub(in crate::solver::collision) use mesh::Mesh;
pub use mesh::{MeshError, MeshKind};
pub(crate) use placed::PlacedShape;
pub(crate) use simplex::Simplex;
pub(in crate::solver) use tree::{Bounds, MovingTree};
pub(in crate::solver) use vicinity::Vicinity;

/// The nearest point of the surface of a shape.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Nearest {
    /// How far it is, m; negative inside.
    pub distance: f64,
    /// The outward unit normal there.
    pub normal: DVec3,
}

/// Where a path meets a shape.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Crossing {
    /// As a part of the path.
    pub time: f64,
    /// The point of the surface, m.
    pub foot: DVec3,
    /// Towards where the path comes from.
    pub normal: DVec3,
}

/// Where a shape is, in f64.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::solver) struct Placement {
    pub rotation: DMat3,
    pub point: DVec3,
}

impl Placement {
    /// A normal of a shape, seen from the world; of one that is [`in_plane`](Shape::in_plane) within that plane.
    pub fn direction(&self, shape: &Shape, normal: DVec3) -> DVec3 {
        let normal = self.rotation * normal;
        if !matches!(shape.0, Kind::Flat(_)) {
            return normal;
        }
        normal.with_z(0.0).try_normalize().unwrap_or(DVec3::Y)
    }

    pub fn new(pose: Pose) -> Self {
        let rotation = DMat3::from_quat(pose.rotation.as_dquat().normalize());
        Self { rotation, point: pose.point.as_dvec3() }
    }

    pub fn to_local(self, point: DVec3) -> DVec3 {
        // The inverse of a rotation is its transpose.
        self.rotation.transpose() * (point - self.point)
    }

    pub fn to_world(self, point: DVec3) -> DVec3 {
        self.rotation * point + self.point
    }
}

/// What a collider looks like; big ones are shared.
#[derive(Debug, Clone)]
pub struct Shape(Kind);

#[derive(Debug, Clone)]
enum Kind {
    HalfSpace,
    Ball {
        radius: f64,
    },
    Capsule {
        radius: f64,
        half_length: f64,
    },
    Cuboid {
        half_size: DVec3,
    },
    Frustum {
        radii: [f64; 2],
        half_height: f64,
    },
    Mesh(Arc<Mesh>),
    Compound(Arc<[Part]>),
    /// Where it cuts the plane z = 0 in which particles move.
    Flat(Arc<Shape>),
}

/// A part of a compound.
#[derive(Debug, Clone)]
struct Part {
    placement: Placement,
    shape: Shape,
    bounds: Bounds,
}

/// Builds what has been [checked](crate::solver) already: sizes are finite and > 0.
impl Shape {
    /// All below the plane y = 0.
    pub const HALF_SPACE: Self = Self(Kind::HalfSpace);

    /// A ball, m.
    pub fn ball(radius: f32) -> Self {
        Self(Kind::Ball { radius: radius.into() })
    }

    /// All within `radius` of a segment of the half length `half_length` along y, m.
    pub fn capsule(radius: f32, half_length: f32) -> Self {
        Self(Kind::Capsule { radius: radius.into(), half_length: half_length.into() })
    }

    /// A box, m.
    pub fn cuboid(half_size: Vec3) -> Self {
        Self(Kind::Cuboid { half_size: half_size.as_dvec3() })
    }

    /// A frustum about y with these radii at its lower and upper end, m; one of them may be 0.
    pub fn frustum(radii: [f32; 2], half_height: f32) -> Self {
        Self(Kind::Frustum { radii: radii.map(f64::from), half_height: half_height.into() })
    }

    /// A mesh of triangles that are counterclockwise seen from outside; what is not closed is a sheet, or with
    /// `one_sided` the surface of all behind it.
    ///
    /// # Errors
    /// Names what is wrong with it.
    pub fn mesh(vertices: &[Vec3], triangles: &[[u32; 3]], one_sided: bool) -> Result<Self, MeshError> {
        Ok(Self(Kind::Mesh(Arc::new(Mesh::new(vertices, triangles, one_sided)?))))
    }

    /// The convex hull of these points.
    ///
    /// # Errors
    /// If they all lie in a plane.
    #[cfg(feature = "parry")]
    pub fn convex_hull(points: &[Vec3]) -> Result<Self, MeshError> {
        if let Some(point) = points.iter().position(|point| !point.is_finite()) {
            return Err(MeshError::NotFinite(point));
        }
        let hull = parry3d::transformation::try_convex_hull(points);
        let (vertices, triangles) = hull.map_err(|_| MeshError::Degenerate)?;
        let mesh = Mesh::new(&vertices, &triangles, false)?;
        if mesh.kind != MeshKind::Solid {
            return Err(MeshError::Degenerate);
        }
        Ok(Self(Kind::Mesh(Arc::new(mesh))))
    }

    /// The union of shapes at their places.
    pub fn compound(parts: impl IntoIterator<Item = (Vec3, Quat, Self)>) -> Self {
        let parts = parts.into_iter().map(|(point, rotation, shape)| {
            let pose = Pose { point, rotation };
            Part { placement: Placement::new(pose), bounds: shape.bounds(pose), shape }
        });
        Self(Kind::Compound(parts.collect()))
    }

    /// It as seen by particles that move in the plane z = 0: it pushes within that plane only.
    pub fn in_plane(self) -> Self {
        if self.is_half_space() { self } else { Self(Kind::Flat(Arc::new(self))) }
    }

    /// Whether it is all below a plane.
    pub fn is_half_space(&self) -> bool {
        matches!(self.0, Kind::HalfSpace)
    }

    /// Whether it is a sheet, which is met from both sides, or has one among its parts.
    pub(in crate::solver) fn has_sides(&self) -> bool {
        match &self.0 {
            Kind::Mesh(mesh) => mesh.kind == MeshKind::TwoSided,
            Kind::Compound(parts) => parts.iter().any(|part| part.shape.has_sides()),
            Kind::Flat(shape) => shape.has_sides(),
            _ => false,
        }
    }

    /// The nearest point of its surface, from one side of a sheet: see [`side`](Self::side); 0: from that on which
    /// `point` is.
    pub(in crate::solver) fn nearest(&self, point: DVec3, side: f64) -> Nearest {
        match &self.0 {
            Kind::HalfSpace => Nearest { distance: point.y, normal: DVec3::Y },
            Kind::Ball { radius } => primitives::ball(point, *radius),
            Kind::Capsule { radius, half_length } => primitives::capsule(point, *radius, *half_length),
            Kind::Cuboid { half_size } => primitives::cuboid(point, *half_size),
            Kind::Frustum { radii, half_height } => primitives::frustum(point, *radii, *half_height),
            Kind::Mesh(mesh) => mesh.nearest(point, side),
            Kind::Compound(parts) => {
                let mut least = Nearest { distance: f64::INFINITY, normal: DVec3::Y };
                for part in parts.iter() {
                    if part.distance_of_bounds(point) >= least.distance.max(0.0) && least.distance.is_finite()
                    {
                        continue;
                    }
                    let found = part.shape.nearest(part.placement.to_local(point), side);
                    if found.distance < least.distance {
                        least = Nearest { normal: part.placement.rotation * found.normal, ..found };
                    }
                }
                least
            }
            Kind::Flat(shape) => shape.nearest(point, side),
        }
    }

    /// Whether it is the other one; false of two that were built alike, where these are big.
    pub(in crate::solver::collision) fn is_same(&self, other: &Self) -> bool {
        match (&self.0, &other.0) {
            (Kind::HalfSpace, Kind::HalfSpace) => true,
            (Kind::Ball { radius: one }, Kind::Ball { radius: other }) => one == other,
            (
                Kind::Capsule { radius: one, half_length: length },
                Kind::Capsule { radius: other, half_length: other_length },
            ) => one == other && length == other_length,
            (Kind::Cuboid { half_size: one }, Kind::Cuboid { half_size: other }) => one == other,
            (
                Kind::Frustum { radii: one, half_height: height },
                Kind::Frustum { radii: other, half_height: other_height },
            ) => one == other && height == other_height,
            (Kind::Mesh(one), Kind::Mesh(other)) => Arc::ptr_eq(one, other),
            (Kind::Compound(one), Kind::Compound(other)) => Arc::ptr_eq(one, other),
            (Kind::Flat(one), Kind::Flat(other)) => Arc::ptr_eq(one, other),
            _ => false,
        }
    }

    /// The mesh that it is, if it is one.
    pub(in crate::solver::collision) fn as_mesh(&self) -> Option<&Mesh> {
        match &self.0 {
            Kind::Mesh(mesh) => Some(mesh),
            Kind::Flat(shape) => shape.as_mesh(),
            _ => None,
        }
    }

    /// How deep a ball of `radius` m at a point in its own axes is inside, m; negative outside. Of a sheet, how far less
    /// than its radius the ball is away.
    pub fn depth(&self, point: DVec3, radius: f32) -> f64 {
        f64::from(radius) - self.nearest(point, 0.0).distance
    }

    /// A length below which what moves can be on the wrong side of it: its least half thickness, m. 0 of meshes.
    pub(in crate::solver) fn half_thickness(&self) -> f64 {
        match &self.0 {
            Kind::HalfSpace => f64::INFINITY,
            Kind::Ball { radius } | Kind::Capsule { radius, .. } => *radius,
            Kind::Cuboid { half_size } => half_size.min_element(),
            Kind::Frustum { radii: [bottom, top], half_height } => bottom.min(*top).min(*half_height),
            Kind::Mesh(_) => 0.0,
            Kind::Compound(parts) => {
                parts.iter().map(|part| part.shape.half_thickness()).fold(f64::INFINITY, f64::min)
            }
            Kind::Flat(shape) => shape.half_thickness(),
        }
    }

    /// How far a point in its own axes is from its surface, m, negative inside, and the outward normal there.
    pub fn nearest_surface(&self, point: DVec3) -> (f64, DVec3) {
        let Nearest { distance, normal } = self.nearest(point, 0.0);
        (distance, normal)
    }

    /// On which side of a sheet a point is, 1 or −1; 0 of what has none.
    pub(in crate::solver) fn side(&self, point: DVec3) -> f64 {
        match &self.0 {
            Kind::Mesh(mesh) => mesh.side(point),
            Kind::Flat(shape) => shape.side(point),
            _ => 0.0,
        }
    }

    /// What bounds it at a place in the world, m.
    pub(in crate::solver) fn bounds(&self, pose: Pose) -> Bounds {
        let Pose { point, rotation } = pose;
        let of_box = |low: Vec3, high: Vec3| {
            let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
            let [x, y, z] = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| (rotation * axis).abs());
            let reach = x * half.x + y * half.y + z * half.z;
            let centre = point + rotation * middle;
            let bounds = Bounds { low: centre - reach, high: centre + reach };
            bounds.grown(8.0 * f32::EPSILON * (centre.abs() + reach).max_element())
        };
        let of_half = |half: DVec3| of_box(-half.as_vec3(), half.as_vec3());
        match &self.0 {
            Kind::Flat(shape) => shape.bounds(pose),
            Kind::HalfSpace => Bounds::ALL,
            Kind::Ball { radius } => of_half(DVec3::splat(*radius)),
            Kind::Capsule { radius, half_length } => {
                of_half(DVec3::new(*radius, radius + half_length, *radius))
            }
            Kind::Cuboid { half_size } => of_half(*half_size),
            Kind::Frustum { radii: [bottom, top], half_height } => {
                let radius = bottom.max(*top);
                of_half(DVec3::new(radius, *half_height, radius))
            }
            Kind::Mesh(mesh) => {
                let Bounds { low, high } = mesh.bounds;
                match mesh.kind {
                    // All below it is inside, however deep.
                    MeshKind::OneSided => {
                        let depth = (high - low).max_element();
                        of_box(low - depth, high + depth)
                    }
                    MeshKind::Solid | MeshKind::TwoSided => of_box(low, high),
                }
            }
            Kind::Compound(parts) => {
                let all = parts.iter().fold(Bounds::EMPTY, |all, part| all.union(part.bounds));
                if all.low.is_finite() && all.high.is_finite() {
                    of_box(all.low, all.high)
                } else {
                    Bounds::ALL
                }
            }
        }
    }

    /// The distance from its own origin within which all of it lies, m; infinite of half-spaces.
    pub(in crate::solver) fn reach(&self) -> f32 {
        let Bounds { low, high } = self.bounds(Pose { point: Vec3::ZERO, rotation: Quat::IDENTITY });
        low.abs().max(high.abs()).length()
    }
}

impl Part {
    /// How far a point is from its bounds, m.
    fn distance_of_bounds(&self, point: DVec3) -> f64 {
        let Bounds { low, high } = self.bounds;
        (low.as_dvec3() - point).max(point - high.as_dvec3()).max(DVec3::ZERO).length()
    }
}

impl Placement {
    /// Between two poses, at the part `elapsed` of the way.
    pub fn between(start: Pose, target: Pose, elapsed: f64) -> Self {
        let [from, to] = [start, target].map(|pose| pose.rotation.as_dquat().normalize());
        // The shorter way round.
        let to = if from.dot(to) < 0.0 { -to } else { to };
        let rotation: DQuat = from.slerp(to, elapsed).normalize();
        let point = start.point.as_dvec3().lerp(target.point.as_dvec3(), elapsed);
        Self { rotation: DMat3::from_quat(rotation), point }
    }
}
