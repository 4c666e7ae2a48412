//! Jellies: boxes of cells, and the cells that a mesh fills.

use bevy::math::{DVec3, Vec3};

use super::inside::Voxels;
use super::lattice::{Weave, number, particles, share, springs};
use super::moduli::{Cells, Moduli};
use super::{JellyMaterial, Layout, MeshBinding, Topology};
use crate::solver::Spring;

/// Cells of a lattice, some of which are part of a jelly.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Solid {
    origin: DVec3,
    sizes: DVec3,
    counts: [u32; 3],
    /// The part of each cell that counts; 0 of those that are no part of it.
    filled: Vec<f32>,
    /// The particle at each node of the lattice, if one is there.
    particle_of: Vec<Option<u32>>,
}

/// Cells of which less is inside count as if this were: what hangs from their corners can be pulled.
const MIN_FILLED: f32 = 0.1;

const CORNERS: [[u32; 3]; 8] =
    [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1], [1, 1, 1]];

impl Solid {
    /// A whole box.
    pub fn cuboid(min: Vec3, max: Vec3, counts: [u32; 3]) -> Self {
        let sizes = (max.as_dvec3() - min.as_dvec3()) / DVec3::from_array(counts.map(f64::from));
        let filled = vec![1.0; counts.iter().map(|count| *count as usize).product()];
        Self::new(min.as_dvec3(), sizes, counts, filled)
    }

    /// The cells of which a part is filled.
    pub fn voxels(voxels: Voxels) -> Self {
        let of_cell = |part: &f32| if *part > 0.0 { part.max(MIN_FILLED) } else { 0.0 };
        let filled = voxels.filled.iter().map(of_cell).collect();
        Self::new(voxels.origin, DVec3::splat(voxels.size), voxels.counts, filled)
    }

    fn new(origin: DVec3, sizes: DVec3, counts: [u32; 3], filled: Vec<f32>) -> Self {
        let nodes = counts.iter().map(|count| *count as usize + 1).product();
        let mut solid = Self { origin, sizes, counts, filled, particle_of: vec![None; nodes] };
        for cell in solid.cells() {
            for corner in CORNERS {
                let node = solid.node(cell, corner);
                solid.particle_of[node] = Some(0);
            }
        }
        for (particle, node) in solid.particle_of.iter_mut().flatten().enumerate() {
            *node = particle as u32;
        }
        solid
    }

    /// Whether nothing of it is there.
    pub fn is_empty(&self) -> bool {
        self.particle_of.iter().all(Option::is_none)
    }

    fn index(&self, [i, j, k]: [u32; 3]) -> usize {
        let [x, y, _] = self.counts.map(|count| count as usize);
        (k as usize * y + j as usize) * x + i as usize
    }

    fn is_filled(&self, cell: [u32; 3]) -> bool {
        (0..3).all(|axis| cell[axis] < self.counts[axis]) && self.filled[self.index(cell)] > 0.0
    }

    fn node(&self, cell: [u32; 3], corner: [u32; 3]) -> usize {
        number([0, 1, 2].map(|axis| cell[axis] + corner[axis]), self.counts) as usize
    }

    fn particle(&self, cell: [u32; 3], corner: [u32; 3]) -> u32 {
        self.particle_of[self.node(cell, corner)].unwrap_or_default()
    }

    /// The cells that are part of it.
    fn cells(&self) -> Vec<[u32; 3]> {
        let [x, y, z] = self.counts;
        let all = (0..z).flat_map(|k| (0..y).flat_map(move |j| (0..x).map(move |i| [i, j, k])));
        all.filter(|cell| self.is_filled(*cell)).collect()
    }

    fn positions(&self) -> Vec<Vec3> {
        let place = |indices: [u32; 3]| {
            (self.origin + self.sizes * DVec3::from_array(indices.map(f64::from))).as_vec3()
        };
        let nodes = particles(self.counts).zip(&self.particle_of);
        nodes.filter(|(_, particle)| particle.is_some()).map(|(indices, _)| place(indices)).collect()
    }

    /// The net of a whole box.
    pub fn box_topology(&self, material: &JellyMaterial, weave: &Weave) -> Topology {
        let cells = Cells { counts: self.counts, sizes: self.sizes.to_array() };
        let modulus = f64::from(material.youngs_modulus);
        let moduli = Moduli::new(&cells, modulus, 0.4 * modulus);
        let positions = self.positions();
        let mass = f64::from(material.density) * cells.volume();
        Topology {
            masses: particles(self.counts).map(|node| (mass * share(node, self.counts)) as f32).collect(),
            springs: springs(&cells, &moduli, &positions, weave),
            triangles: self.surface(),
            layout: Layout::Lattice { cells: self.counts },
            positions,
            ..Topology::default()
        }
    }

