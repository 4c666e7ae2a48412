//! What the kernel writes to before it adds to the forces.

use std::cell::RefCell;

use super::bends::BendBuffers;
use super::springs::SpringForces;

/// The working memory of a thread. It is filled with zeros once: that would take a noticeable part of the time of small blocks.
pub(super) struct Workspace {
    pub springs: SpringForces,
    pub bends: BendBuffers,
}

thread_local! {
    static WORKSPACE: RefCell<Box<Workspace>> =
        RefCell::new(Box::new(Workspace { springs: SpringForces::new(), bends: BendBuffers::new() }));
}

impl Workspace {
    /// Calls `work` with the workspace of this thread.
    pub fn with(work: impl FnOnce(&mut Self)) {
        WORKSPACE.with_borrow_mut(|workspace| work(workspace));
    }
}
