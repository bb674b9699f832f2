//! `simulate` and `simulate_batch`: arguments to a problem, records to a dictionary of arrays.

use crate::arrays::{any_vector, count, number, numbers, object, optional_number, require_finite, shown, text, vector};
use crate::errors::{Failure, entry, input_error};
use crate::law::{Law, RigidArm};
use armlet_core::dynamics::PlanarPr;
use armlet_core::law::LawSpec;
use armlet_core::simulate::{self as core, Keep, Method, Options, Problem, Times};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple};
use std::sync::atomic::AtomicBool;

/// Steps that take less than the time between two looks at the keyboard: run where the caller stands.
const SHORT: f64 = 100_000.0;

/// One object, or a list of them.
fn several<'py, T: pyo3::PyClass>(
    function: &str,
    name: &str,
    expected: &str,
    value: &Bound<'py, PyAny>,
) -> Result<Vec<Bound<'py, T>>, Failure> {
    let items: Vec<Bound<'py, PyAny>> = if value.is_instance_of::<PyList>() || value.is_instance_of::<PyTuple>() {
        value.try_iter()?.collect::<PyResult<_>>()?
    } else {
        vec![value.clone()]
    };
    if items.is_empty() {
        return Err(input_error(value.py(), function, name, format!("is empty: expected {expected}, got []")).into());
    }
    let wrong = |item: &Bound<'py, PyAny>, i: usize| -> Failure {
        let problem = format!(
            "is of the wrong type: expected {expected}, got {} (first bad index {i})",
            item.get_type().name().map(|name| name.to_string()).unwrap_or_default()
        );
        input_error(value.py(), function, name, problem).into()
    };
    items.iter().enumerate().map(|(i, item)| item.cast::<T>().cloned().map_err(|_| wrong(item, i))).collect()
}

/// How to run it, as Python gives it.
struct Given<'a, 'py> {
    t_end: &'a Bound<'py, PyAny>,
    dt: Option<&'a Bound<'py, PyAny>>,
    method: &'a Bound<'py, PyAny>,
    rtol: &'a Bound<'py, PyAny>,
    atol: &'a Bound<'py, PyAny>,
    sample_time: Option<&'a Bound<'py, PyAny>>,
    record_every: &'a Bound<'py, PyAny>,
    t_eval: Option<&'a Bound<'py, PyAny>>,
    tau_max: Option<&'a Bound<'py, PyAny>>,
    monitors: bool,
}

impl Given<'_, '_> {
    fn options(&self, function: &str, n: usize) -> Result<Options, Failure> {
        let py = self.t_end.py();
        let every = count(function, "record_every", self.record_every)?;
        let times = match self.t_eval {
            Some(t_eval) => Times::At(any_vector(function, "t_eval", t_eval)?),
            None => Times::Every(every),
        };
        let tau_max = match self.tau_max {
            None => None,
            Some(value) => {
                let (shape, values) = numbers(function, "tau_max", value)?;
                match shape.as_slice() {
                    [] => Some(vec![values[0]; n]),
                    [rows] if *rows == n => Some(values.into_owned()),
                    _ => {
                        let problem = format!("has the wrong shape: expected a scalar or ({n},), got {}", shown(&shape));
                        return Err(input_error(py, function, "tau_max", problem).into());
                    }
                }
            }
        };
        let method = Method::from_name(&text(function, "method", self.method)?)?;
        let [t_end, rtol, atol] =
            [("t_end", self.t_end), ("rtol", self.rtol), ("atol", self.atol)].map(|(name, x)| number(function, name, x));
        let dt = optional_number(function, "dt", self.dt)?;
        let sample_time = optional_number(function, "sample_time", self.sample_time)?;
        Ok(Options { t_end: t_end?, dt, method, rtol: rtol?, atol: atol?, sample_time, times, tau_max, monitors: self.monitors })
    }
}

fn put<'py>(fields: &Bound<'py, PyDict>, name: &str, values: Vec<f64>, shape: &[usize]) -> Result<(), Failure> {
    use numpy::PyArrayMethods;
    let array = PyArray1::from_vec(fields.py(), values).reshape(shape.to_vec())?;
    Ok(fields.set_item(name, array)?)
}

/// The rows of `q0` or `v0`: `(n,)` for one run, `(B, n)` for a batch.
fn single_state(function: &str, name: &str, value: Option<&Bound<'_, PyAny>>, n: usize) -> Result<Vec<f64>, Failure> {
    value.map_or_else(|| Ok(vec![0.0; n]), |value| vector(function, name, value, n))
}

