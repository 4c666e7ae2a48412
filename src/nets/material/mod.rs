//! What nets are made of, in the units of data sheets. The same material makes the same rope, cloth or jelly at every
//! resolution: the recipes derive the constants of the springs from it.

mod cloth;
mod jelly;
mod rope;

pub use cloth::{BalloonMaterial, ClothMaterial};
pub use jelly::JellyMaterial;
pub use rope::RopeMaterial;
