//! The forces of gases, for the schemes that evaluate them at given positions.

use bevy::math::{DVec3, Vec3};

use crate::solver::elements::Gases;
use crate::solver::field::Field;
use crate::solver::particles::Vectors;
use crate::solver::state::Version;

/// The force on the particle in each slot, N: working memory.
#[derive(Debug, Clone, Default)]
pub(super) struct GasForces {
    force: Vectors,
    gradient: Vec<DVec3>,
    /// Particles of other gases have zeros.
    key: Version,
}

impl GasForces {
    /// The field with the forces of the gases at these positions.
    #[inline]
    pub fn evaluate<'a>(&'a mut self, gases: &Gases, position: &Vectors, field: Field<'a>) -> Field<'a> {
        if !gases.any_act() {
            return field;
        }
        self.sum(gases, position);
        Field { gas: Some(&self.force), ..field }
    }

    /// Sums the forces of the gases at these positions.
    fn sum(&mut self, gases: &Gases, position: &Vectors) {
        let Self { force, gradient, key } = self;
        if *key != gases.version() || force.len() != position.len() {
            *key = gases.version();
            force.resize(0);
            force.resize(position.len());
        }
        for slot in gases.acting().flat_map(|(_, enclosure)| &enclosure.slots) {
            force.set(*slot as usize, Vec3::ZERO);
        }
        for (_, enclosure) in gases.acting() {
            let at = |place: usize| position.get(enclosure.slots[place] as usize).as_dvec3();
            let volume = enclosure.measure(at, gradient);
            let pressure = enclosure.gas.pressure_at(volume);
            // What rounding takes from one particle the next one gets, so that all of it adds up to nothing still.
            let mut left = DVec3::ZERO;
            for (slot, gradient) in enclosure.slots.iter().zip(&*gradient) {
                let slot = *slot as usize;
                let wanted = force.get(slot).as_dvec3() + pressure * *gradient + left;
                let rounded = wanted.as_vec3();
                left = wanted - rounded.as_dvec3();
                if !left.is_finite() {
                    left = DVec3::ZERO;
                }
                force.set(slot, rounded);
            }
        }
    }
}