    /// The net of cubes that are filled in part: each has its share of springs and mass by that part. The mass in
    /// all is that of `volume`, m³.
    ///
    /// Edges and diagonals of whole cubes of side h have k = 2/5 E h, shared by 4 and by 2 cubes: see
    /// [`moduli`](super::moduli).
    pub fn voxel_topology(&self, material: &JellyMaterial, volume: f64, weave: &Weave) -> Topology {
        let positions = self.positions();
        let mut masses = vec![0.0; positions.len()];
        for cell in self.cells() {
            for corner in CORNERS {
                masses[self.particle(cell, corner) as usize] += f64::from(self.filled[self.index(cell)]);
            }
        }
        let scale = f64::from(material.density) * volume / masses.iter().sum::<f64>();
        Topology {
            masses: masses.iter().map(|mass| (mass * scale) as f32).collect(),
            springs: self.voxel_springs(material, &positions, weave),
            triangles: self.surface(),
            layout: Layout::Cells,
            positions,
            ..Topology::default()
        }
    }

    fn voxel_springs(
        &self,
        material: &JellyMaterial,
        positions: &[Vec3],
        weave: &Weave,
    ) -> Vec<([u32; 2], Spring)> {
        // Of each node: the edges along the three axes, and the faces across them.
        let mut shares = vec![[0.0_f32; 6]; self.particle_of.len()];
        for cell in self.cells() {
            let part = self.filled[self.index(cell)];
            for axis in 0..3 {
                for corner in CORNERS.into_iter().filter(|corner| corner[axis] == 0) {
                    shares[self.node(cell, corner)][axis] += 0.25 * part;
                }
                let mut beyond = [0; 3];
                for side in 0..2 {
                    beyond[axis] = side;
                    shares[self.node(cell, beyond)][3 + axis] += 0.5 * part;
                }
            }
        }
        let unit = 0.4 * f64::from(material.youngs_modulus) * self.sizes.x;
        let mut springs = Vec::new();
        for (indices, shares) in particles(self.counts).zip(&shares) {
            let mut add = |from: [u32; 3], to: [u32; 3], share: f32| {
                let ends = [from, to].map(|corner| self.particle(indices, corner));
                springs.push(weave.spring(ends, positions, unit * f64::from(share)));
            };
            for axis in 0..3 {
                let [mut along, mut second, mut third] = [[0; 3]; 3];
                (along[axis], second[(axis + 1) % 3], third[(axis + 2) % 3]) = (1, 1, 1);
                let both = [0, 1, 2].map(|axis| second[axis] + third[axis]);
                if shares[axis] > 0.0 {
                    add([0; 3], along, shares[axis]);
                }
                if shares[3 + axis] > 0.0 {
                    add([0; 3], both, shares[3 + axis]);
                    add(second, third, shares[3 + axis]);
                }
            }
        }
        springs
    }

    /// The faces between cells that are part of it and others, counter-clockwise from outside.
    fn surface(&self) -> Vec<[u32; 3]> {
        let mut triangles = Vec::new();
        for cell in self.cells() {
            for axis in 0..3 {
                for side in [0, 1] {
                    let mut beside = cell;
                    beside[axis] = if side == 1 { cell[axis] + 1 } else { cell[axis].wrapping_sub(1) };
                    if self.is_filled(beside) {
                        continue;
                    }
                    let corner = |u: u32, v: u32| {
                        let mut corner = [0; 3];
                        (corner[axis], corner[(axis + 1) % 3], corner[(axis + 2) % 3]) = (side, u, v);
                        self.particle(cell, corner)
                    };
                    let [a, b, c, d] = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
                    match side {
                        1 => triangles.extend([[a, b, c], [a, c, d]]),
                        _ => triangles.extend([[a, c, b], [a, d, c]]),
                    }
                }
            }
        }
        triangles
    }

    /// Hangs vertices on the particles of the cell around each, or nearest to it.
    ///
    /// The cell is divided into six tetrahedra from its least corner to its greatest, one for each order of the local
    /// coordinates (Kuhn's triangulation): along the greatest coordinate first. With u ≥ v ≥ w the weights are 1 − u,
    /// u − v, v − w and w; across the faces of cells and tetrahedra they go on evenly.
    pub fn skin(&self, vertices: &[Vec3]) -> MeshBinding {
        MeshBinding::Skinned(vertices.iter().map(|vertex| self.hang(vertex.as_dvec3())).collect())
    }

    fn hang(&self, vertex: DVec3) -> ([u32; 4], [f32; 3]) {
        let place = ((vertex - self.origin) / self.sizes).to_array();
        let cell = self.nearest_cell(place);
        let local = [0, 1, 2].map(|axis| place[axis] - f64::from(cell[axis]));
        let mut order = [0, 1, 2];
        order.sort_by(|one, other| local[*other].total_cmp(&local[*one]));
        let mut corner = [0; 3];
        let mut particles = [self.particle(cell, corner); 4];
        for (slot, axis) in order.into_iter().enumerate() {
            corner[axis] = 1;
            particles[slot + 1] = self.particle(cell, corner);
        }
        let [u, v, w] = order.map(|axis| local[axis]);
        (particles, [1.0 - u, u - v, v - w].map(|weight| weight as f32))
    }

