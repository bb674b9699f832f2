//! The limits of `armlet.time_path`, which are constant or vary along the path.
//!
//! A *knot* is a path position at which pieces of the path meet. A path of P pieces has P + 1 knots.

use crate::arm::ArmModel;
use crate::arrays::{ArrayArgument, Axis, Form, SCALAR, number, numbers, require_finite, require_no_nan, spread, text};
use crate::errors::{Failure, input_error};
use armlet_core::error::Error;
use armlet_core::motion::Path;
use armlet_core::plan::{PathLimits, TipLimits};
use pyo3::prelude::*;

pub const NAME: &str = "time_path";

/// The path along which limits may vary.
pub struct Along<'a> {
    pub path: &'a Path,
    /// For each waypoint, the index of its knot. It is empty for a callable path.
    pub knot: &'a [usize],
}

/// Lower and upper limits, `(n,)` each.
type Range = (Vec<f64>, Vec<f64>);

type Given<'a, 'py> = Option<&'a Bound<'py, PyAny>>;

/// Read a limit that is a scalar or `(n,)`, and return it as `(n,)`.
pub fn limit(name: &str, value: &Bound<'_, PyAny>, n: usize) -> Result<Vec<f64>, Failure> {
    let (shape, values) = numbers(NAME, name, value, &[SCALAR, Form(&[Axis::Is(n)])])?;
    require_finite(value.py(), NAME, name, &shape, &values)?;
    spread(&shape, values, n)
}

