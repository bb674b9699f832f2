//! Ctrl-C and the interpreter lock: long work runs without the lock, and checks for a signal every 20 ms.

use crate::errors::Failure;
use armlet_core::error::Result as CoreResult;
use armlet_core::interrupt::{Interrupted, Watch, interruptible};
use armlet_core::memory;
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use std::cell::{Cell, RefCell};
use std::time::{Duration, Instant};

thread_local! {
    /// The error of a signal handler on this thread, until the interrupted call raises it.
    static SIGNAL: RefCell<Option<PyErr>> = const { RefCell::new(None) };
}

/// Whether a signal has come. An error of its handler is kept for `long`.
pub fn signalled() -> bool {
    Python::attach(|py| py.check_signals()).map_err(|error| SIGNAL.set(Some(error))).is_err()
}

/// Work without the GIL on this thread. Ctrl-C ends it where it checks `stop` or [`signalled`].
pub fn long<T: Send>(py: Python<'_>, work: impl FnOnce() -> CoreResult<T> + Send) -> Result<T, Failure> {
    ended(py.detach(|| interruptible(Watch::Poll(signalled), work)))
}

/// The same as [`signalled`] for work that holds the GIL: a waiting thread gets the GIL first.
pub fn signalled_in_turn() -> bool {
    Python::attach(pause).map_err(|error| SIGNAL.set(Some(error))).is_err()
}

/// The same as [`long`] for work that calls Python at every sample: it keeps the GIL, and offers it every 20 ms by [`signalled_in_turn`].
///
/// If the GIL is released and taken at every call, a waiting thread wakes each time, finds it taken, and waits again.
pub fn long_calling<T: Send>(work: impl FnOnce() -> CoreResult<T> + Send) -> Result<T, Failure> {
    ended(interruptible(Watch::Poll(signalled_in_turn), work))
}

fn ended<T>(result: Result<CoreResult<T>, Interrupted>) -> Result<T, Failure> {
    match (SIGNAL.take(), result) {
        (Some(signal), _) => Err(signal.into()),
        (None, Ok(result)) => Ok(result?),
        (None, Err(Interrupted)) => Err(PyKeyboardInterrupt::new_err(()).into()),
    }
}

/// The time from one break to the next.
const BREAK: Duration = Duration::from_millis(10);

/// Give the GIL to a waiting thread, and check for Ctrl-C.
fn pause(py: Python<'_>) -> PyResult<()> {
    py.detach(|| ());
    py.check_signals()
}

/// For loops that require the GIL: every 10 ms other threads get it for a moment, and Ctrl-C is checked.
///
/// Python hands the GIL over only to a thread that has already waited for its switch interval, 5 ms. More frequent breaks wake that
/// thread and take the GIL away again. Then the thread waits until the loop ends.
pub struct Breaks {
    next: Instant,
}

impl Breaks {
    pub fn new() -> Self {
        Breaks { next: Instant::now() + BREAK }
    }

    /// To be called after every 1 us to 1 ms of work.
    pub fn pause(&mut self, py: Python<'_>) -> PyResult<()> {
        if Instant::now() >= self.next {
            pause(py)?;
            self.next = Instant::now() + BREAK;
        }
        Ok(())
    }
}

thread_local! {
    /// When [`pause_in_turn`] pauses next on this thread.
    static NEXT: Cell<Option<Instant>> = const { Cell::new(None) };
}

/// The same as [`Breaks::pause`] for successive calls that are shorter than the time to a break, such as pieces for `pickle`.
pub fn pause_in_turn(py: Python<'_>) -> PyResult<()> {
    if NEXT.get().is_none_or(|next| Instant::now() >= next) {
        pause(py)?;
        NEXT.set(Some(Instant::now() + BREAK));
    }
    Ok(())
}

/// The result of `read` for each of these objects, with pauses.
pub fn paused<'py, T>(
    list: &[Bound<'py, PyAny>],
    read: impl Fn(usize, &Bound<'py, PyAny>) -> Result<T, Failure>,
) -> Result<Vec<T>, Failure> {
    let mut breaks = Breaks::new();
    let one = |(i, item): (usize, &Bound<'py, PyAny>)| {
        breaks.pause(item.py())?;
        read(i, item)
    };
    let mut out = memory::reserved(list.len())?;
    for item in list.iter().enumerate().map(one) {
        out.push(item?);
    }
    Ok(out)
}
