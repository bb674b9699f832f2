//! `armlet.Motion` and its subclasses: desired motions as functions of time.

use crate::arrays::{
    ArrayArgument, Axis, Form, SCALAR, any_vector, copied, elements, new_vector, nonnegative_integer, number, numbers, optional_number,
    owned, require_finite, spread, vector, written_array, written_arrays,
};
use crate::constructor_call::{NamedValues, constructor_repr, defined_by_arguments};
use crate::errors::{Failure, entry, input_error};
use crate::interrupts::long;
use armlet_core::error::Error;
use armlet_core::interrupt;
use armlet_core::memory;
use armlet_core::motion::{self, Motion as Core};
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::types::{PyFloat, PyInt};

/// A desired motion: `motion(t)` returns `q_d, v_d, a_d`, each `(n,)`. This is the base class of all motions.
#[pyclass(frozen, subclass, module = "armlet", name = "Motion")]
pub struct Motion {
    pub core: Core,
    /// The arguments of the constructor, for `repr` and pickling.
    arguments: NamedValues,
}

defined_by_arguments!(Motion);

impl Motion {
    pub fn new(core: Core, arguments: Vec<(&'static str, Bound<'_, PyAny>)>) -> Self {
        Motion { core, arguments: arguments.into_iter().map(|(name, value)| (name, value.unbind())).collect() }
    }
}

/// Positions, velocities and accelerations.
pub type Triple<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>);

/// The number of times that are evaluated between two checks for Ctrl-C.
const CHECK_INTERVAL: usize = 1 << 8;

/// Read finite numbers, and return their shape and a copy. Check that there is memory for `width` numbers of results for each.
fn finite_array(function: &str, name: &str, x: &Bound<'_, PyAny>, width: usize) -> Result<(Vec<usize>, Vec<f64>), Failure> {
    let array = ArrayArgument::new(function, name, x)?;
    memory::require(elements(&array.shape)?.saturating_mul(8 * (1 + width)))?;
    let (shape, values) = array.values()?;
    // Use a copy, because other threads may write to the caller's array during the evaluation.
    let values = owned(values)?;
    require_finite(x.py(), function, name, &shape, &values)?;
    Ok((shape, values))
}

/// Evaluate a motion at every number of `x`, and return three arrays `(..., n)`. `write(index, x, row)` writes a row of `3 n` numbers.
pub fn rows<'py>(
    n: usize,
    function: &str,
    name: &str,
    x: &Bound<'py, PyAny>,
    write: impl Fn(usize, f64, &mut [f64]) -> Result<(), Error> + Sync,
) -> Result<Triple<'py>, Failure> {
    let py = x.py();
    let (mut shape, values) = finite_array(function, name, x, 3 * n)?;
    shape.push(n);
    let [q, v, a] = written_arrays(py, &shape, |[q, v, a]| {
        long(py, || {
            let mut row = vec![0.0; 3 * n];
            let outs = q.chunks_exact_mut(n).zip(v.chunks_exact_mut(n)).zip(a.chunks_exact_mut(n));
            for (i, (x, ((q, v), a))) in values.iter().zip(outs).enumerate() {
                if i % CHECK_INTERVAL == 0 {
                    interrupt::check();
                }
                write(i, *x, &mut row)?;
                q.copy_from_slice(&row[..n]);
                v.copy_from_slice(&row[n..2 * n]);
                a.copy_from_slice(&row[2 * n..]);
            }
            Ok(())
        })
    })?;
    Ok((q, v, a))
}

#[entered]
#[pymethods]
impl Motion {
    /// Number of coordinates.
    #[getter]
    fn n(&self) -> usize {
        self.core.dof()
    }

