//! The checked settings of an integration method: its name, tolerances and steps.

use super::field::Field;
use super::slope::States;
use crate::arrays::{Axis, Form, SCALAR, numbers, optional_number, require_finite, spread, text};
use crate::errors::{Failure, input_error};
use armlet_core::integrate::{Adaptive, FixedStep, Method, MethodKind, Steps, Tolerances, WithAdaptive, WithSteps, Work};
use armlet_core::memory;
use pyo3::prelude::*;

/// An integration method during a run on a [`Field`].
pub type Stepping = Box<dyn Adaptive<f64, Field, Vec<f64>> + Send + Sync>;

/// The largest number of steps of a run. More steps indicate an error in the arguments.
const MOST_STEPS: f64 = 1e12;
/// The number of `(n, n)` matrices in the memory estimate of an implicit method: the Jacobian, and complex decompositions with copies.
const MATRICES: u128 = 8;
/// The number of `(n,)` vectors in the memory estimate of an implicit method and of dop853, including vectors for calls of Python.
const VECTORS: u128 = 32;
/// The number of `(n,)` vectors in the memory estimate of another explicit method.
const FEW_VECTORS: u128 = 16;
/// The number of further matrices for a vectorised `f` and an implicit method. Their columns are states or right-hand sides.
const COLUMNS: u128 = 5;

/// The settings of a method, read from Python arguments.
pub struct Settings {
    pub method: Method,
    tolerances: Tolerances,
    dt: Option<f64>,
    max_step: Option<f64>,
    first_step: Option<f64>,
}

impl Settings {
    pub fn new<'py>(
        function: &str,
        n: usize,
        method: &Bound<'py, PyAny>,
        [rtol, atol]: [&Bound<'py, PyAny>; 2],
        [dt, max_step, first_step]: [Option<&Bound<'py, PyAny>>; 3],
        span: f64,
    ) -> Result<Self, Failure> {
        let py = method.py();
        let refuse = |name: &str, problem: String| Failure::from(input_error(py, function, name, problem));
        let method = Method::from_name(&text(function, "method", method)?, false)?;
        let (name, adaptive) = (method.name(), method.is_adaptive());
        let positive = |argument: &str, value: Option<&Bound<'py, PyAny>>| match optional_number(function, argument, value)? {
            // As in scipy, an infinite `max_step` means no limit.
            Some(x) if x == f64::INFINITY && argument == "max_step" => Ok(None),
            Some(x) if !(x > 0.0 && x.is_finite()) => {
                Err(refuse(argument, format!("is not positive: expected a finite number > 0, got {x}")))
            }
            other => Ok(other),
        };
        let (dt, max_step, first_step) = (positive("dt", dt)?, positive("max_step", max_step)?, positive("first_step", first_step)?);
        if dt.is_none() && !adaptive {
            return Err(refuse("dt", format!("is missing: expected a step for {name}, got None")));
        }
        if dt.is_some() && adaptive {
            return Err(refuse("dt", format!("is given: expected None, as {name} chooses its steps (max_step limits them), got a number")));
        }
        if let Some(h) = first_step.filter(|&h| h > span && adaptive) {
            return Err(refuse("first_step", format!("is longer than the span: expected at most {span}, got {h}")));
        }
        // With a smaller relative tolerance the rounding error of a step would exceed the tolerance.
        let least = 100.0 * f64::EPSILON;
        let rtol = of_each(function, "rtol", rtol, n)?;
        if let Some(i) = rtol.iter().position(|&x| !(x >= least)) {
            let problem = format!("is too small: expected finite numbers >= {least:.2e}, got {} (first bad index {i})", rtol[i]);
            return Err(refuse("rtol", problem));
        }
        let atol = of_each(function, "atol", atol, n)?;
        if let Some(i) = atol.iter().position(|&x| !(x >= 0.0)) {
            return Err(refuse("atol", format!("is negative: expected numbers >= 0, got {} (first bad index {i})", atol[i])));
        }
        Ok(Settings { method, tolerances: Tolerances { rtol, atol }, dt, max_step, first_step })
    }

    /// Refuse a step that is too short for the span, and states that need too much memory, before any memory is allocated.
    pub fn require_memory(&self, py: Python<'_>, function: &str, span: f64, n: usize, states: States) -> Result<(), Failure> {
        if let Some(dt) = self.dt.filter(|dt| span / dt > MOST_STEPS) {
            let problem = format!("is too small for the span: expected at least {}, got {dt}", span / MOST_STEPS);
            return Err(input_error(py, function, "dt", problem).into());
        }
        let matrices = MATRICES + if states == States::Columns { COLUMNS } else { 0 };
        let matrices = if self.method.is_implicit() { matrices * (n as u128).pow(2) } else { 0 };
        let vectors = n as u128 * if self.method == Method::Dop853 || self.method.is_implicit() { VECTORS } else { FEW_VECTORS };
        Ok(memory::require(usize::try_from(8 * (matrices + vectors)).unwrap_or(usize::MAX))?)
    }

    /// Start the method on `field` at the state `y`, and return the field with the method.
    pub fn stepping(
        &self,
        function: &str,
        py: Python<'_>,
        field: Field,
        y: Vec<f64>,
        positions: usize,
    ) -> Result<(Field, Stepping), Failure> {
        let n = y.len();
        if self.method == Method::SemiImplicit && (positions == 0 || 2 * positions > n) {
            let problem = format!(
                "is {positions} of {n} components: expected the number p of positions, y = [q (p,), v (p,), rest], for semi_implicit"
            );
            return Err(input_error(py, function, "positions", problem).into());
        }
        let tolerances = self.tolerances.clone();
        let by_steps = Driven(self.dt.unwrap_or(1.0));
        let (field, mut method) = match self.method.kind() {
            MethodKind::ExplicitSteps(method) => method.apply(field, y, 0.0, by_steps)?,
            MethodKind::ImplicitSteps(method) => method.apply(field, y, 0.0, by_steps),
            MethodKind::ExplicitAdaptive(method) => method.apply(field, tolerances, y, 0.0, Driven(0.0)),
            MethodKind::ImplicitAdaptive(method) => method.apply(field, tolerances, y, 0.0, Driven(0.0)),
        };
        if let Some(h) = self.max_step {
            method.limit_step(h);
        }
        if let Some(h) = self.first_step {
            method.first_step(h);
        }
        Ok((field, method))
    }
}

/// The constructor of a method on a field. The number is the step, s, of a method with fixed steps.
struct Driven(f64);

impl WithSteps<f64, Field> for Driven {
    type Output = (Field, Stepping);

    fn with<M: FixedStep<f64, Field, Vec<f64>> + Send + Sync + 'static>(self, field: Field, y: Vec<f64>, method: M) -> Self::Output {
        // The counters of the method start at zero, because the field counts the evaluations.
        (field, Box::new(Steps::new(method, self.0, Work::default(), y, 0.0)))
    }
}

impl WithAdaptive<f64, Field> for Driven {
    type Output = (Field, Stepping);

    fn with<M: Adaptive<f64, Field, Vec<f64>> + Send + Sync + 'static>(self, field: Field, method: M) -> Self::Output {
        (field, Box::new(method))
    }
}

/// Read a tolerance for each of `n` components: one number for all, or `(n,)`.
fn of_each(function: &str, name: &str, value: &Bound<'_, PyAny>, n: usize) -> Result<Vec<f64>, Failure> {
    let (shape, values) = numbers(function, name, value, &[SCALAR, Form(&[Axis::Is(n)])])?;
    require_finite(value.py(), function, name, &shape, &values)?;
    spread(&shape, values, n)
}
