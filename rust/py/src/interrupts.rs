//! Ctrl-C and the interpreter lock (GIL). Long work checks for a signal every 20 ms. It runs without the GIL, unless it calls Python.

use crate::errors::Failure;
use armlet_core::error::Result as CoreResult;
use armlet_core::interrupt::{Interrupted, Watch, interruptible};
use armlet_core::memory;
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use std::cell::{Cell, RefCell};
use std::time::{Duration, Instant};

thread_local! {
    /// The exception of a signal handler on this thread. The interrupted call raises it later.
    static SIGNAL: RefCell<Option<PyErr>> = const { RefCell::new(None) };
}

/// Whether a signal handler has raised an exception. The exception is stored, and [`long`] raises it.
pub fn signalled() -> bool {
    Python::attach(|py| py.check_signals()).map_err(|error| SIGNAL.set(Some(error))).is_err()
}

/// Run `work` on this thread without the GIL. The work calls `interrupt::check` regularly, and Ctrl-C ends it at such a call.
pub fn long<T: Send>(py: Python<'_>, work: impl FnOnce() -> CoreResult<T> + Send) -> Result<T, Failure> {
    ended(py.detach(|| interruptible(Watch::Poll(signalled), work)))
}

/// Give the GIL to a waiting thread, then return whether a signal handler has raised an exception. Work that holds the GIL calls this.
pub fn signalled_in_turn() -> bool {
    Python::attach(pause).map_err(|error| SIGNAL.set(Some(error))).is_err()
}

/// Run `work` that calls Python at every sample. It holds the GIL, and offers it to other threads every 20 ms ([`signalled_in_turn`]).
///
/// If the work released the GIL around every call, a waiting thread would wake each time, find the GIL taken, and wait again.
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

/// The time between two pauses of [`Breaks`].
const BREAK: Duration = Duration::from_millis(10);

/// Give the GIL to a waiting thread, and check for Ctrl-C.
fn pause(py: Python<'_>) -> PyResult<()> {
    py.detach(|| ());
    py.check_signals()
}

/// The pauses of a loop that holds the GIL. Every 10 ms, other threads can take the GIL, and Ctrl-C is checked.
///
/// Python hands the GIL over only to a thread that has waited for the switch interval of 5 ms. A more frequent pause would wake this thread
/// and take the GIL away again. Then the thread would wait until the loop ends.
pub struct Breaks {
    next: Instant,
}

impl Breaks {
    pub fn new() -> Self {
        Breaks { next: Instant::now() + BREAK }
    }

    /// Pause if the last pause is at least 10 ms ago. Call this after every 1 us to 1 ms of work.
    pub fn pause(&mut self, py: Python<'_>) -> PyResult<()> {
        if Instant::now() >= self.next {
            pause(py)?;
            self.next = Instant::now() + BREAK;
        }
        Ok(())
    }
}

thread_local! {
    /// The time of the next pause of [`pause_in_turn`] on this thread.
    static NEXT: Cell<Option<Instant>> = const { Cell::new(None) };
}

/// Pause if the last pause on this thread is at least 10 ms ago. This suits successive short calls, such as the pieces of a pickle.
pub fn pause_in_turn(py: Python<'_>) -> PyResult<()> {
    if NEXT.get().is_none_or(|next| Instant::now() >= next) {
        pause(py)?;
        NEXT.set(Some(Instant::now() + BREAK));
    }
    Ok(())
}

/// Apply `read` to each object of a list. Every 10 ms the loop pauses, so that other threads can take the GIL and Ctrl-C can end it.
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
