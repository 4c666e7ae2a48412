//! Sleep: what rests costs nothing until something happens to it.
//!
//! Movable particles that elements join are a *part* ([`Parts`]); parts that touch are a *group*, which falls asleep and
//! wakes as a whole. While it sleeps its particles answer to forces as pinned ones do ([`Particles::put_to_sleep`]), so
//! that no scheme, contact or limit moves them, to the bit; where nothing is awake a tick ends before it begins.
//!
//! A group falls asleep when each particle of it, for the whole delay T,
//! - stayed within d = [`MAX_DISPLACEMENT_RATIO`] · speed · T of where it was when the delay began, at the end of each tick; one that nothing but
//!   contacts holds within [`CONTACT_DISPLACEMENT_PART`] of its radius, if that is more;
//! - was never faster than [`MAX_SPEED_RATIO`] · speed, so that what vibrates within d is no rest; of what touches something
//!   that is the mean over a tick, as contacts leave velocities of some g h at its end. So it is of all particles of its part, as
//!   which of them touch changes from substep to substep; those that do not are slower than [`BESIDE_RATIO`] times that at any moment;
//! - was pushed by the user with the same force;
//! - and is not held back by dampers or drag: at its mean velocity over the delay they accelerate it by less than
//!   2 speed / T. What creeps against them does not rest.
//!
//! A constant acceleration a moves a particle out of ± d in the time T unless a <= 16 d / T². So the forces on what falls asleep
//! are out of balance by at most (16 · 0.2 + 2) speed / T: 10.4 mm/s² with the default, a thousandth of gravity. A load m
//! on a spring of stiffness k falls asleep within m · 5.2 speed / (T k) of its equilibrium.
//!
//! `memory.rs` is what is remembered, `wake.rs` the start of a tick, `rest.rs` its end, `near.rs` the search,
//! `surroundings.rs` what pinned particles and colliders do.

mod memory;
mod near;
mod rest;
mod surroundings;
mod wake;

use bevy::math::DVec3;

use crate::solver::collision::ContactMemory;
use crate::solver::elements::{CollisionMesh, Elements, Exposed};
use crate::solver::graph::{Forest, Parts};
use crate::solver::particles::{Particles, Vectors};
use crate::solver::pulls::Pulls;
use crate::solver::settings::StepSettings;
pub(in crate::solver) use memory::SleepMemory;
use near::SleepingSpheres;
pub(super) use surroundings::Surroundings;

/// How far a resting particle may get in the delay, as a part of the displacement at the threshold speed.
const MAX_DISPLACEMENT_RATIO: f32 = 0.2;

/// How fast it may be, as a multiple of that speed: the velocity that is left in contacts of a pile is of the
/// order of what gravity gives in a substep, though its places are the same to the bit.
const MAX_SPEED_RATIO: f32 = 10.0;

/// How fast what touches nothing may be at any moment, as a multiple of that, where others of its part touch something. Beside the edges
/// of a box twice were seen.
const BESIDE_RATIO: f32 = 10.0;

/// How far a loose particle that touches something may get in the delay, as a part of its radius, where that is more: what lies
/// in a pile is no pendulum, and goes on settling by such displacements for long.
const CONTACT_DISPLACEMENT_PART: f32 = 0.01;

/// Falling asleep is considered this many times in a delay.
const CHECKS_PER_DELAY: f32 = 8.0;

/// What sleep has to do with of the state.
pub(super) struct Sleepers<'a> {
    pub memory: &'a mut SleepMemory,
    pub particles: &'a mut Particles,
    pub elements: &'a Elements,
    pub exposed: &'a Exposed,
    pub mesh: &'a CollisionMesh,
    pub contacts: &'a mut ContactMemory,
    pub pulls: &'a mut Pulls,
}

/// What is derived from the state for sleep, and working memory.
#[derive(Debug, Clone, Default)]
pub(super) struct SleepCaches {
    parts: Parts,
    spheres: SleepingSpheres,
    /// The names of groups to be woken, with how far around them is to be searched, m.
    waking: Vec<(u32, f32)>,
    /// Of each slot, whether the group of its name is to wake.
    is_waking: Vec<bool>,
    /// Of each part whether it stays awake.
    stays: Vec<bool>,
    forest: Forest,
    /// Of each slot how far from it something of it may touch a collider, m.
    reaches: Vec<f32>,
    /// Positions when the tick began, m.
    start: Vectors,
    /// Of each slot whether it touched something in the last substep; empty where none did.
    touches: Vec<bool>,
    /// Of each slot whether it is pinned and moves in the tick; empty where none does.
    moves: Vec<bool>,
    /// Accelerations by drag and dampers, m/s².
    braking: Vec<DVec3>,
}

impl SleepCaches {
    /// Whether no particle that forces could move is awake, and any sleeps; after the start of a tick.
    pub fn is_all(&self, memory: &SleepMemory) -> bool {
        memory.asleep() > 0 && memory.asleep() == self.parts.movable()
    }
}

/// The gap below which two things count as touching, m: resting contacts open up to the distance of free fall in a substep.
fn touching_gap(settings: &StepSettings) -> f32 {
    let StepSettings { gravity, time_step, sleep, .. } = settings;
    let speed = sleep.map_or(0.0, |sleep| sleep.speed);
    (gravity.length() * time_step + speed) * time_step
}