    /// Compute `q_d, v_d, a_d` at the time `t` in s: each `(n,)` for a number, and `(..., n)` for an array of times.
    fn __call__<'py>(&self, t: &Bound<'py, PyAny>) -> Result<Triple<'py>, Failure> {
        const NAME: &str = "Motion";
        let plain = t.is_instance_of::<PyFloat>() || t.is_instance_of::<PyInt>();
        if !plain && !ArrayArgument::new(NAME, "t", t)?.shape.is_empty() {
            return rows(self.core.dof(), NAME, "t", t, |_, t, row| {
                self.core.sample(t, row);
                Ok(())
            });
        }
        let t = number(NAME, "t", t)?;
        require_finite(py, NAME, "t", &[], &[t])?;
        let n = self.core.dof();
        let mut all = armlet_core::memory::zeros(3 * n)?;
        self.core.sample(t, &mut all);
        let part = |k: usize| {
            new_vector(py, n, |out| {
                out.copy_from_slice(&all[k * n..(k + 1) * n]);
                Ok(())
            })
        };
        Ok((part(0)?, part(1)?, part(2)?))
    }

    /// Compute the position and its derivatives with respect to time at the time `t`, for feed-forward on elastic joints.
    ///
    /// The derivatives are velocity, acceleration, jerk and snap. Where the jerk or the snap jumps, the result is the value after the jump.
    /// They jump at the ends of a `Quintic`, at the knots of a `Table`, and at the knots and grid points of a `TimedPath`. The snap does not
    /// contain the impulses at jumps of the jerk. At the end of a `Table` or `TimedPath`, the result is that of its last interval.
    ///
    /// Args:
    ///     t: time, s, or an array of times.
    ///     order: the highest derivative, 0 to 4; at most 2 if the acceleration jumps, as in `BangBang` and most results of `time_path`.
    ///
    /// Returns:
    ///     Rows of position, velocity, acceleration, .., `(order + 1, n)`; `(..., order + 1, n)` for an array of times.
    ///
    /// Raises:
    ///     InputError: a time is not finite, or the motion does not have the derivatives.
    ///     SolveError: the motion is a path without a timing.
    ///
    /// >>> import armlet as al
    /// >>> al.Quintic([0.0], [1.0], 1.0).derivatives(0.5, 4)[:, 0]
    /// array([  0.5  ,   1.875,   0.   , -30.   ,   0.   ])
    fn derivatives<'py>(&self, t: &Bound<'py, PyAny>, order: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Failure> {
        let (n, order) = (self.core.dof(), nonnegative_integer(NAME, "order", order)?);
        self.core.require_derivatives(order)?;
        let width = (order + 1) * n;
        let (mut shape, times) = finite_array(NAME, "t", t, width)?;
        shape.extend([order + 1, n]);
        written_array(py, &shape, |out| {
            long(py, || {
                let mut values = memory::zeros(motion::DERIVATIVES * n)?;
                for (i, (&t, rows)) in times.iter().zip(out.chunks_exact_mut(width)).enumerate() {
                    if i % CHECK_INTERVAL == 0 {
                        interrupt::check();
                    }
                    self.core.write_derivatives(t, &mut values);
                    rows.copy_from_slice(&values[..width]);
                }
                Ok(())
            })
        })
    }

    fn __repr__(slf: &Bound<'_, Self>) -> PyResult<String> {
        constructor_repr(slf.as_any(), None, &slf.get().arguments)
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Motion>().is_ok_and(|other| other.get().core == self.core)
    }
}

/// A constant position `q`, `(n,)`, rad or m.
///
/// >>> import armlet as al
/// >>> al.Hold([1.0, 0.0])(2.0)[0]
/// array([1., 0.])
#[pyclass(frozen, extends = Motion, module = "armlet")]
pub struct Hold;

#[entered]
#[pymethods]
impl Hold {
    #[new]
    fn new(q: &Bound<'_, PyAny>) -> Result<PyClassInitializer<Self>, Failure> {
        let q = any_vector(NAME, "q", q)?;
        let arguments = vec![("q", copied(py, &[q.len()], &q)?)];
        Ok(PyClassInitializer::from(Motion::new(long(py, || Core::hold(q))?, arguments)).add_subclass(Hold))
    }
}

