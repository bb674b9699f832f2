//! Thread pools of rayon. A pool is created at first use, stored by size, and created again in a forked child process.

use super::threads::{MOST_THREADS, lock, on_worker};
use rayon::iter::{IndexedParallelIterator, IntoParallelIterator, IntoParallelRefMutIterator, ParallelIterator};
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::collections::HashMap;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};

/// The pools of this process, by number of threads. A forked child inherits this map, but not the threads.
static POOLS: Mutex<Option<ProcessPools>> = Mutex::new(None);

/// The id of the process that created the pools, and the pools.
type ProcessPools = (u32, HashMap<usize, Arc<ThreadPool>>);

/// If this number of pools is stored, a new pool first removes the unused ones.
const KEPT_POOLS: usize = 4;

fn pool(threads: usize) -> Option<Arc<ThreadPool>> {
    let process = std::process::id();
    let mut pools = lock(&POOLS);
    match &*pools {
        Some((owner, _)) if *owner == process => {}
        // The threads of the parent do not exist in this process. Dropping their pool could wait for ever.
        _ => std::mem::forget(pools.replace((process, HashMap::new()))),
    }
    let (_, pools) = pools.as_mut()?;
    if let Some(pool) = pools.get(&threads) {
        return Some(pool.clone());
    }
    if pools.len() >= KEPT_POOLS {
        // A pool in use has another reference, so that it is not removed.
        pools.retain(|_, pool| Arc::strong_count(pool) > 1);
    }
    let pool = ThreadPoolBuilder::new().num_threads(threads).thread_name(|i| format!("armlet-{i}")).build().ok()?;
    let pool = Arc::new(pool);
    pools.insert(threads, pool.clone());
    Some(pool)
}

/// Run `work(stop)` in a pool with at most `threads` threads, and at most one thread per piece of work. `poll` is called every 20 ms. If
/// its result is true, `stop` is set. If no thread can start, the calling thread does the work.
pub fn run<R: Send>(threads: usize, pieces: usize, poll: &mut dyn FnMut() -> bool, work: impl FnOnce(&Arc<AtomicBool>) -> R + Send) -> R {
    match pool(threads.min(pieces).clamp(1, MOST_THREADS)) {
        Some(pool) => on_worker(poll, |stop| pool.install(|| work(stop))),
        None => {
            // Outside of a pool, parallel iterators would start rayon's global threads, and panic if that fails. So this thread becomes a
            // pool of one thread. If it is already a worker, this call has no effect.
            let _ = ThreadPoolBuilder::new().num_threads(1).use_current_thread().build();
            work(&Arc::default())
        }
    }
}

/// Run `work` on each part with the threads of the present pool, and collect the results in order.
pub(super) fn map<P: Send, R: Send, C>(parts: Vec<P>, work: impl Fn(P) -> R + Sync) -> C
where
    C: rayon::iter::FromParallelIterator<R>,
{
    parts.into_par_iter().with_max_len(1).map(&work).collect()
}

/// Run `work(i, part)` on each part with the threads of the present pool. Return true if any result is true.
pub fn any<P: Send>(parts: &mut [P], work: impl Fn(usize, &mut P) -> bool + Sync) -> bool {
    parts.par_iter_mut().enumerate().with_max_len(1).map(|(i, part)| work(i, part)).reduce(|| false, |a, b| a | b)
}

/// Run `work` on each part with the threads of the present pool. Each part has a new `state()`.
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
