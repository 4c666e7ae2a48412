//! How the vertices of a mesh hang on a net, also after it tore.

use std::collections::BTreeMap;

use bevy::mesh::{Indices, MeshAccessError, PrimitiveTopology, VertexAttributeValues};
use bevy::prelude::*;
use thiserror::Error;

use super::fine;
use super::surface::{Points, Surface};
use super::tangents::{Rest, Tangents};
use crate::nets::{MeshBinding, Topology};

/// Why a mesh cannot be moved by a net.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum NetMeshError {
    /// The mesh is on the graphics card only.
    #[error(
        "its mesh cannot be read: load it with `RenderAssetUsages::default()`, which keeps it in main memory"
    )]
    Extracted,
    /// The mesh is not one of triangles with positions of three `f32`.
    #[error(
        "its mesh must be a list of triangles (`PrimitiveTopology::TriangleList`) with positions `Float32x3`"
    )]
    NotTriangles,
    /// The net was not made from this mesh.
    #[error("its mesh has {vertices} vertices, but the net was made for a mesh of {expected}")]
    Vertices {
        /// How many vertices the mesh has.
        vertices: usize,
        /// How many the net has a place for.
        expected: usize,
    },
    /// The net has other triangles than its mesh.
    #[error("triangle {triangle} of the net is none of its mesh")]
    Triangle {
        /// Its number in the topology of the net.
        triangle: usize,
    },
    /// A net without triangles moves no skin.
    #[error("its net has no surface")]
    NoSurface,
    /// A vertex hangs on a particle that does not exist.
    #[error("vertex {vertex} of its mesh hangs on a particle that the net does not have")]
    Particle {
        /// The number of the vertex.
        vertex: usize,
    },
}

impl From<MeshAccessError> for NetMeshError {
    fn from(error: MeshAccessError) -> Self {
        match error {
            MeshAccessError::ExtractedToRenderWorld => Self::Extracted,
            MeshAccessError::NotFound => Self::NotTriangles,
        }
    }
}

/// The vertices of a mesh that is torn as its net is.
#[derive(Debug, Clone, Default)]
pub(super) struct Binding {
    /// The particle of each vertex.
    pub particle_of: Vec<u32>,
    /// The vertices at the corners of each triangle of the net.
    pub corners: Vec<[u32; 3]>,
    /// The vertex of the mesh at rest of which each vertex is a copy.
    origin: Vec<u32>,
    /// The mesh at rest, if it has tangents.
    rest: Option<RestAttributes>,
}

#[derive(Debug, Clone, Default)]
pub(super) struct RestAttributes {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    tangents: Vec<[f32; 4]>,
}

/// The triangles of a mesh, by vertex.
pub(super) fn triangles_of(mesh: &Mesh) -> Result<Vec<[u32; 3]>, NetMeshError> {
    if mesh.primitive_topology() != PrimitiveTopology::TriangleList {
        return Err(NetMeshError::NotTriangles);
    }
    let vertices = positions_of(mesh)?.len();
    let corners: Vec<u32> = match mesh.try_indices_option()? {
        Some(indices) => indices.iter().map(|index| index as u32).collect(),
        None => (0..vertices as u32).collect(),
    };
    if corners.iter().any(|corner| *corner as usize >= vertices) {
        return Err(NetMeshError::NotTriangles);
    }
    Ok(corners.as_chunks().0.to_vec())
}

pub(super) fn positions_of(mesh: &Mesh) -> Result<&[[f32; 3]], NetMeshError> {
    mesh.try_attribute(Mesh::ATTRIBUTE_POSITION)?.as_float3().ok_or(NetMeshError::NotTriangles)
}

