//! Work on many blocks, on this thread or on all.

use bevy::tasks::ComputeTaskPool;

/// Calls `work` for every part. With `parallel`, on all threads of Bevy's [`ComputeTaskPool`].
///
/// The parts must not depend on each other nor on the number of threads: then neither does the result.
pub(super) fn for_each<Part: Send>(
    parts: impl Iterator<Item = Part>,
    parallel: bool,
    work: impl Fn(Part) + Sync,
) {
    match ComputeTaskPool::try_get().filter(|pool| parallel && pool.thread_num() > 1) {
        Some(pool) => {
            let work = &work;
            pool.scope(|scope| parts.for_each(|part| scope.spawn(async move { work(part) })));
        }
        None => parts.for_each(work),
    }
}
