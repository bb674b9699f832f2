//! Thread pools of rayon: made at the first use, kept by size, made again in a forked child.

use super::{MOST_THREADS, lock, on_worker};
use rayon::iter::{IndexedParallelIterator, IntoParallelIterator, IntoParallelRefMutIterator, ParallelIterator};
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::collections::HashMap;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};

/// The pools of one process, by size. A forked child inherits the map but not the threads.
static POOLS: Mutex<Option<ProcessPools>> = Mutex::new(None);

/// The process that made the pools, and the pools.
type ProcessPools = (u32, HashMap<usize, Arc<ThreadPool>>);

/// Number of unused pools that are kept.
const KEPT_POOLS: usize = 4;

fn pool(threads: usize) -> Option<Arc<ThreadPool>> {
    let process = std::process::id();
    let mut pools = lock(&POOLS);
    match &*pools {
        Some((owner, _)) if *owner == process => {}
        // The parent's threads do not exist in this process. Dropping their pool would wait for them for ever.
        _ => std::mem::forget(pools.replace((process, HashMap::new()))),
    }
    let (_, pools) = pools.as_mut()?;
    if let Some(pool) = pools.get(&threads) {
        return Some(pool.clone());
    }
    if pools.len() >= KEPT_POOLS {
        // The user of a pool has another reference to it.
        pools.retain(|_, pool| Arc::strong_count(pool) > 1);
    }
    let pool = ThreadPoolBuilder::new().num_threads(threads).thread_name(|i| format!("armlet-{i}")).build().ok()?;
    let pool = Arc::new(pool);
    pools.insert(threads, pool.clone());
    Some(pool)
}

/// Run `work(stop)` in a pool of at most `threads` threads, and at most one per piece of work. `poll` is called every 20 ms, and its result
/// is passed on as the request to stop. If no thread can start, the calling thread does the work.
pub fn run<R: Send>(threads: usize, pieces: usize, poll: &mut dyn FnMut() -> bool, work: impl FnOnce(&Arc<AtomicBool>) -> R + Send) -> R {
    match pool(threads.min(pieces).clamp(1, MOST_THREADS)) {
        Some(pool) => on_worker(poll, |stop| pool.install(|| work(stop))),
        None => {
            // Outside a pool, parallel iterators would start rayon's threads, and panic if that fails. So this thread becomes a pool of
            // one. If it is a worker already, it remains one.
            let _ = ThreadPoolBuilder::new().num_threads(1).use_current_thread().build();
            work(&Arc::default())
        }
    }
}

/// Run `work` on each part with the threads of the calling pool. The results are in order.
pub(super) fn map<P: Send, R: Send, C>(parts: Vec<P>, work: impl Fn(P) -> R + Sync) -> C
where
    C: rayon::iter::FromParallelIterator<R>,
{
    parts.into_par_iter().with_max_len(1).map(&work).collect()
}

/// Run `work(i, part)` on each part, by the threads of the calling pool. The result is true if any of them returned true.
pub fn any<P: Send>(parts: &mut [P], work: impl Fn(usize, &mut P) -> bool + Sync) -> bool {
    parts.par_iter_mut().enumerate().with_max_len(1).map(|(i, part)| work(i, part)).reduce(|| false, |a, b| a | b)
}

/// Run `work` on each part, with a state that every thread of the pool makes.
pub fn each_with<P: Send, L>(parts: Vec<P>, state: impl Fn() -> L + Sync, work: impl Fn(&mut L, P) + Sync) {
    parts.into_par_iter().with_max_len(1).for_each_init(&state, &work);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn threads_are_no_more_than_pieces_and_not_beyond_reason() {
        for (threads, pieces, expected) in [(8, 3, 3), (2, 100, 2), (4, 0, 1), (10_000_000, 5, 5)] {
            let count = run(threads, pieces, &mut || false, |_| rayon::current_num_threads());
            assert_eq!(count, expected, "{threads} threads, {pieces} pieces");
        }
    }

    #[test]
    fn few_idle_pools_are_kept() {
        for threads in 1..=20 {
            assert!(pool(threads).is_some());
        }
        assert!(lock(&POOLS).as_ref().is_some_and(|(_, pools)| pools.len() <= 2 * KEPT_POOLS), "other tests hold some at most");
    }
}
