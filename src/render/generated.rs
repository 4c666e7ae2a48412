//! A mesh for a net that has none.

use bevy::asset::RenderAssetUsages;
use bevy::math::{Vec3, Vec3A};
use bevy::mesh::{Mesh, PrimitiveTopology};

use super::binding::indices;
use super::surface::sum_area_normals;
use crate::nets::{Layout, Topology};

/// A vertex for each particle, at rest. Grids have texture coordinates, the upper left corner (0, 0), and tangents.
pub(super) fn mesh_of(topology: &Topology) -> Mesh {
    let places: Vec<Vec3A> = topology.positions.iter().map(|place| Vec3A::from(*place)).collect();
    let mut normals = Vec::new();
    let is_sound = |corners: &&[u32; 3]| corners.iter().all(|corner| (*corner as usize) < places.len());
    let triangles: Vec<[u32; 3]> = topology.triangles.iter().filter(is_sound).copied().collect();
    sum_area_normals(&places, &triangles, &mut normals);
    let normals: Vec<Vec3> = normals.iter().map(|normal| normal.normalize_or(Vec3A::Z).into()).collect();
    let mut mesh = Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default());
    if let Layout::Grid { cells } = topology.layout
        && let Some((uvs, tangents)) = texture(cells, &topology.positions, &normals)
    {
        mesh.insert_attribute(Mesh::ATTRIBUTE_UV_0, uvs);
        mesh.insert_attribute(Mesh::ATTRIBUTE_TANGENT, tangents);
    }
    mesh.insert_attribute(Mesh::ATTRIBUTE_POSITION, topology.positions.clone());
    mesh.insert_attribute(Mesh::ATTRIBUTE_NORMAL, normals);
    mesh.insert_indices(indices(&triangles, places.len()));
    mesh
}

/// The texture coordinates and tangents of a grid. Its texture is upright: v grows downwards, or towards the viewer on
/// what lies flat, as on Bevy's planes.
fn texture(
    [columns, rows]: [u32; 2],
    places: &[Vec3],
    normals: &[Vec3],
) -> Option<(Vec<[f32; 2]>, Vec<[f32; 4]>)> {
    let number = |column: u32, row: u32| (row * (columns + 1) + column) as usize;
    if columns == 0 || rows == 0 || places.len() <= number(columns, rows) {
        return None;
    }
    let origin = places[0];
    let is_turned = |side: Vec3| side.x - side.y + side.z < 0.0;
    let across = places[number(columns, 0)] - origin;
    let along = places[number(0, rows)] - origin;
    let [turned_u, turned_v] = [is_turned(across), is_turned(along)];
    let part = |number: u32, of: u32, is_turned: bool| {
        let part = number as f32 / of as f32;
        if is_turned { 1.0 - part } else { part }
    };
    let (mut uvs, mut tangents) = (vec![[0.0; 2]; places.len()], vec![[1.0, 0.0, 0.0, 1.0]; places.len()]);
    for row in 0..=rows {
        for column in 0..=columns {
            let here = number(column, row);
            uvs[here] = [part(column, columns, turned_u), part(row, rows, turned_v)];
            let step = |from: usize, to: usize, is_turned: bool| {
                if is_turned { places[from] - places[to] } else { places[to] - places[from] }
            };
            let (left, right) =
                (number(column.saturating_sub(1), row), number((column + 1).min(columns), row));
            let (above, below) = (number(column, row.saturating_sub(1)), number(column, (row + 1).min(rows)));
            let [u, v] = [step(left, right, turned_u), step(above, below, turned_v)];
            let normal = normals[here];
            let tangent = u.reject_from_normalized(normal).normalize_or(Vec3::X);
            // Bevy's bitangent, w n × t, points towards smaller v.
            let w = if normal.cross(tangent).dot(v) < 0.0 { 1.0 } else { -1.0 };
            tangents[here] = tangent.extend(w).to_array();
        }
    }
    Some((uvs, tangents))
}
