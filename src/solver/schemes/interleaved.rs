//! Two schemes in one tick: TR-BDF2 for the stiff islands, an explicit scheme for all others.
//!
//! A long step of TR-BDF2 passes through the short substeps of the explicit scheme as a *kick* at its start, which
//! gives the velocity of its end, and a *linear path* along the straight line from x to x':
//!
//! ```text
//! stiff   kick ──────────────► x'   kick ──────────────► x'
//! soft    │ substep │ substep │     │ substep │ substep │
//! contacts          ▲         ▲               ▲         ▲
//! ```
//!
//! No element joins the two kinds, and each scheme writes its own particles only, so an island that touches
//! nothing ends each step where it would without the others, to the bit. A contact on the way changes velocities; on the next
//! kick elements answer to them. Until then particles that elements join come back to their paths: one that left the others would
//! stretch stiff springs. Others fly on as the contact has sent them.

use bevy::math::Vec3;

use super::ImplicitEuler;
use crate::solver::particles::{Particles, Vectors};

/// The motion of the stiff particles within a tick: working memory.
#[derive(Debug, Clone, Default)]
pub(in crate::solver) struct Interleaved {
    paths: Vec<LinearPath>,
    /// Number of those of the stiff islands; behind them are those of particles that these have met.
    own: usize,
    /// Number of those among them that elements join to others: they come first.
    joined: usize,
}

/// A straight path at constant velocity.
#[derive(Debug, Clone, Copy, Default)]
struct LinearPath {
    slot: usize,
    start: Vec3,
    target: Vec3,
    velocity: Vec3,
    /// The change of the velocity by the kick, m/s.
    kick: Vec3,
    /// The substep of the long step in which it started.
    started: u32,
    /// Where the particle was put last.
    position: Vec3,
}

/// Where a substep lies in the long step that it belongs to.
#[derive(Clone, Copy)]
pub(in crate::solver) struct SubstepIndex {
    /// Substeps of the long step before it.
    pub done: u32,
    /// All substeps of the long step.
    pub count: u32,
    /// Their duration, s.
    pub substep: f32,
}

impl Interleaved {
    /// To be called before the first substep of a tick.
    pub fn begin_tick(&mut self, implicit_euler: &ImplicitEuler) {
        self.paths.clear();
        self.paths.extend(implicit_euler.slots().map(|slot| LinearPath { slot, ..LinearPath::default() }));
        self.own = self.paths.len();
        self.joined = implicit_euler.island_slots().count();
    }

    /// To be called before the explicit scheme advances the others by a substep within a long step: sends the stiff particles on
    /// that a contact has displaced or that have another velocity.
    pub fn follow_contacts(
        &mut self,
        particles: &Particles,
        SubstepIndex { done, count, substep }: SubstepIndex,
    ) {
        let left = (count - done) as f32 * substep;
        let Self { paths, joined, .. } = self;
        for (number, path) in paths.iter_mut().enumerate() {
            path.follow_contact(particles, done, left, number < *joined);
        }
    }

    /// To be called when a long step begins, before the stiff particles are advanced to its end.
    pub fn begin_step(&mut self, particles: &Particles) {
        self.paths.truncate(self.own);
        for path in &mut self.paths {
            path.started = 0;
            path.start = particles.position.get(path.slot);
            path.velocity = particles.velocity.get(path.slot);
        }
    }

    /// To be called after that: their paths lead there.
    pub fn begin_paths(&mut self, implicit_euler: &ImplicitEuler, particles: &Particles) {
        let own = &self.paths[..self.own];
        let added =
            implicit_euler.lone_advanced().filter(|(slot, _)| own.iter().all(|path| path.slot != *slot));
        let added: Vec<LinearPath> = added
            .map(|(slot, [start, velocity])| LinearPath { slot, start, velocity, ..LinearPath::default() })
            .collect();
        self.paths.extend(added);
        for path in &mut self.paths {
            let velocity = particles.velocity.get(path.slot);
            path.kick = velocity - path.velocity;
            path.velocity = velocity;
            path.target = particles.position.get(path.slot);
        }
    }

    /// To be called after the explicit scheme has advanced the others: puts the stiff particles where they are by
    /// now.
    pub fn after_substep(
        &mut self,
        particles: &mut Particles,
        acceleration: &mut Vectors,
        SubstepIndex { done, count, substep }: SubstepIndex,
    ) {
        for path in &mut self.paths {
            path.position = path.after(done + 1, count);
            particles.position.set(path.slot, path.position);
            particles.velocity.set(path.slot, path.velocity);
            // The whole kick falls into the first substep.
            acceleration.set(path.slot, if done == 0 { path.kick / substep } else { Vec3::ZERO });
        }
    }
}

impl LinearPath {
    /// Goes on from where a contact has put it, with the velocity that it got there: to where that leads, or, if it is
    /// `joined` to others, to where they are in balance.
    fn follow_contact(&mut self, particles: &Particles, done: u32, left: f32, is_joined: bool) {
        let (position, velocity) = (particles.position.get(self.slot), particles.velocity.get(self.slot));
        if position != self.position || velocity != self.velocity {
            let target = if is_joined { self.target } else { position + left * velocity };
            *self = Self { start: position, target, velocity, started: done, ..*self };
        }
    }

    /// Where it is after `done` of `count` substeps of the long step.
    fn after(&self, done: u32, count: u32) -> Vec3 {
        match done == count {
            true => self.target,
            false => {
                let share = (done - self.started) as f32 / (count - self.started) as f32;
                self.start.lerp(self.target, share)
            }
        }
    }
}
