//! One method on one callable, a step at a time: what `scipy_method` builds its `OdeSolver` on.

use super::field::Field;
use super::{Method, Settings, filled, initial_state, jacobian};
use crate::arrays::{number, require_finite};
use crate::errors::{Failure, entry, input_error};
use armlet_core::integrate::solve::node;
use armlet_macros::entered;
use pyo3::prelude::*;

/// An initial-value problem under way.
#[pyclass(module = "armlet._core")]
pub struct Stepper {
    field: Field,
    method: Method,
    direction: f64,
}

#[entered]
#[pymethods]
impl Stepper {
    #[new]
    #[pyo3(signature = (f, t0, y0, t_bound, method, rtol, atol, max_step, first_step, jac))]
    fn new<'py>(
        f: &Bound<'py, PyAny>,
        t0: &Bound<'py, PyAny>,
        y0: &Bound<'py, PyAny>,
        t_bound: &Bound<'py, PyAny>,
        method: &Bound<'py, PyAny>,
        rtol: &Bound<'py, PyAny>,
        atol: &Bound<'py, PyAny>,
        max_step: Option<&Bound<'py, PyAny>>,
        first_step: Option<&Bound<'py, PyAny>>,
        jac: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Self> {
        const NAME: &str = "scipy_method";
        let py = f.py();
        entry(py, NAME, || {
            let span = [number(NAME, "t0", t0)?, number(NAME, "t_bound", t_bound)?];
            require_finite(py, NAME, "t_bound", &[2], &span)?;
            let y0 = initial_state(NAME, "y0", y0)?;
            let n = y0.len();
            let settings = Settings::new(NAME, n, method, rtol, atol, None, max_step, first_step)?;
            settings.require_room(py, NAME, 0.0, n)?;
            let direction = if span[1] < span[0] { -1.0 } else { 1.0 };
            let jacobian = jacobian(NAME, jac, n, settings.central())?;
            let mut field = Field::new(NAME, f.clone().unbind(), None, false, jacobian, direction, 0, n);
            let mut method = settings.method(NAME, py, &field, y0, 0)?;
            let end = direction * span[1];
            let begun = method.begin(&mut field, direction * span[0], end, end);
            if let Some(error) = field.error.take() {
                return Err(Failure::Python(error));
            }
            if begun.is_err() {
                let problem = "is not finite at the start: expected finite slopes, got NaN or infinity";
                return Err(input_error(py, NAME, "fun", problem).into());
            }
            Ok(Stepper { field, method, direction })
        })
    }

    /// One accepted step: the code of its status.
    fn step(&mut self, py: Python<'_>) -> PyResult<i32> {
        entry(py, "scipy_method", || {
            let result = self.method.step(&mut self.field);
            if let Some(error) = self.field.error.take() {
                return Err(Failure::Python(error));
            }
            Ok(result.err().map_or(0, |status| status.code()))
        })
    }

    #[getter]
    fn t(&self) -> f64 {
        self.direction * self.method.t()
    }

    #[getter]
    fn y<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        entry(py, "scipy_method", || filled(py, &[self.method.x().len()], self.method.x()))
    }

    /// The polynomial of the last step, by its values at its nodes, `(degree + 1, n)`.
    fn nodes<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        entry(py, "scipy_method", || {
            let (degree, n) = (self.method.dense_degree(), self.method.x().len());
            let (t_old, t) = (self.method.t_old(), self.method.t());
            let mut at = self.method.x().clone();
            let mut values = Vec::with_capacity((degree + 1) * n);
            for k in 0..=degree {
                let s = if k == degree { t } else { t_old + node(k, degree) * (t - t_old) };
                self.method.interpolate(&mut self.field, s, &mut at);
                values.extend_from_slice(&at);
            }
            if let Some(error) = self.field.error.take() {
                return Err(Failure::Python(error));
            }
            filled(py, &[degree + 1, n], &values)
        })
    }

    #[getter]
    fn evaluations(&self) -> u64 {
        self.field.evaluations
    }
    #[getter]
    fn jacobians(&self) -> u64 {
        self.method.work().jacobians
    }
    #[getter]
    fn factorisations(&self) -> u64 {
        self.method.work().factorisations
    }
}
