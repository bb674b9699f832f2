//! What is asked of a method: its name, tolerances and steps, checked before anything is made.

use super::field::Field;
use super::slope::States;
use crate::arrays::{Axis, Form, SCALAR, numbers, optional_number, require_finite, spread, text};
use crate::errors::{Failure, input_error};
use armlet_core::integrate::{
    Adaptive, Dop853, Dopri5, Euler, FixedStep, Radau5, Rk4, Rodas4, Ros2, SemiImplicit, Steps, Tolerances, Work,
};
use armlet_core::memory;
use pyo3::prelude::*;

pub type AdaptiveMethod = Box<dyn Adaptive<f64, Field, Vec<f64>> + Send + Sync>;

const ADAPTIVE: [&str; 4] = ["dopri5", "dop853", "radau5", "rodas4"];
const FIXED: [&str; 4] = ["euler", "semi_implicit", "rk4", "ros2"];
const IMPLICIT: [&str; 3] = ["radau5", "rodas4", "ros2"];
/// More steps than this is a mistake in the arguments, not a run.
const MOST_STEPS: f64 = 1e12;
/// Matrices of an implicit method: the Jacobian, and the largest decomposition, which is complex with its copies.
const MATRICES: u128 = 8;
/// Vectors of a method with the most stages: its own, those of the field, and those that Python is handed.
const VECTORS: u128 = 32;
/// The same of the others.
const FEW_VECTORS: u128 = 16;
/// Matrices of states whose columns go to a vectorised `f` together, and of their slopes.
const COLUMNS: u128 = 5;

/// How a method is to run, as Python gives it.
pub struct Settings {
    name: String,
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
        rtol: &Bound<'py, PyAny>,
        atol: &Bound<'py, PyAny>,
        dt: Option<&Bound<'py, PyAny>>,
        max_step: Option<&Bound<'py, PyAny>>,
        first_step: Option<&Bound<'py, PyAny>>,
        span: f64,
    ) -> Result<Self, Failure> {
        let py = method.py();
        let refuse = |name: &str, problem: String| Failure::from(input_error(py, function, name, problem));
        let name = text(function, "method", method)?;
        let known = [FIXED, ADAPTIVE].concat();
        if !known.contains(&name.as_str()) {
            return Err(refuse("method", format!("is unknown: expected one of {}, got {name}", known.join(", "))));
        }
        let positive = |argument: &str, value: Option<&Bound<'py, PyAny>>| match optional_number(function, argument, value)? {
            // No limit, as scipy writes it.
            Some(x) if x == f64::INFINITY && argument == "max_step" => Ok(None),
            Some(x) if !(x > 0.0 && x.is_finite()) => {
                Err(refuse(argument, format!("is not positive: expected a finite number > 0, got {x}")))
            }
            other => Ok(other),
        };
        let (dt, max_step, first_step) = (positive("dt", dt)?, positive("max_step", max_step)?, positive("first_step", first_step)?);
        if dt.is_none() && FIXED.contains(&name.as_str()) {
            return Err(refuse("dt", format!("is missing: expected a step for {name}, got None")));
        }
        if dt.is_some() && ADAPTIVE.contains(&name.as_str()) {
            return Err(refuse("dt", format!("is given: expected None, as {name} chooses its steps (max_step limits them), got a number")));
        }
        if let Some(h) = first_step.filter(|&h| h > span && ADAPTIVE.contains(&name.as_str())) {
            return Err(refuse("first_step", format!("is longer than the span: expected at most {span}, got {h}")));
        }
        // Below this the error of a step is rounding.
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
        Ok(Settings { name, tolerances: Tolerances { rtol, atol }, dt, max_step, first_step })
    }

    /// Refuse steps too short for the span, and states too large for the memory, before anything is made.
    pub fn require_memory(&self, py: Python<'_>, function: &str, span: f64, n: usize, states: States) -> Result<(), Failure> {
        if let Some(dt) = self.dt.filter(|dt| span / dt > MOST_STEPS) {
            let problem = format!("is too small for the span: expected at least {}, got {dt}", span / MOST_STEPS);
            return Err(input_error(py, function, "dt", problem).into());
        }
        let matrices = MATRICES + if states == States::Columns { COLUMNS } else { 0 };
        let matrices = if self.implicit() { matrices * (n as u128).pow(2) } else { 0 };
        let vectors = n as u128 * if self.name == "dop853" || self.implicit() { VECTORS } else { FEW_VECTORS };
        Ok(memory::require(usize::try_from(8 * (matrices + vectors)).unwrap_or(usize::MAX))?)
    }

    pub fn adaptive(&self) -> bool {
        ADAPTIVE.contains(&self.name.as_str())
    }

    /// Whether the method takes derivatives at all.
    pub fn implicit(&self) -> bool {
        IMPLICIT.contains(&self.name.as_str())
    }

    /// Whether the method's order rests on its derivatives.
    pub fn central(&self) -> bool {
        self.name == "rodas4"
    }

    pub fn method(&self, function: &str, py: Python<'_>, field: &Field, y: Vec<f64>, positions: usize) -> Result<AdaptiveMethod, Failure> {
        let n = y.len();
        let (matrix, pivots) = if self.implicit() { (vec![0.0; n * n], vec![0; n]) } else { Default::default() };
        let tolerances = self.tolerances.clone();
        let h = self.dt.unwrap_or(1.0);
        let mut method: AdaptiveMethod = match self.name.as_str() {
            "dopri5" => Box::new(Dopri5::new(tolerances, y, 0.0)),
            "dop853" => Box::new(Dop853::new(tolerances, y, 0.0)),
            "radau5" => Box::new(Radau5::new(tolerances, y, 0.0)),
            "rodas4" => Box::new(Rodas4::new(tolerances, y, matrix, pivots, 0.0)),
            "euler" => fixed(Euler::new(y.clone(), 0.0), h, y),
            "rk4" => fixed(Rk4::new(y.clone(), 0.0), h, y),
            "ros2" => fixed(Ros2::new(y.clone(), matrix, pivots, 0.0), h, y),
            _ => {
                if positions == 0 || 2 * positions > n {
                    let problem = format!(
                        "is {positions} of {n} components: expected the number p of positions, y = [q (p,), v (p,), rest], for semi_implicit"
                    );
                    return Err(input_error(py, function, "positions", problem).into());
                }
                let method = SemiImplicit::new::<f64, Field>(field, y.clone(), 0.0)?;
                fixed(if field.slope.direction < 0.0 { method.backwards() } else { method }, h, y)
            }
        };
        if let Some(h) = self.max_step {
            method.limit_step(h);
        }
        if let Some(h) = self.first_step {
            method.first_step(h);
        }
        Ok(method)
    }
}

fn fixed<M: FixedStep<f64, Field, Vec<f64>> + Send + Sync + 'static>(method: M, h: f64, y: Vec<f64>) -> AdaptiveMethod {
    // The field itself counts its evaluations.
    Box::new(Steps::new(method, h, Work::default(), y, 0.0))
}

/// A tolerance of each of `n` components, from one number or `n`.
fn of_each(function: &str, name: &str, value: &Bound<'_, PyAny>, n: usize) -> Result<Vec<f64>, Failure> {
    let (shape, values) = numbers(function, name, value, &[SCALAR, Form(&[Axis::Is(n)])])?;
    require_finite(value.py(), function, name, &shape, &values)?;
    spread(&shape, values, n)
}
