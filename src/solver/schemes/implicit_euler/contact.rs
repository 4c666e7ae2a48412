//! One contact of an implicit step: what it adds to the potential. See `contacts.rs`.

use bevy::math::DVec3;

use super::block::Symmetric;
use super::follow::Followed;
use super::friction::{FrictionHistory, FrictionState, Slip};
use super::system::Compound;
use crate::solver::collision::{ContactEnds, Obstacle, Vicinity};
use crate::solver::elements::MAX_ENDS;
use crate::solver::graph::{Elimination, Linked};

/// K of contacts of surfaces, at most, as a multiple of the inertia.
const SURFACE_STIFFENING: f64 = 100.0;

/// Fraction of the allowed penetration above which a surface contact is stiffened: the springs of a stiff net, or a heavy net, push a light
/// one through softer contacts.
const DEEP_PART: f64 = 0.5;

/// How far around a point triangles of a mesh are listed, as a part of the radius.
const NEAR_PART: f64 = 0.1;

/// Factor of that stiffening.
const HARDENING: f64 = 30.0;

/// A particle that touches an obstacle or another particle, or may in this step.
#[derive(Debug, Clone)]
pub(super) struct Contact {
    pub node: usize,
    /// The other particles that have a part in the point that touches, of an edge or a face; their nodes and weights.
    pub others: [(usize, f64); 3],
    /// The weight of the particle, and how many others there are.
    pub weight: f64,
    pub count: usize,
    pub partner: Partner,
    /// m.
    pub radius: f64,
    /// K is a multiple of this, N/m.
    pub inertia: f64,
    /// The gap at which it begins to be held, m, <= 0.
    pub allowed: f64,
    /// Where the particle would be if it had moved with what it touches, relative to that where it is another one; m.
    pub origin: DVec3,
    /// The speed at which the two come closer when the step begins, m/s; gravity's share of the step included.
    pub approach: f64,
    /// Towards the particle, where it was linearised last.
    pub normal: DVec3,
    /// The normal force there, N, >= 0.
    pub force: f64,
    /// How far it was beyond `allowed` there, m.
    pub depth: f64,
    /// How far it was beyond `allowed` in the last solution that came close enough, m.
    pub last_depth: f64,
    /// The force of the solution before, N: see `contacts.rs`.
    pub multiplier: f64,
    /// The normal force that friction goes by, N.
    pub lagged: f64,
    /// How far it is sent back in as long as the step takes, m.
    pub rebound: f64,
    /// The force of friction where it was linearised last, N.
    pub rubbing: DVec3,
    /// What friction was there.
    pub friction_state: FrictionState,
    pub friction_history: FrictionHistory,
    /// Coefficient of restitution, 0 to 1.
    pub restitution: f64,
    /// Coefficient of Coulomb friction, >= 0.
    pub friction: f64,
    /// The allowed penetration: how far it may go beyond `allowed` until surfaces are stopped, m; infinite for other contacts.
    pub max_depth: f64,
    /// By how much K is greater than that of others.
    pub hardness: f64,
    /// Of an edge or a face: how the contact point follows the iterates.
    pub followed: Option<Followed>,
    /// The triangles of a mesh that are near. It changes no result.
    pub vicinity: Vicinity,
}

/// What a particle touches.
#[derive(Debug, Clone)]
#[expect(
    clippy::large_enum_variant,
    reason = "most are obstacles, and a list of them is walked in each iteration"
)]
pub(super) enum Partner {
    Obstacle(Obstacle),
    /// Another node, which it is not to come closer to than `reach` m along `normal`.
    Node {
        node: usize,
        normal: DVec3,
        reach: f64,
    },
    /// Another surface: what touches is not to come closer than `reach` m along `normal`. The weights are those of both sides; that
    /// of the second is negative.
    Surface {
        /// A particle of the other one.
        slot: usize,
        normal: DVec3,
        reach: f64,
        /// Σ wᵢ xᵢ of the pinned corners at the end of the step, m.
        pinned: DVec3,
        /// Σ wᵢ of the others.
        free_weight: f64,
    },
}

/// Forces and stiffness of the nodes, to be added to.
pub(super) struct Sums<'a> {
    pub right: &'a mut [DVec3],
    pub diagonal: &'a mut [Symmetric],
    pub compounds: &'a mut Vec<Compound>,
}

/// How contacts are linearised.
#[derive(Debug, Clone, Copy)]
pub(super) struct Approach {
    /// K as a multiple of the inertia.
    pub stiffness: f64,
    /// The slip below which friction is viscous, m.
    pub creep: f64,
    /// Whether a whole Newton step has been taken since the last linearisation.
    pub is_whole_step: bool,
    /// Whether faces touch.
    pub has_faces: bool,
}

