//! Blocks that no element leaves need nothing of each other: each is advanced by itself.

use crate::solver::field::Field;
use crate::solver::graph::Blocks;
use crate::solver::kernel::{Closed, Substeps};
use crate::solver::parallel;
use crate::solver::particles::Particles;

/// Calls `advance` for each block, with what of it is in `kept`: an entry for each block.
pub(super) fn for_each<Kept: Send>(
    particles: &mut Particles,
    blocks: &Blocks,
    field: &Field,
    substeps: Substeps,
    kept: impl Iterator<Item = Kept> + Send,
    advance: impl Fn(Closed, Kept) + Sync,
) {
    let is_unpushed = particles.is_unpushed();
    let (position, velocity, applied_force, inverse_mass) = particles.answers_to_forces_mut();
    let applied_force = applied_force.axes();
    let mut left = substeps.pinned;
    let pinned = blocks.blocks.iter().map(move |block| {
        let count = left.partition_point(|motion| motion.slot < block.slots.end);
        left.split_off(..count).expect("they are in the order of their slots, and each slot is in a block")
    });
    let moved = blocks.split(position.axes_mut()).zip(blocks.split(velocity.axes_mut()));
    let parts = blocks.blocks.iter().zip(pinned).zip(moved).zip(kept);
    let is_shared = blocks.are_worth_sharing_for(substeps.count);
    parallel::for_each(parts, is_shared, |(((block, pinned), (position, velocity)), kept)| {
        let closed = Closed {
            block,
            field,
            applied_force: applied_force.map(|axis| &axis[block.slots.clone()]),
            inverse_mass: &inverse_mass[block.slots.clone()],
            is_unpushed,
            position,
            velocity,
            substeps: Substeps { pinned, ..substeps },
        };
        advance(closed, kept);
    });
}