/// Read a scalar, `(n,)` or `(n, terms)`, and return the number of terms with the numbers `(n, terms)`.
fn terms(function: &str, name: &str, value: &Bound<'_, PyAny>, n: usize) -> Result<(usize, Vec<f64>), Failure> {
    let forms = [SCALAR, Form(&[Axis::Is(n)]), Form(&[Axis::Is(n), Axis::Any("k")])];
    let (shape, values) = numbers(function, name, value, &forms)?;
    require_finite(value.py(), function, name, &shape, &values)?;
    Ok((shape.get(1).copied().unwrap_or(1), spread(&shape, values, n)?))
}

/// A sum of sinusoids for each joint: `q_d = offset + sum amplitude sin(frequency t + phase)`.
///
/// Args:
///     offset: centre of the motion, `(n,)`, rad or m.
///     amplitude, frequency, phase: rad or m, rad/s, and rad: `(n,)`, `(n, k)` for k terms per joint, or one number for all. Zeros are
///         allowed.
///
/// Raises:
///     InputError: a shape is wrong, or a number is not finite.
///
/// Source: docs/plants_and_laws.md.
///
/// >>> import armlet as al
/// >>> q_d, v_d, a_d = al.Sinusoid([0.0], [0.5], [2.0], [0.0])(0.0)
/// >>> v_d
/// array([1.])
#[pyclass(frozen, subclass, extends = Motion, module = "armlet")]
pub struct Sinusoid;

#[entered]
#[pymethods]
impl Sinusoid {
    #[new]
    #[arguments(offset, amplitude, frequency, phase)]
    fn new() -> Result<PyClassInitializer<Self>, Failure> {
        let offset = any_vector(NAME, "offset", offset)?;
        let n = offset.len();
        let named = [("amplitude", amplitude), ("frequency", frequency), ("phase", phase)];
        let mut parts = Vec::new();
        for (name, value) in named {
            parts.push(terms(NAME, name, value, n)?);
        }
        let count = parts.iter().map(|(terms, _)| *terms).max().unwrap_or(1);
        let mut arguments = vec![("offset", copied(py, &[n], &offset)?)];
        for (k, (name, value)) in named.into_iter().enumerate() {
            if parts[k].0 == 1 && count > 1 {
                let given = std::mem::take(&mut parts[k].1);
                let terms = n.saturating_mul(count);
                parts[k].1 = memory::collected((0..terms).map(|term| given[term / count]))?;
                parts[k].0 = count;
            }
            if parts[k].0 != count {
                let problem = format!("has the wrong number of terms: expected {count}, got {}", parts[k].0);
                return Err(input_error(value.py(), NAME, name, problem).into());
            }
            arguments.push((name, copied(py, &[n, count], &parts[k].1)?));
        }
        let [(_, amplitude), (_, frequency), (_, phase)] = <[_; 3]>::try_from(parts).expect("three parts");
        let core = long(py, || motion::Sinusoid::new(offset, count, amplitude, frequency, phase))?;
        Ok(PyClassInitializer::from(Motion::new(Core::Sinusoid(core), arguments)).add_subclass(Sinusoid))
    }
}

