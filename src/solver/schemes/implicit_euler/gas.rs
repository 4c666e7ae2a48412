//! Gases in the potential of a step: E = −p₀ V₀ ln (V/V₀) at the positions x' at its end.
//!
//! The Hessian is p/V g gᵀ − p ∇²V with the gradient g of the volume. The first term couples all particles of a gas by
//! one vector. The second has both signs, and is small beside the tension of a surface that encloses the pressure (of a
//! sphere of radius r, edges e: p e against p r/2); it is left out, so that the matrix stays positive.

use bevy::math::DVec3;

use crate::solver::elements::{Elements, Enclosure};
use crate::solver::graph::Elimination;

/// A gas as it was linearised last; its nodes are in [`Elimination::gases`].
#[derive(Debug, Clone, Default)]
pub(super) struct GasTerm {
    enclosure: Enclosure,
    gradient: Vec<DVec3>,
    pressure: f64,
    /// p/V, Pa/m³.
    stiffness: f64,
}

/// The gases of an island.
#[derive(Debug, Clone, Default)]
pub(super) struct GasTerms(Vec<GasTerm>);

impl GasTerms {
    /// Takes the gases from `elements`, at the start of a step.
    pub fn begin(&mut self, elimination: &Elimination, elements: &Elements) {
        let Self(terms) = self;
        let enclosure = |number: u32| &elements.gases().all()[number as usize];
        if terms.len() != elimination.gases.len() {
            let new = |(number, _): &(u32, Vec<u32>)| GasTerm {
                enclosure: enclosure(*number).clone(),
                ..GasTerm::default()
            };
            terms.clear();
            terms.extend(elimination.gases.iter().map(new));
        }
        for (term, (number, _)) in terms.iter_mut().zip(&elimination.gases) {
            term.enclosure.gas = enclosure(*number).gas;
        }
    }

    /// Linearises them at the present positions, and adds their forces times `load` to `right`; their energy, J.
    pub fn linearise(
        &mut self,
        elimination: &Elimination,
        position: &[DVec3],
        load: f64,
        right: &mut [DVec3],
    ) -> f64 {
        let mut energy = 0.0;
        for (term, (_, nodes)) in self.0.iter_mut().zip(&elimination.gases) {
            let GasTerm { enclosure, gradient, pressure, stiffness } = term;
            let volume = enclosure.measure(|place| position[nodes[place] as usize], gradient);
            (*pressure, *stiffness) = (enclosure.gas.pressure_at(volume), enclosure.gas.stiffness_at(volume));
            energy += enclosure.gas.energy_at(volume);
            for (node, gradient) in nodes.iter().zip(&*gradient) {
                if (*node as usize) < elimination.free {
                    right[*node as usize] += *gradient * (load * *pressure);
                }
            }
        }
        energy
    }

    /// Their energy at these positions, J.
    pub fn energy(&self, elimination: &Elimination, position: impl Fn(usize) -> DVec3) -> f64 {
        let of = |(term, (_, nodes)): (&GasTerm, &(u32, Vec<u32>))| {
            let enclosure = &term.enclosure;
            enclosure.gas.energy_at(enclosure.volume(|place| position(nodes[place] as usize)))
        };
        self.0.iter().zip(&elimination.gases).map(of).sum()
    }
}

/// Calls `push` with each free node of the gases and the force on it at these positions, N; `gradient` is working space.
pub(super) fn for_each_force(
    elimination: &Elimination,
    elements: &Elements,
    position: impl Fn(usize) -> DVec3,
    gradient: &mut Vec<DVec3>,
    mut push: impl FnMut(usize, DVec3),
) {
    for (number, nodes) in &elimination.gases {
        let enclosure = &elements.gases().all()[*number as usize];
        let volume = enclosure.measure(|place| position(nodes[place] as usize), gradient);
        let pressure = enclosure.gas.pressure_at(volume);
        let free = nodes.iter().zip(&*gradient).filter(|(node, _)| (**node as usize) < elimination.free);
        free.for_each(|(node, gradient)| push(*node as usize, *gradient * pressure));
    }
}

/// What gases add to the matrix of the core: for each, `stiffness` g gᵀ.
#[derive(Debug, Clone, Default)]
pub(super) struct CoreGases {
    gases: Vec<(f64, usize)>,
    /// The nodes of all of them, numbered from 0 in the core, with their gradients.
    nodes: Vec<(usize, DVec3)>,
}

impl CoreGases {
    pub fn fill(&mut self, terms: &GasTerms, elimination: &Elimination) {
        let core = elimination.trees..elimination.free;
        self.gases.clear();
        self.nodes.clear();
        for (term, (_, nodes)) in terms.0.iter().zip(&elimination.gases) {
            let nodes = nodes.iter().map(|node| *node as usize).zip(&term.gradient);
            let free = nodes.filter(|(node, _)| core.contains(node));
            self.nodes.extend(free.map(|(node, gradient)| (node - core.start, *gradient)));
            self.gases.push((term.stiffness, self.nodes.len()));
        }
    }

    /// `product` += their matrix · `vector`.
    #[inline(always)]
    pub fn add_product(&self, [x, y, z]: [&[f64]; 3], product: &mut [&mut [f64]; 3]) {
        let mut start = 0;
        for &(stiffness, end) in &self.gases {
            let nodes = &self.nodes[start..end];
            start = end;
            let mut sum = 0.0;
            for (node, gradient) in nodes {
                sum += gradient.dot(DVec3::new(x[*node], y[*node], z[*node]));
            }
            for (node, gradient) in nodes {
                let force = *gradient * (stiffness * sum);
                product[0][*node] += force.x;
                product[1][*node] += force.y;
                product[2][*node] += force.z;
            }
        }
    }
}
