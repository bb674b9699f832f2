//! Ctrl-C in calls that take long: none waits for its end.

use crate::errors::Failure;
use armlet_core::error::Result as CoreResult;
use armlet_core::parallel;
use pyo3::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Look for Ctrl-C: what it raised is kept, and the work is told to stop.
pub fn listen(signal: &mut Option<PyErr>) -> impl FnMut() -> bool + '_ {
    move || {
        if signal.is_none() {
            *signal = Python::attach(|py| py.check_signals()).err();
        }
        signal.is_some()
    }
}

/// Work without the GIL, on a thread of its own while this one listens for Ctrl-C, which sets what `work` is given.
pub fn listening<T: Send>(py: Python<'_>, work: impl FnOnce(&Arc<AtomicBool>) -> CoreResult<T> + Send) -> Result<T, Failure> {
    let (mut signal, stop) = (None, Arc::new(AtomicBool::new(false)));
    let result = {
        let mut interrupted = listen(&mut signal);
        let mut poll = || stop.fetch_or(interrupted(), Ordering::Relaxed);
        py.detach(|| parallel::on_worker(&mut poll, |_| work(&stop)))
    };
    match signal {
        Some(signal) => Err(Failure::Python(signal)),
        None => Ok(result?),
    }
}
