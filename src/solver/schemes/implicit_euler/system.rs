//! The potential that a step minimises, its gradient, and its Hessian as blocks.
//!
//! All of it is in f64: a spring of 10⁹ N/m turns the rounding of an f32 position into a force of
//! hundreds of newtons.

use bevy::math::DVec3;

use super::block::Symmetric;
use super::contact;
use super::contacts::Contacts;
use super::coupling::TreeLink;
use super::gas::{self, GasTerms};
use super::linearised::Linearised;
use super::tethers::Tethers;
use super::trees::Eliminated;
use super::wide::Wide;
use crate::solver::elements::{Elements, MAX_ENDS};
use crate::solver::field::Field;
use crate::solver::graph::{Elimination, Linked};
use crate::solver::particles::Particles;

/// Components of corrections below this are cleared, m.
const NEGLIGIBLE: f64 = 1e-60;

/// Sums over the island, as it was linearised.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Sums {
    /// Σ ‖x − y‖², the displacement by springs, m².
    pub pulled: f64,
    /// Σ (m/h² + ν/h) ‖x − y‖², J.
    pub pulled_energy: f64,
    /// The energy of the step of the trees, stepᵀ H step, J.
    pub step_energy: f64,
}

/// One step's minimisation problem; arrays by node, see [`Elimination`].
#[derive(Debug, Clone, Default)]
pub(super) struct System {
    /// m/h² + ν/h: what holds a node to its free flight, N/m.
    pub inertia: Vec<f64>,
    /// Where a node flies without springs, m.
    pub flight: Vec<DVec3>,
    /// The present iterate; where pinned particles are at the end of the step, m.
    pub position: Vec<DVec3>,
    /// The right side: forces that are not balanced yet, with those of the eliminated nodes below, N.
    pub right: Vec<DVec3>,
    /// The diagonal blocks without inertia, N/m.
    pub diagonal: Vec<Symmetric>,
    /// The positions at the start, m.
    pub start: Vec<DVec3>,
    /// The correction of the positions, m.
    pub step: Vec<DVec3>,
    pub eliminated: Vec<Eliminated>,
    /// The same where nodes may have two parents.
    pub wide: Wide,
    pub sums: Sums,
    /// 1; 0 where the forces of inertia and of elements are left out, and only their stiffness counts.
    pub load: f64,
    /// The elements of two ends, then the compounds.
    pub elements: Vec<Linearised>,
    /// The links within the core.
    pub links: Vec<Link>,
    /// The elements of more ends.
    pub compounds: Vec<Compound>,
    /// What contacts couple tree nodes by to their parents, by node.
    pub tree_links: Vec<TreeLink>,
    /// What it encloses.
    pub gases: GasTerms,
    /// To the air, across filaments.
    pub tethers: Tethers,
    /// With what nothing in the step can move.
    pub contacts: Contacts,
    /// The forces of elements and gases at the start, N; found where a contact may rebound.
    pub start_pull: Vec<DVec3>,
    /// Working space: the gradient of the volume of a gas, m².
    gradient: Vec<DVec3>,
}

/// The stiffness of an element of more than two ends; that of a tree node is in no `block`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Compound {
    pub nodes: Linked,
    pub weights: [f64; MAX_ENDS],
    pub block: Symmetric,
}

impl Compound {
    /// The ends in the core, numbered from 0 there, and their weights.
    pub fn core_ends(&self, elimination: &Elimination) -> impl Iterator<Item = (usize, f64)> {
        let core = elimination.trees..elimination.free;
        let ends = self.nodes.ends().iter().map(|node| *node as usize).zip(self.weights);
        ends.filter(move |(node, _)| core.contains(node))
            .map(|(node, weight)| (node - elimination.trees, weight))
    }
}

/// The stiffness of an element of the core, N/m.
#[derive(Debug, Clone, Copy)]
pub(super) struct Link {
    pub direction: DVec3,
    pub along: f64,
    pub across: f64,
}

impl Link {
    pub fn block(&self) -> Symmetric {
        Symmetric::uniaxial(self.direction, self.along, self.across)
    }
}

