//! The recipe of a balloon.

use bevy::prelude::*;

use super::icosphere::icosphere;
use super::lattice::Weave;
use super::triangle_mesh::Groups;
use super::weld::Welded;
use super::{Air, BalloonMaterial, MeshBinding, NetError, Topology, TriangleMesh, membrane};
use crate::parameter;

/// A balloon: a closed skin with gas in it, a sphere or any closed triangle mesh.
///
/// Shape and subdivisions act when the component is inserted; the material and the radius also later. At rest the skin
/// is as it is laid out; the pressure of the gas then stretches it, to (1 + p r / (3 K)) of its radius for a sphere of
/// radius r, as its tension is p r / 2 and Poisson's ratio 1/3.
#[derive(Component, Reflect, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[require(Transform)]
pub struct Balloon {
    /// Topology: where it is laid out.
    pub shape: BalloonShape,
    /// Topology, of spheres: how often each triangle of an icosahedron is divided into four. Default 3: 642 particles.
    pub subdivisions: u32,
    /// Half of the thickness of its skin, m, >= 0: its radius in collisions. Default 0.01.
    pub radius: f32,
    /// What it is made of.
    pub material: BalloonMaterial,
    /// The strain limit of its springs, >= 0: never longer than (1 + this) rest lengths. Default `None`.
    pub max_stretch: Option<f32>,
    /// The coefficients of the air's forces on its area.
    pub air: Air,
}

/// Where a balloon is laid out.
#[derive(Reflect, Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
#[non_exhaustive]
pub enum BalloonShape {
    /// A sphere.
    Sphere {
        /// Its centre, m.
        centre: Vec3,
        /// Its radius, m, > 0.
        radius: f32,
    },
    /// The mesh of the entity, which must be closed.
    Mesh,
}

#[cfg(feature = "serialize")]
use bevy::reflect::{ReflectDeserialize, ReflectSerialize};

/// A sphere of 0.5 m about the origin.
impl Default for BalloonShape {
    fn default() -> Self {
        Self::Sphere { centre: Vec3::ZERO, radius: 0.5 }
    }
}

impl Default for Balloon {
    fn default() -> Self {
        Self {
            shape: BalloonShape::default(),
            subdivisions: 3,
            radius: 0.01,
            material: BalloonMaterial::default(),
            max_stretch: None,
            air: Air::default(),
        }
    }
}

/// A balloon about the origin.
impl From<Sphere> for Balloon {
    fn from(sphere: Sphere) -> Self {
        Self::sphere(sphere)
    }
}

impl Balloon {
    /// The greatest number of subdivisions: 655,362 particles.
    pub const MAX_SUBDIVISIONS: u32 = 8;

    /// A sphere about the origin.
    pub fn sphere(sphere: Sphere) -> Self {
        let shape = BalloonShape::Sphere { centre: Vec3::ZERO, radius: sphere.radius };
        Self { shape, ..Self::default() }
    }

    /// A balloon from the closed mesh of its entity. Without the feature `render` the mesh is that of a
    /// [`RecipeMesh`](crate::nets::RecipeMesh).
    ///
    #[cfg_attr(feature = "render", doc = "```")]
    #[cfg_attr(not(feature = "render"), doc = "```ignore")]
    /// # use bevy::prelude::*;
    /// # use bevy_mass_spring::prelude::*;
    /// fn spawn_swim_ring(mut commands: Commands, mut meshes: ResMut<Assets<Mesh>>) {
    ///     let ring = Mesh3d(meshes.add(Torus { minor_radius: 0.13, major_radius: 0.3 }));
    ///     commands.spawn((ring, Balloon::from_mesh().with_material(BalloonMaterial::VINYL), NetMesh));
    /// }
    /// ```
    pub fn from_mesh() -> Self {
        Self { shape: BalloonShape::Mesh, ..Self::default() }
    }

    /// The same balloon about another centre, m. One from a mesh stays where that is.
    pub fn with_centre(mut self, place: Vec3) -> Self {
        if let BalloonShape::Sphere { centre, .. } = &mut self.shape {
            *centre = place;
        }
        self
    }

    /// The same balloon with another number of subdivisions.
    pub fn with_subdivisions(mut self, subdivisions: u32) -> Self {
        self.subdivisions = subdivisions;
        self
    }

    /// The same balloon of another material.
    pub fn with_material(mut self, material: BalloonMaterial) -> Self {
        self.material = material;
        self
    }

    /// The same balloon with gas of another pressure, Pa.
    pub fn with_pressure(mut self, pressure: f32) -> Self {
        self.material.pressure = pressure;
        self
    }

    /// The same balloon with a strain limit of its springs, >= 0.
    pub fn with_max_stretch(mut self, max_stretch: f32) -> Self {
        self.max_stretch = Some(max_stretch);
        self
    }

    /// The same balloon with other coefficients of the air's forces.
    pub fn with_air(mut self, air: Air) -> Self {
        self.air = air;
        self
    }

    /// Whether it is made from the mesh of its entity.
    pub fn needs_mesh(&self) -> bool {
        self.shape == BalloonShape::Mesh
    }

    /// Checks all numbers but the shape.
    ///
    /// # Errors
    /// Names the field at fault.
    pub fn validate(&self) -> Result<(), NetError> {
        super::check_numbers(self.radius, self.material.validate(), self.max_stretch, self.air)
    }

    /// The particles and springs of a sphere.
    ///
    /// # Errors
    /// If a number is outside its range, or it is to be made from a mesh.
    pub fn topology(&self) -> Result<Topology, NetError> {
        self.validate()?;
        let BalloonShape::Sphere { centre, radius } = self.shape else {
            return Err(NetError::MissingMesh { recipe: "balloon" });
        };
        parameter::finite("centre", centre)?;
        parameter::positive("radius", radius)?;
        let most = Self::MAX_SUBDIVISIONS.into();
        let subdivisions = NetError::count("subdivisions", self.subdivisions.into(), 0, most)?;
        let (positions, triangles) = icosphere(centre, radius, subdivisions);
        self.cover(&Welded::unwelded(positions, triangles))
    }

    /// The same from a closed mesh, if the shape is that; other balloons ignore it.
    ///
    /// # Errors
    /// As [`topology`](Self::topology); and if the mesh is empty, broken, degenerate, not manifold, open or
    /// inside out.
    pub fn topology_with(&self, mesh: &TriangleMesh) -> Result<Topology, NetError> {
        if !self.needs_mesh() {
            return self.topology();
        }
        self.validate()?;
        let welded = mesh.weld()?;
        welded.check_closed()?;
        let topology = self.cover(&welded)?;
        let Groups { painted, weights } = welded.groups(mesh);
        let binding = Some(MeshBinding::Welded(welded.particle_of));
        Ok(Topology { painted, weights, binding, ..topology })
    }

    fn cover(&self, mesh: &Welded) -> Result<Topology, NetError> {
        let weave = Weave { retardation_time: self.material.retardation_time, max_stretch: self.max_stretch };
        let skin = membrane::Skin {
            area_density: self.material.area_density,
            stretch_stiffness: self.material.stretch_stiffness,
            bending_stiffness: self.material.bending_stiffness,
        };
        let topology = membrane::topology(mesh, &skin, &weave);
        let pressure = Some(self.material.pressure);
        Topology { radius: self.radius, air: self.air, pressure, ..topology }.checked()
    }
}