impl Contact {
    /// One that holds nothing yet, at a gap of 0.
    pub fn new(node: usize, partner: Partner) -> Self {
        Self {
            node,
            others: [(0, 0.0); 3],
            weight: 1.0,
            count: 0,
            partner,
            radius: 0.0,
            inertia: 0.0,
            allowed: 0.0,
            origin: DVec3::ZERO,
            approach: 0.0,
            normal: DVec3::ZERO,
            force: 0.0,
            depth: 0.0,
            last_depth: f64::INFINITY,
            multiplier: 0.0,
            lagged: 0.0,
            rebound: 0.0,
            rubbing: DVec3::ZERO,
            friction_state: FrictionState::Unknown,
            friction_history: FrictionHistory::default(),
            restitution: 0.0,
            friction: 0.0,
            max_depth: f64::INFINITY,
            hardness: 1.0,
            followed: None,
            vicinity: Vicinity::default(),
        }
    }

    /// Whether it is a single particle that touches.
    pub fn is_particle(&self) -> bool {
        self.count == 0 && !matches!(self.partner, Partner::Surface { .. })
    }

    /// Its particles that can move, if the next step begins with its force.
    pub fn ends(&self, elimination: &Elimination) -> Option<ContactEnds> {
        let slot = |node: usize| elimination.slots[node];
        match self.partner {
            Partner::Obstacle(_) => {
                let others = self.others[..self.count].iter().map(|(node, _)| *node);
                let free = others.chain([self.node]).filter(|node| *node < elimination.free);
                Some(ContactEnds::of(free.map(slot)))
            }
            Partner::Node { node, .. } => Some(ContactEnds::of_pair([slot(self.node), slot(node)])),
            Partner::Surface { .. } => None,
        }
    }

    /// K, N/m, where it is to be this multiple of the inertia. Surfaces yield by parts of their thickness, so that theirs need not be so
    /// great until they are [hardened](Self::harden); it would have the method of conjugate gradients take many more iterations, as it couples several particles.
    fn stiffness(&self, multiple: f64) -> f64 {
        let is_surface = matches!(self.partner, Partner::Surface { .. });
        self.inertia * self.hardness * if is_surface { multiple.min(SURFACE_STIFFENING) } else { multiple }
    }

    /// Makes it stiffer if it yields so far that the surfaces would soon be stopped where they are, and keeps its force; whether it is.
    pub fn harden(&mut self) -> bool {
        let is_deep = self.force > 0.0 && self.depth > DEEP_PART * self.max_depth;
        if is_deep {
            self.multiplier = self.force;
            self.hardness *= HARDENING;
        }
        is_deep
    }

    /// The slip in m below which friction of at most `limit` N is viscous; of surfaces it is as stiff as these are, at most.
    fn creep(&self, creep: f64, limit: f64) -> f64 {
        match self.partner {
            Partner::Surface { .. } => creep.max(limit / (SURFACE_STIFFENING * self.inertia)),
            _ => creep,
        }
    }

    /// The part of its force that comes from what nothing in the step can move.
    pub fn outer_part(&self) -> f64 {
        match self.partner {
            Partner::Obstacle(_) => 1.0,
            Partner::Node { .. } => 0.0,
            Partner::Surface { free_weight, .. } => free_weight,
        }
    }

    /// Σ wᵢ vᵢ over the particles that touch.
    pub fn point(&self, vectors: &[DVec3]) -> DVec3 {
        if self.is_particle() {
            return vectors[self.node];
        }
        let others = self.others[..self.count].iter().map(|(node, weight)| vectors[*node] * *weight);
        vectors[self.node] * self.weight + others.sum::<DVec3>()
    }

    /// The gap at these positions, m, and the direction towards the particle.
    pub fn gap(&self, position: &[DVec3]) -> (f64, DVec3) {
        match &self.partner {
            Partner::Obstacle(obstacle) => {
                obstacle.gap_known(self.point(position), self.radius, &self.vicinity)
            }
            Partner::Node { node, normal, reach } => {
                ((position[self.node] - position[*node]).dot(*normal) - reach, *normal)
            }
            Partner::Surface { normal, reach, pinned, .. } => {
                ((self.point(position) + pinned).dot(*normal) - reach, *normal)
            }
        }
    }

    /// The way of the particle in the step, relative to what it touches, m.
    pub fn displacement(&self, position: &[DVec3]) -> DVec3 {
        let other = if let Partner::Node { node, .. } = self.partner { position[node] } else { DVec3::ZERO };
        self.point(position) - other - self.origin
    }

    /// The slip along the surface; `creep` in m.
    fn slip(&self, position: &[DVec3], normal: DVec3, creep: f64) -> Slip {
        let displacement = self.displacement(position);
        let limit = self.friction * self.lagged;
        let creep = self.creep(creep, limit);
        Slip { displacement: displacement - normal * displacement.dot(normal), limit, creep }
    }

    /// Its energy at these positions, J; `stiffness` is K as a multiple of the inertia, `creep` in m.
    pub fn energy(&self, position: &[DVec3], stiffness: f64, creep: f64) -> f64 {
        let (gap, normal) = self.gap(position);
        let stiffness = self.stiffness(stiffness);
        let force = (self.multiplier + stiffness * (self.allowed - gap)).max(0.0);
        0.5 * force * force / stiffness + self.slip(position, normal, creep).energy()
    }

