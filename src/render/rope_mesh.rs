//! Ropes as tubes and ribbons.

use bevy::asset::RenderAssetUsages;
use bevy::mesh::PrimitiveTopology;
use bevy::prelude::*;
use thiserror::Error;

use super::crowd::{CrowdShape, RopeCrowd};
use super::drawing::{Drawing, Kind, Shape};
use super::known::Known;
use super::own_mesh::{OwnMesh, report};
use super::surface::{Scratch, Vertices};
use super::tube::{Profile, Section, Tube};
use crate::nets::{ParticleNet, Topology};

/// Draws a rope, or every thread of a net of ropes, as a tube.
///
/// It makes the mesh of its entity; give it a material. u of the texture goes once around, v along the rest length,
/// so that a stretched rope has a stretched texture. What tore is drawn in pieces, each with rounded ends.
/// A change acts at once.
#[derive(Component, Debug, Clone, Copy, PartialEq, Reflect)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct RopeMesh {
    /// The radius of the tube, m, > 0. `None`, the default: that of the particles.
    pub radius: Option<f32>,
    /// How many sides it has, 3 to 256. Default 8.
    pub sides: u32,
    /// How many cross-sections it has for each link, 1 to 64: 1 are straight links, more are a smooth curve (a
    /// Catmull–Rom spline) through the particles. Default 2.
    pub rings: u32,
    /// How many rings each rounded end has, up to 64; 0 are open ends. Default 3.
    pub cap_rings: u32,
    /// The length of rope on which the texture is once, m, > 0. `None`, the default: the circumference, so that a square
    /// of the texture is one on the rope.
    pub texture_length: Option<f32>,
}

impl Default for RopeMesh {
    fn default() -> Self {
        Self { radius: None, sides: 8, rings: 2, cap_rings: 3, texture_length: None }
    }
}

impl RopeMesh {
    /// A tube of another radius than that of the particles, m.
    pub fn with_radius(mut self, radius: f32) -> Self {
        self.radius = Some(radius);
        self
    }

    /// Sets the number of sides of the tube, 3 to 256.
    pub fn with_sides(mut self, sides: u32) -> Self {
        self.sides = sides;
        self
    }

    /// Sets the number of cross-sections for each link, 1 to 64.
    pub fn with_rings(mut self, rings: u32) -> Self {
        self.rings = rings;
        self
    }

    /// A texture that is once on this length of rope, m.
    pub fn with_texture_length(mut self, length: f32) -> Self {
        self.texture_length = Some(length);
        self
    }
}

/// Draws a rope as a flat ribbon: a strap, a belt, a rope in two dimensions.
///
/// It makes the mesh of its entity. u of the texture goes across, v along the rest length. It has one side: see
/// [`NetMesh`](super::NetMesh) for a material that shows both. A change acts at once.
#[derive(Component, Debug, Clone, Copy, PartialEq, Reflect)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct RopeRibbon {
    /// Its width, m, > 0. `None`, the default: the diameter of the particles.
    pub width: Option<f32>,
    /// The direction of the world that it faces, as far as the rope lets it. `None`, the default: +z where it is a
    /// `Mesh2d`, else none, and it does not twist.
    pub facing: Option<Vec3>,
    /// How many cross-sections it has for each link, 1 to 64, as of [`RopeMesh::rings`]. Default 2.
    pub rings: u32,
    /// The length of rope on which the texture is once, m, > 0. `None`, the default: the width.
    pub texture_length: Option<f32>,
}

impl Default for RopeRibbon {
    fn default() -> Self {
        Self { width: None, facing: None, rings: 2, texture_length: None }
    }
}

/// Why a rope cannot be drawn.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum RopeMeshError {
    /// A length that is not finite and > 0.
    #[error("{field} must be a finite number > 0, not {value}")]
    Length {
        /// Which field it is.
        field: &'static str,
        /// What it is set to.
        value: f32,
    },
    /// A number outside its range.
    #[error("{field} must be {low} to {high}, not {value}")]
    Count {
        /// Which field it is.
        field: &'static str,
        /// What it is set to.
        value: u32,
        /// The least.
        low: u32,
        /// The greatest.
        high: u32,
    },
    /// The net has no springs.
    #[error("its net has no springs")]
    NoSprings,
}

fn length(field: &'static str, value: f32) -> Result<f32, RopeMeshError> {
    if value.is_finite() && value > 0.0 { Ok(value) } else { Err(RopeMeshError::Length { field, value }) }
}

fn count(field: &'static str, value: u32, [low, high]: [u32; 2]) -> Result<u32, RopeMeshError> {
    if (low..=high).contains(&value) {
        Ok(value)
    } else {
        Err(RopeMeshError::Count { field, value, low, high })
    }
}

impl RopeMesh {
    fn profile(&self, topology: &Topology) -> Result<Profile, RopeMeshError> {
        let radius = length("RopeMesh::radius", self.radius.unwrap_or(topology.radius))?;
        let texture_length = self.texture_length.unwrap_or(std::f32::consts::TAU * radius);
        Ok(Profile {
            section: Section::Round {
                radius,
                sides: count("RopeMesh::sides", self.sides, [3, 256])?,
                cap_rings: count("RopeMesh::cap_rings", self.cap_rings, [0, 64])?,
            },
            rings: count("RopeMesh::rings", self.rings, [1, 64])?,
            texture_length: length("RopeMesh::texture_length", texture_length)?,
        })
    }
}

