//! The exhibits, one file each.

mod balloon;
mod bridge;
mod cape;
mod crane;
mod curtain;
mod flag;
mod hammock;
mod jelly;
mod mail;
mod mattress;
mod rods;
mod tear;

use bevy::prelude::*;

/// Adds all exhibits, in the order in which they are listed.
pub fn plugin(app: &mut App) {
    app.add_plugins((
        bridge::plugin,
        flag::plugin,
        hammock::plugin,
        curtain::plugin,
        cape::plugin,
        crane::plugin,
        jelly::plugin,
        balloon::plugin,
        tear::plugin,
        mail::plugin,
        mattress::plugin,
        rods::plugin,
    ));
}
