//! Backward Euler: v' = v + h a(x', v'), x' = x + h v'. First order; stable for every substep.
//!
//! Baraff and Witkin, *Large steps in cloth simulation* (1998), took one Newton step on these equations;
//! here they are solved, as the minimum of a potential (Martin et al., *Example-based elastic
//! materials*, 2011; Liu et al., *Fast simulation of mass-spring systems*, 2013):
//!
//! Φ(x') = Σ ½ (m/h² + ν/h) ‖x' − y‖² + Σ ½ k (‖s(x')‖ − l0)² + Σ ½ (c/h) (‖s(x')‖ − ‖s(x)‖)²
//!
//! where y is where the particle flies without elements, and s is the separation of an element. The last sum is
//! the dampers: their elongation rate is (‖s'‖ − ‖s‖)/h, and their force acts along the element as it is in the
//! end, so that it conserves momentum and angular momentum. Pinned particles are where they will be.
//!
//! The two stages of TR-BDF2 are such steps too (`tr_bdf2.rs`).
//!
//! Each island is solved by itself, so that it moves to the bit as it would alone. Newton's method:
//! `system.rs` linearises, the graph's `elimination.rs` orders the unknowns so that trees of springs and ropes that
//! resist bending are eliminated directly, `conjugate_gradient.rs` solves for the rest.

mod backtrack;
mod backward_euler;
mod balance;
mod block;
mod clusters;
mod conjugate_gradient;
mod contact;
mod contacts;
mod core;
mod coupling;
mod features;
mod follow;
mod friction;
mod gas;
mod island;
mod lanes;
mod linearised;
mod newton;
mod preconditioner;
mod published;
mod remembered;
mod surfaces;
mod surplus;
mod system;
mod tethers;
mod tr_bdf2;
mod trees;
mod wide;

use bevy::math::{DVec3, Vec3};

use crate::solver::collision::{
    ContactForce, ContactMemory, ContactRecord, Obstacles, StiffContact, StiffPair, Surfaces, Surroundings,
};
use crate::solver::elements::Elements;
use crate::solver::field::Field;
use crate::solver::graph::{Elimination, IslandSet, Islands, sprung_pinned};
use crate::solver::particles::{Particles, Vectors};
use crate::solver::pulls::Pulls;
use crate::solver::state::Version;
pub(in crate::solver) use backtrack::{EnergyCorrection, StepEndpoints};
use clusters::Clusters;
use contacts::PairFilter;
use features::IslandFeatures;
use newton::{MAX_STEPS, Newton};
use system::System;
use tr_bdf2::{Context, Stages};

/// The islands that the scheme advances: the order of elimination, and working memory.
#[derive(Debug, Clone, Default)]
pub(in crate::solver) struct ImplicitEuler {
    islands: Vec<Island>,
    /// Slots of the particles in no island, and of pinned ones where it advances all.
    others: Vec<u32>,
    /// The pinned slots that any element pulls at.
    sprung: Vec<u32>,
    obstacles: Obstacles,
    clusters: Clusters,
    /// The contacts of the last step.
    touched: Touched,
    key: Option<(Version, Version, Version)>,
}

/// The contacts of a step.
#[derive(Debug, Clone, Default)]
struct Touched {
    records: Vec<ContactRecord>,
    forces: Vec<ContactForce>,
}

impl Touched {
    fn clear(&mut self) {
        self.records.clear();
        self.forces.clear();
    }

    /// Keeps those of particles in these slots.
    fn retain(&mut self, keeps: impl Fn(usize) -> bool) {
        self.records.retain(|record| keeps(record.slot));
        self.forces.retain(|force| force.ends.slots().all(&keeps));
    }
}

#[derive(Debug, Clone, Default)]
struct Island {
    elimination: Elimination,
    system: System,
    newton: Newton,
    /// Its springs to pinned particles: the node, the pinned slot and the spring.
    anchors: Vec<(u32, u32, u32)>,
    /// The nodes and pinned slots that do not collide.
    excluded: Vec<(u32, u32)>,
    /// The contacts between its own particles, where it is a cluster of islands, and the node of each slot.
    pairs: Vec<StiffPair>,
    surfaces: Vec<StiffContact>,
    node_of: Vec<u32>,
    stages: Stages,
    /// Its edges and triangles that collide.
    features: IslandFeatures,
}

