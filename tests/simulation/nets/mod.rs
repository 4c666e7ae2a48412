//! Recipes of nets against closed forms.

mod balloons;
mod cloths;
mod jellies;
mod ropes;
mod statics;
