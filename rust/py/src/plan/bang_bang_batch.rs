//! `armlet.bang_bang_time` for arrays of problems. Threads share the problems, and each SIMD register has numbers of several problems.

use super::bang_bang_report::BangBangReport;
use crate::arrays::{adopted, index_of, items, new_array, shown, signed, written_arrays};
use crate::broadcast::Columns;
use crate::errors::{Failure, entry, input_error};
use crate::interrupts::{Breaks, long, signalled};
use crate::seal::{Sealed, seal_call};
use armlet_core::error::Error;
use armlet_core::interrupt::{self, interrupt};
use armlet_core::{memory, parallel, plan};
use armlet_macros::entered;
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use pyo3::types::{PyString, PyTuple};

/// The results of `bang_bang_time` for arrays of problems: the fields of `BangBangReport` as arrays of the broadcast shape.
#[pyclass(frozen, module = "armlet", name = "BangBangBatch")]
pub struct BangBangBatch {
    problems: Columns<6>,
    /// Whether some duration satisfies the torque limits, in the broadcast shape.
    #[pyo3(get)]
    feasible: Py<PyAny>,
    /// Shortest durations, s; NaN if infeasible.
    #[pyo3(get)]
    t_min: Py<PyAny>,
    /// Longest durations, s; infinite if the motion may be arbitrarily slow, NaN if infeasible.
    #[pyo3(get)]
    t_max: Py<PyAny>,
    /// The smallest `inertia * A` that the limits allow, N m, with the magnitude `A` of the acceleration.
    #[pyo3(get)]
    a_min: Py<PyAny>,
    /// The largest `inertia * A` that the limits allow, N m, with the magnitude `A` of the acceleration.
    #[pyo3(get)]
    a_max: Py<PyAny>,
    /// Whether the torque can hold the link at rest at the start.
    #[pyo3(get)]
    hold_start: Py<PyAny>,
    /// Whether the torque can hold the link at rest at the end.
    #[pyo3(get)]
    hold_end: Py<PyAny>,
    /// The number of feasible problems.
    solved: usize,
}

/// The largest number of problems that a thread solves between two checks for Ctrl-C.
pub(super) const CHUNK: usize = 1 << 13;

/// The largest number of problems for one thread.
const FEW: usize = 2 * CHUNK;

/// The size of a result in bytes: four numbers and three flags.
pub(super) const ANSWER: usize = 4 * 8 + 3;

/// The largest number of axes of an index, as in numpy.
const MOST_AXES: usize = 64;

/// Add the index of a problem of a batch to its error.
fn refused(py: Python<'_>, function: &str, shape: &[usize], i: usize, error: Error) -> Failure {
    match (error.argument(), error.problem()) {
        (Some(argument), Some(problem)) => {
            input_error(py, function, argument, format!("{problem} (first bad index {})", index_of(shape, i))).into()
        }
        _ => error.into(),
    }
}