/// What the islands have in common in a step.
#[derive(Clone, Copy)]
struct Step<'a> {
    elements: &'a Elements,
    field: Field<'a>,
    /// Its duration, s.
    h: f64,
    obstacles: &'a Obstacles,
    /// The pinned slots that any element pulls at.
    sprung: &'a [u32],
    surroundings: Surroundings<'a>,
}

impl<'a> Step<'a> {
    fn context(self, elimination: &'a Elimination) -> Context<'a> {
        Context { elimination, elements: self.elements, field: self.field, h: self.h }
    }
}

impl ImplicitEuler {
    /// Chooses what it advances: the `wanted` particles, or all of them.
    pub fn prepare(
        &mut self,
        elements: &Elements,
        particles: &Particles,
        islands: &Islands,
        wanted: Option<&IslandSet>,
    ) {
        let set = wanted.map_or(Version::default(), IslandSet::version);
        let key = Some((elements.ends_version(), particles.free_version(), set));
        if self.key == key {
            return;
        }
        self.key = key;
        let is_wanted = |island: usize| wanted.is_none_or(|wanted| wanted.contains_island(island));
        let eliminations = Elimination::of_islands(elements, particles, islands, is_wanted);
        self.islands.clear();
        self.islands.extend(eliminations.into_iter().map(Island::new));
        let is_lone =
            |slot: &u32| islands.of(*slot as usize).is_none() && !particles.is_pinned(*slot as usize);
        let lone = (0..particles.len() as u32).filter(is_lone);
        self.clusters.reset(&self.islands, lone, particles.len());
        self.sprung = sprung_pinned(elements, particles);
        let is_other = |slot: &u32| {
            let slot = *slot as usize;
            islands.of(slot).is_none()
                && wanted.is_none_or(|wanted| wanted.contains(islands, particles, slot))
        };
        self.others.clear();
        self.others.extend((0..particles.len() as u32).filter(is_other));
    }

    /// The slots of the particles that it advances.
    pub fn slots(&self) -> impl Iterator<Item = usize> {
        self.island_slots().chain(self.others.iter().map(|slot| *slot as usize))
    }

    /// The contacts of the last step.
    pub fn touching(&self) -> &[ContactRecord] {
        &self.touched.records
    }

    /// Has the `memory` keep the forces of the contacts of the last step, for the next one; those of what sleeps are kept.
    pub fn remember_forces(&mut self, memory: &mut ContactMemory, is_asleep: impl Fn(usize) -> bool) {
        memory.forces.replace(&mut self.touched.forces, is_asleep);
    }

    /// The particles in no island that were advanced with those that they met in the last step, with their positions
    /// and velocities before.
    pub fn lone_advanced(&self) -> impl Iterator<Item = (usize, [Vec3; 2])> {
        self.clusters.lone_advanced()
    }

    /// Writes the tension of each element at the end of the last step, N, by its number.
    pub fn read_tensions(&self, tensions: &mut [f64]) {
        self.islands.iter().chain(self.clusters.islands()).for_each(|island| island.read_tensions(tensions));
    }

    /// The slots of the particles in islands that it advances.
    pub fn island_slots(&self) -> impl Iterator<Item = usize> {
        self.islands.iter().flat_map(Island::slots)
    }