impl RopeRibbon {
    fn profile(&self, topology: &Topology, is_flat: bool) -> Result<Profile, RopeMeshError> {
        let width = length("RopeRibbon::width", self.width.unwrap_or(2.0 * topology.radius))?;
        Ok(Profile {
            section: Section::Flat {
                half_width: 0.5 * width,
                facing: self.facing.or(is_flat.then_some(Vec3::Z)),
            },
            rings: count("RopeRibbon::rings", self.rings, [1, 64])?,
            texture_length: length("RopeRibbon::texture_length", self.texture_length.unwrap_or(width))?,
        })
    }
}

type Ropes<'w, 's> = Query<
    'w,
    's,
    (
        Entity,
        &'static ParticleNet,
        Option<Ref<'static, RopeMesh>>,
        Option<Ref<'static, RopeRibbon>>,
        Has<Mesh3d>,
        Has<Mesh2d>,
        Has<RopeCrowd>,
        Option<&'static mut Drawing>,
        Option<&'static Name>,
    ),
    Or<(With<RopeMesh>, With<RopeRibbon>)>,
>;

/// Makes the meshes of new ropes, of those that were changed, and of those that tore.
pub(super) fn prepare_ropes(
    mut ropes: Ropes,
    mut meshes: ResMut<Assets<Mesh>>,
    own: OwnMesh,
    mut commands: Commands,
) {
    for (entity, net, tube, ribbon, has_3d, has_2d, is_of_crowd, drawing, name) in &mut ropes {
        let (kind, is_changed) = match (&tube, &ribbon) {
            (Some(tube), _) => (Kind::RopeMesh, tube.is_changed()),
            (None, Some(ribbon)) => (Kind::RopeRibbon, ribbon.is_changed()),
            (None, None) => continue,
        };
        let is_of_crowd = is_of_crowd && own.has_crowds() && tube.is_some() && !own.is_flat(has_3d, has_2d);
        let is_as_wanted = |drawing: &Mut<Drawing>| {
            let is_of_other_kind = match &drawing.shape {
                Some(Shape::Crowd(_)) => !is_of_crowd,
                shape => shape.is_some() && is_of_crowd,
            };
            drawing.kind == kind && !is_of_other_kind
        };
        let drawing = drawing.filter(is_as_wanted);
        if let Some(drawing) = &drawing
            && !is_changed
            && drawing.known.is_same(net)
        {
            continue;
        }
        let profile = match (tube, ribbon) {
            (Some(tube), _) => tube.profile(net.topology()),
            (None, Some(ribbon)) => ribbon.profile(net.topology(), own.is_flat(has_3d, has_2d)),
            (None, None) => continue,
        };
        let tube = profile
            .map(|profile| Tube::new(net.topology(), net.broken(), profile))
            .and_then(|tube| if tube.vertex_count() > 0 { Ok(tube) } else { Err(RopeMeshError::NoSprings) });
        let tube = match tube {
            Ok(tube) => tube,
            Err(error) => {
                report(entity, name, &error);
                let nothing = Drawing::new(entity, net, kind, Handle::default());
                commands.entity(entity).try_insert(nothing);
                continue;
            }
        };
        // Other parameters, as a winch sets in every tick, change no mesh.
        let mut drawing = drawing;
        if let Some(drawing) = &mut drawing
            && let Some(Shape::Tube(old) | Shape::Crowd(CrowdShape { tube: old, .. })) = &drawing.shape
            && old.is_like(&tube)
        {
            drawing.known = Known::new(net);
            continue;
        }
        if is_of_crowd {
            let shape = Shape::Crowd(CrowdShape { tube, entries: Vec::new(), has_place: false });
            let drawing = Drawing::new(entity, net, kind, Handle::default()).with_shape(shape);
            commands.entity(entity).try_insert(drawing);
            continue;
        }
        let mesh = mesh_of(&tube, net.topology());
        let shape = Shape::Tube(tube);
        // A mesh of its own is made anew in place.
        if let Some(mut drawing) = drawing
            && let Some(mut old) = meshes.get_mut(&drawing.mesh)
        {
            *old = mesh;
            drawing.known = Known::new(net);
            drawing.shape = Some(shape);
            drawing.reset();
            continue;
        }
        let handle = meshes.add(mesh);
        own.give(entity, handle.clone(), has_3d, has_2d, &mut commands);
        let drawing = Drawing::new(entity, net, kind, handle).with_shape(shape);
        commands.entity(entity).try_insert(drawing);
    }
}

/// The mesh of a rope at rest.
fn mesh_of(tube: &Tube, topology: &Topology) -> Mesh {
    let mut scratch = Scratch::default();
    scratch.places.extend(topology.positions.iter().map(|place| bevy::math::Vec3A::from(*place)));
    let mut vertices = Vertices::default();
    tube.write(&super::frame::Frame::World, &mut scratch, &mut vertices);
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, vertices.positions)
        .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, vertices.normals)
        .with_inserted_attribute(Mesh::ATTRIBUTE_TANGENT, vertices.tangents)
        .with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, tube.uvs())
        .with_inserted_indices(tube.indices())
}
