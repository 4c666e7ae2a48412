//! The linear system of the core, as arrays that vector instructions run along.
//!
//! A vector has the x of all nodes, then the y, then the z. The matrix exists as its elements only.

use bevy::math::{DMat3, DVec3};

use super::block::Symmetric;
use super::gas::CoreGases;
use super::system::System;
use crate::solver::elements::MAX_ENDS;
use crate::solver::graph::{Elimination, NodeRun};

/// The matrix of the core: inertia, a block for some nodes, the links, the compounds, and what eliminated nodes left.
///
/// What the links weigh is rounded to f32: that changes the matrix a little, not that it is symmetric
/// and positive, and halves what each iteration of conjugate gradients reads.
#[derive(Debug, Clone, Default)]
pub(super) struct Core {
    inertia: Vec<f64>,
    /// The blocks of nodes that carry a tree or hang on a pinned particle.
    blocks: Vec<(u32, Symmetric)>,
    /// Each link couples its ends by `across` I + `along` `along`ᵀ.
    along: [Vec<f32>; 3],
    across: Vec<f32>,
    compounds: Vec<CoreCompound>,
    /// The blocks between nodes that eliminated ones have joined; the first node is the row.
    fills: Vec<([usize; 2], DMat3)>,
    gases: CoreGases,
}

/// An element that couples more than two nodes.
#[derive(Debug, Clone, Copy)]
struct CoreCompound {
    /// The nodes of the first `count` ends, and their weights.
    ends: [(usize, f64); MAX_ENDS],
    count: usize,
    block: Symmetric,
}

/// The x, the y and the z of a vector.
#[inline(always)]
pub(super) fn thirds(vector: &[f64], count: usize) -> [&[f64]; 3] {
    [&vector[..count], &vector[count..2 * count], &vector[2 * count..3 * count]]
}

#[inline(always)]
pub(super) fn thirds_mut(vector: &mut [f64], count: usize) -> [&mut [f64]; 3] {
    let (x, rest) = vector.split_at_mut(count);
    let (y, z) = rest.split_at_mut(count);
    [x, y, &mut z[..count]]
}

/// Links that are computed before their ends are written.
const CHUNK: usize = 64;

impl Core {
    /// Takes the blocks of the core from `system`.
    pub fn fill(&mut self, system: &System, elimination: &Elimination) {
        let nodes = elimination.trees..elimination.free;
        self.inertia.clear();
        self.inertia.extend_from_slice(&system.inertia[nodes.clone()]);
        self.blocks.clear();
        self.blocks.extend(
            (0..)
                .zip(&system.diagonal[nodes])
                .filter(|(_, block)| **block != Symmetric::default())
                .map(|(node, block)| (node, *block)),
        );
        let [x, y, z] = &mut self.along;
        for entries in [&mut *x, &mut *y, &mut *z, &mut self.across] {
            entries.clear();
        }
        for link in &system.links {
            let along = link.direction * (link.along - link.across).sqrt();
            x.push(along.x as f32);
            y.push(along.y as f32);
            z.push(along.z as f32);
            self.across.push((link.across as f32).min(f32::MAX));
        }
        self.gases.fill(&system.gases, elimination);
        self.compounds.clear();
        self.compounds.extend(system.compounds[elimination.tree_compounds..].iter().map(|compound| {
            let (mut ends, mut count) = ([(0, 0.0); MAX_ENDS], 0);
            for end in compound.core_ends(elimination) {
                ends[count] = end;
                count += 1;
            }
            CoreCompound { ends, count, block: compound.block }
        }));
        self.fills.clear();
        let pairs = elimination.fills.iter().map(|pair| pair.map(|node| node as usize));
        self.fills.extend(pairs.zip(system.wide.fills.iter().copied()));
    }

    /// `product` = matrix · `vector`.
    #[inline(always)]
    pub fn multiply(&self, runs: &[NodeRun], vector: &[f64], product: &mut [f64]) {
        let nodes = self.inertia.len();
        let [x, y, z] = thirds(vector, nodes);
        let mut product = thirds_mut(product, nodes);
        for (product, vector) in product.iter_mut().zip([x, y, z]) {
            for (product, (vector, inertia)) in product.iter_mut().zip(vector.iter().zip(&self.inertia)) {
                *product = inertia * vector;
            }
        }
        for (node, block) in &self.blocks {
            let node = *node as usize;
            let force = block.times(DVec3::new(x[node], y[node], z[node]));
            product[0][node] += force.x;
            product[1][node] += force.y;
            product[2][node] += force.z;
        }
        let mut start = 0;
        for run in runs {
            let mut done = 0;
            while done < run.count {
                let count = CHUNK.min(run.count - done);
                let (first, second, link) = (run.first + done, run.second + done, start + done);
                let mut pulls = [[0.0; CHUNK]; 3];
                let [pull_x, pull_y, pull_z] = pulls.each_mut().map(|pull| &mut pull[..count]);
                let (x1, y1, z1) =
                    (&x[first..first + count], &y[first..first + count], &z[first..first + count]);
                let (x2, y2, z2) =
                    (&x[second..second + count], &y[second..second + count], &z[second..second + count]);
                let [along_x, along_y, along_z] =
                    self.along.each_ref().map(|entries| &entries[link..link + count]);
                let across = &self.across[link..link + count];
                for place in 0..count {
                    let (dx, dy, dz) = (x1[place] - x2[place], y1[place] - y2[place], z1[place] - z2[place]);
                    let across = f64::from(across[place]);
                    let (ax, ay, az) =
                        (f64::from(along_x[place]), f64::from(along_y[place]), f64::from(along_z[place]));
                    let share = ax * dx + ay * dy + az * dz;
                    pull_x[place] = across * dx + ax * share;
                    pull_y[place] = across * dy + ay * share;
                    pull_z[place] = across * dz + az * share;
                }
                for (product, pull) in product.iter_mut().zip(&pulls) {
                    for (product, pull) in product[first..first + count].iter_mut().zip(pull) {
                        *product += pull;
                    }
                    for (product, pull) in product[second..second + count].iter_mut().zip(pull) {
                        *product -= pull;
                    }
                }
                done += count;
            }
            start += run.count;
        }
        for CoreCompound { ends, count, block } in &self.compounds {
            let ends = &ends[..*count];
            let vector = |node: usize| DVec3::new(x[node], y[node], z[node]);
            let force = block.times(ends.iter().map(|(node, weight)| vector(*node) * *weight).sum());
            for (node, weight) in ends {
                for (product, force) in product.iter_mut().zip(force.to_array()) {
                    product[*node] += weight * force;
                }
            }
        }
        for &([first, second], fill) in &self.fills {
            let vector = |node: usize| DVec3::new(x[node], y[node], z[node]);
            let forces = [(first, fill * vector(second)), (second, fill.transpose() * vector(first))];
            for (node, force) in forces {
                for (product, force) in product.iter_mut().zip(force.to_array()) {
                    product[node] += force;
                }
            }
        }
        self.gases.add_product([x, y, z], &mut product);
    }
}

/// The vector in place `node`.
#[inline(always)]
pub(super) fn get(vector: &[f64], node: usize) -> DVec3 {
    let count = vector.len() / 3;
    DVec3::new(vector[node], vector[count + node], vector[2 * count + node])
}

#[inline(always)]
pub(super) fn set(vector: &mut [f64], node: usize, value: DVec3) {
    let count = vector.len() / 3;
    vector[node] = value.x;
    vector[count + node] = value.y;
    vector[2 * count + node] = value.z;
}