impl System {
    /// Sets up the step of `h` seconds from the present state of `particles`.
    pub fn begin(
        &mut self,
        elimination: &Elimination,
        particles: &Particles,
        elements: &Elements,
        field: Field,
        h: f64,
    ) {
        self.load = 1.0;
        self.tethers.clear();
        for (node, &slot) in elimination.slots.iter().enumerate() {
            let slot = slot as usize;
            let start = particles.position.get(slot).as_dvec3();
            let velocity = particles.velocity.get(slot).as_dvec3();
            self.start[node] = start;
            self.position[node] = start + h * velocity;
            if node < elimination.free {
                let mass = 1.0 / f64::from(particles.inverse_mass()[slot]);
                self.inertia[node] = mass / (h * h) + field.drag(slot, mass) / h;
                self.flight[node] =
                    start + h * field.velocity_without_filaments(particles, slot, velocity, h);
                self.tethers.add((node, start), (slot, mass), field, h);
            }
        }
        self.gases.begin(elimination, elements);
        self.elements.clear();
        for (&element, &[first, second]) in elimination.elements.iter().zip(&elimination.ends) {
            let start = self.start[first as usize] - self.start[second as usize];
            let length = start.length();
            self.elements.push(Linearised::new(elements.potential(element, length, h), start, length));
        }
        self.compounds.clear();
        for &nodes in &elimination.compounds {
            let weights = elements.weights(nodes.element);
            let start = combine(&nodes, weights, &self.start);
            let length = start.length();
            self.elements.push(Linearised::new(elements.potential(nodes.element, length, h), start, length));
            self.compounds.push(Compound { nodes, weights, block: Symmetric::default() });
        }
    }

    /// Begins the iteration from where the potential is lower: from where the nodes were, if what they touch on the way weighs more
    /// than the way. Whatever the iteration comes to then has no more energy than these.
    pub fn begin_low(&mut self, elimination: &Elimination) {
        self.linearise(elimination);
        let moved = self.potential(elimination);
        let free = 0..elimination.free;
        self.step[free.clone()].copy_from_slice(&self.position[free.clone()]);
        self.position[free.clone()].copy_from_slice(&self.start[free.clone()]);
        if self.potential(elimination) >= moved {
            self.position[free.clone()].copy_from_slice(&self.step[free]);
        }
    }

    /// Allocates the nodes of `elimination`.
    pub fn resize(&mut self, elimination: &Elimination) {
        let count = elimination.slots.len() + 1;
        for vectors in
            [&mut self.flight, &mut self.position, &mut self.start, &mut self.right, &mut self.step]
        {
            vectors.resize(count, DVec3::ZERO);
        }
        self.inertia.resize(count, 0.0);
        self.diagonal.resize(count, Symmetric::default());
        let trees = if elimination.bent.is_empty() { elimination.trees } else { 0 };
        self.eliminated.resize(trees, Eliminated::default());
        self.wide.resize(elimination);
    }

    /// Linearises everything at the present positions, and eliminates the trees from the leaves to
    /// their roots. What remains is the core, the `right` and `diagonal` of which are filled in.
    ///
    /// Returns the value of the potential there, in J.
    pub fn linearise(&mut self, elimination: &Elimination) -> f64 {
        // Those of the trees are emptied as they are eliminated.
        self.right[elimination.trees..].fill(DVec3::ZERO);
        self.diagonal[elimination.trees..].fill(Symmetric::default());
        self.sums = Sums::default();
        self.step[elimination.free..].fill(DVec3::ZERO);
        let core = self.linearise_core(elimination) + self.linearise_compounds(elimination);
        let Self { contacts, gases, tethers, position, start, right, diagonal, compounds, load, .. } = self;
        let core = core + gases.linearise(elimination, position, *load, right);
        let core = core + tethers.linearise(position, *load, right, diagonal);
        let touched = contacts.linearise([position, start], contact::Sums { right, diagonal, compounds });
        self.route_contacts(elimination);
        let trees = match elimination.bent.is_empty() {
            true => self.eliminate_trees(elimination),
            false => self.eliminate_wide(elimination),
        };
        core + touched + trees
    }

    /// The value of the potential at the present positions, J.
    pub fn potential(&self, elimination: &Elimination) -> f64 {
        let free = 0..elimination.free;
        let inertial = free
            .map(|node| 0.5 * self.inertia[node] * self.position[node].distance_squared(self.flight[node]));
        let pairs = self.elements.iter().zip(&elimination.ends).map(|(element, &[first, second])| {
            element.energy(self.position[first as usize] - self.position[second as usize])
        });
        let compounds = self.compounds.iter().zip(&self.elements[elimination.elements.len()..]);
        let compounds = compounds.map(|(compound, element)| {
            element.energy(combine(&compound.nodes, compound.weights, &self.position))
        });
        let gases = self.gases.energy(elimination, |node| self.position[node]);
        inertial.chain(pairs).chain(compounds).sum::<f64>()
            + gases
            + self.tethers.energy(&self.position)
            + self.contacts.energy(&self.position)
    }

    /// The tensions of the elements at the present positions, dampers included, N.
    pub fn tensions(&self, elimination: &Elimination) -> impl Iterator<Item = f64> {
        let pairs = self.elements.iter().zip(&elimination.ends).map(|(element, &[first, second])| {
            element.tension(self.position[first as usize] - self.position[second as usize])
        });
        let compounds = self.compounds.iter().zip(&self.elements[elimination.elements.len()..]);
        pairs.chain(compounds.map(|(compound, element)| {
            element.tension(combine(&compound.nodes, compound.weights, &self.position))
        }))
    }

