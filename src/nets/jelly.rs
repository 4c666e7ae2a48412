//! The recipe of a jelly.

use bevy::prelude::*;

use super::inside::Voxels;
use super::lattice::Weave;
use super::solid::Solid;
use super::triangle_mesh::Groups;
use super::{Air, JellyMaterial, MeshBinding, NetError, Topology, TriangleMesh};
use crate::parameter;

/// A jelly: an elastic solid, a box or whatever a closed mesh encloses.
///
/// Shape, spacing and cells act when the component is inserted; the material, the radius and the limit also later.
///
/// Particle (i, j, k) of a box is number (k (ny + 1) + j) (nx + 1) + i. Springs along the edges of cells and the
/// diagonals of their faces make an isotropic solid with the Young's modulus of the material and Poisson's ratio
/// 1/4; cells that are nearly cubes serve best. A mesh is filled with cubes, in which its vertices hang.
#[derive(Component, Reflect, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[require(Transform)]
pub struct Jelly {
    /// Topology: where it is laid out.
    pub shape: JellyShape,
    /// Topology, of boxes: the numbers of cells along X, Y and Z; `None`, the default: as many as `spacing` says.
    pub cells: Option<UVec3>,
    /// Topology: the side of the cubes that fill a mesh; of boxes the greatest side of a cell where `cells` is
    /// `None`. m, > 0. Default 0.2.
    pub spacing: f32,
    /// The radius of its particles in collisions, m, >= 0. Default 0.01.
    pub radius: f32,
    /// What it is made of.
    pub material: JellyMaterial,
    /// The strain limit of its springs, >= 0: never longer than (1 + this) rest lengths. Default `None`.
    pub max_stretch: Option<f32>,
    /// The coefficients of the air's forces on its surface.
    pub air: Air,
}

/// Where a jelly is laid out.
#[derive(Reflect, Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[non_exhaustive]
pub enum JellyShape {
    /// A box along the axes.
    Cuboid {
        /// Its least corner, m.
        min: Vec3,
        /// Its greatest corner, m.
        max: Vec3,
    },
    /// What the mesh of the entity encloses, which must be closed.
    Mesh,
}

#[cfg(feature = "serialize")]
use bevy::reflect::{ReflectDeserialize, ReflectSerialize};

/// A cube of 1 m about the origin.
impl Default for JellyShape {
    fn default() -> Self {
        Self::Cuboid { min: Vec3::splat(-0.5), max: Vec3::splat(0.5) }
    }
}

impl Default for Jelly {
    fn default() -> Self {
        Self {
            shape: JellyShape::default(),
            cells: None,
            spacing: 0.2,
            radius: 0.01,
            material: JellyMaterial::default(),
            max_stretch: None,
            air: Air::default(),
        }
    }
}

/// A box about the origin.
impl From<Cuboid> for Jelly {
    fn from(cuboid: Cuboid) -> Self {
        Self::cuboid(cuboid)
    }
}

impl Jelly {
    /// The greatest number of cells of a box, or of the box around a mesh.
    pub const MAX_CELLS: u32 = 1 << 21;

    /// A box about the origin.
    pub fn cuboid(cuboid: Cuboid) -> Self {
        Self {
            shape: JellyShape::Cuboid { min: -cuboid.half_size, max: cuboid.half_size },
            ..Self::default()
        }
    }

    /// A box between two corners, m, with this many cells along each axis.
    pub fn lattice(min: Vec3, max: Vec3, cells: UVec3) -> Self {
        Self { shape: JellyShape::Cuboid { min, max }, cells: Some(cells), ..Self::default() }
    }

    /// A jelly that fills the closed mesh of its entity with cubes of this side, m. With
    /// `NetMesh` (feature `render`) it moves that mesh; without that feature the mesh is that of a
    /// [`RecipeMesh`](crate::nets::RecipeMesh).
    ///
    #[cfg_attr(feature = "render", doc = "```")]
    #[cfg_attr(not(feature = "render"), doc = "```ignore")]
    /// # use bevy::prelude::*;
    /// # use bevy_mass_spring::prelude::*;
    /// fn spawn_ring(mut commands: Commands, mut meshes: ResMut<Assets<Mesh>>) {
    ///     let ring = Mesh3d(meshes.add(Torus { minor_radius: 0.13, major_radius: 0.3 }));
    ///     commands.spawn((ring, Jelly::fill_mesh(0.09), NetMesh, Transform::from_xyz(0.0, 2.0, 0.0)));
    /// }
    /// ```
    pub fn fill_mesh(cell: f32) -> Self {
        Self { shape: JellyShape::Mesh, spacing: cell, ..Self::default() }
    }

    /// The same jelly with exactly this many cells along each axis.
    pub fn with_cells(mut self, cells: UVec3) -> Self {
        self.cells = Some(cells);
        self
    }

    /// The same jelly with cells of at most this side, m.
    pub fn with_spacing(mut self, spacing: f32) -> Self {
        self.spacing = spacing;
        self.cells = None;
        self
    }