/// The index of the first problem of a part, and slices of the four number columns and the three flag columns of the results.
type Part<'a> = (usize, ([&'a mut [f64]; 4], [&'a mut [bool]; 3]));

/// Split columns of equal length into parts of [`CHUNK`] entries.
fn chunks<T, const K: usize>(columns: [&mut [T]; K]) -> impl Iterator<Item = [&mut [T]; K]> {
    let mut columns = columns.map(|column| column.chunks_mut(CHUNK));
    std::iter::from_fn(move || {
        let parts = columns.each_mut().map(|parts| parts.next().unwrap_or_default());
        (!parts[0].is_empty()).then_some(parts)
    })
}

impl BangBangBatch {
    pub(super) fn solve(py: Python<'_>, problems: Columns<6>) -> Result<Self, Failure> {
        let n = problems.count;
        let shape = &problems.shape;
        let mut flags: [Vec<bool>; 3] = [memory::untouched(n)?, memory::untouched(n)?, memory::untouched(n)?];
        let column = |k: usize, start: usize, end: usize| {
            let column = problems.column(k);
            if column.len() == 1 { column } else { &column[start..end] }
        };
        let [t_min, t_max, a_min, a_max] = written_arrays(py, shape, |mut times| {
            let work = |(start, (numbers, flags)): Part| {
                interrupt::check();
                let end = start + flags[0].len();
                // The planner takes `tau_min` before `tau_max`.
                let columns = [0, 1, 2, 3, 5, 4].map(|k| column(k, start, end));
                plan::bang_bang_times(columns, plan::BangBangTimes { numbers, flags }).map_err(|(i, error)| (start + i, error))
            };
            let solved = long(py, || {
                let (times, flags) = (chunks(times.each_mut().map(|x| &mut **x)), chunks(flags.each_mut().map(|x| &mut x[..])));
                let mut parts = (0..n).step_by(CHUNK).zip(times.zip(flags));
                if n <= FEW {
                    return Ok(parts.try_for_each(work));
                }
                let said = parallel::pieces(parallel::default_threads(), &mut signalled, parts.collect(), work);
                Ok(said.unwrap_or_else(|_| interrupt()).into_iter().collect())
            })?;
            solved.map_err(|(i, error)| refused(py, "bang_bang_time", shape, i, error))?;
            Ok(())
        })?
        .map(Bound::unbind);
        let solved = flags[0].iter().filter(|&&f| f).count();
        let [feasible, hold_start, hold_end] = flags;
        let flag = |x: Vec<bool>| Ok::<_, Failure>(adopted(py, shape, x)?.unbind());
        Ok(BangBangBatch {
            feasible: flag(feasible)?,
            hold_start: flag(hold_start)?,
            hold_end: flag(hold_end)?,
            t_min,
            t_max,
            a_min,
            a_max,
            solved,
            problems,
        })
    }

    /// Solve problem `i`, in C order, and return its report.
    fn report(&self, i: usize) -> Result<BangBangReport, Error> {
        BangBangReport::solve(self.problems.row(i))
    }
}

#[entered]
#[pymethods]
impl BangBangBatch {
    /// The common shape of the arguments after broadcasting.
    #[getter]
    fn shape<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, &self.problems.shape)
    }

    /// An array of strings with the `BangBangReport.reason` of each problem, which is empty where a duration is feasible.
    #[getter]
    fn reason<'py>(&self) -> Result<Bound<'py, PyAny>, Failure> {
        let numpy = py.import("numpy")?;
        let mut breaks = Breaks::new();
        let parts = (0..self.problems.count.max(1)).step_by(CHUNK).map(|first| {
            breaks.pause(py)?;
            let last = (first + CHUNK).min(self.problems.count);
            let words = (first..last).map(|i| Ok(self.report(i)?.why())).collect::<Result<Vec<_>, Error>>()?;
            Ok(numpy.call_method1("array", (words, PyString::new(py, "str")))?)
        });
        let words = numpy.call_method1("concatenate", (parts.collect::<Result<Vec<_>, Failure>>()?,))?;
        Ok(words.call_method1("reshape", (PyTuple::new(py, &self.problems.shape)?,))?)
    }

    /// The report of one problem. The index is an integer in C order, or one integer for each axis.
    fn __getitem__(&self, index: &Bound<'_, PyAny>) -> Result<BangBangReport, Failure> {
        const NAME: &str = "BangBangBatch";
        let what = "an index: expected an integer, or one for each axis";
        let parts = match index.cast::<PyTuple>() {
            Ok(parts) => items(NAME, "index", what, parts, MOST_AXES)?,
            Err(_) => vec![index.clone()],
        };
        let shape: &[usize] = if parts.len() == 1 { &[self.problems.count] } else { &self.problems.shape };
        let mut flat = Some(0).filter(|_| parts.len() == shape.len());
        for (part, &n) in parts.iter().zip(shape) {
            let i = signed(part).ok_or_else(|| input_error(py, NAME, "index", format!("is not {what}, got {}", part.get_type())))?;
            let inside = if i < 0 { i.saturating_add_unsigned(n) } else { i };
            flat = flat.filter(|_| inside >= 0 && inside < n as isize).map(|k| k * n + inside as usize);
        }
        let outside = || PyIndexError::new_err(format!("BangBangBatch: index is out of range: expected one in shape {}", shown(shape)));
        Ok(self.report(flat.ok_or_else(outside)?)?)
    }

    fn __repr__(&self) -> String {
        format!("BangBangBatch({} problems of shape {}, {} feasible)", self.problems.count, shown(&self.problems.shape), self.solved)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Sealed<'py>> {
        let shape = &self.problems.shape;
        let mut columns = Vec::new();
        for k in 0..6 {
            let column = self.problems.column(k);
            // The first column is stored with the full shape. Another column with one number for all problems is stored as this number.
            let full = k == 0 || column.len() != 1;
            let axes: &[usize] = if full { shape } else { &[] };
            let fill = |out: &mut [f64]| {
                if column.len() == out.len() {
                    out.copy_from_slice(column)
                } else {
                    out.fill(column[0])
                }
                Ok(())
            };
            columns.push(entry(py, "BangBangBatch", || new_array(py, axes, fill))?);
        }
        seal_call(py, "_restore_plan", ("bang_bang_time", PyTuple::new(py, columns)?).into_pyobject(py)?)
    }
}
