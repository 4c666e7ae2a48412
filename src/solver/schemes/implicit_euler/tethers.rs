//! What air does across filaments, during a step of backward Euler.
//!
//! With D the force D (u − v') is that of a spring which is 0 long at rest, with the matrix of stiffness D/h, from the node
//! to where the air is after the step that began with the node: v' = (x' − x)/h.

use bevy::math::DVec3;

use super::block::Symmetric;
use crate::solver::field::Field;

/// A spring to the air.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tether {
    pub node: usize,
    /// D/h, N/m.
    stiffness: Symmetric,
    /// x + h u, m.
    place: DVec3,
}

impl Tether {
    /// Its force on the node there, N.
    pub fn force(&self, position: &[DVec3]) -> DVec3 {
        self.stiffness.times(self.place - position[self.node])
    }
}

/// Those of an island, in the order of their nodes.
#[derive(Debug, Clone, Default)]
pub(super) struct Tethers(Vec<Tether>);

impl Tethers {
    pub fn clear(&mut self) {
        self.0.clear();
    }

    /// Adds that of a node at `start` and of this mass (kg), if filaments end in its slot.
    pub fn add(&mut self, (node, start): (usize, DVec3), (slot, mass): (usize, f64), field: Field, h: f64) {
        if let Some((across, air)) = field.filament(slot).map(|load| load.across()) {
            let stiffness = Symmetric::from_matrix(&(across * (mass / h)));
            self.0.push(Tether { node, stiffness, place: start + h * air });
        }
    }

    pub fn iter(&self) -> impl Iterator<Item = &Tether> {
        self.0.iter()
    }

    /// Their energy at these positions, J.
    pub fn energy(&self, position: &[DVec3]) -> f64 {
        let of = |tether: &Tether| {
            let apart = tether.place - position[tether.node];
            0.5 * apart.dot(tether.stiffness.times(apart))
        };
        self.0.iter().map(of).sum()
    }

    /// Adds their forces times `load` to `right` and their stiffnesses to `diagonal`; their energy, J.
    pub fn linearise(
        &self,
        position: &[DVec3],
        load: f64,
        right: &mut [DVec3],
        diagonal: &mut [Symmetric],
    ) -> f64 {
        for tether in &self.0 {
            right[tether.node] += load * tether.force(position);
            diagonal[tether.node] += tether.stiffness;
        }
        self.energy(position)
    }

    /// The sum of their stiffnesses, N/m.
    pub fn stiffness(&self) -> Symmetric {
        let mut sum = Symmetric::default();
        self.0.iter().for_each(|tether| sum += tether.stiffness);
        sum
    }

    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The sum of the forces by which they oppose the displacements `step` (m), N.
    pub fn resistance(&self, step: &[DVec3]) -> DVec3 {
        self.0.iter().map(|tether| tether.stiffness.times(step[tether.node])).sum()
    }
}
