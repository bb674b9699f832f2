//! `armlet.Spline` and `armlet.Table.at`: motions through knots at their own times.

use crate::arrays::{Axis, Form, any_vector, copied, name, numbers, owned, require_finite};
use crate::errors::{Failure, input_error};
use crate::interrupts::long;
use crate::motion::{Motion, Table};
use armlet_core::motion::{self, Ends, Motion as Core};
use armlet_macros::entered;
use pyo3::prelude::*;

/// Read the end conditions of a spline.
pub fn ends(function: &str, value: Option<&Bound<'_, PyAny>>, default: Ends) -> Result<Ends, Failure> {
    let Some(value) = value else { return Ok(default) };
    match name(function, "spline", value)? {
        "natural" => Ok(Ends::Natural),
        "clamped" => Ok(Ends::Clamped),
        "not-a-knot" => Ok(Ends::NotAKnot),
        other => {
            let problem = format!("is unknown: expected one of \"natural\", \"clamped\", \"not-a-knot\", got {other:?}");
            Err(input_error(value.py(), function, "spline", problem).into())
        }
    }
}

/// A motion through knots at their own times, such as the points of a ROS `JointTrajectory`.
///
/// Between two knots the motion is a polynomial in time. Its degree depends on what the knots have:
///
/// ==============================================  ==================================================================
/// knots                                           motion
/// ==============================================  ==================================================================
/// positions                                       cubic spline: `q`, `v`, `a` are continuous
/// positions and velocities                        cubic Hermite polynomials: `q`, `v` are continuous, `a` jumps
/// positions, velocities and accelerations         quintic Hermite polynomials: `q`, `v`, `a` are continuous
/// ==============================================  ==================================================================
///
/// Before the first knot and after the last one, it rests at the position of that knot. With the default `spline="clamped"`, a motion
/// through positions alone starts and ends at rest, so that its velocity never jumps. At other jumps of `v` or `a`, integrators restart.
///
/// Args:
///     t: times of the knots, `(K,)`, s, `K >= 2`. They increase.
///     q: positions at the knots, `(K, n)`, rad or m.
///     v: velocities at the knots, `(K, n)`, rad/s or m/s; None if unknown.
///     a: accelerations at the knots, `(K, n)`, rad/s^2 or m/s^2; only with `v`.
///     spline: end conditions of a motion through positions alone: "clamped" (`v = 0`, the default), "natural" (`a = 0`) or
///         "not-a-knot" (keyword only). "not-a-knot" makes the jerk continuous at the second and the last but one knot.
///
/// Raises:
///     InputError: the times do not increase, a shape is wrong, a number is not finite, or an argument lacks its partner.
///
/// Source: [deBoor2001], chapter 4; [SicilianoEtAl2009], section 4.2.
///
/// >>> import armlet as al
/// >>> motion = al.Spline([0.0, 0.5, 2.0], [[0.0], [1.0], [1.0]], [[0.0], [1.0], [0.0]])
/// >>> q, v, a = motion([0.5, 9.0])
/// >>> q[:, 0], v[:, 0]
/// (array([1., 1.]), array([1., 0.]))
#[pyclass(frozen, extends = Motion, module = "armlet")]
pub struct Spline;

#[entered]
#[pymethods]
impl Spline {
    #[new]
    #[arguments(t, q, v=None, a=None, *, spline=None)]
    fn new() -> Result<PyClassInitializer<Self>, Failure> {
        Spline::read(NAME, [t, q], [v, a, spline])
    }
}

impl Spline {
    /// Read the arguments of the constructor: `t` and `q`, and the optional `v`, `a` and `spline`.
    pub fn read(
        function: &str,
        [t, q]: [&Bound<'_, PyAny>; 2],
        [v, a, spline]: [Option<&Bound<'_, PyAny>>; 3],
    ) -> Result<PyClassInitializer<Self>, Failure> {
        let py = t.py();
        let times = any_vector(function, "t", t)?;
        let mut shape = vec![];
        let mut columns = Vec::new();
        let mut arguments = vec![("t", copied(py, &[times.len()], &times)?)];
        for (name, value) in [("q", Some(q)), ("v", v), ("a", a)] {
            let Some(value) = value else { continue };
            let n = if let [_, n] = shape[..] { Axis::Is(n) } else { Axis::Any("n") };
            let (of, values) = numbers(function, name, value, &[Form(&[Axis::Is(times.len()), n])])?;
            require_finite(py, function, name, &of, &values)?;
            arguments.push((name, copied(py, &of, &values)?));
            columns.push((name, owned(values)?));
            shape = of;
        }
        if let (Some(value), true) = (spline, v.is_some()) {
            return Err(input_error(value.py(), function, "spline", "takes effect only without v: expected None with velocities").into());
        }
        let ends = ends(function, spline, Ends::Clamped)?;
        if let Some(value) = spline {
            arguments.push(("spline", value.clone()));
        }
        let n = shape[1];
        let column = |name: &str| columns.iter().find(|(of, _)| *of == name).map(|(_, values)| values.as_slice());
        let core = long(py, || motion::Spline::new(&times, column("q").unwrap_or_default(), column("v"), column("a"), n, ends))?;
        Ok(PyClassInitializer::from(Motion::new(Core::Spline(core), arguments)).add_subclass(Spline))
    }
}

#[entered]
#[pymethods]
impl Table {
    /// Make a motion through knots at uneven times: `armlet.Spline`, which describes the arguments.
    ///
    /// >>> import armlet as al
    /// >>> al.Table.at([0.0, 0.5, 2.0], [[0.0], [1.0], [1.0]], [[0.0], [1.0], [0.0]])(0.5)[1]
    /// array([1.])
    #[staticmethod]
    #[arguments(t, q, v=None, a=None, *, spline=None)]
    fn at() -> Result<Py<Spline>, Failure> {
        Ok(Py::new(py, Spline::read(NAME, [t, q], [v, a, spline])?)?)
    }
}
