//! Ctrl-C and the interpreter lock: long work runs without the lock, and every 20 ms somebody looks whether a signal has come.

use crate::errors::Failure;
use armlet_core::error::Result as CoreResult;
use armlet_core::interrupt::{Interrupted, Watch, interruptible};
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use std::cell::RefCell;

thread_local! {
    /// What a signal's handler raised on this thread, until the call that it interrupted passes it on.
    static SIGNAL: RefCell<Option<PyErr>> = const { RefCell::new(None) };
}

/// Look for Ctrl-C: what it raised is kept, and the work is told to stop.
pub fn listen(signal: &mut Option<PyErr>) -> impl FnMut() -> bool + '_ {
    move || {
        if signal.is_none() {
            *signal = Python::attach(|py| py.check_signals()).err();
        }
        signal.is_some()
    }
}

fn signalled() -> bool {
    Python::attach(|py| py.check_signals()).map_err(|error| SIGNAL.set(Some(error))).is_err()
}

/// Work without the GIL on this thread, ended by Ctrl-C where it looks.
pub fn long<T: Send>(py: Python<'_>, work: impl FnOnce() -> CoreResult<T> + Send) -> Result<T, Failure> {
    match py.detach(|| interruptible(Watch::Poll(signalled), work)) {
        Ok(result) => Ok(result?),
        Err(Interrupted) => Err(SIGNAL.take().unwrap_or_else(|| PyKeyboardInterrupt::new_err(())).into()),
    }
}
