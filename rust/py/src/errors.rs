//! The conversion of core errors to Python exceptions, and of panics to `InternalError`. No panic reaches Python.

use armlet_core::error::Error;
use armlet_core::status::Status;
use pyo3::exceptions::{PyMemoryError, PyTypeError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyTuple, PyType};
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// A class of `armlet.errors`. The module is imported once.
fn class(py: Python<'_>, name: &'static str) -> PyResult<Py<PyType>> {
    static MODULE: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    let module = MODULE.get_or_try_init(py, || PyResult::Ok(py.import("armlet.errors")?.into_any().unbind()))?;
    Ok(module.bind(py).getattr(name)?.cast_into::<PyType>()?.unbind())
}

fn raise(py: Python<'_>, name: &'static str, arguments: impl for<'a> pyo3::call::PyCallArgs<'a>) -> PyErr {
    match class(py, name).and_then(|class| class.bind(py).call1(arguments)) {
        Ok(error) => PyErr::from_value(error),
        Err(error) => error,
    }
}

/// Convert a core error to the Python exception that `function` raises.
fn to_python(py: Python<'_>, function: &str, error: Error) -> PyErr {
    let message = format!("{function}: {error}");
    match error {
        Error::Input { .. } | Error::WrongShape { .. } | Error::Unknown { .. } => {
            let raised = raise(py, "InputError", (message,));
            let about = || -> PyResult<()> {
                let value = raised.value(py);
                value.setattr("argument", error.argument())?;
                value.setattr("problem", error.problem())?;
                value.setattr("index", PyTuple::new(py, error.index())?)?;
                value.setattr("available", PyTuple::new(py, error.available())?)
            };
            about().err().unwrap_or(raised)
        }
        Error::Model { file, line, .. } => raise(py, "ModelError", (message, file, line)),
        Error::Solve { status, t, .. } => raise(py, "SolveError", (message, status.code(), t)),
        Error::Format(_) => raise(py, "FormatError", (message,)),
        Error::Memory { .. } => PyMemoryError::new_err(message),
    }
}

/// Make an `InputError` with the message `function: argument problem`.
pub fn input_error(py: Python<'_>, function: &str, argument: &str, problem: impl std::fmt::Display) -> PyErr {
    raise(py, "InputError", (format!("{function}: {argument} {problem}"),))
}

/// Refuse arguments without a name beyond the last positional one. `names` are the arguments that require their names.
pub fn require_names(surplus: &Bound<'_, PyTuple>, function: &str, most: usize, names: &str) -> PyResult<()> {
    if surplus.is_empty() {
        return Ok(());
    }
    let given = most + surplus.len();
    let message = format!("{function}: expected at most {most} arguments without a name, got {given}: write the others by name: {names}");
    Err(PyTypeError::new_err(message))
}

/// Make a `FormatError`, for stored data that is not in its declared format.
pub fn format_error(py: Python<'_>, message: &str) -> PyErr {
    raise(py, "FormatError", (message,))
}

/// Make a `SolveError` with the status, the time `t` in s at which the run ended, and the partial result.
pub fn solve_error(py: Python<'_>, message: String, status: Status, t: f64, partial: Py<PyAny>) -> PyErr {
    raise(py, "SolveError", (message, status.code(), t, partial))
}

/// Run the body of an entry point, and convert a panic to an `InternalError`. The macro `#[entered]` wraps every entry point in this
/// function.
pub fn caught<T>(function: &str, body: impl FnOnce() -> PyResult<T>) -> PyResult<T> {
    catch_unwind(AssertUnwindSafe(body)).unwrap_or_else(|panic| Err(panicked(function, panic.as_ref())))
}

/// The `InternalError` for a panic.
#[cold]
fn panicked(function: &str, panic: &(dyn Any + Send)) -> PyErr {
    let text = panic.downcast_ref::<String>().map(String::as_str).or(panic.downcast_ref::<&str>().copied());
    let message = format!("{function}: internal error, please report it: {}", text.unwrap_or("no message"));
    Python::attach(|py| raise(py, "InternalError", (message,)))
}

/// Run the body of an entry point as [`caught`] does, and convert core errors to Python exceptions.
pub fn entry<T>(py: Python<'_>, function: &str, body: impl FnOnce() -> Result<T, Failure>) -> PyResult<T> {
    caught(function, || body().map_err(|failure| failure.into_python(py, function)))
}

/// The error of a function that Python calls: an error of the core, or a Python exception.
pub enum Failure {
    Core(Error),
    Python(PyErr),
}

impl Failure {
    /// Convert the error to the Python exception that `function` raises.
    #[cold]
    pub fn into_python(self, py: Python<'_>, function: &str) -> PyErr {
        match self {
            Failure::Core(error) => to_python(py, function, error),
            Failure::Python(error) => error,
        }
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Failure::Core(error)
    }
}

impl From<PyErr> for Failure {
    fn from(error: PyErr) -> Self {
        Failure::Python(error)
    }
}
