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
//! end, so that momentum and angular momentum know nothing of it. Pinned particles are where they will be.
//!
//! Each island is solved by itself, so that it moves to the bit as it would alone. Newton's method:
//! `system.rs` linearises, the graph's `elimination.rs` orders the unknowns so that trees of springs are
//! eliminated directly, `conjugate_gradient.rs` solves for the rest.

mod block;
mod conjugate_gradient;
mod core;
mod newton;
mod preconditioner;
mod system;

use bevy::math::{DVec3, Vec3};

use crate::solver::elements::Elements;
use crate::solver::graph::{Elimination, IslandSet, Islands};
use crate::solver::particles::{Particles, Vectors};
use crate::solver::settings::Field;
use crate::solver::state::Version;
use newton::Newton;
use system::System;

/// The islands that the scheme advances: the order of elimination, and working memory.
#[derive(Debug, Clone, Default)]
pub(in crate::solver) struct ImplicitEuler {
    islands: Vec<Island>,
    /// Slots of the particles in no island, and of pinned ones where it advances all.
    others: Vec<u32>,
    key: Option<(Version, Version, Version)>,
}

#[derive(Debug, Clone, Default)]
struct Island {
    elimination: Elimination,
    system: System,
    newton: Newton,
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
        self.islands.extend(eliminations.into_iter().map(|elimination| {
            let mut system = System::default();
            system.resize(&elimination);
            Island { elimination, system, newton: Newton::default() }
        }));
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
        let islands = self
            .islands
            .iter()
            .flat_map(|Island { elimination, .. }| elimination.slots[..elimination.free].iter());
        islands.chain(&self.others).map(|slot| *slot as usize)
    }

    /// Advances what it has been [prepared](Self::prepare) for.
    pub fn advance(
        &mut self,
        elements: &Elements,
        particles: &mut Particles,
        field: Field,
        acceleration: &mut Vectors,
        substep: f32,
    ) {
        let h = f64::from(substep);
        for island in &mut self.islands {
            island.system.begin(&island.elimination, particles, elements, field, h);
            island.newton.minimise(&mut island.system, &island.elimination);
            island.balance();
            island.finish(particles, acceleration, h);
        }
        for slot in self.others.iter().map(|slot| *slot as usize) {
            if particles.is_pinned(slot) {
                acceleration.set(slot, Vec3::ZERO);
                continue;
            }
            let velocity = particles.free_velocity(slot, field, h);
            let position = particles.position.get(slot).as_dvec3() + h * velocity;
            write(particles, acceleration, slot, [position, velocity], h);
        }
    }
}

impl Island {
    /// Moves an island that hangs on nothing as a whole, to where it has the momentum that it must have:
    /// Σ (m/h² + ν/h) (x' − y) = 0, as elements add none. It would be so by itself, had the equations of the core
    /// been solved to the last bit.
    fn balance(&mut self) {
        let Self { elimination, system, .. } = self;
        if elimination.trees == elimination.free || elimination.is_anchored() {
            return;
        }
        let (mut drift, mut inertia) = (DVec3::ZERO, 0.0);
        for node in 0..elimination.free {
            drift += system.inertia[node] * (system.position[node] - system.flight[node]);
            inertia += system.inertia[node];
        }
        for position in &mut system.position[..elimination.free] {
            *position -= drift / inertia;
        }
    }

    /// Writes positions, velocities and accelerations back.
    fn finish(&self, particles: &mut Particles, acceleration: &mut Vectors, h: f64) {
        let free = self.elimination.slots[..self.elimination.free].iter();
        for (slot, &position) in free.zip(&self.system.position) {
            let slot = *slot as usize;
            let velocity = (position - particles.position.get(slot).as_dvec3()) / h;
            write(particles, acceleration, slot, [position, velocity], h);
        }
    }
}

/// Gives a particle its new position and velocity.
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
