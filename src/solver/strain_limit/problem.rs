//! The impulses of a group, one for each of its springs, and what they do to its nodes.

use bevy::math::DVec3;

use super::tree::Tree;
use super::{LOOP_TOLERANCE, TREE_TOLERANCE};
use crate::solver::graph::LimitGroup;
use crate::solver::particles::Particles;

/// Maximal number of projections of a group without loops.
const MAX_PROJECTIONS: usize = 24;

/// Maximal number of sweeps over the springs of a group with loops.
const MAX_SWEEPS: usize = 400;

/// How far a spring may turn from the direction of its impulse, as a cosine.
const MIN_COSINE: f64 = 0.9;

/// The factor of over-relaxation.
const RELAXATION: f64 = 1.6;

/// A spring of the group.
#[derive(Debug, Clone, Copy)]
pub(super) struct Link {
    /// The outer node and the inner one.
    pub nodes: [usize; 2],
    /// Its largest length, m.
    pub limit: f64,
    /// The largest length that is asked for now, m.
    pub bound: f64,
    /// The direction of its impulse on the inner node, towards the outer one.
    pub along: DVec3,
    /// Whether it keeps this direction, as long as it is about the present one.
    pub keeps_direction: bool,
    /// That impulse, >= 0: kg·m for positions, N·s for velocities.
    pub impulse: f64,
}

/// What is limited.
#[derive(Clone, Copy, PartialEq)]
enum Quantity {
    /// Lengths.
    Positions,
    /// Their rates.
    Velocities,
}

/// The problem of one group after the other: working memory.
#[derive(Debug, Clone, Default)]
pub(super) struct Problem {
    pub links: Vec<Link>,
    /// The error that is left, as a part of the limit.
    pub tolerance: f64,
    has_loops: bool,
    /// 1/mass of each node, 1/kg.
    inverse_mass: Vec<f64>,
    /// The change of each node.
    change: Vec<DVec3>,
    tree: Tree,
}

impl Link {
    /// How far it is above its bound, measured along its impulse. Its impulse goes on in the present direction if that
    /// has turned far from where it was.
    #[inline]
    fn gap(&mut self, values: &[DVec3], quantity: Quantity) -> f64 {
        let difference = values[self.nodes[0]] - values[self.nodes[1]];
        if quantity == Quantity::Velocities {
            return self.along.dot(difference);
        }
        let length = difference.length();
        let along = self.along.dot(difference);
        let reach = self.bound * self.bound - (length * length - along * along);
        if self.keeps_direction && along >= MIN_COSINE * length && reach > 0.0 {
            return along - reach.sqrt();
        }
        self.along = if length > 0.0 { difference / length } else { self.along };
        length - self.bound
    }
}

impl Problem {
    /// To be called before the problems of a group.
    pub fn begin(&mut self, group: &LimitGroup, particles: &Particles) {
        self.has_loops = group.has_loops;
        self.tolerance = if group.has_loops { LOOP_TOLERANCE } else { TREE_TOLERANCE };
        self.inverse_mass.clear();
        let inverse_mass = particles.inverse_mass();
        self.inverse_mass.extend(group.slots.iter().map(|slot| f64::from(inverse_mass[*slot as usize])));
        self.tree.resize(group.free, group.links.len());
    }

    /// Whether the limits close a loop; if not, the links go outwards from the root.
    pub fn has_loops(&self) -> bool {
        self.has_loops
    }

    /// What the impulses of the last problem have changed of a node.
    pub fn change(&self, node: usize) -> DVec3 {
        self.change[node]
    }

    /// Brings all lengths to their bounds; returns whether they are there.
    pub fn solve_positions(&mut self, position: &mut [DVec3]) -> bool {
        self.solve(position, Quantity::Positions, 1.0)
    }

    /// Brings all rates of lengths to 0, in steps of `h` seconds.
    pub fn solve_velocities(&mut self, velocity: &mut [DVec3], h: f64) {
        self.solve(velocity, Quantity::Velocities, 1.0 / h);
    }

