//! A mesh that moves with the net on its own entity.

use bevy::asset::RenderAssetUsages;
use bevy::prelude::*;

use super::binding::{Binding, NetMeshError, bind};
use super::drawing::{Drawing, Kind, Shape};
use super::generated;
use super::known::Particles;
use super::own_mesh::{OwnMesh, report};
use super::rope_mesh::{RopeMesh, RopeRibbon};
use super::surface::Surface;
use crate::nets::{ParticleNet, Topology};

/// Moves the mesh of this entity with its [`ParticleNet`].
///
/// An entity with a `Mesh3d` or `Mesh2d` from which its net was made gets a copy of that mesh, once; the mesh
/// itself, which other entities may have, stays what it is ([`RestMesh`] keeps it). Positions, normals and tangents are
/// written in every frame in which the net moved and is seen; texture coordinates, colours and all else stay. An entity
/// without a mesh gets one of the triangles of its net: a `Mesh2d` in [`Dimensions::Two`](crate::Dimensions), or where
/// there is a `Mesh2d` that is empty (`Mesh2d::default()`); else a `Mesh3d`. That of a grid has texture coordinates,
/// upright and once over all of it.
///
/// Where the net tears, the mesh opens. Vertices that hang on one particle keep the same position and normal, to the
/// bit, so that seams of texture coordinates do not gape.
///
/// A cloth is seen from both sides: give it a material without culling and with two-sided shading, as
/// `StandardMaterial { double_sided: true, cull_mode: None, ..default() }`.
///
/// Its `Aabb` follows, and is not Bevy's to compute. An entity has one of [`RopeMesh`], [`RopeRibbon`] and `NetMesh`;
/// of several the first of these counts.
#[derive(Component, Debug, Clone, Copy, Default, PartialEq, Eq, Reflect)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct NetMesh;

/// The mesh that the entity of a [`NetMesh`] had before it got its own copy of it.
#[derive(Component, Debug, Clone, PartialEq, Eq, Reflect)]
#[reflect(Component, Debug, Clone, PartialEq)]
pub struct RestMesh(pub Handle<Mesh>);

type NetMeshes<'w, 's> = Query<
    'w,
    's,
    (
        Entity,
        &'static ParticleNet,
        Option<&'static Mesh3d>,
        Option<&'static Mesh2d>,
        Option<&'static RestMesh>,
        Option<&'static mut Drawing>,
        Option<&'static Name>,
    ),
    (With<NetMesh>, Without<RopeMesh>, Without<RopeRibbon>),
>;

/// Gives new nets their meshes, and tears those of nets that tore.
pub(super) fn prepare_net_meshes(
    mut nets: NetMeshes,
    mut meshes: ResMut<Assets<Mesh>>,
    own: OwnMesh,
    mut commands: Commands,
) {
    for (entity, net, mesh_3d, mesh_2d, rest, drawing, name) in &mut nets {
        let current = mesh_3d.map(|mesh| &mesh.0).or(mesh_2d.map(|mesh| &mesh.0));
        let mut source = current.filter(|handle| **handle != Handle::default());
        if let Some(mut drawing) = drawing
            && drawing.kind == Kind::NetMesh
            && source == Some(&drawing.mesh)
        {
            if drawing.known.is_same(net) || tear(drawing.bypass_change_detection(), net, &mut meshes) {
                continue;
            }
            // Another net: from the mesh at rest, or from none.
            source = rest.map(|rest| &rest.0);
        }
        let (mut mesh, source) = match source {
            None => (generated::mesh_of(net.topology()), None),
            Some(source) => match meshes.get(source) {
                Some(mesh) => (mesh.clone(), Some(source.clone())),
                // It loads, or never does, as Bevy says then.
                None => continue,
            },
        };
        mesh.asset_usage = RenderAssetUsages::default();
        let bound = match &source {
            Some(_) => bind(&mut mesh, net.topology()),
            None => bind_generated(&mut mesh, net.topology()),
        };
        let shape = match bound {
            Ok((surface, binding)) => Shape::Surface { surface, binding },
            Err(error) => {
                report(entity, name, &error);
                // Its mesh stays; it is tried again with another.
                let mesh = source.unwrap_or_default();
                commands.entity(entity).try_insert(Drawing::new(entity, net, Kind::NetMesh, mesh));
                continue;
            }
        };
        let handle = meshes.add(mesh);
        own.give(entity, handle.clone(), mesh_3d.is_some(), mesh_2d.is_some(), &mut commands);
        if let Some(source) = source {
            commands.entity(entity).try_insert(RestMesh(source));
        }
        commands
            .entity(entity)
            .try_insert(Drawing::new(entity, net, Kind::NetMesh, handle).with_shape(shape));
    }
}

/// Binds a mesh that has a vertex for each particle.
fn bind_generated(mesh: &mut Mesh, topology: &Topology) -> Result<(Surface, Option<Binding>), NetMeshError> {
    match topology.binding {
        None => bind(mesh, topology),
        Some(_) => bind(mesh, &Topology { binding: None, ..topology.clone() }),
    }
}

/// Lets the mesh follow a net that tore. `false`: it is another net.
fn tear(drawing: &mut Drawing, net: &ParticleNet, meshes: &mut Assets<Mesh>) -> bool {
    if !drawing.keep(net) {
        return false;
    }
    // What cannot be drawn still cannot; a fine mesh hangs on the same particles as before.
    let Some(Shape::Surface { surface, binding: Some(binding) }) = &mut drawing.shape else { return true };
    let topology = net.topology();
    if topology.triangles.is_empty() || topology.triangles == surface.triangles {
        return true;
    }
    if topology.triangles.len() != surface.triangles.len() {
        return false;
    }
    let Some(mut mesh) = meshes.get_mut(&drawing.mesh) else { return false };
    let Ok(torn) = binding.follow(&mut mesh, topology) else { return false };
    *surface = torn;
    drawing.particles = Particles::new(topology);
    drawing.reset();
    true
}
