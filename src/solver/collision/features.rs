//! The edges and triangles of nets that collide between their corners, which are spheres of their own.

use bevy::math::DVec3;

use super::touch::MAX_POINTS;
use crate::solver::elements::{CollisionMesh, Elements};
use crate::solver::state::Version;

/// An edge or a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::solver) struct Feature {
    /// Slots; of an edge the last is the one before.
    pub corners: [u32; MAX_POINTS],
    /// How many there are.
    pub count: usize,
}

/// All edges, then all triangles: a cache.
#[derive(Debug, Clone, Default)]
pub(in crate::solver) struct Features {
    all: Vec<Feature>,
    key: Option<(Version, Version, bool)>,
    version: Version,
}

impl Features {
    /// Makes them those of a mesh, and of loose springs, if these collide along their length.
    pub fn refresh(&mut self, mesh: &CollisionMesh, elements: &Elements, with_springs: bool) {
        let key = Some((mesh.version(), elements.ends_version(), with_springs));
        if self.key == key {
            return;
        }
        self.key = key;
        self.version = Version::new();
        self.all.clear();
        let edges = mesh.present_edges(elements, with_springs).map(|([a, b], _)| [a, b, b]);
        self.all.extend(edges.map(|corners| Feature { corners, count: 2 }));
        self.all.extend(mesh.present_triangles().map(|corners| Feature { corners, count: 3 }));
    }

    /// Changes with them.
    pub fn version(&self) -> Version {
        self.version
    }

    /// All of them.
    pub fn all(&self) -> &[Feature] {
        &self.all
    }
}

/// Σ wᵢ xᵢ.
pub(in crate::solver) fn sum(points: [DVec3; MAX_POINTS], weights: [f64; MAX_POINTS]) -> DVec3 {
    points[0] * weights[0] + points[1] * weights[1] + points[2] * weights[2]
}

/// Σ wᵢ rᵢ.
pub(in crate::solver) fn weigh(numbers: [f64; MAX_POINTS], weights: [f64; MAX_POINTS]) -> f64 {
    numbers[0] * weights[0] + numbers[1] * weights[1] + numbers[2] * weights[2]
}
