//! What the crate logs: warnings about bad values, and particles that become non-finite.
//!
//! The log belongs to the process, so each test here holds `Logged` from its first line on.

mod colliders;
#[path = "../common/mod.rs"]
mod common;
mod faults;
mod orphans;
mod recipes;
mod warnings;
