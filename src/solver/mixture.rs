//! Two schemes in one tick: implicit Euler for what is stiff, an explicit scheme for all else.
//!
//! Implicit Euler changes the velocity, v' = v + h a(x', v'), and then moves with it, x' = x + h v'. So a
//! long step of it passes through the short substeps of the explicit scheme as a *kick* at its start and
//! a *glide* at constant velocity:
//!
//! ```text
//! stiff   kick ──────────────► x'   kick ──────────────► x'
//! soft    │ substep │ substep │     │ substep │ substep │
//! contacts          ▲         ▲               ▲         ▲
//! ```
//!
//! A stiff particle that touches nothing ends each step where it would without the others, to the bit. What
//! a contact changes on the way is glided on with, until the next kick.
//!
//! No spring joins the two kinds, so each is advanced with the other one held: as if it were pinned. An
//! explicit scheme moves a pinned particle at its velocity.

use bevy::math::Vec3;

use super::integrators::{self, Scheme};
use super::{SolverState, StepSettings};

/// What is kept within a tick.
#[derive(Debug, Clone, Default)]
pub(super) struct Mixture {
    /// One for each stiff particle.
    glides: Vec<Glide>,
    /// Inverse masses with the stiff particles held.
    soft_inverse_mass: Vec<f32>,
    /// Inverse masses with the others held.
    stiff_inverse_mass: Vec<f32>,
}

/// A straight way at constant velocity.
#[derive(Debug, Clone, Copy, Default)]
struct Glide {
    start: Vec3,
    target: Vec3,
    velocity: Vec3,
    /// The change of the velocity by the kick, m/s.
    kick: Vec3,
    /// The substep of the long step in which it started.
    begun: u32,
    /// Where the particle was put last.
    place: Vec3,
}

/// Sorts the particles into stiff ones and others.
pub(super) fn begin_tick(state: &mut SolverState) {
    let SolverState { particles, stiff, mixture, .. } = state;
    let Mixture { glides, soft_inverse_mass, stiff_inverse_mass } = mixture;
    glides.clear();
    glides.resize(stiff.len(), Glide::default());
    soft_inverse_mass.clone_from(&particles.inverse_mass);
    stiff_inverse_mass.clear();
    stiff_inverse_mass.resize(particles.len(), 0.0);
    for &slot in &*stiff {
        std::mem::swap(&mut soft_inverse_mass[slot], &mut stiff_inverse_mass[slot]);
    }
}

/// Advances everything by the substep of this `number`, of `count` in the tick.
pub(super) fn advance(
    state: &mut SolverState,
    settings: &StepSettings,
    [number, count]: [u32; 2],
    substep: f32,
) {
    let ratio = count / settings.stiff_substeps;
    let done = number % ratio;
    if done == 0 {
        kick(state, settings);
    } else {
        notice_impacts(state, done, (ratio - done) as f32 * substep);
    }
    std::mem::swap(&mut state.particles.inverse_mass, &mut state.mixture.soft_inverse_mass);
    integrators::advance(state, settings, substep);
    std::mem::swap(&mut state.particles.inverse_mass, &mut state.mixture.soft_inverse_mass);
    integrators::note_disturbance(state);
    let SolverState { particles, stiff, mixture, .. } = state;
    for (glide, &slot) in mixture.glides.iter_mut().zip(&*stiff) {
        glide.place = glide.after(done + 1, ratio);
        particles.position.set(slot, glide.place);
        if done == 0 {
            // The whole kick falls into this substep.
            particles.acceleration.set(slot, glide.kick / substep);
        }
    }
}

/// Lets implicit Euler find the velocities and targets of the next long step.
fn kick(state: &mut SolverState, settings: &StepSettings) {
    for (glide, &slot) in state.mixture.glides.iter_mut().zip(&state.stiff) {
        glide.begun = 0;
        glide.start = state.particles.position.get(slot);
        glide.velocity = state.particles.velocity.get(slot);
    }
    let step = settings.time_step / settings.stiff_substeps as f32;
    let implicit = StepSettings { scheme: Scheme::ImplicitEuler, ..*settings };
    std::mem::swap(&mut state.particles.inverse_mass, &mut state.mixture.stiff_inverse_mass);
    integrators::advance(state, &implicit, step);
    std::mem::swap(&mut state.particles.inverse_mass, &mut state.mixture.stiff_inverse_mass);
    for (glide, &slot) in state.mixture.glides.iter_mut().zip(&state.stiff) {
        let velocity = state.particles.velocity.get(slot);
        glide.kick = velocity - glide.velocity;
        glide.velocity = velocity;
        glide.target = state.particles.position.get(slot);
    }
}

/// Sends those on a new way that a contact has displaced or that have another velocity, with `left` seconds
/// of the long step to go.
fn notice_impacts(state: &mut SolverState, done: u32, left: f32) {
    for (glide, &slot) in state.mixture.glides.iter_mut().zip(&state.stiff) {
        let (position, velocity) = (state.particles.position.get(slot), state.particles.velocity.get(slot));
        if position != glide.place || velocity != glide.velocity {
            *glide = Glide {
                start: position,
                target: position + left * velocity,
                velocity,
                begun: done,
                ..*glide
            };
        }
    }
}

impl Glide {
    /// Where it has come after `done` of `count` substeps of the long step.
    fn after(&self, done: u32, count: u32) -> Vec3 {
        match done == count {
            true => self.target,
            false => self.start.lerp(self.target, (done - self.begun) as f32 / (count - self.begun) as f32),
        }
    }
}
