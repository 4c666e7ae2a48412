//! The potential that a step minimises, its gradient, and its Hessian as blocks.
//!
//! All of it is in f64: a spring of 10⁹ N/m turns the rounding of an f32 position into a force of
//! hundreds of newtons.

use bevy::math::DVec3;

use super::super::super::forces::Field;
use super::super::super::particles::Particles;
use super::super::super::springs::Springs;
use super::super::free_velocity;
use super::block::Symmetric;
use super::topology::Topology;

/// Components of corrections below this are none, m.
const TRACE: f64 = 1e-60;

/// A damped spring during one step: both its forces together are those of one spring.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spring {
    /// k + c/h, N/m.
    pub stiffness: f64,
    /// (k l0 + c/h l) / (k + c/h) with the length l at the start of the step, m.
    pub rest_length: f64,
    /// The direction where the spring was linearised last; zero where it had none.
    pub direction: DVec3,
}

/// What a spring contributes at a position.
pub(super) struct Contribution {
    /// ½ stiffness (l − rest_length)², J.
    pub energy: f64,
    /// Force on the first end, N.
    pub force: DVec3,
    /// Second derivatives along and across its direction, made non-negative, N/m.
    pub along: f64,
    pub across: f64,
}

impl Spring {
    fn new(rest_length: f64, stiffness: f64, damping_rate: f64, separation: DVec3) -> Self {
        let length = separation.length();
        let direction = if length > 0.0 { separation / length } else { DVec3::ZERO };
        let sum = stiffness + damping_rate;
        let rest_length = match damping_rate > 0.0 {
            true => (stiffness * rest_length + damping_rate * length) / sum,
            false => rest_length,
        };
        Self { stiffness: sum, rest_length, direction }
    }

    /// Linearises the spring between ends that are `separation` apart.
    ///
    /// The Hessian of its energy is k d dᵀ + (T/l) (I − d dᵀ) with the tension T. A step that turns the
    /// spring lengthens it, in second order, and a stiff one then seems to be under a tension that the
    /// next step takes away again; as a stiffness against turning it would only be in the way. So T is
    /// the tension that the last linearisation predicts for this place: Newton's method for position
    /// and tension as two unknowns, which converges alike for every stiffness. T < 0 counts as 0, so
    /// that the Hessian is positive semi-definite.
    #[inline]
    pub fn linearise(&mut self, separation: DVec3) -> Contribution {
        let squared = separation.length_squared();
        if squared == 0.0 {
            self.direction = DVec3::ZERO;
            let across = if self.rest_length == 0.0 { self.stiffness } else { 0.0 };
            let energy = 0.5 * self.stiffness * self.rest_length * self.rest_length;
            return Contribution { energy, force: DVec3::ZERO, along: across, across };
        }
        let length = squared.sqrt();
        let inverse_length = 1.0 / length;
        let predicted_length = match self.rest_length == 0.0 {
            true => length,
            false => self.direction.dot(separation),
        };
        let elongation = length - self.rest_length;
        self.direction = separation * inverse_length;
        let tension = self.stiffness * elongation;
        let across = self.stiffness * ((predicted_length - self.rest_length) * inverse_length).max(0.0);
        Contribution {
            energy: 0.5 * tension * elongation,
            force: self.direction * -tension,
            along: self.stiffness,
            across,
        }
    }
}

/// A node that has been eliminated: its step is `own` + `coupling` · (the step of its parent).
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Eliminated {
    pub own: DVec3,
    pub coupling: [DVec3; 3],
}

/// Sums over a part of the net, as it was linearised.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Sums {
    /// Σ ‖x − y‖², the displacement by springs, m².
    pub pulled: f64,
    /// Σ (m/h² + ν/h) ‖x − y‖², J.
    pub pulled_energy: f64,
    /// The energy of the step of the trees, stepᵀ H step, J.
    pub step_energy: f64,
}

/// One step's minimisation problem; arrays by node, see [`Topology`].
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
    /// The correction of the positions, m; before the first, the positions at the start.
    pub step: Vec<DVec3>,
    eliminated: Vec<Eliminated>,
    /// For each part of the net.
    pub sums: Vec<Sums>,
    pub springs: Vec<Spring>,
    /// The links within the core.
    pub links: Vec<Link>,
}