/// One run as a dictionary of its fields.
#[pyfunction]
#[pyo3(signature = (plant, law, q0, v0, t_end, dt, method, rtol, atol, sample_time, record_every, t_eval, tau_max, monitors))]
pub fn simulate<'py>(
    py: Python<'py>,
    plant: &Bound<'py, PyAny>,
    law: &Bound<'py, PyAny>,
    q0: &Bound<'py, PyAny>,
    v0: Option<&Bound<'py, PyAny>>,
    t_end: &Bound<'py, PyAny>,
    dt: Option<&Bound<'py, PyAny>>,
    method: &Bound<'py, PyAny>,
    rtol: &Bound<'py, PyAny>,
    atol: &Bound<'py, PyAny>,
    sample_time: Option<&Bound<'py, PyAny>>,
    record_every: &Bound<'py, PyAny>,
    t_eval: Option<&Bound<'py, PyAny>>,
    tau_max: Option<&Bound<'py, PyAny>>,
    monitors: bool,
) -> PyResult<Bound<'py, PyDict>> {
    const NAME: &str = "simulate";
    entry(py, NAME, || {
        let plant = object::<RigidArm>(NAME, "plant", "a plant such as RigidArm", plant)?;
        let law = object::<Law>(NAME, "law", "a law such as Adaptive", law)?;
        let n = Problem::DOF;
        let options = Given { t_end, dt, method, rtol, atol, sample_time, record_every, t_eval, tau_max, monitors }.options(NAME, n)?;
        let arm = plant.get().arm.get().model.planar_pr()?;
        let problem = Problem {
            plants: vec![&arm],
            laws: vec![&law.get().spec],
            q0: vector(NAME, "q0", q0, n)?,
            v0: single_state(NAME, "v0", v0, n)?,
            options,
        };
        let given = &problem.options;
        let short = given.dt.or(given.sample_time).is_some_and(|dt| given.t_end / dt < SHORT) && !given.method.is_adaptive();
        let mut signal = None;
        let run = if short {
            py.detach(|| core::simulate(&problem, &AtomicBool::new(false)))
        } else {
            let mut poll = listen(&mut signal);
            py.detach(|| core::on_worker(&mut poll, |stop| core::simulate(&problem, stop)))
        }?;
        if let Some(signal) = signal {
            return Err(Failure::Python(signal));
        }
        let (k, p) = (run.t.len(), run.z.len() / run.t.len().max(1));
        let fields = PyDict::new(py);
        put(&fields, "t", run.t, &[k])?;
        put(&fields, "q", run.q, &[k, n])?;
        put(&fields, "v", run.v, &[k, n])?;
        put(&fields, "tau", run.tau, &[k, n])?;
        if !law.get().spec.initial_state().is_empty() {
            put(&fields, "estimate", run.z, &[k, p])?;
        }
        let series = PyDict::new(py);
        for (name, values) in run.monitors {
            put(&series, name, values, &[k])?;
        }
        fields.set_item("monitors", series)?;
        fields.set_item("status", run.status.code())?;
        fields.set_item("ended", run.ended)?;
        let stats = PyDict::new(py);
        stats.set_item("evaluations", run.evaluations)?;
        stats.set_item("steps", run.steps)?;
        stats.set_item("rejections", run.rejections)?;
        fields.set_item("stats", stats)?;
        Ok(fields)
    })
}

/// Look for Ctrl-C: what it raised is kept, and the work is told to stop.
pub fn listen(signal: &mut Option<PyErr>) -> impl FnMut() -> bool + '_ {
    move || {
        if signal.is_none() {
            *signal = Python::attach(|py| py.check_signals()).err();
        }
        signal.is_some()
    }
}