    /// Finds the normal force at these positions; the normal.
    pub fn press(&mut self, position: &[DVec3], stiffness: f64) -> DVec3 {
        let point = self.point(position);
        let (gap, normal) = match &self.partner {
            Partner::Obstacle(obstacle) => {
                obstacle.gap_near(point, self.radius, (&mut self.vicinity, NEAR_PART * self.radius))
            }
            _ => self.gap(position),
        };
        self.depth = self.allowed - gap;
        self.normal = normal;
        self.force = (self.multiplier + self.stiffness(stiffness) * self.depth).max(0.0);
        normal
    }

    /// Finds the force of friction at these positions, in the state of the last linearisation.
    pub fn rub(&mut self, position: &[DVec3], normal: DVec3, creep: f64) {
        let slip = self.slip(position, normal, creep);
        self.rubbing = slip.friction(self.friction_state).force.clamp_length_max(slip.limit);
    }

    /// Adds what it contributes at these positions; its energy in J.
    pub fn linearise(
        &mut self,
        position: &[DVec3],
        Approach { stiffness, creep, is_whole_step, has_faces }: Approach,
        sums: &mut Sums,
    ) -> f64 {
        let normal = self.press(position, stiffness);
        let stiffness = self.stiffness(stiffness);
        let slip = self.slip(position, normal, creep);
        // In a part of a step what sticks comes a part of the way only.
        let is_on_the_way = !is_whole_step && self.friction_state == FrictionState::Sticking;
        if !(has_faces || is_on_the_way && slip.limit > 0.0) {
            self.friction_state = self.friction_state.next(slip);
        }
        let friction = match has_faces {
            true => self.friction_history.friction(slip),
            false => slip.friction(self.friction_state),
        };
        self.rubbing = friction.force.clamp_length_max(slip.limit);
        if self.force == 0.0 && slip.limit == 0.0 {
            return 0.0;
        }
        let along = if self.force > 0.0 { stiffness } else { 0.0 };
        self.add(normal * self.force + friction.force, friction.block(normal, along), sums);
        if self.force > 0.0 {
            self.add_turning(sums);
        }
        0.5 * self.force * self.force / stiffness + slip.energy()
    }

    /// The speed, at most, at which the forces `pull` on the nodes, N, press the two together within `h` seconds from
    /// rest, m/s.
    pub fn pressing_speed(&self, pull: &[DVec3], h: f64) -> f64 {
        let other = if let Partner::Node { node, .. } = self.partner { pull[node] } else { DVec3::ZERO };
        // Inertia is m/h².
        (-(self.point(pull) - other).dot(self.normal) / (self.inertia * h)).max(0.0)
    }

    /// Holds what has touched where it is, or sends it back by `rebound`.
    pub fn send_back(&self, stiffness: f64, sums: &mut Sums) {
        if self.force > 0.0 {
            let stiffness = self.stiffness(stiffness);
            let block = Symmetric::uniaxial(self.normal, stiffness, 0.0);
            self.add(self.normal * (stiffness * self.rebound), block, sums);
        }
    }

    /// Adds a force on the particle, N, and a stiffness, N/m.
    fn add(&self, force: DVec3, block: Symmetric, sums: &mut Sums) {
        if !self.is_particle() {
            self.add_to_all(force, block, sums);
            return;
        }
        sums.right[self.node] += force;
        match self.partner {
            Partner::Obstacle(_) | Partner::Surface { .. } => sums.diagonal[self.node] += block,
            Partner::Node { node, .. } => {
                sums.right[node] -= force;
                let nodes = Linked::new(u32::MAX, &[self.node as u32, node as u32]);
                let mut weights = [0.0; MAX_ENDS];
                weights[..2].copy_from_slice(&[1.0, -1.0]);
                sums.compounds.push(Compound { nodes, weights, block });
            }
        }
    }
}

impl Contact {
    /// Adds a force on a point of several particles, and its stiffness.
    fn add_to_all(&self, force: DVec3, block: Symmetric, sums: &mut Sums) {
        if self.count == 0 {
            sums.right[self.node] += force * self.weight;
            sums.diagonal[self.node] += block.scaled(self.weight * self.weight);
            return;
        }
        let mut nodes = [self.node as u32; MAX_ENDS];
        let mut weights = [0.0; MAX_ENDS];
        weights[0] = self.weight;
        sums.right[self.node] += force * self.weight;
        for (place, (node, weight)) in self.others[..self.count].iter().enumerate() {
            (nodes[place + 1], weights[place + 1]) = (*node as u32, *weight);
            sums.right[*node] += force * *weight;
        }
        let nodes = Linked::new(u32::MAX, &nodes[..=self.count]);
        sums.compounds.push(Compound { nodes, weights, block });
    }
}
