//! The class that advances a Python callable step by step. The `OdeSolver` classes of `scipy_method` use it.

use super::field::Field;
use super::jacobian::Jacobian;
use super::settings::{Settings, Stepping};
use super::slope::{Slope, States};
use crate::arrays::{any_vector, copied, flag, number, require_finite};
use crate::errors::{Failure, input_error};
use crate::properties::properties;
use armlet_core::integrate::solve::node;
use armlet_core::memory;
use armlet_macros::entered;
use pyo3::prelude::*;

/// An initial-value problem during its integration.
#[pyclass(module = "armlet._core")]
pub struct Stepper {
    field: Field,
    method: Stepping,
    direction: f64,
}

properties!(Stepper {
    t: f64 = |stepper| stepper.direction * stepper.method.t();
    /// The number of evaluations of `f`. As in scipy, it excludes evaluations for difference quotients.
    evaluations: u64 = |stepper| stepper.field.slope.evaluations - stepper.field.differenced;
    jacobians: u64 = |stepper| stepper.field.jacobians;
    factorisations: u64 = |stepper| stepper.method.work().factorisations;
});

#[entered]
#[pymethods]
impl Stepper {
    #[new]
    #[arguments(f, t0, y0, t_bound, method, rtol, atol, max_step, first_step, jac, jac_sparsity, vectorized)]
    fn new<'py>(
        max_step: Option<&Bound<'py, PyAny>>,
        first_step: Option<&Bound<'py, PyAny>>,
        jac: Option<&Bound<'py, PyAny>>,
        jac_sparsity: Option<&Bound<'py, PyAny>>,
    ) -> Result<Self, Failure> {
        const NAME: &str = "scipy_method";
        let span = [number(NAME, "t0", t0)?, number(NAME, "t_bound", t_bound)?];
        require_finite(py, NAME, "t0", &[], &span[..1])?;
        if span[1].is_nan() {
            return Err(input_error(py, NAME, "t_bound", "is not a time: expected a number or infinity, got nan").into());
        }
        let states = if flag(NAME, "vectorized", vectorized)? { States::Columns } else { States::Array };
        let y0 = any_vector(NAME, "y0", y0)?;
        let n = y0.len();
        let direction = if span[1] < span[0] { -1.0 } else { 1.0 };
        let (start, end) = (direction * span[0], direction * span[1]);
        let settings = Settings::new(NAME, n, method, [rtol, atol], [None, max_step, first_step], end - start)?;
        settings.require_memory(py, NAME, 0.0, n, states)?;
        let jacobian = Jacobian::new(NAME, jac, jac_sparsity, n, states, settings.method)?;
        let slope = Slope::new(NAME, f.clone().unbind(), None, states, direction);
        let field = Field::new(slope, jacobian, (start, end), 0, n);
        let (mut field, mut method) = settings.stepping(NAME, py, field, y0, 0)?;
        let begun = method.begin(&mut field, start, end, end);
        if let Some(error) = field.slope.error.take() {
            return Err(Failure::Python(error));
        }
        if begun.is_err() {
            let problem = "is not finite at the start: expected finite slopes, got NaN or infinity";
            return Err(input_error(py, NAME, "fun", problem).into());
        }
        Ok(Stepper { field, method, direction })
    }

    /// Advance by one accepted step, and return the code of its status.
    fn step(&mut self) -> Result<i32, Failure> {
        const NAME: &str = "scipy_method";
        let result = self.method.step(&mut self.field);
        if let Some(error) = self.field.slope.error.take() {
            return Err(Failure::Python(error));
        }
        Ok(result.err().map_or(0, |status| status.code()))
    }

    #[getter]
    fn y<'py>(&self) -> Result<Bound<'py, PyAny>, Failure> {
        const NAME: &str = "scipy_method";
        copied(py, &[self.method.x().len()], self.method.x())
    }

    /// The polynomial of the last step: its values at its nodes, `(degree + 1, n)`.
    fn nodes<'py>(&mut self) -> Result<Bound<'py, PyAny>, Failure> {
        const NAME: &str = "scipy_method";
        let (degree, n) = (self.method.dense_degree(), self.method.x().len());
        let (t_old, t) = (self.method.t_old(), self.method.t());
        let mut at = memory::copied(self.method.x())?;
        let mut values = memory::reserved((degree + 1) * n)?;
        for k in 0..=degree {
            let s = if k == degree { t } else { t_old + node(k, degree) * (t - t_old) };
            self.method.interpolate(&mut self.field, s, &mut at);
            values.extend_from_slice(&at);
        }
        if let Some(error) = self.field.slope.error.take() {
            return Err(Failure::Python(error));
        }
        copied(py, &[degree + 1, n], &values)
    }
}
