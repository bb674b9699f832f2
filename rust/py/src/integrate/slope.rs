//! The right-hand side: calls of `f(t, y, *args)` with one state, or with several states as the columns of a matrix.
//!
//! The first exception is stored. From then on the right-hand side is NaN, so the method ends without another call of Python.

use crate::arrays::{Axis, Form, Lent, SCALAR, copied, numbers, of_shape};
use pyo3::prelude::*;
use pyo3::types::{PyFloat, PyList, PyTuple};

/// The form in which Python callables take a state.
#[derive(Clone, Copy, PartialEq)]
pub enum States {
    /// An array `(n,)`.
    Array,
    /// A list of floats.
    List,
    /// `f` takes an array `(n, k)` with a state in each column. Its Jacobian and its events take `(n,)`.
    Columns,
}

pub struct Slope {
    /// The name of the entry point, for messages.
    pub function: &'static str,
    f: Py<PyAny>,
    /// Further arguments of `f`.
    pub arguments: Option<Py<PyTuple>>,
    pub states: States,
    lent: Lent,
    /// 1, or -1 if the span decreases. The method uses the time `s = direction t`, so `dy/ds = direction f(direction s, y)`.
    pub direction: f64,
    pub error: Option<PyErr>,
    /// The number of states at which `f` was evaluated.
    pub evaluations: u64,
}

impl Slope {
    pub fn new(function: &'static str, f: Py<PyAny>, arguments: Option<Py<PyTuple>>, states: States, direction: f64) -> Self {
        Slope { function, f, arguments, states, lent: Lent::default(), direction, error: None, evaluations: 0 }
    }

    /// Write `dy/ds` at the time `s` to `out`, for each of the `columns` states of `y`, `(n, columns)` row-major.
    pub fn at(&mut self, s: f64, y: &[f64], columns: usize, out: &mut [f64]) {
        if self.error.is_some() {
            out.fill(f64::NAN);
            return;
        }
        self.evaluations += columns as u64;
        let t = self.direction * s;
        let result = Python::attach(|py| {
            let shape = [y.len() / columns.max(1), columns];
            let y = match self.states {
                States::Array => self.lent.array(py, y).map_err(|failure| failure.into_python(py, self.function))?,
                States::List => list(py, y)?,
                States::Columns => copied(py, &shape, y).map_err(|failure| failure.into_python(py, self.function))?,
            };
            let value = with_state(py, self.f.bind(py), self.arguments.as_ref(), t, y)?;
            read(py, self.function, &value, self.states, shape, out)
        });
        if let Err(error) = result {
            self.error = Some(error);
            out.fill(f64::NAN);
        } else if self.direction < 0.0 {
            for x in out {
                *x = -*x;
            }
        }
    }

    /// Call a Jacobian or an event function for one state: `callable(t, y, *arguments)`.
    pub fn call_other<'py>(&self, py: Python<'py>, callable: &Bound<'py, PyAny>, s: f64, y: &[f64]) -> PyResult<Bound<'py, PyAny>> {
        with(py, callable, self.arguments.as_ref(), self.states, self.direction * s, y)
    }
}

/// Write a result of `f` to `out`.
fn read(py: Python<'_>, function: &str, value: &Bound<'_, PyAny>, states: States, shape: [usize; 2], out: &mut [f64]) -> PyResult<()> {
    let single = shape[1] == 1;
    let found = if states == States::Columns { of_shape(value, &shape) } else { None };
    if let Some(slice) = found.or_else(|| if single { of_shape(value, &shape[..1]) } else { None }) {
        out.copy_from_slice(slice);
        return Ok(());
    }
    if single
        && let Ok(list) = value.cast_exact::<PyList>()
        && list.len() == out.len()
        && list.iter().zip(out.iter_mut()).all(|(item, out)| item.cast::<PyFloat>().map(|x| *out = x.value()).is_ok())
    {
        return Ok(());
    }
    if single
        && let Ok(tuple) = value.cast_exact::<PyTuple>()
        && tuple.len() == out.len()
        && tuple.iter_borrowed().zip(out.iter_mut()).all(|(item, out)| item.cast::<PyFloat>().map(|x| *out = x.value()).is_ok())
    {
        return Ok(());
    }
    read_converted(py, function, value, states, shape, out)
}

/// Call `callable(t, y, *arguments)`. The object `y` is new, so the callable may keep it.
pub fn with<'py>(
    py: Python<'py>,
    callable: &Bound<'py, PyAny>,
    arguments: Option<&Py<PyTuple>>,
    states: States,
    t: f64,
    y: &[f64],
) -> PyResult<Bound<'py, PyAny>> {
    let y = match states {
        States::List => list(py, y)?,
        _ => copied(py, &[y.len()], y).map_err(|failure| failure.into_python(py, "integrate"))?,
    };
    with_state(py, callable, arguments, t, y)
}

/// Make a list of the numbers of a state. It is new for each call, because the callable may keep it.
fn list<'py>(py: Python<'py>, y: &[f64]) -> PyResult<Bound<'py, PyAny>> {
    Ok(PyList::new(py, y)?.into_any())
}

fn with_state<'py>(
    py: Python<'py>,
    f: &Bound<'py, PyAny>,
    arguments: Option<&Py<PyTuple>>,
    t: f64,
    y: Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyAny>> {
    match arguments {
        None => f.call1((t, y)),
        Some(more) => {
            let first = (t, y).into_pyobject(py)?;
            let all = first.as_any().add(more.bind(py))?;
            f.call1(all.cast_into::<PyTuple>()?)
        }
    }
}

/// Write a result of `f` that is neither a float64 array of the expected shape nor a list or tuple of floats, to `out`.
fn read_converted(
    py: Python<'_>,
    function: &str,
    value: &Bound<'_, PyAny>,
    states: States,
    expected: [usize; 2],
    out: &mut [f64],
) -> PyResult<()> {
    const WHAT: &str = "f(t, y)";
    let (one, columns) = (Form(&[Axis::Is(expected[0])]), Form(&[Axis::Is(expected[0]), Axis::Is(expected[1])]));
    let single = expected[1] == 1;
    let forms: &[Form<'_>] = match states {
        States::Columns if single => &[columns, one],
        States::Columns => &[columns],
        _ if expected[0] == 1 => &[one, SCALAR],
        _ => &[one],
    };
    let (_, values) = numbers(function, WHAT, value, forms).map_err(|failure| failure.into_python(py, function))?;
    out.copy_from_slice(&values);
    Ok(())
}
