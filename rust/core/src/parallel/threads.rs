//! The number of threads, and work on another thread, during which the caller remains responsive.

use crate::error::{Error, Result};
use crate::interrupt::SLICE;
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

pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

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
