//! The springs and bends of a triangle mesh.

use bevy::math::DVec3;

use super::lattice::Weave;
use super::weld::{Side, Welded};
use super::{Layout, Topology};
use crate::solver::Bend;

/// What a mesh is covered with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Skin {
    pub area_density: f32,
    pub stretch_stiffness: f32,
    pub bending_stiffness: f32,
}

/// The net of a mesh: a spring along each edge and, if it resists bending, a bend about each edge of two triangles.
/// Each particle has a third of the mass of the triangles around it.
///
/// **Stretch** (Van Gelder, *Approximate simulation of elastic membranes by triangulated spring meshes*, 1998): a
/// spring along an edge of length l has k = K Σ A / l², of the areas A of its triangles. Of equilateral triangles
/// three directions n with k = K A / l² each make C₁₁ = 9/8 K and C₁₂ = C₆₆ = 3/8 K, which is the isotropic sheet
/// with Poisson's ratio 1/3 that shows K, exactly (Lloyd, Székely and Harders, *Identification of spring parameters
/// for deformable object simulation*, 2007). No springs along the edges of a mesh of other triangles do so; those of
/// right-angled ones with diagonals both ways are stiffer by a fifth along the legs.
///
/// **Bending** (Bergou, Wardetzky, Harmon, Zorin and Grinspun, *A quadratic bending model for inextensible
/// surfaces*, 2006): the bend about an edge e has the vector s = Σ cᵢ xᵢ, which is the sum of the normals of the
/// edge in the planes of its two triangles, each as long as the edge: ‖s‖ = ‖e‖ · 2 sin(θ/2) for the dihedral angle
/// θ. With the energy ½ k ‖s‖², k = c D / (A₀ + A₁), a mesh of equilateral triangles under the curvatures κ₁ = H + d
/// and κ₂ = H − d has ½ c D · 4/3 (H² + 2 d²) per area. A strip with free sides takes the κ₂ of least energy, d =
/// κ₁/3, and has ½ c D · 8/9 κ₁²: c = 9/8. Meshes that are curved at rest keep ‖s‖ at rest.
pub(super) fn topology(mesh: &Welded, skin: &Skin, weave: &Weave) -> Topology {
    let areas: Vec<f64> = mesh.triangles.iter().map(|corners| area(places(mesh, *corners))).collect();
    let mut masses = vec![0.0; mesh.positions.len()];
    for (corners, area) in mesh.triangles.iter().zip(&areas) {
        for corner in corners {
            masses[*corner as usize] += f64::from(skin.area_density) * area / 3.0;
        }
    }
    let (mut springs, mut hinges) = (Vec::new(), Vec::new());
    let sides = mesh.sides();
    for edge in sides.chunk_by(|one, other| one.ends == other.ends) {
        let area: f64 = edge.iter().map(|side| areas[side.triangle as usize]).sum();
        let [start, end] = edge[0].ends.map(|end| mesh.positions[end as usize].as_dvec3());
        let stiffness = f64::from(skin.stretch_stiffness) * area / start.distance_squared(end);
        springs.push(weave.spring(edge[0].ends, &mesh.positions, stiffness));
        if let [one, other] = edge
            && skin.bending_stiffness > 0.0
            && one.apex != other.apex
        {
            hinges.push(hinge(mesh, [one, other], 1.125 * f64::from(skin.bending_stiffness) / area, weave));
        }
    }
    Topology {
        positions: mesh.positions.clone(),
        masses: masses.iter().map(|mass| *mass as f32).collect(),
        springs,
        hinges,
        triangles: mesh.triangles.clone(),
        layout: Layout::Free,
        ..Topology::default()
    }
}

fn places(mesh: &Welded, corners: [u32; 3]) -> [DVec3; 3] {
    corners.map(|corner| mesh.positions[corner as usize].as_dvec3())
}

fn area([a, b, c]: [DVec3; 3]) -> f64 {
    0.5 * (b - a).cross(c - a).length()
}

fn hinge(mesh: &Welded, sides: [&Side; 2], stiffness: f64, weave: &Weave) -> ([u32; 4], Bend<4>) {
    let [start, end] = sides[0].ends;
    let ends = [start, end, sides[0].apex, sides[1].apex];
    let [x0, x1, x2, x3] = ends.map(|end| mesh.positions[end as usize].as_dvec3());
    let edge = x1 - x0;
    let mut weights = [0.0; 4];
    for (slot, apex) in [(2, x2), (3, x3)] {
        let along = (apex - x0).dot(edge) / edge.length_squared();
        let slope = edge.length() / (apex - x0 - along * edge).length();
        weights[slot] = slope;
        weights[0] -= slope * (1.0 - along);
        weights[1] -= slope * along;
    }
    let separation: DVec3 = [x0, x1, x2, x3].iter().zip(weights).map(|(place, weight)| *place * weight).sum();
    // What is flat but for the rounding of its places is flat.
    let rounding = 1e-6 * weights.iter().map(|weight| weight.abs()).sum::<f64>() * edge.length();
    let rest_length = if separation.length() > rounding { separation.length() as f32 } else { 0.0 };
    let weights = rounded(weights);
    let damping = (stiffness * f64::from(weave.retardation_time)) as f32;
    (ends, Bend { rest_length, stiffness: stiffness as f32, damping, weights })
}

/// The weights as multiples of a power of two so large that their sum is 0 without rounding: a bend far from the
/// origin exerts no force.
fn rounded(weights: [f64; 4]) -> [f32; 4] {
    let largest = weights.iter().fold(0.0_f64, |largest, weight| largest.max(weight.abs()));
    const EXPONENT: u64 = 0x7ff0_0000_0000_0000;
    let unit = f64::from_bits(largest.to_bits() & EXPONENT) / f64::from(1_u32 << 20);
    let mut rounded = weights.map(|weight| (weight / unit).round() * unit);
    rounded[1] = -(rounded[0] + rounded[2] + rounded[3]);
    rounded.map(|weight| weight as f32)
}
