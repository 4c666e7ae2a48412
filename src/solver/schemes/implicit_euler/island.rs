//! An island besides its equations: its pinned particles, the pairs that do not collide, and what it publishes.

use super::Island;
use crate::solver::elements::Elements;
use crate::solver::graph::{Elimination, overlap_at_rest};
use crate::solver::particles::Particles;
use crate::solver::pulls::Pulls;

impl Island {
    /// One with these unknowns.
    pub fn new(elimination: Elimination) -> Self {
        let mut island = Self { elimination, ..Self::default() };
        island.system.resize(&island.elimination);
        island.find_anchors();
        island
    }

    /// Whether the parameters of one of its elements change in this tick. The stages of TR-BDF2 would need them at times
    /// in between, so that it takes steps of backward Euler.
    pub fn is_on_ramp(&self, elements: &Elements) -> bool {
        let Elimination { elements: pairs, compounds, .. } = &self.elimination;
        let mut numbers = pairs.iter().copied().chain(compounds.iter().map(|compound| compound.element));
        elements.any_ramps() && numbers.any(|number| elements.is_on_ramp(number))
    }

    /// Writes the tension of each of its elements in the last step, N, by the number of the element.
    pub fn read_tensions(&self, tensions: &mut [f64]) {
        let Self { elimination, system, .. } = self;
        let compounds = elimination.compounds.iter().map(|compound| &compound.element);
        let numbers = elimination.elements.iter().chain(compounds);
        for (place, (number, tension)) in numbers.zip(system.tensions(elimination)).enumerate() {
            tensions[*number as usize] = self.stages.mean_tension(place, tension);
        }
    }

    /// Lists the springs to pinned particles.
    pub fn find_anchors(&mut self) {
        let Self { elimination, anchors, .. } = self;
        let ends = elimination.ends.iter().zip(&elimination.elements);
        let anchored = ends.filter(|([_, other], _)| *other as usize >= elimination.free);
        anchors
            .extend(anchored.map(|(ends, element)| (ends[0], elimination.slots[ends[1] as usize], *element)));
    }

    /// Lists the pairs that do not collide, since they overlap at rest.
    pub fn exclude_pairs(&mut self, particles: &Particles, elements: &Elements) {
        let Self { elimination, anchors, excluded, .. } = self;
        let radius = particles.radius();
        excluded.clear();
        excluded.extend(anchors.iter().filter_map(|&(node, pinned, element)| {
            let reach = radius[elimination.slots[node as usize] as usize] + radius[pinned as usize];
            overlap_at_rest(elements.coefficients(element).1, reach).then_some((node, pinned))
        }));
    }

    /// Keeps the accelerations by elements, (m/h² + ν/h) (x' − y) / m, as the solution has them, and what it touches.
    pub fn keep_pulls(&self, particles: &Particles, pulls: &mut Pulls) {
        let Self { elimination, system, .. } = self;
        for (node, slot) in elimination.slots[..elimination.free].iter().enumerate() {
            let slot = *slot as usize;
            let force = system.inertia[node] * (system.position[node] - system.flight[node]);
            pulls.set(slot, (force * f64::from(particles.inverse_mass()[slot])).as_vec3());
        }
        for tether in system.tethers.iter() {
            let (node, slot) = (tether.node, elimination.slots[tether.node] as usize);
            let force = system.inertia[node] * (system.position[node] - system.flight[node]);
            let force = force - tether.force(&system.position);
            pulls.set(slot, (force * f64::from(particles.inverse_mass()[slot])).as_vec3());
        }
        system.contacts.for_each_touching_node(elimination.free, |node| {
            pulls.set_touching(elimination.slots[node] as usize);
        });
    }
}
