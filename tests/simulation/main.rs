//! The physics and the plugin, in one process: tests that need nothing of it for themselves.
//!
//! Tests that do are binaries of their own: task pools of a given size (`determinism`, `edits`), the log
//! (`logging`), the allocator (`allocations`), a display (`window`).

mod air;
mod ambiguity;
mod attachments;
mod bend_entities;
mod bends;
mod breaking;
#[cfg(feature = "scene")]
mod bsn;
mod cables;
mod caches;
mod capstan;
mod coincidence;
mod collider_cloths;
#[cfg(feature = "interpolation")]
mod collider_easing;
mod collider_entities;
mod collider_nets;
mod collider_shots;
mod collider_slopes;
mod colliders;
mod collisions;
#[path = "../common/mod.rs"]
mod common;
mod contact_events;
mod control;
mod crowds;
mod disabling;
mod elastic_impacts;
mod energy;
mod exemptions;
mod far;
mod flatness;
mod forces;
mod gas;
mod implicit_euler;
mod islands;
mod jelly_breaking;
mod lifecycle;
mod mixed_contacts;
mod mixture;
mod net_breaking;
mod nets;
mod nets_sync;
mod order;
mod overlap;
mod physics;
mod pinning;
mod plugins;
mod prescribed;
mod pressed;
mod properties;
mod ramps;
#[cfg(feature = "scene")]
mod reflection;
mod resting;
mod rollback;
#[cfg(feature = "scene")]
mod scene;
mod schemes;
mod second_order;
mod sleep;
mod sleeping_entities;
mod sleeping_nets;
mod snapshots;
mod spatial_queries;
mod squeezed;
mod stage;
mod stiff_contacts;
mod strain_limit;
mod streaming;
mod struck_ropes;
mod surfaces;
mod sweeps;
mod tearing_soak;
mod tears;
mod teleport_commands;
mod teleports;
mod trampoline;
mod turning;
mod waking;
mod winch;
mod winch_force;
mod yielding;
