//! From Bevy's meshes to those that recipes read.

use bevy::math::Vec3;
use bevy::mesh::{Mesh, MeshVertexAttribute, PrimitiveTopology, VertexAttributeValues, VertexFormat};

use super::{MeshVertex, NetError, TriangleMesh};

/// How much a vertex is pinned, from 0 to 1: those with at least 1/2 are in the group `PIN`, to be [`Pinned`](crate::Pinned),
/// and all above 0 with their [weights](crate::nets::Topology::weights) in the group `SOFT_PIN`, to be tied by an
/// [`Attachment`](crate::nets::Attachment).
pub const ATTRIBUTE_PIN: MeshVertexAttribute =
    MeshVertexAttribute::new("Pin", 0x6d73_5f70_696e, VertexFormat::Float32);

impl TriangleMesh {
    /// The triangles of a mesh, its positions, and the groups that its vertex colours mean
    /// ([`paint_by_colours`](Self::paint_by_colours)). `PIN` is the group of those that [`ATTRIBUTE_PIN`] says, beside
    /// `SOFT_PIN`, or, without it, of all that are painted `RED`.
    ///
    /// # Errors
    /// If it is no list of triangles, or has no positions in the main world.
    pub fn from_mesh(mesh: &Mesh) -> Result<Self, NetError> {
        let (positions, triangles) = read_triangles(mesh)?;
        let mut found = Self::new(positions, triangles);
        found.colours = colours(mesh);
        found.paint_by_colours();
        if let Ok(Some(VertexAttributeValues::Float32(weights))) = mesh.try_attribute_option(ATTRIBUTE_PIN) {
            let weight = |vertex: &MeshVertex| weights.get(vertex.number as usize).copied().unwrap_or(0.0);
            found.paint("PIN", |vertex| weight(vertex) >= 0.5);
            found.paint_weights("SOFT_PIN", weight);
        } else if let Some((_, red)) = found.painted.first() {
            let pins = red.clone();
            found.painted.push(("PIN".to_owned(), pins));
        }
        Ok(found)
    }
}

fn unreadable(why: &'static str) -> NetError {
    NetError::UnreadableMesh { why }
}

/// The positions of the vertices of a mesh, m.
///
/// # Errors
/// If it has none in the main world.
pub(super) fn read_positions(mesh: &Mesh) -> Result<Vec<Vec3>, NetError> {
    let positions = mesh
        .try_attribute_option(Mesh::ATTRIBUTE_POSITION)
        .map_err(|_| unreadable("it is in the render world only"))?
        .and_then(VertexAttributeValues::as_float3)
        .ok_or(unreadable("it has no positions"))?;
    Ok(positions.iter().copied().map(Vec3::from).collect())
}

/// The positions of the vertices of a mesh, m, and the vertices of its triangles.
///
/// # Errors
/// If it is no list of triangles, or has no positions in the main world.
pub(super) fn read_triangles(mesh: &Mesh) -> Result<(Vec<Vec3>, Vec<[u32; 3]>), NetError> {
    if mesh.primitive_topology() != PrimitiveTopology::TriangleList {
        return Err(unreadable("it is not a list of triangles"));
    }
    let positions = read_positions(mesh)?;
    let indices = mesh.try_indices_option().map_err(|_| unreadable("it is in the render world only"))?;
    let corners: Vec<u32> = match indices {
        Some(indices) => indices.iter().map(|index| index as u32).collect(),
        None => (0..positions.len() as u32).collect(),
    };
    let (triangles, rest) = corners.as_chunks();
    if !rest.is_empty() {
        return Err(unreadable("the number of its indices is no multiple of three"));
    }
    Ok((positions, triangles.to_vec()))
}

/// The vertex colours of a mesh in the formats that Bevy's loaders make; empty if it has none.
fn colours(mesh: &Mesh) -> Vec<[f32; 4]> {
    match mesh.try_attribute_option(Mesh::ATTRIBUTE_COLOR) {
        Ok(Some(VertexAttributeValues::Float32x4(colours))) => colours.clone(),
        Ok(Some(VertexAttributeValues::Float32x3(colours))) => {
            colours.iter().map(|[r, g, b]| [*r, *g, *b, 1.0]).collect()
        }
        Ok(Some(VertexAttributeValues::Unorm8x4(colours))) => {
            colours.iter().map(|colour| colour.map(|channel| f32::from(channel) / 255.0)).collect()
        }
        _ => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use bevy::asset::RenderAssetUsages;
    use bevy::math::primitives::{Cuboid, Sphere};
    use bevy::mesh::Indices;

    use super::super::{Balloon, Cloth, Jelly, MeshBinding};
    use super::*;

    #[test]
    fn meshes_of_primitives_become_nets() {
        let cube = Mesh::from(Cuboid::new(1.0, 1.0, 1.0));
        let net = Cloth::topology_of(&TriangleMesh::from_mesh(&cube).expect("readable")).expect("sound");
        assert_eq!((net.positions.len(), net.triangles.len()), (8, 12));
        let Some(MeshBinding::Welded(map)) = net.binding else { panic!("a weld map") };
        assert_eq!(map.len(), cube.count_vertices());
        let sphere = TriangleMesh::from_mesh(&Mesh::from(Sphere::new(1.0))).expect("readable");
        let balloon = Balloon::from_mesh().topology_with(&sphere).expect("closed");
        assert!(balloon.pressure.is_some());
        let jelly = Jelly::fill_mesh(0.25).topology_with(&sphere).expect("closed");
        assert!(
            matches!(jelly.binding, Some(MeshBinding::Skinned(skin)) if skin.len() == sphere.positions.len())
        );
    }

    #[test]
    fn red_vertices_are_pins() {
        let corners = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let colours = vec![[1.0, 0.0, 0.0, 1.0], [1.0, 1.0, 1.0, 1.0], [0.0, 0.0, 1.0, 1.0]];
        let mesh = Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, corners)
            .with_inserted_attribute(Mesh::ATTRIBUTE_COLOR, colours)
            .with_inserted_indices(Indices::U16(vec![0, 1, 2]));
        let mesh = TriangleMesh::from_mesh(&mesh).expect("readable");
        let net = Cloth::topology_of(&mesh).expect("sound");
        assert_eq!(net.painted("PIN"), Some(&[0][..]));
        assert_eq!(net.painted("BLUE"), Some(&[2][..]));
        assert_eq!(net.painted("GREEN"), Some(&[][..]));
    }

    #[test]
    fn an_attribute_says_how_much_vertices_are_pinned() {
        let corners = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let mesh = Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, corners)
            .with_inserted_attribute(ATTRIBUTE_PIN, vec![0.75_f32, 0.0, 0.25])
            .with_inserted_indices(Indices::U16(vec![0, 1, 2]));
        let mesh = TriangleMesh::from_mesh(&mesh).expect("readable");
        let net = Cloth::topology_of(&mesh).expect("sound");
        assert_eq!(net.painted("PIN"), Some(&[0][..]));
        assert_eq!(net.painted("SOFT_PIN"), Some(&[0, 2][..]));
        assert_eq!([0, 2].map(|particle| net.weight("SOFT_PIN", particle)), [0.75, 0.25]);
    }

    #[test]
    fn lines_are_refused() {
        let mesh = Mesh::new(PrimitiveTopology::LineList, RenderAssetUsages::default());
        let refused = TriangleMesh::from_mesh(&mesh).expect_err("refused").to_string();
        assert_eq!(refused, "the mesh cannot be read: it is not a list of triangles");
    }
}
