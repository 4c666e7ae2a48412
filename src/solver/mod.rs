//! The physics, pure: flat arrays in, flat arrays out. It knows no entity, no world and no component.
//!
//! [`SolverState`] holds one array for each coordinate of each quantity (structure of arrays), indexed
//! by *slot*; [`step`] advances it by one tick:
//!
//! ```text
//! for each substep:   forces → integrate → move the pinned → contacts
//! ```
//!
//! All of it is public, so that a simulation can run without Bevy's ECS and so that every formula can
//! be tested and measured by itself.
//!
//! ```
//! use bevy::math::Vec3;
//! use bevy_mass_spring::solver::{Scheme, SolverState, StepSettings, step};
//!
//! let mut state = SolverState::default();
//! state.particles.push(Vec3::new(0.0, 10.0, 0.0), Vec3::ZERO, 1.0, 0.0);
//! let settings = StepSettings {
//!     scheme: Scheme::SecondOrderTaylor,
//!     substeps: 1,
//!     time_step: 0.5,
//!     gravity: Vec3::new(0.0, -9.81, 0.0),
//!     ..Default::default()
//! };
//! step(&mut state, &settings);
//! assert_eq!(state.particles.position.get(0).y, 10.0 - 0.5 * 9.81 * 0.25);
//! ```

mod batches;
pub(crate) mod blocks;
pub mod contacts;
pub mod energy;
pub mod forces;
pub mod integrators;
mod kernel;
mod mixture;
pub mod ordering;
pub mod particles;
pub mod springs;
pub mod stability;

use bevy::math::Vec3;

pub use contacts::{ContactRecord, Contacts, PairRules, Plane};
pub use integrators::Scheme;
pub use particles::{Particles, Vectors};
pub use springs::Springs;

/// Everything that one tick reads and writes.
#[derive(Debug, Clone, Default)]
pub struct SolverState {
    /// The particles.
    pub particles: Particles,
    /// The springs between them.
    pub springs: Springs,
    /// Where each pinned particle goes in this tick.
    pub pinned: Vec<PinnedMotion>,
    /// Slots of the free particles that implicit Euler advances, if
    /// [`stiff_substeps`](StepSettings::stiff_substeps) > 0. No spring joins them with other free ones.
    pub stiff: Vec<usize>,
    /// Planes, touching pairs and what is remembered of them.
    pub contacts: Contacts,
    scratch: integrators::Scratch,
    mixture: mixture::Mixture,
}

/// The prescribed motion of a pinned particle in one tick: a straight line at constant velocity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PinnedMotion {
    /// Slot of the particle; its inverse mass is 0.
    pub slot: usize,
    /// Position at the start of the tick, m.
    pub start: Vec3,
    /// Position at the end of the tick, m, reached exactly.
    pub target: Vec3,
}

/// The parameters of one tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepSettings {
    /// The integration scheme. Default semi-implicit Euler.
    pub scheme: Scheme,
    /// Number of equal substeps, >= 1. Default 1.
    pub substeps: u32,
    /// Number of equal steps that implicit Euler takes with the particles of [`SolverState::stiff`], while
    /// `scheme` advances the others; `substeps` is a multiple of it, or counts as the next one. 0, the
    /// default: `scheme` advances all.
    pub stiff_substeps: u32,
    /// Duration of the whole tick in s, > 0. Default 1/60.
    pub time_step: f32,
    /// Acceleration of gravity, m/s². Default 0.
    pub gravity: Vec3,
    /// Viscosity of the medium ν, N·s/m, >= 0. Default 0.
    pub viscosity: f32,
    /// Whether particles collide with planes. Default true.
    pub collide_with_planes: bool,
    /// How particles collide with each other; `None`: not at all. Default `None`.
    pub pair_rules: Option<PairRules>,
}

impl Default for StepSettings {
    fn default() -> Self {
        Self {
            scheme: Scheme::SemiImplicitEuler,
            substeps: 1,
            stiff_substeps: 0,
            time_step: 1.0 / 60.0,
            gravity: Vec3::ZERO,
            viscosity: 0.0,
            collide_with_planes: true,
            pair_rules: None,
        }
    }
}

/// Advances `state` by one tick of `settings.time_step` seconds.
///
/// Never panics on values: what overflows becomes non-finite, and is the caller's to find.
pub fn step(state: &mut SolverState, settings: &StepSettings) {
    let substeps = settings.substeps.max(1).next_multiple_of(settings.stiff_substeps.max(1));
    let substep = settings.time_step / substeps as f32;
    for motion in &state.pinned {
        state.particles.position.set(motion.slot, motion.start);
        state.particles.velocity.set(motion.slot, (motion.target - motion.start) / settings.time_step);
    }
    state.contacts.begin_tick();
    integrators::begin_tick(state, settings);
    if settings.stiff_substeps > 0 {
        mixture::begin_tick(state);
    }
    for index in 0..substeps {
        state.contacts.begin_substep(&state.particles, settings);
        if settings.stiff_substeps > 0 {
            mixture::advance(state, settings, [index, substeps], substep);
        } else {
            integrators::advance(state, settings, substep);
        }
        let elapsed = if index + 1 == substeps { 1.0 } else { (index + 1) as f32 / substeps as f32 };
        move_pinned(state, elapsed);
        state.contacts.resolve(&mut state.particles, &state.springs, settings, substep, elapsed);
        if state.contacts.count() > 0 {
            integrators::note_disturbance(state);
        }
    }
    state.particles.position.clear_traces();
    state.particles.velocity.clear_traces();
}

/// Puts the pinned particles where they are after the fraction `elapsed` of the tick.
fn move_pinned(state: &mut SolverState, elapsed: f32) {
    for motion in &state.pinned {
        let position = if elapsed == 1.0 { motion.target } else { motion.start.lerp(motion.target, elapsed) };
        state.particles.position.set(motion.slot, position);
    }
}