    /// Advances what it has been [prepared](Self::prepare) for; with `pulls` by TR-BDF2, where the present motion of an
    /// island allows it.
    pub fn advance(
        &mut self,
        elements: &Elements,
        particles: &mut Particles,
        field: Field,
        acceleration: &mut Vectors,
        (surroundings, surfaces): (Surroundings, &mut Surfaces),
        mut pulls: Option<&mut Pulls>,
        substep: f32,
    ) {
        let h = f64::from(substep);
        self.obstacles.gather(particles, surroundings, h);
        let Self { islands, others, obstacles, clusters, sprung, touched, .. } = self;
        touched.clear();
        let step = Step { elements, field, h, obstacles, sprung, surroundings };
        let particles_collide = surroundings.settings.pair_rules.is_some();
        clusters.begin(particles, particles_collide);
        for island in &mut *islands {
            island.exclude_pairs(particles, elements);
            let is_second_order = match &pulls {
                Some(pulls) if !island.is_on_ramp(elements) => {
                    island.advance_tr_bdf2(step, particles, acceleration, pulls)
                }
                Some(_) => false,
                None => false,
            };
            if !is_second_order {
                island.advance_backward_euler(step, particles, acceleration, touched);
            }
            if let Some(pulls) = &mut pulls {
                island.keep_pulls(particles, pulls);
            }
        }
        for slot in others.iter().map(|slot| *slot as usize) {
            if particles.is_pinned(slot) {
                acceleration.set(slot, Vec3::ZERO);
                continue;
            }
            let motion = match &pulls {
                Some(_) => field.free_motion(particles, slot, h),
                None => {
                    let velocity = field.free_velocity(particles, slot, h);
                    [particles.position.get(slot).as_dvec3() + h * velocity, velocity]
                }
            };
            write(particles, acceleration, slot, motion, h);
        }
        if particles_collide {
            let parts = (&islands[..], &others[..], surfaces);
            clusters.advance(parts, step, particles, acceleration, touched, pulls);
        }
    }
}

impl Island {
    /// TR-BDF2; false, and nothing done, where the step is one for backward Euler.
    fn advance_tr_bdf2(
        &mut self,
        step: Step,
        particles: &mut Particles,
        acceleration: &mut Vectors,
        pulls: &Pulls,
    ) -> bool {
        let context = step.context(&self.elimination);
        if !self.stages.begin(context, particles, pulls) {
            return false;
        }
        self.stages.begin_trapezoid(&mut self.system, context);
        self.newton.minimise(&mut self.system, &self.elimination, MAX_STEPS);
        self.balance();
        let context = step.context(&self.elimination);
        self.stages.begin_difference(&mut self.system, context);
        self.newton.minimise(&mut self.system, &self.elimination, MAX_STEPS);
        self.balance();
        if step.obstacles.any_thin() {
            let Surroundings { features, features_version, .. } = step.surroundings;
            self.refresh_features(features, features_version, particles.len());
            if self.features_enter(particles, step) {
                return false;
            }
        }
        let Self { elimination, system, stages, excluded, .. } = self;
        let context = step.context(elimination);
        let (memory, families) = (step.surroundings.memory, particles.families());
        let filter = PairFilter { excluded, sprung: step.sprung, memory, families };
        if stages.enters_obstacle(system, context, particles, (step.obstacles, step.surroundings, &filter))
            || stages.gains_energy(system, context)
        {
            return false;
        }
        stages.finish(system, context, particles, acceleration);
        true
    }

    /// Writes positions, velocities and accelerations back; what `rebounds` gets the last step for a change of its
    /// velocity.
    fn finish(&self, particles: &mut Particles, acceleration: &mut Vectors, h: f64, rebounds: bool) {
        let free = self.elimination.slots[..self.elimination.free].iter();
        for ((slot, &position), step) in free.zip(&self.system.position).zip(&self.system.step) {
            let slot = *slot as usize;
            let rebound = if rebounds { *step } else { DVec3::ZERO };
            let velocity = (position - particles.position.get(slot).as_dvec3() + rebound) / h;
            write(particles, acceleration, slot, [position, velocity], h);
        }
        if !rebounds {
            self.rest(particles);
        }
    }
}

impl Island {
    /// Stops what is held and has moved by less than the rounding of its position.
    fn rest(&self, particles: &mut Particles) {
        let System { start, contacts, .. } = &self.system;
        for node in contacts.held_nodes() {
            let slot = self.elimination.slots[node] as usize;
            if particles.position.get(slot) == start[node].as_vec3() {
                particles.velocity.set(slot, Vec3::ZERO);
            }
        }
    }
}

/// Gives a particle its new position and velocity.
#[inline]
fn write(
    particles: &mut Particles,
    acceleration: &mut Vectors,
    slot: usize,
    [position, velocity]: [DVec3; 2],
    h: f64,
) {
    let change = velocity - particles.velocity.get(slot).as_dvec3();
    particles.position.set(slot, position.as_vec3());
    particles.velocity.set(slot, velocity.as_vec3());
    acceleration.set(slot, (change / h).as_vec3());
}