    /// Whether any element, with its damper, pushes at the present positions.
    pub fn any_pressed(&self, elimination: &Elimination) -> bool {
        let mut pairs = self.elements.iter().zip(&elimination.ends);
        let mut compounds = self.compounds.iter().zip(&self.elements[elimination.elements.len()..]);
        pairs.any(|(element, &[first, second])| {
            element.is_pressed(self.position[first as usize] - self.position[second as usize])
        }) || compounds.any(|(compound, element)| {
            element.is_pressed(combine(&compound.nodes, compound.weights, &self.position))
        })
    }

    /// Finds the forces of elements and gases on the nodes at the start of the step, N; dampers have none there.
    pub fn find_start_pull(&mut self, elimination: &Elimination, elements: &Elements) {
        let Self { start, start_pull: pull, .. } = self;
        pull.clear();
        pull.resize(start.len(), DVec3::ZERO);
        for (element, &[first, second]) in self.elements.iter().zip(&elimination.ends) {
            let [first, second] = [first as usize, second as usize];
            let separation = start[first] - start[second];
            let force = separation.normalize_or_zero() * -element.tension(separation);
            pull[first] += force;
            pull[second] -= force;
        }
        for (compound, element) in self.compounds.iter().zip(&self.elements[elimination.elements.len()..]) {
            let separation = combine(&compound.nodes, compound.weights, start);
            let force = separation.normalize_or_zero() * -element.tension(separation);
            for (node, weight) in compound.nodes.ends().iter().zip(compound.weights) {
                pull[*node as usize] += force * weight;
            }
        }
        let push = |node: usize, push: DVec3| pull[node] += push;
        gas::for_each_force(elimination, elements, |node| start[node], &mut self.gradient, push);
    }

    fn linearise_core(&mut self, elimination: &Elimination) -> f64 {
        let mut energy = 0.0;
        for node in elimination.trees..elimination.free {
            let apart = self.position[node] - self.flight[node];
            let pulled = apart.length_squared();
            self.sums.pulled += pulled;
            self.sums.pulled_energy += self.inertia[node] * pulled;
            energy += 0.5 * self.inertia[node] * pulled;
            self.right[node] -= self.load * self.inertia[node] * apart;
        }
        self.links.clear();
        for (element, &[first, second]) in
            self.elements.iter_mut().zip(&elimination.ends).skip(elimination.tree_elements())
        {
            let (first, second) = (first as usize, second as usize);
            let found = element.linearise(self.position[first] - self.position[second]);
            energy += found.energy;
            let force = self.load * found.force;
            self.right[first] += force;
            let link = Link { direction: element.direction, along: found.along, across: found.across };
            if second >= elimination.free {
                self.diagonal[first] += link.block();
            } else {
                self.right[second] -= force;
                self.links.push(link);
            }
        }
        energy
    }

    fn linearise_compounds(&mut self, elimination: &Elimination) -> f64 {
        let mut energy = 0.0;
        // Behind them are those of contacts.
        self.compounds.truncate(elimination.compounds.len());
        let Self { compounds, elements, position, right, load, .. } = self;
        let load = *load;
        let all = compounds.iter_mut().zip(&mut elements[elimination.elements.len()..]);
        for (compound, element) in all.skip(elimination.tree_compounds) {
            let found = element.linearise(combine(&compound.nodes, compound.weights, position));
            energy += found.energy;
            compound.block = Symmetric::uniaxial(element.direction, found.along, found.across);
            for (node, weight) in compound.core_ends(elimination) {
                right[elimination.trees + node] += found.force * (load * weight);
            }
        }
        energy
    }

    /// The step of a tree node, from those of its parents.
    #[inline]
    pub fn substitute(&mut self, elimination: &Elimination, node: usize) {
        let parent = self.step[elimination.parents[node] as usize];
        let step = match elimination.bent.get(node) {
            Some(bent) => self.wide.step(node, [parent, self.step[bent.second_parent as usize]]),
            None => self.eliminated[node].step(parent),
        };
        // From link to link a step fades, down to subnormal numbers, for which processors take ten times as long.
        let clear = |component: f64| if component.abs() < NEGLIGIBLE { 0.0 } else { component };
        self.step[node] = DVec3::new(clear(step.x), clear(step.y), clear(step.z));
    }
}

/// Σ cᵢ vᵢ over the ends of an element.
pub(super) fn combine(nodes: &Linked, weights: [f64; MAX_ENDS], vectors: &[DVec3]) -> DVec3 {
    nodes.ends().iter().zip(weights).map(|(node, weight)| vectors[*node as usize] * weight).sum()
}
