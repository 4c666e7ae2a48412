//! Mass-spring physics for [Bevy](https://bevyengine.org): ropes, chains, cloth and jelly with
//! physical quantities as parameters (stiffness in N/m, damping in N·s/m, masses in kg).
//!
//! Add [`MassSpringPlugin`], spawn entities with [`Particle`], join them with [`Spring`]s:
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_mass_spring::prelude::*;
//!
//! # let mut app = App::new();
//! # app.add_plugins(MinimalPlugins);
//! app.add_plugins(MassSpringPlugin::default());
//! app.add_systems(Startup, |mut commands: Commands| {
//!     let anchor = commands.spawn((Particle::new(1.0, 0.1), Pinned, Transform::from_xyz(0.0, 3.0, 0.0))).id();
//!     let bob = commands.spawn((Particle::new(1.0, 0.1), Transform::from_xyz(0.0, 2.0, 0.0))).id();
//!     commands.spawn(Spring::new(anchor, bob, 1.0).with_stiffness(200.0).with_damping(2.0));
//!     commands.spawn(ParticleCollider::default()); // the ground, y = 0
//! });
//! # app.update();
//! ```
//!
//! Many particles on one entity are a net: a rope, a cloth, a jelly or a balloon of a material in physical units. The guide
//! is in the module [`nets`].
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_mass_spring::prelude::*;
//!
//! # let mut app = App::new();
//! # app.add_plugins(MinimalPlugins);
//! # app.add_plugins(MassSpringPlugin::default());
//! app.add_systems(Startup, |mut commands: Commands| {
//!     let hook = (Part::Start, Pinned);
//!     let lamp = (Part::End, AppliedForce(Vec3::NEG_Y * 5.0)); // N
//!     let rope = Rope::new(3.0).with_material(RopeMaterial::HEMP); // m
//!     // With `RopeMesh::default()` (feature `render`) it is drawn, too.
//!     commands.spawn((rope, related!(Parts[hook, lamp]), Transform::from_xyz(0.0, 4.0, 0.0)));
//! });
//! # app.update();
//! ```
//!
//! The position of a particle is its [`Transform`](bevy::prelude::Transform): moving it moves the
//! particle. [`Pinned`] particles go where their transform (or their moving parent) goes, and
//! drag along what hangs from them. [`Environment`] holds gravity and the viscosity of the medium,
//! [`SolverSettings`] the integration scheme, [`CollisionSettings`] what collides.
//!
//! One tick of Bevy's fixed clock runs three stages, [`MassSpringSystems`]: *Gather* copies the
//! components into the flat arrays of the [`solver`], *Step* integrates them, *Scatter* copies back.
//! [`TickReport`] says what the last tick did and what it cost.
//!
//! [`MassSpringPlugins`] is the group of all plugins of the crate, each of which can be disabled.

#![warn(missing_docs)]

pub mod bend;
pub mod collider;
pub mod diagnostics;
#[cfg(feature = "drag")]
pub mod drag;
pub mod environment;
#[cfg(feature = "gizmos")]
pub mod gizmos;
#[cfg(feature = "gltf")]
pub mod gltf;
#[cfg(feature = "interpolation")]
mod interpolation;
pub mod nets;
#[cfg(feature = "panel")]
pub mod panel;
pub mod parameter;
pub mod particle;
mod plugin;
mod plugin_group;
pub mod queries;
#[cfg(feature = "render")]
pub mod render;
pub mod report;
#[cfg(feature = "scene")]
pub mod scene;
mod schedule;
pub mod settings;
pub mod snapshot;
pub mod solver;
pub mod spring;
mod sync;
pub mod teleport;
pub mod time_control;

#[cfg(feature = "interpolation")]
pub use interpolation::MassSpringInterpolationPlugin;
pub use plugin::MassSpringPlugin;
pub use plugin_group::MassSpringPlugins;
pub use schedule::MassSpringSystems;

/// What most users of the crate need, in one import.
pub mod prelude {
    #[cfg(feature = "interpolation")]
    pub use crate::MassSpringInterpolationPlugin;
    pub use crate::bend::Bend;
    pub use crate::collider::{
        ColliderMotion, ColliderPart, ColliderShape, CollisionSettings, CombineRule, Contact, ContactEnded,
        ContactEvents, ContactExemptions, ContactLayers, ContactMaterial, ContactStarted, ParticleCollider,
    };
    pub use crate::diagnostics::{MassSpringDiagnosticsPlugin, Measurements};
    #[cfg(feature = "drag")]
    pub use crate::drag::ParticleDragPlugin;
    pub use crate::environment::{Environment, Gusts};
    #[cfg(feature = "gizmos")]
    pub use crate::gizmos::{MassSpringGizmos, MassSpringGizmosPlugin};
    #[cfg(feature = "gltf")]
    pub use crate::gltf::MassSpringGltfPlugin;
    pub use crate::nets::{
        Air, Attachment, Balloon, BalloonMaterial, BalloonShape, Breaking, Cloth, ClothMaterial, ClothShape,
        Corner, Jelly, JellyMaterial, JellyShape, Part, PartOf, ParticleNet, Parts, Rope, RopeMaterial, Side,
        Winch, Yielding,
    };
    #[cfg(feature = "panel")]
    pub use crate::panel::MassSpringPanelPlugin;
    pub use crate::particle::{
        AppliedForce, Particle, ParticleVelocity, Pinned, Quarantined, SimulationOrder,
    };
    pub use crate::queries::{ParticleHit, ParticleQueries, ParticleQueryFilter};
    #[cfg(feature = "render")]
    pub use crate::render::{
        MassSpringRenderPlugin, NetMesh, NetSkin, RopeCrowd, RopeLinks, RopeMesh, RopeRibbon,
    };
    pub use crate::report::{
        Broke, InvalidColliders, ParticleFault, Reaction, SleepingParticles, SpringForces, TickReport,
    };
    #[cfg(feature = "scene")]
    pub use crate::scene::{MassSpringScene, MassSpringScenePlugin, MassSpringSceneRoot};
    pub use crate::settings::{
        Dimensions, Integrator, OrphanedSprings, SleepSettings, SolverSettings, SubstepMode,
    };
    pub use crate::snapshot::{
        MassSpringState, RestoreInitialState, Snapshot, SnapshotError, TakeInitialState,
    };
    pub use crate::spring::{Broken, Plasticity, Spring};
    pub use crate::teleport::Teleport;
    pub use crate::time_control::{SingleStep, SingleStepPlugin};
    pub use crate::{MassSpringPlugin, MassSpringPlugins, MassSpringSystems};
}
#[doc(inline)]
pub use prelude::*;

/// The code of the README, compiled.
#[cfg(all(doctest, feature = "render", feature = "gizmos"))]
#[doc = include_str!("../README.md")]
struct Readme;

/// The code of the guide to contacts, compiled.
#[cfg(all(doctest, feature = "scene"))]
#[doc = include_str!("../docs/contacts.md")]
struct ContactsGuide;
