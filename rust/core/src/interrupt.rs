//! Interruption of long work. The work calls [`check`] in its loops. If a stop is requested, `check` unwinds the stack to [`interruptible`].
//!
//! [`interruptible`] sets the source of requests for one piece of work on one thread. Without a source, `check` has no effect. Unwinding
//! drops all results of the work. Work that must return partial results checks a `simulate::Stop` instead. A call of `check` takes about 50
//! ns, so that work calls it every 10 us to 1 ms (`docs/adr/0007-interruption.md`).

use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// The time between two checks of a polled request.
pub const SLICE: Duration = Duration::from_millis(20);

/// The source of requests to stop.
///
/// ```
/// use armlet_core::interrupt::{self, Interrupted, Watch, interruptible};
/// use std::sync::Arc;
/// use std::sync::atomic::{AtomicBool, Ordering};
///
/// let stop = Arc::new(AtomicBool::new(false));
/// let work = || (0..100).for_each(|_| interrupt::check());
/// assert_eq!(interruptible(Watch::Flag(stop.clone()), work), Ok(()));
/// stop.store(true, Ordering::Relaxed);
/// assert_eq!(interruptible(Watch::Flag(stop), work), Err(Interrupted));
/// ```
#[derive(Clone, Debug)]
pub enum Watch {
    /// A flag that another thread sets.
    Flag(Arc<AtomicBool>),
    /// A function that is called every 20 ms on the working thread. The result true requests a stop.
    Poll(fn() -> bool),
}

/// The result of work that was stopped on request.
///
/// ```
/// use armlet_core::interrupt::{self, Interrupted, Watch, interruptible};
///
/// // The function is called for the first time after 20 ms.
/// let endless = || loop {
///     interrupt::check();
/// };
/// let result: Result<(), Interrupted> = interruptible(Watch::Poll(|| true), endless);
/// assert_eq!(result, Err(Interrupted));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Interrupted;

/// The source of stop requests of this thread, and the time of the next poll.
struct Watched {
    watch: Watch,
    next: Instant,
}

thread_local! {
    static WATCHED: RefCell<Option<Watched>> = const { RefCell::new(None) };
}

/// Check for a request to stop. On a request, the work unwinds to its [`interruptible`].
pub fn check() {
    let poll = WATCHED.with_borrow_mut(|watched| match watched {
        None => Err(false),
        Some(Watched { watch: Watch::Flag(stop), .. }) => Err(stop.load(Ordering::Relaxed)),
        Some(Watched { watch: Watch::Poll(poll), next }) => {
            let now = Instant::now();
            if now < *next {
                return Err(false);
            }
            *next = now + SLICE;
            Ok(*poll)
        }
    });
    // The borrow has ended before this call, because the function may itself start interruptible work.
    if poll.map_or_else(|stop| stop, |poll| poll()) {
        interrupt();
    }
}

/// The number of rows up to which [`check_at_row`] has no effect. It is the maximum number of bodies of an arm with mimic joints.
const FEW: usize = 256;

/// Call [`check`] at row 256 of a matrix and at every 64th row after it. `row` counts from 0. Loops that are slow only for large matrices
/// call this function.
#[inline(always)]
pub fn check_at_row(row: usize) {
    if row >= FEW && row.is_multiple_of(64) {
        check();
    }
}

/// Unwind to [`interruptible`] now, on a request from another source. Requires an enclosing `interruptible`.
pub fn interrupt() -> ! {
    resume_unwind(Box::new(Interrupted))
}

/// Restores the previous source of requests when it is dropped, also during an unwind.
struct Restore(Option<Watched>);

impl Drop for Restore {
    fn drop(&mut self) {
        WATCHED.set(self.0.take());
    }
}

/// Run `work`. It stops at its next call of `check` after a request from `watch`. Errors: `Interrupted` if it stopped.
pub fn interruptible<R>(watch: Watch, work: impl FnOnce() -> R) -> Result<R, Interrupted> {
    let restore = Restore(WATCHED.replace(Some(Watched { watch, next: Instant::now() + SLICE })));
    let result = catch_unwind(AssertUnwindSafe(work));
    drop(restore);
    result.map_err(|cause| if cause.is::<Interrupted>() { Interrupted } else { resume_unwind(cause) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_stops_at_a_check_after_a_request_only() {
        let stop = Arc::new(AtomicBool::new(false));
        let (mut checks, flag) = (0, stop.clone());
        let work = || {
            for _ in 0..1000 {
                checks += 1;
                if checks == 500 {
                    flag.store(true, Ordering::Relaxed);
                }
                check();
            }
        };
        assert_eq!(interruptible(Watch::Flag(stop.clone()), work), Err(Interrupted));
        assert_eq!(checks, 500);
        // After the interruption, no source exists, and `check` has no effect.
        (0..100).for_each(|_| check());
        assert_eq!(interruptible(Watch::Flag(Arc::new(AtomicBool::new(false))), || (0..100).for_each(|_| check())), Ok(()));
    }

    #[test]
    fn only_late_rows_of_large_matrices_are_checked() {
        let rows = |n: usize| interruptible(Watch::Flag(Arc::new(AtomicBool::new(true))), || (0..n).for_each(check_at_row));
        assert_eq!((rows(FEW), rows(FEW + 1)), (Ok(()), Err(Interrupted)));
        let backwards = || (FEW + 1..FEW + 65).rev().for_each(check_at_row);
        assert_eq!(interruptible(Watch::Flag(Arc::new(AtomicBool::new(true))), backwards), Err(Interrupted));
    }

    #[test]
    fn a_poll_is_called_after_20_ms() {
        let began = Instant::now();
        let endless = || {
            loop {
                check();
            }
        };
        assert_eq!(interruptible(Watch::Poll(|| true), endless).map(|()| false), Err(Interrupted));
        assert!(began.elapsed() >= SLICE);
    }

    #[test]
    fn inner_work_hands_back_to_the_outer() {
        let stop = Arc::new(AtomicBool::new(false));
        let outer = interruptible(Watch::Flag(stop.clone()), || {
            assert_eq!(interruptible(Watch::Flag(Arc::new(AtomicBool::new(true))), || (0..100).for_each(|_| check())), Err(Interrupted));
            stop.store(true, Ordering::Relaxed);
            (0..100).for_each(|_| check());
        });
        assert_eq!(outer, Err(Interrupted));
    }

    #[test]
    fn other_panics_pass() {
        let caught = catch_unwind(|| interruptible(Watch::Poll(|| false), || resume_unwind(Box::new("other"))));
        assert_eq!(caught.unwrap_err().downcast_ref::<&str>(), Some(&"other"));
    }
}
