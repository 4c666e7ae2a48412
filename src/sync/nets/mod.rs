//! Nets in the simulation: which there are, where they are in the solver, and their arrays into it and back.
//!
//! Loose particles come first in the solver, then the nets, each a range of slots and of places in the tables of
//! elements. What is added later is appended; all are sorted again when slots are assigned anew.

mod attach;
mod failure;
mod gather;
mod part_links;
mod parts;
mod place;
mod registry;
mod scatter;

use bevy::prelude::*;

pub(super) use attach::{retie, tie_attachments, untie};
pub(super) use failure::{give_breaking, give_yielding, turn_winches};
pub(super) use gather::{GatheredNets, gather_nets};
pub(super) use part_links::{note_despawned_part, relink_part, unlink_part};
pub(super) use parts::{gather_parts, scatter_parts};
pub(super) use place::NetData;
pub(super) use registry::{NetRegistry, mark_replaced, register_existing_nets, register_net, unregister_net};
pub(super) use scatter::{any_nets, scatter_nets};

/// Does what the next tick would begin with: lays out nets, finds the particles of parts, and ties what is attached.
pub(super) fn prepare(world: &mut World) {
    crate::nets::lay_out_now(world);
    let found = world.run_system_cached(gather_parts);
    if let Err(problem) = found.and_then(|()| world.run_system_cached(tie_attachments)) {
        log::error!("parts of nets are not found: {problem}");
    }
}
