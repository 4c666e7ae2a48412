//! The edges by which convex hulls are drawn.

use bevy::prelude::*;

use super::{ColliderShape, SharedList};

impl ColliderShape {
    /// The edges of the convex hull of these points, m; none where there is no such solid.
    pub(crate) fn hull_edges(points: &SharedList<Vec3>) -> Vec<[Vec3; 2]> {
        let hull = Self::ConvexHull { points: points.clone() };
        hull.build(Vec3::ONE).map_or(Vec::new(), |hull| hull.sharp_edges())
    }
}
