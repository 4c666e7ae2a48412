//! The linear problem of a group without loops, solved directly from its leaves to its root and back.
//!
//! Node i changes by uᵢ = wᵢ (Σ impulses), w = 1/m; a spring above its bound by g, with the impulse λ in the direction
//! d, asks for g + d·(u_outer − u_inner) = α λ. The small compliance α leaves what is impossible (both ends
//! pinned too far apart) finite; its error is gone after another projection. Seen from its inner node, all that hangs on the outer end of a spring is one
//! number, what it yields to λ.

use bevy::math::{DMat3, DVec3};

use super::problem::Link;

/// The compliance α, as a part of the inverse masses of the ends.
const COMPLIANCE: f64 = 1e-6;

/// Maximal number of sets of active springs that are tried.
const MAX_ACTIVE_SETS: usize = 10;

/// What is known of a spring in one step.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Row {
    /// Whether it takes part.
    pub is_active: bool,
    /// How far it is above its bound.
    pub gap: f64,
    /// Its impulse.
    pub impulse: f64,
    /// λ = (`force` − d·u_inner) · `mobility`⁻¹, and u_outer = `own` − λ · `response`.
    force: f64,
    mobility: f64,
    response: DVec3,
}

/// Working memory.
#[derive(Debug, Clone, Default)]
pub(super) struct Tree {
    pub rows: Vec<Row>,
    /// For each node: `matrix` · u = w · (impulse from its inner spring) + `right`.
    matrix: Vec<DMat3>,
    right: Vec<DVec3>,
    /// u; on the way to the root, u without an impulse from the inner spring.
    change: Vec<DVec3>,
}

impl Tree {
    /// Makes it one of `free` nodes and `links` springs.
    pub fn resize(&mut self, free: usize, links: usize) {
        self.rows.resize(links, Row::default());
        self.matrix.resize(free, DMat3::IDENTITY);
        self.right.resize(free, DVec3::ZERO);
        self.change.resize(free, DVec3::ZERO);
    }

    /// The impulses that bring the active springs to their bounds, and others not above theirs: springs that would
    /// push are left out, those that would come to be above their bounds are taken in, and all is solved again.
    /// (Hintermüller, Ito and Kunisch, *SIAM J. Optim.* 13, 865, 2002.)
    pub fn solve(&mut self, links: &[Link], inverse_mass: &[f64]) {
        for round in 0..2 * MAX_ACTIVE_SETS {
            self.step(links, inverse_mass);
            let mut is_settled = true;
            for (link, row) in links.iter().zip(&mut self.rows) {
                let change = |node: usize| self.change.get(node).copied().unwrap_or_default();
                let gap = row.gap + link.along.dot(change(link.nodes[0]) - change(link.nodes[1]));
                // Late ones are left to the next projection, so that this comes to an end.
                let joins = gap > 0.0 && round < MAX_ACTIVE_SETS;
                let is_active = if row.is_active { row.impulse > 0.0 } else { joins };
                is_settled &= row.is_active == is_active;
                row.is_active = is_active;
            }
            if is_settled {
                return;
            }
        }
    }

    /// The impulses that bring all active springs to their bounds. The links are sorted by their outer nodes; that
    /// to a free inner node is the first one of each.
    fn step(&mut self, links: &[Link], inverse_mass: &[f64]) {
        let free = self.matrix.len();
        self.matrix.fill(DMat3::IDENTITY);
        self.right.fill(DVec3::ZERO);
        let mut end = links.len();
        for node in (0..free).rev() {
            let mut first = end;
            while first > 0 && links[first - 1].nodes[0] == node {
                first -= 1;
            }
            for index in (first..end).rev() {
                let (link, row) = (&links[index], &mut self.rows[index]);
                if row.is_active && link.nodes[1] >= free {
                    row.mobility = compliance(link, inverse_mass);
                    row.force = row.gap;
                    let push = link.along * (inverse_mass[node] / row.mobility);
                    self.matrix[node] += outer_product(push, link.along);
                    self.right[node] -= push * row.force;
                }
            }
            let inverse = self.matrix[node].inverse();
            self.change[node] = inverse * self.right[node];
            if first < end && links[first].nodes[1] < free && self.rows[first].is_active {
                self.pass_inwards(&links[first], first, inverse * inverse_mass[node], inverse_mass);
            }
            end = first;
        }
        self.pass_outwards(links, free);
    }

    /// Adds what hangs on the outer end of a spring to its inner node.
    fn pass_inwards(&mut self, link: &Link, index: usize, mobility: DMat3, inverse_mass: &[f64]) {
        let row = &mut self.rows[index];
        let [outer, inner] = link.nodes;
        let compliance = compliance(link, inverse_mass);
        row.response = mobility * link.along;
        row.mobility = link.along.dot(row.response).max(0.0) + compliance;
        row.force = row.gap + link.along.dot(self.change[outer]);
        let push = link.along * (inverse_mass[inner] / row.mobility);
        self.matrix[inner] += outer_product(push, link.along);
        self.right[inner] += push * row.force;
    }

    fn pass_outwards(&mut self, links: &[Link], free: usize) {
        for (link, row) in links.iter().zip(&mut self.rows).filter(|(_, row)| row.is_active) {
            let [outer, inner] = link.nodes;
            if inner >= free {
                row.impulse = (row.force + link.along.dot(self.change[outer])) / row.mobility;
            } else {
                row.impulse = (row.force - link.along.dot(self.change[inner])) / row.mobility;
                self.change[outer] -= row.response * row.impulse;
            }
        }
    }
}

fn compliance(link: &Link, inverse_mass: &[f64]) -> f64 {
    COMPLIANCE * (inverse_mass[link.nodes[0]] + inverse_mass[link.nodes[1]])
}

/// `column` · `row`ᵀ.
fn outer_product(column: DVec3, row: DVec3) -> DMat3 {
    DMat3::from_cols(column * row.x, column * row.y, column * row.z)
}
