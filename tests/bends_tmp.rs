#[path = "simulation/bends.rs"]
mod bends;
