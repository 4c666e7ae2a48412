//! The tests of plugins and of reflected types once more, with all plugins that need no window: a small binary beside
//! `simulation`, which is built without their features.

#[path = "../common/mod.rs"]
mod common;
#[path = "../simulation/plugins.rs"]
mod plugins;
#[path = "../simulation/reflection.rs"]
mod reflection;
