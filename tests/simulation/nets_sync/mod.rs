//! Nets in the simulation: the same physics as that of particle and spring entities, in one component.

mod contacts;
mod entities;
mod faults;
mod live_edits;
mod parts;
mod recipes;
pub mod shapes;
mod snapshots;
