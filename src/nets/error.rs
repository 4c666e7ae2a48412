//! What is wrong with a recipe, or with the mesh that it was given.

use super::InvalidTopology;
use crate::parameter::InvalidParameter;

/// What a recipe of a net refuses. Vertices and triangles are numbered as in the mesh that was given.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NetError {
    /// A number is outside its range.
    #[error(transparent)]
    Parameter(#[from] InvalidParameter),
    /// A number of cells, segments or subdivisions is outside its range.
    #[error("{field} is {value}, expected {least} to {most}")]
    Count {
        /// The name of the field.
        field: &'static str,
        /// What was given, or what follows from the spacing.
        value: u64,
        /// The smallest number that is accepted.
        least: u64,
        /// The greatest number that is accepted.
        most: u64,
    },
    /// Numbers that are in their ranges, but give masses, stiffnesses or lengths that are not.
    #[error("sizes and material do not go together: {0}")]
    OutOfScale(#[from] InvalidTopology),
    /// A shape without length, area or volume.
    #[error("{field} has no {lacks}")]
    Degenerate {
        /// The name of the field.
        field: &'static str,
        /// What it lacks.
        lacks: &'static str,
    },
    /// The recipe is made from the mesh of its entity, and there is none.
    #[error("a {recipe} from a mesh needs a mesh")]
    MissingMesh {
        /// The name of the recipe.
        recipe: &'static str,
    },
    /// A mesh without triangles.
    #[error("the mesh is empty: it has no triangles")]
    EmptyMesh,
    /// A mesh that is not a list of triangles, or lacks positions.
    #[error("the mesh cannot be read: {why}")]
    UnreadableMesh {
        /// What is the matter.
        why: &'static str,
    },
    /// A position with NaN or infinity.
    #[error("vertex {vertex} of the mesh is not finite")]
    NonFiniteVertex {
        /// The vertex.
        vertex: u32,
    },
    /// A triangle with a vertex that does not exist.
    #[error("triangle {triangle} of the mesh has vertex {vertex}, expected less than {count}")]
    MissingVertex {
        /// The triangle.
        triangle: u32,
        /// What it names.
        vertex: u32,
        /// The number of vertices.
        count: u32,
    },
    /// A triangle without area, of three vertices in different places.
    #[error("triangle {triangle} of the mesh is degenerate: it has no area")]
    DegenerateTriangle {
        /// The triangle.
        triangle: u32,
    },
    /// A vertex in no triangle: it would have no mass.
    #[error("vertex {vertex} of the mesh is in no triangle with an area")]
    LooseVertex {
        /// The vertex.
        vertex: u32,
    },
    /// An edge of three or more triangles.
    #[error("the mesh is not manifold: more than two triangles meet between vertices {} and {}", edge[0], edge[1])]
    NonManifold {
        /// A vertex at each of its ends.
        edge: [u32; 2],
    },
    /// Two triangles that face different ways.
    #[error("the mesh is not oriented: its triangles between vertices {} and {} face different ways", edge[0], edge[1])]
    Unoriented {
        /// A vertex at each end of their edge.
        edge: [u32; 2],
    },
    /// An edge of one triangle in a mesh that must be closed.
    #[error("the mesh is open: one triangle only is between vertices {} and {}", edge[0], edge[1])]
    Open {
        /// A vertex at each of its ends.
        edge: [u32; 2],
    },
    /// A closed mesh with triangles that face inwards.
    #[error("the mesh is inside out: it encloses {volume} m³, expected > 0")]
    InsideOut {
        /// The signed volume, m³.
        volume: f64,
    },
}

impl NetError {
    /// Accepts numbers from `least` to `most`.
    pub(super) fn count(field: &'static str, value: u64, least: u64, most: u64) -> Result<u32, Self> {
        match (least..=most).contains(&value) {
            true => Ok(value as u32),
            false => Err(Self::Count { field, value, least, most }),
        }
    }
}
