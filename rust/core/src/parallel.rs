//! Worker threads: a pool made on first use, made anew in a forked child, and a caller that keeps listening
//! while they work. Work on rows is cut at places that do not depend on the number of threads.

use rayon::iter::{IndexedParallelIterator, ParallelIterator};
use rayon::slice::ParallelSliceMut;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, mpsc};
use std::time::Duration;

/// How long the caller waits between two looks at what else it has to do.
const SLICE: Duration = Duration::from_millis(20);

/// Pools by size, of one process. A forked child inherits the map but not the threads.
static POOLS: Mutex<Option<ProcessPools>> = Mutex::new(None);

/// The process that made the pools, and the pools.
type ProcessPools = (u32, HashMap<usize, Arc<ThreadPool>>);

/// `ARMLET_NUM_THREADS` if it is a positive integer, else the cores.
pub fn default_threads() -> usize {
    let asked = std::env::var("ARMLET_NUM_THREADS").ok().and_then(|n| n.trim().parse().ok()).filter(|&n| n > 0);
    asked.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, |n| n.get()))
}

fn pool(threads: usize) -> Option<Arc<ThreadPool>> {
    let process = std::process::id();
    let mut pools = POOLS.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    match &*pools {
        Some((owner, _)) if *owner == process => {}
        // The parent's threads do not exist here: dropping their pool would wait for them for ever.
        _ => std::mem::forget(pools.replace((process, HashMap::new()))),
    }
    let (_, pools) = pools.as_mut()?;
    if let Some(pool) = pools.get(&threads) {
        return Some(pool.clone());
    }
    let pool = ThreadPoolBuilder::new().num_threads(threads).thread_name(|i| format!("armlet-{i}")).build().ok()?;
    let pool = Arc::new(pool);
    pools.insert(threads, pool.clone());
    Some(pool)
}

/// Run `work(stop)` in the pool; `poll` is asked every 20 ms whether to stop, and what it says is passed on.
/// Where no thread can be had the work is done here.
pub fn run<R: Send>(threads: usize, poll: &mut dyn FnMut() -> bool, work: impl FnOnce(&AtomicBool) -> R + Send) -> R {
    match pool(threads) {
        Some(pool) => on_worker(poll, |stop| pool.install(|| work(stop))),
        None => work(&AtomicBool::new(false)),
    }
}

/// Run `work(stop)` on a thread of its own, so that the caller can go on listening: `poll` is asked every 20 ms.
pub fn on_worker<R: Send>(poll: &mut dyn FnMut() -> bool, work: impl FnOnce(&AtomicBool) -> R + Send) -> R {
    let stop = AtomicBool::new(false);
    let mut result = None;
    std::thread::scope(|scope| {
        let (done, finished) = mpsc::channel::<()>();
        let (result, stop) = (&mut result, &stop);
        scope.spawn(move || {
            *result = Some(work(stop));
            // The receiver lives until the scope ends: this can't fail while anyone listens.
            let _ = done.send(());
        });
        // Work that panics drops its sender: that ends the wait too, and the scope passes the panic on.
        while finished.recv_timeout(SLICE) == Err(mpsc::RecvTimeoutError::Timeout) {
            if poll() {
                stop.store(true, Ordering::Relaxed);
            }
        }
    });
    result.expect("a scope returns after its threads, or panics with them")
}

/// Fill the rows of `out`, `length` numbers each, by `work(first, last, rows)` on `chunk` rows at a time; what each chunk
/// said, in order, or `None` where `poll` asked to stop.
pub fn rows<R: Send>(
    threads: usize,
    poll: &mut dyn FnMut() -> bool,
    (length, chunk): (usize, usize),
    out: &mut [f64],
    work: impl Fn(usize, usize, &mut [f64]) -> R + Sync,
) -> Option<Vec<R>> {
    let chunk = chunk.max(1);
    let part = |stop: &AtomicBool, i: usize, rows: &mut [f64]| {
        let (first, count) = (i * chunk, rows.len() / length.max(1));
        (!stop.load(Ordering::Relaxed)).then(|| work(first, first + count, rows))
    };
    let width = (length * chunk).max(1);
    if threads == 1 {
        return on_worker(poll, |stop| out.chunks_mut(width).enumerate().map(|(i, rows)| part(stop, i, rows)).collect());
    }
    run(threads, poll, |stop| out.par_chunks_mut(width).enumerate().with_max_len(1).map(|(i, rows)| part(stop, i, rows)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_filled_in_order_by_any_number_of_threads_and_stop_when_asked() {
        for (threads, chunk) in [(1, 3), (2, 1), (3, 4), (2, 100)] {
            let mut out = vec![0.0; 2 * 11];
            let fill = |first: usize, last: usize, rows: &mut [f64]| {
                for (i, row) in (first..last).zip(rows.chunks_exact_mut(2)) {
                    row.fill(i as f64);
                }
                (first, last)
            };
            let said = rows(threads, &mut || false, (2, chunk), &mut out, fill).expect("nobody asked to stop");
            assert!(out.chunks(2).enumerate().all(|(i, row)| row == [i as f64; 2]), "{out:?}");
            assert_eq!((said[0].0, said[said.len() - 1].1, said.len()), (0, 11, 11usize.div_ceil(chunk)));
        }
        let slow = |_: usize, _: usize, _: &mut [f64]| std::thread::sleep(Duration::from_millis(2));
        assert!(rows(2, &mut || true, (1, 1), &mut [0.0; 1000], slow).is_none());
    }
}