/// The stiffness of a spring of the core, N/m.
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
        topology: &Topology,
        particles: &Particles,
        springs: &Springs,
        field: Field,
        h: f64,
    ) {
        let viscosity = f64::from(field.viscosity);
        for (node, &slot) in topology.slots.iter().enumerate() {
            let slot = slot as usize;
            let start = particles.position.get(slot).as_dvec3();
            let velocity = particles.velocity.get(slot).as_dvec3();
            self.step[node] = start;
            self.position[node] = start + h * velocity;
            if node < topology.free {
                let mass = 1.0 / f64::from(particles.inverse_mass[slot]);
                self.inertia[node] = mass / (h * h) + viscosity / h;
                self.flight[node] = start + h * free_velocity(particles, slot, field, h);
            }
        }
        self.springs.clear();
        for (&spring, &[first, second]) in topology.springs.iter().zip(&topology.ends) {
            let spring = spring as usize;
            self.springs.push(Spring::new(
                springs.rest_length()[spring].into(),
                springs.stiffness()[spring].into(),
                f64::from(springs.damping()[spring]) / h,
                self.step[first as usize] - self.step[second as usize],
            ));
        }
    }

    /// Makes room for the nodes of `topology`.
    pub fn resize(&mut self, topology: &Topology) {
        let count = topology.len() + 1;
        for vectors in [&mut self.flight, &mut self.position, &mut self.right, &mut self.step] {
            vectors.clear();
            vectors.resize(count, DVec3::ZERO);
        }
        self.inertia.resize(count, 0.0);
        self.diagonal.clear();
        self.diagonal.resize(count, Symmetric::default());
        self.eliminated.resize(topology.trees, Eliminated::default());
        self.sums.resize(topology.anchored.len(), Sums::default());
    }

    /// Linearises everything at the present positions, and eliminates the trees from the leaves to
    /// their roots. What remains is the core, whose `right` and `diagonal` are filled in.
    ///
    /// Returns the value of the potential there, in J.
    pub fn linearise(&mut self, topology: &Topology) -> f64 {
        // Those of the trees are emptied as they are eliminated.
        self.right[topology.trees..].fill(DVec3::ZERO);
        self.diagonal[topology.trees..].fill(Symmetric::default());
        self.sums.fill(Sums::default());
        self.step[topology.free..].fill(DVec3::ZERO);
        self.linearise_core(topology) + self.eliminate_trees(topology)
    }

    fn linearise_core(&mut self, topology: &Topology) -> f64 {
        let mut energy = 0.0;
        for node in topology.trees..topology.free {
            let apart = self.position[node] - self.flight[node];
            let pulled = apart.length_squared();
            let sums = &mut self.sums[topology.parts[node] as usize];
            sums.pulled += pulled;
            sums.pulled_energy += self.inertia[node] * pulled;
            energy += 0.5 * self.inertia[node] * pulled;
            self.right[node] -= self.inertia[node] * apart;
        }
        self.links.clear();
        for (spring, &[first, second]) in
            self.springs.iter_mut().zip(&topology.ends).skip(topology.tree_springs())
        {
            let (first, second) = (first as usize, second as usize);
            let found = spring.linearise(self.position[first] - self.position[second]);
            energy += found.energy;
            self.right[first] += found.force;
            let link = Link { direction: spring.direction, along: found.along, across: found.across };
            if second >= topology.free {
                self.diagonal[first] += link.block();
            } else {
                self.right[second] -= found.force;
                self.links.push(link);
            }
        }
        energy
    }

    fn eliminate_trees(&mut self, topology: &Topology) -> f64 {
        let mut energy = 0.0;
        for (node, eliminated) in self.eliminated.iter_mut().enumerate() {
            let parent = topology.parents[node] as usize;
            let position = self.position[node];
            let inertia = self.inertia[node];
            let apart = position - self.flight[node];
            let pulled = apart.length_squared();
            let sums = &mut self.sums[topology.parts[node] as usize];
            sums.pulled += pulled;
            sums.pulled_energy += inertia * pulled;
            energy += 0.5 * inertia * pulled;
            let mut right = self.right[node] - inertia * apart;
            let mut own = self.diagonal[node].plus_diagonal(inertia);
            let mut link = Symmetric::default();
            for spring in topology.tree_starts[node] as usize..topology.tree_starts[node + 1] as usize {
                let other = topology.ends[spring][1] as usize;
                let found = self.springs[spring].linearise(position - self.position[other]);
                energy += found.energy;
                right += found.force;
                let block = Symmetric::uniaxial(self.springs[spring].direction, found.along, found.across);
                own += block;
                if other == parent {
                    link += block;
                    self.right[parent] -= found.force;
                }
            }
            let factor = own.factor(inertia);
            let coupling = factor.solve_columns(&link);
            *eliminated = Eliminated { own: factor.solve(right), coupling };
            sums.step_energy += right.dot(eliminated.own);
            (self.right[node], self.diagonal[node]) = Default::default();
            self.right[parent] += link.times(eliminated.own);
            self.diagonal[parent] += link;
            self.diagonal[parent] -= link.symmetric_product(&coupling);
        }
        energy
    }

    /// The step of a tree node, from that of its parent.
    #[inline]
    pub fn substitute(&mut self, topology: &Topology, node: usize) {
        let Eliminated { own, coupling: [x, y, z] } = self.eliminated[node];
        let parent = self.step[topology.parents[node] as usize];
        let step = own + x * parent.x + y * parent.y + z * parent.z;
        // From link to link a step fades, down to subnormal numbers, for which processors take ten times as long.
        let clear = |component: f64| if component.abs() < TRACE { 0.0 } else { component };
        self.step[node] = DVec3::new(clear(step.x), clear(step.y), clear(step.z));
    }
}