/// Binds a mesh to the net that was made from it. The mesh gets normals if it has none.
pub(super) fn bind(mesh: &mut Mesh, topology: &Topology) -> Result<(Surface, Option<Binding>), NetMeshError> {
    let triangles = triangles_of(mesh)?;
    let vertices = positions_of(mesh)?.len();
    if mesh.try_attribute_option(Mesh::ATTRIBUTE_NORMAL)?.and_then(VertexAttributeValues::as_float3).is_none()
    {
        mesh.try_insert_attribute(Mesh::ATTRIBUTE_NORMAL, rest_normals(mesh, &triangles)?)?;
    }
    let particles = topology.positions.len();
    let particle_of: Vec<u32> = match &topology.binding {
        Some(MeshBinding::Welded(map)) if map.len() == vertices => map.clone(),
        Some(MeshBinding::Skinned(means)) if means.len() == vertices => {
            return fine::bind_means(mesh, triangles, means, particles).map(|surface| (surface, None));
        }
        None if vertices == particles => (0..vertices as u32).collect(),
        Some(MeshBinding::Welded(map)) => {
            return Err(NetMeshError::Vertices { vertices, expected: map.len() });
        }
        Some(MeshBinding::Skinned(means)) => {
            return Err(NetMeshError::Vertices { vertices, expected: means.len() });
        }
        None => return Err(NetMeshError::Vertices { vertices, expected: particles }),
    };
    if let Some(vertex) = particle_of.iter().position(|particle| *particle as usize >= particles) {
        return Err(NetMeshError::Particle { vertex });
    }
    let mut binding = Binding::new(mesh, particle_of, &triangles, topology)?;
    let surface = binding.follow(mesh, topology)?;
    Ok((surface, Some(binding)))
}

/// The normals of a mesh at rest, by its own triangles.
pub(super) fn rest_normals(mesh: &Mesh, triangles: &[[u32; 3]]) -> Result<Vec<[f32; 3]>, NetMeshError> {
    let places: Vec<_> =
        positions_of(mesh)?.iter().map(|place| bevy::math::Vec3A::from_array(*place)).collect();
    let mut normals = Vec::new();
    super::surface::sum_area_normals(&places, triangles, &mut normals);
    Ok(normals.iter().map(|normal| normal.normalize_or(bevy::math::Vec3A::Z).to_array()).collect())
}

impl Binding {
    fn new(
        mesh: &Mesh,
        particle_of: Vec<u32>,
        triangles: &[[u32; 3]],
        topology: &Topology,
    ) -> Result<Self, NetMeshError> {
        let corners = match topology.triangles.as_slice() {
            [] => triangles.to_vec(),
            wanted => match_triangles(&particle_of, triangles, wanted)?,
        };
        let origin = (0..particle_of.len() as u32).collect();
        Ok(Self { particle_of, corners, origin, rest: RestAttributes::of(mesh)? })
    }

    /// Follows the net where it tore: triangles that let go of a particle get a vertex of their own at the new one,
    /// which has the texture coordinates, the colour and all else of the old one.
    pub fn follow(&mut self, mesh: &mut Mesh, topology: &Topology) -> Result<Surface, NetMeshError> {
        let triangles = match topology.triangles.as_slice() {
            [] => self
                .corners
                .iter()
                .map(|corners| corners.map(|corner| self.particle_of[corner as usize]))
                .collect(),
            triangles => triangles.to_vec(),
        };
        let known = self.particle_of.len();
        // Vertices of the mesh at rest that have copies, with the particle of the copy.
        let mut copies: BTreeMap<(u32, u32), u32> = BTreeMap::new();
        for (vertex, (origin, particle)) in self.origin.iter().zip(&self.particle_of).enumerate() {
            copies.entry((*origin, *particle)).or_insert(vertex as u32);
        }
        for (corners, wanted) in self.corners.iter_mut().zip(&triangles) {
            for (corner, particle) in corners.iter_mut().zip(wanted) {
                if self.particle_of[*corner as usize] == *particle {
                    continue;
                }
                let origin = self.origin[*corner as usize];
                *corner = *copies.entry((origin, *particle)).or_insert_with(|| {
                    self.particle_of.push(*particle);
                    self.origin.push(origin);
                    self.origin.len() as u32 - 1
                });
            }
        }
        append_copies(mesh, &self.origin[known..])?;
        mesh.try_insert_indices(indices(&self.corners, self.origin.len()))?;
        let tangents = self
            .rest
            .as_ref()
            .map(|rest| rest.of_copies(&self.origin).tangents(&self.corners, &self.particle_of));
        Ok(Surface { points: Points::Particles, triangles, point_of: self.particle_of.clone(), tangents })
    }
}

impl RestAttributes {
    pub fn of(mesh: &Mesh) -> Result<Option<Self>, NetMeshError> {
        let Some(VertexAttributeValues::Float32x4(tangents)) =
            mesh.try_attribute_option(Mesh::ATTRIBUTE_TANGENT)?
        else {
            return Ok(None);
        };
        let normals = mesh.try_attribute(Mesh::ATTRIBUTE_NORMAL)?.as_float3();
        Ok(normals.map(|normals| Self {
            positions: positions_of(mesh).map(<[_]>::to_vec).unwrap_or_default(),
            normals: normals.to_vec(),
            tangents: tangents.clone(),
        }))
    }

