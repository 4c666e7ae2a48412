//! The recipe of a cloth.

use bevy::prelude::*;

use super::lattice::Weave;
use super::sheet::{self, Frame};
use super::triangle_mesh::Groups;
use super::{Air, ClothMaterial, MeshBinding, NetError, Topology, TriangleMesh, membrane};
use crate::parameter;

/// A cloth: a rectangular sheet, or any triangle mesh.
///
/// Shape, spacing and cells act when the component is inserted; the material, the radius and the limit also later.
///
/// Particle (i, j) of a sheet, at `corner` + i/nx `width` + j/ny `height`, is number j (nx + 1) + i. It is woven of
/// springs along the grid and both diagonals of each cell, in such a way that its stiffnesses are those of its
/// material at every resolution; cells that are nearly square serve best.
///
/// Particles of a cloth from a mesh are the places of its vertices, in their order: vertices in the same place are one
/// particle. Springs along the edges make a sheet of the stretch stiffness K in all directions, as well as springs can
/// (Van Gelder 1998), and bends about the edges one of the bending stiffness D (Bergou et al. 2006).
#[derive(Component, Reflect, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[require(Transform)]
pub struct Cloth {
    /// Topology: where it is laid out.
    pub shape: ClothShape,
    /// Topology, of sheets: the numbers of cells along width and height; `None`, the default: as many as `spacing`
    /// says.
    pub cells: Option<UVec2>,
    /// Topology, of sheets: the greatest length of the sides of a cell where `cells` is `None`, m, > 0. Default 0.05.
    pub spacing: f32,
    /// Half of its thickness, m, >= 0. Default 0.01.
    pub radius: f32,
    /// What it is made of.
    pub material: ClothMaterial,
    /// The strain limit of its springs, >= 0: never longer than (1 + this) rest lengths. Default `None`.
    pub max_stretch: Option<f32>,
    /// The coefficients of the air's forces on its area.
    pub air: Air,
    /// Whether its particles collide with each other, where particles collide at all. Default true.
    pub self_collision: bool,
}

/// Where a cloth is laid out.
#[derive(Reflect, Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[non_exhaustive]
pub enum ClothShape {
    /// A rectangle; its front is where width × height points.
    Sheet {
        /// The place of particle (0, 0), m.
        corner: Vec3,
        /// From there to the other end of the side `Bottom`, m.
        width: Vec3,
        /// From there to the other end of the side `Left`, m.
        height: Vec3,
    },
    /// The mesh of the entity.
    Mesh,
}

#[cfg(feature = "serialize")]
use bevy::reflect::{ReflectDeserialize, ReflectSerialize};

/// 1 m × 1 m, upright, about the origin.
impl Default for ClothShape {
    fn default() -> Self {
        Self::Sheet { corner: Vec3::new(-0.5, -0.5, 0.0), width: Vec3::X, height: Vec3::Y }
    }
}

impl Default for Cloth {
    fn default() -> Self {
        Self {
            shape: ClothShape::default(),
            cells: None,
            spacing: 0.05,
            radius: 0.01,
            material: ClothMaterial::default(),
            max_stretch: None,
            air: Air::default(),
            self_collision: true,
        }
    }
}

/// A sheet, upright: see [`Cloth::sheet`].
impl From<Rectangle> for Cloth {
    fn from(rectangle: Rectangle) -> Self {
        Self::sheet(rectangle)
    }
}

/// A sheet about the origin with its front where the normal points; its height points to −Z where the normal is Y.
impl From<Plane3d> for Cloth {
    fn from(plane: Plane3d) -> Self {
        let turn = Quat::from_rotation_arc(Vec3::Y, *plane.normal);
        let width = turn * Vec3::X * (2.0 * plane.half_size.x);
        let height = turn * Vec3::NEG_Z * (2.0 * plane.half_size.y);
        let shape = ClothShape::Sheet { corner: -0.5 * (width + height), width, height };
        Self { shape, ..Self::default() }
    }
}

impl Cloth {
    /// The greatest number of cells in all.
    pub const MAX_CELLS: u32 = 1 << 24;

    /// An upright sheet about the origin, as Bevy's rectangle: width along X, height along Y, its front towards Z.
    pub fn sheet(rectangle: Rectangle) -> Self {
        let [width, height] = [Vec3::X * 2.0 * rectangle.half_size.x, Vec3::Y * 2.0 * rectangle.half_size.y];
        let shape = ClothShape::Sheet { corner: -0.5 * (width + height), width, height };
        Self { shape, ..Self::default() }
    }

    /// A sheet from a corner along two vectors, m, with this many cells along each.
    pub fn grid(corner: Vec3, width: Vec3, height: Vec3, cells: UVec2) -> Self {
        Self { shape: ClothShape::Sheet { corner, width, height }, cells: Some(cells), ..Self::default() }
    }

