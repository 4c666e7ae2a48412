//! Spheres of nearly equilateral triangles.

use std::collections::BTreeMap;

use bevy::math::{DVec3, Vec3};

/// The vertices and triangles of an icosahedron with each triangle divided into four `subdivisions` times, on
/// a sphere: 10 · 4ⁿ + 2 vertices. Those of the icosahedron come first, then those of each division.
pub(super) fn icosphere(centre: Vec3, radius: f32, subdivisions: u32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let golden = 0.5 * (1.0 + 5.0_f64.sqrt());
    let mut directions: Vec<DVec3> = Vec::new();
    for (first, second) in [(1.0, golden), (-1.0, golden), (1.0, -golden), (-1.0, -golden)] {
        directions.push(DVec3::new(0.0, first, second).normalize());
        directions.push(DVec3::new(first, second, 0.0).normalize());
        directions.push(DVec3::new(second, 0.0, first).normalize());
    }
    let mut triangles = faces(&directions);
    for _ in 0..subdivisions {
        let mut middles: BTreeMap<[u32; 2], u32> = BTreeMap::new();
        let mut middle = |one: u32, other: u32| {
            *middles.entry([one.min(other), one.max(other)]).or_insert_with(|| {
                directions.push((directions[one as usize] + directions[other as usize]).normalize());
                directions.len() as u32 - 1
            })
        };
        let divide = |[a, b, c]: [u32; 3]| {
            let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        };
        triangles = triangles.into_iter().flat_map(divide).collect();
    }
    let place = |direction: &DVec3| (centre.as_dvec3() + f64::from(radius) * *direction).as_vec3();
    (directions.iter().map(place).collect(), triangles)
}

/// The triangles of an icosahedron: three corners that are neighbours of each other, seen from outside.
fn faces(corners: &[DVec3]) -> Vec<[u32; 3]> {
    // Neighbours have cos 63.4° = 0.447 between them, the others less.
    let is_edge = |one: usize, other: usize| corners[one].dot(corners[other]) > 0.4;
    let mut faces = Vec::new();
    for a in 0..corners.len() {
        for b in a + 1..corners.len() {
            for c in b + 1..corners.len() {
                if is_edge(a, b) && is_edge(b, c) && is_edge(c, a) {
                    let is_outward = corners[a].dot(corners[b].cross(corners[c])) > 0.0;
                    let [b, c] = if is_outward { [b, c] } else { [c, b] };
                    faces.push([a as u32, b as u32, c as u32]);
                }
            }
        }
    }
    faces
}

#[cfg(test)]
mod tests {
    use super::super::weld::Welded;
    use super::*;

    #[test]
    fn it_is_closed_and_nearly_round() {
        for subdivisions in 0..4 {
            let (positions, triangles) = icosphere(Vec3::ZERO, 2.0, subdivisions);
            assert_eq!(positions.len(), 10 * 4_usize.pow(subdivisions) + 2);
            assert_eq!(triangles.len(), 20 * 4_usize.pow(subdivisions));
            let mesh = Welded::unwelded(positions, triangles);
            mesh.check_closed().expect("closed");
            let round = 32.0 / 3.0 * std::f64::consts::PI;
            assert!(mesh.volume() < round && (subdivisions < 3 || mesh.volume() > 0.98 * round));
        }
    }
}
