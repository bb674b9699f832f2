//! A Python callable as a system: `f(t, y) -> dy/dt`, its Jacobian given or by differences.
//!
//! A decreasing span runs on the time `s = -t`: `dy/ds = -f(-s, y)`. The first exception is kept and the slope is NaN from then on,
//! so that the method ends at once without calling Python again.

use crate::arrays::{Axis, Form, Lent, SCALAR, numbers, of_shape};
use crate::errors::{Failure, to_python};
use armlet_core::integrate::{Differentiable, System};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyFloat, PyList, PyTuple};

/// How the derivatives of the callable are had.
pub enum Jacobian {
    /// Forward differences where the method corrects itself (Newton, W-methods), central ones where its order rests on them.
    Differences {
        central: bool,
    },
    Constant(Vec<f64>),
    Callable(Py<PyAny>),
}

pub struct Field {
    /// Name of the entry point, for messages.
    function: &'static str,
    f: Py<PyAny>,
    /// Further arguments of `f`.
    arguments: Option<Py<PyTuple>>,
    /// States go out as lists of floats instead of arrays.
    lists: bool,
    lent: Lent,
    jacobian: Jacobian,
    /// -1 where the span decreases.
    pub direction: f64,
    /// The first so many components are positions and the next so many their velocities.
    positions: usize,
    pub error: Option<PyErr>,
    pub evaluations: u64,
    up: Vec<f64>,
    down: Vec<f64>,
    at: Vec<f64>,
}

impl Field {
    pub fn new(
        function: &'static str,
        f: Py<PyAny>,
        arguments: Option<Py<PyTuple>>,
        lists: bool,
        jacobian: Jacobian,
        direction: f64,
        positions: usize,
        n: usize,
    ) -> Self {
        let [up, down, at] = std::array::from_fn(|_| vec![0.0; n]);
        Field {
            function,
            f,
            arguments,
            lists,
            lent: Lent::default(),
            jacobian,
            direction,
            positions,
            error: None,
            evaluations: 0,
            up,
            down,
            at,
        }
    }

    /// Call `f(t, y)` into `out`, both in the caller's own time.
    fn evaluate(&mut self, t: f64, y: &[f64], out: &mut [f64]) {
        if self.error.is_some() {
            out.fill(f64::NAN);
            return;
        }
        self.evaluations += 1;
        let result = Python::attach(|py| {
            let y = if self.lists { list(py, y)? } else { self.lent.array(py, y) };
            call(py, self.function, self.f.bind(py), self.arguments.as_ref(), t, y, out)
        });
        if let Err(error) = result {
            self.error = Some(error);
            out.fill(f64::NAN);
        }
    }

    /// The slope at `(s, y)` of the time that runs forward.
    fn slope(&mut self, s: f64, y: &[f64], out: &mut [f64]) {
        let direction = self.direction;
        self.evaluate(direction * s, y, out);
        if direction < 0.0 {
            for x in out {
                *x = -*x;
            }
        }
    }
}

/// `f(t, y, *arguments)` into `out`.
fn call(
    py: Python<'_>,
    function: &str,
    f: &Bound<'_, PyAny>,
    arguments: Option<&Py<PyTuple>>,
    t: f64,
    y: Bound<'_, PyAny>,
    out: &mut [f64],
) -> PyResult<()> {
    let value = with_state(py, f, arguments, t, y)?;
    if let Some(slice) = of_shape(&value, &[out.len()]) {
        out.copy_from_slice(slice);
        return Ok(());
    }
    if let Ok(list) = value.cast_exact::<PyList>()
        && list.len() == out.len()
        && list.iter().zip(out.iter_mut()).all(|(item, out)| item.cast::<PyFloat>().map(|x| *out = x.value()).is_ok())
    {
        return Ok(());
    }
    if let Ok(tuple) = value.cast_exact::<PyTuple>()
        && tuple.len() == out.len()
        && tuple.iter_borrowed().zip(out.iter_mut()).all(|(item, out)| item.cast::<PyFloat>().map(|x| *out = x.value()).is_ok())
    {
        return Ok(());
    }
    slow(py, function, &value, out)
}

/// `f(t, y, *arguments)`.
pub fn with<'py>(
    py: Python<'py>,
    f: &Bound<'py, PyAny>,
    arguments: Option<&Py<PyTuple>>,
    lists: bool,
    t: f64,
    y: &[f64],
) -> PyResult<Bound<'py, PyAny>> {
    let y = if lists { list(py, y)? } else { PyArray1::from_slice(py, y).into_any() };
    with_state(py, f, arguments, t, y)
}

/// A fresh list each time: the callable may keep it.
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