    /// A cloth from the mesh of its entity. Without the feature `render` the mesh is that of a
    /// [`RecipeMesh`](crate::nets::RecipeMesh).
    ///
    #[cfg_attr(feature = "render", doc = "```")]
    #[cfg_attr(not(feature = "render"), doc = "```ignore")]
    /// # use bevy::prelude::*;
    /// # use bevy_mass_spring::prelude::*;
    /// /// A cape that hangs on a neck where its vertices are red.
    /// fn spawn_cape(mut commands: Commands, cape: Mesh3d, neck: Entity) {
    ///     let collar = (Part::Painted("RED".into()), Attachment::to(neck));
    ///     commands.spawn((cape, Cloth::from_mesh(), NetMesh, related!(Parts[collar])));
    /// }
    /// ```
    pub fn from_mesh() -> Self {
        Self { shape: ClothShape::Mesh, ..Self::default() }
    }

    /// The same cloth with exactly this many cells along width and height.
    pub fn with_cells(mut self, cells: UVec2) -> Self {
        self.cells = Some(cells);
        self
    }

    /// The same cloth with cells of at most this size, m.
    pub fn with_spacing(mut self, spacing: f32) -> Self {
        self.spacing = spacing;
        self.cells = None;
        self
    }

    /// The same cloth with another radius, m: half of its thickness.
    pub fn with_radius(mut self, radius: f32) -> Self {
        self.radius = radius;
        self
    }

    /// The same cloth of another material.
    pub fn with_material(mut self, material: ClothMaterial) -> Self {
        self.material = material;
        self
    }

    /// The same cloth with a strain limit of its springs, >= 0.
    pub fn with_max_stretch(mut self, max_stretch: f32) -> Self {
        self.max_stretch = Some(max_stretch);
        self
    }

    /// The same cloth, its particles colliding with each other or not.
    pub fn with_self_collision(mut self, self_collision: bool) -> Self {
        self.self_collision = self_collision;
        self
    }

    /// The same cloth with other coefficients of the air's forces.
    pub fn with_air(mut self, air: Air) -> Self {
        self.air = air;
        self
    }

    /// Whether it is made from the mesh of its entity.
    pub fn needs_mesh(&self) -> bool {
        self.shape == ClothShape::Mesh
    }

    /// Checks all numbers but the shape.
    ///
    /// # Errors
    /// Names the field at fault.
    pub fn validate(&self) -> Result<(), NetError> {
        parameter::positive("spacing", self.spacing)?;
        super::check_numbers(self.radius, self.material.validate(), self.max_stretch, self.air)
    }

    /// The particles, springs and bends of a sheet.
    ///
    /// # Errors
    /// If a number is outside its range, width and height span no area, or it is to be made from a mesh.
    pub fn topology(&self) -> Result<Topology, NetError> {
        self.validate()?;
        let ClothShape::Sheet { corner, width, height } = self.shape else {
            return Err(NetError::MissingMesh { recipe: "cloth" });
        };
        let frame = Frame { corner, width, height };
        frame.validate()?;
        let cells = match self.cells {
            Some(cells) => cells.to_array().map(u64::from),
            None => [width, height].map(|side| super::cells_along(f64::from(side.length()), self.spacing)),
        };
        let most = Self::MAX_CELLS.into();
        let cells =
            [NetError::count("cells.x", cells[0], 1, most)?, NetError::count("cells.y", cells[1], 1, most)?];
        NetError::count("cells in all", u64::from(cells[0]) * u64::from(cells[1]), 1, most)?;
        self.finish(sheet::topology(&frame, cells, &self.material, &self.weave()))
    }

    /// The same from a mesh, if the shape is that; other cloths ignore it.
    ///
    /// # Errors
    /// As [`topology`](Self::topology); and if the mesh is empty, broken, degenerate or not manifold.
    pub fn topology_with(&self, mesh: &TriangleMesh) -> Result<Topology, NetError> {
        if !self.needs_mesh() {
            return self.topology();
        }
        self.validate()?;
        let welded = mesh.weld()?;
        welded.check_manifold()?;
        let skin = membrane::Skin {
            area_density: self.material.area_density,
            stretch_stiffness: self.material.stretch_stiffness,
            bending_stiffness: self.material.bending_stiffness,
        };
        let topology = membrane::topology(&welded, &skin, &self.weave());
        let Groups { painted, weights } = welded.groups(mesh);
        let binding = Some(MeshBinding::Welded(welded.particle_of));
        self.finish(Topology { painted, weights, binding, ..topology })
    }

    /// A cloth of the default material from a mesh.
    ///
    /// # Errors
    /// If the mesh is empty, broken, degenerate or not manifold.
    pub fn topology_of(mesh: &TriangleMesh) -> Result<Topology, NetError> {
        Self::from_mesh().topology_with(mesh)
    }

    fn weave(&self) -> Weave {
        Weave { retardation_time: self.material.retardation_time, max_stretch: self.max_stretch }
    }

    fn finish(&self, topology: Topology) -> Result<Topology, NetError> {
        let ignores_itself = !self.self_collision;
        Topology { radius: self.radius, air: self.air, ignores_itself, ..topology }.checked()
    }
}
