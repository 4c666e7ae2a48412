//! A fine mesh that a coarse net of another entity moves.

use bevy::asset::RenderAssetUsages;
use bevy::ecs::entity::MapEntities;
use bevy::mesh::VertexAttributeValues;
use bevy::prelude::*;

use super::binding::{NetMeshError, rest_normals, triangles_of};
use super::drawing::{Drawing, Kind, Shape};
use super::fine;
use super::own_mesh::{OwnMesh, report};
use super::{NetMesh, RestMesh, RopeMesh, RopeRibbon};
use crate::nets::{ParticleNet, Topology};

/// Lets the surface of a net move the mesh of this entity, which may be much finer than the net and lie beside it: a
/// coat with buttons on a cloth, a face on a balloon.
///
/// The entity has a `Mesh3d`, in the frame of the recipe of the net: where the net is laid out at rest, the mesh lies
/// around it. Each vertex keeps its place over the nearest triangle. Like that of a [`NetMesh`] it is a copy; normals are
/// computed anew, with the creases that it has. Several skins may share a net, and a net that has skins need not be
/// drawn itself.
///
/// A skin does not tear.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_mass_spring::prelude::*;
/// /// A ball of jelly with 27 cells, drawn by a sphere of 2562 vertices.
/// fn spawn_ball(mut commands: Commands, mut meshes: ResMut<Assets<Mesh>>, green: MeshMaterial3d<StandardMaterial>) {
///     let coarse = Jelly::cuboid(Cuboid::from_length(0.5)).with_cells(UVec3::splat(3));
///     let jelly = commands.spawn((coarse, Transform::from_xyz(0.0, 2.0, 0.0))).id();
///     let fine = Sphere::new(0.25).mesh().ico(15).expect("less than 80");
///     commands.spawn((NetSkin(jelly), Mesh3d(meshes.add(fine)), green));
/// }
/// ```
#[derive(Component, FromTemplate, MapEntities, Debug, Clone, Copy, PartialEq, Eq, Reflect)]
#[cfg_attr(feature = "serialize", derive(serde::Serialize, serde::Deserialize))]
#[reflect(Component, Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serialize", reflect(Serialize, Deserialize))]
pub struct NetSkin(
    /// The entity of the net.
    #[entities]
    pub Entity,
);

type Skins<'w, 's> = Query<
    'w,
    's,
    (
        Entity,
        Ref<'static, NetSkin>,
        Option<&'static Mesh3d>,
        Option<&'static Mesh2d>,
        Option<&'static RestMesh>,
        Option<&'static mut Drawing>,
        Option<&'static Name>,
    ),
    (Without<NetMesh>, Without<RopeMesh>, Without<RopeRibbon>),
>;

/// Binds new skins.
pub(super) fn prepare_skins(
    mut skins: Skins,
    nets: Query<&ParticleNet>,
    mut meshes: ResMut<Assets<Mesh>>,
    own: OwnMesh,
    mut commands: Commands,
) {
    for (entity, skin, mesh_3d, mesh_2d, rest, drawing, name) in &mut skins {
        let Ok(net) = nets.get(skin.0) else { continue };
        let Some(mut source) = mesh_3d.map(|mesh| &mesh.0).or(mesh_2d.map(|mesh| &mesh.0)) else { continue };
        if let Some(mut drawing) = drawing
            && drawing.kind == Kind::NetSkin
            && drawing.net == skin.0
            && *source == drawing.mesh
        {
            if drawing.known.is_same(net) || drawing.keep(net) {
                continue;
            }
            source = rest.map_or(source, |rest| &rest.0);
        }
        let Some(mesh) = meshes.get(source) else { continue };
        let (source, mut mesh) = (source.clone(), mesh.clone());
        mesh.asset_usage = RenderAssetUsages::default();
        let mut drawing = Drawing::new(skin.0, net, Kind::NetSkin, source.clone());
        match bind(&mut mesh, net.topology()) {
            Err(error) => {
                report(entity, name, &error);
                commands.entity(entity).try_insert(drawing);
            }
            Ok(shape) => {
                let mesh = meshes.add(mesh);
                own.give(entity, mesh.clone(), mesh_3d.is_some(), mesh_2d.is_some(), &mut commands);
                drawing.mesh = mesh;
                let drawing = drawing.with_shape(shape);
                commands.entity(entity).try_insert((RestMesh(source), drawing));
            }
        }
    }
}

fn bind(mesh: &mut Mesh, topology: &Topology) -> Result<Shape, NetMeshError> {
    let triangles = triangles_of(mesh)?;
    let normals =
        mesh.try_attribute_option(Mesh::ATTRIBUTE_NORMAL)?.and_then(VertexAttributeValues::as_float3);
    if normals.is_none() {
        mesh.try_insert_attribute(Mesh::ATTRIBUTE_NORMAL, rest_normals(mesh, &triangles)?)?;
    }
    let surface = fine::bind_raised(mesh, triangles, topology)?;
    Ok(Shape::Surface { surface, binding: None })
}
