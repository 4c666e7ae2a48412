//! The physics, independent of entities, worlds and components.
//!
//! Users of the plugin never need it. It is the interface for programs without Bevy's ECS, and for tests and measurements of
//! the physics alone: a [`Solver`] holds particles and springs, numbered in the order in which they are added, and
//! [`step`](Solver::step) advances them by one tick.
//!
//! ```text
//! plan: which scheme for each island, how many substeps
//! for each substep:   forces → integrate → move the pinned → contacts
//! outputs: contacts, tensions, reactions
//! ```
//!
//! ```
//! use bevy::math::Vec3;
//! use bevy_mass_spring::solver::{Integrator, Solver, Spring, StepSettings, SubstepMode};
//!
//! let mut solver = Solver::default();
//! let anchor = solver.add_particle(Vec3::Y, Vec3::ZERO, f32::INFINITY, 0.0)?;
//! let bob = solver.add_particle(Vec3::ZERO, Vec3::ZERO, 1.0, 0.0)?;
//! solver.add_spring([anchor, bob], Spring { rest_length: 1.0, stiffness: 981.0, damping: 20.0, ..Spring::default() })?;
//! let settings = StepSettings { gravity: Vec3::new(0.0, -9.81, 0.0), ..Default::default() };
//! for _ in 0..600 {
//!     solver.step(&settings);
//! }
//! // Stretched by m g / k.
//! assert!((solver.position(bob).y + 0.01).abs() < 1e-5);
//! # Ok::<(), bevy_mass_spring::solver::SolverError>(())
//! ```
//!
//! Inside, `state.rs` is exactly what the next ticks depend on, `elements/` the forces between particles, `graph/` connectivity,
//! `stability/` how long substeps may be, `schemes/` how they integrate, `collision/` the contacts, `step.rs` the
//! tick. All but the state are caches.

mod air;
mod api;
mod buckets;
mod collision;
mod elements;
mod energy;
mod failures;
mod field;
mod graph;
mod gusts;
mod kernel;
mod outputs;
pub(crate) mod parallel;
pub(crate) mod particles;
pub(crate) mod pulls;
mod schemes;
mod settings;
mod sleep;
mod stability;
mod state;
mod step;
mod strain_limit;
mod surfaces;
mod validation;

pub use api::{Solver, SolverError};
pub use collision::{
    Collider, CombineRule, ContactPartner, ContactProperties, ContactRecord, Exemptions, Layers, Material,
    MeshError, MeshKind, Pose, Shape,
};
pub(crate) use collision::{Crossing, Nearest, PlacedShape, Simplex};
pub use elements::{Bend, Face, Filament, Gas, GasReading, Plasticity, Spring, enclosed_volume};
pub use energy::Measurements;
pub(crate) use energy::measure;
pub use outputs::{Broken, Outputs};
pub use particles::PinnedMotion;
pub use settings::{Gusts, Integrator, PairRules, Sleep, StepSettings, SubstepMode, UnknownIntegrator};
pub use stability::{FrequencyBounds, MAX_SUBSTEPS, Plan};
pub use state::State;
pub(crate) use state::{NetElements, NetRanges, Version};
pub use step::Inputs;
pub(crate) use step::{Caches, step};
