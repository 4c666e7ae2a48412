//! Work on many parts, on this thread or on all.

use std::hint;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use bevy::tasks::ComputeTaskPool;

/// How often this thread checks whether the helpers are done before it goes to sleep: some tenths of a
/// millisecond.
const MAX_SPINS: u32 = 5000;

/// Whether [`for_each`] uses several threads.
pub(crate) fn is_shared(parallel: bool) -> bool {
    pool(parallel).is_some()
}

fn pool(parallel: bool) -> Option<&'static ComputeTaskPool> {
    ComputeTaskPool::try_get().filter(|pool| parallel && pool.thread_num() > 1)
}

/// Calls `work` for every part. With `parallel`, on all threads of Bevy's [`ComputeTaskPool`].
///
/// The parts must not depend on each other nor on the number of threads: then neither does the result.
/// This thread takes parts too, and each helper takes the next one when it has done one: as many threads
/// compute as the pool has, a helper that wakes late costs nothing, and there is one task a helper, not
/// one a part.
pub(crate) fn for_each<Part: Send>(
    parts: impl Iterator<Item = Part> + Send,
    parallel: bool,
    work: impl Fn(Part) + Sync,
) {
    let Some(pool) = pool(parallel) else {
        return parts.for_each(work);
    };
    let most = parts.size_hint().1.unwrap_or(usize::MAX);
    let helpers = most.min(pool.thread_num()).saturating_sub(1);
    let parts = Mutex::new(parts);
    let next = || parts.lock().unwrap_or_else(PoisonError::into_inner).next();
    let help = || {
        while let Some(part) = next() {
            work(part);
        }
    };
    let busy = AtomicUsize::new(0);
    pool.scope(|scope| {
        for _ in 0..helpers {
            scope.spawn(async {
                busy.fetch_add(1, Ordering::Relaxed);
                help();
                busy.fetch_sub(1, Ordering::Relaxed);
            });
        }
        help();
        // The last parts take less time than falling asleep and being woken.
        for _ in 0..MAX_SPINS {
            if busy.load(Ordering::Relaxed) == 0 {
                break;
            }
            hint::spin_loop();
        }
    });
}