macro_rules! rest_to_rest {
    ($name:ident, $doc:literal) => {
        #[doc = $doc]
        ///
        /// The motion holds `q0` before time 0 and `q1` after `duration`.
        ///
        /// Args:
        ///     q0, q1: start and end, `(n,)`, rad or m.
        ///     duration: duration of the motion, s, > 0.
        ///
        /// Raises:
        ///     InputError: a shape is wrong, a number is not finite, or `duration` is not positive.
        ///
        /// Source: [SicilianoEtAl2009], section 4.2.
        ///
        /// >>> import armlet as al
        /// >>> al.Quintic([0.0], [1.0], 2.0)(1.0)[0], al.BangBang([0.0], [1.0], 2.0)(1.0)[0]
        /// (array([0.5]), array([0.5]))
        #[pyclass(frozen, extends = Motion, module = "armlet")]
        pub struct $name;

        #[entered]
        #[pymethods]
        impl $name {
            #[new]
            fn new(q0: &Bound<'_, PyAny>, q1: &Bound<'_, PyAny>, duration: &Bound<'_, PyAny>) -> PyResult<PyClassInitializer<Self>> {
                const NAME: &str = stringify!($name);
                let py = q0.py();
                entry(py, NAME, || {
                    let duration = number(NAME, "duration", duration)?;
                    let q0 = any_vector(NAME, "q0", q0)?;
                    let n = q0.len();
                    let q1 = vector(NAME, "q1", q1, n)?;
                    let seconds = duration.into_pyobject(py).map_err(PyErr::from)?.into_any();
                    let arguments = vec![("q0", copied(py, &[n], &q0)?), ("q1", copied(py, &[n], &q1)?), ("duration", seconds)];
                    let core = motion::$name::new(q0, q1, duration)?;
                    Ok(PyClassInitializer::from(Motion::new(Core::$name(core), arguments)).add_subclass($name))
                })
            }
        }
    };
}
rest_to_rest!(Quintic, "Rest-to-rest motion `q0 + s (q1 - q0)` with `s = 10 x^3 - 15 x^4 + 6 x^5` and `x = t / duration`.");
rest_to_rest!(BangBang, "Rest-to-rest motion with the symmetric bang-bang acceleration `+-4 (q1 - q0) / duration^2`.");

/// A motion through samples at the times `start + k dt`, the *knots*.
///
/// The motion has the positions `q`, the velocities `v` and the accelerations `a` at the knots, and is a quintic Hermite polynomial between
/// them. Before the first knot and after the last one, it rests at the position of that knot. `Table.at` accepts uneven times.
///
/// Args:
///     dt: time between two knots, s, > 0.
///     q, v, a: positions, velocities and accelerations at the knots, `(K, n)` each, rad or m, per s and per s^2.
///     start: time of the first knot, s; zero if None (keyword only).
///
/// Raises:
///     InputError: `dt` is not positive, a shape is wrong, or a number is not finite.
///
/// Source: [SicilianoEtAl2009], section 4.2; docs/plants_and_laws.md.
///
/// >>> import armlet as al
/// >>> table = al.Table(0.5, [[0.0], [1.0]], [[0.0], [0.0]], [[0.0], [0.0]])
/// >>> table(0.25)[0]
/// array([0.5])
#[pyclass(frozen, extends = Motion, module = "armlet")]
pub struct Table;

#[entered]
#[pymethods]
impl Table {
    #[new]
    #[arguments(dt, q, v, a, *, start=None)]
    fn new() -> Result<PyClassInitializer<Self>, Failure> {
        let dt = number(NAME, "dt", dt)?;
        let start = optional_number(NAME, "start", start)?.unwrap_or(0.0);
        let mut columns = Vec::new();
        let mut knots = vec![];
        for (name, value) in [("q", q), ("v", v), ("a", a)] {
            let axes: [Axis<'_>; 2] = if let [k, n] = knots[..] { [Axis::Is(k), Axis::Is(n)] } else { [Axis::Any("K"), Axis::Any("n")] };
            let (shape, values) = numbers(NAME, name, value, &[Form(&axes)])?;
            require_finite(py, NAME, name, &shape, &values)?;
            knots = shape;
            columns.push(values);
        }
        let n = knots[1];
        let object = |x: f64| -> Result<Bound<'_, PyAny>, Failure> { Ok(x.into_pyobject(py).map_err(PyErr::from)?.into_any()) };
        let arguments = vec![
            ("dt", object(dt)?),
            ("q", copied(py, &knots, &columns[0])?),
            ("v", copied(py, &knots, &columns[1])?),
            ("a", copied(py, &knots, &columns[2])?),
            ("start", object(start)?),
        ];
        let columns: Vec<Vec<f64>> = columns.into_iter().map(owned).collect::<Result<_, _>>()?;
        let core = long(py, || motion::Table::of_columns(start, dt, n, [&columns[0], &columns[1], &columns[2]]))?;
        Ok(PyClassInitializer::from(Motion::new(Core::Table(core), arguments)).add_subclass(Table))
    }
}