/// A batch as a dictionary of its fields.
#[pyfunction]
#[pyo3(signature = (plant, law, q0, v0, t_end, dt, method, rtol, atol, sample_time, record_every, t_eval, tau_max, monitors, threads, keep))]
pub fn simulate_batch<'py>(
    py: Python<'py>,
    plant: &Bound<'py, PyAny>,
    law: &Bound<'py, PyAny>,
    q0: &Bound<'py, PyAny>,
    v0: Option<&Bound<'py, PyAny>>,
    t_end: &Bound<'py, PyAny>,
    dt: Option<&Bound<'py, PyAny>>,
    method: &Bound<'py, PyAny>,
    rtol: &Bound<'py, PyAny>,
    atol: &Bound<'py, PyAny>,
    sample_time: Option<&Bound<'py, PyAny>>,
    record_every: &Bound<'py, PyAny>,
    t_eval: Option<&Bound<'py, PyAny>>,
    tau_max: Option<&Bound<'py, PyAny>>,
    monitors: bool,
    threads: Option<&Bound<'py, PyAny>>,
    keep: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyDict>> {
    const NAME: &str = "simulate_batch";
    entry(py, NAME, || {
        let plants = several::<RigidArm>(NAME, "plant", "a plant such as RigidArm, or a list of them", plant)?;
        let laws = several::<Law>(NAME, "law", "a law such as Adaptive, or a list of them", law)?;
        let n = Problem::DOF;
        let keep = match text(NAME, "keep", keep)?.as_str() {
            "all" => Keep::All,
            "final" => Keep::Final,
            other => {
                let problem = format!("is unknown: expected one of all, final, got {other}");
                return Err(input_error(py, NAME, "keep", problem).into());
            }
        };
        let threads = match threads {
            Some(threads) => count(NAME, "threads", threads)?,
            None => core::default_threads(),
        };
        let (rows, q0) = batch_rows(NAME, "q0", q0, n)?;
        let v0 = match v0 {
            None => vec![0.0; q0.len()],
            Some(v0) => {
                let (given, values) = batch_rows(NAME, "v0", v0, n)?;
                if given != rows {
                    let problem = format!("has the wrong shape: expected ({rows}, {n}), got ({given}, {n})");
                    return Err(input_error(py, NAME, "v0", problem).into());
                }
                values
            }
        };
        let options = Given { t_end, dt, method, rtol, atol, sample_time, record_every, t_eval, tau_max, monitors }.options(NAME, n)?;
        let models: Vec<PlanarPr<f64>> = plants.iter().map(|plant| plant.get().arm.get().model.planar_pr()).collect::<Result<_, _>>()?;
        let arms: Vec<&PlanarPr<f64>> = models.iter().collect();
        let specs: Vec<&LawSpec> = laws.iter().map(|law| &law.get().spec).collect();
        let stateful = !specs[0].initial_state().is_empty();
        let problem = Problem { plants: arms, laws: specs, q0, v0, options };
        let mut signal = None;
        let mut poll = listen(&mut signal);
        let batch = py.detach(|| core::simulate_batch(&problem, keep, threads, &mut poll))?;
        drop(poll);
        if let Some(signal) = signal {
            return Err(Failure::Python(signal));
        }
        let k = batch.t.len();
        let p = problem.laws[0].initial_state().len();
        let fields = PyDict::new(py);
        put(&fields, "t", batch.t, &[k])?;
        put(&fields, "q", batch.q, &[rows, k, n])?;
        put(&fields, "v", batch.v, &[rows, k, n])?;
        put(&fields, "tau", batch.tau, &[rows, k, n])?;
        if stateful {
            put(&fields, "estimate", batch.z, &[rows, k, p])?;
        }
        let series = PyDict::new(py);
        for (name, values) in batch.monitors {
            put(&series, name, values, &[rows, k])?;
        }
        fields.set_item("monitors", series)?;
        let status: Vec<i64> = batch.status.iter().map(|s| i64::from(s.code())).collect();
        fields.set_item("status", PyArray1::from_vec(py, status))?;
        put(&fields, "ended", batch.ended, &[rows])?;
        Ok(fields)
    })
}

/// `(B, n)` initial states, copied; too many to hold is a `MemoryError` at once.
fn batch_rows(function: &str, name: &str, value: &Bound<'_, PyAny>, n: usize) -> Result<(usize, Vec<f64>), Failure> {
    let py = value.py();
    if let Ok(shape) = value.getattr("shape").and_then(|shape| shape.extract::<Vec<usize>>())
        && let [rows, _] = shape.as_slice()
        && *rows as u128 * n as u128 * 8 > isize::MAX as u128 / 64
    {
        return Err(armlet_core::error::Error::Memory { bytes: *rows as u128 * n as u128 * 8 }.into());
    }
    let (shape, values) = numbers(function, name, value)?;
    if shape.len() != 2 || shape[1] != n {
        return Err(input_error(py, function, name, format!("has the wrong shape: expected (B, {n}), got {}", shown(&shape))).into());
    }
    require_finite(py, function, name, &shape, &values)?;
    Ok((shape[0], values.into_owned()))
}

/// How the extension was built and what it chose at run time.
#[pyfunction]
pub fn build_info(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    use armlet_core::scalar;
    let info = PyDict::new(py);
    info.set_item("version", env!("CARGO_PKG_VERSION"))?;
    info.set_item("profile", if cfg!(debug_assertions) { "debug" } else { "release" })?;
    info.set_item("instruction_set", scalar::isa().name())?;
    info.set_item("best_instruction_set", scalar::Isa::best().name())?;
    info.set_item("lanes", core::lanes())?;
    info.set_item("threads", core::default_threads())?;
    Ok(info)
}

/// Code, name and advice of every status.
#[pyfunction]
pub fn statuses(py: Python<'_>) -> PyResult<Bound<'_, PyList>> {
    use armlet_core::status::Status;
    PyList::new(py, Status::ALL.map(|s| (s.code(), s.name(), s.advice())))
}
