//! Ropes, cloths and other surfaces against each other and against themselves: nothing ever passes through anything.

#[path = "../common/mod.rs"]
mod common;
mod impacts;
mod piles;
mod shots;