    fn nearest_cell(&self, place: [f64; 3]) -> [u32; 3] {
        let inside = [0, 1, 2].map(|axis| (place[axis].floor().max(0.0) as u32).min(self.counts[axis] - 1));
        if self.is_filled(inside) {
            return inside;
        }
        let distance = |cell: [u32; 3]| -> f64 {
            let beyond = |axis: usize| {
                let low = f64::from(cell[axis]);
                (low - place[axis]).max(place[axis] - low - 1.0).max(0.0) * self.sizes[axis]
            };
            (0..3).map(|axis| beyond(axis) * beyond(axis)).sum()
        };
        let furthest = self.counts.into_iter().max().unwrap_or_default();
        for reach in 1..=furthest {
            let range = |axis: usize| {
                inside[axis].saturating_sub(reach)..=(inside[axis] + reach).min(self.counts[axis] - 1)
            };
            let mut best: Option<(f64, [u32; 3])> = None;
            for k in range(2) {
                for j in range(1) {
                    for i in range(0).filter(|i| self.is_filled([*i, j, k])) {
                        let found = distance([i, j, k]);
                        if best.is_none_or(|(least, _)| found < least) {
                            best = Some((found, [i, j, k]));
                        }
                    }
                }
            }
            if let Some((_, cell)) = best {
                return cell;
            }
        }
        inside
    }
}

#[cfg(test)]
mod tests {
    use super::super::weld::Welded;
    use super::*;

    #[test]
    fn the_surface_of_a_box_is_closed_and_encloses_it() {
        let solid = Solid::cuboid(Vec3::ZERO, Vec3::new(2.0, 3.0, 4.0), [2, 3, 2]);
        let weave = Weave { retardation_time: 0.0, max_stretch: None };
        let topology = solid.box_topology(&JellyMaterial::default(), &weave);
        let mesh = Welded::unwelded(topology.positions, topology.triangles);
        mesh.check_closed().expect("closed");
        assert!((mesh.volume() - 24.0).abs() < 1e-6);
        let mass: f64 = topology.masses.iter().map(|mass| f64::from(*mass)).sum();
        let density = f64::from(JellyMaterial::default().density);
        assert!((mass / 24.0 / density - 1.0).abs() < 1e-6);
    }

    /// Of whole cubes both ways to make springs agree, but for the weights across beams, which boxes alone have.
    #[test]
    fn voxels_that_are_full_have_the_springs_of_a_box() {
        let solid = Solid::cuboid(Vec3::ZERO, Vec3::splat(3.0), [1, 1, 1]);
        let weave = Weave { retardation_time: 0.1, max_stretch: None };
        let material = JellyMaterial::default();
        let sorted = |topology: Topology| {
            let mut springs: Vec<_> = topology
                .springs
                .iter()
                .map(|(ends, spring)| ([ends[0].min(ends[1]), ends[0].max(ends[1])], spring.stiffness))
                .collect();
            springs.sort_by_key(|(ends, _)| *ends);
            springs
        };
        let whole = sorted(solid.box_topology(&material, &weave));
        let cubes = sorted(solid.voxel_topology(&material, 27.0, &weave));
        assert_eq!((whole.len(), cubes.len()), (12 + 12, 24));
        for (one, other) in whole.iter().zip(&cubes) {
            assert_eq!(one.0, other.0);
            assert!((one.1 / other.1 - 1.0).abs() < 1e-6, "{one:?} {other:?}");
        }
    }

    /// Linear weights give a place back: vertices are where they were.
    #[test]
    fn a_skin_at_rest_is_where_it_was() {
        let mut solid = Solid::cuboid(Vec3::splat(-1.0), Vec3::splat(1.0), [4, 5, 3]);
        for cell in [[1, 1, 1], [0, 0, 0], [3, 4, 2], [3, 4, 1]] {
            let index = solid.index(cell);
            solid.filled[index] = 0.0;
        }
        let solid = Solid::new(solid.origin, solid.sizes, solid.counts, solid.filled);
        let positions = solid.positions();
        let vertices: Vec<Vec3> = (0..500_u16)
            .map(|index| {
                Vec3::new(f32::from(index % 11), f32::from(index % 7), f32::from(index % 13)) * 0.2 - 1.1
            })
            .collect();
        let MeshBinding::Skinned(skin) = solid.skin(&vertices) else { panic!("a skin") };
        for (vertex, (particles, [a, b, c])) in vertices.iter().zip(skin) {
            let weights = [a, b, c, 1.0 - a - b - c];
            let place: Vec3 = particles
                .iter()
                .zip(weights)
                .map(|(particle, weight)| positions[*particle as usize] * weight)
                .sum();
            assert!(place.distance(*vertex) < 1e-5, "{vertex} {place}");
        }
    }
}