    /// The same jelly with another radius of its particles, m.
    pub fn with_radius(mut self, radius: f32) -> Self {
        self.radius = radius;
        self
    }

    /// The same jelly of another material.
    pub fn with_material(mut self, material: JellyMaterial) -> Self {
        self.material = material;
        self
    }

    /// The same jelly with a strain limit of its springs, >= 0.
    pub fn with_max_stretch(mut self, max_stretch: f32) -> Self {
        self.max_stretch = Some(max_stretch);
        self
    }

    /// The same jelly with other coefficients of the air's forces.
    pub fn with_air(mut self, air: Air) -> Self {
        self.air = air;
        self
    }

    /// Whether it is made from the mesh of its entity.
    pub fn needs_mesh(&self) -> bool {
        self.shape == JellyShape::Mesh
    }

    /// Checks all numbers but the shape.
    ///
    /// # Errors
    /// Names the field at fault.
    pub fn validate(&self) -> Result<(), NetError> {
        parameter::positive("spacing", self.spacing)?;
        super::check_numbers(self.radius, self.material.validate(), self.max_stretch, self.air)
    }

    /// The particles and springs of a box.
    ///
    /// # Errors
    /// If a number is outside its range, the box has no volume, or it is to be made from a mesh.
    pub fn topology(&self) -> Result<Topology, NetError> {
        self.finish(self.solid()?.box_topology(&self.material, &self.weave()))
    }

    /// The same with a detailed mesh that hangs in it. A jelly that fills its mesh is made from it; a box carries any.
    ///
    /// # Errors
    /// As [`topology`](Self::topology); and if the mesh is empty, broken or degenerate, or, to be filled,
    /// is not manifold, open or inside out.
    pub fn topology_with(&self, mesh: &TriangleMesh) -> Result<Topology, NetError> {
        let welded = mesh.weld()?;
        let (solid, topology) = match self.needs_mesh() {
            false => {
                let solid = self.solid()?;
                let topology = solid.box_topology(&self.material, &self.weave());
                (solid, topology)
            }
            true => {
                self.validate()?;
                welded.check_closed()?;
                let mut voxels = Voxels::around(&welded.positions, self.spacing.into());
                check_counts(voxels.counts.map(u64::from))?;
                voxels.fill(&welded);
                let solid = Solid::voxels(voxels);
                if solid.is_empty() {
                    return Err(NetError::Degenerate {
                        field: "the inside of the mesh",
                        lacks: "cell of any size",
                    });
                }
                let topology = solid.voxel_topology(&self.material, welded.volume(), &self.weave());
                (solid, topology)
            }
        };
        let binding = solid.skin(&mesh.positions);
        let Groups { painted, weights } = groups(mesh, &binding);
        self.finish(Topology { binding: Some(binding), painted, weights, ..topology })
    }

    fn solid(&self) -> Result<Solid, NetError> {
        self.validate()?;
        let JellyShape::Cuboid { min, max } = self.shape else {
            return Err(NetError::MissingMesh { recipe: "jelly" });
        };
        parameter::finite("min", min)?;
        parameter::finite("max", max)?;
        let extent = (max - min).to_array();
        if extent.iter().any(|side| !side.is_finite() || *side <= 0.0) {
            return Err(NetError::Degenerate { field: "max − min", lacks: "volume" });
        }
        let counts = match self.cells {
            Some(cells) => cells.to_array().map(u64::from),
            None => extent.map(|side| super::cells_along(side.into(), self.spacing)),
        };
        Ok(Solid::cuboid(min, max, check_counts(counts)?))
    }

    fn weave(&self) -> Weave {
        Weave { retardation_time: self.material.retardation_time, max_stretch: self.max_stretch }
    }

    fn finish(&self, topology: Topology) -> Result<Topology, NetError> {
        Topology { radius: self.radius, air: self.air, ..topology }.checked()
    }
}

fn check_counts(counts: [u64; 3]) -> Result<[u32; 3], NetError> {
    let most = u64::from(Jelly::MAX_CELLS);
    let checked = [
        NetError::count("cells.x", counts[0], 1, most)?,
        NetError::count("cells.y", counts[1], 1, most)?,
        NetError::count("cells.z", counts[2], 1, most)?,
    ];
    NetError::count("cells in all", counts.iter().fold(1, |all, count| all.saturating_mul(*count)), 1, most)?;
    Ok(checked)
}

/// Groups of vertices as groups of the particles that carry most of each.
fn groups(mesh: &TriangleMesh, binding: &MeshBinding) -> Groups {
    let MeshBinding::Skinned(skin) = binding else { return Groups::default() };
    mesh.groups(|vertex| {
        let (particles, [a, b, c]) = *skin.get(vertex as usize)?;
        let weights = [a, b, c, 1.0 - a - b - c];
        let best = (0..4).rev().max_by(|one: &usize, other| weights[*one].total_cmp(&weights[*other]))?;
        Some(particles[best])
    })
}
