//! The exhibits, one file each.

mod ball;
mod capstan;
mod funnel;
mod knot;
mod paddle;
mod shapes;

use bevy::prelude::*;

/// Adds all exhibits, in the order in which they are listed.
pub fn plugin(app: &mut App) {
    app.add_plugins((
        shapes::plugin,
        capstan::plugin,
        ball::plugin,
        paddle::plugin,
        funnel::plugin,
        knot::plugin,
    ));
}
