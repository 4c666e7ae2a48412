//! An approximate inverse of the core's matrix: on each level of coarsening, the inverted blocks.
//!
//! z = Σ over the levels Pₗ Dₗ⁻¹ Pₗᵀ r, where Pₗ moves all nodes of a group alike and Dₗ are the 3×3
//! diagonal blocks of Pₗᵀ H Pₗ. The finest level alone (block Jacobi) lets a force reach one neighbour
//! further in each iteration of conjugate gradients; with the coarser ones it reaches every node at once.
//! (Bramble, Pasciak and Xu, *Math. Comp.* 55, 1, 1990; with groups, for cloth: Wu, Wang and Wang,
//! *A GPU-based multilevel additive Schwarz preconditioner for cloth and deformable body simulation*,
//! 2022.)

use bevy::math::DVec3;

use super::block::{Factor, Symmetric};
use super::core::{get, set, thirds, thirds_mut};
use super::system::System;
use crate::solver::elements::MAX_ENDS;
use crate::solver::graph::Elimination;
use crate::solver::graph::Hierarchy;

#[derive(Debug, Clone, Default)]
pub(super) struct Preconditioner {
    finest: Factors,
    coarse: Vec<CoarseLevel>,
    /// Working space: the blocks that are to be inverted.
    blocks: Vec<Symmetric>,
    /// Working space: where the ends of each element of more than two ends are on the level at hand.
    members: Vec<Members>,
}

/// The members of a level in which an element has ends, and the sums of its weights there.
#[derive(Debug, Clone, Copy, Default)]
struct Members {
    ends: [(usize, f64); MAX_ENDS],
    count: usize,
}

impl Members {
    fn of(ends: impl Iterator<Item = (usize, f64)>) -> Self {
        let mut members = Self::default();
        for (member, weight) in ends {
            members.add(member, weight);
        }
        members
    }

    fn add(&mut self, member: usize, weight: f64) {
        match self.ends[..self.count].iter_mut().find(|(other, _)| *other == member) {
            Some((_, sum)) => *sum += weight,
            None => {
                self.ends[self.count] = (member, weight);
                self.count += 1;
            }
        }
    }

    fn ends(&self) -> impl Iterator<Item = (usize, f64)> {
        self.ends[..self.count].iter().copied()
    }
}

/// The factored blocks of the nodes, see [`Factor`], rounded to f32: a product of factors stays positive.
#[derive(Debug, Clone, Default)]
struct Factors([Vec<f32>; 6]);

impl Factors {
    fn fill(&mut self, factors: impl Iterator<Item = Factor>) {
        for entries in &mut self.0 {
            entries.clear();
        }
        for factor in factors {
            for (entries, entry) in self.0.iter_mut().zip(factor.entries()) {
                entries.push(entry as f32);
            }
        }
    }

    /// `result` = inverted blocks · `vector`; see [`Factor::solve`].
    #[inline(always)]
    fn solve(&self, vector: &[f64], result: &mut [f64]) {
        let count = self.0[0].len();
        let [yx, zx, zy, inverse_x, inverse_y, inverse_z] =
            self.0.each_ref().map(|entries| &entries[..count]);
        let [x, y, z] = thirds(vector, count);
        let [result_x, result_y, result_z] = thirds_mut(result, count);
        for node in 0..count {
            let (yx, zx, zy) = (f64::from(yx[node]), f64::from(zx[node]), f64::from(zy[node]));
            let y = y[node] - yx * x[node];
            let z = (z[node] - zx * x[node] - zy * y) * f64::from(inverse_z[node]);
            let y = y * f64::from(inverse_y[node]) - zy * z;
            result_x[node] = x[node] * f64::from(inverse_x[node]) - yx * y - zx * z;
            result_y[node] = y;
            result_z[node] = z;
        }
    }
}

#[derive(Debug, Clone, Default)]
struct CoarseLevel {
    inertia: Vec<f64>,
    own: Vec<Symmetric>,
    inverse: Vec<Symmetric>,
    vector: Vec<DVec3>,
}