    /// How the tangents of this mesh follow points.
    pub fn tangents(&self, corners: &[[u32; 3]], point_of: &[u32]) -> Tangents {
        let Self { positions, normals, tangents } = self;
        Tangents::new(corners, point_of, Rest { positions, normals, tangents })
    }

    fn of_copies(&self, origin: &[u32]) -> Self {
        let origin = || origin.iter().map(|vertex| *vertex as usize);
        Self {
            positions: origin().map(|vertex| self.positions[vertex]).collect(),
            normals: origin().map(|vertex| self.normals[vertex]).collect(),
            tangents: origin().map(|vertex| self.tangents[vertex]).collect(),
        }
    }
}

/// The vertices of the triangles of the net, of which the mesh may have more: those that were welded to a line.
fn match_triangles(
    particle_of: &[u32],
    triangles: &[[u32; 3]],
    wanted: &[[u32; 3]],
) -> Result<Vec<[u32; 3]>, NetMeshError> {
    let particles = |corners: &[u32; 3]| corners.map(|corner| particle_of[corner as usize]);
    let is_triangle = |corners: &&[u32; 3]| {
        let [a, b, c] = particles(corners);
        a != b && b != c && c != a
    };
    let kept: Vec<[u32; 3]> = triangles.iter().filter(is_triangle).copied().collect();
    let turned = |corners: &[u32; 3], wanted: &[u32; 3]| {
        let [a, b, c] = *corners;
        [[a, b, c], [b, c, a], [c, a, b]].into_iter().find(|corners| particles(corners) == *wanted)
    };
    if kept.len() == wanted.len() {
        // The same triangles in the same order; those that differ have torn already.
        return Ok(kept
            .iter()
            .zip(wanted)
            .map(|(corners, wanted)| turned(corners, wanted).unwrap_or(*corners))
            .collect());
    }
    let sorted = |mut corners: [u32; 3]| {
        corners.sort_unstable();
        corners
    };
    let mut known: BTreeMap<[u32; 3], [u32; 3]> = BTreeMap::new();
    for corners in &kept {
        known.entry(sorted(particles(corners))).or_insert(*corners);
    }
    let find = |(triangle, wanted): (usize, &[u32; 3])| {
        let corners = known.get(&sorted(*wanted)).and_then(|corners| turned(corners, wanted));
        corners.ok_or(NetMeshError::Triangle { triangle })
    };
    wanted.iter().enumerate().map(find).collect()
}

/// The index buffer of triangles: of 16 bits where the number of `vertices` allows it.
pub(super) fn indices(triangles: &[[u32; 3]], vertices: usize) -> Indices {
    let corners = triangles.iter().flatten();
    if vertices <= usize::from(u16::MAX) {
        Indices::U16(corners.map(|corner| *corner as u16).collect())
    } else {
        Indices::U32(corners.copied().collect())
    }
}

/// Appends to each attribute the values that these vertices have.
fn append_copies(mesh: &mut Mesh, vertices: &[u32]) -> Result<(), NetMeshError> {
    macro_rules! extend {
        ($values:expr, $($format:ident)+) => {
            match $values {
                $(VertexAttributeValues::$format(values) => {
                    values.extend_from_within_each(vertices);
                })+
            }
        };
    }
    for (_, values) in mesh.try_attributes_mut()? {
        extend!(values,
            Uint8 Uint8x2 Uint8x4 Sint8 Sint8x2 Sint8x4 Unorm8 Unorm8x2 Unorm8x4 Snorm8 Snorm8x2 Snorm8x4
            Uint16 Uint16x2 Uint16x4 Sint16 Sint16x2 Sint16x4 Unorm16 Unorm16x2 Unorm16x4 Snorm16 Snorm16x2
            Snorm16x4 Float16 Float16x2 Float16x4 Float32 Float32x2 Float32x3 Float32x4 Uint32 Uint32x2
            Uint32x3 Uint32x4 Sint32 Sint32x2 Sint32x3 Sint32x4 Float64 Float64x2 Float64x3 Float64x4
            Unorm10_10_10_2 Unorm8x4Bgra);
    }
    Ok(())
}

trait ExtendFromWithin {
    /// Appends copies of the elements with these numbers.
    fn extend_from_within_each(&mut self, numbers: &[u32]);
}

impl<T: Copy> ExtendFromWithin for Vec<T> {
    fn extend_from_within_each(&mut self, numbers: &[u32]) {
        for number in numbers {
            self.push(self[*number as usize]);
        }
    }
}
