//! Worker threads. A pool of threads is created at first use, and again in a forked child process. The calling thread can check for a stop
//! request during the work. The division of rows into chunks does not depend on the number of threads.
//!
//! `pool` contains the threads. Without the feature `parallel`, `serial` replaces it: one worker, with the same results.

#[cfg(feature = "parallel")]
mod pool;
#[cfg(not(feature = "parallel"))]
#[path = "serial.rs"]
mod pool;

pub use pool::{any, each_with, run};

use crate::error::{Error, Result};
use crate::interrupt::{Interrupted, SLICE, Watch, interruptible};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError, mpsc};

/// The maximum number of threads.
pub const MOST_THREADS: usize = 1024;

/// Return `ARMLET_NUM_THREADS` if it is a positive integer, otherwise the number of cores that were available to the process at the first
/// call. The result is at most [`MOST_THREADS`].
pub fn default_threads() -> usize {
    // The count is stored, because on Linux each count reads the files of the process's control group.
    static CORES: OnceLock<usize> = OnceLock::new();
    let requested = std::env::var("ARMLET_NUM_THREADS").ok().and_then(|n| n.trim().parse().ok()).filter(|&n| n > 0);
    requested.unwrap_or_else(|| *CORES.get_or_init(|| std::thread::available_parallelism().map_or(1, |n| n.get()))).min(MOST_THREADS)
}

/// Return the argument `threads`. Errors: `Input` if it is zero or more than [`MOST_THREADS`].
pub fn require_threads(threads: usize) -> Result<usize> {
    if (1..=MOST_THREADS).contains(&threads) {
        return Ok(threads);
    }
    Err(Error::input("threads", format!("is out of range: expected 1 to {MOST_THREADS}, got {threads}")))
}

/// Run `work(stop)` on another thread, so that the caller remains responsive. `poll` is called every 20 ms on the calling thread. If its
/// result is true, `stop` is set. If no thread can start, the calling thread does the work, without `poll`.
pub fn on_worker<R: Send>(poll: &mut dyn FnMut() -> bool, work: impl FnOnce(&Arc<AtomicBool>) -> R + Send) -> R {
    let stop = Arc::new(AtomicBool::new(false));
    let (todo, result) = (Mutex::new(Some(work)), Mutex::new(None));
    let once = || {
        let work = lock(&todo).take();
        // A panic is passed to the caller with its message.
        let ended = work.map(|work| catch_unwind(AssertUnwindSafe(|| work(&stop))));
        *lock(&result) = ended;
    };
    let spawned = std::thread::scope(|scope| {
        let (done, finished) = mpsc::channel::<()>();
        let task = || {
            // The end of the task drops this value, which ends the wait of the caller.
            let _done = done;
            once();
        };
        let spawned = std::thread::Builder::new().spawn_scoped(scope, task).is_ok();
        while finished.recv_timeout(SLICE) == Err(mpsc::RecvTimeoutError::Timeout) {
            if poll() {
                stop.store(true, Ordering::Relaxed);
            }
        }
        spawned
    });
    if !spawned {
        once();
    }
    match lock(&result).take() {
        Some(Ok(result)) => result,
        Some(Err(panic)) => resume_unwind(panic),
        None => unreachable!("the work was done by the thread or here"),
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Fill the rows of `out`, which have `length` numbers each, with `work(first, last, rows)`. Each call has `chunk` rows, and the last call
/// has the remaining rows. Return the results in the order of the chunks. Errors: `Interrupted` after `poll` returned true.
pub fn rows<R: Send>(
    threads: usize,
    poll: &mut dyn FnMut() -> bool,
    (length, chunk): (usize, usize),
    out: &mut [f64],
    work: impl Fn(usize, usize, &mut [f64]) -> R + Sync,
) -> std::result::Result<Vec<R>, Interrupted> {
    let chunk = chunk.max(1);
    let parts = out.chunks_mut((length * chunk).max(1)).enumerate().collect();
    pieces(threads, poll, parts, |(i, rows): (usize, &mut [f64])| work(i * chunk, i * chunk + rows.len() / length.max(1), rows))
}

/// Run `work` on each of the parts, and return the results in the same order. Errors: `Interrupted` after `poll` returned true.
pub fn pieces<P: Send, R: Send>(
    threads: usize,
    poll: &mut dyn FnMut() -> bool,
    parts: Vec<P>,
    work: impl Fn(P) -> R + Sync,
) -> std::result::Result<Vec<R>, Interrupted> {
    let one = |stop: &Arc<AtomicBool>, part: P| {
        if stop.load(Ordering::Relaxed) {
            return Err(Interrupted);
        }
        interruptible(Watch::Flag(stop.clone()), || work(part))
    };
    if threads == 1 {
        return on_worker(poll, |stop| parts.into_iter().map(|part| one(stop, part)).collect());
    }
    run(threads, parts.len(), poll, |stop| pool::map(parts, |part| one(stop, part)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

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
            let chunk_results = rows(threads, &mut || false, (2, chunk), &mut out, fill).expect("no request to stop");
            assert!(out.chunks(2).enumerate().all(|(i, row)| row == [i as f64; 2]), "{out:?}");
            assert_eq!(
                (chunk_results[0].0, chunk_results[chunk_results.len() - 1].1, chunk_results.len()),
                (0, 11, 11usize.div_ceil(chunk))
            );
        }
        let slow = |_: usize, _: usize, _: &mut [f64]| std::thread::sleep(Duration::from_millis(2));
        assert!(rows(2, &mut || true, (1, 1), &mut [0.0; 1000], slow).is_err());
    }

    #[test]
    fn threads_beyond_reason_are_refused() {
        assert_eq!(require_threads(MOST_THREADS), Ok(MOST_THREADS));
        for threads in [0, MOST_THREADS + 1, usize::MAX] {
            let error = require_threads(threads).expect_err("out of range");
            assert_eq!(error.to_string(), format!("threads is out of range: expected 1 to 1024, got {threads}"));
        }
    }

    #[test]
    fn a_panic_reaches_the_caller_with_its_message() {
        let panic = catch_unwind(AssertUnwindSafe(|| on_worker(&mut || false, |_| panic!("of the work")))).expect_err("a panic");
        assert_eq!(panic.downcast_ref::<&str>(), Some(&"of the work"));
    }
}