impl Preconditioner {
    /// Takes the blocks from `system`.
    pub fn fill(&mut self, system: &System, elimination: &Elimination) {
        let nodes = elimination.trees..elimination.free;
        let inertia = &system.inertia[nodes.clone()];
        let own = &system.diagonal[nodes];
        self.blocks.clear();
        self.blocks.extend(own.iter().zip(inertia).map(|(own, inertia)| own.plus_diagonal(*inertia)));
        let mut link = 0;
        for run in &elimination.runs {
            for place in 0..run.count {
                let block = system.links[link].block();
                self.blocks[run.first + place] += block;
                self.blocks[run.second + place] += block;
                link += 1;
            }
        }
        let compounds = &system.compounds[elimination.tree_compounds..];
        for compound in compounds {
            for (node, weight) in compound.core_ends(elimination) {
                self.blocks[node] += compound.block.scaled(weight * weight);
            }
        }
        self.finest.fill(self.blocks.iter().zip(inertia).map(|(block, inertia)| block.factor(*inertia)));
        self.fill_coarse(system, elimination);
    }

    fn fill_coarse(&mut self, system: &System, elimination: &Elimination) {
        let nodes = elimination.trees..elimination.free;
        let compounds = &system.compounds[elimination.tree_compounds..];
        let (mut finer_inertia, mut finer_own) = (&system.inertia[nodes.clone()], &system.diagonal[nodes]);
        self.coarse.resize_with(elimination.hierarchy.levels.len(), CoarseLevel::default);
        self.members.clear();
        self.members.extend(compounds.iter().map(|compound| Members::of(compound.core_ends(elimination))));
        for (level, coarse) in elimination.hierarchy.levels.iter().zip(&mut self.coarse) {
            coarse.inertia.clear();
            coarse.inertia.resize(level.count, 0.0);
            coarse.own.clear();
            coarse.own.resize(level.count, Symmetric::default());
            for (member, group) in level.groups.iter().enumerate() {
                coarse.inertia[*group as usize] += finer_inertia[member];
                coarse.own[*group as usize] += finer_own[member];
            }
            self.blocks.clear();
            self.blocks.extend(
                coarse.own.iter().zip(&coarse.inertia).map(|(own, inertia)| own.plus_diagonal(*inertia)),
            );
            for &(link, ends) in &level.crossings {
                let block = system.links[link as usize].block();
                for end in ends {
                    self.blocks[end as usize] += block;
                }
            }
            for (compound, members) in compounds.iter().zip(&mut self.members) {
                *members = Members::of(
                    members.ends().map(|(member, weight)| (level.groups[member] as usize, weight)),
                );
                for (group, weight) in members.ends() {
                    self.blocks[group] += compound.block.scaled(weight * weight);
                }
            }
            coarse.inverse.clear();
            coarse.inverse.extend(
                self.blocks
                    .iter()
                    .zip(&coarse.inertia)
                    .map(|(block, inertia)| block.factor(*inertia).inverse()),
            );
            (finer_inertia, finer_own) = (&coarse.inertia, &coarse.own);
        }
    }

    /// `result` = approximate inverse · `vector`.
    #[inline(always)]
    pub fn apply(&mut self, hierarchy: &Hierarchy, vector: &[f64], result: &mut [f64]) {
        self.finest.solve(vector, result);
        let levels = &hierarchy.levels;
        let Some(first) = levels.first() else { return };
        let sums = &mut self.coarse[0].vector;
        sums.clear();
        sums.resize(first.count, DVec3::ZERO);
        for (node, group) in first.groups.iter().enumerate() {
            sums[*group as usize] += get(vector, node);
        }
        for index in 1..levels.len() {
            let (finer, coarser) = self.coarse.split_at_mut(index);
            let sums = &mut coarser[0].vector;
            sums.clear();
            sums.resize(levels[index].count, DVec3::ZERO);
            for (sum, group) in finer[index - 1].vector.iter().zip(&levels[index].groups) {
                sums[*group as usize] += *sum;
            }
        }
        for index in (0..levels.len()).rev() {
            let (coarse, coarser) = self.coarse.split_at_mut(index + 1);
            let CoarseLevel { inverse, vector, .. } = &mut coarse[index];
            for (value, inverse) in vector.iter_mut().zip(inverse) {
                *value = inverse.times(*value);
            }
            if let Some(coarser) = coarser.first() {
                for (value, group) in vector.iter_mut().zip(&levels[index + 1].groups) {
                    *value += coarser.vector[*group as usize];
                }
            }
        }
        let corrections = &self.coarse[0].vector;
        for (node, group) in first.groups.iter().enumerate() {
            let value = get(result, node) + corrections[*group as usize];
            set(result, node, value);
        }
    }
}