/// Anything that numpy takes for `n` numbers.
fn slow(py: Python<'_>, function: &str, value: &Bound<'_, PyAny>, out: &mut [f64]) -> PyResult<()> {
    const WHAT: &str = "f(t, y)";
    let forms = [Form(&[Axis::Is(out.len())]), SCALAR];
    let forms = if out.len() == 1 { &forms[..] } else { &forms[..1] };
    let (_, values) = numbers(function, WHAT, value, forms).map_err(|failure| python(py, function, failure))?;
    out.copy_from_slice(&values);
    Ok(())
}

pub fn python(py: Python<'_>, function: &str, failure: Failure) -> PyErr {
    match failure {
        Failure::Core(error) => to_python(py, function, error),
        Failure::Python(error) => error,
    }
}

/// `jac(t, y)` as `(n, n)` numbers.
pub fn matrix(py: Python<'_>, function: &str, value: &Bound<'_, PyAny>, out: &mut [f64], n: usize) -> PyResult<()> {
    let form = Form(&[Axis::Is(n), Axis::Is(n)]);
    let (_, values) = numbers(function, "jac", value, &[form]).map_err(|failure| python(py, function, failure))?;
    out.copy_from_slice(&values);
    Ok(())
}

impl System<f64> for Field {
    /// The time.
    type Input = f64;

    fn input(&mut self, t: f64, u: &mut f64) {
        *u = t;
    }
    fn anchor(&mut self, _: &[f64]) {}
    fn rhs(&mut self, t: &f64, x: &[f64], dx: &mut [f64]) {
        self.slope(*t, x, dx);
    }
    fn rate_of(&self, i: usize) -> Option<usize> {
        (i < self.positions).then_some(i + self.positions)
    }
    /// An evaluation in Python takes a thousand times as long as one of the core: this many take some 0.3 s.
    fn chatter_budget(&self) -> u64 {
        5_000
    }
}

impl Differentiable<f64> for Field {
    fn linearise(&mut self, t: f64, _: &f64, x: &[f64], dx: &mut [f64], j: &mut [f64]) {
        let n = x.len();
        self.slope(t, x, dx);
        let central = match &self.jacobian {
            Jacobian::Differences { central } => *central,
            Jacobian::Constant(matrix) => {
                for (j, m) in j.iter_mut().zip(matrix) {
                    *j = self.direction * m;
                }
                return;
            }
            Jacobian::Callable(jac) => {
                if self.error.is_some() {
                    j.fill(f64::NAN);
                    return;
                }
                let result = Python::attach(|py| {
                    let value = with(py, jac.bind(py), self.arguments.as_ref(), self.lists, self.direction * t, x)?;
                    matrix(py, self.function, &value, j, n)
                });
                if let Err(error) = result {
                    self.error = Some(error);
                    j.fill(f64::NAN);
                }
                for j in j.iter_mut() {
                    *j *= self.direction;
                }
                return;
            }
        };
        let [mut up, mut down, mut at] = [&mut self.up, &mut self.down, &mut self.at].map(std::mem::take);
        at.copy_from_slice(x);
        for k in 0..n {
            // Rounding and curvature balance; numbers below 1e-5 count as that, and the forward step is longer for numbers
            // below one, where the curvature is rarely on their scale (Hairer and Wanner's radau5.f).
            let size = x[k].abs().max(1e-5);
            let step = if central { f64::EPSILON.cbrt() * size } else { f64::EPSILON.sqrt() * size.max(size.sqrt()) };
            at[k] = x[k] + step;
            let above = at[k];
            self.slope(t, &at, &mut up);
            if central {
                at[k] = x[k] - step;
                self.slope(t, &at, &mut down);
            }
            let width = above - if central { at[k] } else { x[k] };
            let base: &[f64] = if central { &down } else { dx };
            for i in 0..n {
                j[i * n + k] = (up[i] - base[i]) / width;
            }
            at[k] = x[k];
        }
        (self.up, self.down, self.at) = (up, down, at);
    }

    /// Central: it looks beyond the ends of the span by the root of a rounding.
    fn time_derivative(&mut self, t: f64, _: &f64, x: &[f64], dft: &mut [f64]) {
        let step = (f64::EPSILON * t.abs().max(1e-5)).sqrt();
        let mut down = std::mem::take(&mut self.down);
        self.slope(t + step, x, dft);
        self.slope(t - step, x, &mut down);
        let width = (t + step) - (t - step);
        for (up, down) in dft.iter_mut().zip(&down) {
            *up = (*up - down) / width;
        }
        self.down = down;
    }

    fn stopped(&mut self) -> bool {
        if self.error.is_none() {
            self.error = Python::attach(|py| py.check_signals()).err();
        }
        self.error.is_some()
    }
}