    /// `unit` is that of the gaps, in lengths.
    fn solve(&mut self, values: &mut [DVec3], quantity: Quantity, unit: f64) -> bool {
        self.change.clear();
        self.change.resize(values.len(), DVec3::ZERO);
        (!self.has_loops && self.solve_directly(values, quantity, unit)) || self.relax(values, quantity, unit)
    }

    /// The kinetic energy of the free nodes, J.
    pub fn kinetic_energy(&self, velocity: &[DVec3]) -> f64 {
        let nodes = velocity.iter().zip(&self.inverse_mass).filter(|(_, inverse)| **inverse > 0.0);
        nodes.map(|(velocity, inverse)| 0.5 * velocity.length_squared() / inverse).sum()
    }

    /// Projects onto the half-spaces that the bounds are, linearised, until all are kept. These contain all that keeps
    /// the bounds, so each projection comes nearer to that, and none asks for more energy. Returns whether all are
    /// kept.
    fn solve_directly(&mut self, values: &mut [DVec3], quantity: Quantity, unit: f64) -> bool {
        for _ in 0..MAX_PROJECTIONS {
            let mut is_solved = true;
            for (link, row) in self.links.iter_mut().zip(&mut self.tree.rows) {
                let gap = link.gap(values, quantity);
                (row.is_active, row.gap) = (gap > 0.0, gap);
                is_solved &= gap <= self.tolerance * link.limit * unit;
            }
            if is_solved {
                return true;
            }
            self.tree.solve(&self.links, &self.inverse_mass);
            for (link, row) in self.links.iter().zip(&self.tree.rows) {
                if row.is_active && row.impulse > 0.0 {
                    let [outer, inner] = link.nodes;
                    let impulse = link.along * row.impulse;
                    push(values, &mut self.change, outer, impulse * -self.inverse_mass[outer]);
                    push(values, &mut self.change, inner, impulse * self.inverse_mass[inner]);
                }
            }
        }
        false
    }

    /// Sweeps over the springs outwards and back, one after the other. Returns whether all bounds are kept.
    fn relax(&mut self, values: &mut [DVec3], quantity: Quantity, unit: f64) -> bool {
        for sweep in 0..MAX_SWEEPS {
            let mut worst = 0.0_f64;
            for index in 0..self.links.len() {
                let index = if sweep % 2 == 0 { index } else { self.links.len() - 1 - index };
                let link = &mut self.links[index];
                let gap = link.gap(values, quantity);
                if gap <= 0.0 && link.impulse == 0.0 {
                    continue;
                }
                worst = worst.max(gap / (link.limit * unit));
                let [outer, inner] = link.nodes;
                let mobility = self.inverse_mass[outer] + self.inverse_mass[inner];
                let impulse = (link.impulse + RELAXATION * gap / mobility).max(0.0);
                let change = link.along * (impulse - link.impulse);
                link.impulse = impulse;
                push(values, &mut self.change, outer, change * -self.inverse_mass[outer]);
                push(values, &mut self.change, inner, change * self.inverse_mass[inner]);
            }
            // What came first in the sweep may have been pulled at since.
            if worst <= self.tolerance && self.worst(values, quantity, unit) <= 2.0 * self.tolerance {
                return true;
            }
        }
        false
    }

    /// How far the worst spring is above its bound, as a part of its limit.
    fn worst(&mut self, values: &[DVec3], quantity: Quantity, unit: f64) -> f64 {
        let gaps = self.links.iter_mut().map(|link| link.gap(values, quantity) / (link.limit * unit));
        gaps.fold(0.0, f64::max)
    }

    /// How far the worst spring is above its bound, as a part of its limit.
    pub fn worst_length(&mut self, position: &[DVec3]) -> f64 {
        self.worst(position, Quantity::Positions, 1.0)
    }
}

fn push(values: &mut [DVec3], changes: &mut [DVec3], node: usize, change: DVec3) {
    values[node] += change;
    changes[node] += change;
}
