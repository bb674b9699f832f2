//! Information about the extension.

use armlet_core::simulate;
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

/// Return the build of the extension, the instruction set in use, and the number of threads.
///
/// Returns:
///     A dict: `version`, `profile` of the build ("debug" or "release"), `instruction_set` in use, `best_instruction_set` of the processor.
///     It also has `lanes` (runs that a batch computes as one group), and `threads` (default number of threads). `programs` is "machine" if
///     armlet compiles control loops to machine code, otherwise "interpreter".
///
/// Raises:
///     (nothing): an unknown instruction set raises an error at import.
///
/// Source: docs/performance.md.
///
/// >>> import armlet as al
/// >>> al.build_info()["lanes"] >= 1
/// True
#[entered]
#[pyfunction]
pub fn build_info(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    use armlet_core::scalar;
    let info = PyDict::new(py);
    info.set_item("version", env!("CARGO_PKG_VERSION"))?;
    info.set_item("profile", if cfg!(debug_assertions) { "debug" } else { "release" })?;
    info.set_item("instruction_set", scalar::isa().name())?;
    info.set_item("best_instruction_set", scalar::Isa::best().name())?;
    info.set_item("lanes", simulate::lanes())?;
    info.set_item("programs", armlet_core::trace::engine().name())?;
    info.set_item("threads", simulate::default_threads())?;
    Ok(info)
}

/// Return the code, the name and the advice of every status.
#[entered]
#[pyfunction]
pub fn statuses(py: Python<'_>) -> PyResult<Bound<'_, PyList>> {
    use armlet_core::status::Status;
    PyList::new(py, Status::ALL.map(|s| (s.code(), s.name(), s.advice())))
}
