//! What stops gains no energy.
//!
//! Forces do no work on what does not move: the part of its displacement that a stopped particle does not go is the part of the
//! velocity that forces gave it in the substep which it loses. Else what is jammed would swing up. Particles that stop each other
//! keep the momentum of all that they lose together, unless what is pinned stops them, which bears it.

use bevy::math::{DVec3, Vec3};

use crate::solver::particles::{Particles, Vectors};

/// What particles lose that stop each other.
#[derive(Debug, Clone, Copy, Default)]
struct StoppedGroup {
    /// kg·m/s.
    momentum: DVec3,
    /// kg.
    mass: f64,
    /// Whether pinned particles are among them.
    is_held: bool,
}

/// Working memory.
#[derive(Debug, Clone, Default)]
pub(super) struct ForceVelocities {
    /// By slot: what forces have changed the velocities by, m/s; until they have, the velocities before.
    by_forces: Vectors,
    /// By slot: another one of those that stop each other in this substep, or itself. Empty if nothing has stopped.
    parents: Vec<u32>,
    /// By slot, of those that are their own parents; else none.
    groups: Vec<StoppedGroup>,
    /// The pinned ones among those that stop each other.
    pinned: Vec<u32>,
}

impl ForceVelocities {
    /// To be called before the velocities change by forces.
    pub fn begin(&mut self, particles: &Particles) {
        self.by_forces.copy_from(&particles.velocity);
    }

    /// To be called when they have.
    pub fn end(&mut self, particles: &Particles) {
        self.by_forces.subtract_from(&particles.velocity);
    }

    /// Nothing has been stopped in this substep yet.
    pub fn clear(&mut self) {
        self.parents.clear();
        self.pinned.clear();
    }

    /// The particles in these slots stop each other.
    pub fn join(&mut self, slots: impl IntoIterator<Item = u32>, particles: &Particles) {
        if self.parents.is_empty() {
            self.parents.extend(0..particles.len() as u32);
            self.groups.resize(particles.len(), StoppedGroup::default());
        }
        let mut joined = None;
        for slot in slots {
            if particles.is_pinned(slot as usize) {
                self.pinned.push(slot);
            }
            let root = self.root(slot);
            let other = joined.map_or(root, |joined| self.root(joined));
            self.parents[root.max(other) as usize] = root.min(other);
            joined = Some(slot);
        }
    }

    fn root(&mut self, mut slot: u32) -> u32 {
        while self.parents[slot as usize] != slot {
            let above = self.parents[slot as usize];
            self.parents[slot as usize] = self.parents[above as usize];
            slot = self.parents[slot as usize];
        }
        slot
    }

    /// Takes from stopped particles, each of which is listed once with the part of its displacement that it goes, what forces have given
    /// them on the rest of it.
    pub fn lose(&mut self, particles: &mut Particles, stopped: &[(u32, f32)]) {
        // Only an implicit step has stopped anything.
        if self.parents.is_empty() {
            return;
        }
        for number in 0..self.pinned.len() {
            let root = self.root(self.pinned[number]);
            self.groups[root as usize].is_held = true;
        }
        for (number, part) in stopped.iter().copied() {
            let (root, slot) = (self.root(number) as usize, number as usize);
            let mass = 1.0 / f64::from(particles.inverse_mass()[slot]);
            self.groups[root].mass += mass;
            self.groups[root].momentum += mass * ((1.0 - part) * self.by_forces.get(slot)).as_dvec3();
        }
        for (number, part) in stopped.iter().copied() {
            let (root, slot) = (self.root(number) as usize, number as usize);
            let StoppedGroup { momentum, mass, is_held } = self.groups[root];
            let shared = if is_held { Vec3::ZERO } else { (momentum / mass).as_vec3() };
            let by_force = self.by_forces.get(slot);
            particles.velocity.set(slot, particles.velocity.get(slot) - (1.0 - part) * by_force + shared);
            self.by_forces.set(slot, part * by_force + shared);
        }
        self.groups.fill(StoppedGroup::default());
    }
}
