//! Colliders from Bevy's meshes, read as those of nets are.

use bevy::mesh::Mesh;

use super::bevy_mesh::{read_positions, read_triangles};
use super::{NetError, TriangleMesh};
use crate::collider::ColliderShape;

/// From meshes, in the axes of the mesh (feature `render`): beside a `Mesh3d` on the same entity, a collider is where it is drawn.
impl ColliderShape {
    /// The triangles of a mesh: a solid if they are closed and counterclockwise seen from outside, else a sheet, which is met from
    /// both sides. Vertices in one place, up to 1e-5 of its size, are one.
    ///
    /// ```
    /// # use bevy::prelude::*;
    /// # use bevy_mass_spring::prelude::*;
    /// let ring = ColliderShape::mesh(&Mesh::from(Torus::new(0.5, 1.0)))?;
    /// let collider = ParticleCollider::new(ring).with_friction(0.5);
    /// # Ok::<(), bevy_mass_spring::nets::NetError>(())
    /// ```
    ///
    /// # Errors
    /// If the mesh is no list of triangles or is not in the main world, or names what is wrong with it: see
    /// [`MeshError`](crate::solver::MeshError).
    pub fn mesh(mesh: &Mesh) -> Result<Self, NetError> {
        checked(triangles_of(mesh)?)
    }

    /// The triangles of a mesh that is not closed, such as a terrain, with all behind them solid; all are to face the same
    /// side.
    ///
    /// # Errors
    /// As [`mesh`](Self::mesh), and if neighbouring triangles face different sides.
    pub fn one_sided_mesh(mesh: &Mesh) -> Result<Self, NetError> {
        checked(triangles_of(mesh)?.one_sided())
    }

    /// The smallest convex solid that holds all vertices of a mesh, whatever it is made of (needs the feature `parry`).
    ///
    /// # Errors
    /// If the mesh has no positions in the main world, one is not finite, all are in one plane, or without the feature.
    pub fn convex_hull(mesh: &Mesh) -> Result<Self, NetError> {
        checked(Self::ConvexHull { points: read_positions(mesh)?.into() })
    }
}

fn triangles_of(mesh: &Mesh) -> Result<ColliderShape, NetError> {
    let (positions, triangles) = read_triangles(mesh)?;
    let (vertices, triangles) = TriangleMesh::new(positions, triangles).closed_seams()?;
    Ok(ColliderShape::Mesh { vertices: vertices.into(), triangles: triangles.into(), one_sided: false })
}

fn checked(shape: ColliderShape) -> Result<ColliderShape, NetError> {
    shape.validate()?;
    Ok(shape)
}

#[cfg(test)]
mod tests {
    use bevy::math::DVec3;
    use bevy::math::primitives::{Cuboid, Sphere, Torus};
    use bevy::mesh::{Mesh, Meshable};

    use super::*;

    /// Meshes of primitives have seams, and their poles triangles without area: they are solids all the same.
    #[test]
    fn meshes_of_primitives_are_solids() {
        let sphere = Sphere::new(1.0).mesh();
        let inside = DVec3::new(0.1, 0.2, 0.3);
        for (name, mesh, inside) in [
            ("cuboid", Mesh::from(Cuboid::new(1.0, 1.0, 1.0)), inside),
            ("icosphere", sphere.ico(3).unwrap(), inside),
            ("sphere", sphere.uv(16, 8), inside),
            ("torus", Mesh::from(Torus::new(0.5, 1.5)), DVec3::X + inside),
        ] {
            let shape = ColliderShape::mesh(&mesh).unwrap();
            let depth = shape.depth_meter().unwrap();
            assert!(depth(inside, 0.0) > 0.05, "{name}: {} m", depth(inside, 0.0));
            assert!(depth(DVec3::ONE * 2.0, 0.0) < -0.5, "{name}");
        }
    }
}