impl Along<'_> {
    /// Limits at the knots, `(P + 1, n)`, from limits at the waypoints. For repeated waypoints the smallest limit counts.
    fn at_knots(&self, values: &[f64], n: usize) -> Vec<f64> {
        let mut limits = vec![f64::INFINITY; self.path.knots().len() * n];
        for (row, knot) in values.chunks_exact(n).zip(self.knot) {
            row.iter().zip(&mut limits[knot * n..(knot + 1) * n]).for_each(|(value, limit)| *limit = limit.min(*value));
        }
        limits
    }

    /// Limits at the knots, `(P + 1, n)`, from a Python function of the path position `s`.
    fn of_function(&self, name: &str, value: &Bound<'_, PyAny>, n: usize) -> Result<Vec<f64>, Failure> {
        let mut limits = Vec::with_capacity(self.path.knots().len() * n);
        for &s in self.path.knots() {
            limits.extend(limit(name, &value.call1((s,))?, n)?);
        }
        Ok(limits)
    }

    /// Read a limit. The result is `(n,)` for a constant, and `(P + 1, n)` for limits `(K, n)` at the waypoints or a function of `s`.
    fn limit(&self, name: &str, value: &Bound<'_, PyAny>, n: usize) -> Result<Vec<f64>, Failure> {
        if value.is_callable() {
            return self.of_function(name, value, n);
        }
        if self.knot.is_empty() {
            return limit(name, value, n);
        }
        let forms = [SCALAR, Form(&[Axis::Is(n)]), Form(&[Axis::Is(self.knot.len()), Axis::Is(n)])];
        let (shape, values) = numbers(NAME, name, value, &forms)?;
        require_finite(value.py(), NAME, name, &shape, &values)?;
        if shape.len() == 2 { Ok(self.at_knots(&values, n)) } else { spread(&shape, values, n) }
    }

    /// Read the lower and upper torque limits, N m or N. An array `(n, 2)` contains both. All other forms contain the upper limit, and the
    /// lower limit is its negative.
    fn torque(&self, model: &ArmModel, value: &Bound<'_, PyAny>) -> Result<Range, Failure> {
        let n = model.n();
        let py = value.py();
        let symmetric = |upper: Vec<f64>| (upper.iter().map(|x| -x).collect(), upper);
        if value.is_callable() {
            return Ok(symmetric(self.of_function("tau_max", value, n)?));
        }
        let forms = [SCALAR, Form(&[Axis::Is(n)]), Form(&[Axis::Is(n), Axis::Is(2)]), Form(&[Axis::Is(self.knot.len()), Axis::Is(n)])];
        let forms = if self.knot.is_empty() { &forms[..3] } else { &forms[..] };
        let (shape, values) = numbers(NAME, "tau_max", value, forms)?;
        require_finite(py, NAME, "tau_max", &shape, &values)?;
        if shape == [n, 2] {
            return Ok((values.chunks_exact(2).map(|row| row[0]).collect(), values.chunks_exact(2).map(|row| row[1]).collect()));
        }
        if shape.len() == 2 {
            return Ok(symmetric(self.at_knots(&values, n)));
        }
        let upper = spread(&shape, values, n)?;
        if let Some(k) = upper.iter().position(|x| !(*x > 0.0)) {
            let error = Error::input("tau_max", format!("is not positive: expected numbers > 0, got {}", upper[k]));
            return Err(if shape.is_empty() { error } else { model.core().name_limit(error.at([k])) }.into());
        }
        Ok(symmetric(upper))
    }

    /// Read all limits: `tau_max, v_max, a_max`, then `q_min, q_max`, then `tip_speed, tip_acceleration, frame`.
    pub fn limits(
        &self,
        model: &ArmModel,
        [tau_max, v_max, a_max]: [Given; 3],
        range: [Given; 2],
        tip: [Given; 3],
    ) -> Result<PathLimits, Failure> {
        let n = model.n();
        let of = |name: &str, value: Given| value.map(|value| self.limit(name, value, n)).transpose();
        Ok(PathLimits {
            torque: tau_max.map(|value| self.torque(model, value)).transpose()?,
            velocity: of("v_max", v_max)?,
            acceleration: of("a_max", a_max)?,
            position: positions(range, n)?,
            tip: self.tip_limits(model, tip)?,
        })
    }

    /// Read a limit of the frame. The result is `(1,)` for a number, and `(P + 1,)` for limits `(K,)` at the waypoints or a function of
    /// `s`.
    fn of_tip(&self, name: &str, value: &Bound<'_, PyAny>) -> Result<Vec<f64>, Failure> {
        if value.is_callable() {
            return self.path.knots().iter().map(|&s| number(NAME, name, &value.call1((s,))?)).collect();
        }
        if self.knot.is_empty() || ArrayArgument::new(NAME, name, value)?.shape.is_empty() {
            return Ok(vec![number(NAME, name, value)?]);
        }
        let (shape, values) = numbers(NAME, name, value, &[SCALAR, Form(&[Axis::Is(self.knot.len())])])?;
        require_finite(value.py(), NAME, name, &shape, &values)?;
        Ok(self.at_knots(&values, 1))
    }

    fn tip_limits(&self, model: &ArmModel, [speed, acceleration, frame]: [Given; 3]) -> Result<Option<TipLimits>, Failure> {
        let Some(given) = speed.or(acceleration) else {
            return match frame {
                None => Ok(None),
                Some(frame) => {
                    Err(input_error(frame.py(), NAME, "frame", "is not used: expected tip_speed= or tip_acceleration= with it").into())
                }
            };
        };
        let Some(frame) = frame else {
            let problem = "is missing: expected the name of the frame that tip_speed and tip_acceleration limit, got None";
            return Err(input_error(given.py(), NAME, "frame", problem).into());
        };
        let of = |name: &str, value: Given| value.map(|value| self.of_tip(name, value)).transpose();
        let (speed, acceleration) = (of("tip_speed", speed)?, of("tip_acceleration", acceleration)?);
        Ok(Some(TipLimits { frame: model.frame(&text(NAME, "frame", frame)?)?, speed, acceleration }))
    }
}

/// Read the position limits `q_min` and `q_max`. A missing limit is infinite.
fn positions(range: [Given; 2], n: usize) -> Result<Option<Range>, Failure> {
    if range.iter().all(Option::is_none) {
        return Ok(None);
    }
    let of = |name: &str, value: Given, without: f64| match value {
        None => Ok(vec![without; n]),
        Some(value) => {
            let (shape, values) = numbers(NAME, name, value, &[SCALAR, Form(&[Axis::Is(n)])])?;
            require_no_nan(value.py(), NAME, name, &shape, &values)?;
            spread(&shape, values, n)
        }
    };
    Ok(Some((of("q_min", range[0], f64::NEG_INFINITY)?, of("q_max", range[1], f64::INFINITY)?)))
}
