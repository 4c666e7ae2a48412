//! Nets as meshes, in an app that has cameras and meshes but neither a window nor a renderer.

mod colliders;
mod easing;
mod recipes;
mod ropes;
mod scene;
mod surfaces;
mod tearing;
mod tears;
mod upkeep;
